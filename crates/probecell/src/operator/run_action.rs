//! The service `run` as an action: `run/_action/...` (`probecell_msgs/action/RunPart`).
//!
//! A goal is accepted where the cell accepts the request, and ends with the report of the part. To cancel it is to stop the
//! machine and the part.

use std::sync::Arc;

use graph::topics;
use host::bus::{Bus, Request};
use probecell_msgs::{
    OperatorReply, OperatorRequest, PartReport, PartStatus,
    action::{RunPart, RunPartFeedback, RunPartGoal, RunPartResult},
    action_msgs::GoalStatus,
    builtin_interfaces::Time,
    srv::RunRequest,
    unique_identifier_msgs::UUID,
};

use super::{
    action::{self, Action, Caller, Goals, Pursuit, Served},
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

/// What is kept of a part that is being made.
pub(super) struct Pursued {
    /// When the cell accepted the request, by its clock.
    accepted: Time,
    operator: String,
}

impl Action for Running {
    const NAME: &'static str = "run";
    type Types = RunPart;
    type Pursued = Pursued;
}

/// Makes parts.
pub(super) struct Running {
    caller: Caller<News>,
    goals: Goals<Self>,
    /// The part that ended last: its report may overtake the reply to its request.
    last: PartReport,
}

/// Serves the action. What is received of parts goes to the events returned.
pub(super) fn serve(
    bus: &Bus,
    namespace: &str,
    requests: &Arc<RequestPublishers>,
) -> anyhow::Result<Served<News>> {
    action::serve(bus, namespace, |goals, events| Running {
        caller: Caller::new(requests, events),
        goals,
        last: PartReport::default(),
    })
}

impl Pursuit for Running {
    type News = News;

    fn goals(&mut self) -> &mut Goals<Self> {
        &mut self.goals
    }

    fn send(&mut self, id: UUID, goal: RunPartGoal, request: Request) {
        let operator = goal.operator_name.clone();
        let call = run_request(as_service(goal));
        let sent = move |reply| News::Sent(id, operator, reply, request);
        self.caller.call(topics::RUN_REPLIES.name, call, sent);
    }

    fn cancel(&mut self) {
        let pursued = self.goals.active();
        let stop = OperatorRequest {
            operator_name: pursued.map_or(String::new(), |goal| goal.pursued.operator.clone()),
            ..OperatorRequest::default()
        };
        self.caller
            .call(topics::STOP_REPLIES.name, stop, News::Stopped);
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
                    self.goals.feed_back(RunPartFeedback { status });
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
        let order = Time::nanos;
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
