//! The service `run` as an action: `run/_action/...` (`probecell_msgs/action/RunPart`).
//!
//! A goal is accepted where the cell accepts the request, and ends with the report of the part. To cancel it is to stop the
//! machine and the part. The cell makes one part at a time, so at most one goal is pursued; a goal that has ended is kept for
//! its result. Source: the ROS 2 design of actions, and what `rcl_action` answers.

use std::{
    collections::VecDeque,
    mem,
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    time::{Duration, Instant},
};

use graph::topics;
use host::bus::{Bus, Publisher, Qos, Request, Server, ServiceId};
use probecell_msgs::{
    Message, OperatorReply, OperatorRequest, PartReport, PartStatus, Service,
    action::{
        RunPartFeedback, RunPartFeedbackMessage, RunPartGetResult, RunPartGetResultRequest,
        RunPartGetResultResponse, RunPartGoal, RunPartResult, RunPartSendGoal,
        RunPartSendGoalRequest, RunPartSendGoalResponse,
    },
    action_msgs::{
        GoalInfo, GoalStatus, GoalStatusArray,
        srv::{CancelGoal, CancelGoalRequest, CancelGoalResponse},
    },
    builtin_interfaces::Time,
    from_cdr,
    srv::RunRequest,
    to_cdr,
    unique_identifier_msgs::UUID,
};

use super::{
    services::{RequestPublishers, run_request},
    state::PartNews,
};

/// How long the result of a goal is kept, as `rcl_action` keeps it by default.
const KEPT: Duration = Duration::from_secs(10);

/// What happens to goals.
pub(super) enum Event {
    /// Somebody asks for a goal.
    Send(Request),
    /// The cell has answered the request for that goal.
    Sent(
        Box<RunPartSendGoalRequest>,
        Result<OperatorReply, String>,
        Request,
    ),
    /// Somebody cancels goals.
    Cancel(Request),
    /// The cell has answered the stop.
    Stopped(Result<OperatorReply, String>),
    /// Somebody wants the result of a goal.
    Result(Request),
    /// Something is received of a part.
    Part(PartNews),
}

/// A goal that was accepted.
struct Goal {
    info: GoalInfo,
    /// When the cell accepted the request, by its clock.
    accepted: Time,
    status: i8,
    operator: String,
    result: RunPartResult,
    /// Who waits for the result.
    waiting: Vec<Request>,
    ended: Option<Instant>,
}

impl Goal {
    fn is_active(&self) -> bool {
        self.ended.is_none()
    }

    fn response(&self) -> Vec<u8> {
        to_cdr(&RunPartGetResultResponse {
            status: self.status,
            result: self.result.clone(),
        })
    }
}

/// The action server; its thread ends with the senders of events.
struct ActionServer {
    requests: Arc<RequestPublishers>,
    events: Sender<Event>,
    feedback: Publisher,
    status: Publisher,
    /// Oldest first.
    goals: VecDeque<Goal>,
    /// Identifiers whose requests are not answered yet.
    asked: Vec<UUID>,
    /// Calls that wait for the machine to stand, with the goals that they cancel.
    cancels: Vec<(Request, Vec<GoalInfo>)>,
    /// The part that ended last: its report may overtake the reply to its request.
    last: PartReport,
}

/// Serves the action. What is received of parts goes to the events returned.
pub(super) fn serve(
    bus: &Bus,
    namespace: &str,
    requests: &Arc<RequestPublishers>,
) -> anyhow::Result<(Vec<Server>, Sender<Event>)> {
    let name = |part: &str| format!("{namespace}/run/_action/{part}");
    let (events, received) = channel();
    let offer = |part: &str, ty: ServiceId, event: fn(Request) -> Event| {
        let events = events.clone();
        // The thread of the action ends with the process only.
        let on_request = move |request| drop(events.send(event(request)));
        bus.serve_deferred(&name(part), ty, Box::new(on_request))
    };
    let mut server = ActionServer {
        requests: Arc::clone(requests),
        events: events.clone(),
        feedback: bus.publisher(
            &name("feedback"),
            RunPartFeedbackMessage::TYPE,
            Qos::reliable(10),
        )?,
        status: bus.publisher(&name("status"), GoalStatusArray::TYPE, Qos::latched(1))?,
        goals: VecDeque::new(),
        asked: Vec::new(),
        cancels: Vec::new(),
        last: PartReport::default(),
    };
    let servers = vec![
        offer("send_goal", RunPartSendGoal::TYPE.into(), Event::Send)?,
        offer("cancel_goal", CancelGoal::TYPE.into(), Event::Cancel)?,
        offer("get_result", RunPartGetResult::TYPE.into(), Event::Result)?,
    ];
    std::thread::Builder::new()
        .name("action run".to_owned())
        .spawn(move || server.run(&received))?;
    Ok((servers, events))
}

impl ActionServer {
    fn run(&mut self, events: &Receiver<Event>) {
        loop {
            match events.recv_timeout(KEPT) {
                Ok(event) => {
                    self.forget();
                    self.take(event);
                }
                Err(RecvTimeoutError::Timeout) => self.forget(),
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn take(&mut self, event: Event) {
        match event {
            Event::Send(request) => self.send(request),
            Event::Sent(asked, reply, request) => self.sent(*asked, reply, request),
            Event::Cancel(request) => self.cancel(request),
            Event::Stopped(reply) => self.stopped(reply),
            Event::Result(request) => self.result(request),
            Event::Part(PartNews::Status(status)) => self.feed_back(status),
            Event::Part(PartNews::Report(report)) => {
                self.last = report;
                self.end();
            }
        }
    }

    /// Drops goals whose results were kept long enough; as with rcl no message tells.
    fn forget(&mut self) {
        let kept = |goal: &Goal| goal.ended.is_none_or(|at| at.elapsed() < KEPT);
        self.goals.retain(kept);
    }

    fn send(&mut self, request: Request) {
        let Some((asked, request)) = read::<RunPartSendGoalRequest>(request) else {
            return;
        };
        let id = asked.goal_id;
        let used = self.goals.iter().any(|goal| goal.info.goal_id == id);
        if used || self.asked.contains(&id) {
            request.answer(Ok(to_cdr(&RunPartSendGoalResponse::default())));
            return;
        }
        self.asked.push(id);
        let call = run_request(as_service(asked.goal.clone()));
        let sent = move |reply| Event::Sent(Box::new(asked), reply, request);
        self.call(topics::RUN_REPLIES.name, call, sent);
    }

    fn sent(
        &mut self,
        asked: RunPartSendGoalRequest,
        reply: Result<OperatorReply, String>,
        request: Request,
    ) {
        self.asked.retain(|id| *id != asked.goal_id);
        let reply = reply.and_then(|reply| {
            let refused = reply.text.clone();
            reply.accepted.then_some(reply).ok_or(refused)
        });
        let response = match &reply {
            Ok(_) => RunPartSendGoalResponse {
                accepted: true,
                stamp: host::now().time(),
            },
            // The response has no room for the reason.
            Err(why) => {
                tracing::warn!("a goal of the action run is refused: {why}");
                RunPartSendGoalResponse::default()
            }
        };
        request.answer(Ok(to_cdr(&response)));
        let Ok(reply) = reply else { return };
        self.goals.push_back(Goal {
            info: GoalInfo {
                goal_id: asked.goal_id,
                stamp: response.stamp,
            },
            accepted: reply.header.stamp,
            status: GoalStatus::STATUS_ACCEPTED,
            operator: asked.goal.operator_name,
            result: RunPartResult::default(),
            waiting: Vec::new(),
            ended: None,
        });
        self.publish_status();
        self.set_status(GoalStatus::STATUS_EXECUTING);
        self.end();
    }

    fn cancel(&mut self, request: Request) {
        let Some((asked, request)) = read::<CancelGoalRequest>(request) else {
            return;
        };
        let GoalInfo { goal_id, stamp } = asked.goal_info;
        let by_id = goal_id != UUID::default();
        let all = !by_id && stamp == Time::default();
        let order = |time: Time| (time.sec, time.nanosec);
        let meant = |info: &GoalInfo| {
            all || by_id && info.goal_id == goal_id
                || stamp != Time::default() && order(info.stamp) <= order(stamp)
        };
        let active = self.goals.iter().filter(|goal| goal.is_active());
        let canceled: Vec<(GoalInfo, String)> = active
            .filter(|goal| meant(&goal.info))
            .map(|goal| (goal.info, goal.operator.clone()))
            .collect();
        let Some((_, operator)) = canceled.first().cloned() else {
            let known = self.goals.iter().any(|goal| goal.info.goal_id == goal_id);
            let return_code = match (by_id, known) {
                (false, _) => CancelGoalResponse::ERROR_NONE,
                (true, true) => CancelGoalResponse::ERROR_GOAL_TERMINATED,
                (true, false) => CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID,
            };
            request.answer(Ok(to_cdr(&CancelGoalResponse {
                return_code,
                goals_canceling: Vec::new(),
            })));
            return;
        };
        let infos = canceled.into_iter().map(|(info, _)| info).collect();
        self.cancels.push((request, infos));
        let stop = OperatorRequest {
            operator_name: operator,
            ..OperatorRequest::default()
        };
        self.call(topics::STOP_REPLIES.name, stop, Event::Stopped);
    }

    /// Answers whoever cancels: the machine stands, or why it may not.
    fn stopped(&mut self, reply: Result<OperatorReply, String>) {
        let stands = match reply {
            Ok(reply) if reply.accepted => true,
            Ok(OperatorReply { text, .. }) | Err(text) => {
                tracing::warn!("a goal of the action run is not canceled: {text}");
                false
            }
        };
        for (request, infos) in mem::take(&mut self.cancels) {
            let response = if stands {
                CancelGoalResponse {
                    return_code: CancelGoalResponse::ERROR_NONE,
                    goals_canceling: infos,
                }
            } else {
                CancelGoalResponse {
                    return_code: CancelGoalResponse::ERROR_REJECTED,
                    goals_canceling: Vec::new(),
                }
            };
            request.answer(Ok(to_cdr(&response)));
        }
        if stands {
            self.set_status(GoalStatus::STATUS_CANCELING);
        }
    }

    fn result(&mut self, request: Request) {
        let Some((asked, request)) = read::<RunPartGetResultRequest>(request) else {
            return;
        };
        let mut goals = self.goals.iter_mut();
        match goals.find(|goal| goal.info.goal_id == asked.goal_id) {
            Some(goal) if goal.is_active() => goal.waiting.push(request),
            Some(goal) => request.answer(Ok(goal.response())),
            None => request.answer(Ok(to_cdr(&RunPartGetResultResponse::default()))),
        }
    }

    fn feed_back(&mut self, status: PartStatus) {
        if status.stage == PartStatus::NONE {
            return;
        }
        if let Some(goal) = self.goals.iter().find(|goal| goal.is_active()) {
            let message = RunPartFeedbackMessage {
                goal_id: goal.info.goal_id,
                feedback: RunPartFeedback { status },
            };
            publish(&self.feedback, &message);
        }
    }

    /// Ends the goal whose part was reported last.
    fn end(&mut self) {
        let report = self.last.clone();
        let order = |time: Time| (time.sec, time.nanosec);
        let mut goals = self.goals.iter_mut();
        // A report from before the request is that of another part.
        let Some(goal) = goals
            .find(|goal| goal.is_active() && order(report.header.stamp) >= order(goal.accepted))
        else {
            return;
        };
        let canceled = goal.status == GoalStatus::STATUS_CANCELING || !self.cancels.is_empty();
        let status = match report.verdict {
            PartReport::STOPPED if canceled => GoalStatus::STATUS_CANCELED,
            PartReport::STOPPED => GoalStatus::STATUS_ABORTED,
            _ => GoalStatus::STATUS_SUCCEEDED,
        };
        goal.result = RunPartResult {
            text: report.text.clone(),
            report,
        };
        // The report may come before the stop is answered.
        if status == GoalStatus::STATUS_CANCELED {
            self.set_status(GoalStatus::STATUS_CANCELING);
        }
        self.set_status(status);
    }

    /// Gives the goal that is pursued another status; a terminal one ends it.
    fn set_status(&mut self, status: i8) {
        let mut goals = self.goals.iter_mut();
        let Some(goal) = goals.find(|goal| goal.is_active() && goal.status != status) else {
            return;
        };
        goal.status = status;
        let mut waiting = Vec::new();
        if status >= GoalStatus::STATUS_SUCCEEDED {
            goal.ended = Some(Instant::now());
            waiting = mem::take(&mut goal.waiting);
        }
        let response = goal.response();
        self.publish_status();
        for request in waiting {
            request.answer(Ok(response.clone()));
        }
    }

    fn publish_status(&self) {
        let status = |goal: &Goal| GoalStatus {
            goal_info: goal.info,
            status: goal.status,
        };
        let status_list = self.goals.iter().map(status).collect();
        publish(&self.status, &GoalStatusArray { status_list });
    }

    /// Calls into the graph on a thread of its own, so that a cancel never waits behind another call.
    fn call(
        &self,
        reply_topic: &'static str,
        request: OperatorRequest,
        event: impl FnOnce(Result<OperatorReply, String>) -> Event + Send + 'static,
    ) {
        let (requests, events) = (Arc::clone(&self.requests), self.events.clone());
        std::thread::spawn(move || {
            let reply = requests.call(reply_topic, request);
            // The receiver ends with the process only.
            drop(events.send(event(reply)));
        });
    }
}

fn as_service(goal: RunPartGoal) -> RunRequest {
    RunRequest {
        part_id: goal.part_id,
        plan_id: goal.plan_id,
        expires: goal.expires,
        operator_name: goal.operator_name,
        signed_at: goal.signed_at,
        shown: goal.shown,
        signature: goal.signature,
    }
}

/// The request as a message; what cannot be read is refused.
fn read<M: Message>(request: Request) -> Option<(M, Request)> {
    match from_cdr(&request.payload) {
        Ok(message) => Some((message, request)),
        Err(error) => {
            request.answer(Err(format!("the request cannot be read: {error}")));
            None
        }
    }
}

fn publish(publisher: &Publisher, message: &impl Message) {
    if let Err(error) = publisher.publish(to_cdr(message), host::now().0) {
        tracing::error!("the action run: {error}");
    }
}
