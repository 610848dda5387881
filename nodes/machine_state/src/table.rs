//! The volumetric table at the gate: whole, entry by entry within bounds, and read back entry by entry.
//!
//! m for entries that begin with EX, EY, EZ, rad for EA, EB, EC (ISO 230-1). A table is written as a whole or not at all:
//! its entries were estimated together, and half of them would describe another machine.

use crate::quantity::{Angle, Length};
use probecell_msgs::{Correction, CorrectionAcknowledgement as Ack, offset};

use crate::{
    config::Config,
    refusal::{Refusal, refuse},
    state::Controller,
};

/// True where two tables hold the same values.
pub(crate) fn same(one: &[f64], other: &[f64]) -> bool {
    let mut pairs = one.iter().zip(other);
    one.len() == other.len() && pairs.all(|(one, other)| offset::is_same(*one, *other))
}

/// Checks a table against its own bounds, those of the machine, and the values that the controller holds now.
pub(crate) fn check(
    config: &Config,
    controller: &Controller,
    correction: &Correction,
) -> Result<(), Refusal> {
    let (names, held) = (
        &controller.status.volumetric_entries,
        &controller.status.volumetric_values,
    );
    if names.is_empty() {
        return refuse(Ack::FAILED, "the controller has no volumetric table");
    }
    if correction.entries != *names || held.len() != names.len() {
        let text = format!(
            "it has the entries [{}], but the controller's table has [{}]",
            correction.entries.join(", "),
            names.join(", ")
        );
        return refuse(Ack::FAILED, text);
    }
    let complete = [
        &correction.previous_values,
        &correction.new_values,
        &correction.value_limits,
    ];
    if !complete.iter().all(|values| values.len() == names.len()) {
        let text = "an entry has no value, no previous value or no bound";
        return refuse(Ack::REFUSED_OUT_OF_BOUNDS, text);
    }
    for (index, name) in names.iter().enumerate() {
        let Some(entry) = Entry::named(name) else {
            let text = format!("{name:?} is not a location error such as EX0C or EA0B");
            return refuse(Ack::FAILED, text);
        };
        let (before, now) = (correction.previous_values[index], held[index]);
        if !offset::is_same(now, before) {
            let text = format!(
                "it was computed from {name} = {}, but the controller holds {name} = {}",
                entry.display(before),
                entry.display(now)
            );
            return refuse(Ack::REFUSED_STALE, text);
        }
        let value = correction.new_values[index];
        let limit = entry.limit(config, correction.value_limits[index]);
        // Written so that what is not a number is out of bounds.
        if !(value.abs() <= limit) {
            let text = format!(
                "{name} = {} lies outside ±{}",
                entry.display(value),
                entry.display(limit)
            );
            return refuse(Ack::REFUSED_OUT_OF_BOUNDS, text);
        }
    }
    Ok(())
}

/// What an entry of the table is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Entry {
    /// A length, m.
    Length,
    /// An angle, rad.
    Angle,
}

impl Entry {
    /// The entry of that name, where it is the name of a location error (ISO 230-1).
    fn named(name: &str) -> Option<Self> {
        let (component, rest) = (name.get(..2)?, name.get(2..)?);
        let axis = rest.strip_prefix('0').filter(|axis| !axis.is_empty());
        axis.and(match component {
            "EX" | "EY" | "EZ" => Some(Self::Length),
            "EA" | "EB" | "EC" => Some(Self::Angle),
            _ => None,
        })
    }

    /// The tighter one of the correction's bound (m or rad) and the machine's, NaN where the correction has none.
    fn limit(self, config: &Config, bound: f64) -> f64 {
        let machine = match self {
            Self::Length => config.volumetric_length_limit.m(),
            Self::Angle => config.volumetric_angle_limit.rad(),
        };
        if bound.is_nan() {
            bound
        } else {
            bound.min(machine)
        }
    }

    /// A value (m or rad) as a person reads it.
    fn display(self, value: f64) -> String {
        match self {
            Self::Length => Length::from_m(value).to_string(),
            Self::Angle => Angle::from_rad(value).to_string(),
        }
    }
}
