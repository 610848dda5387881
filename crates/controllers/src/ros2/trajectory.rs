//! The trajectory of a move, in the frame of the robot's program.

use machine::{Chain, Nominal};
use nalgebra::{Isometry3, Point3};
use probecell_msgs::InspectionPlan;

use super::{
    program::shifts,
    wire::{GoalId, Waypoint},
};

/// Between two waypoints of a rapid move, s.
const STEP: f64 = 0.02;
/// A first waypoint is reached at top speed times this at most; top speeds are rounded.
const TOP_SPEED_MARGIN: f64 = 1.1;
/// Where targets differ by less (m or rad), nothing moves.
pub(super) const SAME: f64 = 1e-9;

/// The frame in which the program runs, against that of the robot.
pub(super) struct Frame<'a> {
    pub(super) chain: &'a Chain,
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
    pub(super) fn actual(&self, programmed: &[f64]) -> Result<Vec<f64>, String> {
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

    pub(super) fn ball(&self, positions: &[f64]) -> Point3<f64> {
        self.chain.ball_in_part(positions, &self.pose, &self.ball)
    }
}

/// The first waypoint of a trajectory is within reach from where the robot is.
pub(super) fn check_start(
    chain: &Chain,
    newest: &[f64],
    points: &[Waypoint],
) -> Result<(), String> {
    let Some(first) = points.first() else {
        return Ok(());
    };
    let pairs = newest.iter().zip(&first.positions);
    for (index, (from, to)) in pairs.enumerate() {
        let axis = chain.axis(index);
        let speed = chain.motion().axes()[index].velocity;
        let way = (to - from).abs();
        if way > SAME + speed * TOP_SPEED_MARGIN * first.time {
            return Err(format!(
                "the first waypoint of the trajectory is {way:.4} m or rad of axis {:?} from where the robot is, to be reached in {:.3} s",
                axis.name, first.time
            ));
        }
    }
    Ok(())
}

/// A goal is of one measurement of one driver.
pub(super) fn goal_id(now: i64, number: usize) -> GoalId {
    let mut id = [0; 16];
    id[..8].copy_from_slice(&now.to_le_bytes());
    id[8..].copy_from_slice(&(number as u64 + 1).to_le_bytes());
    id
}

/// From one set of positions to another; `feed` (m/s of the ball in the part) 0 is rapid.
pub(super) fn trajectory(frame: &Frame<'_>, from: &[f64], to: &[f64], feed: f64) -> Vec<Waypoint> {
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
