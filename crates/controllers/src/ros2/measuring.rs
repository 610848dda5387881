//! A measurement: each move of the order is one goal of `FollowJointTrajectory`, and a probing move ends at the contact.
//!
//! A rapid move is straight in the joints and follows the motion model of the cell ([`machine::motion`]); a move at a feed
//! takes the way of the ball over the feed. At a contact all goals are cancelled, so that the robot stops; where it was at the
//! contact it has latched, or is interpolated between the samples of its joints.

use std::time::{Duration, Instant};

use machine::{Chain, Nominal};
use nalgebra::{Isometry3, Point3};
use probecell_msgs::{
    ControllerCommand, InspectionPlan, MeasurementOrder, ProbeTrigger, ProbingMove,
};

use super::{
    action::{ANSWER_LIMIT, Action, header},
    calls::Pending,
    config::{ContactPositions, RawContact},
    program::shifts,
    received::{Joints, Received},
    wire::{self, GoalId, Waypoint},
};

/// Between two waypoints of a rapid move, s.
const STEP: f64 = 0.02;
/// A robot may take this much longer than its trajectory.
const LATE: f64 = 60.0;
/// Where targets differ by less (m or rad), nothing moves.
const SAME: f64 = 1e-9;
/// The positions of a contact come within this time.
const CONTACT_LIMIT: Duration = Duration::from_secs(2);

/// How far a measurement has got.
pub(super) enum Progress {
    Working,
    Ended,
    /// It cannot go on: `code: text`.
    Broken(String),
}

/// The frame in which the program runs, against that of the robot.
pub(super) struct Frame<'a> {
    chain: &'a Chain,
    offsets: &'a [(String, f64)],
    pose: Isometry3<f64>,
    ball: Point3<f64>,
}

impl<'a> Frame<'a> {
    pub(super) fn new(
        chain: &'a Chain,
        plan: &InspectionPlan,
        offsets: &'a [(String, f64)],
    ) -> Result<Self, String> {
        let nominal = Nominal::from_plan(plan).map_err(|error| error.to_string())?;
        Ok(Self {
            chain,
            offsets,
            pose: nominal.part_pose,
            ball: nominal.ball,
        })
    }

    /// Positions of the robot for programmed ones.
    fn actual(&self, programmed: &[f64]) -> Result<Vec<f64>, String> {
        self.shifted(programmed, 1.0)
    }

    /// Programmed positions for those of the robot.
    pub(super) fn programmed(&self, actual: &[f64]) -> Result<Vec<f64>, String> {
        self.shifted(actual, -1.0)
    }

    fn shifted(&self, positions: &[f64], sign: f64) -> Result<Vec<f64>, String> {
        let shifts = shifts(self.chain, self.offsets, sign);
        self.chain
            .with_work_offsets(positions, shifts.into_iter(), &self.pose, &self.ball)
            .map_err(|error| error.to_string())
    }

    fn ball(&self, positions: &[f64]) -> Point3<f64> {
        self.chain.ball_in_part(positions, &self.pose, &self.ball)
    }
}

/// One move on its way.
struct Leg {
    /// ns; contacts and standstills of this move are newer.
    begun: i64,
    goal: GoalId,
    sent: Option<Pending>,
    result: Option<Pending>,
    cancel: Option<Pending>,
    contact: Option<(i64, Instant)>,
    limit: Duration,
    ended: bool,
}

/// A measurement under way.
pub(super) struct Measurement {
    pub(super) command: ControllerCommand,
    /// Triggers to be published; session and number are not yet filled in.
    pub(super) triggers: Vec<ProbeTrigger>,
    next: usize,
    leg: Option<Leg>,
}

impl Measurement {
    pub(super) fn new(command: ControllerCommand) -> Self {
        Self {
            command,
            triggers: Vec::new(),
            next: 0,
            leg: None,
        }
    }

    /// Goes on as far as what was received allows.
    pub(super) fn poll(
        &mut self,
        now: i64,
        received: &Received,
        action: &Action,
        frame: &Frame<'_>,
        order: Option<&MeasurementOrder>,
        contact: &RawContact,
    ) -> Progress {
        let Some(order) = order.filter(|order| {
            order.plan_id == self.command.plan_id && order.order == self.command.order
        }) else {
            return Progress::Working;
        };
        let Some(one) = order.moves.get(self.next) else {
            return Progress::Ended;
        };
        let done = match self.leg.take() {
            None => self.begin(now, received, action, frame, (order, one)),
            Some(leg) => self.follow(leg, received, action, frame, one, contact),
        };
        match done {
            Ok(false) => Progress::Working,
            Ok(true) => {
                self.next += 1;
                Progress::Working
            }
            Err(text) => Progress::Broken(text),
        }
    }

    /// Sends the goal of a move; true where it is none.
    fn begin(
        &mut self,
        now: i64,
        received: &Received,
        action: &Action,
        frame: &Frame<'_>,
        (order, one): (&MeasurementOrder, &ProbingMove),
    ) -> Result<bool, String> {
        let alarm = |text: String| format!("controller_alarm: {text}");
        let Some(newest) = received.newest() else {
            return Ok(false);
        };
        let from = newest.positions.clone();
        let is_touch = one.kind == ProbingMove::TOUCH;
        if is_touch && received.level() == Some(true) {
            self.trigger(one, frame, newest, [true, true])
                .map_err(alarm)?;
            return Err(format!(
                "probe_stuck: the probe was tripped where the move to point {} began",
                one.point_index
            ));
        }
        let target = frame
            .chain
            .positions(&order.axis_names, &one.axis_positions);
        let target = target.map_err(|error| alarm(error.to_string()))?;
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
        let duration = points.last().map_or(0.0, |last| last.time);
        let names = received.joint_names();
        let goal = goal_id(now, self.next);
        let request = wire::send_goal(&goal, names, &points);
        self.leg = Some(Leg {
            begun: newest.stamp,
            goal,
            sent: Some(Pending::call(&action.send, request, ANSWER_LIMIT)),
            result: None,
            cancel: None,
            contact: None,
            limit: Duration::from_secs_f64(duration + LATE),
            ended: false,
        });
        Ok(false)
    }

    /// Follows a goal; true when its move has ended.
    fn follow(
        &mut self,
        mut leg: Leg,
        received: &Received,
        action: &Action,
        frame: &Frame<'_>,
        one: &ProbingMove,
        contact: &RawContact,
    ) -> Result<bool, String> {
        let alarm = |text: String| format!("controller_alarm: {text}");
        if leg.contact.is_none()
            && one.kind != ProbingMove::RETRACT
            && let Some(trip) = received.trip_after(leg.begun)
        {
            leg.contact = Some((trip, Instant::now()));
            leg.cancel = Some(action.cancel());
            if one.kind != ProbingMove::TOUCH {
                return Err(format!(
                    "unplanned_touch: probe tripped during non-probe move to point {}",
                    one.point_index
                ));
            }
        }
        answered(&mut leg, action).map_err(alarm)?;
        if let Some(answer) = leg.result.as_ref().and_then(Pending::answer) {
            leg.result = None;
            leg.ended = true;
            let (status, code, text) = answer
                .and_then(|response| {
                    let result = wire::result(&response);
                    result.ok_or_else(|| "the result is no FollowJointTrajectory".to_owned())
                })
                .map_err(alarm)?;
            // A robot may end a cancelled goal as it likes.
            if status != wire::STATUS_SUCCEEDED && leg.contact.is_none() {
                return Err(alarm(format!(
                    "the trajectory has ended with status {status}, error {code} {text}"
                )));
            }
        }
        if !(leg.ended && received.stands_since(leg.begun)) {
            self.leg = Some(leg);
            return Ok(false);
        }
        if one.kind != ProbingMove::TOUCH {
            return Ok(true);
        }
        let Some((trip, since)) = leg.contact else {
            let newest = received.newest().cloned();
            let newest = newest.ok_or_else(|| alarm("no joint states".to_owned()))?;
            self.trigger(one, frame, &newest, [false, false])
                .map_err(alarm)?;
            return Ok(true);
        };
        let latch = match contact.positions {
            ContactPositions::Latched => received.latched_after(leg.begun).cloned(),
            ContactPositions::Interpolated => {
                received.at(trip - (contact.delay_ms * 1e6).round() as i64)
            }
        };
        match latch {
            Some(latch) => {
                self.trigger(one, frame, &latch, [true, false])
                    .map_err(alarm)?;
                Ok(true)
            }
            None if since.elapsed() > CONTACT_LIMIT => Err(alarm(format!(
                "the positions of the contact at point {} have not come",
                one.point_index
            ))),
            None => {
                self.leg = Some(leg);
                Ok(false)
            }
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

/// Takes the answer to a goal, and asks for its result.
fn answered(leg: &mut Leg, action: &Action) -> Result<(), String> {
    let Some(answer) = leg.sent.as_ref().and_then(Pending::answer) else {
        return Ok(());
    };
    leg.sent = None;
    match wire::accepted(&answer?) {
        Some(true) => {
            let request = wire::get_result(&leg.goal);
            leg.result = Some(Pending::call(&action.result, request, leg.limit));
            Ok(())
        }
        Some(false) => Err("the robot does not accept the trajectory".to_owned()),
        None => Err("the answer to the trajectory is no FollowJointTrajectory".to_owned()),
    }
}

/// A goal is of one measurement of one driver.
fn goal_id(now: i64, number: usize) -> GoalId {
    let mut id = [0; 16];
    id[..8].copy_from_slice(&now.to_le_bytes());
    id[8..].copy_from_slice(&(number as u64 + 1).to_le_bytes());
    id
}

/// From one set of positions to another; `feed` (m/s of the ball in the part) 0 is rapid.
fn trajectory(frame: &Frame<'_>, from: &[f64], to: &[f64], feed: f64) -> Vec<Waypoint> {
    let at = |share: f64| {
        from.iter()
            .zip(to)
            .map(|(a, b)| a + (b - a) * share)
            .collect()
    };
    let motion = frame.chain.motion();
    if feed > 0.0 {
        let distance = (frame.ball(to) - frame.ball(from)).norm();
        // Where the ball stays, the axes decide.
        let time = (distance / feed).max(motion.time(from, to)).max(STEP);
        return vec![Waypoint {
            time,
            positions: to.to_vec(),
        }];
    }
    let profile = motion.leading(from, to);
    let duration = profile.map_or_else(|| motion.time(from, to), |profile| profile.duration());
    let steps = (duration / STEP).ceil().max(1.0) as usize;
    let times = (1..=steps).map(|step| duration.max(STEP) * step as f64 / steps as f64);
    times
        .map(|time| Waypoint {
            time,
            positions: match profile {
                _ if time >= duration => to.to_vec(),
                Some(profile) => at(profile.share_at(time)),
                None => at(time / duration),
            },
        })
        .collect()
}
