//! One move of a measurement on its way: its goal, the contact that ends it, and where the robot was then.

use std::time::{Duration, Instant};

use machine::contact_position::{Sample, locate};
use probecell_msgs::ProbingMove;

use super::{
    action::Action,
    calls::Pending,
    config::{ContactPositions, RawContact},
    received::{Joints, Received, Trip},
    trajectory::Frame,
    wire::{self, GoalId, GoalResult},
};

/// The message of a contact at which a robot ends its trajectory itself comes within this time after.
const CONTACT_FOLLOWS: Duration = Duration::from_millis(500);
/// A robot stands within this time after its trajectory, or after a contact.
pub(super) const STANDSTILL_LIMIT: Duration = Duration::from_millis(4500);
/// A probe that is retracted bounces when it comes free; a contact of the way back comes after it has rested for this long.
const BOUNCE: Duration = Duration::from_millis(50);

/// m or rad; a joint that is no farther from its target has come to it.
pub(super) const ARRIVED: f64 = 1e-3;

/// What a measurement goes on by.
pub(super) struct World<'a> {
    pub(super) now: i64,
    pub(super) at: Instant,
    pub(super) action: &'a Action,
    pub(super) frame: &'a Frame<'a>,
    pub(super) contact: &'a RawContact,
}

/// One move on its way.
pub(super) struct Leg {
    /// ns by the clock of the joints; samples of this move are newer.
    pub(super) begun: i64,
    /// Samples of a standstill after this move have come later.
    pub(super) sent_at: Instant,
    /// How many contacts and latched positions had come before.
    pub(super) counts: [u64; 2],
    pub(super) goal: GoalId,
    pub(super) sent: Option<Pending>,
    pub(super) result: Option<Pending>,
    pub(super) cancels: Vec<Pending>,
    pub(super) contact: Option<(Trip, Instant)>,
    /// m or rad, in the order of the axes.
    pub(super) target: Vec<f64>,
    /// Its result comes within this time.
    pub(super) limit: Duration,
    pub(super) ended: Option<Instant>,
    /// How the trajectory has ended, where not at its target.
    pub(super) failed: Option<GoalResult>,
}

impl Leg {
    /// A contact that has come since the goal was sent has cancelled it, or does now.
    pub(super) fn look_for_contact(
        &mut self,
        received: &mut Received,
        world: &World<'_>,
        one: &ProbingMove,
    ) {
        if self.contact.is_some() {
            return;
        }
        if let Some(trip) = received.trip_after(self.counts[0], rest(one)) {
            self.contact = Some((trip, world.at));
            let cancel = received.disarm();
            self.cancels
                .push(cancel.unwrap_or_else(|| world.action.cancel(world.at)));
        }
    }

    /// Takes the answer to a goal, asks for its result, and takes that.
    pub(super) fn go_on(&mut self, received: &Received, world: &World<'_>) -> Result<(), String> {
        if let Some(answer) = self.sent.as_ref().and_then(|sent| sent.answer(world.at)) {
            self.sent = None;
            match wire::accepted(&answer?) {
                Some(true) => {
                    let request = wire::get_result(&self.goal);
                    let result = Pending::call(&world.action.result, request, self.limit, world.at);
                    self.result = Some(result);
                    if self.contact.is_some() {
                        // The goal may have come after what cancelled it.
                        self.cancels.push(world.action.cancel(world.at));
                    }
                }
                Some(false) => {
                    return Err(
                        "the controller does not accept the trajectory; the reason is in its log (a controller that is not active accepts none)"
                            .to_owned(),
                    );
                }
                None => {
                    return Err(
                        "the answer to the trajectory is no FollowJointTrajectory".to_owned()
                    );
                }
            }
        }
        let mut failed = None;
        self.cancels.retain(|call| match call.answer(world.at) {
            None => true,
            Some(answer) => {
                failed = failed.take().or(answer.err());
                false
            }
        });
        if let Some(text) = failed {
            return Err(format!("the trajectory could not be cancelled: {text}"));
        }
        let Some(answer) = self.result.as_ref().and_then(|one| one.answer(world.at)) else {
            return Ok(());
        };
        self.result = None;
        self.ended = Some(world.at);
        let answer = answer.map_err(|text| {
            if world.at.saturating_duration_since(self.sent_at) < self.limit {
                return text;
            }
            format!(
                "the controller has not ended the trajectory within {:.1} s, and {}; possible causes: a protective stop, a blocked joint, a speed of 0",
                self.limit.as_secs_f64(),
                self.place(received, world.frame)
            )
        })?;
        let result = wire::result(&answer)
            .ok_or_else(|| "the result is no FollowJointTrajectory".to_owned())?;
        // A robot may end a goal as it likes that was cancelled, or that it ends at the contact itself.
        self.failed = (!result.has_succeeded()).then_some(result);
        Ok(())
    }

    /// A trajectory that has not come to its target has met a contact, whose message may be on its way.
    pub(super) fn check_end(&self, at: Instant, one: &ProbingMove) -> Result<(), String> {
        let (Some(failed), Some(_), None) = (&self.failed, self.ended, self.contact) else {
            return Ok(());
        };
        let may_follow = one.kind == ProbingMove::TOUCH && self.contact_may_follow(at);
        if !(may_follow && failed.may_be_a_contact()) {
            return Err(failed.sentence());
        }
        Ok(())
    }

    /// The message of a contact at which the trajectory has ended may still be on its way.
    pub(super) fn contact_may_follow(&self, at: Instant) -> bool {
        (self.ended).is_some_and(|ended| at.saturating_duration_since(ended) <= CONTACT_FOLLOWS)
    }

    /// A trajectory that has succeeded, and after which the robot stands, has come to its target.
    pub(super) fn check_target(
        &self,
        received: &Received,
        frame: &Frame<'_>,
    ) -> Result<(), String> {
        let is_there = received.newest().is_some_and(|newest| {
            let pairs = newest.positions.iter().zip(&self.target);
            pairs.into_iter().all(|(a, b)| (a - b).abs() <= ARRIVED)
        });
        // What has met a contact, or was ended before, is nowhere near it.
        if is_there || self.contact.is_some() || self.failed.is_some() {
            return Ok(());
        }
        Err(format!(
            "the controller says that the trajectory has succeeded, but {}",
            self.place(received, frame)
        ))
    }

    /// How far the robot is from the target of the move, in words.
    fn place(&self, received: &Received, frame: &Frame<'_>) -> String {
        let Some(newest) = received.newest() else {
            return "it is not known where the arm is".to_owned();
        };
        let pairs = newest.positions.iter().zip(&self.target);
        let ways = pairs.map(|(a, b)| (a - b).abs()).enumerate();
        let most = ways.max_by(|(_, a), (_, b)| a.total_cmp(b));
        let Some((index, way)) = most else {
            return "it is not known where the arm is".to_owned();
        };
        let (name, unit) = (&frame.chain.axis(index).name, received.unit(index));
        format!("axis {name:?} is {way:.4} {unit} from its target")
    }

    /// Where the robot was at a contact; none until that has come.
    pub(super) fn touched(
        &self,
        trip: Trip,
        received: &Received,
        world: &World<'_>,
        clock: Duration,
    ) -> Result<Option<Joints>, String> {
        if world.contact.positions == ContactPositions::Latched {
            let Some(latched) = received.latched_after(self.counts[1]) else {
                return Ok(None);
            };
            received.check_latched(latched, self.begun, clock)?;
            return Ok(Some(latched.clone()));
        }
        let instant = trip.stamp - (world.contact.delay_ms * 1e6).round() as i64;
        if received.newest().is_none_or(|last| last.stamp <= instant) {
            return Ok(None);
        }
        let samples = received.samples_after(self.begun);
        let samples = samples.iter().map(|one| {
            let time = (one.stamp - instant) as f64 * 1e-9;
            (time, one.positions.as_slice())
        });
        let samples: Vec<Sample<'_>> = samples.collect();
        let (found, _) = locate(&samples, clock.as_secs_f64(), |positions| {
            world.frame.ball(positions)
        })?;
        Ok(Some(Joints::at(instant, found)))
    }

    /// A robot stands soon after its trajectory, or after a contact.
    pub(super) fn is_late(&self, at: Instant) -> Result<(), String> {
        let after = |since: Option<Instant>, what: &str| match since {
            Some(since) if at.saturating_duration_since(since) > STANDSTILL_LIMIT => Err(format!(
                "the robot does not stand {:.1} s after {what}",
                STANDSTILL_LIMIT.as_secs_f64()
            )),
            _ => Ok(()),
        };
        after(self.contact.map(|(_, since)| since), "the contact")?;
        after(self.ended, "the end of its trajectory")
    }
}

/// How long the probe has rested before a contact that counts during a move.
pub(super) fn rest(one: &ProbingMove) -> Duration {
    if one.kind == ProbingMove::RETRACT {
        BOUNCE
    } else {
        Duration::ZERO
    }
}
