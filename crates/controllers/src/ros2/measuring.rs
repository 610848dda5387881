//! A measurement: each move of the order is one goal of `FollowJointTrajectory`, and a probing move ends at the contact.
//!
//! A rapid move is straight in the joints and follows the motion model of the cell ([`machine::motion`]); a move at a feed
//! takes the way of the ball over the feed. A contact that arrives after a goal was sent cancels all goals, so that the robot
//! stops; what its stamp says is looked at afterwards. Where the robot was at the contact it has latched, or it is found from
//! the samples of its joints ([`machine::contact_position`]).
//!
//! Nothing is sent unless the robot stands, its newest sample is new, and its messages are those of one publisher with one clock.

use std::time::{Duration, Instant};

use machine::contact_position::POSITION_LIMIT;
use probecell_msgs::{ControllerCommand, MeasurementOrder, ProbeTrigger, ProbingMove};

use super::{
    action::{ANSWER_LIMIT, header},
    calls::Pending,
    config::{ContactPositions, RawContact},
    leg::{ARRIVED, Leg, STANDSTILL_LIMIT, World, rest},
    received::{Joints, Received},
    trajectory::{Frame, SAME, check_start, goal_id, trajectory},
    wire,
};

/// A robot may take this much longer than its trajectory.
const LATE: f64 = 60.0;
/// The positions of a contact come within this time.
const CONTACT_LIMIT: Duration = Duration::from_secs(2);
/// A goal is sent from a sample of the joints that has come within this time: two samples at 10 Hz.
const NEW: Duration = Duration::from_millis(250);
/// Enough messages to compare the clocks come within this time: a level that is published once a second is heard twelve times.
const CLOCK_LIMIT: Duration = Duration::from_secs(12);
/// s; the smallest delays of two publishers, each the best of ten messages or more, differ by less than this on a host under load.
const CLOCK_RESOLUTION: f64 = 1e-3;

/// How far a measurement has got.
pub(super) enum Progress {
    Working,
    Ended,
    /// It cannot go on: `code: text`.
    Broken(String),
}

/// A measurement under way.
pub(super) struct Measurement {
    pub(super) command: ControllerCommand,
    /// Triggers to be published; session and number are not yet filled in.
    pub(super) triggers: Vec<ProbeTrigger>,
    next: usize,
    leg: Option<Leg>,
    /// Wrong messages that had come before.
    faults: u64,
    /// Since when nothing can be sent, as clocks are not known or the robot does not stand.
    waiting: Option<Instant>,
}

impl Measurement {
    /// `faults` messages were wrong before.
    pub(super) fn new(command: ControllerCommand, faults: u64) -> Self {
        Self {
            command,
            triggers: Vec::new(),
            next: 0,
            leg: None,
            faults,
            waiting: None,
        }
    }

    /// A goal that the robot has not answered yet.
    pub(super) fn unanswered(&mut self) -> Option<Pending> {
        self.leg.as_mut()?.sent.take()
    }

    /// Goes on as far as what was received allows.
    pub(super) fn poll(
        &mut self,
        received: &mut Received,
        world: &World<'_>,
        order: Option<&MeasurementOrder>,
    ) -> Progress {
        let Some(order) = order.filter(|order| {
            order.plan_id == self.command.plan_id && order.order == self.command.order
        }) else {
            return Progress::Working;
        };
        let Some(one) = order.moves.get(self.next) else {
            return Progress::Ended;
        };
        let limit = clock_limit(world.contact, order);
        let done = self
            .check(received, world, limit)
            .and_then(|known| match self.leg.take() {
                None if !known => self.wait(
                    world.at,
                    CLOCK_LIMIT,
                    "too few messages have come to compare the clocks of joint states and contact",
                ),
                None => self.begin(received, world, (order, one)),
                Some(leg) => self.follow(leg, received, world, one, limit),
            });
        match done {
            Ok(false) => Progress::Working,
            Ok(true) => {
                self.next += 1;
                Progress::Working
            }
            Err(text) => Progress::Broken(text),
        }
    }

    /// Whether the messages of the robot may be believed; false while that is not known.
    fn check(
        &self,
        received: &Received,
        world: &World<'_>,
        limit: Duration,
    ) -> Result<bool, String> {
        if received.faults() > self.faults {
            return Err(alarm(received.fault()));
        }
        match world.contact.positions {
            ContactPositions::Latched => Ok(true),
            ContactPositions::Interpolated => received.one_clock(limit).map_err(alarm),
        }
    }

    /// Nothing is sent yet, for `limit` at most.
    fn wait(&mut self, at: Instant, limit: Duration, why: &str) -> Result<bool, String> {
        let since = *self.waiting.get_or_insert(at);
        if at.saturating_duration_since(since) > limit {
            return Err(alarm(why));
        }
        Ok(false)
    }

    /// Sends the goal of a move; true where it is none.
    fn begin(
        &mut self,
        received: &mut Received,
        world: &World<'_>,
        (order, one): (&MeasurementOrder, &ProbingMove),
    ) -> Result<bool, String> {
        let frame = world.frame;
        let is_new = received.silence(world.at).is_some_and(|age| age < NEW);
        if !(is_new && received.stands_since(None)) {
            let why = "the robot moves although nothing of this cell moves it, or its joint states come too seldom to tell";
            return self.wait(world.at, STANDSTILL_LIMIT, why);
        }
        self.waiting = None;
        let Some(newest) = received.newest() else {
            return Ok(false);
        };
        let from = newest.positions.clone();
        let is_touch = one.kind == ProbingMove::TOUCH;
        if one.kind != ProbingMove::RETRACT && received.level() == Some(true) {
            if is_touch {
                self.trigger(one, frame, newest, [true, true])
                    .map_err(alarm)?;
            }
            return Err(format!(
                "probe_stuck: the probe was tripped where the move to point {} began",
                one.point_index
            ));
        }
        let target = frame
            .chain
            .positions(&order.axis_names, &one.axis_positions);
        let target = target.map_err(alarm)?;
        let target = frame.actual(&target).map_err(alarm)?;
        let moves = from.iter().zip(&target).any(|(a, b)| (a - b).abs() > SAME);
        if !moves {
            if is_touch {
                self.trigger(one, frame, newest, [false, false])
                    .map_err(alarm)?;
            }
            return Ok(true);
        }
        let points = trajectory(frame, &from, &target, one.feed);
        check_start(frame.chain, &newest.positions, &points).map_err(alarm)?;
        let duration = points.last().map_or(0.0, |last| last.time);
        let goal = goal_id(world.now, self.next);
        let request = wire::send_goal(&goal, &received.joint_names(), &points, ARRIVED);
        let begun = newest.stamp;
        // From here on a contact stops the robot, also one that comes before the goal does.
        received.arm(world.action, rest(one));
        self.leg = Some(Leg {
            begun,
            sent_at: world.at,
            counts: received.counts(),
            goal,
            sent: Some(Pending::call(
                &world.action.send,
                request,
                ANSWER_LIMIT,
                world.at,
            )),
            result: None,
            cancels: Vec::new(),
            contact: None,
            target,
            limit: Duration::from_secs_f64(duration + LATE),
            ended: None,
            failed: None,
        });
        Ok(false)
    }

    /// Follows a goal; true when its move has ended.
    fn follow(
        &mut self,
        mut leg: Leg,
        received: &mut Received,
        world: &World<'_>,
        one: &ProbingMove,
        clock: Duration,
    ) -> Result<bool, String> {
        leg.look_for_contact(received, world, one);
        let went_on = leg
            .go_on(received, world)
            .and_then(|()| leg.check_end(world.at, one));
        if leg.contact.is_some() && one.kind != ProbingMove::TOUCH {
            self.leg = Some(leg);
            return Err(format!(
                "unplanned_touch: probe tripped during non-probe move to point {}",
                one.point_index
            ));
        }
        if let Err(text) = went_on {
            self.leg = Some(leg);
            return Err(alarm(text));
        }
        let is_open = leg.failed.is_some() && leg.contact.is_none();
        let has_ended = leg.ended.is_some() && !is_open;
        if !(has_ended && received.stands_since(Some(leg.sent_at))) {
            let late = leg.is_late(world.at);
            self.leg = Some(leg);
            return late.map(|()| false).map_err(alarm);
        }
        if let Err(text) = leg.check_target(received, world.frame) {
            let may_be_a_contact =
                one.kind == ProbingMove::TOUCH && leg.contact_may_follow(world.at);
            self.leg = Some(leg);
            return if may_be_a_contact {
                Ok(false)
            } else {
                Err(alarm(text))
            };
        }
        received.disarm();
        if one.kind != ProbingMove::TOUCH {
            return Ok(true);
        }
        let Some((trip, since)) = leg.contact else {
            let newest = received.newest().cloned();
            let newest = newest.ok_or_else(|| alarm("no joint states"))?;
            self.trigger(one, world.frame, &newest, [false, false])
                .map_err(alarm)?;
            return Ok(true);
        };
        match leg.touched(trip, received, world, clock) {
            Ok(Some(joints)) => {
                self.trigger(one, world.frame, &joints, [true, false])
                    .map_err(alarm)?;
                Ok(true)
            }
            Ok(None) if world.at.saturating_duration_since(since) > CONTACT_LIMIT => {
                Err(alarm(format!(
                    "the positions of the contact at point {} have not come",
                    one.point_index
                )))
            }
            Ok(None) => {
                self.leg = Some(leg);
                Ok(false)
            }
            Err(text) => Err(alarm(format!(
                "the touch of point {} at {:.6} s is refused: {text}",
                one.point_index,
                trip.stamp as f64 * 1e-9
            ))),
        }
    }

    /// A trigger: `tripped`, and whether before the move began.
    fn trigger(
        &mut self,
        one: &ProbingMove,
        frame: &Frame<'_>,
        joints: &Joints,
        [tripped, tripped_before]: [bool; 2],
    ) -> Result<(), String> {
        self.triggers.push(ProbeTrigger {
            header: header(joints.stamp),
            plan_id: self.command.plan_id.clone(),
            point_index: one.point_index,
            tripped,
            tripped_before,
            axis_names: frame.chain.axis_names().map(str::to_owned).collect(),
            axis_positions: frame.programmed(&joints.positions)?,
            feed: one.feed,
            ..ProbeTrigger::default()
        });
        Ok(())
    }
}

fn alarm(text: impl std::fmt::Display) -> String {
    format!("controller_alarm: {text}")
}

/// By how much the clocks of joints and contact may differ: what that does to a touch at the highest feed of the order is within
/// [`POSITION_LIMIT`], or within three standard uncertainties of its instant, which are in U already.
fn clock_limit(contact: &RawContact, order: &MeasurementOrder) -> Duration {
    let touches = order.moves.iter();
    let touches = touches.filter(|one| one.kind == ProbingMove::TOUCH);
    let feed = touches.map(|one| one.feed).fold(0.0, f64::max);
    let stated = 3.0 * contact.time_standard_uncertainty_ms * 1e-3;
    let seconds = (POSITION_LIMIT / feed.max(POSITION_LIMIT)).max(stated);
    Duration::from_secs_f64(seconds.max(CLOCK_RESOLUTION))
}
