//! The state of one cell, as its topics give it.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use diagnosis::Report;
use effects::vocabulary;
use graph::Stamp;
use metrology::conformance::contradiction;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{
    Fault, FeatureResult, GapReport, InspectionPlan, LossReport, MachineState, MeasurementOrder,
    Orders, PartReport, PartStatus, PassDecision, PlanProgress, RecordingStatus, Verdict, from_cdr,
    geometrical,
};

use super::course::{Course, Doing, LastPart, Signal, Trend};
use super::ledger::{Entry, Ledger};
use super::wording;

/// A cell that has said nothing for longer is stale: well above the period of `machine_state`, which speaks at least ten
/// times a second.
const STALE_S: f64 = 2.0;

/// Parts of the page of a cell that change independently.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Section {
    /// State, part, decision.
    State,
    /// The part with its touches.
    Part,
    /// Measuring order.
    Order,
    /// Sizes.
    Sizes,
    /// Run charts.
    Runs,
    /// Corrections.
    Ledger,
    /// Faults and losses.
    Faults,
    /// How large the gap is, and what to do.
    Why,
    /// Gap report.
    Gap,
    /// Axes and temperatures.
    Axes,
}

impl Section {
    /// All, in the order of the page.
    pub const ALL: [Self; 10] = [
        Self::Part,
        Self::State,
        Self::Why,
        Self::Ledger,
        Self::Sizes,
        Self::Gap,
        Self::Runs,
        Self::Order,
        Self::Faults,
        Self::Axes,
    ];
}

/// How much a cell needs a person; the most urgent first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Attention {
    /// Alarm, emergency stop, or a part that ended badly.
    Act,
    /// A correction waits for approval, or a decision asks for somebody.
    Decide,
    /// Silent, or unsure: something should be looked at.
    Look,
    /// Working.
    Working,
    /// Nothing to do.
    Idle,
}

impl Attention {
    /// Somebody must act, decide or look.
    pub fn needs_a_person(self) -> bool {
        self <= Self::Look
    }
}

/// The newest touch of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Number of the event.
    pub sequence: u64,
    /// When it was received.
    pub at: Stamp,
    /// When it was made, by the clock of the cell.
    pub made: Stamp,
    /// m, along the outward normal; material in excess is positive.
    pub deviation: f64,
    /// m.
    pub standard_uncertainty: f64,
}

/// A deviation of size of one part, for a run chart.
#[derive(Clone, Debug, PartialEq)]
pub struct RunChartPoint {
    /// The run, and the pass of it, that was measured last.
    pub run: String,
    /// m, size minus nominal.
    pub deviation: f64,
    /// m, expanded.
    pub expanded: f64,
    /// Limits of the deviation by which this part was judged, m.
    pub limits: Option<(f64, f64)>,
    /// A reference contradicts the readings of this feature on this part: the value says nothing of the process.
    pub contradicted: bool,
}

/// Characteristic whose values are comparable over parts: drawing, feature, nominal size (nm).
pub type Characteristic = (String, String, i64);

/// What is known of one cell. Bounds: one plan, order, report and joint state; 64 corrections; 256 references; 48 faults and losses each; 200
/// parts of 128 characteristics; the last 25 parts; a course of 96 intervals, trends of 16 places and 32 signals; results and touches of the plan only.
#[derive(Clone, Debug, Default)]
pub struct CellState {
    /// Namespace without its first slash.
    pub name: String,
    /// All that is known of it is what a storage has kept: it is not live.
    pub kept: bool,
    /// Version of the program that it runs, `0.1.0 (8d17e5fa)`; empty where it does not say.
    pub version: String,
    /// It says another version than that of whoever reads it.
    pub says_another: bool,
    /// What differs in its messages, by topic: a text for each field, or why they are not read.
    pub differs: BTreeMap<String, Vec<String>>,
    /// First and last reception.
    pub heard: Option<(Stamp, Stamp)>,
    /// Instant from which on none of its processes was on the bus.
    pub left: Option<Stamp>,
    pub(super) machine_bytes: Vec<u8>,
    pub(super) joints_bytes: Vec<u8>,
    /// Description of the machine (URDF), at most 1 MiB.
    pub description: Arc<str>,
    /// The part that is being made.
    pub part: PartStatus,
    /// The part that was being made when the cell fell silent.
    pub(super) interrupted: Option<PartStatus>,
    /// The last parts that ended, newest last.
    pub ended: VecDeque<PartReport>,
    /// Reports of parts that ended, by verdict.
    pub parts: BTreeMap<u8, u64>,
    /// Of these, those that a later report of the same part has replaced: a reference may revoke what was qualified.
    pub(super) revoked: BTreeMap<u8, u64>,
    /// Reports that hold, of parts that were qualified before and are not any more.
    pub(super) revocations: u64,
    /// Verdicts, by code.
    pub verdict_counts: BTreeMap<u8, u64>,
    /// The plan.
    pub plan: Option<Arc<InspectionPlan>>,
    /// Its measuring order.
    pub order: Option<Arc<MeasurementOrder>>,
    /// Newest touch of each point of the plan.
    pub touches: BTreeMap<u32, Touch>,
    /// First touch of the plan.
    pub first_touch: Option<Stamp>,
    /// Touches since the first message of the cell.
    pub touch_count: u64,
    /// Results of the plan measured last, by feature.
    pub results: BTreeMap<String, FeatureResult>,
    /// Verdicts of the plan measured last, by feature.
    pub verdicts: BTreeMap<String, Verdict>,
    /// What outside instruments found, newest last.
    pub(super) references: VecDeque<FeatureResult>,
    /// The newest decision on a pass.
    pub(super) decision: Option<PassDecision>,
    /// Values over parts.
    pub runs: BTreeMap<Characteristic, VecDeque<RunChartPoint>>,
    /// The last parts, newest last.
    pub last_parts: VecDeque<LastPart>,
    /// What it did over the last hours.
    pub course: Course,
    /// Temperatures (°C) by place, feed override (%) and spindle speed (1/min).
    pub trends: BTreeMap<String, Trend>,
    /// Signals of controllers beside the machine, by name.
    pub signals: BTreeMap<String, Signal>,
    /// What it says that it does.
    pub(super) doing: Option<Doing>,
    pub(super) ledger: Ledger,
    /// The newest gap report.
    pub gap: Option<Arc<GapReport>>,
    /// The same in full, where it can be read.
    pub report: Option<Arc<Report>>,
    /// The newest faults.
    pub faults: VecDeque<(Stamp, Fault)>,
    /// The newest losses.
    pub losses: VecDeque<(Stamp, LossReport)>,
    /// Messages reported as lost and not recovered.
    pub lost: u64,
    /// Whether it is recorded.
    pub recording: Option<RecordingStatus>,
    /// Parts that operators have ordered.
    pub orders: Orders,
    /// The newest progress of planning; that of a plan that is made stays.
    pub(super) progress: Option<PlanProgress>,
    /// How often each section has changed.
    pub revisions: BTreeMap<Section, u64>,
    /// Number of its newest event in the hall.
    pub(crate) last_event: u64,
    /// Alarms of the machine, as its state of last reports them.
    pub(super) alarms: Vec<String>,
}

impl CellState {
    pub(super) fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            ..Self::default()
        }
    }

    /// A cell of which only kept state is known. Its sections differ from those of a live one that takes its place.
    pub(super) fn of_kept(name: &str) -> Self {
        Self {
            kept: true,
            revisions: Section::ALL.map(|one| (one, 1 << 32)).into(),
            ..Self::new(name)
        }
    }

    pub(super) fn changed(&mut self, sections: &[Section]) {
        for section in sections {
            *self.revisions.entry(*section).or_default() += 1;
        }
    }

    /// Parts that ended, by the word for the end that holds.
    pub fn ended_counts(&self) -> Vec<(&'static str, u64)> {
        let replaced = |verdict| self.revoked.get(verdict).copied().unwrap_or_default();
        let counts = (self.parts.iter()).flat_map(|(verdict, count)| {
            let left = count.saturating_sub(replaced(verdict));
            let revocations = match *verdict {
                PartReport::STOPPED => self.revocations.min(left),
                _ => 0,
            };
            [
                (PartReport::word(*verdict), left - revocations),
                ("not qualified any more", revocations),
            ]
        });
        counts.filter(|(_, count)| *count > 0).collect()
    }

    /// The verdict on a result of the plan measured last.
    pub fn verdict_on(&self, result: &FeatureResult) -> Option<&Verdict> {
        let verdict = self.verdicts.get(&result.feature_id)?;
        (verdict.plan_id == result.plan_id).then_some(verdict)
    }

    /// The limits of a feature's deviation (m): those that its verdict applied, else those of the plan.
    pub fn limits(&self, feature: &str) -> Option<(f64, f64)> {
        let result = self.results.get(feature);
        let of_plan = self.plan.as_ref().and_then(|plan| {
            let own = plan.features.iter().find(|one| one.id == feature)?;
            let (lower, upper) = (own.lower_tolerance, own.upper_tolerance);
            (upper > lower && lower.is_finite() && upper.is_finite()).then_some((lower, upper))
        });
        let zone = result.is_some_and(|one| geometrical::named(one.kind).is_some());
        let lowest = if zone { 0.0 } else { -1.0 };
        let verdict = match result {
            Some(result) => self.verdict_on(result),
            None => self.verdicts.get(feature),
        };
        let of_verdict = verdict.map(|one| (lowest * one.tolerance, one.tolerance));
        (of_verdict.filter(|(_, upper)| *upper > 0.0 && upper.is_finite())).or(of_plan)
    }

    /// The reference that contradicts a result, as the cell itself decides it: E_n > 1 (ISO 13528:2015, 9.7), or out of
    /// tolerance what was qualified.
    pub fn refuting(&self, result: &FeatureResult) -> Option<&FeatureResult> {
        let same = |one: &&FeatureResult| {
            one.plan_id == result.plan_id && one.feature_id == result.feature_id
        };
        let reference = self.references.iter().rfind(same)?;
        let measured = |one: &FeatureResult| one.decision != FeatureResult::INVALID;
        if !measured(result) || !measured(reference) {
            return None;
        }
        let accepted = (self.verdict_on(result))
            .filter(|one| matches!(one.verdict, Verdict::QUALIFIED | Verdict::CONTRADICTED))
            .map(|one| one.tolerance);
        contradiction(
            (result.compared_deviations(), result.expanded_uncertainty()),
            (
                reference.compared_deviations(),
                reference.expanded_uncertainty(),
            ),
            accepted,
        )
        .map(|_| reference)
    }

    /// Why the readings of this cell may be wrong, a sentence without its stop: its diagnosis names the probe as a cause of the
    /// gap, alone or among others.
    pub fn doubt(&self) -> Option<String> {
        let report = self.report.as_ref()?;
        let is_of_probe = |one: &&String| one.starts_with("probe.");
        let suspect = report.effects.iter().find_map(|effect| {
            let mut own = std::iter::once(&effect.effect).chain(&effect.group);
            Some((effect, own.find(is_of_probe)?))
        });
        let (effect, cause) = suspect?;
        let rivals = match effect.group.len() {
            0 | 1 => String::new(),
            count => format!(", one of {count} causes"),
        };
        let words = vocabulary::describe(cause);
        Some(format!(
            "the probe may be wrong ({}{rivals}): check it first, the error may be of the readings",
            vocabulary::short(&words),
        ))
    }

    /// State of the machine.
    pub fn machine(&self) -> Option<MachineState> {
        from_cdr(&self.machine_bytes).ok()
    }

    /// Positions of the axes.
    pub fn joints(&self) -> Option<JointState> {
        from_cdr(&self.joints_bytes).ok()
    }

    /// s since the last message.
    pub fn age_s(&self, now: Stamp) -> f64 {
        self.heard
            .map_or(f64::INFINITY, |(_, last)| now.since_s(last).max(0.0))
    }

    /// It has said nothing for two seconds, none of its processes is on the bus, or only kept state of it is known.
    pub fn is_stale(&self, now: Stamp) -> bool {
        self.kept || self.left.is_some() || self.age_s(now) > STALE_S
    }

    /// The version that it runs, where that is another than that of whoever reads it.
    pub fn other_version(&self) -> Option<&str> {
        match (self.says_another, self.differs.is_empty()) {
            (true, _) => Some(&self.version),
            (false, false) => Some("another version"),
            (false, true) => None,
        }
    }

    /// A part is being made.
    pub fn is_making(&self) -> bool {
        self.part.stage != PartStatus::NONE
    }

    /// A part that the cell was making when it fell silent, and of which it knows nothing any more.
    pub fn interrupted(&self) -> Option<&PartStatus> {
        (self.interrupted.as_ref()).filter(|_| !self.is_making())
    }

    /// Of the verdicts on the plan measured last the one that is worst, of equals that whose error takes most of its tolerance.
    pub fn worst_verdict(&self) -> Option<&Verdict> {
        let rank = |one: &Verdict| match one.verdict {
            Verdict::QUALIFIED => 0,
            Verdict::COMPENSABLE => 1,
            Verdict::INDETERMINATE => 2,
            _ => 3,
        };
        let worse = |a: &&Verdict, b: &&Verdict| {
            let used = |one: &Verdict| one.error.abs() / one.tolerance.max(f64::MIN_POSITIVE);
            let by_error = || used(a).total_cmp(&used(b));
            rank(a).cmp(&rank(b)).then_with(by_error)
        };
        self.verdicts.values().max_by(worse)
    }

    /// What was decided on the part that is shown: that which is being made, else that which ended last.
    pub fn decision(&self) -> Option<&PassDecision> {
        let ended = || self.ended.back().map(|last| &last.run_id);
        let run = match self.interrupted() {
            Some(part) => Some(&part.run_id),
            None if self.is_making() => Some(&self.part.run_id),
            None => ended(),
        };
        let of_run = |one: &&PassDecision| {
            run.is_none_or(|run| {
                (one.plan_id.strip_prefix(run)).is_some_and(|rest| rest.starts_with('/'))
            })
        };
        self.decision.as_ref().filter(of_run)
    }

    /// Planning that is under way.
    pub fn planning(&self) -> Option<&PlanProgress> {
        (self.progress.as_ref()).filter(|one| one.phase < PlanProgress::DONE)
    }

    /// Corrections, newest last.
    pub fn corrections(&self) -> impl DoubleEndedIterator<Item = &Entry> {
        self.ledger.entries.iter()
    }

    /// Corrections that wait for a person.
    pub fn waiting(&self, now: Stamp) -> impl Iterator<Item = &Entry> {
        self.corrections().filter(move |one| one.is_waiting(now))
    }

    /// Gap over noise; none without a report or without noise.
    pub fn gap_ratio(&self) -> Option<f64> {
        let gap = self.gap.as_ref()?;
        let ratio = gap.rms / gap.noise_floor;
        ratio.is_finite().then_some(ratio)
    }

    /// How much it needs a person, and why, in a few words.
    pub fn attention(&self, now: Stamp) -> (Attention, String) {
        let machine = self.machine();
        let execution = machine.as_ref().map(|one| one.execution);
        if self.is_stale(now) {
            let what = if self.is_making() {
                let how = match self.left {
                    Some(_) => "left the bus",
                    None => "silent",
                };
                let text = format!("{how} while making {}", self.part.part_id);
                (Attention::Act, text)
            } else if self.kept {
                (Attention::Look, "not live: kept state".to_owned())
            } else if self.left.is_some() {
                (Attention::Look, "left the bus".to_owned())
            } else {
                (Attention::Look, "silent".to_owned())
            };
            return what;
        }
        match (execution, self.alarms.first()) {
            (_, Some(alarm)) => return (Attention::Act, alarm.clone()),
            (Some(MachineState::EXECUTION_ALARM), _) => {
                return (Attention::Act, "alarm".to_owned());
            }
            (Some(MachineState::EXECUTION_ESTOP), _) => {
                return (Attention::Act, "emergency stop".to_owned());
            }
            _ => {}
        }
        if let Some(one) = self.waiting(now).next() {
            let features = one.correction.feature_ids.join(", ");
            let mut text = match self.waiting(now).count() {
                1 => format!("decide on correction of {features}"),
                count => format!("decide on {count} corrections"),
            };
            if self.doubt().is_some() {
                text.push_str("; the probe may be wrong");
            }
            return (Attention::Decide, text);
        }
        if let Some(part) = self.interrupted() {
            let text = format!("{} was interrupted: the cell ended", part.part_id);
            return (Attention::Act, text);
        }
        if !self.is_making()
            && let Some(last) = self.ended.back()
            && matches!(last.verdict, PartReport::SCRAP | PartReport::STOPPED)
        {
            let what = if last.verdict == PartReport::SCRAP {
                "is scrap"
            } else if last.is_revocation() {
                "is not qualified any more"
            } else {
                "was stopped"
            };
            return (Attention::Act, format!("{} {what}", last.part_id));
        }
        if let Some(open) = self.report.as_deref().and_then(open_in) {
            return (Attention::Look, open);
        }
        if self.is_making() || execution == Some(MachineState::EXECUTION_RUNNING) {
            return (Attention::Working, "nothing to do".to_owned());
        }
        (Attention::Idle, "nothing to do".to_owned())
    }
}

/// What a diagnosis leaves to a person, in about five words; none where there is no gap.
fn open_in(report: &Report) -> Option<String> {
    match report.verdict {
        diagnosis::Verdict::Unexplained => return Some("gap not explained".to_owned()),
        diagnosis::Verdict::PartlyExplained => return Some("gap partly explained".to_owned()),
        diagnosis::Verdict::NoGap => return None,
        diagnosis::Verdict::Explained => {}
    }
    if let Some(rivals) = report.effects.iter().find(|one| one.group.len() > 1) {
        let causes = rivals.group.len();
        let proposed = report.next_measurement.iter();
        let proposed = proposed.max_by_key(|one| one.points.len());
        return Some(match proposed.map(|one| (one.points.len(), one.chance)) {
            Some((count, chance)) if count > 0 => {
                let will = if chance < 0.5 { "may" } else { "would" };
                format!("{count} touches {will} decide between {causes} causes")
            }
            _ => format!("no touch decides between {causes} causes"),
        });
    }
    let closed = |one: &diagnosis::report::Effect| one.rms_before.powi(2) - one.rms_after.powi(2);
    let remedied = (report.effects.iter()).filter_map(|one| Some((closed(one), one.remedy()?)));
    let first = remedied.max_by(|a, b| a.0.total_cmp(&b.0));
    first.map(|(_, remedy)| wording::in_short(&remedy).to_owned())
}
