//! Robot descriptions that come with the project, as text of `launch-scripts`.

/// Five axes, WCBXFZYSt: rotary table B and C under the part (`docs/source_systems.md, D`).
pub const WCBXFZYST: &str = include_str!("../../../launch-scripts/wcbxfzyst.urdf");

/// Five axes, XFYZBA: swivel head B and A above the part (`docs/source_systems.md, E`).
pub const XFYZBA: &str = include_str!("../../../launch-scripts/xfyzba.urdf");
