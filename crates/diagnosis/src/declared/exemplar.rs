//! The table on which the library is offered to a declared effect: a machine that shows everything.
//!
//! What the library fixes from a session's rows (the middle of the travel, the longest overhang) it fixes here from the
//! declared constants, so that the variant predicts what was once fitted, whatever the next session visits. Nothing is
//! measured on it. Metres, radians, seconds.

use machine::{Chain, Nominal, Surface};
use nalgebra::{Isometry3, Point3, Vector3};

use super::DeclaredEffect;
use crate::observation::{Observations, Pose, Row};

/// Half the travel where the effect names none, m or rad.
const HALF: f64 = 1.0;
/// Touches at the ends of the travels, and between them.
const ENDS: usize = 4;
const BETWEEN: usize = 12;
/// Longest overhang, or greatest height along the tool, where the effect names none, m.
const LENGTH: f64 = 0.1;

/// Touches at either end of every axis, by the declared tool and by another, and at places between: some effects are
/// offered only where an axis visits enough of them.
pub(super) fn table(chain: &Chain, effect: &DeclaredEffect) -> Observations {
    let constant = |name: &str, usual: f64| effect.value(name).unwrap_or(usual);
    let (mid, half) = (constant("mid", 0.0), constant("half", HALF));
    let tool = constant("tool", 1.0).clamp(0.0, f64::from(u32::MAX - 1)) as u32;
    let (length, height) = (constant("length", LENGTH), constant("height", LENGTH));
    let part_pose = Isometry3::identity();
    let (ball, normal) = (Point3::origin(), Vector3::z_axis());
    let row = |number: usize| {
        let high = number % 2 == 1;
        let along = match number.checked_sub(ENDS) {
            None if high => 1.0,
            None => -1.0,
            Some(place) => 2.0 * (place + 1) as f64 / (BETWEEN + 1) as f64 - 1.0,
        };
        let at = mid + along * half;
        let positions = vec![at; chain.axes().len()];
        let of_end = |end: f64| if high { end } else { 0.0 };
        Row {
            point: number,
            feature: 0,
            sequence: Some(number as u64),
            index: 0,
            time: number as f64,
            feed: 0.01,
            position: ball,
            normal: normal.into_inner(),
            surface: Surface::Plane(ball, normal),
            pose: Some(Pose {
                latched: positions.clone(),
                sensitivity: chain.sensitivity(&positions, &part_pose, &ball),
                speeds: vec![0.0; positions.len()],
                positions,
            }),
            cut: None,
            warmth: Some(1.0),
            tool: Some(if number < 2 { tool } else { tool + 1 }),
            cut_length: 1.0,
            tool_height: of_end(height),
            overhang: of_end(length),
            weight: 1.0,
        }
    };
    Observations {
        chain: chain.clone(),
        nominal: Nominal {
            part_pose,
            ball,
            ball_radius: 0.0,
            points: vec![(ball, normal)],
            surfaces: vec![Surface::Plane(ball, normal)],
        },
        rows: (0..ENDS + BETWEEN).map(row).collect(),
        deviations: vec![0.0; ENDS + BETWEEN],
        declared: Vec::new(),
        features: vec![String::new()],
        cut_here: false,
        prescribed: Vec::new(),
        grid: None,
        reference_uncertainty: 0.0,
        skipped: Vec::new(),
    }
}
