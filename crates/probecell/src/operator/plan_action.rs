//! The service `plan` as an action: `plan/_action/...` (`probecell_msgs/action/PlanMeasurement`).
//!
//! A goal is accepted at once, since whether the planner takes it shows with its answer: what the planner refuses is aborted,
//! with the reason. To cancel it is to end the search.

use std::{sync::Arc, time::Instant};

use graph::topics;
use host::bus::{Bus, Request};
use probecell_msgs::{
    OperatorReply, OperatorRequest, PlanProgress,
    action::{
        PlanMeasurement, PlanMeasurementFeedback, PlanMeasurementGoal, PlanMeasurementResult,
    },
    action_msgs::GoalStatus,
    unique_identifier_msgs::UUID,
};

use super::{
    action::{self, Action, Caller, Goals, KEPT, Pursuit, Served},
    services::{RequestPublishers, plan_request},
};

/// What the action follows of the cell.
pub(super) enum News {
    /// The planner has answered that request.
    Replied(u64, Result<OperatorReply, String>),
    /// The planner has answered the cancel.
    Cancelled(Result<OperatorReply, String>),
    /// How far an order has come.
    Progress(PlanProgress),
}

/// What is kept of a plan in the making.
pub(super) struct Pursued {
    /// Number of the request.
    request_id: u64,
    /// Name of the plan as progress names it.
    plan_id: String,
    /// What the planner has answered, and when.
    planned: Option<(String, Instant)>,
    /// The last progress, which travels on another topic.
    done: Option<PlanProgress>,
}

impl Action for Planning {
    const NAME: &'static str = "plan";
    type Types = PlanMeasurement;
    type Pursued = Pursued;
}

/// Makes plans.
pub(super) struct Planning {
    caller: Caller<News>,
    goals: Goals<Self>,
}

/// Serves the action. Progress goes to the events returned.
pub(super) fn serve(
    bus: &Bus,
    namespace: &str,
    requests: &Arc<RequestPublishers>,
) -> anyhow::Result<Served<News>> {
    action::serve(bus, namespace, |goals, events| Planning {
        caller: Caller::new(requests, events),
        goals,
    })
}

impl Pursuit for Planning {
    type News = News;

    fn goals(&mut self) -> &mut Goals<Self> {
        &mut self.goals
    }

    fn send(&mut self, id: UUID, goal: PlanMeasurementGoal, request: Request) {
        if self.goals.active().is_some() {
            let why = "another goal is pursued";
            return self.goals.refuse(id, why, request);
        }
        let PlanMeasurementGoal { plan_id, points } = goal;
        let named = if plan_id.is_empty() {
            path_planning::PREVIEW.to_owned()
        } else {
            plan_id.clone()
        };
        // Here and not on the thread that waits: a cancel must not overtake it.
        let asked = (self.caller).ask(topics::PLAN_REPLIES.name, plan_request(plan_id, points));
        let asked = match asked {
            Ok(asked) => asked,
            Err(why) => return self.goals.refuse(id, &why, request),
        };
        let request_id = asked.request_id;
        let pursued = Pursued {
            request_id,
            plan_id: named,
            planned: None,
            done: None,
        };
        self.goals.accept(id, pursued, request);
        self.caller
            .wait(asked, move |reply| News::Replied(request_id, reply));
    }

    fn cancel(&mut self) {
        let Some(goal) = self.goals.active() else {
            return;
        };
        let cancel = OperatorRequest {
            cancels: vec![goal.pursued.request_id],
            ..OperatorRequest::default()
        };
        match self.caller.ask(topics::PLAN_REPLIES.name, cancel) {
            Ok(asked) => self.caller.wait(asked, News::Cancelled),
            Err(why) => self.goals.canceled(Err(&why)),
        }
    }

    fn take(&mut self, news: News) {
        match news {
            News::Cancelled(Ok(reply)) if reply.accepted => self.goals.canceled(Ok(())),
            News::Cancelled(Ok(OperatorReply { text, .. }) | Err(text)) => {
                self.goals.canceled(Err(&text));
            }
            News::Replied(number, reply) => self.replied(number, reply),
            News::Progress(progress) => self.progress(progress),
        }
    }

    /// Ends the goal whose order is made. Reply and last progress arrive in either order; without the latter, which a link may
    /// have dropped, the goal ends a while later.
    fn tend(&mut self) {
        let Some(goal) = self.goals.active() else {
            return;
        };
        let pursued = &mut goal.pursued;
        let Some((text, at)) = &pursued.planned else {
            return;
        };
        if pursued.done.is_none() && at.elapsed() < KEPT {
            return;
        }
        let (text, done) = (text.clone(), pursued.done.take().unwrap_or_default());
        let result = PlanMeasurementResult {
            plan_id: done.plan_id,
            touches: done.touches,
            air_time: done.air_time,
            given_air_time: done.given_air_time,
            air_length: done.air_length,
            given_air_length: done.given_air_length,
            text,
        };
        self.goals.end(GoalStatus::STATUS_SUCCEEDED, result);
    }
}

impl Planning {
    fn progress(&mut self, progress: PlanProgress) {
        let Some(goal) = self.goals.active() else {
            return;
        };
        // The planner makes one order at a time; this one may be of the cycle.
        if goal.pursued.plan_id != progress.plan_id {
            return;
        }
        if progress.phase == PlanProgress::DONE {
            goal.pursued.done = Some(progress.clone());
        }
        self.goals.feed_back(PlanMeasurementFeedback { progress });
    }

    fn replied(&mut self, number: u64, reply: Result<OperatorReply, String>) {
        let active = self.goals.active();
        let Some(goal) = active.filter(|goal| goal.pursued.request_id == number) else {
            return;
        };
        match reply {
            Ok(reply) if reply.accepted => {
                goal.pursued.planned = Some((reply.text, Instant::now()));
            }
            Ok(OperatorReply { text, .. }) | Err(text) => {
                let status = if self.goals.is_canceled() {
                    GoalStatus::STATUS_CANCELED
                } else {
                    GoalStatus::STATUS_ABORTED
                };
                let result = PlanMeasurementResult {
                    text,
                    ..PlanMeasurementResult::default()
                };
                self.goals.end(status, result);
            }
        }
    }
}
