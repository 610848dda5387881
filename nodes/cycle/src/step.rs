//! The rules of `cycle`.

use graph::{NoFaults, Node, Outbox, START, Stamp};
use probecell_msgs::{
    CorrectionAcknowledgement, Fault, OperationReport, OperationRequest, OperatorReply,
    OperatorRequest, PartReport, PassDecision, PassDecisionCode, PlanId, RunId,
};

use crate::{
    config::Config,
    ports::{Input, Output},
    state::{Run, Stage, State},
};

/// Parts kept that a reference may refute yet.
const QUALIFIED_LIMIT: usize = 64;
/// Why no part is begun after a reference has refuted a measurement; a further measurement is made.
const REFUTED: &str = "no part is made until the cause is found and the cell started again";

/// The node.
pub struct CycleNode;

impl Node for CycleNode {
    const NAME: &'static str = "cycle";
    type Config = Config;
    type State = State;
    type Input = Input;
    type Output = Output;
    type Fault = NoFaults;

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
            // A restarted process must not take reports on the requests of its predecessor for its own.
            Input::Timer(START) => state.next_request = now.0.unsigned_abs(),
            Input::Timer(id) => handle_timeout(state, now, id, out),
            Input::Run(request) => handle_run_request(config, state, now, &request, out),
            Input::Report(report) => handle_report(config, state, now, &report, out),
            Input::Decision(decision) => handle_decision(config, state, now, &decision, out),
            Input::Acknowledgement(answer) => {
                handle_acknowledgement(config, state, now, answer, out);
            }
            Input::MachineFault(fault)
            | Input::ProbeFault(fault)
            | Input::PlanningFault(fault)
            | Input::AnalysisFault(fault)
            | Input::LauncherFault(fault) => {
                let invalidates = invalidates_measurements(&fault);
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
                if invalidates {
                    state.last = None;
                }
            }
        }
    }
}

/// After some faults earlier touches cannot be evaluated together with later ones: a process has lost its state, or the
/// origin of the axes may have changed.
fn invalidates_measurements(fault: &Fault) -> bool {
    let codes = [Fault::PROCESS_ENDED, Fault::CONTROLLER_RESTARTED];
    fault.severity == Fault::ERROR && codes.contains(&fault.code.as_str())
}

/// A name that can be printed on one line and kept in a file; empty where a request names nothing.
fn is_name(text: &str) -> bool {
    text.chars().count() <= 200
        && !text
            .chars()
            .any(|letter| probecell_msgs::is_unprintable(letter))
}

fn handle_run_request(
    config: &Config,
    state: &mut State,
    now: Stamp,
    asked: &OperatorRequest,
    out: &mut Outbox<Output>,
) {
    let asked_plan = PlanId::from(&asked.plan_id);
    let measured = |run: &&Run| run.stage.plan_id() == Some(&asked_plan);
    let last = state.last.as_ref().filter(measured).cloned();
    let refusal = match &state.run {
        Some(run) if matches!(run.stage, Stage::OnlyMeasuring { .. }) => {
            Some("a part is being measured")
        }
        Some(_) => Some("a part is being made"),
        None if !is_name(&asked.subject) => {
            Some("the name of the part holds a character that cannot be printed, or more than 200")
        }
        None if asked.plan_id.is_empty() && state.refuted.is_some() => Some(REFUTED),
        None => match &last {
            Some(run) if asked.subject.is_empty() || asked.subject == run.part_id => None,
            Some(_) => Some("the plan belongs to another part"),
            None if asked.subject.is_empty() => Some("the request names no part"),
            None => None,
        },
    };
    out.send(Output::Reply(OperatorReply {
        header: now.header(""),
        request_id: asked.request_id,
        accepted: refusal.is_none(),
        text: match (&state.refuted, refusal) {
            (Some(why), Some(REFUTED)) => format!("{REFUTED}: {why}"),
            (_, refusal) => refusal.unwrap_or_default().to_owned(),
        },
    }));
    if refusal.is_some() {
        return;
    }
    state.acknowledged.clear();
    state.last = None;
    if let Some(run) = last {
        return resume(state, now, run, out);
    }
    let only = !asked.plan_id.is_empty();
    let stage = if only {
        let request_id = measure(state, now, &asked_plan, 0, only, out);
        Stage::OnlyMeasuring {
            plan_id: asked_plan,
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

/// Resumes the measurement with which a part ended.
fn resume(state: &mut State, now: Stamp, mut run: Run, out: &mut Outbox<Output>) {
    match &mut run.stage {
        Stage::Measuring {
            plan_id,
            request_id,
            done,
            decision,
        } => {
            *request_id = measure(state, now, plan_id, run.pass, false, out);
            *done = false;
            *decision = None;
        }
        Stage::OnlyMeasuring {
            plan_id,
            request_id,
        } => *request_id = measure(state, now, plan_id, run.pass, true, out),
        Stage::Cutting { .. } | Stage::Correcting { .. } => return,
    }
    state.run = Some(run);
}

/// Requests a measurement and returns the number of the request.
fn measure(
    state: &mut State,
    now: Stamp,
    plan_id: &PlanId,
    pass_number: u32,
    only_measure: bool,
    out: &mut Outbox<Output>,
) -> u64 {
    let asked = OperationRequest {
        kind: OperationRequest::MEASURE,
        plan_id: plan_id.to_string(),
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
        let plan_id = PlanId::measurement(RunId::new(&run.part_id, &pass.name), run.attempt);
        let request_id = measure(state, now, &plan_id, run.pass, false, out);
        run.stage = Stage::Measuring {
            plan_id,
            request_id,
            done: false,
            decision: None,
        };
    }
    state.run = Some(run);
}

fn handle_report(
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
        let text = format!("the machine did not complete an operation: {}", report.text);
        end(state, now, PartReport::STOPPED, &text, out);
        return;
    }
    match (next, early) {
        _ if measured => {
            let text = "measured; nothing was cut, decided or corrected";
            end(state, now, PartReport::MEASURED, text, out);
        }
        (Some(index), _) => cut(config, state, now, index, out),
        (None, Some(decision)) => handle_decision(config, state, now, &decision, out),
        // Numbered by the request, so that the timer of an earlier measurement does not end this one.
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

fn handle_timeout(state: &mut State, now: Stamp, timer: u32, out: &mut Outbox<Output>) {
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
        let text = format!("no decision on {plan_id} arrived in time");
        end(state, now, PartReport::STOPPED, &text, out);
    }
}

fn handle_decision(
    config: &Config,
    state: &mut State,
    now: Stamp,
    decision: &PassDecision,
    out: &mut Outbox<Output>,
) {
    if decision.decision == PassDecision::REVOKED {
        return revoke(state, now, decision, out);
    }
    let Some(run) = &mut state.run else { return };
    let current = match &run.stage {
        Stage::Measuring { plan_id, .. } | Stage::Correcting { plan_id, .. } => {
            *plan_id == PlanId::from(&decision.plan_id)
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
    let pass = &config.passes[run.pass as usize];
    let is_last = run.pass as usize + 1 >= config.passes.len();
    let code = PassDecisionCode::try_from(decision.decision);
    match code.unwrap_or(PassDecisionCode::Stop) {
        _ if pass.for_record && !is_last => next_pass(config, state, now, out),
        PassDecisionCode::Next if !is_last => next_pass(config, state, now, out),
        PassDecisionCode::Next => {
            let run_id = PlanId::from(&decision.plan_id).run();
            let qualified = (run_id, run.part_id.clone(), run.cuts);
            state.qualified.push_back(qualified);
            if state.qualified.len() > QUALIFIED_LIMIT {
                state.qualified.pop_front();
            }
            end(state, now, PartReport::QUALIFIED, &decision.text, out);
        }
        PassDecisionCode::Recut => {
            let awaited = decision.correction_ids.iter().cloned().collect();
            run.stage = Stage::Correcting {
                plan_id: PlanId::from(&decision.plan_id),
                awaited,
            };
            recut_when_corrected(config, state, now, out);
        }
        PassDecisionCode::Scrap => end(state, now, PartReport::SCRAP, &decision.text, out),
        PassDecisionCode::Stop | PassDecisionCode::Revoked => {
            end(state, now, PartReport::STOPPED, &decision.text, out)
        }
    }
}

/// A reference refutes what was decided on: the part of it is not qualified, the one that is being made is stopped, and
/// none is begun any more.
fn revoke(state: &mut State, now: Stamp, decision: &PassDecision, out: &mut Outbox<Output>) {
    let run_id = PlanId::from(&decision.plan_id).run();
    if state.run.is_some() {
        let stop = OperationRequest {
            kind: OperationRequest::STOP,
            ..OperationRequest::default()
        };
        request(state, now, stop, out);
        end(state, now, PartReport::STOPPED, &decision.text, out);
    }
    if let Some(index) = state.qualified.iter().rposition(|(run, ..)| *run == run_id)
        && let Some((_, part_id, passes)) = state.qualified.remove(index)
    {
        out.send(Output::Part(PartReport {
            header: now.header(""),
            part_id,
            verdict: PartReport::STOPPED,
            passes,
            text: format!("not qualified any more: {}", decision.text),
            plan_id: String::new(),
        }));
    }
    state.last = None;
    state.refuted.get_or_insert_with(|| decision.text.clone());
}

fn next_pass(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    if let Some(run) = &mut state.run {
        run.pass += 1;
        run.attempt = 0;
    }
    cut(config, state, now, 0, out);
}

fn handle_acknowledgement(
    config: &Config,
    state: &mut State,
    now: Stamp,
    answer: CorrectionAcknowledgement,
    out: &mut Outbox<Output>,
) {
    if state.run.is_some() {
        state
            .acknowledged
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
        acknowledged,
        ..
    } = state
    else {
        return;
    };
    let mut refused = None;
    awaited.retain(|id| match acknowledged.get(id) {
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
        header: now.header(""),
        request_id,
        ..asked
    }));
    request_id
}

fn end(state: &mut State, now: Stamp, verdict: u8, text: &str, out: &mut Outbox<Output>) {
    if let Some(run) = state.run.take() {
        let plan_id = match &run.stage {
            Stage::OnlyMeasuring { plan_id, .. } => plan_id.to_string(),
            _ => String::new(),
        };
        out.send(Output::Part(PartReport {
            header: now.header(""),
            part_id: run.part_id.clone(),
            verdict,
            passes: run.cuts,
            text: text.to_owned(),
            plan_id,
        }));
        // A decision that asked for corrections is carried out or void.
        state.last = run.stage.plan_id().is_some().then_some(run);
    }
    state.acknowledged.clear();
}
