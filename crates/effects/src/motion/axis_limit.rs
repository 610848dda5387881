//! What the effects on one limit of an axis share: top speed, acceleration, jerk.

use machine::{Chain, motion::AxisLimits};

use super::{MotionEffect, MotionParameter, Moves, acts_on};
use crate::effect::{Definition, Effect, Instance};
use crate::variant::Parameter;

/// A limit of each axis that is other than declared.
pub(super) struct AxisLimit {
    /// Identifier of the effect, with `<A>` for the axis.
    pub(super) id: &'static str,
    /// Name of the limit under `[motion]` and in reports.
    pub(super) name: &'static str,
    /// As of [`Definition::name`].
    pub(super) description: &'static str,
    pub(super) remedy: &'static str,
    /// Its units, of a linear and of a rotary axis.
    pub(super) units: [&'static str; 2],
    /// Largest size usually met, in that unit.
    pub(super) largest: f64,
    /// Its values that are tried, by the declared limits.
    pub(super) tried: fn(&AxisLimits) -> Tried,
    /// Makes an axis keep a value.
    pub(super) set: fn(&mut AxisLimits, f64),
}

/// Which values of a limit are tried.
pub(super) enum Tried {
    /// Around the declared one.
    Around(f64),
    /// Between a least and a largest one, where none is declared.
    Between([f64; 2]),
}

impl AxisLimit {
    fn unit(&self, turns: bool) -> &'static str {
        self.units[usize::from(turns)]
    }
}

impl Effect for AxisLimit {
    fn definition(&self) -> Definition {
        Definition {
            id: self.id,
            name: self.description,
            remedy: self.remedy,
            parameters: &[],
            acts_on: acts_on(),
        }
    }

    fn parameters(&self, chain: &Chain, of: &Instance<'_>) -> Vec<Parameter> {
        let unit = self.unit(of.turns(chain));
        vec![Parameter::new(self.name, unit, self.largest)]
    }
}

impl MotionEffect for AxisLimit {
    /// One of each axis that moves.
    fn limits(&self, moves: &Moves) -> Vec<MotionParameter> {
        let moving = (moves.axes.iter().enumerate()).filter(|(axis, _)| moves.is_moved(*axis));
        moving
            .map(|(axis, (name, turns))| {
                let effect = Instance::on(name).id(self.id);
                let what = (self.name, self.unit(*turns));
                let limit = match (self.tried)(&moves.declared.axes()[axis]) {
                    Tried::Around(declared) => MotionParameter::around(effect, what, declared),
                    Tried::Between(range) => MotionParameter::between(effect, what, range),
                };
                limit.of_axis(axis, self.set)
            })
            .collect()
    }

    fn sized_remedy(&self, of: &Instance<'_>, name: &str, size: &str, instead: &str) -> String {
        format!(
            "{name} of {}: declare {size}{instead}, or set the axis to what is declared",
            of.axis
        )
    }
}
