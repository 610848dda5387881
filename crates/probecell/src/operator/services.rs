//! The operator's services: each call enters the graph as a message, and the reply of a node answers it.

use std::{
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, channel},
    },
    time::{Duration, Instant},
};

use cell::Cell;
use graph::{Stamp, Topic, topics};
use host::{
    bus::{Bus, Publisher, Server},
    bus_qos,
    private::Answering,
    sim_time::SimulatedClock,
};
use probecell_msgs::{
    InspectionPoint, Message, OperatorReply, OperatorRequest, OrderRequest, Orders, Service,
    ServiceType, builtin_interfaces::Time, from_cdr, srv, std_msgs, to_cdr,
};

use super::state::{OperatorState, lock};

/// Timeout of a reply, restarted by each progress message of a plan.
const REPLY_TIMEOUT: Duration = Duration::from_secs(10);

/// s after which a request for a part that no node took starts nothing: the caller is told so after [`REPLY_TIMEOUT`].
const VALIDITY: f64 = 8.0;

/// When a request for a part that is made now expires.
pub(super) fn expiry() -> Stamp {
    host::now().after_s(VALIDITY)
}

/// Kind of a call of `manage_orders` that lists them and changes nothing.
const LIST: u8 = 0;

/// A call whose reply is awaited.
pub(super) struct Asked {
    reply_topic: &'static str,
    /// Number of the request.
    pub(super) request_id: u64,
    receiver: Receiver<OperatorReply>,
}

/// Publishes operators' calls into the graph.
pub(super) struct RequestPublishers {
    plan: Publisher,
    run: Publisher,
    stop: Publisher,
    approve: Publisher,
    orders: Publisher,
    state: Arc<Mutex<OperatorState>>,
    clock: Option<Arc<SimulatedClock>>,
}

impl RequestPublishers {
    /// Announces the topics of requests.
    pub(super) fn new(
        bus: &Bus,
        cell: &Cell,
        state: &Arc<Mutex<OperatorState>>,
        clock: Option<Arc<SimulatedClock>>,
    ) -> anyhow::Result<Self> {
        let publisher = |topic: Topic| {
            bus.publisher(&cell.topic(topic.name), topic.message, bus_qos(topic.qos))
        };
        Ok(Self {
            plan: publisher(topics::PLAN_REQUESTS)?,
            run: publisher(topics::RUN_REQUESTS)?,
            stop: publisher(topics::STOP_REQUESTS)?,
            approve: publisher(topics::APPROVALS)?,
            orders: publisher(topics::ORDER_REQUESTS)?,
            state: Arc::clone(state),
            clock,
        })
    }

    /// Publishes a call and waits for its reply.
    pub(super) fn call(
        &self,
        reply_topic: &'static str,
        request: OperatorRequest,
    ) -> Result<OperatorReply, String> {
        self.wait(self.ask(reply_topic, request)?)
    }

    /// Publishes a call.
    pub(super) fn ask(
        &self,
        reply_topic: &'static str,
        request: OperatorRequest,
    ) -> Result<Asked, String> {
        let (topic, publisher) = match reply_topic {
            name if name == topics::PLAN_REPLIES.name => (topics::PLAN_REQUESTS, &self.plan),
            name if name == topics::RUN_REPLIES.name => (topics::RUN_REQUESTS, &self.run),
            name if name == topics::STOP_REPLIES.name => (topics::STOP_REQUESTS, &self.stop),
            _ => (topics::APPROVALS, &self.approve),
        };
        self.publish((topic, publisher), reply_topic, |header, request_id| {
            OperatorRequest {
                header,
                request_id,
                ..request
            }
        })
    }

    /// Publishes a request under a number of its own.
    fn publish<M: Message>(
        &self,
        (topic, publisher): (Topic, &Publisher),
        reply_topic: &'static str,
        request: impl FnOnce(std_msgs::Header, u64) -> M,
    ) -> Result<Asked, String> {
        // It does not age on its way.
        if let Some(clock) = &self.clock {
            clock.publishing(topic.name);
        }
        let (sender, receiver) = channel();
        let request_id = {
            let mut state = lock(&self.state);
            let request_id = state.next_request;
            state.next_request += 1;
            state.pending.insert((reply_topic, request_id), sender);
            request_id
        };
        let instant = host::now();
        publisher
            .publish(to_cdr(&request(instant.header(""), request_id)), instant.0)
            .map_err(|error| error.to_string())?;
        Ok(Asked {
            reply_topic,
            request_id,
            receiver,
        })
    }

    /// The orders that are on disk.
    pub(super) fn orders(&self) -> Orders {
        lock(&self.state).orders.clone()
    }

    /// Changes the orders, unless they are only to be listed; gives the number of the order, which a new one gets here.
    pub(super) fn manage_orders(
        &self,
        asked: srv::ManageOrdersRequest,
    ) -> Result<(u64, OperatorReply), String> {
        if asked.kind == LIST {
            let listed = OperatorReply {
                accepted: true,
                ..OperatorReply::default()
            };
            return Ok((0, listed));
        }
        let order_id = match asked.kind {
            OrderRequest::ADD => {
                let mut state = lock(&self.state);
                state.last_order = state.last_order.max(state.orders.last_id) + 1;
                state.last_order
            }
            _ => asked.order_id,
        };
        let (way, replies) = (
            (topics::ORDER_REQUESTS, &self.orders),
            topics::ORDER_REPLIES.name,
        );
        let sent = self.publish(way, replies, |header, request_id| OrderRequest {
            header,
            request_id,
            kind: asked.kind,
            order_id,
            part_id: asked.part_id,
            count: asked.count,
            position: asked.position,
            operator_name: asked.operator_name,
            expires: expiry().time(),
        })?;
        Ok((order_id, self.wait(sent)?))
    }

    /// Waits for the reply to a call.
    pub(super) fn wait(&self, asked: Asked) -> Result<OperatorReply, String> {
        let Asked {
            reply_topic,
            request_id,
            receiver,
        } = asked;
        let mut deadline = Instant::now() + REPLY_TIMEOUT;
        let reply = loop {
            let reply = receiver.recv_timeout(deadline.saturating_duration_since(Instant::now()));
            let progress = lock(&self.state).planning.map(|last| last + REPLY_TIMEOUT);
            let restarts =
                |next: &Instant| reply_topic == topics::PLAN_REPLIES.name && *next > deadline;
            match (&reply, progress.filter(restarts)) {
                (Err(_), Some(next)) => deadline = next,
                _ => break reply,
            }
        };
        lock(&self.state).pending.remove(&(reply_topic, request_id));
        reply.map_err(|_| format!("no node answered within {} s", REPLY_TIMEOUT.as_secs()))
    }
}

/// A service of the operator: its name, its type, and what answers it.
pub(super) struct Offered {
    pub(super) name: &'static str,
    kind: &'static ServiceType,
    pub(super) answering: Answering,
}

impl Offered {
    /// One whose answer is made here of the bytes of a request.
    pub(super) fn answered_here<S: Service>(
        name: &'static str,
        answer: impl Fn(&[u8]) -> Vec<u8> + Send + Sync + 'static,
    ) -> Self {
        let (kind, answering) = (S::TYPE, Arc::new(answer));
        Self {
            name,
            kind,
            answering,
        }
    }
}

/// `plan`, `run`, `stop`, `status` and `approve_correction`.
pub(super) fn all(requests: &Arc<RequestPublishers>) -> Vec<Offered> {
    let state = Arc::clone(&requests.state);
    vec![
        offered::<srv::Plan>(
            ("plan", topics::PLAN_REPLIES),
            requests,
            |request| plan_request(request.plan_id, request.points),
            |accepted, text| srv::PlanResponse { accepted, text },
        ),
        offered::<srv::Run>(
            ("run", topics::RUN_REPLIES),
            requests,
            run_request,
            |accepted, text| srv::RunResponse { accepted, text },
        ),
        offered::<srv::Stop>(
            ("stop", topics::STOP_REPLIES),
            requests,
            |request| OperatorRequest {
                operator_name: request.operator_name,
                signed_at: request.signed_at,
                shown: request.shown,
                signature: request.signature,
                ..OperatorRequest::default()
            },
            |accepted, text| srv::StopResponse { accepted, text },
        ),
        // Answered here: what was received is known, and nothing is asked of a node.
        Offered::answered_here::<srv::Status>("status", move |_| to_cdr(&lock(&state).status())),
        offered::<srv::ApproveCorrection>(
            ("approve_correction", topics::APPROVAL_REPLIES),
            requests,
            |request| OperatorRequest {
                subject: request.correction_id,
                operator_name: request.operator_name,
                approve: request.approve,
                signed_at: request.signed_at,
                shown: request.shown,
                signature: request.signature,
                ..OperatorRequest::default()
            },
            |accepted, text| srv::ApproveCorrectionResponse { accepted, text },
        ),
    ]
}

/// Serves them on the bus.
pub(super) fn serve(bus: &Bus, namespace: &str, all: &[Offered]) -> anyhow::Result<Vec<Server>> {
    let served = all.iter().map(|one| {
        let answering = Arc::clone(&one.answering);
        let handler = move |request: &[u8]| Ok(answering(request));
        Ok(bus.serve(
            &format!("{namespace}/{}", one.name),
            one.kind,
            Box::new(handler),
        )?)
    });
    served.collect()
}

/// What a request for a plan asks of the graph.
pub(super) fn plan_request(plan_id: String, points: Vec<InspectionPoint>) -> OperatorRequest {
    OperatorRequest {
        subject: plan_id,
        points,
        ..OperatorRequest::default()
    }
}

/// What a request for a part asks of the graph.
pub(super) fn run_request(request: srv::RunRequest) -> OperatorRequest {
    OperatorRequest {
        subject: request.part_id,
        operator_name: request.operator_name,
        signed_at: request.signed_at,
        shown: request.shown,
        signature: request.signature,
        plan_id: request.plan_id,
        expires: if request.expires == Time::default() {
            expiry().time()
        } else {
            request.expires
        },
        ..OperatorRequest::default()
    }
}

/// A service whose calls enter the graph.
fn offered<S: Service>(
    (name, reply): (&'static str, Topic),
    requests: &Arc<RequestPublishers>,
    to_request: fn(S::Request) -> OperatorRequest,
    to_response: fn(bool, String) -> S::Response,
) -> Offered {
    let requests = Arc::clone(requests);
    // A ROS 2 client never hears of an error reply: a failure is answered in the service's type.
    let answering = move |request: &[u8]| {
        let answer = from_cdr::<S::Request>(request)
            .map_err(|error| format!("the request cannot be read: {error}"))
            .and_then(|request| requests.call(reply.name, to_request(request)));
        let (accepted, text) = match answer {
            Ok(reply) => (reply.accepted, reply.text),
            Err(why) => (false, why),
        };
        to_cdr(&to_response(accepted, text))
    };
    Offered::answered_here::<S>(name, answering)
}
