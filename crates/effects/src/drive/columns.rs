//! One axis of a drive session as its effects see it, and their columns over its samples.

use machine::{Chain, JointKind};

use super::signals::Signals;

/// Speed over which a sign turns, as a share of the usual speed.
const TURN: f64 = 0.02;

/// Which difference is explained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Measured against commanded position.
    Motion,
    /// Measured against nominal effort.
    Effort,
}

/// One linear parameter of an effect on one axis.
#[derive(Debug, Clone)]
pub struct Term {
    /// Name of the parameter.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Column over the samples.
    pub column: Vec<f64>,
}

/// An effect on one axis: its terms at a definite shape.
#[derive(Debug, Clone)]
pub struct DriveEffect {
    /// Identifier of the vocabulary.
    pub effect: &'static str,
    /// Sign that physics asks of its terms; 0 where both occur.
    pub sign: f64,
    /// Effects that are the same to first order.
    pub same_as: Vec<String>,
    /// Terms, alternatives for the shapes of the effect.
    pub shapes: Vec<Vec<Term>>,
}

/// One axis of a drive session, as its effects see it.
pub struct Drive<'a> {
    /// The machine.
    pub chain: &'a Chain,
    /// Motion and effort of the axis.
    pub signals: &'a Signals,
    /// The difference that is explained.
    pub channel: Channel,
    /// Smoothed sign of the speed; empty for motion.
    pub sign: Vec<f64>,
}

impl<'a> Drive<'a> {
    /// An axis with the sign of its speed.
    pub fn new(chain: &'a Chain, signals: &'a Signals, channel: Channel) -> Self {
        let sign = match channel {
            Channel::Motion => Vec::new(),
            Channel::Effort => sign(signals),
        };
        Self {
            chain,
            signals,
            channel,
            sign,
        }
    }

    /// The effect of this identifier with one term, on this channel only.
    pub(crate) fn on(
        &self,
        channel: Channel,
        effect: &'static str,
        terms: impl FnOnce() -> Vec<Vec<Term>>,
    ) -> Option<DriveEffect> {
        (self.channel == channel).then(|| DriveEffect {
            effect,
            sign: 0.0,
            same_as: Vec::new(),
            shapes: terms(),
        })
    }

    /// True where the axis turns.
    pub(crate) fn turns(&self) -> bool {
        let axis = self.chain.axis_index(&self.signals.axis);
        axis.is_some_and(|axis| self.chain.axis(axis).kind == JointKind::Revolute)
    }
}

impl DriveEffect {
    /// The same with the sign that physics asks of its terms.
    pub(crate) fn signed(mut self, sign: f64) -> Self {
        self.sign = sign;
        self
    }

    /// The same with an effect that is equal to first order.
    pub(crate) fn same_as(mut self, effect: String) -> Self {
        self.same_as.push(effect);
        self
    }
}

/// A term of this name, unit and column.
pub(crate) fn term(name: &str, unit: &str, column: Vec<f64>) -> Term {
    Term {
        name: name.to_owned(),
        unit: unit.to_owned(),
        column,
    }
}

/// The difference that a channel explains; `None` where the record lacks a signal.
pub fn difference(chain: &Chain, signals: &Signals, channel: Channel) -> Option<Vec<f64>> {
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
pub fn nominal_inertia(chain: &Chain, axis: &str) -> f64 {
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

/// Smoothed sign of the speed of an axis.
fn sign(signals: &Signals) -> Vec<f64> {
    let speed = &signals.speed;
    // Where the measured speed is too noisy, the command knows its sign.
    let usual = (speed.iter().map(|v| v * v).sum::<f64>() / speed.len().max(1) as f64).sqrt();
    if signals.command_speed.is_empty() || signals.speed_noise < TURN * usual {
        signs(speed, signals.speed_noise)
    } else {
        signs(&signals.command_speed, 0.0)
    }
}

/// Sign of a speed, smoothed around standstill and over its noise.
pub fn signs(speed: &[f64], noise: f64) -> Vec<f64> {
    let mut sizes: Vec<f64> = speed.iter().map(|value| value.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let usual = sizes[sizes.len() * 19 / 20];
    let turn = (TURN * usual).max(2.0 * noise).max(f64::MIN_POSITIVE);
    speed.iter().map(|value| (value / turn).tanh()).collect()
}
