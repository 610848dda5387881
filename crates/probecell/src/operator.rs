//! The operator's side of a cell: its services, what a person reads while a part is made, and the diagnostics.
//!
//! A service call enters the graph as a message with a number, so that it is recorded and a replay can make it again;
//! the answer is the node's, found by that number.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        mpsc::{Sender, channel},
    },
    time::{Duration, Instant},
};

use anyhow::{Context, bail};
use cell::Cell;
use graph::{Topic, topics};
use host::{
    bus::{Bus, Publisher, Received, Server, Subscription, TypeId},
    bus_qos,
};
use probecell_msgs::{
    Correction, CorrectionAcknowledgement, Fault, InspectionPlan, MachineState, Message,
    OperatorReply, OperatorRequest, PartReport, PassDecision, PlanProgress, Service, Verdict,
    diagnostic_msgs, from_cdr, srv, std_msgs, to_cdr,
};

use crate::{FAILED, GOOD, LOSS, launcher, report};

/// How long a node may take to answer an operator.
const ANSWER_PATIENCE: Duration = Duration::from_secs(10);
/// How long a plan may take in all: the cell itself answers when nothing is heard of it for [`ANSWER_PATIENCE`].
const PLAN_PATIENCE: Duration = Duration::from_secs(1800);
/// Between two diagnostics.
const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);

/// How a part ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PartEnd {
    /// All sizes in tolerance.
    pub(crate) qualified: bool,
}

#[derive(Default)]
struct Heard {
    machine: bool,
    verdicts: BTreeMap<String, Vec<Verdict>>,
    decisions: BTreeMap<String, PassDecision>,
    /// Sizes that decide in each pass: so many verdicts belong to each decision.
    sizes: Vec<usize>,
    part: Option<PartReport>,
    waiting: BTreeMap<(&'static str, u64), Sender<OperatorReply>>,
    /// When progress of a plan was heard last.
    planning: Option<Instant>,
    next_request: u64,
    diagnosed: Option<Instant>,
}

/// The operator of a running cell.
pub(crate) struct Operator {
    bus: Bus,
    namespace: String,
    heard: Arc<Mutex<Heard>>,
    gate: Arc<Gate>,
    diagnostics: Publisher,
    faults: Publisher,
    subscriptions: Vec<Subscription>,
    servers: Vec<Server>,
}

/// Where operators' calls enter the graph.
struct Gate {
    plan: Publisher,
    run: Publisher,
    approve: Publisher,
    heard: Arc<Mutex<Heard>>,
}

fn lock(heard: &Mutex<Heard>) -> MutexGuard<'_, Heard> {
    // A panic elsewhere leaves plain data behind: there is no half-made state in it.
    heard.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Heard {
    /// Tells a measurement once its decision and all its verdicts are there: they travel on different topics.
    fn tell_when_complete(&mut self, plan_id: &str) {
        let given = self.verdicts.get(plan_id).map_or(0, Vec::len);
        let awaited = (self.decisions.get(plan_id))
            .and_then(|decision| self.sizes.get(decision.pass_number as usize));
        let complete = awaited.is_some_and(|awaited| given >= *awaited);
        if complete
            && let Some(decision) = self.decisions.remove(plan_id)
            && let Some(verdicts) = self.verdicts.remove(plan_id)
        {
            tell_measurement(&decision, &verdicts);
        }
    }
}

impl Gate {
    /// Publishes a call and waits for its answer.
    fn call(
        &self,
        reply_topic: &'static str,
        request: OperatorRequest,
    ) -> Result<OperatorReply, String> {
        let publisher = match reply_topic {
            name if name == topics::PLAN_REPLIES.name => &self.plan,
            name if name == topics::RUN_REPLIES.name => &self.run,
            _ => &self.approve,
        };
        let (sender, receiver) = channel();
        let request_id = {
            let mut heard = lock(&self.heard);
            let request_id = heard.next_request;
            heard.next_request += 1;
            heard.waiting.insert((reply_topic, request_id), sender);
            request_id
        };
        let instant = host::now();
        let header = std_msgs::Header {
            stamp: instant.time(),
            frame_id: String::new(),
        };
        let request = OperatorRequest {
            header,
            request_id,
            ..request
        };
        publisher
            .publish(to_cdr(&request), instant.0)
            .map_err(|error| error.to_string())?;
        let mut until = Instant::now() + ANSWER_PATIENCE;
        let answer = loop {
            let answer = receiver.recv_timeout(until.saturating_duration_since(Instant::now()));
            // A long plan is no missing answer.
            let planning = lock(&self.heard)
                .planning
                .map(|last| last + ANSWER_PATIENCE);
            let goes_on =
                |next: &Instant| reply_topic == topics::PLAN_REPLIES.name && *next > until;
            match (&answer, planning.filter(goes_on)) {
                (Err(_), Some(next)) => until = next,
                _ => break answer,
            }
        };
        lock(&self.heard).waiting.remove(&(reply_topic, request_id));
        answer.map_err(|_| format!("no node answered within {} s", ANSWER_PATIENCE.as_secs()))
    }
}

impl Operator {
    /// Takes the operator's place in a cell.
    pub(crate) fn join(bus: Bus, cell: &Cell) -> anyhow::Result<Self> {
        let namespace = cell.namespace();
        let publisher = |topic: Topic| {
            bus.publisher(&cell.topic(topic.name), topic.message, bus_qos(topic.qos))
        };
        let passes = cell.cycle.passes.iter();
        let sizes = passes.map(|pass| {
            let all = cell.compensation.characteristics.iter();
            all.filter(|one| one.decides_in(&pass.name)).count()
        });
        let sizes = sizes.collect();
        let heard = Arc::new(Mutex::new(Heard {
            sizes,
            ..Heard::default()
        }));
        let gate = Arc::new(Gate {
            plan: publisher(topics::PLAN_REQUESTS)?,
            run: publisher(topics::RUN_REQUESTS)?,
            approve: publisher(topics::APPROVALS)?,
            heard: Arc::clone(&heard),
        });
        let diagnostics = bus.publisher(
            "/diagnostics",
            diagnostic_msgs::DiagnosticArray::TYPE,
            bus_qos(graph::Qos::reliable(10)),
        )?;
        let faults = publisher(topics::LAUNCHER_FAULTS)?;
        let mut operator = Self {
            bus,
            namespace,
            heard,
            gate,
            diagnostics,
            faults,
            subscriptions: Vec::new(),
            servers: Vec::new(),
        };
        operator.listen(&cell.text().name)?;
        operator.serve()?;
        Ok(operator)
    }

    fn listen(&mut self, file: &str) -> anyhow::Result<()> {
        self.hear(topics::MACHINE_STATE, |heard, state: MachineState| {
            heard.machine = state.execution == MachineState::EXECUTION_IDLE;
        })?;
        self.hear(topics::VERDICTS, |heard, verdict: Verdict| {
            let plan_id = verdict.plan_id.clone();
            heard
                .verdicts
                .entry(plan_id.clone())
                .or_default()
                .push(verdict);
            heard.tell_when_complete(&plan_id);
        })?;
        self.hear(topics::PASS_DECISIONS, |heard, decision: PassDecision| {
            let plan_id = decision.plan_id.clone();
            heard.decisions.insert(plan_id.clone(), decision);
            heard.tell_when_complete(&plan_id);
        })?;
        let file = file.to_owned();
        self.hear(topics::CORRECTIONS, move |_, correction: Correction| {
            tell_correction(&correction, &file);
        })?;
        self.hear(
            topics::CORRECTION_ACKNOWLEDGEMENTS,
            |_, answer: CorrectionAcknowledgement| tell_answer(&answer),
        )?;
        self.hear(topics::PART_REPORTS, |heard, part: PartReport| {
            tell_part(&part);
            heard.part = Some(part);
        })?;
        self.hear(topics::PLAN_PROGRESS, |heard, _: PlanProgress| {
            heard.planning = Some(Instant::now());
        })?;
        for topic in topics::ALL
            .iter()
            .filter(|topic| topic.name.ends_with("/faults") && topic.producer != "operator")
        {
            self.hear(*topic, |_, fault: Fault| {
                report::remark(&format!(
                    "fault {} of {}: {}",
                    fault.code, fault.node, fault.text
                ));
            })?;
        }
        for topic in [
            topics::PLAN_REPLIES,
            topics::RUN_REPLIES,
            topics::APPROVAL_REPLIES,
        ] {
            self.hear(topic, move |heard, reply: OperatorReply| {
                if let Some(waiting) = heard.waiting.remove(&(topic.name, reply.request_id)) {
                    // Who asked may have given up.
                    drop(waiting.send(reply));
                }
            })?;
        }
        Ok(())
    }

    fn hear<M: Message>(
        &mut self,
        topic: Topic,
        take: impl Fn(&mut Heard, M) + Send + Sync + 'static,
    ) -> anyhow::Result<()> {
        let heard = Arc::clone(&self.heard);
        let on_sample = move |received: Received<'_>| {
            if let Ok(message) = from_cdr::<M>(&received.payload) {
                take(&mut lock(&heard), message);
            }
        };
        let on_lost = move |lost: host::bus::Lost| {
            report::remark(&format!(
                "the operator lost {} messages on {}",
                lost.count, topic.name
            ));
        };
        let name = format!("{}/{}", self.namespace, topic.name);
        let qos = bus_qos(topic.qos);
        self.subscriptions.push(self.bus.subscribe(
            &name,
            topic.message,
            qos,
            Box::new(on_sample),
            Box::new(on_lost),
        )?);
        Ok(())
    }

    fn serve(&mut self) -> anyhow::Result<()> {
        self.offer::<srv::Plan>(
            "plan",
            topics::PLAN_REPLIES,
            |request| OperatorRequest {
                subject: request.plan_id,
                points: request.points,
                ..OperatorRequest::default()
            },
            |accepted, text| srv::PlanResponse { accepted, text },
        )?;
        self.offer::<srv::Run>(
            "run",
            topics::RUN_REPLIES,
            |request| OperatorRequest {
                subject: request.part_id,
                plan_id: request.plan_id,
                ..OperatorRequest::default()
            },
            |accepted, text| srv::RunResponse { accepted, text },
        )?;
        self.offer::<srv::ApproveCorrection>(
            "approve_correction",
            topics::APPROVAL_REPLIES,
            |request| OperatorRequest {
                subject: request.correction_id,
                operator_name: request.operator_name,
                approve: request.approve,
                ..OperatorRequest::default()
            },
            |accepted, text| srv::ApproveCorrectionResponse { accepted, text },
        )
    }

    fn offer<S: Service>(
        &mut self,
        name: &str,
        reply: Topic,
        ask: fn(S::Request) -> OperatorRequest,
        answer: fn(bool, String) -> S::Response,
    ) -> anyhow::Result<()> {
        let gate = Arc::clone(&self.gate);
        let handler = move |request: &[u8]| {
            let request = from_cdr::<S::Request>(request).map_err(|error| error.to_string())?;
            let reply = gate.call(reply.name, ask(request))?;
            Ok(to_cdr(&answer(reply.accepted, reply.text)))
        };
        let name = format!("{}/{name}", self.namespace);
        self.servers
            .push(self.bus.serve(&name, S::TYPE, Box::new(handler))?);
        Ok(())
    }

    /// The machine is idle, and everybody hears a request for a part.
    pub(crate) fn ready(&self) -> bool {
        let topic = topics::RUN_REQUESTS;
        let heard = self.bus.graph().subscriptions(
            &format!("{}/{}", self.namespace, topic.name),
            &TypeId::from(topic.message),
        );
        lock(&self.heard).machine && heard > 0
    }

    /// What is missing.
    pub(crate) fn not_ready(&self) -> &'static str {
        if lock(&self.heard).machine {
            "nobody hears requests for parts"
        } else {
            "the machine is not idle"
        }
    }

    /// Asks for a part; a refusal is an error.
    pub(crate) fn ask_for_part(&self, part: &str) -> anyhow::Result<()> {
        let request = OperatorRequest {
            subject: part.to_owned(),
            operator_name: "up".to_owned(),
            ..OperatorRequest::default()
        };
        let reply = self
            .gate
            .call(topics::RUN_REPLIES.name, request)
            .map_err(launcher::Failed)?;
        if !reply.accepted {
            bail!(launcher::Failed(format!(
                "the cell does not make the part: {}",
                reply.text
            )));
        }
        Ok(())
    }

    /// How the part ended, once.
    pub(crate) fn part_ended(&self) -> Option<PartEnd> {
        let part = lock(&self.heard).part.take()?;
        Some(PartEnd {
            qualified: part.verdict == PartReport::QUALIFIED,
        })
    }

    /// Tells the cell that a process has ended. The part under way ends with it, unless that process only looks on.
    pub(crate) fn tell_ended(&self, name: &str, text: &str) {
        let instant = host::now();
        let fault = Fault {
            header: std_msgs::Header {
                stamp: instant.time(),
                frame_id: String::new(),
            },
            node: name.to_owned(),
            severity: if name == "gap" {
                Fault::WARNING
            } else {
                Fault::ERROR
            },
            code: "process_ended".to_owned(),
            text: text.to_owned(),
        };
        if let Err(error) = self.faults.publish(to_cdr(&fault), instant.0) {
            report::remark(&format!("a fault could not be published: {error}"));
        }
    }

    /// Publishes the state of the processes on `/diagnostics`, once a second.
    pub(crate) fn tell_processes(&self, states: &[(String, bool, u32)]) {
        let mut heard = lock(&self.heard);
        if heard
            .diagnosed
            .is_some_and(|last| last.elapsed() < DIAGNOSTICS_PERIOD)
        {
            return;
        }
        heard.diagnosed = Some(Instant::now());
        drop(heard);
        let instant = host::now();
        let status = states
            .iter()
            .map(|(name, runs, starts)| diagnostic_msgs::DiagnosticStatus {
                level: if *runs {
                    diagnostic_msgs::DiagnosticStatus::OK
                } else {
                    diagnostic_msgs::DiagnosticStatus::ERROR
                },
                name: format!("{}/{name}", self.namespace),
                message: if *runs {
                    "runs"
                } else {
                    "ended; it is started again"
                }
                .to_owned(),
                hardware_id: String::new(),
                values: vec![diagnostic_msgs::KeyValue {
                    key: "starts".to_owned(),
                    value: starts.to_string(),
                }],
            });
        let array = diagnostic_msgs::DiagnosticArray {
            header: std_msgs::Header {
                stamp: instant.time(),
                frame_id: String::new(),
            },
            status: status.collect(),
        };
        if let Err(error) = self.diagnostics.publish(to_cdr(&array), instant.0) {
            report::remark(&format!("diagnostics could not be published: {error}"));
        }
    }

    /// Leaves the cell.
    pub(crate) fn leave(mut self) -> anyhow::Result<()> {
        self.servers.clear();
        self.subscriptions.clear();
        self.bus.close(Duration::from_secs(2))?;
        Ok(())
    }
}

/// `probecell run`: a call of the cell's service.
pub(crate) fn ask_for_part(file: &Path, part: &str) -> anyhow::Result<u8> {
    let request = srv::RunRequest {
        part_id: part.to_owned(),
        plan_id: String::new(),
    };
    let response: srv::RunResponse = call::<srv::Run>(file, "run", &request)?;
    Ok(tell_reply(response.accepted, &response.text))
}

/// `probecell measure`: goes on with the plan that the cell published last; `again` are points of it that are measured
/// once more.
pub(crate) fn measure(file: &Path, again: &[u32]) -> anyhow::Result<u8> {
    let (cell, bus) = open(file)?;
    let plan = last_plan(&bus, &cell)?;
    let mut points = Vec::new();
    for &index in again {
        let point = plan.points.get(index as usize);
        points.push(point.cloned().with_context(|| {
            let (id, count) = (&plan.plan_id, plan.points.len());
            format!("point {index} is not in plan {id:?}, which has {count} points from 0")
        })?);
    }
    let plan_id = plan.plan_id;
    let asked = srv::PlanRequest {
        plan_id: plan_id.clone(),
        points,
    };
    let planned = ask_for_plan(&bus, &cell.namespace(), &asked)?;
    report::line(&format!("{plan_id}: {}", planned.text));
    let mut status = FAILED;
    if planned.accepted {
        let asked = srv::RunRequest {
            part_id: String::new(),
            plan_id,
        };
        let run = ask::<srv::Run>(&bus, &cell, "run", &asked)?;
        status = tell_reply(run.accepted, &run.text);
    }
    bus.close(Duration::from_secs(2))?;
    Ok(status)
}

/// Asks a running cell for a plan; a person at a terminal sees how far it is.
pub(crate) fn ask_for_plan(
    bus: &Bus,
    namespace: &str,
    asked: &srv::PlanRequest,
) -> anyhow::Result<srv::PlanResponse> {
    let topic = topics::PLAN_PROGRESS;
    let on_sample = |received: Received<'_>| {
        if let Ok(progress) = from_cdr::<PlanProgress>(&received.payload) {
            report::progress(&progress);
        }
    };
    let subscription = bus.subscribe(
        &format!("{namespace}/{}", topic.name),
        topic.message,
        bus_qos(topic.qos),
        Box::new(on_sample),
        Box::new(|_| {}),
    )?;
    let answered = bus.call_patiently(
        &format!("{namespace}/plan"),
        srv::Plan::TYPE,
        &to_cdr(asked),
        ANSWER_PATIENCE,
        PLAN_PATIENCE,
    );
    drop(subscription);
    report::end_progress();
    from_cdr(&answered?).context("the answer is not of the service's type")
}

/// The plan that a running cell published last.
fn last_plan(bus: &Bus, cell: &Cell) -> anyhow::Result<InspectionPlan> {
    let topic = topics::INSPECTION_PLAN;
    let (sender, receiver) = channel();
    let on_sample = move |received: Received<'_>| {
        // Who asked may have got one already.
        drop(sender.send(from_cdr::<InspectionPlan>(&received.payload)));
    };
    let subscription = bus.subscribe(
        &cell.topic(topic.name),
        topic.message,
        bus_qos(topic.qos),
        Box::new(on_sample),
        Box::new(|_| {}),
    )?;
    let heard = receiver.recv_timeout(ANSWER_PATIENCE);
    drop(subscription);
    let heard = heard.map_err(|_| {
        let seconds = ANSWER_PATIENCE.as_secs();
        launcher::Failed(format!(
            "no plan was heard within {seconds} s: the cell has measured nothing"
        ))
    })?;
    heard.context("the plan heard is not of its type")
}

/// `probecell approve`: a call of the cell's service.
pub(crate) fn approve(
    file: &Path,
    correction: &str,
    operator: &str,
    approve: bool,
) -> anyhow::Result<u8> {
    let (correction_id, operator_name) = (correction.to_owned(), operator.to_owned());
    let request = srv::ApproveCorrectionRequest {
        correction_id,
        operator_name,
        approve,
    };
    let response = call::<srv::ApproveCorrection>(file, "approve_correction", &request)?;
    Ok(tell_reply(response.accepted, &response.text))
}

/// `probecell recording start`: a call of the cell's service.
pub(crate) fn start_recording(file: &Path, name: &str) -> anyhow::Result<u8> {
    let request = srv::StartRecordingRequest {
        uri: name.to_owned(),
    };
    let response = call::<srv::StartRecording>(file, "start_recording", &request)?;
    report::line(&if response.accepted {
        format!("records in {}", response.uri)
    } else {
        response.text
    });
    Ok(if response.accepted { GOOD } else { FAILED })
}

/// `probecell recording stop`: a call of the cell's service.
pub(crate) fn stop_recording(file: &Path) -> anyhow::Result<u8> {
    let request = srv::StopRecordingRequest::default();
    let response = call::<srv::StopRecording>(file, "stop_recording", &request)?;
    if !response.accepted {
        report::line(&response.text);
        return Ok(FAILED);
    }
    report::line(&format!(
        "recorded {} messages in {}",
        response.messages, response.uri
    ));
    if response.text.is_empty() {
        return Ok(GOOD);
    }
    report::remark(&response.text);
    Ok(LOSS)
}

fn tell_reply(accepted: bool, text: &str) -> u8 {
    report::line(if accepted { "accepted" } else { text });
    if accepted { GOOD } else { FAILED }
}

/// The cell of a file, and its bus to call services on.
fn open(file: &Path) -> anyhow::Result<(Cell, Bus)> {
    let cell = Cell::read(file)?;
    let bus = Bus::open(
        &launcher::bus_config(&cell)?,
        "operator_call",
        &cell.namespace(),
    )?;
    Ok((cell, bus))
}

fn call<S: Service>(file: &Path, name: &str, request: &S::Request) -> anyhow::Result<S::Response> {
    let (cell, bus) = open(file)?;
    let response = ask::<S>(&bus, &cell, name, request)?;
    bus.close(Duration::from_secs(2))?;
    Ok(response)
}

fn ask<S: Service>(
    bus: &Bus,
    cell: &Cell,
    name: &str,
    request: &S::Request,
) -> anyhow::Result<S::Response> {
    let response = bus.call(
        &cell.topic(name),
        S::TYPE,
        &to_cdr(request),
        ANSWER_PATIENCE,
    )?;
    from_cdr(&response).context("the answer is not of the service's type")
}

fn tell_measurement(decision: &PassDecision, verdicts: &[Verdict]) {
    report::line(&decision.plan_id);
    for verdict in verdicts {
        let (size, error) = (verdict.size * 1e3, verdict.error * 1e6);
        let word = verdict_word(verdict.verdict);
        let note = if verdict.text.is_empty() {
            String::new()
        } else {
            format!("  {}", verdict.text)
        };
        report::line(&format!(
            "  {:<8} {size:9.4} mm  {error:+7.1} µm  {word}{note}",
            verdict.feature_id
        ));
    }
    let next = match decision.decision {
        PassDecision::NEXT => "next pass",
        PassDecision::RECUT => "correct and repeat the pass",
        PassDecision::SCRAP => "scrap",
        _ => "stop",
    };
    report::line(&format!("  {}: {next}", decision.text));
}

fn verdict_word(verdict: u8) -> &'static str {
    match verdict {
        Verdict::QUALIFIED => "qualified",
        Verdict::COMPENSABLE => "can be corrected",
        Verdict::OVERCUT_NOT_COMPENSABLE => "overcut",
        Verdict::TOOL_WORN => "tool worn",
        Verdict::NOT_CONVERGED => "does not converge",
        _ => "not measured",
    }
}

/// `file`: the cell file, to name in what an operator is to type.
fn tell_correction(correction: &Correction, file: &str) {
    let (from, to) = (correction.previous_value * 1e6, correction.new_value * 1e6);
    let who = match correction.approval {
        Correction::APPROVAL_NONE => format!(
            "waits for approval: probecell approve {} --operator NAME --cell {file}",
            correction.correction_id
        ),
        Correction::APPROVAL_REJECTED => format!("rejected by {}", correction.approved_by),
        _ => format!("approved by {}", correction.approved_by),
    };
    let what = match correction.kind {
        Correction::TOOL_PATH => format!("tool path of {}", correction.feature_ids.join(", ")),
        Correction::VOLUMETRIC => "volumetric table, largest displacement".to_owned(),
        Correction::WORK_OFFSET => format!("the work offset of {}", correction.axis),
        _ => format!("tool {}", correction.tool_number),
    };
    report::line(&format!(
        "  correction of {what}: {from:+.1} -> {to:+.1} µm, {who}"
    ));
    for entry in records::table_entries(correction) {
        let [name, from, to, bound, u] = entry;
        report::line(&format!(
            "    {name}: {from} -> {to} (u {u}, bound {bound})"
        ));
    }
}

fn tell_answer(answer: &CorrectionAcknowledgement) {
    let (before, after) = (answer.value_before * 1e6, answer.value_after * 1e6);
    let word = match answer.outcome {
        CorrectionAcknowledgement::APPLIED => {
            format!("applied: the controller read {before:+.1}, now reads {after:+.1} µm")
        }
        CorrectionAcknowledgement::ALREADY_APPLIED => "applied before".to_owned(),
        _ => format!("refused: {}", answer.text),
    };
    report::line(&format!("  {}: {word}", answer.correction_id));
}

fn tell_part(part: &PartReport) {
    if part.verdict == PartReport::MEASURED {
        report::line(&format!("plan {}: {}", part.plan_id, part.text));
        return;
    }
    let word = match part.verdict {
        PartReport::QUALIFIED => "qualified",
        PartReport::SCRAP => "scrap",
        _ => "stopped",
    };
    report::line(&format!(
        "part {}: {word} after {} cuts: {}",
        part.part_id, part.passes, part.text
    ));
}
