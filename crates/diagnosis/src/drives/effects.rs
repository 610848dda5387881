//! The library of drive effects: columns over the samples of one axis.
//!
//! Motion: e = position − command. Effort: e = effort − (nominal mass or inertia)·acceleration. Friction after
//! Armstrong-Hélouvry; signs of speed are smoothed over a fiftieth of the usual speed, since measured speeds are noisy
//! around standstill. A position error against the command is no effect on the effort: under a servo the effort follows
//! it always. m or rad, seconds, and the effort's own unit.

use std::f64::consts::TAU;

use machine::{Chain, JointKind};

use super::signals::{Signals, derivative};
use crate::evidence::{add_scaled, dot};

/// Speed over which a sign turns, as a share of the usual speed.
const TURN: f64 = 0.02;

/// Delays that are tried beside the infinitesimal one, samples.
const LATE: [usize; 12] = [1, 2, 3, 4, 5, 6, 8, 10, 13, 17, 22, 28];
/// Half waves of cogging over the travel, at least: fewer are no teeth, but a slow change along the way.
const COARSEST: i32 = 6;
/// And at most.
const FINEST: i32 = 120;

/// Which difference is explained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Channel {
    /// Measured against commanded position.
    Motion,
    /// Measured against nominal effort.
    Effort,
}

/// One linear parameter of an effect on one axis.
#[derive(Debug, Clone)]
pub(super) struct Term {
    /// Name of the parameter.
    pub(super) name: String,
    /// Unit.
    pub(super) unit: String,
    /// Column over the samples.
    pub(super) column: Vec<f64>,
}

/// An effect on one axis: its terms at a definite shape.
#[derive(Debug, Clone)]
pub(super) struct DriveEffect {
    /// Identifier of the vocabulary.
    pub(super) effect: &'static str,
    /// Sign that physics asks of its terms; 0 where both occur.
    pub(super) sign: f64,
    /// Effects that are the same to first order.
    pub(super) same_as: Vec<String>,
    /// Terms, alternatives for the shapes of the effect.
    pub(super) shapes: Vec<Vec<Term>>,
}

/// Effects that can act on an axis in a channel.
pub(super) fn library(chain: &Chain, signals: &Signals, channel: Channel) -> Vec<DriveEffect> {
    let mut effects = match channel {
        Channel::Motion => motion(signals),
        Channel::Effort => effort(chain, signals),
    };
    for effect in &mut effects {
        effect.sign = match (effect.effect, channel) {
            (
                "drive.coulomb_friction"
                | "drive.viscous_friction"
                | "drive.stribeck"
                | "drive.delay",
                _,
            )
            | ("drive.backlash", Channel::Motion) => 1.0,
            // The load side stays behind what drives it.
            ("drive.compliance", Channel::Motion) => -1.0,
            _ => 0.0,
        };
    }
    effects
}

/// The difference that a channel explains; `None` where the record lacks a signal.
pub(super) fn difference(chain: &Chain, signals: &Signals, channel: Channel) -> Option<Vec<f64>> {
    match channel {
        Channel::Motion if signals.command.is_empty() => None,
        Channel::Motion => Some(
            signals
                .position
                .iter()
                .zip(&signals.command)
                .map(|(q, c)| q - c)
                .collect(),
        ),
        Channel::Effort if signals.effort.is_empty() => None,
        Channel::Effort => {
            let inertia = nominal_inertia(chain, &signals.axis);
            Some(
                signals
                    .effort
                    .iter()
                    .zip(&signals.acceleration)
                    .map(|(f, a)| f - inertia * a)
                    .collect(),
            )
        }
    }
}

/// Mass (kg) or inertia about the axis (kg m²) of the link that a joint moves.
pub(super) fn nominal_inertia(chain: &Chain, axis: &str) -> f64 {
    let Some(index) = chain.axis_index(axis) else {
        return 0.0;
    };
    let joint = chain.axis(index);
    if joint.kind == JointKind::Prismatic {
        return joint.mass;
    }
    let direction = joint.axis.into_inner();
    let arm = joint.centre_of_mass - direction * direction.dot(&joint.centre_of_mass);
    direction.dot(&(joint.inertia * direction)) + joint.mass * arm.norm_squared()
}

/// Sign of a speed, smoothed around standstill and over its noise.
fn signs(speed: &[f64], noise: f64) -> Vec<f64> {
    let mut sizes: Vec<f64> = speed.iter().map(|value| value.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let usual = sizes[sizes.len() * 19 / 20];
    let turn = (TURN * usual).max(2.0 * noise).max(f64::MIN_POSITIVE);
    speed.iter().map(|value| (value / turn).tanh()).collect()
}

fn one(effect: &'static str, name: &str, unit: &str, column: Vec<f64>) -> DriveEffect {
    DriveEffect {
        effect,
        sign: 0.0,
        same_as: Vec::new(),
        shapes: vec![vec![term(name, unit, column)]],
    }
}

fn term(name: &str, unit: &str, column: Vec<f64>) -> Term {
    Term {
        name: name.to_owned(),
        unit: unit.to_owned(),
        column,
    }
}

fn motion(signals: &Signals) -> Vec<DriveEffect> {
    let speed = &signals.command_speed;
    let mut delay = delay(signals, &signals.command, &LATE);
    delay.same_as = vec![format!("axis.{}.lag", signals.axis)];
    let backlash = signals.direction.iter().map(|s| -0.5 * s).collect();
    // Without a measured effort the load of a rigid inertia stands for it.
    let (unit, load) = if signals.effort.is_empty() {
        ("s^2", derivative(&signals.time, &signals.piece, speed))
    } else {
        ("rad/(N m) or m/N", signals.effort.clone())
    };
    vec![
        delay,
        one("drive.backlash", "b", "m or rad", backlash),
        one("drive.compliance", "c", unit, load),
    ]
}

fn effort(chain: &Chain, signals: &Signals) -> Vec<DriveEffect> {
    let speed = &signals.speed;
    // Where the measured speed is too noisy, the command knows its sign.
    let usual = (speed.iter().map(|v| v * v).sum::<f64>() / speed.len().max(1) as f64).sqrt();
    let sign = if signals.command_speed.is_empty() || signals.speed_noise < TURN * usual {
        signs(speed, signals.speed_noise)
    } else {
        signs(&signals.command_speed, 0.0)
    };
    let mut effects = vec![
        one("drive.coulomb_friction", "force", "effort", sign.clone()),
        one(
            "drive.viscous_friction",
            "coefficient",
            "effort per (m/s or rad/s)",
            speed.clone(),
        ),
        one(
            "drive.friction_offset",
            "offset",
            "effort",
            vec![1.0; speed.len()],
        ),
        one(
            "drive.inertia",
            "excess",
            "effort per (m/s^2 or rad/s^2)",
            signals.acceleration.clone(),
        ),
        stribeck(speed, &sign),
    ];
    let revolute = chain
        .axis_index(&signals.axis)
        .is_some_and(|axis| chain.axis(axis).kind == JointKind::Revolute);
    if revolute {
        effects.push(DriveEffect {
            effect: "drive.gravity",
            sign: 0.0,
            same_as: Vec::new(),
            shapes: vec![vec![
                term(
                    "sin",
                    "effort",
                    signals.position.iter().map(|q| q.sin()).collect(),
                ),
                term(
                    "cos",
                    "effort",
                    signals.position.iter().map(|q| q.cos()).collect(),
                ),
            ]],
        });
    } else {
        effects[2].same_as.push("drive.gravity".to_owned());
    }
    let expected = expected(&signals.effort, &effects);
    // Later copies of what an acceleration predicts would share its noise; its slope does not.
    effects.push(delay(signals, &expected, &[]));
    effects.push(cogging(signals));
    effects
}

/// The effort as the linear effects together explain it: free of the sensor's noise, which a delayed copy of the
/// measured effort would bring into its own explanation.
fn expected(effort: &[f64], effects: &[DriveEffect]) -> Vec<f64> {
    let columns: Vec<&Vec<f64>> = (effects.iter())
        .filter_map(|effect| effect.shapes.get(effect.shapes.len() / 2))
        .flatten()
        .map(|term| &term.column)
        .collect();
    let n = columns.len();
    let size: Vec<f64> = (columns.iter())
        .map(|column| dot(column, column).sqrt().max(f64::MIN_POSITIVE))
        .collect();
    let normal = nalgebra::DMatrix::from_fn(n, n, |i, k| {
        let ridge = if i == k { 1e-9 } else { 0.0 };
        dot(columns[i], columns[k]) / (size[i] * size[k]) + ridge
    });
    let right = nalgebra::DVector::from_fn(n, |i, _| dot(columns[i], effort) / size[i]);
    let mut sum = vec![0.0; effort.len()];
    if let Some(factor) = nalgebra::Cholesky::new(normal) {
        for ((column, own), length) in columns.iter().zip(factor.solve(&right).iter()).zip(&size) {
            add_scaled(&mut sum, own / length, column);
        }
    }
    sum
}

/// `drive.delay` of a signal: (s(t − τ) − s(t))/τ for τ of some samples, its derivative for the shortest; the
/// coefficient is the delay.
fn delay(signals: &Signals, signal: &[f64], late: &[usize]) -> DriveEffect {
    let (time, piece) = (&signals.time, &signals.piece);
    let slope = derivative(time, piece, signal).iter().map(|f| -f).collect();
    let mut shapes = vec![vec![term("tau", "s", slope)]];
    for &steps in late {
        if steps * 20 > signal.len() {
            break;
        }
        let column = (0..signal.len())
            .map(|at| {
                let before = at.saturating_sub(steps);
                if piece[before] != piece[at] || before == at {
                    return 0.0;
                }
                (signal[before] - signal[at]) / (time[at] - time[before])
            })
            .collect();
        shapes.push(vec![term("tau", "s", column)]);
    }
    DriveEffect {
        effect: "drive.delay",
        sign: 1.0,
        same_as: Vec::new(),
        shapes,
    }
}

fn stribeck(speed: &[f64], sign: &[f64]) -> DriveEffect {
    let fastest = speed
        .iter()
        .fold(0.0_f64, |most, v| most.max(v.abs()))
        .max(f64::MIN_POSITIVE);
    let shapes = [0.02, 0.05, 0.12, 0.3]
        .map(|share| {
            let slow = share * fastest;
            let column = speed
                .iter()
                .zip(sign)
                .map(|(v, s)| s * (-(v / slow).powi(2)).exp())
                .collect();
            vec![term("force", "effort", column)]
        })
        .into();
    DriveEffect {
        effect: "drive.stribeck",
        sign: 0.0,
        same_as: Vec::new(),
        shapes,
    }
}

fn cogging(signals: &Signals) -> DriveEffect {
    let (low, high) = signals
        .position
        .iter()
        .fold((f64::MAX, f64::MIN), |(l, h), &q| (l.min(q), h.max(q)));
    let range = (high - low).max(f64::MIN_POSITIVE);
    let shapes = (COARSEST..=FINEST)
        .map(|turns| {
            let wave = TAU * 0.5 * f64::from(turns) / range;
            // What the low-pass leaves of a wave that is passed at this speed.
            let column = |value: fn(f64) -> f64| {
                (signals.position.iter().zip(&signals.speed))
                    .map(|(q, v)| {
                        value(wave * q) * (-0.5 * (wave * v * signals.width).powi(2)).exp()
                    })
                    .collect()
            };
            vec![
                term("sin", "effort", column(f64::sin)),
                term("cos", "effort", column(f64::cos)),
            ]
        })
        .collect();
    DriveEffect {
        effect: "drive.cogging",
        sign: 0.0,
        same_as: Vec::new(),
        shapes,
    }
}
