//! What a person on watch must know of the cell, besides whether its processes run: entries of `/diagnostics`.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use probecell_msgs::{
    Correction, GapReport, LossReport, MachineState, RecordingStatus,
    diagnostic_msgs::{DiagnosticStatus, KeyValue},
};

/// A machine that has said nothing for longer is stale.
pub(super) const KNOWN: Duration = Duration::from_secs(2);
/// Waiting corrections and topics with losses that are named.
const NAMED: usize = 8;

/// What was received since the start of the cell.
#[derive(Debug, Default)]
pub(super) struct Health {
    /// The last state of the machine, and when it was received.
    pub(super) machine: Option<(MachineState, Instant)>,
    /// Whether the cell is recorded.
    pub(super) recording: RecordingStatus,
    /// States of the machine since the last array, and when that was.
    states: u64,
    counted: Option<Instant>,
    /// Corrections that wait for an operator.
    pub(super) waiting: BTreeMap<String, Correction>,
    /// Messages lost for good, by topic.
    lost: BTreeMap<String, u64>,
    recovered: u64,
    gap: Option<GapReport>,
}

impl Health {
    /// Takes a state of the machine.
    pub(super) fn machine(&mut self, machine: MachineState) {
        self.states += 1;
        self.machine = Some((machine, Instant::now()));
    }

    /// Takes a correction at one of its stages.
    pub(super) fn correction(&mut self, correction: &Correction) {
        if correction.approval == Correction::APPROVAL_NONE {
            (self.waiting).insert(correction.correction_id.clone(), correction.clone());
        } else {
            self.waiting.remove(&correction.correction_id);
        }
    }

    /// A correction has been answered by the machine or refused.
    pub(super) fn answered(&mut self, correction_id: &str) {
        self.waiting.remove(correction_id);
    }

    /// Corrections of a part that has ended are void.
    pub(super) fn part_ended(&mut self) {
        self.waiting.clear();
    }

    /// Takes a report of lost messages.
    pub(super) fn loss(&mut self, loss: &LossReport) {
        if loss.recovered {
            self.recovered += loss.count;
        } else {
            *self.lost.entry(loss.topic.clone()).or_default() += loss.count;
        }
    }

    /// Takes a gap report.
    pub(super) fn gap(&mut self, report: GapReport) {
        self.gap = Some(report);
    }

    /// The entries, each named `NAMESPACE/machine`, `/recording`, `/messages`, `/corrections` or `/gap_report`.
    pub(super) fn entries(&mut self, namespace: &str) -> Vec<DiagnosticStatus> {
        let entry = |name: &str, (level, message, values): Entry| DiagnosticStatus {
            level,
            name: format!("{namespace}/{name}"),
            message,
            hardware_id: String::new(),
            values,
        };
        let rate = self.rate();
        let mut entries = vec![
            entry("machine", self.of_machine(rate)),
            entry("recording", self.of_recording()),
            entry("messages", self.of_messages()),
            entry("corrections", self.of_corrections()),
        ];
        entries.extend(
            self.gap
                .as_ref()
                .map(|gap| entry("gap_report", of_gap(gap))),
        );
        entries
    }

    /// States of the machine per second since the last call.
    fn rate(&mut self) -> f64 {
        let since = self.counted.replace(Instant::now());
        let states = std::mem::take(&mut self.states);
        since.map_or(0.0, |since| states as f64 / since.elapsed().as_secs_f64())
    }

    fn of_machine(&self, rate: f64) -> Entry {
        let known = self.machine.as_ref();
        let Some((machine, _)) = known.filter(|(_, at)| at.elapsed() < KNOWN) else {
            let text = "no machine_state for two seconds".to_owned();
            return (DiagnosticStatus::STALE, text, Vec::new());
        };
        let (level, execution) = match machine.execution {
            MachineState::EXECUTION_IDLE => (DiagnosticStatus::OK, "idle"),
            MachineState::EXECUTION_RUNNING => (DiagnosticStatus::OK, "running"),
            MachineState::EXECUTION_HOLD => (DiagnosticStatus::WARN, "hold"),
            MachineState::EXECUTION_ALARM => (DiagnosticStatus::ERROR, "alarm"),
            _ => (DiagnosticStatus::ERROR, "emergency stop"),
        };
        let mut values = vec![
            value("program", &machine.program),
            value("tool_number", &machine.tool_number),
            value("feed_override", &machine.feed_override),
            value("machine_state rate [Hz]", &format!("{rate:.1}")),
        ];
        let temperatures = machine.temperature_names.iter().zip(&machine.temperatures);
        values.extend(temperatures.map(|(name, degrees)| {
            value(
                &format!("temperature {name} [°C]"),
                &format!("{degrees:.2}"),
            )
        }));
        values.extend(machine.alarms.iter().map(|alarm| value("alarm", alarm)));
        (level, execution.to_owned(), values)
    }

    fn of_recording(&self) -> Entry {
        let (level, more) = match self.recording.state {
            RecordingStatus::RECORDING => (DiagnosticStatus::OK, ""),
            RecordingStatus::WAIVED => (DiagnosticStatus::WARN, ""),
            _ => (DiagnosticStatus::ERROR, ": no operation starts"),
        };
        let values = vec![value("uri", &self.recording.uri)];
        (level, format!("{}{more}", self.recording.word()), values)
    }

    fn of_messages(&self) -> Entry {
        let lost: u64 = self.lost.values().sum();
        let (level, text) = match lost {
            0 => (DiagnosticStatus::OK, "none lost".to_owned()),
            _ => (DiagnosticStatus::WARN, format!("{lost} lost")),
        };
        let topics = self.lost.iter().take(NAMED);
        let mut values: Vec<_> = topics.map(|(topic, count)| value(topic, count)).collect();
        values.push(value("recovered", &self.recovered));
        (level, text, values)
    }

    fn of_corrections(&self) -> Entry {
        let (level, text) = match self.waiting.len() {
            0 => (DiagnosticStatus::OK, "none waits for approval".to_owned()),
            1 => (DiagnosticStatus::WARN, "one waits for approval".to_owned()),
            more => (DiagnosticStatus::WARN, format!("{more} wait for approval")),
        };
        let waiting = self.waiting.keys().take(NAMED);
        let values = waiting.map(|id| value("correction_id", id)).collect();
        (level, text, values)
    }
}

/// Level, message, values.
type Entry = (u8, String, Vec<KeyValue>);

fn of_gap(gap: &GapReport) -> Entry {
    let (level, text) = match gap.verdict {
        GapReport::NO_GAP => (DiagnosticStatus::OK, "no gap"),
        GapReport::EXPLAINED => (DiagnosticStatus::WARN, "gap explained"),
        GapReport::PARTLY_EXPLAINED => (DiagnosticStatus::WARN, "gap partly explained"),
        _ => (DiagnosticStatus::WARN, "gap unexplained"),
    };
    let mut values = vec![
        value("plan_id", &gap.plan_id),
        value("rms [µm]", &format!("{:.2}", gap.rms * 1e6)),
        value("noise floor [µm]", &format!("{:.2}", gap.noise_floor * 1e6)),
        value("ratio", &format!("{:.2}", gap.rms / gap.noise_floor)),
    ];
    values.extend(gap.effects.iter().map(|effect| {
        let mut group = vec![effect.effect.clone()];
        group.extend(effect.indistinguishable_from.iter().cloned());
        value("effect", &group.join(" or "))
    }));
    (level, text.to_owned(), values)
}

fn value(key: &str, value: &(impl ToString + ?Sized)) -> KeyValue {
    KeyValue {
        key: key.to_owned(),
        value: value.to_string(),
    }
}
