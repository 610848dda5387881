//! The classes of sealed sessions: what is drawn for each, what acts in it and what may be named.

use std::f64::consts::TAU;

use diagnosis::Session;

use super::{Grain, Sealed, between, displace, expert, rms, sized, sizes, smooth};
use crate::layouts::bed::{Pose, block, formed_bed_of};
use crate::layouts::{Chance, V, arm, iso230, plate, warming};

/// The turns of a part that lies turned by so little that their order does not matter.
fn turned_by(turns: V) -> Vec<(&'static str, &'static str, f64)> {
    let small = turns.iter().all(|turn| turn.abs() < 5e-4) && turns != [0.0; 3];
    let named = ["a", "b", "c"].into_iter().zip(turns);
    let told = named.filter(|_| small);
    told.map(|(name, turn)| ("fixture.tilt", name, turn))
        .collect()
}

pub(super) fn axis(chance: &mut Chance) -> Sealed {
    let noise = between(chance, 0.8e-6, 2e-6);
    let travel = [0.3, 0.4, 0.5][(3.0 * chance.uniform()) as usize];
    let step = 0.005;
    let lost = sized(chance, 4e-6, 2e-5);
    let curved = chance.uniform() < 0.7;
    let cyclic = !curved || chance.uniform() < 0.3;
    let wave = if cyclic {
        between(chance, 2.0, 5.0) * noise
    } else {
        0.0
    };
    let pitch = between(chance, 0.011, 0.02);
    let length = travel * between(chance, 0.25, 0.8);
    let curve = smooth(chance, length);
    let bent = if curved {
        sized(chance, 5e-6, 3e-5)
    } else {
        0.0
    };
    let vary = smooth(chance, 1.5 * travel);
    let varies = if chance.uniform() < 0.5 { 0.15 } else { 0.0 };
    let warms = chance.uniform() < 0.6;
    let drift = if warms {
        sized(chance, 4e-6, 2e-5)
    } else {
        0.0
    };
    let slow = between(chance, 0.3, 3.0);
    let model = |values: &[f64]| {
        iso230::axis(travel, step, |x, up, share| {
            let behind = if up { -0.5 } else { 0.5 };
            let target = (x / step).round() as usize;
            values[0] * behind * (1.0 + varies * vary(x, 0.0))
                + values[1] * (TAU * x / pitch + 0.7).sin()
                + values[2] * (1.0 - (-share / slow).exp()) / (1.0 - (-1.0 / slow).exp())
                + bent * curve(x, 0.0)
                + values.get(3 + target).copied().unwrap_or(0.0)
        })
    };
    let mut truth = vec![lost, wave, drift];
    let mut steps = vec![1e-6; 3];
    if curved {
        let targets = (travel / step).round() as usize + 1;
        truth.extend(vec![0.0; targets]);
        steps.extend(vec![1e-6; targets]);
    }
    let grain = Grain::draw(chance, noise);
    let mut session = model(&truth);
    let farther: Vec<bool> = (session.events.iter())
        .map(|event| event.axis_positions[0] > 0.5 * travel)
        .collect();
    let errors = grain.errors(chance, &session, &farther);
    displace(&mut session, true, &errors);
    let mut causes = vec!["axis.X.backlash"];
    causes.extend((curved && bent.abs() > 4.0 * noise).then_some("axis.X.positioning"));
    causes.extend((cyclic && !curved).then_some("axis.X.cyclic"));
    let mut truths = Vec::new();
    // Elsewhere its mean over the travel is another.
    truths.extend((varies == 0.0).then_some(("axis.X.backlash", "b", lost)));
    if cyclic && !curved {
        truths.extend([
            ("axis.X.cyclic", "a", wave),
            ("axis.X.cyclic", "period", pitch),
        ]);
    }
    Sealed {
        truths,
        expert: expert(&model, &truth, &steps, &session),
        fit: vec![session],
        withheld: Vec::new(),
        causes,
        allowed: vec![
            "axis.X.positioning",
            "axis.X.cyclic",
            "axis.X.scale",
            "thermal.drift",
            "thermal.spindle_growth",
        ],
        unknown: false,
        noise,
        drawn: format!(
            "travel {travel} lost {lost:.1e} wave {wave:.1e} bent {bent:.1e} length {length:.2} varies {varies} drift {drift:.1e} slow {slow:.1} noise {noise:.1e} rho {} uneven {} stray {}",
            grain.correlation, grain.uneven, grain.stray
        ),
    }
}

pub(super) fn drilled(chance: &mut Chance) -> Sealed {
    let noise = between(chance, 1.5e-6, 3.5e-6);
    let truth = [
        sized(chance, 2e-5, 1.6e-4),
        sized(chance, 2e-5, 1.6e-4),
        sized(chance, 1.5e-5, 1e-4),
        sized(chance, 8e-6, 4e-5),
        sized(chance, 8e-6, 4e-5),
        sized(chance, 8e-6, 5e-5),
    ];
    let by_rows = chance.uniform() < 0.6;
    let rough = if chance.uniform() < 0.5 {
        between(chance, 1e-6, 3e-6)
    } else {
        0.0
    };
    let fields = [smooth(chance, 0.25), smooth(chance, 0.25)];
    let order = move |hole: u32| if by_rows { hole } else { hole * 237 % 640 };
    let model = |values: &[f64]| {
        let errors = plate::Errors {
            shift: [values[0], values[1]],
            turn: values[2],
            scale: [values[3], values[4]],
            squareness: values[5],
            noise: 0.0,
        };
        plate::ordered(&errors, order)
    };
    let grain = Grain::draw(chance, noise);
    let mut session = model(&truth);
    let plan = session.plan.as_ref().unwrap();
    let upper: Vec<bool> = plan
        .points
        .iter()
        .map(|point| point.position.y > 0.2)
        .collect();
    let mut errors = grain.errors(chance, &session, &upper);
    for (error, point) in errors.iter_mut().zip(&plan.points) {
        let field = &fields[usize::from(point.normal.y > 0.5)];
        *error += rough * field(point.position.x, point.position.y);
    }
    displace(&mut session, true, &errors);
    Sealed {
        truths: vec![
            ("fixture.tilt", "c", truth[2]),
            ("axis.X.scale", "k", truth[3]),
            ("axis.Y.scale", "k", truth[4]),
        ],
        expert: expert(&model, &truth, &[1e-6; 6], &session),
        fit: vec![session],
        withheld: Vec::new(),
        causes: vec![
            "fixture.shift",
            "fixture.tilt",
            "axis.X.scale",
            "axis.Y.scale",
        ],
        allowed: vec![
            "link.EC0Y",
            "link.EC0X",
            "link.EC0Z",
            "probe.stylus_offset",
            "thermal.part_expansion",
        ],
        unknown: rough > 0.0,
        noise: noise.hypot(rough),
        drawn: format!(
            "{} rows {by_rows} rough {rough:.1e} noise {noise:.1e} rho {} uneven {} stray {}",
            sizes(&truth),
            grain.correlation,
            grain.uneven,
            grain.stray
        ),
    }
}

pub(super) fn bed(chance: &mut Chance) -> Sealed {
    let noise = between(chance, 1e-6, 4e-6);
    let truth = [
        sized(chance, 2.5e-4, 8e-3),
        sized(chance, 2.5e-4, 8e-3),
        sized(chance, 3e-5, 6e-4),
        if chance.uniform() < 0.7 {
            sized(chance, 1e-5, 8e-5)
        } else {
            0.0
        },
        if chance.uniform() < 0.5 {
            sized(chance, 1e-5, 5e-5)
        } else {
            0.0
        },
    ];
    let rough = if chance.uniform() < 0.5 {
        between(chance, 2.0, 8.0) * noise
    } else {
        0.0
    };
    let length = between(chance, 0.15, 0.4);
    let form = smooth(chance, length);
    let grid = [
        10 + (4.0 * chance.uniform()) as i32,
        9 + (5.0 * chance.uniform()) as i32,
    ];
    let model = |values: &[f64]| {
        let pose = Pose {
            turn: [values[0], values[1], 0.0],
            shift: [0.0, 0.0, values[2]],
        };
        let bows = |x: f64, y: f64| {
            values[3] * (1.0 - (x / 0.25).powi(2)) + values[4] * (1.0 - (y / 0.2).powi(2))
        };
        formed_bed_of(&pose, bows, grid)
    };
    let grain = Grain::draw(chance, noise);
    let mut session = model(&truth);
    let plan = session.plan.as_ref().unwrap();
    let right: Vec<bool> = plan
        .points
        .iter()
        .map(|point| point.position.x > 0.0)
        .collect();
    let mut errors = grain.errors(chance, &session, &right);
    for (error, point) in errors.iter_mut().zip(&plan.points) {
        *error += rough * form(point.position.x, point.position.y);
    }
    displace(&mut session, false, &errors);
    Sealed {
        truths: turned_by([truth[0], truth[1], 0.0]),
        expert: expert(&model, &truth, &[1e-6; 5], &session),
        fit: vec![session],
        withheld: Vec::new(),
        causes: vec!["fixture.tilt"],
        allowed: vec![
            "fixture.shift",
            "axis.X.straightness",
            "axis.Y.straightness",
            "axis.X.angular",
            "axis.Y.angular",
            "probe.ball_radius",
            "probe.stylus_length",
        ],
        unknown: rough > 0.0,
        noise: noise.hypot(rough),
        drawn: format!(
            "{} rough {rough:.1e} length {length:.2} noise {noise:.1e} rho {} uneven {} stray {}",
            sizes(&truth),
            grain.correlation,
            grain.uneven,
            grain.stray
        ),
    }
}

pub(super) fn blocks(chance: &mut Chance, beside: bool) -> Sealed {
    let noise = between(chance, 0.5e-6, 2e-6);
    let turned = chance.uniform() < 0.6;
    let truth: Vec<f64> = (0..6)
        .map(|own| match own {
            0..3 if turned => sized(chance, 1e-4, 1e-2),
            3.. if !turned || own % 2 == 1 => sized(chance, 1.5e-5, 3e-4),
            _ => 0.0,
        })
        .collect();
    let model = |values: &[f64]| {
        let pose = Pose {
            turn: [values[0], values[1], values[2]],
            shift: [values[3], values[4], values[5]],
        };
        block(&pose, 0.0, 3)
    };
    let grain = Grain::draw(chance, noise);
    let mut session = model(&truth);
    let plan = session.plan.as_ref().unwrap();
    let sideways: Vec<bool> = plan.points.iter().map(|p| p.normal.z < 0.5).collect();
    let mut errors = grain.errors(chance, &session, &sideways);
    let size = between(chance, 4.0, 12.0) * noise;
    let kind = (5.0 * chance.uniform()) as usize;
    let field = smooth(chance, 0.12);
    let place: V = [
        between(chance, -0.06, 0.06),
        between(chance, -0.04, 0.04),
        0.03,
    ];
    let along: V = [0, 1, 2].map(|_| chance.normal());
    let length = along.iter().map(|part| part * part).sum::<f64>().sqrt();
    let mut seat = false;
    if beside {
        for (error, point) in errors.iter_mut().zip(&plan.points) {
            let (p, n) = (&point.position, &point.normal);
            seat ^= chance.uniform() < 0.15;
            let facing = (along[0] * n.x + along[1] * n.y + along[2] * n.z) / length;
            *error += size
                * match kind {
                    // A beam that bends upwards, a form of the top, a dent, a field, a loose stylus.
                    0 => n.z * 3.0 * (p.x / 0.08).powi(2),
                    1 => field(p.x + p.z, p.y),
                    2 => {
                        let away = [p.x - place[0], p.y - place[1], p.z - place[2]];
                        let far = away.iter().map(|part| part * part).sum::<f64>();
                        4.0 * (-far / (2.0 * 0.025_f64.powi(2))).exp()
                    }
                    3 => facing * 2.0 * ((p.x / 0.08).powi(2) - (p.y / 0.06).powi(2)),
                    _ => 2.0 * facing * if seat { 0.5 } else { -0.5 },
                };
        }
    }
    displace(&mut session, false, &errors);
    let mut truths = turned_by([truth[0], truth[1], truth[2]]);
    let shift = ["x", "y", "z"].into_iter().zip(&truth[3..]);
    if !turned {
        truths.extend(shift.map(|(name, &size)| ("fixture.shift", name, size)));
    }
    Sealed {
        truths,
        expert: expert(&model, &truth, &[1e-6; 6], &session),
        fit: vec![session],
        withheld: Vec::new(),
        causes: if turned {
            vec!["fixture.tilt"]
        } else {
            vec!["fixture.shift"]
        },
        // A beam that bends and a saddle are what the straightness of a slide looks like.
        allowed: if beside && matches!(kind, 0 | 3) {
            vec!["fixture.", "probe.stylus_offset", "axis.X.", "axis.Y."]
        } else {
            vec![
                "fixture.",
                "probe.stylus_offset",
                "probe.stylus_length",
                "link.E",
            ]
        },
        unknown: beside && !matches!(kind, 0 | 3),
        noise: if beside { rms(&errors) } else { noise },
        drawn: format!(
            "{} kind {} size {size:.1e} noise {noise:.1e} rho {} uneven {} stray {}",
            sizes(&truth),
            if beside { kind as i32 } else { -1 },
            grain.correlation,
            grain.uneven,
            grain.stray
        ),
    }
}

pub(super) fn spindle(chance: &mut Chance) -> Sealed {
    let growth = (sized(chance, 0.6e-6, 4e-6), sized(chance, 0.5e-6, 3e-6));
    let noise = between(chance, 0.5e-6, 1.5e-6);
    let first = (1e6 * chance.uniform()) as u64;
    let mut days: Vec<Session> = (0..4)
        .map(|day| warming::day(first + day, growth, noise))
        .collect();
    let withheld = days.split_off(3);
    Sealed {
        truths: vec![
            ("thermal.spindle_growth", "g_bearing", growth.0),
            ("thermal.spindle_growth", "g_column", growth.1),
        ],
        fit: days,
        withheld,
        causes: vec!["thermal.spindle_growth"],
        allowed: vec!["thermal.drift"],
        unknown: false,
        noise,
        // The sensors' own 0.03 K are felt by who uses them.
        expert: noise.hypot(0.03 * growth.0.hypot(growth.1)),
        drawn: format!("{} noise {noise:.1e}", sizes(&[growth.0, growth.1])),
    }
}

pub(super) fn tracked(chance: &mut Chance) -> Sealed {
    let errors = arm::Errors {
        zeros: [0, 1, 2, 3, 4, 5].map(|joint| {
            if (1..5).contains(&joint) {
                sized(chance, 1e-4, 1e-3)
            } else {
                0.0
            }
        }),
        lengths: [sized(chance, 1e-4, 5e-4), sized(chance, 1e-4, 5e-4)],
        sag: [between(chance, 0.0, 3e-4), between(chance, 5e-5, 4e-4)],
        noise: between(chance, 1e-5, 3e-5),
    };
    let mut place = || {
        let shift: V = [0, 1, 2].map(|_| between(chance, -0.01, 0.01));
        (between(chance, -0.01, 0.01), shift)
    };
    let (one, other) = (place(), place());
    let seed = (1e6 * chance.uniform()) as u64;
    Sealed {
        truths: Vec::new(),
        fit: vec![arm::tracked(&errors, 120, one, seed)],
        withheld: vec![arm::tracked(&errors, 80, other, seed + 1)],
        causes: vec!["drive.compliance"],
        allowed: vec!["link.", "axis.A", "drive."],
        unknown: false,
        noise: errors.noise,
        expert: errors.noise * (1.0 + 14.0 / 360.0_f64).sqrt(),
        drawn: format!(
            "zeros {} lengths {} sag {} noise {:.0e}",
            sizes(&errors.zeros),
            sizes(&errors.lengths),
            sizes(&errors.sag),
            errors.noise
        ),
    }
}
