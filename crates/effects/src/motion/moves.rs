//! The moves between successive touches of a session: from its measuring orders, or where there is none from the recorded
//! axes.

use std::collections::BTreeMap;

use machine::{Chain, JointKind, Motion, Nominal, touch_positions};
use metrology::statistics::{median, robust_deviation};
use probecell_msgs::{InspectionPlan, MachineState, MeasurementOrder, ProbeEvent, ProbingMove};

use super::probing::Probing;
use super::track::Track;
use crate::session::{Session, SessionError, seconds};

/// The moves from one touch to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Interval {
    /// Instant of the second touch, s from the first of the session.
    pub time: f64,
    /// Sequences of both events.
    pub sequences: [u64; 2],
    /// Points touched.
    pub points: [u32; 2],
    /// Positions of the axes at the first touch, m or rad.
    pub start: Vec<f64>,
    /// And at the second, m or rad.
    pub end: Vec<f64>,
    /// Path of the ball in the first move back, m.
    pub retreat: f64,
    /// Targets of the positioning moves in between, the start of the probing move last: positions of all axes, m or rad.
    pub targets: Vec<Vec<f64>>,
    /// Path of the ball in the probing move until the touch, m.
    pub distance: f64,
    /// Its feed, m/s.
    pub feed: f64,
    /// Time between both touches, s.
    pub measured: f64,
}

/// The moves of a session and the motion model that promised their times.
#[derive(Debug, Clone)]
pub struct Moves {
    /// Name of each axis, and whether it turns.
    pub axes: Vec<(String, bool)>,
    /// The declared motion model.
    pub declared: Motion,
    /// In the order of time.
    pub intervals: Vec<Interval>,
    /// Least and largest share of its feed at which the recorded axes show the probing moves; `None` where they do not show it.
    pub feed_seen: Option<[f64; 2]>,
    /// What was left out, and what the controller said about itself.
    pub remarks: Vec<String>,
}

/// Why the times of a session cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum MovesError {
    /// Machine, plan or events cannot be used.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Neither an order nor axes over time.
    #[error(
        "the session has no measurement_order of plan `{0}`, and too few joint_states between its touches to see the moves"
    )]
    NoMoves(String),
    /// Too few of them.
    #[error("the session has {0} moves between successive touches; at least {1} are needed")]
    TooFew(usize, usize),
}

/// Fewest moves that are compared.
const FEWEST: usize = 8;
/// Standard deviations to either side of the share of the feed that is seen ([`Moves::feed_seen`]).
pub const FEED_DEVIATIONS: f64 = 3.0;
/// Least distance to either side, as a share of it: axes are recorded at instants that are rounded.
const FINEST_FEED: f64 = 0.01;
/// Standard deviation of a median over that of a mean.
const OF_MEDIAN: f64 = 1.253;

impl Moves {
    /// How long each row takes by a motion model, s.
    pub fn durations(&self, motion: &Motion) -> Vec<f64> {
        let of = |row: &Interval| {
            let back = row.targets.first().map_or(&row.start, |target| target);
            let begins = row.targets.last().map_or(&row.start, |target| target);
            let stopped = (row.start.as_slice(), back.as_slice());
            motion.stopping(stopped, row.retreat, row.feed)
                + motion.time_along(&row.start, &row.targets)
                + motion.touching((begins, &row.end), row.distance, row.feed)
        };
        self.intervals.iter().map(of).collect()
    }

    /// How far each axis travels in a row, m or rad.
    pub fn travel(&self, row: &Interval) -> Vec<f64> {
        let mut sums = vec![0.0; self.axes.len()];
        let mut at = &row.start;
        for target in &row.targets {
            for (sum, (from, to)) in sums.iter_mut().zip(at.iter().zip(target)) {
                *sum += (to - from).abs();
            }
            at = target;
        }
        sums
    }

    /// True where an axis takes part in some positioning move.
    pub(super) fn is_moved(&self, axis: usize) -> bool {
        let moved = |row: &Interval| self.travel(row)[axis] > 1e-6;
        self.intervals.iter().any(moved)
    }

    /// Says what was left out, of moves held and of moves unseen, and whether enough remain.
    fn remark(
        &mut self,
        [held, unseen]: [usize; 2],
        by_axes: bool,
        plan: &InspectionPlan,
    ) -> Result<(), MovesError> {
        if self.intervals.is_empty() && unseen > 0 && by_axes {
            return Err(MovesError::NoMoves(plan.plan_id.clone()));
        }
        if self.intervals.len() < FEWEST {
            return Err(MovesError::TooFew(self.intervals.len(), FEWEST));
        }
        if held > 0 {
            self.remarks.push(format!(
                "{held} moves were left out: the machine was held or stopped in them"
            ));
        }
        if unseen > 0 {
            self.remarks.push(format!(
                "{unseen} moves were left out: neither an order nor the recorded axes give their path"
            ));
        }
        if by_axes {
            self.remarks.push(
                "no measurement_order: the moves were read from the recorded axes".to_owned(),
            );
        }
        Ok(())
    }
}

/// The moves between successive touches of a session with the orders of its plan; `motion` is the declared model.
///
/// # Errors
/// [`MovesError`] names what is missing.
pub fn moves(
    session: &Session,
    orders: &[MeasurementOrder],
    motion: &Motion,
) -> Result<Moves, MovesError> {
    if session.robot_description.is_empty() {
        return Err(SessionError::NoMachine.into());
    }
    let chain = Chain::from_urdf(&session.robot_description).map_err(SessionError::from)?;
    let plan = session.plan.as_ref().ok_or(SessionError::NoPlan)?;
    let nominal = Nominal::from_plan(plan).map_err(SessionError::from)?;
    let probing = Probing {
        chain: &chain,
        plan,
        nominal,
    };
    let events = touches(session, &probing)?;
    let paths = ordered(&chain, plan, orders);
    let track = Track::new(&chain, &session.joint_states);
    let mut found = Moves {
        axes: (0..chain.axes().len())
            .map(|axis| chain.axis(axis))
            .map(|joint| (joint.name.clone(), joint.kind == JointKind::Revolute))
            .collect(),
        declared: motion.clone(),
        intervals: Vec::new(),
        feed_seen: None,
        remarks: spoken(&session.machine_states),
    };
    let mut shares = Vec::new();
    let first = events
        .first()
        .map_or(0.0, |(event, _)| seconds(&event.header.stamp));
    let (mut held, mut unseen) = (0, 0);
    for pair in events.windows(2) {
        let [(before, start), (after, end)] = pair else {
            continue;
        };
        let stamps = [before, after].map(|event| seconds(&event.header.stamp));
        if [before, after]
            .iter()
            .any(|event| event.outcome != ProbeEvent::OUTCOME_TOUCHED)
            || after.sequence != before.sequence + 1
            || stamps[1] <= stamps[0]
        {
            continue;
        }
        if is_held(&session.machine_states, stamps) {
            held += 1;
            continue;
        }
        let key = [before.point_index, after.point_index];
        let targets = if orders.is_empty() {
            track.targets(&probing, (before, start), (after, end))
        } else {
            paths.get(&key).cloned()
        };
        let Some((start_of_touch, targets)) =
            targets.and_then(|targets| Some((targets.last()?.clone(), targets)))
        else {
            unseen += 1;
            continue;
        };
        let feed = if after.feed > 0.0 {
            after.feed
        } else {
            point_feed(plan, after)
        };
        let distance = probing.ball_path(&start_of_touch, end);
        let speed = track.probing_speed(&probing, stamps[0], (after, end), distance);
        shares.extend(
            speed
                .map(|speed| speed / feed)
                .filter(|share| share.is_finite()),
        );
        found.intervals.push(Interval {
            time: stamps[1] - first,
            sequences: [before.sequence, after.sequence],
            points: key,
            start: start.clone(),
            end: end.clone(),
            retreat: targets
                .first()
                .map_or(0.0, |back| probing.ball_path(start, back)),
            targets,
            distance,
            feed,
            measured: stamps[1] - stamps[0],
        });
    }
    found.remark([held, unseen], orders.is_empty(), plan)?;
    found.feed_seen = seen(&shares);
    if let Some([least, most]) = found.feed_seen
        && !(least..=most).contains(&motion.program.feed_override)
    {
        found.remarks.push(format!(
            "the recorded axes show the probing moves at {:.0} % of their feed",
            50.0 * (least + most)
        ));
    }
    Ok(found)
}

/// The share that most of them have, with its uncertainty.
fn seen(shares: &[f64]) -> Option<[f64; 2]> {
    let middle = median(shares);
    let spread = OF_MEDIAN * robust_deviation(shares, middle) / (shares.len() as f64).sqrt();
    let half = (FEED_DEVIATIONS * spread).max(FINEST_FEED * middle);
    (shares.len() >= FEWEST).then_some([middle - half, middle + half])
}

fn point_feed(plan: &InspectionPlan, event: &ProbeEvent) -> f64 {
    let point = plan.points.get(event.point_index as usize);
    point.map_or(0.0, |point| point.feed)
}

/// Events of the plan in the order of their numbers, each once, with the positions of all axes.
fn touches<'s>(
    session: &'s Session,
    probing: &Probing<'_>,
) -> Result<Vec<(&'s ProbeEvent, Vec<f64>)>, SessionError> {
    let of_plan = session
        .events
        .iter()
        .filter(|event| event.plan_id == probing.plan.plan_id);
    let mut found = of_plan
        .map(|event| Ok((event, touch_positions(probing.chain, probing.plan, event)?)))
        .collect::<Result<Vec<_>, SessionError>>()?;
    found.sort_by_key(|(event, _)| event.sequence);
    found.dedup_by_key(|(event, _)| event.sequence);
    Ok(found)
}

/// Positioning targets between the touches of two points, for every pair that an order makes successive.
fn ordered(
    chain: &Chain,
    plan: &InspectionPlan,
    orders: &[MeasurementOrder],
) -> BTreeMap<[u32; 2], Vec<Vec<f64>>> {
    let mut paths = BTreeMap::new();
    for order in orders.iter().filter(|order| order.plan_id == plan.plan_id) {
        let columns: Vec<Option<usize>> = chain
            .axis_names()
            .map(|name| order.axis_names.iter().position(|known| known == name))
            .collect();
        let positions = |step: &ProbingMove| -> Vec<f64> {
            let of = |column: &Option<usize>| {
                column
                    .and_then(|column| step.axis_positions.get(column))
                    .copied()
                    .unwrap_or(0.0)
            };
            columns.iter().map(of).collect()
        };
        let mut from: Option<u32> = None;
        let mut path: Vec<Vec<f64>> = Vec::new();
        for step in &order.moves {
            if step.kind != ProbingMove::TOUCH {
                path.push(positions(step));
                continue;
            }
            let path = std::mem::take(&mut path);
            if let Some(from) = from.replace(step.point_index) {
                paths.insert([from, step.point_index], path);
            }
        }
    }
    paths
}

/// True where the controller did not run freely at some instant between two.
fn is_held(states: &[MachineState], [from, to]: [f64; 2]) -> bool {
    let within = states.iter().filter(|state| {
        let at = seconds(&state.header.stamp);
        at > from && at < to
    });
    let free = [
        MachineState::EXECUTION_RUNNING,
        MachineState::EXECUTION_IDLE,
    ];
    within
        .into_iter()
        .any(|state| !free.contains(&state.execution))
}

/// What the controller itself reports of its override.
fn spoken(states: &[MachineState]) -> Vec<String> {
    let mut overrides: Vec<f64> = states
        .iter()
        .map(|state| state.feed_override)
        .filter(|share| share.is_finite() && *share > 0.0 && (share - 1.0).abs() > 1e-3)
        .collect();
    overrides.sort_by(f64::total_cmp);
    let (Some(least), Some(most)) = (overrides.first(), overrides.last()) else {
        return Vec::new();
    };
    vec![format!(
        "the controller reported a feed override of {:.0} % to {:.0} %",
        least * 100.0,
        most * 100.0
    )]
}
