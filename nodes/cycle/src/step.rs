//! The rules of `cycle`.

use std::collections::{BTreeMap, BTreeSet};

use graph::{Node, Outbox, START, Stamp, inputs, outputs, topics};
use probecell_msgs::{
    CorrectionAcknowledgement, Fault, OperationReport, OperationRequest, OperatorReply,
    OperatorRequest, PartReport, PassDecision, std_msgs,
};
use serde::{Deserialize, Serialize};

use crate::config::Config;

inputs! {
    /// What `cycle` hears.
    pub enum Input {
        /// An operator wants a part.
        Run(OperatorRequest) = topics::RUN_REQUESTS,
        /// What came of an operation.
        Report(OperationReport) = topics::OPERATION_REPORTS,
        /// What follows from a measurement.
        Decision(PassDecision) = topics::PASS_DECISIONS,
        /// What became of a correction.
        Acknowledgement(CorrectionAcknowledgement) = topics::CORRECTION_ACKNOWLEDGEMENTS,
        /// Faults of `machine_state`.
        MachineFault(Fault) = topics::MACHINE_STATE_FAULTS,
        /// Faults of `probe_events`.
        ProbeFault(Fault) = topics::PROBE_EVENTS_FAULTS,
        /// Faults of `path_planning`.
        PlanningFault(Fault) = topics::PATH_PLANNING_FAULTS,
        /// Faults of `analysis`.
        AnalysisFault(Fault) = topics::ANALYSIS_FAULTS,
        /// Faults of the processes, told by who started them.
        LauncherFault(Fault) = topics::LAUNCHER_FAULTS,
    }
}

outputs! {
    /// What `cycle` says.
    pub enum Output {
        /// What the machine shall do next.
        Request(OperationRequest) = topics::OPERATION_REQUESTS,
        /// How a part ended.
        Part(PartReport) = topics::PART_REPORTS,
        /// The answer to an operator.
        Reply(OperatorReply) = topics::RUN_REPLIES,
    }
}

/// The memory of `cycle`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The part that is being made.
    pub run: Option<Run>,
    /// The part that ended last, where it ended with a measurement that can go on: nothing was cut or corrected since.
    pub last: Option<Run>,
    /// Number of the next operation request.
    pub next_request: u64,
    /// Outcome of each correction of this part that the machine has answered.
    pub answered: BTreeMap<String, (u8, String)>,
}

/// A part that is being made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// The part.
    pub part_id: String,
    /// Index of the pass.
    pub pass: u32,
    /// Measurements of this pass so far.
    pub attempt: u32,
    /// Machining passes made, recuts counted.
    pub cuts: u32,
    /// What is under way.
    pub stage: Stage,
}

/// What is under way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Stage {
    /// The machine cuts operation `index` of the pass.
    Cutting {
        /// Index of the operation.
        index: usize,
        /// The request that it answers.
        request_id: u64,
    },
    /// The machine measures.
    Measuring {
        /// The plan.
        plan_id: String,
        /// The request that it answers.
        request_id: u64,
        /// The machine has finished; only the decision is awaited.
        done: bool,
        /// The decision, when it comes before the machine has finished: it waits until the probe is out of the way.
        decision: Option<PassDecision>,
    },
    /// The machine measures, and nothing follows from it.
    OnlyMeasuring {
        /// The plan.
        plan_id: String,
        /// The request that it answers.
        request_id: u64,
    },
    /// Corrections are awaited before the pass is cut again.
    Correcting {
        /// The plan that asks for them.
        plan_id: String,
        /// Corrections not answered yet.
        awaited: BTreeSet<String>,
    },
}

impl Stage {
    /// The plan that is measured.
    fn plan_id(&self) -> Option<&str> {
        match self {
            Self::Measuring { plan_id, .. } | Self::OnlyMeasuring { plan_id, .. } => Some(plan_id),
            Self::Cutting { .. } | Self::Correcting { .. } => None,
        }
    }
}

/// The node.
pub struct CycleNode;

impl Node for CycleNode {
    const NAME: &'static str = "cycle";
    type Config = Config;
    type State = State;
    type Input = Input;
    type Output = Output;

    fn start(_config: &Config) -> State {
        State::default()
    }

    fn step(
        config: &Config,
        state: &mut State,
        now: Stamp,
        input: Input,
        out: &mut Outbox<Output>,
    ) {
        match input {
            // A process that follows another one must not take the answers to that one's requests for its own.
            Input::Timer(START) => state.next_request = now.0.unsigned_abs(),
            Input::Timer(id) => overdue(state, now, id, out),
            Input::Run(request) => run(config, state, now, &request, out),
            Input::Report(report) => reported(config, state, now, &report, out),
            Input::Decision(decision) => decided(config, state, now, &decision, out),
            Input::Acknowledgement(answer) => acknowledged(config, state, now, answer, out),
            Input::MachineFault(fault)
            | Input::ProbeFault(fault)
            | Input::PlanningFault(fault)
            | Input::AnalysisFault(fault)
            | Input::LauncherFault(fault) => {
                let forgets = forgets(&fault);
                if fault.severity == Fault::ERROR && state.run.is_some() {
                    request(
                        state,
                        now,
                        OperationRequest {
                            kind: OperationRequest::STOP,
                            ..OperationRequest::default()
                        },
                        out,
                    );
                    let text = format!("{}: {}: {}", fault.node, fault.code, fault.text);
                    end(state, now, PartReport::STOPPED, &text, out);
                }
                if forgets {
                    state.last = None;
                }
            }
        }
    }
}

/// After some faults what was measured before cannot be relied on together with what is measured next: a process has
/// lost its memory, or the axes may have another origin.
fn forgets(fault: &Fault) -> bool {
    let codes = ["process_ended", "controller_restarted"];
    fault.severity == Fault::ERROR && codes.contains(&fault.code.as_str())
}

fn run(
    config: &Config,
    state: &mut State,
    now: Stamp,
    asked: &OperatorRequest,
    out: &mut Outbox<Output>,
) {
    let measured = |run: &&Run| run.stage.plan_id() == Some(asked.plan_id.as_str());
    let last = state.last.as_ref().filter(measured).cloned();
    let refusal = match &state.run {
        Some(run) if matches!(run.stage, Stage::OnlyMeasuring { .. }) => {
            Some("a part is being measured")
        }
        Some(_) => Some("a part is being made"),
        None => match &last {
            Some(run) if asked.subject.is_empty() || asked.subject == run.part_id => None,
            Some(_) => Some("the plan is of another part"),
            None if asked.subject.is_empty() => Some("the part has no name"),
            None => None,
        },
    };
    out.send(Output::Reply(OperatorReply {
        header: header(now),
        request_id: asked.request_id,
        accepted: refusal.is_none(),
        text: refusal.unwrap_or_default().to_owned(),
    }));
    if refusal.is_some() {
        return;
    }
    state.answered.clear();
    state.last = None;
    if let Some(run) = last {
        return go_on(state, now, run, out);
    }
    let only = !asked.plan_id.is_empty();
    let stage = if only {
        let plan_id = asked.plan_id.clone();
        let request_id = measure(state, now, plan_id.clone(), 0, only, out);
        Stage::OnlyMeasuring {
            plan_id,
            request_id,
        }
    } else {
        Stage::Cutting {
            index: 0,
            request_id: 0,
        }
    };
    state.run = Some(Run {
        part_id: asked.subject.clone(),
        pass: 0,
        attempt: 0,
        cuts: 0,
        stage,
    });
    if !only {
        cut(config, state, now, 0, out);
    }
}

/// Goes on with the measurement at which a part ended.
fn go_on(state: &mut State, now: Stamp, mut run: Run, out: &mut Outbox<Output>) {
    match &mut run.stage {
        Stage::Measuring {
            plan_id,
            request_id,
            done,
            decision,
        } => {
            *request_id = measure(state, now, plan_id.clone(), run.pass, false, out);
            *done = false;
            *decision = None;
        }
        Stage::OnlyMeasuring {
            plan_id,
            request_id,
        } => *request_id = measure(state, now, plan_id.clone(), run.pass, true, out),
        Stage::Cutting { .. } | Stage::Correcting { .. } => return,
    }
    state.run = Some(run);
}

/// Asks for a measurement; gives the number of the request.
fn measure(
    state: &mut State,
    now: Stamp,
    plan_id: String,
    pass_number: u32,
    only_measure: bool,
    out: &mut Outbox<Output>,
) -> u64 {
    let asked = OperationRequest {
        kind: OperationRequest::MEASURE,
        plan_id,
        pass_number,
        only_measure,
        ..OperationRequest::default()
    };
    request(state, now, asked, out)
}

/// Cuts operation `index` of the pass, or measures when all are cut.
fn cut(config: &Config, state: &mut State, now: Stamp, index: usize, out: &mut Outbox<Output>) {
    let Some(mut run) = state.run.take() else {
        return;
    };
    let pass = &config.passes[run.pass as usize];
    if let Some(operation) = pass.operations.get(index) {
        let kind = OperationRequest::CUT;
        let asked = OperationRequest {
            kind,
            operation: operation.clone(),
            pass_number: run.pass,
            ..OperationRequest::default()
        };
        let request_id = request(state, now, asked, out);
        run.stage = Stage::Cutting { index, request_id };
    } else {
        run.cuts += u32::from(!pass.operations.is_empty());
        run.attempt += 1;
        let plan_id = format!("{}/{}/{}", run.part_id, pass.name, run.attempt);
        let request_id = measure(state, now, plan_id.clone(), run.pass, false, out);
        run.stage = Stage::Measuring {
            plan_id,
            request_id,
            done: false,
            decision: None,
        };
    }
    state.run = Some(run);
}

fn reported(
    config: &Config,
    state: &mut State,
    now: Stamp,
    report: &OperationReport,
    out: &mut Outbox<Output>,
) {
    let Some(run) = &mut state.run else { return };
    let (mut early, mut measured) = (None, false);
    let next = match &mut run.stage {
        Stage::Cutting { index, request_id } if *request_id == report.request_id => {
            Some(*index + 1)
        }
        Stage::Measuring {
            request_id,
            done,
            decision,
            ..
        } if *request_id == report.request_id => {
            *done = true;
            early = decision.take();
            None
        }
        Stage::OnlyMeasuring { request_id, .. } if *request_id == report.request_id => {
            measured = true;
            None
        }
        _ => return,
    };
    if report.outcome != OperationReport::DONE {
        let text = format!(
            "the machine did not carry out what it was asked: {}",
            report.text
        );
        end(state, now, PartReport::STOPPED, &text, out);
        return;
    }
    match (next, early) {
        _ if measured => {
            let text = "measured; nothing was cut, decided or corrected";
            end(state, now, PartReport::MEASURED, text, out);
        }
        (Some(index), _) => cut(config, state, now, index, out),
        (None, Some(decision)) => decided(config, state, now, &decision, out),
        // Numbered by the request, so that a timer of an earlier measurement says nothing about this one.
        (None, None) => out.wake_at(
            now.after_s(config.decision_limit),
            timer_of(report.request_id),
        ),
    }
}

/// The timer of a request: never [`START`].
fn timer_of(request_id: u64) -> u32 {
    (request_id & 0x7fff_ffff) as u32 + 1
}

fn overdue(state: &mut State, now: Stamp, timer: u32, out: &mut Outbox<Output>) {
    let Some(Run {
        stage:
            Stage::Measuring {
                request_id,
                done: true,
                plan_id,
                ..
            },
        ..
    }) = &state.run
    else {
        return;
    };
    if timer_of(*request_id) == timer {
        let text = format!("no decision on {plan_id} came in time");
        end(state, now, PartReport::STOPPED, &text, out);
    }
}

fn decided(
    config: &Config,
    state: &mut State,
    now: Stamp,
    decision: &PassDecision,
    out: &mut Outbox<Output>,
) {
    let Some(run) = &mut state.run else { return };
    let current = match &run.stage {
        Stage::Measuring { plan_id, .. } | Stage::Correcting { plan_id, .. } => {
            *plan_id == decision.plan_id
        }
        Stage::Cutting { .. } | Stage::OnlyMeasuring { .. } => false,
    };
    if !current {
        return;
    }
    if let Stage::Measuring {
        done: false,
        decision: early,
        ..
    } = &mut run.stage
    {
        *early = Some(decision.clone());
        return;
    }
    let for_record = config.passes[run.pass as usize].for_record;
    match decision.decision {
        _ if for_record && (run.pass as usize) + 1 < config.passes.len() => {
            run.pass += 1;
            run.attempt = 0;
            cut(config, state, now, 0, out);
        }
        PassDecision::NEXT if (run.pass as usize) + 1 < config.passes.len() => {
            run.pass += 1;
            run.attempt = 0;
            cut(config, state, now, 0, out);
        }
        PassDecision::NEXT => end(state, now, PartReport::QUALIFIED, &decision.text, out),
        PassDecision::RECUT => {
            let awaited = decision.correction_ids.iter().cloned().collect();
            run.stage = Stage::Correcting {
                plan_id: decision.plan_id.clone(),
                awaited,
            };
            recut_when_corrected(config, state, now, out);
        }
        PassDecision::SCRAP => end(state, now, PartReport::SCRAP, &decision.text, out),
        _ => end(state, now, PartReport::STOPPED, &decision.text, out),
    }
}

fn acknowledged(
    config: &Config,
    state: &mut State,
    now: Stamp,
    answer: CorrectionAcknowledgement,
    out: &mut Outbox<Output>,
) {
    if state.run.is_some() {
        state
            .answered
            .insert(answer.correction_id, (answer.outcome, answer.text));
        recut_when_corrected(config, state, now, out);
    }
}

fn recut_when_corrected(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    let State {
        run:
            Some(Run {
                stage: Stage::Correcting { awaited, .. },
                ..
            }),
        answered,
        ..
    } = state
    else {
        return;
    };
    let mut refused = None;
    awaited.retain(|id| match answered.get(id) {
        None => true,
        Some((
            CorrectionAcknowledgement::APPLIED | CorrectionAcknowledgement::ALREADY_APPLIED,
            _,
        )) => false,
        Some((_, text)) => {
            refused = Some(format!("correction {id} was refused: {text}"));
            false
        }
    });
    let corrected = awaited.is_empty();
    if let Some(text) = refused {
        end(state, now, PartReport::STOPPED, &text, out);
    } else if corrected {
        cut(config, state, now, 0, out);
    }
}

fn request(
    state: &mut State,
    now: Stamp,
    asked: OperationRequest,
    out: &mut Outbox<Output>,
) -> u64 {
    let request_id = state.next_request;
    state.next_request += 1;
    out.send(Output::Request(OperationRequest {
        header: header(now),
        request_id,
        ..asked
    }));
    request_id
}

fn end(state: &mut State, now: Stamp, verdict: u8, text: &str, out: &mut Outbox<Output>) {
    if let Some(run) = state.run.take() {
        let plan_id = match &run.stage {
            Stage::OnlyMeasuring { plan_id, .. } => plan_id.clone(),
            _ => String::new(),
        };
        out.send(Output::Part(PartReport {
            header: header(now),
            part_id: run.part_id.clone(),
            verdict,
            passes: run.cuts,
            text: text.to_owned(),
            plan_id,
        }));
        // A decision that asked for corrections is carried out or void.
        state.last = run.stage.plan_id().is_some().then_some(run);
    }
    state.answered.clear();
}

fn header(now: Stamp) -> std_msgs::Header {
    std_msgs::Header {
        stamp: now.time(),
        frame_id: String::new(),
    }
}
