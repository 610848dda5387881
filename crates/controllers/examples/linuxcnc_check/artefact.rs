//! Plans for the artefacts of the simulated machine, and the moves that touch them.
//!
//! The stylus is declared with its ball centre at the axes' zero, so joint positions are positions of the ball centre.

use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MeasurementOrder, ProbingMove, Stylus,
    geometry_msgs::{Point, Pose, Quaternion, Vector3},
};

/// Nominal ball radius, m.
pub(crate) const BALL: f64 = 3e-3;
/// Nominal radius of the bore, m.
pub(crate) const BORE: f64 = 25e-3;
/// Half sizes of the box, m.
pub(crate) const BOX: [f64; 3] = [25e-3, 15e-3, 10e-3];
/// m, from the start of the probing move to the nominal contact, and as far beyond.
pub(crate) const APPROACH: f64 = 1e-3;
/// m, above everything.
const SAFE: f64 = 30e-3;
/// m/s: one servo period is 0.5 µm.
pub(crate) const FEED: f64 = 0.5e-3;

/// A plan and its order.
pub(crate) type Plan = (InspectionPlan, MeasurementOrder);

/// A bore about Z with its top at Z = 0, touched all round at one height.
pub(crate) fn bore(id: &str, points: usize, clearance_feed: f64) -> Plan {
    let mut plan = empty(id, InspectionFeature::BORE);
    let mut moves = Vec::new();
    for index in 0..points {
        let angle = std::f64::consts::TAU * index as f64 / points as f64;
        let (sine, cosine) = angle.sin_cos();
        let normal = [-cosine, -sine, 0.0];
        let position = [BORE * cosine, BORE * sine, -5e-3];
        plan.points.push(point(position, normal));
        let inside = [0.0, 0.0, -5e-3];
        if index == 0 {
            moves.push(probing(
                ProbingMove::CLEARANCE,
                index,
                [0.0, 0.0, SAFE],
                0.0,
            ));
        }
        moves.push(probing(
            ProbingMove::CLEARANCE,
            index,
            inside,
            clearance_feed,
        ));
        touch(&mut moves, index, position, normal);
        if index + 1 == points {
            moves.push(probing(ProbingMove::CLEARANCE, index, inside, 0.0));
            moves.push(probing(
                ProbingMove::CLEARANCE,
                index,
                [0.0, 0.0, SAFE],
                0.0,
            ));
        }
    }
    finish(plan, moves)
}

/// A box about the origin, touched on its four sides and on top, `each` times.
pub(crate) fn outside(id: &str, each: usize) -> Plan {
    let mut plan = empty(id, InspectionFeature::PLANE);
    let mut moves = Vec::new();
    let faces = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    let mut index = 0;
    for normal in faces {
        for repeat in 0..each {
            // Spread along the face, below the top edge.
            let shift = 4e-3 * (repeat as f64 - 0.5 * (each as f64 - 1.0));
            let mut position = [
                normal[0] * BOX[0] - normal[1] * shift,
                normal[1] * BOX[1] + normal[0] * shift,
                0.0,
            ];
            if normal[2] > 0.0 {
                position = [shift, 0.0, BOX[2]];
            }
            plan.points.push(point(position, normal));
            let away = 2.0 * APPROACH + BALL;
            let beside: [f64; 3] = std::array::from_fn(|axis| position[axis] + normal[axis] * away);
            let above = [beside[0], beside[1], SAFE];
            moves.push(probing(ProbingMove::CLEARANCE, index, above, 0.0));
            moves.push(probing(ProbingMove::CLEARANCE, index, beside, 0.0));
            touch(&mut moves, index, position, normal);
            moves.push(probing(ProbingMove::RETRACT, index, above, 0.0));
            index += 1;
        }
    }
    finish(plan, moves)
}

/// The moves from the start of an approach to the retract after it.
fn touch(moves: &mut Vec<ProbingMove>, index: usize, position: [f64; 3], normal: [f64; 3]) {
    let at = |distance: f64| -> [f64; 3] {
        std::array::from_fn(|axis| position[axis] + normal[axis] * distance)
    };
    moves.push(probing(
        ProbingMove::APPROACH,
        index,
        at(BALL + APPROACH),
        0.0,
    ));
    moves.push(probing(
        ProbingMove::TOUCH,
        index,
        at(BALL - APPROACH),
        FEED,
    ));
    moves.push(probing(
        ProbingMove::RETRACT,
        index,
        at(BALL + 2.0 * APPROACH),
        0.0,
    ));
}

fn probing(kind: u8, index: usize, position: [f64; 3], feed: f64) -> ProbingMove {
    ProbingMove {
        kind,
        point_index: index as u32,
        axis_positions: position.to_vec(),
        feed,
    }
}

fn point(position: [f64; 3], normal: [f64; 3]) -> InspectionPoint {
    InspectionPoint {
        position: Point::from(position),
        normal: Vector3::from(normal),
        approach_distance: APPROACH,
        retract_distance: APPROACH,
        feed: FEED,
        operation: -1,
        ..InspectionPoint::default()
    }
}

fn empty(id: &str, kind: u8) -> InspectionPlan {
    InspectionPlan {
        plan_id: id.to_owned(),
        part_id: "artefact".to_owned(),
        part_pose: Pose {
            orientation: Quaternion {
                w: 1.0,
                ..Quaternion::default()
            },
            ..Pose::default()
        },
        stylus: Stylus {
            id: "S6".to_owned(),
            ball_radius: BALL,
            ..Stylus::default()
        },
        features: vec![InspectionFeature {
            id: id.to_owned(),
            kind,
            ..InspectionFeature::default()
        }],
        ..InspectionPlan::default()
    }
}

fn finish(plan: InspectionPlan, moves: Vec<ProbingMove>) -> Plan {
    let order = MeasurementOrder {
        plan_id: plan.plan_id.clone(),
        order: (0..plan.points.len() as u32).collect(),
        axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
        moves,
        ..MeasurementOrder::default()
    };
    (plan, order)
}
