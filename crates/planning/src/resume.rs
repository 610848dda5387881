//! Decides how a scan goes on: what is left after a break, and where a point is measured once more.

use crate::costs::CostMatrix;
use crate::problem::{Problem, ProblemError};

/// What is left of a problem, with its own numbering.
#[derive(Debug, Clone, PartialEq)]
pub struct Remainder {
    /// The places left; the first is where the machine stands, and the path starts there.
    pub problem: Problem,
    /// Place of the whole problem for each place of `problem`.
    pub places: Vec<usize>,
}

impl Remainder {
    /// An order of the remainder in the numbering of the whole problem, without the place where the machine stands.
    /// Indices that do not exist are left out.
    pub fn translate(&self, order: &[usize]) -> Vec<usize> {
        order
            .iter()
            .filter(|&&place| place > 0)
            .filter_map(|&place| self.places.get(place).copied())
            .collect()
    }
}

impl Problem {
    /// What remains to be measured when the first `done` places of `order` are measured: the last of them is kept as
    /// the start, the rest of `order` is the order to beat. With `done` zero the remainder is the whole problem,
    /// whose start is then the first place of `order`.
    ///
    /// # Errors
    /// [`ProblemError`] when `order` is not an order of this problem.
    pub fn resume(&self, order: &[usize], done: usize) -> Result<Remainder, ProblemError> {
        let whole = self.clone().given(order.to_vec());
        let checked = crate::problem::Checked::new(&whole)?;
        let here = done.saturating_sub(1).min(order.len().saturating_sub(1));
        let rest = order.get(here..).unwrap_or_default();
        // Points keep their order of the plan; the places of each stay together, the planned one first.
        let (mut places, mut alternatives) = (Vec::new(), Vec::new());
        for (rank, &place) in rest.iter().enumerate() {
            let others = checked.places_of[checked.point_of[place]]
                .iter()
                .filter(|&&other| other != place);
            let own = std::iter::once(place).chain(others.copied().filter(|_| rank > 0));
            let first = places.len();
            places.extend(own);
            alternatives.push((first..places.len()).collect::<Vec<_>>());
        }
        let number = |point: usize| {
            rest.iter()
                .position(|&place| checked.point_of[place] == point)
        };
        let costs = CostMatrix::from_fn(places.len(), |i, j| self.costs.cost(places[i], places[j]));
        let problem = Problem {
            // Entries of a checked table are valid.
            costs: costs.map_err(|_| ProblemError::NoPlace(0))?,
            start: Some(0).filter(|_| !rest.is_empty()),
            end: self
                .end
                .and_then(|end| places.iter().position(|&place| place == end)),
            given: Some(alternatives.iter().map(|own| own[0]).collect()),
            stages: Some(
                rest.iter()
                    .map(|&place| checked.stage[checked.point_of[place]])
                    .collect(),
            ),
            precedence: self
                .precedence
                .iter()
                .filter_map(|&(before, after)| Some((number(before)?, number(after)?)))
                .collect(),
            alternatives: Some(alternatives),
        };
        Ok(Remainder { problem, places })
    }
}

/// Where a place is visited once more at the least extra cost: an index into `order`, from `from` on (what lies before
/// is measured already), such that inserting there lengthens the path least; the earliest among equals. Inserting at
/// `order.len()` is allowed unless `keep_end`. Nothing when `from` lies beyond the end or the place does not exist.
pub fn cheapest_revisit(
    costs: &CostMatrix,
    order: &[usize],
    from: usize,
    place: usize,
    keep_end: bool,
) -> Option<usize> {
    let exists = |place: &usize| *place < costs.len();
    if !exists(&place) || !order.iter().all(exists) {
        return None;
    }
    let last = if keep_end {
        order.len().checked_sub(1)?
    } else {
        order.len()
    };
    let extra = |at: usize| {
        let before = at.checked_sub(1).map(|before| order[before]);
        let after = order.get(at).copied();
        let cost = |from: Option<usize>, to: Option<usize>| {
            from.zip(to).map_or(0.0, |(a, b)| costs.cost(a, b))
        };
        cost(before, Some(place)) + cost(Some(place), after) - cost(before, after)
    };
    (from..=last)
        .map(|at| (at, extra(at)))
        .reduce(|best, next| if next.1 < best.1 { next } else { best })
        .map(|best| best.0)
}
