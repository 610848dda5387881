//! The seven patterns of D.3 on a block of 120 × 120 mm whose top lies 150 mm above the crossing of B and C.

use nalgebra::{Point3, Unit, Vector3};

/// Axes of the standard patterns' indices.
pub const ROTARY: [&str; 2] = ["B", "C"];

/// The eight link errors of WCBXFZYSt in the source's order, with the sizes of its sensitivity table (rad, m).
pub const LINKS: [(&str, f64); 8] = [
    ("EA0B", 50e-6),
    ("EC0B", 50e-6),
    ("EX0C", 20e-6),
    ("EA0C", 50e-6),
    ("EB0C", 50e-6),
    ("EB0Z", 50e-6),
    ("EA0Y", 50e-6),
    ("EC0Y", 50e-6),
];

/// How a pattern is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PatternKind {
    /// Both halves with the same tool axis in the part: floor and lateral direction.
    Slot,
    /// Floor and wall, one half end-milled, the other flank-milled with a perpendicular tool axis.
    Step,
}

/// One test pattern.
#[derive(Debug, Clone)]
pub struct Pattern {
    /// Its name.
    pub id: String,
    /// How it is cut.
    pub kind: PatternKind,
    /// Where its halves meet, part frame, m.
    pub point: Point3<f64>,
    /// Positions of the rotary axes for the first and second half, rad.
    pub indices: [Vec<f64>; 2],
    /// Directions in which the step between the halves is measured (a, b), part frame.
    pub directions: [Unit<Vector3<f64>>; 2],
}

/// The patterns P1 to P7 of D.3, for axes [`ROTARY`].
pub fn standard_patterns() -> Vec<Pattern> {
    use PatternKind::{Slot, Step};
    let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
    let pattern = |id: &str, kind, point: [f64; 3], indices: [[f64; 2]; 2], directions| Pattern {
        id: id.to_owned(),
        kind,
        point: Point3::from(Vector3::from(point) * 1e-3),
        indices: indices.map(|index| index.map(f64::to_radians).to_vec()),
        directions,
    };
    vec![
        pattern("P1", Slot, [50., 50., 150.], [[0., 0.], [0., 180.]], [z, y]),
        pattern("P2", Slot, [-50., 50., 150.], [[0., 0.], [0., 90.]], [z, x]),
        pattern(
            "P3",
            Slot,
            [50., -50., 150.],
            [[0., 90.], [0., 180.]],
            [z, x],
        ),
        pattern(
            "P4",
            Slot,
            [40., 60., 130.],
            [[90., 90.], [-90., 270.]],
            [y, x],
        ),
        pattern(
            "P5",
            Slot,
            [-60., -40., 90.],
            [[90., 0.], [-90., 180.]],
            [-x, z],
        ),
        pattern(
            "P6",
            Step,
            [-60., 40., 150.],
            [[-90., 180.], [0., 180.]],
            [-x, z],
        ),
        pattern(
            "P7",
            Step,
            [-60., 60., 110.],
            [[-90., 270.], [90., 0.]],
            [y, -x],
        ),
    ]
}
