//! The rules of `cycle`.

use graph::{START, Stamp};
use probecell_msgs::{
    CorrectionAcknowledgement, Fault, OperationReport, OperationRequest, OperatorReply,
    OperatorRequest, Order, PartReport, PartStatus, PassDecision, PassDecisionCode, PlanId, RunId,
};

use crate::{
    config::Config,
    ending::end,
    orders,
    ports::{Input, Out, Output},
    requests,
    run::{NOTHING_RESUMED, begin, measure, refusal, resume},
    state::{REFUTED, Run, Stage, State, Stopping},
};

/// Parts kept that a reference may refute yet.
const QUALIFIED_LIMIT: usize = 64;

/// Processes one input at the instant `now`.
pub(crate) fn step(config: &Config, state: &mut State, now: Stamp, input: Input, out: &mut Out) {
    let before = requests::stage(state);
    let orders_before = state.book.list.clone();
    match input {
        // A restarted process must not take reports on the requests of its predecessor for its own.
        Input::Timer(START) => state.next_request = now.0.unsigned_abs(),
        Input::Timer(_) => requests::tick(config, state, now, out),
        Input::Run(request) => handle_run_request(config, state, now, &request, out),
        Input::Report(report) => handle_report(config, state, now, &report, out),
        Input::Decision(decision) => handle_decision(config, state, now, &decision, out),
        Input::Acknowledgement(answer) => {
            handle_acknowledgement(config, state, now, answer, out);
        }
        Input::Supervised(status) => {
            let first = !state.informed;
            handle_supervised(state, now, &status, out);
            if first {
                // Only now a part can be asked for.
                requests::publish(config, state, now, out);
            }
        }
        Input::Stop(request) => {
            let text = orders::by("stopped", &request.operator_name);
            requests::stop(state, now, &text, out);
        }
        Input::MachineFault(fault)
        | Input::ProbeFault(fault)
        | Input::PlanningFault(fault)
        | Input::AnalysisFault(fault)
        | Input::LauncherFault(fault) => handle_fault(state, now, &fault, out),
        Input::OrderRequest(request) => orders::request(state, now, request),
        Input::KeptOrders(kept) => state.book.take_kept(kept),
    }
    if let Some(order) = orders::due(state) {
        begin_ordered(config, state, now, &order, out);
    }
    orders::settle(state, now, &orders_before, out);
    if requests::stage(state) != before {
        requests::publish(config, state, now, out);
    }
    requests::wake(state, now, out);
}

/// A fault of severity ERROR stops machine and part.
fn handle_fault(state: &mut State, now: Stamp, fault: &Fault, out: &mut Out) {
    if fault.severity == Fault::ERROR {
        let text = format!("{}: {}: {}", fault.node, fault.code, fault.text);
        requests::stop(state, now, &text, out);
    }
    if invalidates_measurements(fault) {
        state.last = None;
        // Of a driver that was restarted the launcher says that it ended, before or after.
        if fault.code == Fault::CONTROLLER_RESTARTED {
            let text = "the driver was restarted, what it measured is void";
            state.void = Some(text.to_owned());
        } else if state.void.is_none() {
            state.void = Some(format!("what was measured is void: {}", fault.text));
        }
        if let Some(stopping) = state.run.as_mut().and_then(|run| run.stopping.as_mut()) {
            stopping.void = true;
        }
    }
}

/// What `machine_state` knows of the parts: an earlier process of this node may have left one behind, whose end is
/// reported here.
fn handle_supervised(state: &mut State, now: Stamp, known: &PartStatus, out: &mut Out) {
    state.informed = true;
    state.runs = state.runs.max(known.run_number);
    if known.stage == PartStatus::NONE || state.used.contains(&known.run_id) {
        return;
    }
    state.used.insert(known.run_id.clone());
    out.send(Output::Part(PartReport {
        header: now.header(""),
        part_id: known.part_id.clone(),
        run_id: known.run_id.clone(),
        verdict: PartReport::STOPPED,
        text: "cycle was restarted while the part was made".to_owned(),
        ..PartReport::default()
    }));
}

/// After some faults earlier touches cannot be evaluated together with later ones: a process has lost its state, or the
/// origin of the axes may have changed.
fn invalidates_measurements(fault: &Fault) -> bool {
    let codes = [Fault::PROCESS_ENDED, Fault::CONTROLLER_RESTARTED];
    fault.severity == Fault::ERROR && codes.contains(&fault.code.as_str())
}

fn handle_run_request(
    config: &Config,
    state: &mut State,
    now: Stamp,
    asked: &OperatorRequest,
    out: &mut Out,
) {
    // What is delivered again is no further request. Those that have expired are refused anyway.
    (state.recent).retain(|known| now <= Stamp::from(&known.expires));
    if state.recent.contains(asked) {
        return;
    }
    if Stamp::from(&asked.expires) != Stamp(0) {
        state.recent.push(asked.clone());
    }
    let asked_plan = PlanId::from(&asked.plan_id);
    let measured = |run: &&Run| run.stage.plan_id() == Some(&asked_plan);
    let last = state.last.as_ref().filter(measured).cloned();
    let refusal = refusal(state, now, asked, last.as_ref());
    out.send(Output::Reply(OperatorReply {
        header: now.header(""),
        request_id: asked.request_id,
        accepted: refusal.is_none(),
        text: match (&state.refuted, refusal) {
            (Some(why), Some(REFUTED)) => format!("{REFUTED}: {why}"),
            (_, Some(NOTHING_RESUMED)) => {
                let why = state.void.as_deref().or(state.refuted.as_deref());
                let why = why
                    .unwrap_or("the last measurement is not one of this plan that was broken off");
                format!("{NOTHING_RESUMED}: {why}")
            }
            (_, refusal) => refusal.unwrap_or_default().to_owned(),
        },
    }));
    if refusal.is_some() {
        return;
    }
    forget_last(state);
    if let Some(run) = last {
        return resume(state, now, run, out);
    }
    let mut run = begin(state, now, &asked.subject);
    if asked.plan_id.is_empty() {
        state.run = Some(run);
        return cut(config, state, now, 0, out);
    }
    let request_id = measure(state, now, &mut run, &asked_plan, true, out);
    run.stage = Stage::OnlyMeasuring {
        plan_id: asked_plan,
        request_id,
    };
    state.run = Some(run);
}

/// What belongs to the part that was made last is over.
fn forget_last(state: &mut State) {
    state.acknowledged.clear();
    state.last = None;
    state.void = None;
}

/// Begins a part of an order.
fn begin_ordered(config: &Config, state: &mut State, now: Stamp, order: &Order, out: &mut Out) {
    forget_last(state);
    let mut run = begin(state, now, &order.part_id);
    run.order_id = order.order_id;
    orders::begun(state, &run);
    state.run = Some(run);
    cut(config, state, now, 0, out);
}

/// Cuts operation `index` of the pass, or measures when all are cut.
fn cut(config: &Config, state: &mut State, now: Stamp, index: usize, out: &mut Out) {
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
        let request_id = requests::request(state, now, &mut run, asked, out);
        run.stage = Stage::Cutting { index, request_id };
    } else {
        run.cuts += u32::from(!pass.operations.is_empty());
        run.attempt += 1;
        let plan_id = PlanId::measurement(RunId::new(&run.run_id, &pass.name), run.attempt);
        let request_id = measure(state, now, &mut run, &plan_id, false, out);
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
    out: &mut Out,
) {
    let Some(run) = &mut state.run else { return };
    if !requests::take_report(run, now, report) {
        return;
    }
    if let Some(Stopping {
        request_id, text, ..
    }) = &run.stopping
    {
        if *request_id == report.request_id {
            let text = if report.outcome == OperationReport::DONE {
                text.clone()
            } else {
                format!(
                    "{text}; the machine has not confirmed its standstill: {}",
                    report.text
                )
            };
            end(state, now, PartReport::STOPPED, &text, out);
        }
        return;
    }
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
        if report.outcome == OperationReport::REFUSED {
            // Nothing was begun.
            end(state, now, PartReport::STOPPED, &text, out);
        } else {
            requests::stop(state, now, &text, out);
        }
        return;
    }
    match (next, early) {
        _ if measured => {
            let text = "measured; nothing was cut, decided or corrected";
            end(state, now, PartReport::MEASURED, text, out);
        }
        (Some(index), _) => cut(config, state, now, index, out),
        (None, Some(decision)) => handle_decision(config, state, now, &decision, out),
        // The decision is awaited.
        (None, None) => {}
    }
}

fn handle_decision(
    config: &Config,
    state: &mut State,
    now: Stamp,
    decision: &PassDecision,
    out: &mut Out,
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
    if !current || run.stopping.is_some() {
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
            run.since = now;
            recut_when_corrected(config, state, now, out);
        }
        PassDecisionCode::Scrap => end(state, now, PartReport::SCRAP, &decision.text, out),
        PassDecisionCode::Stop | PassDecisionCode::Revoked => {
            end(state, now, PartReport::STOPPED, &decision.text, out);
        }
    }
}

/// A reference refutes what was decided on: the part of it is not qualified, the one that is being made is stopped, and
/// none is begun any more.
fn revoke(state: &mut State, now: Stamp, decision: &PassDecision, out: &mut Out) {
    let run_id = PlanId::from(&decision.plan_id).run();
    requests::stop(state, now, &decision.text, out);
    if let Some(stopping) = state.run.as_mut().and_then(|run| run.stopping.as_mut()) {
        stopping.void = true;
    }
    if let Some(index) = state.qualified.iter().rposition(|(run, ..)| *run == run_id)
        && let Some((run, part_id, passes)) = state.qualified.remove(index)
    {
        // The run of a measurement is that of the part, and the pass.
        let run = run.to_string();
        let run = run.rsplit_once('/').map_or(run.as_str(), |(run, _)| run);
        out.send(Output::Part(PartReport {
            header: now.header(""),
            part_id,
            verdict: PartReport::STOPPED,
            passes,
            text: format!("not qualified any more: {}", decision.text),
            plan_id: String::new(),
            run_id: run.to_owned(),
        }));
    }
    state.last = None;
    state.refuted.get_or_insert_with(|| decision.text.clone());
}

fn next_pass(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
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
    out: &mut Out,
) {
    if state.run.is_some() {
        state
            .acknowledged
            .insert(answer.correction_id, (answer.outcome, answer.text));
        recut_when_corrected(config, state, now, out);
    }
}

fn recut_when_corrected(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let State {
        run:
            Some(Run {
                stage: Stage::Correcting { awaited, .. },
                stopping: None,
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
