//! The service `run` as an action: `run/_action/...` (`probecell_msgs/action/RunPart`).
//!
//! A goal is accepted where the cell accepts the request, and ends with the report of the part. To cancel it is to stop the
//! machine and the part.

use std::sync::{Arc, mpsc::Sender};

use graph::topics;
use host::bus::{Bus, Request};
use probecell_msgs::{
    OperatorReply, OperatorRequest, PartReport, PartStatus,
    action::{
        RunPartFeedback, RunPartFeedbackMessage, RunPartGetResult, RunPartGetResultRequest,
        RunPartGetResultResponse, RunPartGoal, RunPartResult, RunPartSendGoal,
        RunPartSendGoalRequest, RunPartSendGoalResponse,
    },
    action_msgs::GoalStatus,
    builtin_interfaces::Time,
    srv::RunRequest,
    unique_identifier_msgs::UUID,
};

use super::{
    action::{self, Action, Event, Goals, Pursuit, Served},
    services::{RequestPublishers, run_request},
    state::PartNews,
};

/// What the action follows of the cell.
pub(super) enum News {
    /// The cell has answered the request for a goal.
    Sent(UUID, String, Result<OperatorReply, String>, Request),
    /// The cell has answered the stop.
    Stopped(Result<OperatorReply, String>),
    /// Something is received of a part.
    Part(PartNews),
}

/// Types of the action.
pub(super) struct RunPart;

/// What is kept of a part that is being made.
pub(super) struct Pursued {
    /// When the cell accepted the request, by its clock.
    accepted: Time,
    operator: String,
}

impl Action for RunPart {
    const NAME: &'static str = "run";
    type SendGoal = RunPartSendGoal;
    type Goal = RunPartGoal;
    type GetResult = RunPartGetResult;
    type Result = RunPartResult;
    type FeedbackMessage = RunPartFeedbackMessage;
    type Feedback = PartStatus;
    type Pursued = Pursued;

    fn goal(request: RunPartSendGoalRequest) -> (UUID, RunPartGoal) {
        (request.goal_id, request.goal)
    }

    fn answer(accepted: bool, stamp: Time) -> RunPartSendGoalResponse {
        RunPartSendGoalResponse { accepted, stamp }
    }

    fn asked(request: &RunPartGetResultRequest) -> UUID {
        request.goal_id
    }

    fn ended(status: i8, result: RunPartResult) -> RunPartGetResultResponse {
        RunPartGetResultResponse { status, result }
    }

    fn feedback(goal_id: UUID, status: PartStatus) -> RunPartFeedbackMessage {
        RunPartFeedbackMessage {
            goal_id,
            feedback: RunPartFeedback { status },
        }
    }
}

/// Makes parts.
pub(super) struct Running {
    requests: Arc<RequestPublishers>,
    events: Sender<Event<News>>,
    goals: Goals<RunPart>,
    /// The part that ended last: its report may overtake the reply to its request.
    last: PartReport,
}

/// Serves the action. What is received of parts goes to the events returned.
pub(super) fn serve(
    bus: &Bus,
    namespace: &str,
    requests: &Arc<RequestPublishers>,
) -> anyhow::Result<Served<News>> {
    let requests = Arc::clone(requests);
    action::serve(bus, namespace, |goals, events| Running {
        requests,
        events,
        goals,
        last: PartReport::default(),
    })
}

impl Pursuit for Running {
    type Action = RunPart;
    type News = News;

    fn goals(&mut self) -> &mut Goals<RunPart> {
        &mut self.goals
    }

    fn send(&mut self, id: UUID, goal: RunPartGoal, request: Request) {
        let operator = goal.operator_name.clone();
        let call = run_request(as_service(goal));
        let sent = move |reply| News::Sent(id, operator, reply, request);
        self.call(topics::RUN_REPLIES.name, call, sent);
    }

    fn cancel(&mut self) {
        let pursued = self.goals.active();
        let stop = OperatorRequest {
            operator_name: pursued.map_or(String::new(), |goal| goal.pursued.operator.clone()),
            ..OperatorRequest::default()
        };
        self.call(topics::STOP_REPLIES.name, stop, News::Stopped);
    }

    fn take(&mut self, news: News) {
        match news {
            News::Sent(id, operator, reply, request) => self.sent(id, operator, reply, request),
            News::Stopped(Ok(reply)) if reply.accepted => self.goals.canceled(Ok(())),
            News::Stopped(Ok(OperatorReply { text, .. }) | Err(text)) => {
                self.goals.canceled(Err(&text));
            }
            News::Part(PartNews::Status(status)) => {
                if status.stage != PartStatus::NONE {
                    self.goals.feed_back(status);
                }
            }
            News::Part(PartNews::Report(report)) => {
                self.last = report;
                self.end();
            }
        }
    }
}

impl Running {
    fn sent(
        &mut self,
        id: UUID,
        operator: String,
        reply: Result<OperatorReply, String>,
        request: Request,
    ) {
        match reply {
            Ok(reply) if reply.accepted => {
                let accepted = reply.header.stamp;
                self.goals
                    .accept(id, Pursued { accepted, operator }, request);
                self.end();
            }
            Ok(OperatorReply { text, .. }) | Err(text) => self.goals.refuse(id, &text, request),
        }
    }

    /// Ends the goal whose part was reported last.
    fn end(&mut self) {
        let report = self.last.clone();
        let order = |time: Time| (time.sec, time.nanosec);
        // A report from before the request is that of another part.
        let is_of = |accepted: Time| order(report.header.stamp) >= order(accepted);
        if !(self.goals.active()).is_some_and(|goal| is_of(goal.pursued.accepted)) {
            return;
        }
        let status = match report.verdict {
            PartReport::STOPPED if self.goals.is_canceled() => GoalStatus::STATUS_CANCELED,
            PartReport::STOPPED => GoalStatus::STATUS_ABORTED,
            _ => GoalStatus::STATUS_SUCCEEDED,
        };
        let text = report.text.clone();
        self.goals.end(status, RunPartResult { report, text });
    }

    /// Calls into the graph on a thread of its own, so that a cancel never waits behind another call.
    fn call(
        &self,
        reply_topic: &'static str,
        request: OperatorRequest,
        news: impl FnOnce(Result<OperatorReply, String>) -> News + Send + 'static,
    ) {
        let (requests, events) = (Arc::clone(&self.requests), self.events.clone());
        std::thread::spawn(move || {
            let reply = requests.call(reply_topic, request);
            // The receiver ends with the process only.
            drop(events.send(Event::News(news(reply))));
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
