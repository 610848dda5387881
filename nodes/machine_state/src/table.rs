//! The volumetric table at the gate: whole, entry by entry within bounds, and read back entry by entry.
//!
//! m for entries that begin EX, EY, EZ, rad for EA, EB, EC (ISO 230-1). A table is written at once or not at all: its
//! entries were estimated together, and half of them is another machine.

use probecell_msgs::{Correction, CorrectionAcknowledgement as Ack};

use crate::{
    config::Config,
    gate::{Refusal, refuse},
    state::Controller,
};

/// Two readings of an entry that differ by less are the same value, m or rad: a controller keeps 1e-7 or finer.
const SAME_ENTRY: f64 = 0.5e-7;

/// True where two tables hold the same values.
pub(crate) fn same(one: &[f64], other: &[f64]) -> bool {
    let mut pairs = one.iter().zip(other);
    one.len() == other.len() && pairs.all(|(one, other)| (one - other).abs() <= SAME_ENTRY)
}

/// Checks a table against its own bounds, the machine's, and what the controller tells that it holds now.
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
            "it is a table of [{}], but the controller's has the entries [{}]",
            correction.entries.join(", "),
            names.join(", ")
        );
        return refuse(Ack::FAILED, text);
    }
    let of_length = |values: &[f64]| values.len() == names.len();
    let complete = [
        &correction.previous_values,
        &correction.new_values,
        &correction.value_limits,
    ];
    if !complete.into_iter().all(|values| of_length(values)) {
        let text = "an entry has no value, no previous value or no bound";
        return refuse(Ack::REFUSED_OUT_OF_BOUNDS, text);
    }
    for (index, name) in names.iter().enumerate() {
        let (before, now) = (correction.previous_values[index], held[index]);
        if !((now - before).abs() <= SAME_ENTRY) {
            let text = format!(
                "it starts from {}, but the controller holds {}",
                shown(name, before),
                shown(name, now)
            );
            return refuse(Ack::REFUSED_STALE, text);
        }
        let Some(machine) = limit(config, name) else {
            let text = format!("{name:?} is not a location error such as EX0C or EA0B");
            return refuse(Ack::FAILED, text);
        };
        let (value, own) = (correction.new_values[index], correction.value_limits[index]);
        // Written so that what is not a number is out of bounds.
        if !(value.abs() <= own && value.abs() <= machine) {
            let text = format!(
                "{} lies outside ±{}",
                shown(name, value),
                measure(name, own.min(machine))
            );
            return refuse(Ack::REFUSED_OUT_OF_BOUNDS, text);
        }
    }
    Ok(())
}

/// The largest value of that entry that this machine is ever told, m or rad.
fn limit(config: &Config, name: &str) -> Option<f64> {
    let (component, rest) = (name.get(..2)?, name.get(2..)?);
    let axis = rest.strip_prefix('0').filter(|axis| !axis.is_empty());
    axis.and(match component {
        "EX" | "EY" | "EZ" => Some(config.volumetric_limit_shift),
        "EA" | "EB" | "EC" => Some(config.volumetric_limit_turn),
        _ => None,
    })
}

/// An entry and its value in µm or µrad.
fn shown(name: &str, value: f64) -> String {
    format!("{name} = {}", measure(name, value))
}

/// A value of an entry in µm or µrad.
fn measure(name: &str, value: f64) -> String {
    let turns = ["EA", "EB", "EC"].iter().any(|kind| name.starts_with(kind));
    let unit = if turns { "µrad" } else { "µm" };
    format!("{:.1} {unit}", value * 1e6)
}
