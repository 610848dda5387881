//! Signals of controllers beside the machine: temperatures for `machine_state`, and whether the part is there and clamped, without
//! which nothing begins.

use graph::{FaultCode, Stamp};
use probecell_msgs::{
    PartStatus,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus},
};

use crate::{
    config::{Config, Role, Signal},
    ports::{MachineFault, Out},
    state::State,
};

/// What is wrong with a signal, and a sentence.
type Wrong = (MachineFault, String);

/// Key of the value of a reading, in the unit of its signal, in decimal digits that give the number back to the bit.
pub const VALUE: &str = "value";

/// Takes readings, one status of the name of each signal: its value, or why it could not be read. One that a link delivers after
/// a newer one is ignored. True where the machine has to stop.
pub(crate) fn take(
    config: &Config,
    state: &mut State,
    now: Stamp,
    readings: DiagnosticArray,
    out: &mut Out,
) -> bool {
    let at = Stamp::from(&readings.header.stamp).min(now);
    for reading in readings.status {
        if !config.signals.iter().any(|one| one.name == reading.name) {
            continue;
        }
        let value = value(&reading);
        let heard = state.signals.entry(reading.name).or_default();
        match value {
            None => heard.failure = reading.message,
            Some(_) if heard.last.is_some_and(|(_, known)| known > at) => {}
            Some(value) => {
                heard.last = Some((value, at));
                heard.failure = String::new();
            }
        }
    }
    watch(config, state, now, out)
}

/// The value of a reading, if it is valid.
fn value(reading: &DiagnosticStatus) -> Option<f64> {
    let is_valid = reading.level == DiagnosticStatus::OK;
    let pair = (reading.values.iter()).find(|pair| is_valid && pair.key == VALUE)?;
    pair.value
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite())
}

/// Reports what has gone wrong with a signal since the last time. True where the machine has to stop: it works on what is not held.
pub(crate) fn watch(config: &Config, state: &mut State, now: Stamp, out: &mut Out) -> bool {
    let mut is_to_stop = false;
    let is_made = state.part.status.stage != PartStatus::NONE || state.operation.is_some();
    for signal in &config.signals {
        let found = wrong(state, now, signal).filter(|(fault, _)| match fault {
            // Between parts clampings open.
            MachineFault::InterlockOpen => is_made,
            MachineFault::InterlockLost | MachineFault::SignalLost => !is_early(state, now, signal),
            _ => true,
        });
        for fault in [
            MachineFault::InterlockLost,
            MachineFault::InterlockOpen,
            MachineFault::SignalLost,
            MachineFault::SignalOutOfRange,
        ] {
            let standing = format!("{} {}", fault.code(), signal.name);
            match &found {
                Some((other, text)) if *other == fault => {
                    if state.standing.insert(standing) {
                        out.fault(now, fault, text.as_str());
                        is_to_stop |= signal.role.is_interlock() && state.operation.is_some();
                    }
                }
                _ => {
                    state.standing.remove(&standing);
                }
            }
        }
    }
    is_to_stop
}

/// Why nothing may begin: something that has to hold the part does not, or is not known to.
pub(crate) fn refusal(config: &Config, state: &State, now: Stamp) -> Option<String> {
    let mut interlocks = (config.signals.iter()).filter(|one| one.role.is_interlock());
    interlocks.find_map(|signal| wrong(state, now, signal).map(|(_, text)| text))
}

/// What has to be known before anything begins has not been read yet, and is not late.
pub(crate) fn is_awaited(config: &Config, state: &State, now: Stamp) -> bool {
    let mut interlocks = (config.signals.iter()).filter(|one| one.role.is_interlock());
    interlocks.any(|signal| last(state, signal).is_none() && is_early(state, now, signal))
}

/// What stands reported, in sentences, for `alarms`.
pub(crate) fn alarms(config: &Config, state: &State, now: Stamp) -> impl Iterator<Item = String> {
    (config.signals.iter()).filter_map(move |signal| {
        let (fault, text) = wrong(state, now, signal)?;
        let standing = format!("{} {}", fault.code(), signal.name);
        state.standing.contains(&standing).then_some(text)
    })
}

/// Names and values of the temperatures that are known now.
pub(crate) fn temperatures(
    config: &Config,
    state: &State,
    now: Stamp,
) -> impl Iterator<Item = (String, f64)> {
    let read = (config.signals.iter()).filter(|one| one.role == Role::Temperature);
    read.filter_map(move |signal| {
        let (value, at) = last(state, signal)?;
        (now.since_s(at) <= signal.timeout).then(|| (signal.name.clone(), value))
    })
}

/// Its last valid reading, and when it was read.
fn last(state: &State, signal: &Signal) -> Option<(f64, Stamp)> {
    state.signals.get(&signal.name)?.last
}

/// It may still come in time: it was read, or this process has begun, no longer ago than its timeout.
fn is_early(state: &State, now: Stamp, signal: &Signal) -> bool {
    let since = last(state, signal).map_or(Stamp(state.started as i64), |(_, at)| at);
    now.since_s(since) <= signal.timeout
}

fn wrong(state: &State, now: Stamp, signal: &Signal) -> Option<Wrong> {
    let (name, unit) = (&signal.name, &signal.unit);
    let known = last(state, signal).filter(|_| is_early(state, now, signal));
    let is_interlock = signal.role.is_interlock();
    let Some((value, _)) = known else {
        let fault = if is_interlock {
            MachineFault::InterlockLost
        } else {
            MachineFault::SignalLost
        };
        let failure = state.signals.get(name).map_or("", |heard| &heard.failure);
        let colon = if failure.is_empty() { "" } else { ": " };
        let limit = signal.timeout;
        let text = format!("signal {name:?} has not been read for {limit} s{colon}{failure}");
        return Some((fault, text));
    };
    match (signal.role, signal.minimum, signal.maximum) {
        (Role::ClampingClosed, ..) if value == 0.0 => {
            let text = format!("the clamping is open (signal {name:?})");
            Some((MachineFault::InterlockOpen, text))
        }
        (Role::PartPresent, ..) if value == 0.0 => {
            let text = format!("no part is present (signal {name:?})");
            Some((MachineFault::InterlockOpen, text))
        }
        (_, Some(minimum), _) if value < minimum => {
            let text = format!("signal {name:?} is {value} {unit}, below {minimum} {unit}");
            Some((MachineFault::SignalOutOfRange, text))
        }
        (_, _, Some(maximum)) if value > maximum => {
            let text = format!("signal {name:?} is {value} {unit}, above {maximum} {unit}");
            Some((MachineFault::SignalOutOfRange, text))
        }
        _ => None,
    }
}
