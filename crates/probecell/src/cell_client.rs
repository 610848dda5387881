//! A client of a running cell's services.

use std::{
    cell::OnceCell,
    collections::BTreeSet,
    ops::ControlFlow,
    path::Path,
    sync::mpsc::{Receiver, channel},
    time::{Duration, Instant},
};

use anyhow::Context;
use cell::Cell;
use graph::{Topic, topics};
use host::{
    bus::{Bus, BusConfig, Received, Subscription},
    bus_qos,
};
use probecell_msgs::{
    CdrError, Correction, InspectionPlan, Message, Orders, PartReport, PlanProgress, Service,
    from_cdr, srv, to_cdr,
};

use crate::{
    FAILED, GOOD,
    cell_bus::{CellFailure, visitor_config},
    operator::private::{LAST_PART, ORDERS, PROPOSALS},
    output,
    own_socket::{COMMAND_PATIENCE, OwnSocket},
    ros_arguments::read_cell,
    routing::refuse_unheard,
};

/// Timeout of a service, longer than the cell waits for its nodes, and of a plan that the cell keeps for late joiners.
const REPLY_TIMEOUT: Duration = Duration::from_secs(15);
/// In which what a cell keeps of a topic for late joiners has arrived.
const KEPT_TIMEOUT: Duration = Duration::from_secs(1);
/// Timeout of a whole plan; the cell itself answers when its progress stalls.
const PLAN_TIMEOUT: Duration = Duration::from_secs(1800);

/// Messages of a topic, as they come.
pub(crate) struct Followed<M> {
    name: &'static str,
    receiver: Receiver<Result<M, CdrError>>,
    _subscription: Subscription,
}

impl<M> Followed<M> {
    /// The next one; none before the deadline.
    pub(crate) fn next(&self, deadline: Instant) -> anyhow::Result<Option<M>> {
        let left = deadline.saturating_duration_since(Instant::now());
        let received = self.receiver.recv_timeout(left).ok();
        received.transpose().with_context(|| {
            format!(
                "a message on {} cannot be decoded as the type of its topic",
                self.name
            )
        })
    }
}

/// A client of the cell that a cell file describes: by its private socket, where the cell answers there, else by the bus, which is
/// joined when it is needed.
pub(crate) struct CellClient {
    cell: Cell,
    calls: Option<OwnSocket>,
    bus: OnceCell<Bus>,
}

impl CellClient {
    /// Connects.
    pub(crate) fn connect(file: &Path) -> anyhow::Result<Self> {
        let cell = read_cell(file)?;
        // What is signed is as old as the cell takes it to be.
        if let Some(clock) = OwnSocket::of_clock(&cell) {
            host::sim_time::follow(clock.path());
        }
        Ok(Self {
            calls: OwnSocket::of_calls(&cell),
            cell,
            bus: OnceCell::new(),
        })
    }

    fn bus(&self) -> anyhow::Result<&Bus> {
        if let Some(bus) = self.bus.get() {
            return Ok(bus);
        }
        let config = BusConfig {
            connect_timeout: COMMAND_PATIENCE,
            ..visitor_config(&self.cell, "operator_call")?
        };
        let bus = Bus::open(&config, "operator_call", &self.cell.namespace())?;
        Ok(self.bus.get_or_init(|| bus))
    }

    /// Calls a service of the private socket.
    fn privately(&self, name: &str, request: &[u8]) -> Option<Vec<u8>> {
        host::private::call(self.calls.as_ref()?.path(), name, request, REPLY_TIMEOUT)
    }

    /// A list of messages by the private socket.
    fn listed<M: Message>(&self, name: &str) -> anyhow::Result<Option<Vec<M>>> {
        let Some(answer) = self.privately(name, &[]) else {
            return Ok(None);
        };
        let (mut rest, mut messages) = (answer.as_slice(), Vec::new());
        while let Some((length, behind)) = rest.split_first_chunk::<4>() {
            let length = u32::from_le_bytes(*length) as usize;
            let (cdr, behind) = behind
                .split_at_checked(length)
                .with_context(|| format!("the answer of {name} ends early"))?;
            messages.push(from_cdr(cdr)?);
            rest = behind;
        }
        Ok(Some(messages))
    }

    /// Calls a service once.
    pub(crate) fn call<S: Service>(
        &self,
        name: &str,
        request: &S::Request,
    ) -> anyhow::Result<S::Response> {
        let unreadable = "the reply cannot be decoded as the response type of the service";
        if let Some(answer) = self.privately(name, &to_cdr(request)) {
            return from_cdr(&answer).context(unreadable);
        }
        let topic = self.cell.topic(name);
        let called = (self.bus()?).call(&topic, S::TYPE, &to_cdr(request), REPLY_TIMEOUT);
        // Nobody answers a stranger; then that is the reason to name.
        let response = called.map_err(|error| match refuse_unheard(&self.cell) {
            Err(reason) => CellFailure(reason.to_string()).into(),
            Ok(()) => anyhow::Error::from(error),
        })?;
        from_cdr(&response).context(unreadable)
    }

    /// Has the cell plan.
    pub(crate) fn plan(&self, request: &srv::PlanRequest) -> anyhow::Result<srv::PlanResponse> {
        request_plan(self.bus()?, &self.cell.namespace(), request)
    }

    /// The plan that the cell published last.
    pub(crate) fn last_plan(&self) -> anyhow::Result<InspectionPlan> {
        let plan = self.first(topics::INSPECTION_PLAN, |_| true)?;
        plan.ok_or_else(|| {
            let seconds = REPLY_TIMEOUT.as_secs();
            let text =
                format!("no plan was received within {seconds} s: the cell has measured nothing");
            CellFailure(text).into()
        })
    }

    /// The proposal of a correction, which the cell keeps for late joiners.
    pub(crate) fn proposed(&self, correction_id: &str) -> anyhow::Result<Correction> {
        let wanted = |one: &Correction| {
            one.correction_id == correction_id && one.approval == Correction::APPROVAL_NONE
        };
        let proposed = match self.listed(PROPOSALS)? {
            Some(known) => known.into_iter().find(wanted),
            None => self.first(topics::CORRECTIONS, wanted)?,
        };
        proposed.ok_or_else(|| {
            let text = format!("the cell proposes no correction {correction_id:?}");
            CellFailure(text).into()
        })
    }

    /// Corrections of a measurement that wait for an operator, of those that the cell keeps for late joiners.
    pub(crate) fn waiting(&self, plan_id: &str) -> anyhow::Result<BTreeSet<String>> {
        if let Some(known) = self.listed::<Correction>(PROPOSALS)? {
            let own = known.into_iter().filter(|one| one.plan_id == plan_id);
            return Ok(own.map(|one| one.correction_id).collect());
        }
        let mut waiting = BTreeSet::new();
        let take = |correction: Correction| {
            if correction.plan_id == plan_id {
                if correction.approval == Correction::APPROVAL_NONE {
                    waiting.insert(correction.correction_id);
                } else {
                    waiting.remove(&correction.correction_id);
                }
            }
            ControlFlow::Continue(())
        };
        self.kept(topics::CORRECTIONS, KEPT_TIMEOUT, take)?;
        Ok(waiting)
    }

    /// The report of the last part, which the cell keeps for late joiners.
    pub(crate) fn last_part(&self) -> anyhow::Result<Option<PartReport>> {
        self.newest(LAST_PART, topics::PART_REPORTS)
    }

    /// The orders on disk, which the cell keeps for late joiners.
    pub(crate) fn orders(&self) -> anyhow::Result<Orders> {
        Ok(self
            .newest(ORDERS, topics::KEPT_ORDERS)?
            .unwrap_or_default())
    }

    /// The newest message of a latched topic: by the private socket, else by the bus, where a stranger reads it too.
    fn newest<M: Message + Send + 'static>(
        &self,
        name: &str,
        topic: Topic,
    ) -> anyhow::Result<Option<M>> {
        if let Some(known) = self.listed(name)? {
            return Ok(known.into_iter().next());
        }
        let mut newest = None;
        let take = |message: M| {
            newest = Some(message);
            ControlFlow::Break(())
        };
        self.kept(topic, KEPT_TIMEOUT, take)?;
        Ok(newest)
    }

    /// The first message on a latched topic that is wanted; none within [`REPLY_TIMEOUT`].
    fn first<M: Message + Send + 'static>(
        &self,
        topic: Topic,
        wanted: impl Fn(&M) -> bool,
    ) -> anyhow::Result<Option<M>> {
        let mut found = None;
        let take = |message: M| {
            if wanted(&message) {
                found = Some(message);
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        self.kept(topic, REPLY_TIMEOUT, take)?;
        Ok(found)
    }

    /// Takes the messages of a latched topic, in their order, until one is the last that is wanted or `patience` is over.
    fn kept<M: Message + Send + 'static>(
        &self,
        topic: Topic,
        patience: Duration,
        mut take: impl FnMut(M) -> ControlFlow<()>,
    ) -> anyhow::Result<()> {
        let messages = self.follow(topic)?;
        let deadline = Instant::now() + patience;
        while let Some(message) = messages.next(deadline)? {
            if take(message).is_break() {
                break;
            }
        }
        Ok(())
    }

    /// Follows a topic from now on; of a latched one also what is kept.
    pub(crate) fn follow<M: Message + Send + 'static>(
        &self,
        topic: Topic,
    ) -> anyhow::Result<Followed<M>> {
        let (sender, receiver) = channel();
        let on_sample = move |received: Received<'_>| {
            // The receiver may be satisfied already.
            drop(sender.send(from_cdr::<M>(&received.payload)));
        };
        let subscription = self.bus()?.subscribe(
            &self.cell.topic(topic.name),
            topic.message,
            bus_qos(topic.qos),
            Box::new(on_sample),
            Box::new(|_| {}),
        )?;
        Ok(Followed {
            name: topic.name,
            receiver,
            _subscription: subscription,
        })
    }

    /// The cell that it is connected to.
    pub(crate) fn cell(&self) -> &Cell {
        &self.cell
    }

    /// Disconnects.
    pub(crate) fn close(self) -> anyhow::Result<()> {
        if let Some(bus) = self.bus.into_inner() {
            bus.close(Duration::from_secs(2))?;
        }
        Ok(())
    }
}

/// Calls one service of the cell that a cell file describes.
pub(crate) fn call_once<S: Service>(
    file: &Path,
    name: &str,
    request: &S::Request,
) -> anyhow::Result<S::Response> {
    let client = CellClient::connect(file)?;
    let response = client.call::<S>(name, request)?;
    client.close()?;
    Ok(response)
}

/// Prints whether a request was accepted; gives the exit status.
pub(crate) fn print_reply(accepted: bool, text: &str) -> u8 {
    output::line(if accepted { "accepted" } else { text });
    if accepted { GOOD } else { FAILED }
}

/// Has a running cell plan; a terminal shows the progress.
pub(crate) fn request_plan(
    bus: &Bus,
    namespace: &str,
    request: &srv::PlanRequest,
) -> anyhow::Result<srv::PlanResponse> {
    let topic = topics::PLAN_PROGRESS;
    let on_sample = |received: Received<'_>| {
        if let Ok(progress) = from_cdr::<PlanProgress>(&received.payload) {
            output::progress(&progress);
        }
    };
    let subscription = bus.subscribe(
        &format!("{namespace}/{}", topic.name),
        topic.message,
        bus_qos(topic.qos),
        Box::new(on_sample),
        Box::new(|_| {}),
    )?;
    let response = bus.call_with_timeouts(
        &format!("{namespace}/plan"),
        srv::Plan::TYPE,
        &to_cdr(request),
        REPLY_TIMEOUT,
        PLAN_TIMEOUT,
    );
    drop(subscription);
    output::end_progress();
    from_cdr(&response?).context("the reply cannot be decoded as the response type of the service")
}
