//! An order that is being made: a value between two stretches of work, whatever their number, so that a node can hear other
//! things in between and say how far it is.
//!
//! First the places of all points are found ([`crate::stations`]), then where ways to and from each end, then the time of
//! each way ([`crate::ways`]), then the order and the poses are searched together. How the work is sliced changes nothing
//! of the answer. Seconds, metres, radians.

use machine::Nominal;
use planning::{CostMatrix, Options, Problem, Search, Solution};
use probecell_msgs::{InspectionPlan, MeasurementOrder, PlanProgress};
use serde::{Deserialize, Serialize};

use crate::{
    route::{Route, RouteError, Seed},
    stations::{self, Place, Poses},
    ways::{Ends, NO_WAY, Ways},
};

/// Places whose ends are found in one stretch.
const ENDS: usize = 50;
/// Ways that are looked at in one stretch: a row of the table more or less. A clearance axis makes most of them simple.
const WAYS: usize = 500;
const WAYS_OVER_CLEARANCE: usize = 50_000;
/// Where the poses of points make more ways, only the likely ones are looked at: those between first poses, and from and
/// to each place those with the nearest others, by what the axes need at least.
const MOST_WAYS: usize = 60_000;
const MOST_WAYS_OVER_CLEARANCE: usize = 4_000_000;
const NEAREST: usize = 40;
/// Kicks of the search in one stretch.
const KICKS: u64 = 1_000;

/// What is to be ordered.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// The plan.
    pub plan: &'a InspectionPlan,
    /// Indices into its points, in the order that is to be beaten.
    pub points: &'a [u32],
    /// One entry for each point of the plan, or empty: points of a lower stage are touched before all of a higher one.
    pub stages: &'a [u32],
    /// One entry for each point of the plan, or empty: positions (rad) of the plan's rotary axes at each of which it may be
    /// touched, the one to beat first. Empty (all, or a point's): the plan's own.
    pub poses: &'a [Poses],
    /// One entry for each of `points`, or empty: the axes then start in the middle of their travel.
    pub seeds: &'a [Seed],
    /// Where the axes stand (m, rad, in the order of the chain's axes), as after a scan that broke off: what clears the
    /// part first is the clearance axis, from there, and the way to the first touch counts. `None`: somewhere clear.
    pub here: Option<&'a [f64]>,
}

/// A plan with the poses chosen, and its order.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    /// The plan given; the points that are touched have the rotary positions chosen.
    pub plan: InspectionPlan,
    /// The order.
    pub order: MeasurementOrder,
}

/// An order that is being made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Task {
    plan: InspectionPlan,
    points: Vec<u32>,
    /// Of each of the points.
    stages: Vec<u32>,
    here: Option<Vec<f64>>,
    places: Vec<Place>,
    /// Of the first places.
    ends: Vec<Ends>,
    /// Seconds from the first places to the others; only to those before where ways back are ways out.
    times: Vec<Vec<f64>>,
    search: Option<Search>,
}

impl Task {
    /// Begins: finds the places of all points.
    ///
    /// # Errors
    /// [`RouteError`] for a point that is named twice or unknown, and for one that no pose reaches.
    pub fn new(route: &Route<'_>, wanted: &Wanted<'_>) -> Result<Self, RouteError> {
        let (plan, points) = (wanted.plan, wanted.points);
        let mut poses = Vec::new();
        for (place, &index) in points.iter().enumerate() {
            let new = !points[..place].contains(&index);
            if !new || plan.points.get(index as usize).is_none() {
                return Err(RouteError::NoPoint(index));
            }
            poses.push(
                wanted
                    .poses
                    .get(index as usize)
                    .cloned()
                    .unwrap_or_default(),
            );
        }
        let stage = |index: &u32| wanted.stages.get(*index as usize).copied().unwrap_or(0);
        let mut task = Self {
            plan: plan.clone(),
            points: points.to_vec(),
            stages: points.iter().map(stage).collect(),
            here: wanted.here.map(<[f64]>::to_vec),
            places: Vec::new(),
            ends: Vec::new(),
            times: Vec::new(),
            search: None,
        };
        let part = task.part();
        let nominal = Nominal::from_plan(&part)?;
        let places = stations::places(route, &part, &nominal, &poses, wanted.seeds);
        task.places = places.map_err(|error| error.of_points(points))?;
        Ok(task)
    }

    /// The plan that is ordered, as it was given.
    pub fn plan(&self) -> &InspectionPlan {
        &self.plan
    }

    /// One stretch more; the answer, when that is the last one.
    ///
    /// # Errors
    /// [`RouteError`] for touches between which no way was found, and for a move outside the travel of an axis.
    pub fn go_on(&mut self, route: &Route<'_>) -> Result<Option<Planned>, RouteError> {
        let part = self.part();
        let nominal = Nominal::from_plan(&part)?;
        let mut ends = std::mem::take(&mut self.ends);
        if ends.len() < self.places.len() {
            let ways = Ways::new(route, &part, &nominal, &self.places, &[]);
            let next = ends.len()..self.places.len().min(ends.len() + ENDS);
            ends.extend(next.map(|place| ways.ends_of(place)));
            self.ends = ends;
            return Ok(None);
        }
        self.ends = ends;
        let ways = Ways::new(route, &part, &nominal, &self.places, &self.ends);
        if self.times.len() < self.places.len() {
            let rows = self.rows(route, &ways);
            self.times.extend(rows);
            return Ok(None);
        }
        let refused = |error: &dyn std::fmt::Display| RouteError::Cost(error.to_string());
        let done = if let Some(search) = &mut self.search {
            search.go_on(KICKS).map_err(|error| refused(&error))?
        } else {
            let options = Options {
                kicks: route.kicks,
                ..Options::default()
            };
            let search = Search::new(self.problem(route, &ways)?, &options);
            let search = search.map_err(|error| refused(&error))?;
            let done = search.is_done();
            self.search = Some(search);
            done
        };
        match &self.search {
            Some(search) if done => self.answer(route, &ways, search.solution()).map(Some),
            _ => Ok(None),
        }
    }

    /// How far it has come: everything but header, plan and end.
    pub fn progress(&self) -> PlanProgress {
        let mut progress = PlanProgress {
            plan_id: self.plan.plan_id.clone(),
            touches: self.points.len() as u32,
            phase: PlanProgress::WAYS,
            ..PlanProgress::default()
        };
        if let Some(search) = &self.search {
            let solution = search.solution();
            progress.phase = PlanProgress::SEARCHING;
            progress.share = search.share();
            progress.air_time = self.seconds(&solution.order);
            progress.given_air_time = self.seconds(&solution.given);
        } else {
            let places = self.places.len().max(1) as f64;
            let found = self.times.len() as f64 / places;
            // Of ways back that are ways out, the first rows have the fewest.
            let of_ways = if self.both_ways() {
                found * found
            } else {
                found
            };
            progress.share = 0.5 * (self.ends.len() as f64 / places + of_ways);
        }
        progress
    }

    /// The plan with no other points than those that are touched.
    fn part(&self) -> InspectionPlan {
        let points = self.points.iter();
        InspectionPlan {
            points: points
                .filter_map(|&index| self.plan.points.get(index as usize).cloned())
                .collect(),
            ..self.plan.clone()
        }
    }

    /// Where approach and retract are the same place, the way back is the same way.
    fn both_ways(&self) -> bool {
        let same = |place: &Place| {
            let index = self.points[place.point] as usize;
            let one = self.plan.points.get(index);
            one.is_none_or(|one| one.approach_distance == one.retract_distance)
        };
        self.places.iter().all(same)
    }

    /// The next rows of the table of times. A point is visited at one of its places, so between them is no way.
    fn rows(&self, route: &Route<'_>, ways: &Ways<'_>) -> Vec<Vec<f64>> {
        let (count, both_ways) = (self.places.len(), self.both_ways());
        let mut left = match route.clearance {
            Some(_) => WAYS_OVER_CLEARANCE,
            None => WAYS,
        };
        let likely = self.likely(route, ways);
        let mut rows = Vec::new();
        while self.times.len() + rows.len() < count && left > 0 {
            let from = self.times.len() + rows.len();
            let to = if both_ways { from } else { count };
            let mut time = |to: usize| {
                if self.places[from].point == self.places[to].point {
                    0.0
                } else if likely(from, to) {
                    left = left.saturating_sub(1);
                    ways.time(from, to)
                } else {
                    NO_WAY
                }
            };
            rows.push((0..to).map(&mut time).collect());
        }
        rows
    }

    /// Which ways are looked at; of few places all.
    fn likely<'a>(
        &'a self,
        route: &'a Route<'_>,
        ways: &'a Ways<'_>,
    ) -> impl Fn(usize, usize) -> bool + use<'a> {
        let count = self.places.len();
        let most = match route.clearance {
            Some(_) => MOST_WAYS_OVER_CLEARANCE,
            None => MOST_WAYS,
        };
        let few = count * count <= most || count == self.points.len();
        let least = move |from: usize, to: usize| {
            let to = std::slice::from_ref(&ways.ends[to].approach.positions);
            route.duration(&ways.ends[from].retract.positions, to)
        };
        let first =
            |place: usize| place == 0 || self.places[place - 1].point != self.places[place].point;
        // Seconds within which the nearest places of other points lie.
        let reach = move |from: usize| {
            let point = self.places[from].point;
            let others = (0..count).filter(|&to| self.places[to].point != point);
            let mut others: Vec<f64> = others.map(|to| least(from, to)).collect();
            let at = NEAREST.min(others.len()).saturating_sub(1);
            let found = at < others.len();
            found.then(|| *others.select_nth_unstable_by(at, f64::total_cmp).1)
        };
        let reaches: Vec<f64> = if few {
            Vec::new()
        } else {
            (0..count).map(|from| reach(from).unwrap_or(0.0)).collect()
        };
        move |from, to| {
            few || first(from) && first(to)
                || least(from, to) <= reaches[from].max(reaches[to])
                || least(to, from) <= reaches[from].max(reaches[to])
        }
    }

    /// Seconds from one place to another, by the table.
    fn time(&self, from: usize, to: usize) -> f64 {
        let row = self.times.get(from).and_then(|row| row.get(to));
        let back = || self.times.get(to).and_then(|row| row.get(from));
        row.or_else(back).copied().unwrap_or(0.0)
    }

    /// Places that go before all others: where the axes stand, where that is known.
    fn before(&self) -> usize {
        usize::from(self.here.is_some())
    }

    /// What is searched. Where the axes stand is a place before all of them.
    fn problem(&self, route: &Route<'_>, ways: &Ways<'_>) -> Result<Problem, RouteError> {
        let before = self.before();
        let time = |from: usize, to: usize| match (from.checked_sub(before), to.checked_sub(before))
        {
            (Some(from), Some(to)) => self.time(from, to),
            (None, Some(to)) => self.here.as_deref().map_or(0.0, |here| {
                let way = route.first(Some(here), &ways.ends[to].approach);
                route.duration(here, &way)
            }),
            _ => 0.0,
        };
        let table = CostMatrix::from_fn(self.places.len() + before, time)
            .map_err(|error| RouteError::Cost(error.to_string()))?;
        let mut places_of: Vec<Vec<usize>> = vec![Vec::new(); self.points.len()];
        for (at, place) in self.places.iter().enumerate() {
            places_of[place.point].push(at);
        }
        let start = (0..before).map(|_| 0);
        let mut given: Vec<usize> = (0..self.points.len()).collect();
        given.sort_by_key(|&point| self.stages[point]);
        let given = given
            .iter()
            .map(|&point| before + self.to_beat(&places_of[point]));
        let given = start.clone().chain(given).collect();
        let stages = (0..before).map(|_| 0).chain(self.stages.iter().copied());
        let mut problem = Problem::new(table).given(given).stages(stages.collect());
        if self.places.len() > self.points.len() {
            let moved = places_of
                .iter()
                .map(|own| own.iter().map(|at| before + at).collect());
            problem = problem.alternatives(start.map(|at| vec![at]).chain(moved).collect());
        }
        if before > 0 {
            problem = problem.starting_at(0);
        }
        Ok(problem)
    }

    /// Of the places of a point the first from which and to which there is a way.
    fn to_beat(&self, places: &[usize]) -> usize {
        let reached = |&&place: &&usize| {
            let others = || (0..self.places.len()).filter(|other| !places.contains(other));
            others().next().is_none()
                || others().any(|other| self.time(other, place) < NO_WAY)
                    && others().any(|other| self.time(place, other) < NO_WAY)
        };
        let first = places.first();
        let best = if places.len() > 1 {
            places.iter().find(reached).or(first)
        } else {
            first
        };
        best.copied().unwrap_or(0)
    }

    /// Seconds of an order of places, from where the axes stand; a way that was not found is not counted.
    fn seconds(&self, order: &[usize]) -> f64 {
        let Some(search) = &self.search else {
            return 0.0;
        };
        // As the search told it, but for the ways that were not found.
        let solution = search.solution();
        let told = if order == solution.order {
            solution.cost
        } else {
            solution.given_cost
        };
        let before = self.before();
        let missing = order.windows(2).filter(|pair| {
            pair[0] >= before && self.time(pair[0] - before, pair[1] - before) >= NO_WAY
        });
        told - NO_WAY * missing.count() as f64
    }

    /// Seconds of ways of an order that were not looked at before: the search took them as none.
    fn not_looked_at(&self, ways: &Ways<'_>, order: &[usize]) -> f64 {
        let pairs = order.windows(2);
        let missing = pairs.filter(|pair| self.time(pair[0], pair[1]) >= NO_WAY);
        missing.map(|pair| ways.time(pair[0], pair[1])).sum()
    }

    fn answer(
        &self,
        route: &Route<'_>,
        ways: &Ways<'_>,
        solution: &Solution,
    ) -> Result<Planned, RouteError> {
        let walked = |order: &[usize]| -> Vec<usize> {
            let places = order.iter();
            places
                .filter_map(|place| place.checked_sub(self.before()))
                .collect()
        };
        let (order, given) = (walked(&solution.order), walked(&solution.given));
        let length = |order: &[usize]| -> f64 {
            let ball = |place: usize| self.places[place].stations.ball;
            let moves = order.windows(2);
            moves
                .map(|pair| (ball(pair[0])[1] - ball(pair[1])[0]).norm())
                .sum()
        };
        let moves = route.moves(ways, &order, self.here.as_deref());
        let mut moves = moves.map_err(|error| error.of_points(&self.points))?;
        for one in &mut moves {
            one.point_index = self.points[one.point_index as usize];
        }
        let mut plan = self.plan.clone();
        for &place in &order {
            let Place { point, pose, .. } = &self.places[place];
            let point = self.points[*point] as usize;
            if let Some(point) = plan.points.get_mut(point) {
                point.rotary_positions.clone_from(pose);
            }
        }
        let points = order.iter().map(|&place| self.places[place].point);
        let order = MeasurementOrder {
            plan_id: plan.plan_id.clone(),
            order: points.map(|point| self.points[point]).collect(),
            air_time: self.seconds(&solution.order) + self.not_looked_at(ways, &order),
            given_air_time: self.seconds(&solution.given),
            air_length: length(&order),
            given_air_length: length(&given),
            optimal: solution.optimal,
            axis_names: route.chain.axis_names().map(str::to_owned).collect(),
            moves,
            ..MeasurementOrder::default()
        };
        route.check_travel(&order)?;
        Ok(Planned { plan, order })
    }
}
