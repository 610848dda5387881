//! The moves of a measuring program and the shortest order of its touches.
//!
//! Each touch has four stations of the ball along the normal: the start of the approach, the nominal contact, the end of
//! the probing move if nothing is touched, and the end of the retract. Between the retract of one touch and the approach
//! of the next the axes move at top speed; where the straight way could lead through the part ([`crate::clear`]), the
//! clearance axis goes out first and comes in last. Without a clearance axis the probe withdraws along its stem, as far as
//! it must, crosses, and comes back. The cost of a move is the time of its slowest axis at the URDF's top speed (source
//! systems C.2, for a turn-mill). The order is for the touches; positions are joint targets in m and rad.

use machine::{Chain, DeviationError, Nominal};
use nalgebra::UnitQuaternion;
use planning::check_limits;
use probecell_msgs::{InspectionPlan, MeasurementOrder, ProbingMove};

use crate::{
    stations,
    task::{Planned, Task, Wanted},
    ways::{End, Ways},
};

/// Speed taken for an axis whose URDF gives none (m/s or rad/s): slow, so that it is not preferred.
const UNKNOWN_SPEED: f64 = 0.05;
/// A plan that cannot be measured on this machine.
#[derive(Debug, thiserror::Error)]
pub enum RouteError {
    /// A station out of reach.
    #[error("point {point} cannot be touched: {source}")]
    Reach {
        /// Index of the point.
        point: usize,
        /// Why.
        source: machine::ReachError,
    },
    /// A point out of reach at every pose.
    #[error(
        "point {point} cannot be touched at any of its {poses} rotary positions; at the first: {source}"
    )]
    Poses {
        /// Index of the point.
        point: usize,
        /// Poses given.
        poses: usize,
        /// Why not at the first.
        source: machine::ReachError,
    },
    /// A rotary axis of the plan is not in the machine.
    #[error("the plan turns axis {0:?}, which the machine does not have")]
    Rotary(String),
    /// A point with a wrong number of rotary positions.
    #[error("point {point} has {given} rotary positions for {axes} rotary axes")]
    Rotaries {
        /// Index of the point.
        point: usize,
        /// Positions given.
        given: usize,
        /// Rotary axes of the plan.
        axes: usize,
    },
    /// A point of a feature that does not exist.
    #[error("point {0} belongs to a feature that the plan does not have")]
    Feature(usize),
    /// The plan has a number that cannot be used.
    #[error(transparent)]
    Plan(#[from] DeviationError),
    /// A point to touch that the plan does not have, or that is named twice.
    #[error("point {0} is not in the plan, or it is to be touched twice")]
    NoPoint(u32),
    /// A move that leaves the travel of an axis.
    #[error(
        "a move to point {point} takes axis {axis:?} to {target:.6} (m or rad), outside its travel {least:.6} to {most:.6}"
    )]
    Travel {
        /// Index of the point.
        point: u32,
        /// The axis.
        axis: String,
        /// Where the move goes, m or rad.
        target: f64,
        /// Lowest, m or rad.
        least: f64,
        /// Highest, m or rad.
        most: f64,
    },
    /// Two touches between which nothing was found that is clear.
    #[error("no way clear of the part was found from point {from} to point {to}")]
    NoWay {
        /// Index of the point left.
        from: u32,
        /// Index of the point sought.
        to: u32,
    },
    /// The cost table was refused.
    #[error("the moves between touches cannot be compared: {0}")]
    Cost(String),
}

/// How the machine may move between touches.
#[derive(Clone, Debug)]
pub struct Route<'a> {
    /// The machine.
    pub chain: &'a Chain,
    /// Axis that goes clear first (index in the chain's axes) and its clear position (m); `None`: the probe withdraws
    /// along its stem.
    pub clearance: Option<(usize, f64)>,
    /// m; how far a probing move goes on behind the nominal contact.
    pub overtravel: f64,
    /// Kicks of the local search.
    pub kicks: u64,
}

/// Where the axes start looking for a way to reach a point, and the attitude of the probe there (for an arm).
#[derive(Clone, Debug)]
pub struct Seed {
    /// Axis positions in the order of the chain's axes, m and rad.
    pub positions: Vec<f64>,
    /// Part from probe mount; `None` where the rotary axes of the plan fix it.
    pub attitude: Option<UnitQuaternion<f64>>,
}

impl RouteError {
    /// The same for a plan of which only these points are touched.
    pub(crate) fn of_points(mut self, points: &[u32]) -> Self {
        let index = |at: usize| points.get(at).copied().unwrap_or(at as u32);
        match &mut self {
            Self::Reach { point, .. }
            | Self::Poses { point, .. }
            | Self::Rotaries { point, .. }
            | Self::Feature(point) => *point = index(*point) as usize,
            Self::NoWay { from, to } => (*from, *to) = (index(*from as usize), index(*to as usize)),
            _ => {}
        }
        self
    }
}

impl Route<'_> {
    /// The shortest order found and its moves. `seeds` has one entry for each point, or is empty (the axes then start
    /// in the middle of their travel).
    ///
    /// # Errors
    /// [`RouteError`]: what cannot be reached, or passed.
    pub fn order(
        &self,
        plan: &InspectionPlan,
        seeds: &[Seed],
    ) -> Result<MeasurementOrder, RouteError> {
        let all: Vec<u32> = (0..plan.points.len() as u32).collect();
        self.order_of(plan, &all, &[], seeds)
    }

    /// The shortest order found of some points of a plan and its moves, at the plan's own rotary positions: as
    /// [`Route::planned`] with these fields of [`Wanted`].
    ///
    /// # Errors
    /// [`RouteError`]: what cannot be reached, or passed.
    pub fn order_of(
        &self,
        plan: &InspectionPlan,
        points: &[u32],
        stages: &[u32],
        seeds: &[Seed],
    ) -> Result<MeasurementOrder, RouteError> {
        let wanted = Wanted {
            plan,
            points,
            stages,
            poses: &[],
            seeds,
            here: None,
        };
        Ok(self.planned(&wanted, &mut |_| {})?.order)
    }

    /// The shortest order found of what is wanted, its moves, and the plan with the poses chosen; never longer than the
    /// order given at the first poses, and every target is within the travel of its axis. `heard` is told how far it is,
    /// now and again.
    ///
    /// # Errors
    /// [`RouteError`]: what cannot be reached, or passed.
    pub fn planned(
        &self,
        wanted: &Wanted<'_>,
        heard: &mut dyn FnMut(&Task),
    ) -> Result<Planned, RouteError> {
        let mut task = Task::new(self, wanted)?;
        loop {
            if let Some(planned) = task.go_on(self)? {
                return Ok(planned);
            }
            heard(&task);
        }
    }

    /// Targets within the travels keep every move within, for the joints go straight.
    pub(crate) fn check_travel(&self, order: &MeasurementOrder) -> Result<(), RouteError> {
        let limits: Vec<(f64, f64)> = (0..self.chain.axes().len())
            .map(|index| {
                let free = (f64::NEG_INFINITY, f64::INFINITY);
                self.chain.axis(index).limits.unwrap_or(free)
            })
            .collect();
        let targets: Vec<Vec<f64>> = order
            .moves
            .iter()
            .map(|one| one.axis_positions.clone())
            .collect();
        check_limits(&targets, &limits).map_err(|found| RouteError::Travel {
            point: order.moves[found.index].point_index,
            axis: self.chain.axis(found.axis).name.clone(),
            target: found.target,
            least: found.least,
            most: found.most,
        })
    }

    /// Axis positions (m, rad) of each touch of a plan, at the end of its probing move.
    ///
    /// # Errors
    /// [`RouteError`] for the first point that is out of reach.
    pub fn contacts(&self, plan: &InspectionPlan) -> Result<Vec<Vec<f64>>, RouteError> {
        let places = stations::places(self, plan, &Nominal::from_plan(plan)?, &[], &[])?;
        Ok(places.into_iter().map(|one| one.stations.touch).collect())
    }

    /// Joint targets to the first touch: from where the axes stand, where that is known, else from somewhere clear.
    pub(crate) fn first(&self, here: Option<&[f64]>, approach: &End) -> Vec<Vec<f64>> {
        let Some((axis, clear)) = self.clearance else {
            return vec![approach.positions.clone()];
        };
        let out = |at: &[f64]| {
            let mut out = at.to_vec();
            out[axis] = clear;
            out
        };
        let away = here.map(out);
        let way = away.into_iter().chain([out(approach.exit())]);
        way.chain(approach.exit.clone())
            .chain([approach.positions.clone()])
            .collect()
    }

    /// Seconds of a way of joint targets.
    pub(crate) fn duration(&self, from: &[f64], way: &[Vec<f64>]) -> f64 {
        let mut at = from;
        let mut seconds = 0.0;
        for target in way {
            seconds += self.move_time(at, target);
            at = target;
        }
        seconds
    }

    fn move_time(&self, from: &[f64], to: &[f64]) -> f64 {
        (0..from.len())
            .map(|index| (to[index] - from[index]).abs() / top_speed(self.chain, index))
            .fold(0.0, f64::max)
    }

    /// The moves of an order of places, for the points that are walked.
    pub(crate) fn moves(
        &self,
        ways: &Ways<'_>,
        order: &[usize],
        here: Option<&[f64]>,
    ) -> Result<Vec<ProbingMove>, RouteError> {
        let mut moves = Vec::new();
        let point_of = |place: usize| ways.places[place].point as u32;
        for (at, &place) in order.iter().enumerate() {
            let mut push = |kind: u8, axis_positions: Vec<f64>, feed: f64| {
                moves.push(ProbingMove {
                    kind,
                    point_index: point_of(place),
                    axis_positions,
                    feed,
                });
            };
            let mut way = match at.checked_sub(1) {
                Some(before) => ways
                    .between(order[before], place)
                    .ok_or(RouteError::NoWay {
                        from: point_of(order[before]),
                        to: point_of(place),
                    })?,
                None => self.first(here, &ways.ends[place].approach),
            };
            way.pop();
            for target in way {
                push(ProbingMove::CLEARANCE, target, 0.0);
            }
            let (point, stations) = (ways.places[place].point, &ways.places[place].stations);
            let feed = ways.plan.points[point].feed;
            push(ProbingMove::APPROACH, stations.approach.clone(), 0.0);
            push(ProbingMove::TOUCH, stations.touch.clone(), feed);
            push(ProbingMove::RETRACT, stations.retract.clone(), 0.0);
        }
        if let (Some((axis, clear)), Some(&last)) = (self.clearance, order.last()) {
            let retract = &ways.ends[last].retract;
            let mut out = retract.exit().to_vec();
            out[axis] = clear;
            let way = retract.exit.clone().into_iter().chain([out]);
            moves.extend(way.map(|axis_positions| ProbingMove {
                kind: ProbingMove::CLEARANCE,
                point_index: point_of(last),
                axis_positions,
                feed: 0.0,
            }));
        }
        Ok(moves)
    }
}

/// Top speed of an axis by its URDF, m/s or rad/s.
pub fn top_speed(chain: &Chain, index: usize) -> f64 {
    chain.axis(index).speed.unwrap_or(UNKNOWN_SPEED)
}
