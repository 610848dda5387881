//! Parts one after the other: touches round a block, of a machine whose deviations are written down by hand: a ball that is too
//! small gives a constant, a part that has moved its shift along the normal. Nothing of the library makes them.

use diagnosis::Session;
use probecell_msgs::{InspectionFeature, InspectionPlan, InspectionPoint, ProbeEvent};

const MACHINE: &str = include_str!("machines/three_axes.urdf");
/// m.
const BALL: f64 = 1e-3;

/// Standard deviations of a touch, and of each coordinate of the clamping from part to part, m.
#[derive(Clone, Copy)]
pub(crate) struct Scatter {
    pub(crate) touch: f64,
    pub(crate) clamping: f64,
}

/// Numbers of a small generator (Steele, Lea and Flood 2014).
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    /// Uniform, 0 to 1.
    pub(crate) fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64
    }

    /// Box and Muller 1958.
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.share().max(1e-300).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.share()).cos()
    }
}

/// Normals and places of the touches: five on each side and on top of a block.
pub(crate) fn touches() -> Vec<([f64; 3], [f64; 3])> {
    let mut touches = Vec::new();
    for k in 0..5 {
        let along = -0.04 + 0.02 * f64::from(k);
        let deep = -0.005 - 0.004 * f64::from(k % 3);
        touches.push(([1.0, 0.0, 0.0], [0.05, along, deep]));
        touches.push(([-1.0, 0.0, 0.0], [-0.05, along, deep]));
        touches.push(([0.0, 1.0, 0.0], [along, 0.05, deep]));
        touches.push(([0.0, -1.0, 0.0], [along, -0.05, deep]));
        touches.push(([0.0, 0.0, 1.0], [along, 0.7 * along, 0.0]));
    }
    touches
}

/// What has begun displaces the reading of a touch along its normal (m), by that normal and its place.
pub(crate) type Begun<'a> = &'a dyn Fn([f64; 3], [f64; 3]) -> f64;

/// A measured part.
pub(crate) fn part(
    number: u64,
    random: &mut Numbers,
    scatter: Scatter,
    begun: Begun<'_>,
) -> Session {
    let clamping = [0; 3].map(|_| scatter.clamping * random.normal());
    let mut plan = InspectionPlan {
        plan_id: format!("part {number}/measure"),
        ..InspectionPlan::default()
    };
    plan.part_pose.orientation.w = 1.0;
    plan.stylus.ball_radius = BALL;
    let mut events = Vec::new();
    for (index, (normal, place)) in touches().into_iter().enumerate() {
        let side = normal.map(f64::abs).iter().position(|n| *n > 0.5).unwrap() * 2
            + usize::from(normal.iter().sum::<f64>() > 0.0);
        if plan.features.len() <= side {
            plan.features.resize_with(side + 1, || {
                let mut feature = InspectionFeature::default();
                feature.axis.z = 1.0;
                feature
            });
        }
        let feature = &mut plan.features[side];
        feature.id = format!("side {side}");
        (feature.axis.x, feature.axis.y, feature.axis.z) = (normal[0], normal[1], normal[2]);
        (feature.origin.x, feature.origin.y, feature.origin.z) = (place[0], place[1], place[2]);
        let mut point = InspectionPoint {
            feature: side as u32,
            approach_distance: 3e-3,
            retract_distance: 3e-3,
            feed: 5e-3,
            operation: -1,
            ..InspectionPoint::default()
        };
        (point.position.x, point.position.y, point.position.z) = (place[0], place[1], place[2]);
        (point.normal.x, point.normal.y, point.normal.z) = (normal[0], normal[1], normal[2]);
        plan.points.push(point);
        let along: f64 = normal
            .iter()
            .zip(clamping)
            .map(|(n, shift)| n * shift)
            .sum();
        let deviation = along + begun(normal, place) + scatter.touch * random.normal();
        let mut event = ProbeEvent {
            sequence: index as u64,
            plan_id: plan.plan_id.clone(),
            point_index: index as u32,
            outcome: ProbeEvent::OUTCOME_TOUCHED,
            axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
            axis_positions: (0..3)
                .map(|axis| place[axis] + normal[axis] * (BALL + deviation))
                .collect(),
            feed: 5e-3,
            ..ProbeEvent::default()
        };
        (event.approach.x, event.approach.y, event.approach.z) =
            (-normal[0], -normal[1], -normal[2]);
        event.header.stamp.sec = (1000 + 600 * number) as i32 + index as i32;
        events.push(event);
    }
    Session {
        name: "live".to_owned(),
        robot_description: MACHINE.to_owned(),
        plan: Some(plan),
        events,
        ..Session::default()
    }
}
