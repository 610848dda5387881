//! A running cell as an edge node of MQTT Sparkplug B (Eclipse Sparkplug 3.0.0): the machine is its device, each quantity a
//! metric of it. Pure: it knows neither the bus nor MQTT.
//!
//! A message of data holds only metrics that the last birth of the device has named. Where a new one comes, such as the first
//! size of another part, the device is born again. Numbers are those of the cell's messages, in SI; `engUnit` names their unit.

mod payload;

use std::collections::BTreeMap;

use connector::live::{Sizes, gap_verdict};
use connector::mtconnect::execution_name;
use probecell_msgs::{
    FeatureResult, GapReport, InspectionPlan, MachineState, PartReport, PartStatus, Verdict,
};

use payload::{Metric, Payload};

pub(crate) use payload::Value;

/// The command by which a host asks for births.
const REBIRTH: &str = "Node Control/Rebirth";
/// Number of the connection, by which a death belongs to its birth.
const SESSION: &str = "bdSeq";

/// A message to be published, with quality of service 0 and not retained.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Message {
    /// Topic.
    pub(crate) topic: String,
    /// Protocol Buffers.
    pub(crate) payload: Vec<u8>,
}

/// A quantity as it was reported last.
#[derive(Clone, Debug, PartialEq)]
struct Known {
    value: Value,
    unit: &'static str,
    /// ms since 1970.
    at: u64,
    /// It is not yet in a message of this connection.
    is_new: bool,
}

/// The edge node of one cell, for one connection to a broker at a time.
#[derive(Debug)]
pub(crate) struct Edge {
    group: String,
    cell: String,
    version: String,
    /// Of the connection.
    session: u64,
    /// Of the next message.
    next: u8,
    /// The host has been told of the node; none until it is connected.
    is_connected: bool,
    /// The cell is on the bus.
    is_present: bool,
    /// The device has been born with these metrics.
    born: Option<Vec<String>>,
    metrics: BTreeMap<String, Known>,
    sizes: Sizes,
}

impl Edge {
    /// The edge node `cell` of `group`; `version` is that of the program.
    pub(crate) fn new(group: &str, cell: &str, version: &str) -> Self {
        Self {
            group: group.to_owned(),
            cell: cell.to_owned(),
            version: version.to_owned(),
            session: 0,
            next: 0,
            is_connected: false,
            is_present: false,
            born: None,
            metrics: BTreeMap::new(),
            sizes: Sizes::default(),
        }
    }

    /// The message that the broker publishes when the connection of this number (modulo 256) is gone, and that is published
    /// before it is closed.
    pub(crate) fn death(&self, session: u64) -> Message {
        let metric = Metric::new(SESSION, &Value::Number(session % 256), None);
        Message {
            topic: self.topic("NDEATH", false),
            payload: Payload {
                metrics: vec![metric],
                ..Payload::default()
            }
            .bytes(),
        }
    }

    /// Topic of commands to this node.
    pub(crate) fn commands(&self) -> String {
        self.topic("NCMD", false)
    }

    /// The connection of this number stands: births.
    pub(crate) fn connected(&mut self, session: u64, now: u64) -> Vec<Message> {
        self.session = session % 256;
        self.is_connected = true;
        self.births(now)
    }

    /// The connection is gone; what comes now is told with the next births.
    pub(crate) fn disconnected(&mut self) {
        self.is_connected = false;
        self.born = None;
    }

    /// Takes a command of a host; births where it asks for them.
    pub(crate) fn command(&mut self, payload: &[u8], now: u64) -> Vec<Message> {
        if self.is_connected && payload::asks_for(payload, REBIRTH) {
            return self.births(now);
        }
        Vec::new()
    }

    fn births(&mut self, now: u64) -> Vec<Message> {
        self.next = 0;
        self.born = None;
        let metrics = vec![
            Metric::new(SESSION, &Value::Number(self.session), Some(now)),
            Metric::new(REBIRTH, &Value::Flag(false), Some(now)),
            Metric::new(
                "Properties/Software",
                &Value::Text("probecell".to_owned()),
                Some(now),
            ),
            Metric::new(
                "Properties/Version",
                &Value::Text(self.version.clone()),
                Some(now),
            ),
        ];
        let mut messages = vec![self.message("NBIRTH", metrics, now)];
        messages.extend(self.changes(now));
        messages
    }

    /// Whether the cell is on the bus; what that changes comes with [`Edge::changes`].
    pub(crate) fn present(&mut self, is_present: bool) {
        self.is_present = is_present;
    }

    /// What has changed since the last message: the death of the device, its birth, or its data.
    pub(crate) fn changes(&mut self, now: u64) -> Vec<Message> {
        if !self.is_connected {
            return Vec::new();
        }
        if !self.is_present {
            let is_born = self.born.take().is_some();
            let death = is_born.then(|| self.message("DDEATH", Vec::new(), now));
            return death.into_iter().collect();
        }
        let names: Vec<String> = self.metrics.keys().cloned().collect();
        let is_birth = self.born.as_ref() != Some(&names);
        let told = (self.metrics.iter_mut()).filter(|(_, known)| is_birth || known.is_new);
        let metrics: Vec<Metric> = told
            .map(|(name, known)| {
                known.is_new = false;
                Metric::new(name, &known.value, Some(known.at)).with_unit(known.unit)
            })
            .collect();
        let kind = if is_birth { "DBIRTH" } else { "DDATA" };
        self.born = Some(names);
        let has_news = is_birth || !metrics.is_empty();
        let message = has_news.then(|| self.message(kind, metrics, now));
        message.into_iter().collect()
    }

    fn message(&mut self, kind: &str, metrics: Vec<Metric>, now: u64) -> Message {
        let seq = self.next;
        self.next = self.next.wrapping_add(1);
        let payload = Payload {
            timestamp: Some(now),
            metrics,
            seq: Some(u64::from(seq)),
        };
        Message {
            topic: self.topic(kind, kind.starts_with('D')),
            payload: payload.bytes(),
        }
    }

    fn topic(&self, kind: &str, is_of_device: bool) -> String {
        let (group, cell) = (&self.group, &self.cell);
        let device = if is_of_device { "/machine" } else { "" };
        format!("spBv1.0/{group}/{kind}/{cell}{device}")
    }

    fn set(&mut self, name: impl Into<String>, value: Value, unit: &'static str, at: u64) {
        let known = Known {
            value,
            unit,
            at,
            is_new: true,
        };
        let name = name.into();
        let is_same = |old: &Known| old.value == known.value && old.unit == known.unit;
        if !self.metrics.get(&name).is_some_and(is_same) {
            self.metrics.insert(name, known);
        }
    }

    /// Takes what the machine is doing.
    pub(crate) fn machine(&mut self, state: &MachineState) {
        let at = milliseconds(state.header.stamp.nanos());
        let mut text =
            |name: &str, text: &str| self.set(name, Value::Text(text.to_owned()), "", at);
        text("machine/execution", execution_name(state.execution));
        text("machine/program", &state.program);
        text("machine/alarms", &state.alarms.join("; "));
        for (name, value) in state.temperature_names.iter().zip(&state.temperatures) {
            let name = format!("machine/temperature/{name}");
            self.set(name, Value::Quantity(*value), "degC", at);
        }
    }

    /// Takes the part that is being made.
    pub(crate) fn part(&mut self, status: &PartStatus) {
        let at = milliseconds(status.header.stamp.nanos());
        let stage = match status.stage {
            PartStatus::CUTTING => "CUTTING",
            PartStatus::MEASURING => "MEASURING",
            PartStatus::DECIDING => "DECIDING",
            PartStatus::CORRECTING => "CORRECTING",
            PartStatus::STOPPING => "STOPPING",
            _ => "NONE",
        };
        self.set("part/stage", Value::Text(stage.to_owned()), "", at);
        self.set("part/run", Value::Text(status.run_id.clone()), "", at);
    }

    /// Takes the end of a part.
    pub(crate) fn report(&mut self, report: &PartReport) {
        let at = milliseconds(report.header.stamp.nanos());
        let verdict = match report.verdict {
            PartReport::QUALIFIED => "QUALIFIED",
            PartReport::SCRAP => "SCRAP",
            PartReport::STOPPED => "STOPPED",
            _ => "MEASURED",
        };
        for (name, text) in [
            ("part/last/run", report.run_id.as_str()),
            ("part/last/verdict", verdict),
            ("part/last/text", &report.text),
        ] {
            self.set(name, Value::Text(text.to_owned()), "", at);
        }
        self.set(
            "part/last/passes",
            Value::Number(u64::from(report.passes)),
            "",
            at,
        );
    }

    /// Takes a plan, whose limits apply where no verdict states others.
    pub(crate) fn plan(&mut self, plan: InspectionPlan) {
        self.sizes.plan(plan);
    }

    /// Takes a size.
    pub(crate) fn result(&mut self, result: FeatureResult) {
        let at = milliseconds(result.header.stamp.nanos());
        self.sizes.result(result);
        self.measured(at);
    }

    /// Takes what was decided of a size.
    pub(crate) fn verdict(&mut self, verdict: Verdict) {
        let at = milliseconds(verdict.header.stamp.nanos());
        if self.sizes.verdict(verdict) {
            self.measured(at);
        }
    }

    fn measured(&mut self, at: u64) {
        for size in self.sizes.sizes() {
            let result = &size.result;
            let name = |what: &str| format!("size/{}/{what}", result.feature_id);
            let quantity = |value: f64| {
                let is_known = size.is_valid() && value.is_finite();
                if is_known {
                    Value::Quantity(value)
                } else {
                    Value::Nothing
                }
            };
            let uncertainty = result.expanded_uncertainty();
            self.set(name("plan"), Value::Text(result.plan_id.clone()), "", at);
            self.set(name("value"), quantity(result.size), "m", at);
            self.set(name("deviation"), quantity(result.size_deviation), "m", at);
            self.set(name("expanded uncertainty"), quantity(uncertainty), "m", at);
            self.set(
                name("coverage factor"),
                quantity(result.coverage_factor),
                "1",
                at,
            );
            let [lower, upper] = size.limits.unwrap_or([f64::NAN; 2]);
            self.set(name("lower limit"), quantity(lower), "m", at);
            self.set(name("upper limit"), quantity(upper), "m", at);
            let status = Value::Text(size.status().name().to_owned());
            self.set(name("status"), status, "", at);
        }
    }

    /// Takes why the session differs from the declared model.
    pub(crate) fn gap(&mut self, report: &GapReport) {
        let at = milliseconds(report.header.stamp.nanos());
        let verdict = gap_verdict(report.verdict);
        let top = report.effects.first();
        let cause = top.map_or(String::new(), |one| one.effect.clone());
        // Those which the session cannot tell from it belong to its name.
        let rivals = top.map_or(String::new(), |one| one.indistinguishable_from.join(", "));
        let probability = top.map_or(Value::Nothing, |one| Value::Quantity(one.probability));
        for (name, text) in [
            ("gap/plan", report.plan_id.clone()),
            ("gap/verdict", verdict.to_owned()),
            ("gap/cause", cause),
            ("gap/cause/indistinguishable from", rivals),
        ] {
            self.set(name, Value::Text(text), "", at);
        }
        self.set("gap/cause/probability", probability, "1", at);
        self.set("gap/rms", Value::Quantity(report.rms), "m", at);
        self.set(
            "gap/noise floor",
            Value::Quantity(report.noise_floor),
            "m",
            at,
        );
    }
}

/// ms since 1970, of ns.
pub(crate) fn milliseconds(nanoseconds: i64) -> u64 {
    u64::try_from(nanoseconds / 1_000_000).unwrap_or_default()
}
