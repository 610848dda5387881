//! The moves of a measuring program, for an order that is decided.

use machine::check_travel;
use probecell_msgs::{MeasurementOrder, ProbingMove};

use crate::{
    error::PlanningError,
    rules::MotionRules,
    transit::{Station, Transits},
};

/// Checks every target of an order against the travel of its axis.
pub(crate) fn check(
    rules: &MotionRules<'_>,
    order: &MeasurementOrder,
) -> Result<(), PlanningError> {
    let limits: Vec<(f64, f64)> = (0..rules.chain.axes().len())
        .map(|index| {
            let free = (f64::NEG_INFINITY, f64::INFINITY);
            rules.chain.axis(index).limits.unwrap_or(free)
        })
        .collect();
    let targets = order.moves.iter();
    let targets: Vec<Vec<f64>> = targets.map(|step| step.axis_positions.clone()).collect();
    check_travel(&targets, &limits).map_err(|found| PlanningError::Travel {
        point: order.moves[found.index].point_index,
        axis: rules.chain.axis(found.axis).name.clone(),
        target: found.target,
        least: found.least,
        most: found.most,
    })
}

/// Joint targets to the first touch: from where the axes stand, where that is known, else from somewhere clear.
pub(crate) fn first_transit(
    rules: &MotionRules<'_>,
    here: Option<&[f64]>,
    approach: &Station,
) -> Vec<Vec<f64>> {
    let Some((axis, clear)) = rules.clearance else {
        // An arm may come from anywhere: over the highest place above the first touch at which all is clear.
        let over = approach.highest().filter(|_| rules.attitudes.is_some());
        let over = over.filter(|over| **over != approach.positions).cloned();
        return over
            .into_iter()
            .chain([approach.positions.clone()])
            .collect();
    };
    let out = |at: &[f64]| {
        let mut out = at.to_vec();
        out[axis] = clear;
        out
    };
    let away = here.map(out);
    let path = away.into_iter().chain([out(approach.exit())]);
    path.chain(approach.exit.clone())
        .chain([approach.positions.clone()])
        .collect()
}

/// The moves of an order of candidates; `here` as in [`first_transit`].
///
/// # Errors
/// [`PlanningError::NoTransit`] with indices into the points of `transits`.
pub(crate) fn of_order(
    rules: &MotionRules<'_>,
    transits: &Transits<'_>,
    order: &[usize],
    here: Option<&[f64]>,
) -> Result<Vec<ProbingMove>, PlanningError> {
    let mut moves = Vec::new();
    let point_of = |candidate: usize| transits.candidates[candidate].point as u32;
    for (at, &candidate) in order.iter().enumerate() {
        let mut push = |kind: u8, axis_positions: Vec<f64>, feed: f64| {
            moves.push(ProbingMove {
                kind,
                point_index: point_of(candidate),
                axis_positions,
                feed,
            });
        };
        let mut path = match at.checked_sub(1) {
            Some(before) => {
                transits
                    .between(order[before], candidate)
                    .ok_or(PlanningError::NoTransit {
                        from: point_of(order[before]),
                        to: point_of(candidate),
                    })?
            }
            None => first_transit(rules, here, &transits.ends[candidate].approach),
        };
        path.pop();
        for target in path {
            push(ProbingMove::CLEARANCE, target, 0.0);
        }
        let chosen = &transits.candidates[candidate];
        let feed = transits.plan.points[chosen.point].feed;
        push(ProbingMove::APPROACH, chosen.targets.approach.clone(), 0.0);
        push(ProbingMove::TOUCH, chosen.targets.touch.clone(), feed);
        push(ProbingMove::RETRACT, chosen.targets.retract.clone(), 0.0);
    }
    if let (Some((axis, clear)), Some(&last)) = (rules.clearance, order.last()) {
        let retract = &transits.ends[last].retract;
        let mut out = retract.exit().to_vec();
        out[axis] = clear;
        let path = retract.exit.clone().into_iter().chain([out]);
        moves.extend(path.map(|axis_positions| ProbingMove {
            kind: ProbingMove::CLEARANCE,
            point_index: point_of(last),
            axis_positions,
            feed: 0.0,
        }));
    } else if let Some(&last) = order.last().filter(|_| rules.attitudes.is_some()) {
        // The next order begins over its own first touch: the probe of an arm does not stay in the part.
        let retract = &transits.ends[last].retract;
        let over = retract.highest().filter(|over| **over != retract.positions);
        moves.extend(over.map(|over| ProbingMove {
            kind: ProbingMove::CLEARANCE,
            point_index: point_of(last),
            axis_positions: over.clone(),
            feed: 0.0,
        }));
    }
    Ok(moves)
}
