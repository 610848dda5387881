//! What each message changes in the state of its cell.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use graph::{Stamp, topics};
use probecell_msgs::{
    Correction, CorrectionAcknowledgement, Fault, FeatureResult, GapReport, InspectionPlan,
    LossReport, MachineState, MeasurementOrder, Message, PartReport, PartStatus, PassDecision,
    PlanId, PlanProgress, RecordingStatus, TouchDeviation, Verdict,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus},
    from_cdr, std_msgs,
};

use super::cell::{CellState, Characteristic, RunChartPoint, Section, Touch};
use super::events::EventKind;
use super::ledger::{part_of, part_of_run};
use super::wording;

/// Letters of the description of a machine.
const DESCRIPTION: usize = 1 << 20;
/// Letters of the version of the program.
const VERSION_LETTERS: usize = 64;
/// Parts of a run chart.
const PARTS: usize = 200;
/// Characteristics with a run chart.
const CHARACTERISTICS: usize = 128;
/// Faults and losses kept, each.
const TROUBLES: usize = 48;
/// Parts that ended, kept.
const ENDED: usize = 32;
/// References kept.
const REFERENCES: usize = 256;
/// Places with a temperature whose trend is kept, and signals of controllers beside the machine.
const PLACES: usize = 16;
const SIGNALS: usize = 32;
/// Letters of the name and the unit of a signal.
const SIGNAL_LETTERS: usize = 64;
/// Names of the trends of what is set on the machine; units as shown.
const OVERRIDE: &str = "Feed override, %";
const SPINDLE: &str = "Spindle, 1/min";
/// Bytes of a CDR message before which only its encapsulation and the stamp of its header stand.
const STAMPED: usize = 12;

/// What happened: kind and a sentence.
pub(super) type Happened = Option<(EventKind, String)>;

impl CellState {
    /// Takes a message on the topic `name` below the cell's namespace. Bytes that are not of the topic's type change nothing.
    pub(super) fn take(&mut self, name: &str, bytes: &[u8], at: Stamp) -> Happened {
        let first = self.heard.map_or(at, |(first, _)| first);
        // Whether it still makes the part, it says itself.
        if self.heard.is_some() && self.is_stale(at) && self.is_making() {
            self.interrupted = Some(self.part.clone());
        }
        self.heard = Some((first, at));
        self.left = None;
        self.goes_on(at);
        let happened = self.reduce(name, bytes, at);
        self.goes_on(at);
        happened
    }

    fn reduce(&mut self, name: &str, bytes: &[u8], at: Stamp) -> Happened {
        match name {
            n if n == topics::JOINT_STATES.name => {
                bytes.clone_into(&mut self.joints_bytes);
                self.changed(&[Section::Axes]);
                None
            }
            n if n == topics::CELL_DESCRIPTION.name => {
                let text: std_msgs::String = read(bytes)?;
                let version = topics::program(&text.data).unwrap_or_default();
                self.version = version.chars().take(VERSION_LETTERS).collect();
                self.changed(&[Section::State]);
                None
            }
            n if n == topics::ROBOT_DESCRIPTION.name => {
                let text: std_msgs::String = read(bytes)?;
                if text.data.len() <= DESCRIPTION {
                    self.description = text.data.into();
                }
                None
            }
            n if n == topics::MACHINE_STATE.name => self.machine_said(bytes),
            n if n == topics::PART_STATUS.name => self.part_said(read(bytes)?),
            n if n == topics::PART_REPORTS.name => self.part_ended(read(bytes)?),
            n if n == topics::ORDERS.name => {
                self.orders = read(bytes)?;
                self.changed(&[Section::State]);
                None
            }
            n if n == topics::INSPECTION_PLAN.name => self.planned(read(bytes)?),
            n if n == topics::MEASUREMENT_ORDER.name => self.ordered(read(bytes)?),
            n if n == topics::PLAN_PROGRESS.name => {
                self.progressed(read(bytes)?);
                None
            }
            n if n == topics::TOUCH_DEVIATIONS.name => Some(self.touched(&read(bytes)?, at)),
            n if n == topics::FEATURE_RESULTS.name => self.resulted(read(bytes)?),
            n if n == topics::REFERENCE_RESULTS.name => self.referred(read(bytes)?),
            n if n == topics::VERDICTS.name => self.judged(read(bytes)?),
            n if n == topics::PASS_DECISIONS.name => self.decided(read(bytes)?),
            n if n == topics::CORRECTIONS.name => self.corrected(read(bytes)?, at),
            n if n == topics::CORRECTION_ACKNOWLEDGEMENTS.name => self.acknowledged(read(bytes)?),
            n if n == topics::GAP_REPORT.name => self.diagnosed(read(bytes)?),
            n if n == topics::RECORDING_STATUS.name => {
                let status: RecordingStatus = read(bytes)?;
                if self.recording.as_ref().map(|one| (one.state, &one.uri))
                    != Some((status.state, &status.uri))
                {
                    self.changed(&[Section::State]);
                }
                self.recording = Some(status);
                None
            }
            n if n == topics::SIGNALS.name => {
                self.signalled(&read(bytes)?, at);
                None
            }
            n if n == topics::LOSS_REPORTS.name => Some(self.lost(read(bytes)?, at)),
            n if n.ends_with("/faults") => Some(self.failed(read(bytes)?, at)),
            _ => None,
        }
    }

    /// What a link has dropped comes late, when the plan is made.
    fn progressed(&mut self, progress: PlanProgress) {
        let is_older = |known: &PlanProgress| {
            known.plan_id == progress.plan_id
                && known.header.stamp.nanos() > progress.header.stamp.nanos()
        };
        if !self.progress.as_ref().is_some_and(is_older) {
            self.progress = Some(progress);
            self.changed(&[Section::State, Section::Order]);
        }
    }

    fn machine_said(&mut self, bytes: &[u8]) -> Happened {
        if bytes.get(STAMPED..) == self.machine_bytes.get(STAMPED..) {
            bytes.clone_into(&mut self.machine_bytes);
            return None;
        }
        let new: MachineState = read(bytes)?;
        let old = self.machine();
        bytes.clone_into(&mut self.machine_bytes);
        self.does();
        self.follow(&new);
        self.changed(&[Section::State, Section::Axes]);
        let raised = new
            .alarms
            .iter()
            .find(|one| !self.alarms.contains(one))
            .cloned();
        self.alarms.clone_from(&new.alarms);
        if let Some(alarm) = raised {
            self.changed(&[Section::Faults]);
            return Some((EventKind::Fault, format!("alarm: {alarm}")));
        }
        let before = old.map(|one| one.execution);
        (before != Some(new.execution)
            && (new.execution >= MachineState::EXECUTION_ALARM
                || before.is_some_and(|one| one >= MachineState::EXECUTION_ALARM)))
        .then(|| {
            (
                EventKind::Fault,
                format!("machine: {}", wording::execution(new.execution)),
            )
        })
    }

    /// Takes the values of which a trend is shown.
    fn follow(&mut self, new: &MachineState) {
        let places = new.temperature_names.iter().map(String::as_str);
        let temperatures = places.zip(new.temperatures.iter().copied()).take(PLACES);
        let spindle = new.spindle_speed * 30.0 / std::f64::consts::PI;
        let others = [(OVERRIDE, 100.0 * new.feed_override), (SPINDLE, spindle)];
        let values: BTreeMap<&str, f64> = temperatures.chain(others).collect();
        self.trends
            .retain(|name, _| values.contains_key(name.as_str()));
        for (name, value) in values.into_iter().filter(|(_, value)| value.is_finite()) {
            match self.trends.get_mut(name) {
                Some(trend) => trend.set(Some(value)),
                None => self
                    .trends
                    .entry(name.to_owned())
                    .or_default()
                    .set(Some(value)),
            }
        }
    }

    /// Takes readings of signals. One that cannot be read has no value until it can.
    fn signalled(&mut self, readings: &DiagnosticArray, at: Stamp) {
        for one in &readings.status {
            let text = |key: &str| {
                let pair = one.values.iter().find(|pair| pair.key == key);
                pair.map_or("", |pair| pair.value.as_str())
            };
            let value = (one.level == DiagnosticStatus::OK)
                .then(|| text("value").parse().ok())
                .flatten()
                .filter(|value: &f64| value.is_finite());
            let short = |text: &str| -> String { text.chars().take(SIGNAL_LETTERS).collect() };
            let name = short(&one.name);
            if !self.signals.contains_key(&name) && self.signals.len() == SIGNALS {
                // In place of one that is not told of any more.
                self.signals
                    .retain(|_, known| known.trend.value().is_some());
                if self.signals.len() == SIGNALS {
                    continue;
                }
            }
            let signal = self.signals.entry(name).or_default();
            if signal.read(value, at) {
                signal.unit = short(text("unit"));
                self.changed(&[Section::Axes]);
            }
        }
    }

    fn part_said(&mut self, status: PartStatus) -> Happened {
        let key = |one: &PartStatus| (one.stage, one.run_id.clone(), one.plan_id.clone());
        let changed = key(&status) != key(&self.part);
        self.part = status;
        self.does();
        if self.is_making() {
            self.interrupted = None;
        }
        if !changed {
            return None;
        }
        self.changed(&[Section::State, Section::Order]);
        let stage = PartStatus::word(self.part.stage);
        (self.part.stage != PartStatus::NONE)
            .then(|| (EventKind::Part, format!("{}: {stage}", self.part.part_id)))
    }

    fn part_ended(&mut self, report: PartReport) -> Happened {
        if self.ended.back() == Some(&report) {
            return None;
        }
        *self.parts.entry(report.verdict).or_default() += 1;
        let same = |one: &&PartReport| !one.run_id.is_empty() && one.run_id == report.run_id;
        if let Some(before) = self.ended.iter().rfind(same) {
            *self.revoked.entry(before.verdict).or_default() += 1;
            let was = u64::from(before.is_revocation());
            self.revocations = self.revocations.saturating_sub(was);
        }
        self.revocations += u64::from(report.is_revocation());
        self.interrupted
            .take_if(|part| part.run_id == report.run_id);
        let text = format!("{} {}: {}", report.part_id, report.end(), report.text);
        push(&mut self.ended, report, ENDED);
        self.changed(&[Section::State]);
        Some((EventKind::Part, text))
    }

    fn planned(&mut self, plan: InspectionPlan) -> Happened {
        if self
            .plan
            .as_ref()
            .is_some_and(|known| known.plan_id == plan.plan_id)
        {
            self.plan = Some(Arc::new(plan));
            self.changed(&[Section::Part, Section::Order, Section::Sizes]);
            return None;
        }
        self.touches.clear();
        self.first_touch = None;
        self.plan = Some(Arc::new(plan));
        self.changed(&[Section::Part, Section::Order, Section::Sizes]);
        None
    }

    fn ordered(&mut self, order: MeasurementOrder) -> Happened {
        self.order = Some(Arc::new(order));
        self.changed(&[Section::Order]);
        None
    }

    fn touched(&mut self, touch: &TouchDeviation, at: Stamp) -> (EventKind, String) {
        self.touch_count += 1;
        let known = self
            .plan
            .as_ref()
            .filter(|plan| plan.plan_id == touch.plan_id);
        let point = known.and_then(|plan| {
            let point = plan.points.get(touch.point_index as usize)?;
            plan.features.get(point.feature as usize)
        });
        let feature = point.map(|feature| feature.id.clone());
        if feature.is_some() {
            self.first_touch.get_or_insert(at);
            self.touches.insert(
                touch.point_index,
                Touch {
                    sequence: touch.sequence,
                    at,
                    made: Stamp(touch.header.stamp.nanos()),
                    deviation: touch.deviation,
                    standard_uncertainty: touch.standard_uncertainty,
                },
            );
            self.changed(&[Section::Part, Section::Order]);
        }
        (
            EventKind::Touch,
            format!(
                "point {} of {}: {}",
                touch.point_index,
                feature.as_deref().unwrap_or(&touch.plan_id),
                wording::micrometres(touch.deviation)
            ),
        )
    }

    fn resulted(&mut self, result: FeatureResult) -> Happened {
        if self
            .results
            .values()
            .any(|one| one.plan_id != result.plan_id)
        {
            self.results.clear();
            self.verdicts.clear();
        }
        let run = PlanId::from(&result.plan_id).run().to_string();
        let characteristic = characteristic(&result);
        if result.decision != FeatureResult::INVALID
            && (self.runs.contains_key(&characteristic) || self.runs.len() < CHARACTERISTICS)
        {
            let made = RunChartPoint {
                run,
                deviation: result.size_deviation,
                expanded: result.expanded_uncertainty(),
                limits: None,
                contradicted: false,
            };
            let parts = self.runs.entry(characteristic).or_default();
            match parts.back_mut().filter(|last| last.run == made.run) {
                Some(last) => *last = made,
                None => push(parts, made, PARTS),
            }
            self.changed(&[Section::Runs]);
        }
        let (plan_id, feature) = (result.plan_id.clone(), result.feature_id.clone());
        self.results.insert(feature.clone(), result);
        self.limit(&feature);
        self.part_measured(&plan_id, &feature);
        self.changed(&[Section::Sizes, Section::Part]);
        None
    }

    /// Keeps the limits of a feature with the value of the part that was measured last.
    fn limit(&mut self, feature: &str) {
        let limits = self.limits(feature);
        let Some(result) = self.results.get(feature) else {
            return;
        };
        let run = PlanId::from(&result.plan_id).run().to_string();
        let made = self.runs.get_mut(&characteristic(result));
        let last = made.and_then(|made| made.back_mut());
        if let Some(last) = last.filter(|last| last.run == run) {
            last.limits = limits;
        }
    }

    fn referred(&mut self, reference: FeatureResult) -> Happened {
        let same = |one: &FeatureResult| {
            one.plan_id == reference.plan_id && one.feature_id == reference.feature_id
        };
        self.references.retain(|one| !same(one));
        let own = self.results.get(&reference.feature_id).cloned();
        push(&mut self.references, reference, REFERENCES);
        if let Some(result) = own
            && self.refuting(&result).is_some()
        {
            self.contradicted(&result.plan_id, &result.feature_id);
        }
        self.changed(&[Section::State, Section::Sizes, Section::Part]);
        None
    }

    /// A reference contradicts the readings of a feature on the part that a plan measures.
    fn contradicted(&mut self, plan_id: &str, feature_id: &str) {
        if self.ledger.contradicted(plan_id, feature_id) {
            self.changed(&[Section::Ledger]);
        }
        let part = part_of(plan_id);
        let of_feature = (self.runs.iter_mut()).filter(|(key, _)| key.1 == feature_id);
        let made = of_feature.flat_map(|(_, made)| made);
        for one in made.filter(|one| part_of_run(&one.run) == part) {
            one.contradicted = true;
        }
        for one in self.last_parts.iter_mut().filter(|one| one.run == part) {
            one.contradicted = true;
        }
        self.changed(&[Section::Runs]);
    }

    fn judged(&mut self, verdict: Verdict) -> Happened {
        let known = self.verdicts.get(&verdict.feature_id);
        if known == Some(&verdict) {
            return None;
        }
        *self.verdict_counts.entry(verdict.verdict).or_default() += 1;
        if self
            .verdicts
            .values()
            .any(|one| one.plan_id != verdict.plan_id)
        {
            self.verdicts.clear();
        }
        if self.ledger.verdict(&verdict) {
            self.changed(&[Section::Ledger]);
        }
        if verdict.verdict == Verdict::CONTRADICTED {
            self.contradicted(&verdict.plan_id, &verdict.feature_id);
        }
        let text = format!(
            "{} {}, {}",
            verdict.feature_id,
            Verdict::word(verdict.verdict),
            wording::micrometres(verdict.error)
        );
        let (plan_id, feature) = (verdict.plan_id.clone(), verdict.feature_id.clone());
        self.verdicts.insert(feature.clone(), verdict);
        self.limit(&feature);
        self.part_measured(&plan_id, &feature);
        self.changed(&[Section::State, Section::Sizes, Section::Part]);
        Some((EventKind::Verdict, text))
    }

    fn decided(&mut self, decision: PassDecision) -> Happened {
        if self.decision.as_ref() == Some(&decision) {
            return None;
        }
        let text = format!(
            "{}: {}",
            wording::decision(decision.decision),
            decision.text
        );
        self.decision = Some(decision);
        self.changed(&[Section::State]);
        Some((EventKind::Verdict, text))
    }

    fn corrected(&mut self, correction: Correction, at: Stamp) -> Happened {
        let text = format!(
            "correction of {}: {}",
            correction.feature_ids.join(", "),
            wording::approval(&correction)
        );
        let changed = self.ledger.correction(at, correction);
        self.changed(&[Section::Ledger, Section::State]);
        changed.then_some((EventKind::Correction, text))
    }

    fn acknowledged(&mut self, answer: CorrectionAcknowledgement) -> Happened {
        let text = format!(
            "correction {}: {}",
            answer.correction_id,
            wording::outcome(answer.outcome)
        );
        let changed = self.ledger.acknowledgement(answer);
        self.changed(&[Section::Ledger, Section::State]);
        changed.then_some((EventKind::Correction, text))
    }

    fn diagnosed(&mut self, report: GapReport) -> Happened {
        if self.gap.as_deref() == Some(&report) {
            return None;
        }
        self.report = serde_json::from_str(&report.json).ok().map(Arc::new);
        let text = format!(
            "gap of {}: {}, {} rms over a noise of {}",
            report.plan_id,
            wording::gap(report.verdict),
            wording::micrometres(report.rms),
            wording::micrometres(report.noise_floor)
        );
        self.part_diagnosed(&report);
        self.gap = Some(Arc::new(report));
        // A correction that waits is shown with what the diagnosis says of the probe.
        self.changed(&[Section::Why, Section::Gap, Section::State, Section::Ledger]);
        Some((EventKind::Gap, text))
    }

    fn lost(&mut self, loss: LossReport, at: Stamp) -> (EventKind, String) {
        if !loss.recovered {
            self.lost += loss.count;
        }
        let text = format!("{} messages of {}", loss.count, loss.topic);
        push(&mut self.losses, (at, loss), TROUBLES);
        self.changed(&[Section::Faults]);
        (EventKind::Loss, text)
    }

    fn failed(&mut self, fault: Fault, at: Stamp) -> (EventKind, String) {
        let text = format!("{}: {}", fault.node, fault.text);
        push(&mut self.faults, (at, fault), TROUBLES);
        self.changed(&[Section::Faults, Section::State]);
        (EventKind::Fault, text)
    }
}

fn characteristic(result: &FeatureResult) -> Characteristic {
    (
        result.part_id.clone(),
        result.feature_id.clone(),
        (result.nominal_size * 1e9).round() as i64,
    )
}

fn read<M: Message>(bytes: &[u8]) -> Option<M> {
    from_cdr(bytes).ok()
}

pub(super) fn push<T>(queue: &mut VecDeque<T>, one: T, bound: usize) {
    if queue.len() == bound {
        queue.pop_front();
    }
    queue.push_back(one);
}
