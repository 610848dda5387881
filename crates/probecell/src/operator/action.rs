//! What all actions of a cell have: goals, their statuses and results, and who cancels them.
//!
//! What a goal asks of the cell, and what ends it, is that of each action ([`super::run_action`], [`super::plan_action`]). At
//! most one goal of an action is pursued; one that has ended is kept for its result. Source: the ROS 2 design of actions, and
//! what `rcl_action` answers.

use std::{
    collections::VecDeque,
    mem,
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    time::{Duration, Instant},
};

use host::bus::{Bus, Publisher, Qos, Request, Server, ServiceId};
use probecell_msgs::{
    Message, OperatorReply, OperatorRequest, Service,
    action_msgs::{
        GoalInfo, GoalStatus, GoalStatusArray,
        srv::{CancelGoal, CancelGoalRequest, CancelGoalResponse},
    },
    builtin_interfaces::Time,
    from_cdr, to_cdr,
    unique_identifier_msgs::UUID,
};

use super::services::{Asked, RequestPublishers};

/// How long the result of a goal is kept, as `rcl_action` keeps it by default.
pub(super) const KEPT: Duration = Duration::from_secs(10);

/// An action of the cell.
pub(super) trait Action: 'static {
    /// Its name below the namespace of the cell.
    const NAME: &'static str;
    /// Its messages and services.
    type Types: probecell_msgs::Action;
    /// What is kept of a goal that is pursued.
    type Pursued;
}

/// Messages and services of an action of the cell.
type Types<A> = <A as Action>::Types;
/// What an action of the cell is to reach.
pub(super) type GoalOf<A> = <Types<A> as probecell_msgs::Action>::Goal;
/// How a goal of it has ended.
pub(super) type ResultOf<A> = <Types<A> as probecell_msgs::Action>::Result;
/// What it reports while a goal is pursued.
pub(super) type FeedbackOf<A> = <Types<A> as probecell_msgs::Action>::Feedback;

/// What happens to the goals of an action; `News` is what it follows of the cell.
pub(super) enum Event<News> {
    /// Somebody asks for a goal.
    Send(Request),
    /// Somebody cancels goals.
    Cancel(Request),
    /// Somebody wants the result of a goal.
    Result(Request),
    /// Something has happened in the cell.
    News(News),
}

/// Asks the nodes on behalf of an action. Replies are awaited on threads of their own, so that a cancel never waits behind
/// another call, and come back as events.
pub(super) struct Caller<News> {
    requests: Arc<RequestPublishers>,
    events: Sender<Event<News>>,
}

impl<News: Send + 'static> Caller<News> {
    /// A caller whose replies go to these events.
    pub(super) fn new(requests: &Arc<RequestPublishers>, events: Sender<Event<News>>) -> Self {
        Self {
            requests: Arc::clone(requests),
            events,
        }
    }

    /// Publishes a request; gives its number, by which it can be cancelled.
    pub(super) fn ask(
        &self,
        reply_topic: &'static str,
        request: OperatorRequest,
    ) -> Result<Asked, String> {
        self.requests.ask(reply_topic, request)
    }

    /// Waits for the reply to a request that was published.
    pub(super) fn wait(
        &self,
        asked: Asked,
        news: impl FnOnce(Result<OperatorReply, String>) -> News + Send + 'static,
    ) {
        self.spawn(move |requests| news(requests.wait(asked)));
    }

    /// Publishes a request and waits for its reply.
    pub(super) fn call(
        &self,
        reply_topic: &'static str,
        request: OperatorRequest,
        news: impl FnOnce(Result<OperatorReply, String>) -> News + Send + 'static,
    ) {
        self.spawn(move |requests| news(requests.call(reply_topic, request)));
    }

    fn spawn(&self, news: impl FnOnce(&RequestPublishers) -> News + Send + 'static) {
        let (requests, events) = (Arc::clone(&self.requests), self.events.clone());
        std::thread::spawn(move || {
            // The receiver ends with the process only.
            drop(events.send(Event::News(news(&requests))));
        });
    }
}

/// How an action pursues its goals.
pub(super) trait Pursuit: Action + Send + Sized {
    /// What it follows of the cell.
    type News: Send;

    /// Its goals.
    fn goals(&mut self) -> &mut Goals<Self>;
    /// Somebody wants this; the request is answered by [`Goals::accept`] or [`Goals::refuse`], now or later.
    fn send(&mut self, id: UUID, goal: GoalOf<Self>, request: Request);
    /// The goal that is pursued is to end; [`Goals::canceled`] says later whether it does.
    fn cancel(&mut self);
    /// Something has happened in the cell.
    fn take(&mut self, news: Self::News);
    /// Called after every event, and at the latest [`KEPT`] after the last.
    fn tend(&mut self) {}
}

/// The servers of an action, and where what happens in the cell goes.
pub(super) type Served<News> = (Vec<Server>, Sender<Event<News>>);

/// Serves an action; its thread ends with the senders of events.
pub(super) fn serve<P: Pursuit>(
    bus: &Bus,
    namespace: &str,
    pursuit: impl FnOnce(Goals<P>, Sender<Event<P::News>>) -> P,
) -> anyhow::Result<Served<P::News>> {
    let action = P::NAME;
    let name = |part: &str| format!("{namespace}/{action}/_action/{part}");
    let (events, received) = channel();
    let offer = |part: &str, ty: ServiceId, event: fn(Request) -> Event<P::News>| {
        let events = events.clone();
        // The thread of the action ends with the process only.
        let on_request = move |request| drop(events.send(event(request)));
        bus.serve_deferred(&name(part), ty, Box::new(on_request))
    };
    let feedback = <Types<P> as probecell_msgs::Action>::FeedbackMessage::TYPE;
    let goals = Goals {
        feedback: bus.publisher(&name("feedback"), feedback, Qos::reliable(10))?,
        status: bus.publisher(&name("status"), GoalStatusArray::TYPE, Qos::latched(1))?,
        kept: VecDeque::new(),
        asked: Vec::new(),
        cancels: Vec::new(),
    };
    let send_goal = <Types<P> as probecell_msgs::Action>::SendGoal::TYPE;
    let get_result = <Types<P> as probecell_msgs::Action>::GetResult::TYPE;
    let servers = vec![
        offer("send_goal", send_goal.into(), Event::Send)?,
        offer("cancel_goal", CancelGoal::TYPE.into(), Event::Cancel)?,
        offer("get_result", get_result.into(), Event::Result)?,
    ];
    let mut pursuit = pursuit(goals, events.clone());
    std::thread::Builder::new()
        .name(format!("action {action}"))
        .spawn(move || run(&mut pursuit, &received))?;
    Ok((servers, events))
}

fn run<P: Pursuit>(pursuit: &mut P, events: &Receiver<Event<P::News>>) {
    loop {
        let event = events.recv_timeout(KEPT);
        pursuit.goals().forget();
        match event {
            Ok(Event::Send(request)) => {
                if let Some((id, goal, request)) = pursuit.goals().asked_for(request) {
                    pursuit.send(id, goal, request);
                }
            }
            Ok(Event::Cancel(request)) => {
                if pursuit.goals().cancel(request) {
                    pursuit.cancel();
                }
            }
            Ok(Event::Result(request)) => pursuit.goals().result(request),
            Ok(Event::News(news)) => pursuit.take(news),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        pursuit.tend();
    }
}

/// A goal that was accepted.
pub(super) struct Goal<A: Action> {
    info: GoalInfo,
    status: i8,
    /// What the action keeps of it.
    pub(super) pursued: A::Pursued,
    result: ResultOf<A>,
    /// Who waits for the result.
    waiting: Vec<Request>,
    ended: Option<Instant>,
}

impl<A: Action> Goal<A> {
    fn is_active(&self) -> bool {
        self.ended.is_none()
    }

    fn response(&self) -> Vec<u8> {
        to_cdr(&<A::Types as probecell_msgs::Action>::ending(
            self.status,
            self.result.clone(),
        ))
    }
}

/// The goals of an action.
pub(super) struct Goals<A: Action> {
    feedback: Publisher,
    status: Publisher,
    /// Oldest first.
    kept: VecDeque<Goal<A>>,
    /// Identifiers whose requests are not answered yet.
    asked: Vec<UUID>,
    /// Calls that wait for what they cancel to end, with those goals.
    cancels: Vec<(Request, Vec<GoalInfo>)>,
}

impl<A: Action> Goals<A> {
    /// The goal that is pursued.
    pub(super) fn active(&mut self) -> Option<&mut Goal<A>> {
        self.kept.iter_mut().find(|goal| goal.is_active())
    }

    /// Somebody wants the goal that is pursued to end.
    pub(super) fn is_canceled(&self) -> bool {
        let canceling = |goal: &Goal<A>| goal.status == GoalStatus::STATUS_CANCELING;
        !self.cancels.is_empty() || self.kept.iter().any(canceling)
    }

    /// Drops goals whose results were kept long enough; as with rcl no message tells.
    fn forget(&mut self) {
        let kept = |goal: &Goal<A>| goal.ended.is_none_or(|at| at.elapsed() < KEPT);
        self.kept.retain(kept);
    }

    /// What is asked for, under an identifier that is new.
    fn asked_for(&mut self, request: Request) -> Option<(UUID, GoalOf<A>, Request)> {
        let (asked, request) = read(request)?;
        let (id, goal) = <A::Types as probecell_msgs::Action>::goal(asked);
        let used = self.kept.iter().any(|goal| goal.info.goal_id == id);
        if used || self.asked.contains(&id) {
            request.answer(Ok(to_cdr(
                &<A::Types as probecell_msgs::Action>::acceptance(false, Time::default()),
            )));
            return None;
        }
        self.asked.push(id);
        Some((id, goal, request))
    }

    /// Refuses a goal. The response has no room for the reason, which the log says.
    pub(super) fn refuse(&mut self, id: UUID, why: &str, request: Request) {
        self.asked.retain(|asked| *asked != id);
        tracing::warn!("a goal of the action {} is refused: {why}", A::NAME);
        request.answer(Ok(to_cdr(
            &<A::Types as probecell_msgs::Action>::acceptance(false, Time::default()),
        )));
    }

    /// Accepts a goal, which is pursued from now on.
    pub(super) fn accept(&mut self, id: UUID, pursued: A::Pursued, request: Request) {
        self.asked.retain(|asked| *asked != id);
        let stamp = host::now().time();
        request.answer(Ok(to_cdr(
            &<A::Types as probecell_msgs::Action>::acceptance(true, stamp),
        )));
        self.kept.push_back(Goal {
            info: GoalInfo { goal_id: id, stamp },
            status: GoalStatus::STATUS_ACCEPTED,
            pursued,
            result: ResultOf::<A>::default(),
            waiting: Vec::new(),
            ended: None,
        });
        self.publish_status();
        self.set_status(GoalStatus::STATUS_EXECUTING);
    }

    /// Whether a call cancels the goal that is pursued; one that does not is answered.
    fn cancel(&mut self, request: Request) -> bool {
        let Some((asked, request)) = read::<CancelGoalRequest>(request) else {
            return false;
        };
        let GoalInfo { goal_id, stamp } = asked.goal_info;
        let by_id = goal_id != UUID::default();
        let all = !by_id && stamp == Time::default();
        let order = Time::nanos;
        let meant = |info: &GoalInfo| {
            all || by_id && info.goal_id == goal_id
                || stamp != Time::default() && order(info.stamp) <= order(stamp)
        };
        let active = self.kept.iter().filter(|goal| goal.is_active());
        let infos: Vec<GoalInfo> = active
            .map(|goal| goal.info)
            .filter(|info| meant(info))
            .collect();
        if !infos.is_empty() {
            self.cancels.push((request, infos));
            return true;
        }
        let known = self.kept.iter().any(|goal| goal.info.goal_id == goal_id);
        let return_code = match (by_id, known) {
            (false, _) => CancelGoalResponse::ERROR_NONE,
            (true, true) => CancelGoalResponse::ERROR_GOAL_TERMINATED,
            (true, false) => CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID,
        };
        request.answer(Ok(to_cdr(&CancelGoalResponse {
            return_code,
            goals_canceling: Vec::new(),
        })));
        false
    }

    /// Answers whoever cancels: the goals end, or why they do not.
    pub(super) fn canceled(&mut self, outcome: Result<(), &str>) {
        let return_code = match outcome {
            Ok(()) => CancelGoalResponse::ERROR_NONE,
            Err(why) => {
                tracing::warn!("a goal of the action {} is not canceled: {why}", A::NAME);
                CancelGoalResponse::ERROR_REJECTED
            }
        };
        for (request, infos) in mem::take(&mut self.cancels) {
            let goals_canceling = outcome.map_or(Vec::new(), |()| infos);
            request.answer(Ok(to_cdr(&CancelGoalResponse {
                return_code,
                goals_canceling,
            })));
        }
        if outcome.is_ok() {
            self.set_status(GoalStatus::STATUS_CANCELING);
        }
    }

    fn result(&mut self, request: Request) {
        let Some((asked, request)) = read(request) else {
            return;
        };
        let id = <A::Types as probecell_msgs::Action>::goal_id(&asked);
        let mut goals = self.kept.iter_mut();
        match goals.find(|goal| goal.info.goal_id == id) {
            Some(goal) if goal.is_active() => goal.waiting.push(request),
            Some(goal) => request.answer(Ok(goal.response())),
            None => request.answer(Ok(to_cdr(&<A::Types as probecell_msgs::Action>::ending(
                0,
                ResultOf::<A>::default(),
            )))),
        }
    }

    /// Tells of the goal that is pursued.
    pub(super) fn feed_back(&mut self, feedback: FeedbackOf<A>) {
        if let Some(goal) = self.kept.iter().find(|goal| goal.is_active()) {
            let message =
                <A::Types as probecell_msgs::Action>::feedback(goal.info.goal_id, feedback);
            publish::<A>(&self.feedback, &message);
        }
    }

    /// Ends the goal that is pursued.
    pub(super) fn end(&mut self, status: i8, result: ResultOf<A>) {
        let Some(goal) = self.active() else { return };
        goal.result = result;
        // It may end before whoever cancels it is answered.
        if status == GoalStatus::STATUS_CANCELED {
            self.set_status(GoalStatus::STATUS_CANCELING);
        }
        self.set_status(status);
    }

    /// Gives the goal that is pursued another status; a terminal one ends it.
    fn set_status(&mut self, status: i8) {
        let Some(goal) = self.active().filter(|goal| goal.status != status) else {
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
        let status = |goal: &Goal<A>| GoalStatus {
            goal_info: goal.info,
            status: goal.status,
        };
        let status_list = self.kept.iter().map(status).collect();
        publish::<A>(&self.status, &GoalStatusArray { status_list });
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

fn publish<A: Action>(publisher: &Publisher, message: &impl Message) {
    if let Err(error) = publisher.publish(to_cdr(message), host::now().0) {
        tracing::error!("the action {}: {error}", A::NAME);
    }
}
