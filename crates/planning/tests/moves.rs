//! Touches, retracts and dog-legs against an independent check of the whole stylus, and against moves known to be bad.
#![allow(clippy::unwrap_used, reason = "a test stops at what should not happen")]

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use planning::{
    Clearances, MoveError, Options, Problem, Solid, Station, StylusShape, Touch, Workspace,
    check_limits, check_moves, path_length, solve,
};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{RngCore, SeedableRng};

const STYLUS: StylusShape = StylusShape {
    ball_radius: 0.003,
    stem_radius: 0.002,
    stem_length: 0.050,
    body_radius: 0.030,
    body_length: 0.100,
};
const CLEARANCES: Clearances = Clearances {
    approach_distance: 0.008,
    retract_distance: 0.010,
    gap: 0.002,
};
const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// A plate with a boss, a wedge and a clamp.
fn part() -> Vec<Solid> {
    vec![
        Solid::Box {
            min: [-0.10, -0.08, -0.02],
            max: [0.10, 0.08, 0.0],
        },
        Solid::Cylinder {
            base: [0.04, 0.0, 0.0],
            axis: UP,
            length: 0.030,
            radius: 0.015,
        },
        Solid::Convex(vec![
            ([0.0, 0.0, -1.0], 0.0),
            ([FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2], -0.02 * FRAC_1_SQRT_2),
            ([-FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2], 0.06 * FRAC_1_SQRT_2),
            ([0.0, 1.0, 0.0], 0.04),
            ([0.0, -1.0, 0.0], 0.04),
        ]),
        Solid::Box {
            min: [-0.02, 0.05, 0.0],
            max: [0.02, 0.08, 0.04],
        },
    ]
}

fn workspace() -> Workspace {
    Workspace::new(part(), STYLUS, CLEARANCES, ([0.0; 3], 0.14)).unwrap()
}

/// On top of the plate, around the boss, and with the stem from the sides onto the plate's flanks.
fn touches() -> Vec<Touch> {
    let r = STYLUS.ball_radius;
    let mut touches: Vec<Touch> = [
        [-0.09, -0.07],
        [0.09, 0.07],
        [-0.09, 0.07],
        [0.08, -0.07],
        [0.0, -0.06],
    ]
    .iter()
    .map(|&[x, y]| Touch {
        contact: [x, y, r],
        approach: [0.0, 0.0, -1.0],
        stem: UP,
    })
    .collect();
    for i in 0..6 {
        let (sine, cosine) = (PI * f64::from(i) / 3.0).sin_cos();
        let reach = 0.015 + r;
        touches.push(Touch {
            contact: [0.04 + reach * cosine, reach * sine, 0.020],
            approach: [-cosine, -sine, 0.0],
            stem: UP,
        });
    }
    touches.push(Touch {
        contact: [0.10 + r, 0.02, -0.01],
        approach: [-1.0, 0.0, 0.0],
        stem: [1.0, 0.0, 0.0],
    });
    touches.push(Touch {
        contact: [-0.10 - r, 0.02, -0.01],
        approach: [1.0, 0.0, 0.0],
        stem: [-1.0, 0.0, 0.0],
    });
    touches.push(Touch {
        contact: [0.02, -0.08 - r, -0.01],
        approach: [0.0, 1.0, 0.0],
        stem: [0.0, -1.0, 0.0],
    });
    touches
}

fn check(stations: &[Station]) -> bool {
    check_moves(stations, &STYLUS, &part(), 0.002, 1e-5).is_ok()
}

#[test]
fn a_planned_scan_hits_nothing_and_is_shorter() {
    let (workspace, touches) = (workspace(), touches());
    let problem = Problem::new(workspace.costs(&touches, path_length).unwrap());
    let solution = solve(
        &problem,
        &Options {
            kicks: 2_000,
            ..Options::default()
        },
        &mut |_| true,
    )
    .unwrap();
    assert!(
        solution.cost < 0.9 * solution.given_cost,
        "{} of {}",
        solution.cost,
        solution.given_cost
    );
    let stations = workspace.scan(&touches, &solution.order).unwrap();
    assert!(check(&stations));
    // Both ends of each touch lie where they should; the air path is what the table said.
    let on_touches =
        touches.len() as f64 * (CLEARANCES.approach_distance + CLEARANCES.retract_distance);
    assert!((path_length(&stations) - on_touches - solution.cost).abs() < 1e-12);
    let contacts = stations
        .iter()
        .filter(|station| touches.iter().any(|touch| touch.contact == station.ball));
    assert_eq!(contacts.count(), touches.len());
}

#[test]
fn the_check_finds_straight_moves_through_the_part() {
    let workspace = workspace();
    let touches = touches();
    let mut caught = 0;
    // Beside the edges of half spaces the planner keeps a larger gap than asked for.
    let boxes: Vec<Solid> = part()
        .into_iter()
        .filter(|solid| !matches!(solid, Solid::Convex(_)))
        .collect();
    let simple = Workspace::new(boxes.clone(), STYLUS, CLEARANCES, ([0.0; 3], 0.14)).unwrap();
    for from in 0..touches.len() {
        for to in 0..touches.len() {
            let [start, end] = [
                workspace.retract_end(&touches[from]),
                workspace.approach_start(&touches[to]),
            ];
            if from == to || start.stem != end.stem {
                continue;
            }
            let way = workspace.way(start, end).unwrap();
            assert!(check(&way), "from {from} to {to}");
            let way = simple.way(start, end).unwrap();
            // A dog-leg was made only where the straight move comes nearer than the gap; this shape, with flat ends,
            // encloses stem and body with their round ends and the gap.
            let wide = StylusShape {
                ball_radius: STYLUS.ball_radius + CLEARANCES.gap + 2e-4,
                stem_radius: STYLUS.stem_radius + CLEARANCES.gap + 2e-4,
                stem_length: STYLUS.stem_length - STYLUS.body_radius - CLEARANCES.gap,
                body_radius: STYLUS.body_radius + CLEARANCES.gap + 2e-4,
                body_length: STYLUS.body_length + 2.0 * (STYLUS.body_radius + CLEARANCES.gap),
            };
            let straight_is_free = check_moves(&[start, end], &wide, &boxes, 0.002, 0.0).is_ok();
            assert!(
                way.len() == 2 || !straight_is_free,
                "from {from} to {to} is free"
            );
            caught += usize::from(!check(&[start, end]));
        }
    }
    assert!(
        caught > 10,
        "only {caught} straight moves collide: the part is too easy"
    );
}

/// Random legs of random styli past random solids: what one method calls clear, the other does not call a hit.
#[test]
fn two_methods_agree_on_random_legs() {
    let mut rng = Pcg32::seed_from_u64(5);
    let mut uniform =
        |low: f64, high: f64| low + (high - low) * f64::from(rng.next_u32()) / 4_294_967_296.0;
    // The probe body has flat ends, and is judged with round ones beyond them; these lie within.
    let inscribed = StylusShape {
        stem_length: 0.080,
        body_length: 0.040,
        ..STYLUS
    };
    let (mut free, mut hit) = (0, 0);
    for _ in 0..400 {
        let mut vector = |size: f64| [0; 3].map(|_| uniform(-size, size));
        let [from, to, centre, raw] = [vector(0.2), vector(0.2), vector(0.1), vector(1.0)];
        let length = raw.iter().map(|x| x * x).sum::<f64>().sqrt();
        let stem = raw.map(|x| x / length);
        let solid = match uniform(0.0, 3.0) as u32 {
            0 => Solid::Box {
                min: centre.map(|x| x - 0.03),
                max: centre.map(|x| x + 0.04),
            },
            1 => Solid::Cylinder {
                base: centre,
                axis: stem,
                length: 0.06,
                radius: 0.03,
            },
            _ => Solid::Convex(vec![
                ([1.0, 0.0, 0.0], centre[0] + 0.03),
                ([-1.0, 0.0, 0.0], 0.03 - centre[0]),
                ([0.0, 1.0, 0.0], centre[1] + 0.03),
                ([0.0, -1.0, 0.0], 0.03 - centre[1]),
                (
                    [0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2],
                    (centre[1] + centre[2]) * FRAC_1_SQRT_2 + 0.02,
                ),
                ([0.0, 0.0, -1.0], 0.03 - centre[2]),
            ]),
        };
        let stations = [Station { ball: from, stem }, Station { ball: to, stem }];
        let sampled = check_moves(&stations, &STYLUS, std::slice::from_ref(&solid), 0.002, 0.0);
        if STYLUS.is_clear(&solid, from, to, stem, 0.0) {
            assert_eq!(sampled, Ok(()));
            free += 1;
        } else if inscribed.is_clear(&solid, from, to, stem, -0.0015) {
            // Within the sampling step of contact, or beside a corner of half spaces: either answer is right.
        } else if !matches!(solid, Solid::Convex(_)) {
            assert!(
                sampled.is_err(),
                "{solid:?} from {from:?} to {to:?} with {stem:?}"
            );
            hit += 1;
        }
    }
    assert!(free > 50 && hit > 30, "{free} free and {hit} hit");
}

#[test]
fn impossible_touches_and_bad_numbers_are_named() {
    let workspace = workspace();
    // From above beside the clamp: the probe body would hit it.
    let r = STYLUS.ball_radius;
    let deep = Touch {
        contact: [0.0, 0.05 - r, -0.015],
        approach: [0.0, 1.0, 0.0],
        stem: UP,
    };
    assert_eq!(
        workspace.check_touches(&[deep]),
        Err(MoveError::Blocked { touch: 0, solid: 0 })
    );
    let mut skew = touches()[0];
    skew.stem = [0.0, 0.0, 2.0];
    assert_eq!(workspace.check_touches(&[skew]), Err(MoveError::Touch(0)));
    skew.stem = UP;
    skew.contact[1] = f64::NAN;
    assert_eq!(workspace.scan(&[skew], &[0]), Err(MoveError::Touch(0)));
    assert_eq!(workspace.scan(&touches(), &[99]), Err(MoveError::Touch(99)));
    let broken = vec![Solid::Box {
        min: [0.0; 3],
        max: [-1.0, 0.0, 0.0],
    }];
    assert_eq!(
        Workspace::new(broken, STYLUS, CLEARANCES, ([0.0; 3], 1.0)),
        Err(MoveError::Solid(0))
    );
    let thin = StylusShape {
        stem_radius: -0.001,
        ..STYLUS
    };
    assert_eq!(
        Workspace::new(part(), thin, CLEARANCES, ([0.0; 3], 1.0)),
        Err(MoveError::Stylus)
    );
}

#[test]
fn soft_limits_are_checked_before_the_first_move() {
    let limits = [(-0.5, 0.5), (0.0, PI)];
    assert_eq!(
        check_limits(&[vec![0.5, 0.0], vec![-0.5, PI]], &limits),
        Ok(())
    );
    let error = check_limits(&[vec![0.0, 0.0], vec![0.6, 0.0]], &limits).unwrap_err();
    assert_eq!((error.index, error.axis, error.target), (1, 0, 0.6));
    assert_eq!(
        error.to_string(),
        "move 1 takes axis 0 to 0.6, outside its limits -0.5 to 0.5 (m or rad)"
    );
    assert!(check_limits(&[vec![0.0]], &limits).is_err());
    assert!(check_limits(&[vec![f64::NAN, 0.0]], &limits).is_err());
}
