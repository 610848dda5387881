//! The operator's side of a running cell.
//!
//! | module | content |
//! |---|---|
//! | [`services`] | `plan`, `run`, `stop`, `approve_correction`: a call enters the graph as a numbered message, so that it is recorded and a replay can repeat it |
//! | [`action`] | what all actions have: goals, statuses, results, cancels |
//! | [`run_action`], [`plan_action`] | `run` and `plan` as actions |
//! | [`state`] | what was received, by the callbacks of the bus |
//! | [`orders`] | the orders on disk, and the service `manage_orders` |
//! | [`keys`] | the operators' keys in force, signed by the cell's |
//! | [`console`] | what a person reads while a part is made |
//! | [`diagnostics`], [`health`] | `/diagnostics`, and faults of processes that ended |
//! | [`transforms`] | the cell's frames on `/tf` and `/tf_static` |

mod action;
mod console;
mod diagnostics;
mod health;
mod keys;
pub(crate) mod orders;
mod plan_action;
pub(crate) mod private;
mod run_action;
mod services;
mod state;
mod transforms;

use std::{
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use anyhow::bail;
use cell::{Cell, keys::KeyFolder};
use graph::{Topic, topics};
use host::{
    bus::{Bus, Graph, Publisher, Received, Server, Subscription, TypeId},
    bus_qos,
    private::{PrivateServices, SocketFile},
    sim_time::SimulatedClock,
};
use probecell_msgs::{
    Correction, CorrectionAcknowledgement, Fault, GapReport, LossReport, MachineState, Message,
    OperatorReply, OperatorRequest, Orders, PartReport, PartStatus, PassDecision, PlanProgress,
    RecordingStatus, Verdict, from_cdr, std_msgs, to_cdr,
};

use self::{
    action::Event,
    console::{print_acknowledgement, print_correction, print_fault, print_part},
    diagnostics::Diagnostics,
    keys::Keys,
    services::RequestPublishers,
    state::{OperatorState, PartNews, lock},
};
pub(crate) use self::{console::described, diagnostics::ProcessState};
use session_io::embedded;

use crate::{cell_bus::CellFailure, output, ros_arguments};

/// How a part ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PartEnd {
    /// All characteristics are in tolerance.
    pub(crate) qualified: bool,
}

/// The operator of a running cell.
pub(crate) struct Operator {
    bus: Bus,
    namespace: String,
    state: Arc<Mutex<OperatorState>>,
    requests: Arc<RequestPublishers>,
    diagnostics: Diagnostics,
    keys: Keys,
    waiver: Option<Publisher>,
    /// The cell file, for late joiners.
    _description: Publisher,
    subscriptions: Vec<Subscription>,
    servers: Vec<Server>,
    private: Option<SocketFile>,
}

impl Operator {
    /// Joins the cell: subscribes to its topics and offers its services, also by the private socket. `verbose`: prints all that the
    /// verdicts say. `clock`: the simulated clock of the cell.
    pub(crate) fn join(
        bus: Bus,
        cell: &Cell,
        verbose: bool,
        private: Option<PrivateServices>,
        clock: Option<Arc<SimulatedClock>>,
    ) -> anyhow::Result<Self> {
        let namespace = cell.namespace();
        let state = Arc::new(Mutex::new(OperatorState::new(cell, verbose)));
        let requests = Arc::new(RequestPublishers::new(&bus, cell, &state, clock.clone())?);
        let mut operator = Self {
            diagnostics: Diagnostics::new(&bus, cell)?,
            keys: Keys::new(&bus, cell)?,
            servers: Vec::new(),
            private: None,
            waiver: None,
            _description: describe(&bus, cell)?,
            bus,
            namespace,
            state,
            requests,
            subscriptions: Vec::new(),
        };
        orders::keep(&operator.bus, cell, &operator.state, clock)?;
        operator.subscribe_to_all(&cell.text().name)?;
        let relayed = transforms::relay(&operator.bus, cell)?;
        operator.subscriptions.extend(relayed);
        let mut services = services::all(&operator.requests);
        services.push(orders::service(&operator.requests));
        operator.servers = services::serve(&operator.bus, &operator.namespace, &services)?;
        if let Some(listener) = private {
            let answered = private::all(&services, &operator.state);
            operator.private = Some(listener.serve(answered)?);
        }
        let (bus, namespace) = (&operator.bus, &operator.namespace);
        let (run, parts) = run_action::serve(bus, namespace, &operator.requests)?;
        let (plan, orders) = plan_action::serve(bus, namespace, &operator.requests)?;
        operator.servers.extend(run.into_iter().chain(plan));
        // The threads of the actions end with the process only.
        let on_part = move |news| drop(parts.send(Event::News(run_action::News::Part(news))));
        let on_progress =
            move |progress| drop(orders.send(Event::News(plan_action::News::Progress(progress))));
        let mut state = lock(&operator.state);
        state.on_part = Some(Box::new(on_part));
        state.on_progress = Some(Box::new(on_progress));
        drop(state);
        Ok(operator)
    }

    /// `file`: the cell file, for the commands that a person is to type.
    fn subscribe_to_all(&mut self, file: &str) -> anyhow::Result<()> {
        self.subscribe(topics::MACHINE_STATE, |state, machine: MachineState| {
            state.machine_idle = machine.execution == MachineState::EXECUTION_IDLE;
            state.health.machine(machine);
        })?;
        self.subscribe(topics::PART_STATUS, |state, status: PartStatus| {
            state.informed = true;
            state.tell(PartNews::Status(status.clone()));
            state.making = status;
        })?;
        self.subscribe(
            topics::RECORDING_STATUS,
            |state, status: RecordingStatus| state.health.recording = status,
        )?;
        self.subscribe(topics::VERDICTS, |state, verdict: Verdict| {
            state.verdict(verdict);
        })?;
        self.subscribe(topics::PASS_DECISIONS, |state, decision: PassDecision| {
            state.decision(decision);
        })?;
        let file = format!("{file}{}", ros_arguments::for_commands());
        self.subscribe(topics::CORRECTIONS, move |state, correction: Correction| {
            state.health.correction(&correction);
            print_correction(&correction, &file);
        })?;
        self.subscribe(
            topics::CORRECTION_ACKNOWLEDGEMENTS,
            |state, answer: CorrectionAcknowledgement| {
                state.health.answered(&answer.correction_id);
                print_acknowledgement(&answer);
            },
        )?;
        self.subscribe(topics::PART_REPORTS, |state, part: PartReport| {
            print_part(&part);
            state.health.part_ended();
            state.tell(PartNews::Report(part.clone()));
            state.last = Some(part.clone());
            state.part = Some(part);
        })?;
        self.subscribe(topics::ORDERS, |state, orders: Orders| {
            if let Some(keep) = &state.on_orders {
                // The thread of the file ends with the process only.
                drop(keep.send(orders));
            }
        })?;
        self.subscribe(topics::LOSS_REPORTS, |state, loss: LossReport| {
            state.health.loss(&loss);
        })?;
        self.subscribe(topics::GAP_REPORT, |state, report: GapReport| {
            state.health.gap(report);
        })?;
        self.subscribe(topics::PLAN_PROGRESS, |state, progress: PlanProgress| {
            state.progress(progress);
        })?;
        for topic in topics::ALL
            .iter()
            .filter(|topic| topic.name.ends_with("/faults") && topic.producer != "operator")
        {
            self.subscribe(*topic, |state, fault: Fault| {
                state.fault(&fault.node, &fault.code, &fault.text);
                print_fault(&fault);
            })?;
        }
        for topic in [
            topics::PLAN_REPLIES,
            topics::RUN_REPLIES,
            topics::STOP_REPLIES,
            topics::ORDER_REPLIES,
            topics::APPROVAL_REPLIES,
        ] {
            self.subscribe(topic, move |state, reply: OperatorReply| {
                state.reply(topic.name, reply);
            })?;
        }
        Ok(())
    }

    fn subscribe<M: Message>(
        &mut self,
        topic: Topic,
        on_message: impl Fn(&mut OperatorState, M) + Send + Sync + 'static,
    ) -> anyhow::Result<()> {
        let state = Arc::clone(&self.state);
        let on_sample = move |received: Received<'_>| {
            if let Ok(message) = from_cdr::<M>(&received.payload) {
                on_message(&mut lock(&state), message);
            }
        };
        let on_lost = move |lost: host::bus::Lost| {
            output::remark(&format!(
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

    /// The machine is idle, and a request for a part has a subscriber.
    pub(crate) fn ready(&self) -> bool {
        let topic = topics::RUN_REQUESTS;
        let subscribers = self.bus.graph().subscriptions(
            &format!("{}/{}", self.namespace, topic.name),
            &TypeId::from(topic.message),
        );
        let state = lock(&self.state);
        state.machine_idle && state.informed && subscribers > 0
    }

    /// What is announced on the bus.
    pub(crate) fn graph(&self) -> Graph {
        self.bus.graph()
    }

    /// A part is being made.
    pub(crate) fn is_making(&self) -> bool {
        lock(&self.state).making.stage != PartStatus::NONE
    }

    /// Stops machine and part; an error says that the machine has not confirmed it.
    pub(crate) fn stop(&self, operator: &str) -> Result<(), CellFailure> {
        let request = OperatorRequest {
            operator_name: operator.to_owned(),
            ..OperatorRequest::default()
        };
        let reply = self.requests.call(topics::STOP_REPLIES.name, request);
        match reply {
            Ok(reply) if reply.accepted => Ok(()),
            Ok(reply) => Err(CellFailure(reply.text)),
            Err(text) => Err(CellFailure(text)),
        }
    }

    /// Declares that the operator wants no recording: operations start without one.
    pub(crate) fn waive_recording(&mut self, namespace: &str) -> anyhow::Result<()> {
        let topic = topics::RECORDING_STATUS;
        let name = format!("{namespace}/{}", topic.name);
        let publisher = self
            .bus
            .publisher(&name, topic.message, bus_qos(topic.qos))?;
        let instant = host::now();
        let waived = RecordingStatus {
            header: instant.header(""),
            state: RecordingStatus::WAIVED,
            ..RecordingStatus::default()
        };
        publisher.publish(to_cdr(&waived), instant.0)?;
        // Late joiners ask it for the message.
        self.waiver = Some(publisher);
        Ok(())
    }

    /// Publishes a warning of the launcher itself.
    pub(crate) fn warn(&self, code: &str, text: &str) {
        lock(&self.state).fault("launcher", code, text);
        self.diagnostics.publish_warning(code, text);
    }

    /// Why the cell is not ready.
    pub(crate) fn not_ready(&self) -> &'static str {
        if lock(&self.state).machine_idle {
            "no node subscribes to requests for parts"
        } else {
            "the machine is not idle"
        }
    }

    /// Requests a part.
    ///
    /// # Errors
    /// [`CellFailure`] when the cell refuses it or does not answer.
    pub(crate) fn request_part(&self, part: &str) -> anyhow::Result<()> {
        let request = OperatorRequest {
            subject: part.to_owned(),
            operator_name: "up".to_owned(),
            expires: services::expiry().time(),
            ..OperatorRequest::default()
        };
        let reply = self
            .requests
            .call(topics::RUN_REPLIES.name, request)
            .map_err(CellFailure)?;
        if !reply.accepted {
            bail!(CellFailure(format!(
                "the cell refuses the part: {}",
                reply.text
            )));
        }
        Ok(())
    }

    /// How the part ended, once.
    pub(crate) fn part_ended(&self) -> Option<PartEnd> {
        let part = lock(&self.state).part.take()?;
        Some(PartEnd {
            qualified: part.verdict == PartReport::QUALIFIED,
        })
    }

    /// Publishes a fault for a process that has ended. The part under way is stopped, unless that process only observes.
    pub(crate) fn report_ended(&self, name: &str, text: &str) {
        lock(&self.state).fault(name, Fault::PROCESS_ENDED, text);
        self.diagnostics.publish_ended(name, text);
    }

    /// Publishes the operators' keys where they have changed.
    pub(crate) fn publish_keys(&mut self) {
        if let Some(trouble) = self.keys.publish_changes() {
            self.warn("keys_not_read", &trouble);
        }
    }

    /// Publishes the states of the processes on `/diagnostics`, once a second.
    pub(crate) fn publish_diagnostics(&self, processes: &[ProcessState]) {
        let mut state = lock(&self.state);
        state.processes = processes.to_vec();
        if state
            .diagnosed
            .is_some_and(|last| last.elapsed() < diagnostics::PERIOD)
        {
            return;
        }
        state.diagnosed = Some(Instant::now());
        let health = state.health.entries(&self.namespace);
        drop(state);
        self.diagnostics.publish(&self.namespace, processes, health);
    }

    /// Leaves the cell.
    pub(crate) fn leave(mut self) -> anyhow::Result<()> {
        self.servers.clear();
        self.private = None;
        self.subscriptions.clear();
        self.bus.close(Duration::from_secs(2))?;
        Ok(())
    }
}

/// Publishes the cell file without passwords, below the public key of the cell, so that a recording by whomever holds what
/// made the cell.
fn describe(bus: &Bus, cell: &Cell) -> anyhow::Result<Publisher> {
    let topic = topics::CELL_DESCRIPTION;
    let publisher = bus.publisher(&cell.topic(topic.name), topic.message, bus_qos(topic.qos))?;
    let description = std_msgs::String {
        data: embedded::description(
            cell,
            &KeyFolder::of(cell)?.public()?.to_string(),
            &crate::version(),
        ),
    };
    publisher.publish(to_cdr(&description), host::now().0)?;
    Ok(publisher)
}
