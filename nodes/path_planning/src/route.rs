//! The moves of a measuring program and the shortest order of its touches.
//!
//! Each touch has four stations of the ball along the normal: the start of the approach, the nominal contact, the end of
//! the probing move if nothing is touched, and the end of the retract. Between the retract of one touch and the approach
//! of the next the axes move at top speed; where the straight way could lead through the part ([`crate::clear`]), the
//! clearance axis goes out first and comes in last. Without a clearance axis the probe withdraws along its stem, as far as
//! it must, crosses, and comes back. The cost of a move is the time of its slowest axis at the URDF's top speed (source
//! systems C.2, for a turn-mill). The order is for the touches; positions are joint targets in m and rad.

use machine::{Chain, DeviationError, Nominal, Target};
use nalgebra::{Point3, UnitQuaternion};
use planning::{CostMatrix, Options, Problem, Solution, check_limits, solve};
use probecell_msgs::{InspectionPlan, MeasurementOrder, ProbingMove};

use crate::ways::{End, NO_WAY, Ways};

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

/// Axis positions of the stations of one touch.
pub(crate) struct Stations {
    pub(crate) approach: Vec<f64>,
    pub(crate) touch: Vec<f64>,
    pub(crate) retract: Vec<f64>,
    /// Of approach and retract.
    pub(crate) ball: [Point3<f64>; 2],
    /// Nominal contact on the surface.
    pub(crate) contact: Point3<f64>,
    /// Axes that stand still while the ball goes to and from the touch, and the attitude of the probe there.
    pub(crate) prescribed: Vec<Option<f64>>,
    pub(crate) attitude: Option<UnitQuaternion<f64>>,
}

impl Route<'_> {
    /// The shortest order found and its moves. `seeds` has one entry for each point, or is empty (the axes then start
    /// in the middle of their travel).
    pub fn order(
        &self,
        plan: &InspectionPlan,
        seeds: &[Seed],
    ) -> Result<MeasurementOrder, RouteError> {
        let all: Vec<u32> = (0..plan.points.len() as u32).collect();
        self.order_of(plan, &all, &[], seeds)
    }

    /// The shortest order found of some points of a plan and its moves. `points` are indices into the plan's points in
    /// the order that is to be beaten. `stages` has one entry for each point of the plan, or is empty: points of a lower
    /// stage are touched before all of a higher one. `seeds` has one entry for each of `points`, or is empty. Every
    /// target is within the travel of its axis.
    pub fn order_of(
        &self,
        plan: &InspectionPlan,
        points: &[u32],
        stages: &[u32],
        seeds: &[Seed],
    ) -> Result<MeasurementOrder, RouteError> {
        self.some(plan, points, stages, seeds, None)
    }

    /// The same from where the axes stand (m, rad, in the order of the chain's axes), as after a scan that broke off:
    /// what clears the part first is the clearance axis, from there, and the way to the first touch counts.
    pub fn order_from(
        &self,
        plan: &InspectionPlan,
        points: &[u32],
        stages: &[u32],
        here: &[f64],
    ) -> Result<MeasurementOrder, RouteError> {
        self.some(plan, points, stages, &[], Some(here))
    }

    fn some(
        &self,
        plan: &InspectionPlan,
        points: &[u32],
        stages: &[u32],
        seeds: &[Seed],
        here: Option<&[f64]>,
    ) -> Result<MeasurementOrder, RouteError> {
        let mut part = InspectionPlan {
            points: Vec::new(),
            ..plan.clone()
        };
        for (place, &index) in points.iter().enumerate() {
            let point = plan.points.get(index as usize);
            let new = !points[..place].contains(&index);
            let point = point.filter(|_| new).ok_or(RouteError::NoPoint(index))?;
            part.points.push(point.clone());
        }
        let stage = |place: usize| stages.get(points[place] as usize).copied().unwrap_or(0);
        let stages: Vec<u32> = (0..points.len()).map(stage).collect();
        let mut order =
            self.shortest(&part, &stages, seeds, here)
                .map_err(|error| match error {
                    RouteError::NoWay { from, to } => RouteError::NoWay {
                        from: points[from as usize],
                        to: points[to as usize],
                    },
                    other => other,
                })?;
        for index in &mut order.order {
            *index = points[*index as usize];
        }
        for one in &mut order.moves {
            one.point_index = points[one.point_index as usize];
        }
        self.check_travel(&order)?;
        Ok(order)
    }

    /// Targets within the travels keep every move within, for the joints go straight.
    fn check_travel(&self, order: &MeasurementOrder) -> Result<(), RouteError> {
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
    pub fn contacts(&self, plan: &InspectionPlan) -> Result<Vec<Vec<f64>>, RouteError> {
        let stations = self.stations(plan, &Nominal::from_plan(plan)?, &[])?;
        Ok(stations.into_iter().map(|one| one.touch).collect())
    }

    fn shortest(
        &self,
        plan: &InspectionPlan,
        stages: &[u32],
        seeds: &[Seed],
        here: Option<&[f64]>,
    ) -> Result<MeasurementOrder, RouteError> {
        let nominal = Nominal::from_plan(plan)?;
        let stations = self.stations(plan, &nominal, seeds)?;
        let ways = Ways::new(self, plan, &nominal, &stations);
        let solution = self.solve(&ways, stages, here)?;
        let length = |order: &[usize]| -> f64 {
            order
                .windows(2)
                .map(|pair| (stations[pair[0]].ball[1] - stations[pair[1]].ball[0]).norm())
                .sum()
        };
        Ok(MeasurementOrder {
            plan_id: plan.plan_id.clone(),
            order: solution.order.iter().map(|&index| index as u32).collect(),
            air_time: solution.cost,
            given_air_time: solution.given_cost,
            air_length: length(&solution.order),
            given_air_length: length(&solution.given),
            optimal: solution.optimal,
            axis_names: self.chain.axis_names().map(str::to_owned).collect(),
            moves: self.moves(&ways, &stations, &solution.order, here)?,
            ..MeasurementOrder::default()
        })
    }

    /// The order of the touches. Where the axes stand is a place before all of them, which the answer leaves out.
    fn solve(
        &self,
        ways: &Ways<'_>,
        stages: &[u32],
        here: Option<&[f64]>,
    ) -> Result<Solution, RouteError> {
        let before = usize::from(here.is_some());
        let times = ways.times();
        let time = |from: usize, to: usize| match (from.checked_sub(before), to.checked_sub(before))
        {
            (Some(from), Some(to)) if from != to => times[from][to],
            (None, Some(to)) => here.map_or(0.0, |here| {
                self.duration(here, &self.first(Some(here), &ways.approach[to]))
            }),
            _ => 0.0,
        };
        let refused = |error: &dyn std::fmt::Display| RouteError::Cost(error.to_string());
        let count = times.len() + before;
        let table = CostMatrix::from_fn(count, time).map_err(|error| refused(&error))?;
        let stages: Vec<u32> = [0]
            .repeat(before)
            .into_iter()
            .chain(stages.iter().copied())
            .collect();
        let mut given: Vec<usize> = (0..count).collect();
        given[before..].sort_by_key(|&index| stages[index]);
        let mut problem = Problem::new(table).given(given).stages(stages);
        if here.is_some() {
            problem = problem.starting_at(0);
        }
        let options = Options {
            kicks: self.kicks,
            ..Options::default()
        };
        let mut solution =
            solve(&problem, &options, &mut |_| true).map_err(|error| refused(&error))?;
        // A way that was not found in the order given is not counted against it.
        let given = solution.given.windows(2);
        let missing = given.filter(|pair| time(pair[0], pair[1]) >= NO_WAY);
        solution.given_cost -= NO_WAY * missing.count() as f64;
        for order in [&mut solution.order, &mut solution.given] {
            *order = order
                .iter()
                .filter_map(|place| place.checked_sub(before))
                .collect();
        }
        Ok(solution)
    }

    fn stations(
        &self,
        plan: &InspectionPlan,
        part: &Nominal,
        seeds: &[Seed],
    ) -> Result<Vec<Stations>, RouteError> {
        let chain = self.chain;
        let mut rotary = Vec::new();
        for name in &plan.rotary_names {
            rotary.push(
                chain
                    .axis_index(name)
                    .ok_or_else(|| RouteError::Rotary(name.clone()))?,
            );
        }
        let radius = part.ball_radius;
        let middle: Vec<f64> = (0..chain.axes().len())
            .map(|index| {
                chain
                    .axis(index)
                    .limits
                    .map_or(0.0, |(lower, upper)| f64::midpoint(lower, upper))
            })
            .collect();
        let mut last = middle;
        let mut all = Vec::with_capacity(plan.points.len());
        for (index, nominal) in plan.points.iter().enumerate() {
            if nominal.feature as usize >= plan.features.len() {
                return Err(RouteError::Feature(index));
            }
            if nominal.rotary_positions.len() != rotary.len() {
                let given = nominal.rotary_positions.len();
                return Err(RouteError::Rotaries {
                    point: index,
                    given,
                    axes: rotary.len(),
                });
            }
            let mut prescribed = vec![None; chain.axes().len()];
            for (&axis, &angle) in rotary.iter().zip(&nominal.rotary_positions) {
                prescribed[axis] = Some(angle);
            }
            let seed = seeds.get(index);
            let mut start = seed.map_or_else(|| last.clone(), |seed| seed.positions.clone());
            let attitude = seed.and_then(|seed| seed.attitude);
            let mut station = |height: f64| {
                let (position, normal) = part.points[index];
                let target = Target {
                    ball: position + normal.into_inner() * height,
                    orientation: attitude,
                };
                let reached =
                    self.chain
                        .reach(&target, &prescribed, &start, &part.part_pose, &part.ball);
                let reached = reached.map_err(|source| RouteError::Reach {
                    point: index,
                    source,
                })?;
                start.clone_from(&reached);
                Ok::<_, RouteError>((target.ball, reached))
            };
            let (approach_ball, approach) = station(radius + nominal.approach_distance)?;
            let (_, touch) = station(radius - self.overtravel)?;
            let (retract_ball, retract) = station(radius + nominal.retract_distance)?;
            last.clone_from(&approach);
            all.push(Stations {
                approach,
                touch,
                retract,
                ball: [approach_ball, retract_ball],
                contact: part.points[index].0,
                prescribed,
                attitude,
            });
        }
        Ok(all)
    }

    /// Joint targets to the first touch: from where the axes stand, where that is known, else from somewhere clear.
    fn first(&self, here: Option<&[f64]>, approach: &End) -> Vec<Vec<f64>> {
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

    fn moves(
        &self,
        ways: &Ways<'_>,
        stations: &[Stations],
        order: &[usize],
        here: Option<&[f64]>,
    ) -> Result<Vec<ProbingMove>, RouteError> {
        let mut moves = Vec::new();
        for (place, &index) in order.iter().enumerate() {
            let mut push = |kind: u8, axis_positions: Vec<f64>, feed: f64| {
                moves.push(ProbingMove {
                    kind,
                    point_index: index as u32,
                    axis_positions,
                    feed,
                });
            };
            let mut way = match place.checked_sub(1) {
                Some(before) => ways
                    .between(order[before], index)
                    .ok_or(RouteError::NoWay {
                        from: order[before] as u32,
                        to: index as u32,
                    })?,
                None => self.first(here, &ways.approach[index]),
            };
            way.pop();
            for target in way {
                push(ProbingMove::CLEARANCE, target, 0.0);
            }
            push(ProbingMove::APPROACH, stations[index].approach.clone(), 0.0);
            push(
                ProbingMove::TOUCH,
                stations[index].touch.clone(),
                ways.plan.points[index].feed,
            );
            push(ProbingMove::RETRACT, stations[index].retract.clone(), 0.0);
        }
        if let (Some((axis, clear)), Some(&last)) = (self.clearance, order.last()) {
            let mut out = ways.retract[last].exit().to_vec();
            out[axis] = clear;
            let way = ways.retract[last].exit.clone().into_iter().chain([out]);
            moves.extend(way.map(|axis_positions| ProbingMove {
                kind: ProbingMove::CLEARANCE,
                point_index: last as u32,
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
