//! The machine of touches that are known in the part frame only: their table does not say which machine made them.

use crate::chain::Chain;

/// Name of the machine, in its URDF.
const NAME: &str = "probecell_part_frame";

/// URDF of a machine that is the part frame: `X`, `Y`, `Z` carry the ball along the directions of the part frame, which does not
/// move. They are no axes of a machine, so that no effect of an axis or link is sought in its sessions.
pub const PART_FRAME_MACHINE: &str = r#"<?xml version="1.0"?>
<!-- No machine: the axes X, Y and Z are the directions of the part frame, in which the touches are known. m. -->
<robot name="probecell_part_frame">
  <link name="foundation"/>
  <link name="workpiece"/>
  <joint name="clamping" type="fixed">
    <parent link="foundation"/><child link="workpiece"/>
    <origin xyz="0 0 0" rpy="0 0 0"/>
  </joint>
  <link name="X_link"/>
  <joint name="X" type="prismatic">
    <parent link="foundation"/><child link="X_link"/>
    <origin xyz="0 0 0" rpy="0 0 0"/>
    <axis xyz="1 0 0"/>
    <limit lower="-100" upper="100" effort="0" velocity="1"/>
  </joint>
  <link name="Y_link"/>
  <joint name="Y" type="prismatic">
    <parent link="X_link"/><child link="Y_link"/>
    <origin xyz="0 0 0" rpy="0 0 0"/>
    <axis xyz="0 1 0"/>
    <limit lower="-100" upper="100" effort="0" velocity="1"/>
  </joint>
  <link name="probe_mount"/>
  <joint name="Z" type="prismatic">
    <parent link="Y_link"/><child link="probe_mount"/>
    <origin xyz="0 0 0" rpy="0 0 0"/>
    <axis xyz="0 0 1"/>
    <limit lower="-100" upper="100" effort="0" velocity="1"/>
  </joint>
</robot>
"#;

/// Whether a machine is [`PART_FRAME_MACHINE`].
pub fn is_part_frame(chain: &Chain) -> bool {
    chain.name() == NAME
}
