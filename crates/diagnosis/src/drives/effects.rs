//! The library of drive effects: columns over the samples of one axis.
//!
//! Motion: e = position − command. Effort: e = effort − (nominal mass or inertia)·acceleration. Friction after
//! Armstrong-Hélouvry; signs of speed are smoothed over a fiftieth of the usual speed, since measured speeds are noisy
//! around standstill. m or rad, seconds, and the effort's own unit.

use std::f64::consts::TAU;

use machine::{Chain, JointKind};

use super::signals::{Signals, derivative};

/// Speed over which a sign turns, as a share of the usual speed.
const TURN: f64 = 0.02;

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
            | ("drive.compliance", Channel::Effort)
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

/// Sign of a speed, smoothed around standstill.
fn signs(speed: &[f64]) -> Vec<f64> {
    let mut sizes: Vec<f64> = speed.iter().map(|value| value.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let usual = sizes[sizes.len() * 19 / 20].max(f64::MIN_POSITIVE);
    speed
        .iter()
        .map(|value| (value / (TURN * usual)).tanh())
        .collect()
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
    let mut delay = one(
        "drive.delay",
        "tau",
        "s",
        speed.iter().map(|v| -v).collect(),
    );
    delay.same_as = vec![format!("axis.{}.lag", signals.axis)];
    let mut effects = vec![
        delay,
        one(
            "drive.backlash",
            "b",
            "m or rad",
            signs(speed).iter().map(|s| -0.5 * s).collect(),
        ),
        one(
            "drive.inertia",
            "per_acceleration",
            "s^2",
            derivative(&signals.time, &signals.piece, speed),
        ),
    ];
    if !signals.effort.is_empty() {
        effects.push(one(
            "drive.compliance",
            "c",
            "rad/(N m) or m/N",
            signals.effort.clone(),
        ));
    }
    effects
}

fn effort(chain: &Chain, signals: &Signals) -> Vec<DriveEffect> {
    let speed = &signals.speed;
    // The command knows its sign without noise, and a drive answers it within a sample or two.
    let sign = signs(if signals.command_speed.is_empty() {
        speed
    } else {
        &signals.command_speed
    });
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
        one(
            "drive.delay",
            "tau",
            "s",
            derivative(&signals.time, &signals.piece, &signals.effort)
                .iter()
                .map(|f| -f)
                .collect(),
        ),
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
    effects.push(cogging(signals));
    if !signals.command.is_empty() {
        let error = signals
            .command
            .iter()
            .zip(&signals.position)
            .map(|(c, q)| c - q)
            .collect();
        effects.push(one(
            "drive.compliance",
            "stiffness",
            "effort per (m or rad)",
            error,
        ));
    }
    effects
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
    let shapes = (2..=120)
        .map(|turns| {
            let wave = TAU * 0.5 * f64::from(turns) / range;
            vec![
                term(
                    "sin",
                    "effort",
                    signals.position.iter().map(|q| (wave * q).sin()).collect(),
                ),
                term(
                    "cos",
                    "effort",
                    signals.position.iter().map(|q| (wave * q).cos()).collect(),
                ),
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
