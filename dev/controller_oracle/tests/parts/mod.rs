//! A bore as a plan with its moves, and as the part that a probe meets.

use std::collections::BTreeMap;

use controller_oracle::control::{Event, Position, Probe};
use controllers::axes::{Axis, Letter};
use metrology::decision::Verdict;
use probecell_msgs::{
    InspectionPlan, InspectionPoint, MeasurementOrder, ProbingMove, Stylus,
    geometry_msgs::{Point, Vector3},
};

/// Nothing is in the way.
pub(crate) struct Air;

impl Probe for Air {
    fn skip(&mut self, _from: &Position, _to: &Position) -> Option<Position> {
        None
    }
}

/// A bore about Z below Z = 0, and whether the probe works.
pub(crate) struct Bore {
    /// mm, of the ball's centre at contact.
    pub(crate) reach: f64,
    /// The probe trips.
    pub(crate) works: bool,
    /// mm, what the programmed X is less than the machine's.
    pub(crate) shift: f64,
}

impl Bore {
    pub(crate) fn of(reach: f64) -> Self {
        Self {
            reach,
            works: true,
            shift: 0.0,
        }
    }
}

impl Probe for Bore {
    fn skip(&mut self, from: &Position, to: &Position) -> Option<Position> {
        let at = |share: f64| -> BTreeMap<char, f64> {
            from.iter()
                .map(|(axis, start)| (*axis, start + (to[axis] - start) * share))
                .collect()
        };
        let inside = |place: &Position| {
            place[&'Z'] > 0.0 || (place[&'X'] + self.shift).hypot(place[&'Y']) < self.reach
        };
        if !self.works || inside(to) {
            return None;
        }
        // Bisection on the way in which it leaves the free space.
        let (mut free, mut hit) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (free + hit);
            if inside(&at(middle)) {
                free = middle;
            } else {
                hit = middle;
            }
        }
        Some(at(hit))
    }
}

/// The order of the touches.
pub(crate) const ORDER: [u32; 6] = [3, 0, 5, 1, 4, 2];

/// Six touches of a bore of 25 mm radius by a ball of 3 mm, and the moves that make them.
pub(crate) fn bore() -> (InspectionPlan, MeasurementOrder) {
    let directions = (0..6).map(|index| (f64::from(index) * std::f64::consts::FRAC_PI_3).sin_cos());
    let points: Vec<_> = directions
        .map(|(sine, cosine)| InspectionPoint {
            position: Point {
                x: 0.025 * cosine,
                y: 0.025 * sine,
                z: -0.005,
            },
            normal: Vector3 {
                x: -cosine,
                y: -sine,
                z: 0.0,
            },
            approach_distance: 0.002,
            retract_distance: 0.002,
            feed: 0.5e-3,
            ..InspectionPoint::default()
        })
        .collect();
    let mut moves = Vec::new();
    for point_index in ORDER {
        let normal = points[point_index as usize].normal;
        let mut push = |kind, reach: f64, z: f64, feed| {
            moves.push(ProbingMove {
                kind,
                point_index,
                axis_positions: vec![-normal.x * reach, -normal.y * reach, z],
                feed,
            });
        };
        push(ProbingMove::CLEARANCE, 0.020, 0.02, 0.0);
        push(ProbingMove::APPROACH, 0.020, -0.005, 0.0);
        push(ProbingMove::TOUCH, 0.024, -0.005, 0.5e-3);
        push(ProbingMove::RETRACT, 0.020, -0.005, 0.0);
        push(ProbingMove::CLEARANCE, 0.020, 0.02, 0.0);
    }
    let plan = InspectionPlan {
        plan_id: "bore".to_owned(),
        stylus: Stylus {
            ball_radius: 0.003,
            ..Stylus::default()
        },
        points,
        ..InspectionPlan::default()
    };
    let order = MeasurementOrder {
        plan_id: "bore".to_owned(),
        order: ORDER.to_vec(),
        axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
        moves,
        ..MeasurementOrder::default()
    };
    (plan, order)
}

/// Three axes of a quarter of a metre each way.
pub(crate) fn axes() -> Vec<Axis> {
    let letters = [Letter::X, Letter::Y, Letter::Z].into_iter().enumerate();
    letters
        .map(|(joint, letter)| Axis {
            name: letter.to_string(),
            letter,
            joint,
            limits: Some([-0.25, 0.25]),
        })
        .collect()
}

/// What was printed or written, a line each.
pub(crate) fn prints(events: &[Event]) -> String {
    let lines = events.iter().filter_map(|event| match event {
        Event::Print(line) => Some(format!("{line}\n")),
        _ => None,
    });
    lines.collect()
}

/// The position lies where the ball met the bore at a point of the plan.
pub(crate) fn at_contact(plan: &InspectionPlan, point: u32, position: &[f64], reach: f64) {
    let normal = plan.points[point as usize].normal;
    let expected = [-normal.x * reach, -normal.y * reach, -5.0];
    let off = (0..3).map(|axis| (position[axis] - expected[axis]).abs());
    assert!(
        off.fold(0.0, f64::max) < 1e-4,
        "point {point}: {position:?} instead of {expected:?}"
    );
}

/// No ordinary move ends in the material.
pub(crate) fn stays_clear(events: &[Event], reach: f64) {
    let crosses = |event: &Event| matches!(event, Event::Move(at) if at[&'Z'] < 0.0 && at[&'X'].hypot(at[&'Y']) > reach);
    assert!(!events.iter().any(crosses), "{events:?}");
}

/// Row of the decision table.
pub(crate) fn row(verdict: Verdict) -> f64 {
    match verdict {
        Verdict::MeasurementInvalid => 0.0,
        Verdict::Qualified => 1.0,
        Verdict::OvercutNotCompensable => 2.0,
        Verdict::ToolWorn => 3.0,
        Verdict::NotConverged => 4.0,
        Verdict::Compensable => 5.0,
        Verdict::Indeterminate => panic!("the table knows no uncertainty"),
    }
}
