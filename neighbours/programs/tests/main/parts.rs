//! A bore as a plan with its moves, and as the part that a probe meets.

use std::collections::BTreeMap;

use controller_oracle::control::{Event, Position, Probe};
use controllers::axes::{Axis, Letter};
use metrology::decision::{Case, DecisionLimits, Policy, Side, Verdict, decide};
use probecell_msgs::{
    InspectionPlan, InspectionPoint, MeasurementOrder, ProbingMove, Stylus,
    geometry_msgs::{Point, Vector3},
};
use programs::dialect::Characteristic;

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
fn row(verdict: Verdict) -> f64 {
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

/// m; drawing size of the characteristic that is decided on.
pub(crate) const NOMINAL: f64 = 19.8e-3;

/// A shaft or a bore of that size.
pub(crate) fn feature(bore: bool) -> Characteristic {
    Characteristic {
        nominal: NOMINAL,
        tolerance: 10e-6,
        wear_limit: -110e-6,
        max_corrections: 5,
        inner: bore,
        tool_number: 2,
    }
}

/// What a deciding program answers for a size (mm; `None`: no valid measurement), the wear before (mm), corrections made, and a
/// bore: the row, and the wear afterwards (mm).
pub(crate) type Decided = fn(Option<f64>, f64, u32, bool) -> (f64, f64);

/// Asserts that the rows of the published table are found.
pub(crate) fn gives_the_published_rows(decided: Decided) {
    let cases = [
        (Some(19.810), 0.0, 0, 1.0, 0.0),
        (Some(19.811), 0.0, 0, 5.0, -0.011),
        (Some(19.790), 0.0, 0, 1.0, 0.0),
        (Some(19.789), 0.0, 0, 2.0, 0.0),
        (Some(19.835), -0.070, 0, 5.0, -0.105),
        (Some(19.835), -0.080, 0, 3.0, -0.080),
        (Some(19.840), -0.070, 0, 5.0, -0.110),
        (Some(19.835), 0.0, 5, 4.0, 0.0),
        (None, -0.02, 0, 0.0, -0.02),
    ];
    for (size, wear, count, row, after) in cases {
        let found = decided(size, wear, count, false);
        assert!(
            found.0 == row && (found.1 - after).abs() < 1e-9,
            "{size:?} with wear {wear}: {found:?}"
        );
    }
}

/// Asserts that the program decides as `metrology::decision` about every size and wear on a grid.
pub(crate) fn decides_as_the_cell(decided: Decided) {
    let mut seen = [0; 6];
    for bore in [false, true] {
        let side = if bore { Side::Bore } else { Side::Outer };
        for step in -60..=60 {
            for wear in [-0.110, -0.0855, -0.03, 0.0, 0.05] {
                for count in [0, 4, 5] {
                    let size = 19.8 + f64::from(step) * 0.0005;
                    let wear = if bore { -wear } else { wear };
                    let limits = DecisionLimits::default();
                    let case = Case {
                        size: Some(size * 1e-3),
                        nominal: NOMINAL,
                        side,
                        wear: wear * 1e-3,
                        corrections: count,
                    };
                    let cell = decide(&case, &limits, Policy::Compensate);
                    let cell = cell.expect("good limits");
                    let (row, after) = decided(Some(size), wear, count, bore);
                    let same = row == self::row(cell.verdict)
                        && (after - cell.new_wear * 1e3).abs() < 1e-9;
                    assert!(
                        same,
                        "{size} with wear {wear}: row {row}, {after}; cell {cell:?}"
                    );
                    seen[row as usize] += 1;
                }
            }
        }
    }
    assert!(
        seen[1..].iter().all(|&count| count > 0),
        "a row was never reached: {seen:?}"
    );
}
