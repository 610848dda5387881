//! The times of all transits between candidates, and the problem that they make of the order.

use planning::{CostMatrix, Problem};
use serde::{Deserialize, Serialize};

use crate::{
    error::PlanningError,
    moves::first_transit,
    rules::MotionRules,
    solver::Candidate,
    transit::{NO_TRANSIT, Transits},
};

/// Transits that are computed in one slice of the work: a row of the table more or less. A clearance axis makes most of
/// them simple.
const SLICE: usize = 500;
const SLICE_OVER_CLEARANCE: usize = 50_000;
/// Where the poses of points make more transits, only the likely ones are computed: those between first poses, and from and
/// to each candidate those with the nearest others, by what the axes need at least.
const MOST: usize = 60_000;
const MAX_OVER_CLEARANCE: usize = 4_000_000;
const NEAREST: usize = 40;

/// Seconds of transits, row by row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct TimeTable {
    /// From the first candidates to all; only to those before where transits take the same time both ways.
    rows: Vec<Vec<f64>>,
}

impl TimeTable {
    /// Candidates whose rows are complete.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Seconds from one candidate to another; [`NO_TRANSIT`] where there is none or it was not computed.
    pub(crate) fn time(&self, from: usize, to: usize) -> f64 {
        let row = self.rows.get(from).and_then(|row| row.get(to));
        let back = || self.rows.get(to).and_then(|row| row.get(from));
        row.or_else(back).copied().unwrap_or(0.0)
    }

    /// Computes the next rows; `reversible`: a transit takes the same time both ways.
    pub(crate) fn extend(
        &mut self,
        rules: &MotionRules<'_>,
        transits: &Transits<'_>,
        points: usize,
        reversible: bool,
    ) {
        let count = transits.candidates.len();
        let mut budget = match rules.clearance {
            Some(_) => SLICE_OVER_CLEARANCE,
            None => SLICE,
        };
        let likely = likely(rules, transits, points);
        // A point is visited at one of its candidates, so between them is no transit.
        let point = |candidate: usize| transits.candidates[candidate].point;
        while self.rows.len() < count && budget > 0 {
            let from = self.rows.len();
            let to = if reversible { from } else { count };
            let mut time = |to: usize| {
                if point(from) == point(to) {
                    0.0
                } else if likely(from, to) {
                    budget = budget.saturating_sub(1);
                    transits.time(from, to)
                } else {
                    NO_TRANSIT
                }
            };
            self.rows.push((0..to).map(&mut time).collect());
        }
    }

    /// Of the candidates of a point the first from which and to which there is a transit.
    fn first_connected(&self, candidates: &[usize]) -> usize {
        let connected = |&&candidate: &&usize| {
            let others = || (0..self.rows.len()).filter(|other| !candidates.contains(other));
            others().next().is_none()
                || others().any(|other| self.time(other, candidate) < NO_TRANSIT)
                    && others().any(|other| self.time(candidate, other) < NO_TRANSIT)
        };
        let first = candidates.first();
        let best = if candidates.len() > 1 {
            candidates.iter().find(connected).or(first)
        } else {
            first
        };
        best.copied().unwrap_or(0)
    }

    /// The problem to be searched, for the stage of each point. Where the axes stand (`here`) is a node before all
    /// candidates.
    pub(crate) fn problem(
        &self,
        rules: &MotionRules<'_>,
        transits: &Transits<'_>,
        stages: &[u32],
        here: Option<&[f64]>,
    ) -> Result<Problem, PlanningError> {
        let (candidates, points) = (transits.candidates, stages.len());
        let before = usize::from(here.is_some());
        let time = |from: usize, to: usize| match (from.checked_sub(before), to.checked_sub(before))
        {
            (Some(from), Some(to)) => self.time(from, to),
            (None, Some(to)) => here.map_or(0.0, |here| {
                let path = first_transit(rules, Some(here), &transits.ends[to].approach);
                rules.motion().time_along(here, &path)
            }),
            _ => 0.0,
        };
        let costs = CostMatrix::from_fn(candidates.len() + before, time)
            .map_err(|error| PlanningError::Cost(error.to_string()))?;
        let mut of_point: Vec<Vec<usize>> = vec![Vec::new(); points];
        for (index, candidate) in candidates.iter().enumerate() {
            of_point[candidate.point].push(index);
        }
        let start = (0..before).map(|_| 0);
        let mut given: Vec<usize> = (0..points).collect();
        given.sort_by_key(|&point| stages[point]);
        let given = given
            .iter()
            .map(|&point| before + self.first_connected(&of_point[point]));
        let given = start.clone().chain(given).collect();
        let stages = (0..before).map(|_| 0).chain(stages.iter().copied());
        let mut problem = Problem::new(costs).given(given).stages(stages.collect());
        if candidates.len() > points {
            let moved = of_point
                .iter()
                .map(|of_point| of_point.iter().map(|at| before + at).collect());
            problem = problem.alternatives(start.map(|at| vec![at]).chain(moved).collect());
        }
        if before > 0 {
            problem = problem.starting_at(0);
        }
        Ok(problem)
    }
}

/// Which transits are computed; of few candidates all.
fn likely<'a>(
    rules: &'a MotionRules<'_>,
    transits: &'a Transits<'_>,
    points: usize,
) -> impl Fn(usize, usize) -> bool + use<'a> {
    let candidates: &[Candidate] = transits.candidates;
    let count = candidates.len();
    let most = match rules.clearance {
        Some(_) => MAX_OVER_CLEARANCE,
        None => MOST,
    };
    let few = count * count <= most || count == points;
    let least = move |from: usize, to: usize| {
        let to = &transits.ends[to].approach.positions;
        rules
            .motion()
            .time(&transits.ends[from].retract.positions, to)
    };
    let first = move |candidate: usize| {
        candidate == 0 || candidates[candidate - 1].point != candidates[candidate].point
    };
    // Seconds within which the nearest candidates of other points lie.
    let reach = move |from: usize| {
        let point = candidates[from].point;
        let others = (0..count).filter(|&to| candidates[to].point != point);
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
