//! Section `[[signals]]`: what is read of controllers beside the machine, and what it says.

use std::collections::BTreeSet;

use machine_state::{Role, Signal};
use plc::{DataType, Poll, controller};
use probecell_msgs::is_unprintable;
use serde::Deserialize;

use crate::Cell;

/// Name of the process that reads them.
pub(crate) const PROCESS: &str = "signals";

/// Units of a signal: SI with its usual names, and degree Celsius.
const UNITS: [&str; 23] = [
    "1", "m", "kg", "s", "A", "K", "degC", "rad", "Hz", "N", "N m", "Pa", "J", "W", "V", "ohm",
    "m/s", "m/s2", "rad/s", "m3/s", "kg/s", "m3", "m2",
];

/// s; shortest and longest time between two readings.
const PERIOD: std::ops::RangeInclusive<f64> = 0.01..=60.0;

/// One signal as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SignalSection {
    /// Its name; of a temperature as well that in `machine_state`.
    pub name: String,
    /// What it says.
    pub role: Role,
    /// The controller, such as `s7://10.0.0.5/0/1`.
    pub source: String,
    /// Where it stands there.
    pub address: String,
    /// How it stands there.
    #[serde(rename = "type")]
    pub data_type: DataType,
    /// Unit of `value = stored * scale + offset`; of a switch and of a temperature it need not be given.
    pub unit: Option<String>,
    /// See `unit`.
    #[serde(default = "one")]
    pub scale: f64,
    /// See `unit`.
    #[serde(default)]
    pub offset: f64,
    /// A switch that is 0 when the part is clamped or present.
    #[serde(default)]
    pub inverted: bool,
    /// Least value, in `unit`.
    pub minimum: Option<f64>,
    /// Largest value, in `unit`.
    pub maximum: Option<f64>,
    /// Time between two readings.
    #[serde(default = "period")]
    pub period_s: f64,
    /// Without a valid reading for longer it is stale.
    #[serde(default = "timeout")]
    pub timeout_s: f64,
}

fn one() -> f64 {
    1.0
}

fn period() -> f64 {
    0.2
}

fn timeout() -> f64 {
    2.0
}

impl SignalSection {
    fn unit(&self) -> &str {
        let usual = match self.role {
            Role::ClampingClosed | Role::PartPresent => "1",
            Role::Temperature => "degC",
            Role::Value => "",
        };
        self.unit.as_deref().unwrap_or(usual)
    }

    /// What is wrong with it, after its name.
    fn check(&self) -> Result<(), String> {
        let unit = self.unit();
        let is_switch = self.role.is_interlock();
        if is_switch && self.data_type != DataType::Bool {
            return Err("a switch is of type bool".to_owned());
        }
        let is_scaled = (self.scale, self.offset, unit) != (1.0, 0.0, "1");
        if is_switch && (is_scaled || self.minimum.or(self.maximum).is_some()) {
            return Err("a switch has no unit, scale, offset, minimum or maximum".to_owned());
        }
        if self.inverted && !is_switch {
            return Err("only a switch can be inverted".to_owned());
        }
        if self.role == Role::Temperature && unit != "degC" {
            return Err(format!(
                "unit = {unit:?} must be \"degC\" for a temperature"
            ));
        }
        if !UNITS.contains(&unit) {
            let known = UNITS.join(", ");
            return Err(format!("unit = {unit:?} must be one of {known}"));
        }
        if self.scale == 0.0 {
            return Err("scale = 0 leaves nothing of what is read".to_owned());
        }
        if let (Some(minimum), Some(maximum)) = (self.minimum, self.maximum)
            && minimum > maximum
        {
            return Err(format!("minimum = {minimum} is above maximum = {maximum}"));
        }
        let (period, timeout) = (self.period_s, self.timeout_s);
        if !PERIOD.contains(&period) {
            let (least, most) = (PERIOD.start(), PERIOD.end());
            return Err(format!(
                "period_s = {period} must lie between {least} and {most}"
            ));
        }
        if timeout < 2.0 * period {
            return Err(format!(
                "timeout_s = {timeout} must be at least twice period_s = {period}"
            ));
        }
        controller(&self.source)?.check(&self.address, self.data_type)
    }

    fn read(&self) -> plc::Signal {
        let (scale, offset) = if self.inverted {
            (-1.0, 1.0)
        } else {
            (self.scale, self.offset)
        };
        plc::Signal {
            name: self.name.clone(),
            address: self.address.clone(),
            data_type: self.data_type,
            scale,
            offset,
            unit: self.unit().to_owned(),
            period_s: self.period_s,
        }
    }

    fn watched(&self) -> Signal {
        Signal {
            name: self.name.clone(),
            role: self.role,
            unit: self.unit().to_owned(),
            minimum: self.minimum,
            maximum: self.maximum,
            timeout: self.timeout_s,
        }
    }
}

/// One sentence about the first that is wrong.
pub(crate) fn check(cell: &Cell) -> Result<(), String> {
    let mut names = BTreeSet::new();
    for signal in &cell.signals {
        let name = &signal.name;
        if name.is_empty() || name.chars().any(is_unprintable) {
            return Err(format!(
                "signals.name = {name:?} must be of printable characters"
            ));
        }
        if !names.insert(name) {
            return Err(format!("signals: {name:?} is listed twice"));
        }
        signal
            .check()
            .map_err(|text| format!("signals: {name:?}: {text}"))?;
    }
    Ok(())
}

impl Cell {
    /// Name of the process that reads signals of controllers beside the machine, where there are any.
    pub fn signals_process(&self) -> Option<&'static str> {
        (!self.signals.is_empty() && !self.is_playback()).then_some(PROCESS)
    }

    /// The controllers beside the machine, each with its signals.
    pub fn polls(&self) -> Vec<Poll> {
        let mut polls: Vec<Poll> = Vec::new();
        for signal in &self.signals {
            match polls.iter_mut().find(|poll| poll.source == signal.source) {
                Some(poll) => poll.signals.push(signal.read()),
                None => polls.push(Poll {
                    source: signal.source.clone(),
                    signals: vec![signal.read()],
                }),
            }
        }
        polls
    }

    /// The same as `machine_state` watches them.
    pub(crate) fn watched_signals(&self) -> Vec<Signal> {
        self.signals.iter().map(SignalSection::watched).collect()
    }
}
