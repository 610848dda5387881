//! What the operator has received of the cell.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Mutex, MutexGuard, PoisonError, mpsc::Sender},
    time::{Duration, Instant},
};

use cell::Cell;
use probecell_msgs::{
    OperatorReply, Orders, PartReport, PartStatus, PassDecision, PlanProgress, Verdict, srv,
    std_msgs,
};

use super::{
    console::print_measurement,
    diagnostics::ProcessState,
    health::{Health, KNOWN},
};

/// What is received of parts.
pub(super) enum PartNews {
    /// The part that is being made.
    Status(PartStatus),
    /// A part has ended.
    Report(PartReport),
}

/// Faults kept for the service `status`.
const FAULTS: usize = 8;

/// A time as a person says it: whole seconds, minutes or hours.
fn rounded(time: Duration) -> String {
    match time.as_secs() {
        seconds @ 0..120 => format!("{seconds} s"),
        seconds @ 120..7200 => format!("{} min", seconds / 60),
        seconds => format!("{} h", seconds / 3600),
    }
}

/// State that the callbacks of subscriptions and services share.
#[derive(Default)]
pub(super) struct OperatorState {
    /// The machine is idle.
    pub(super) machine_idle: bool,
    /// What `/diagnostics` says besides the processes.
    pub(super) health: Health,
    /// `cycle` has said whether a part is being made.
    pub(super) informed: bool,
    /// The part that is being made.
    pub(super) making: PartStatus,
    /// The part that has ended last.
    pub(super) last: Option<PartReport>,
    /// The last faults and when they were received, newest last.
    faults: VecDeque<(String, Instant)>,
    /// The processes of the cell.
    pub(super) processes: Vec<ProcessState>,
    verdicts: BTreeMap<String, Vec<Verdict>>,
    /// All that they say is printed.
    verbose: bool,
    decisions: BTreeMap<String, PassDecision>,
    /// Number of characteristics that decide in each pass: so many verdicts belong to each decision.
    characteristics: Vec<usize>,
    /// The part that ended last.
    pub(super) part: Option<PartReport>,
    /// Calls that wait for a reply, by topic of the reply and number of the request.
    pub(super) pending: BTreeMap<(&'static str, u64), Sender<OperatorReply>>,
    /// When progress of a plan was received last.
    pub(super) planning: Option<Instant>,
    /// Number of the next request.
    pub(super) next_request: u64,
    /// How the action `run` takes what is received of parts; must not block.
    pub(super) on_part: Option<Box<dyn Fn(PartNews) + Send>>,
    /// How the action `plan` takes how far an order has come; must not block.
    pub(super) on_progress: Option<Box<dyn Fn(PlanProgress) + Send>>,
    /// The orders that are on disk.
    pub(super) orders: Orders,
    /// Number of the order placed last; one that was refused had one too.
    pub(super) last_order: u64,
    /// Who writes the orders to disk.
    pub(super) on_orders: Option<Sender<Orders>>,
    /// When diagnostics were published last.
    pub(super) diagnosed: Option<Instant>,
}

/// The state, locked.
pub(super) fn lock(state: &Mutex<OperatorState>) -> MutexGuard<'_, OperatorState> {
    // A panic elsewhere leaves plain data behind: there is no half-made state in it.
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

impl OperatorState {
    /// The state before anything was received.
    pub(super) fn new(cell: &Cell, verbose: bool) -> Self {
        let passes = cell.cycle.passes.iter();
        let characteristics = passes.map(|pass| {
            let all = cell.compensation.characteristics.iter();
            all.filter(|characteristic| characteristic.decides_in(&pass.name))
                .count()
        });
        Self {
            characteristics: characteristics.collect(),
            verbose,
            ..Self::default()
        }
    }

    /// Takes a verdict.
    pub(super) fn verdict(&mut self, verdict: Verdict) {
        let plan_id = verdict.plan_id.clone();
        let verdicts = self.verdicts.entry(plan_id.clone()).or_default();
        verdicts.push(verdict);
        self.print_when_complete(&plan_id);
    }

    /// Takes the decision on a pass.
    pub(super) fn decision(&mut self, decision: PassDecision) {
        let plan_id = decision.plan_id.clone();
        self.decisions.insert(plan_id.clone(), decision);
        self.print_when_complete(&plan_id);
    }

    /// Takes a fault of a node or of a process.
    pub(super) fn fault(&mut self, node: &str, code: &str, text: &str) {
        if self.faults.len() == FAULTS {
            self.faults.pop_front();
        }
        let told = format!("{node}: {code}: {text}");
        self.faults.push_back((told, Instant::now()));
    }

    /// What the cell is doing.
    pub(super) fn status(&self) -> srv::StatusResponse {
        let known = self.health.machine.as_ref();
        let known = known.filter(|(_, at)| at.elapsed() < KNOWN);
        let instant = host::now();
        srv::StatusResponse {
            header: std_msgs::Header {
                stamp: instant.time(),
                frame_id: String::new(),
            },
            execution: known.map_or(0, |(machine, _)| machine.execution),
            alarms: known.map_or(Vec::new(), |(machine, _)| machine.alarms.clone()),
            machine_known: known.is_some(),
            part: self.making.clone(),
            recording: self.health.recording.clone(),
            processes: self.processes.iter().map(|one| one.name.clone()).collect(),
            running: self.processes.iter().map(|one| one.running).collect(),
            starts: self.processes.iter().map(|one| one.starts).collect(),
            faults: (self.faults.iter())
                .map(|(told, at)| format!("{told} ({} ago)", rounded(at.elapsed())))
                .collect(),
        }
    }

    /// Tells the action `run`.
    pub(super) fn tell(&self, news: PartNews) {
        if let Some(take) = &self.on_part {
            take(news);
        }
    }

    /// Takes how far an order has come.
    pub(super) fn progress(&mut self, progress: PlanProgress) {
        self.planning = Some(Instant::now());
        if let Some(take) = &self.on_progress {
            take(progress);
        }
    }

    /// Takes the reply to a call.
    pub(super) fn reply(&mut self, topic: &'static str, reply: OperatorReply) {
        if let Some(caller) = self.pending.remove(&(topic, reply.request_id)) {
            // The caller may have given up.
            drop(caller.send(reply));
        }
    }

    /// Prints a measurement once its decision and all its verdicts have arrived: they travel on different topics.
    fn print_when_complete(&mut self, plan_id: &str) {
        let received = self.verdicts.get(plan_id).map_or(0, Vec::len);
        let expected = (self.decisions.get(plan_id))
            .and_then(|decision| self.characteristics.get(decision.pass_number as usize));
        let complete = expected.is_some_and(|expected| received >= *expected);
        if complete
            && let Some(decision) = self.decisions.remove(plan_id)
            && let Some(verdicts) = self.verdicts.remove(plan_id)
        {
            print_measurement(&decision, &verdicts, self.verbose);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_told_with_its_age() {
        let mut state = OperatorState::default();
        state.fault("machine_state", "controller_lost", "no sample for 1 s");
        let told = state.status().faults;
        assert!(
            told[0].starts_with("machine_state: controller_lost: no sample for 1 s (")
                && told[0].ends_with(" s ago)"),
            "{told:?}"
        );
        let ages = [119, 120, 7199, 7200].map(|seconds| rounded(Duration::from_secs(seconds)));
        assert_eq!(ages, ["119 s", "2 min", "119 min", "2 h"]);
    }
}
