//! Turns a plan and its order into the checked moves of a measuring program, in the controller's units.
//!
//! What the writers for FANUC and SINUMERIK share. Targets are positions of the joints in the machine's coordinates, mm and degrees.

use controllers::{
    axes::{Axis, Letter},
    measuring::{ProgramError, check_move, check_order, refuse},
};
use probecell_msgs::{InspectionPlan, MeasurementOrder, ProbingMove};

/// Joint targets of one touch may differ in a rotary axis by no more than this, rad.
const SAME_ANGLE: f64 = 1e-9;

/// What one move of a program is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// On the way to a touch: nothing may be touched.
    Travel,
    /// Until the probe trips.
    Touch,
    /// Back from a touch, with a probe that may still be deflected.
    Retract,
}

/// One move of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// What it is for.
    pub purpose: Purpose,
    /// Number of the touch that it belongs to, from 1.
    pub touch: usize,
    /// Index into the plan's points.
    pub point: u32,
    /// Target of each axis that moves.
    pub target: Vec<(Letter, f64)>,
    /// mm/min; degrees/min where only rotary axes move.
    pub feed: f64,
}

/// The moves of a plan in the order given, for a controller with these axes. Moves that are not touches are made at
/// `travel_feed` (m/s) at most. A touch that turns a rotary axis is refused, and the order must distinguish moves with it.
///
/// # Errors
/// [`ProgramError`]: an order that is not of the plan, or an axis that the controller does not have.
pub fn legs(
    plan: &InspectionPlan,
    order: &MeasurementOrder,
    axes: &[Axis],
    travel_feed: f64,
) -> Result<Vec<Leg>, ProgramError> {
    let columns = check_order(plan, order, axes)?;
    if !(travel_feed.is_finite() && travel_feed > 0.0) {
        return Err(ProgramError::Setting {
            name: "travel_feed",
            value: travel_feed,
        });
    }
    let mut legs = Vec::with_capacity(order.moves.len());
    let mut touches = 0;
    for (index, one) in order.moves.iter().enumerate() {
        check_move(index, one, axes, &columns)?;
        let travel = if one.feed > 0.0 {
            one.feed.min(travel_feed)
        } else {
            travel_feed
        };
        let (purpose, feed) = match one.kind {
            ProbingMove::TOUCH => {
                touches += 1;
                (
                    Purpose::Touch,
                    touch_feed(plan, &order.moves, index, axes, &columns)?,
                )
            }
            ProbingMove::RETRACT => (Purpose::Retract, travel),
            _ => (Purpose::Travel, travel),
        };
        let target = axes.iter().zip(&columns).filter_map(|(axis, column)| {
            let position = one.axis_positions[(*column)?];
            Some((axis.letter, axis.letter.to_controller(position)))
        });
        let coming = usize::from(purpose == Purpose::Travel && touches < order.order.len());
        legs.push(Leg {
            purpose,
            touch: touches + coming,
            point: one.point_index,
            target: target.collect(),
            feed: feed * 60e3,
        });
    }
    Ok(legs)
}

/// m/s, feed of the touch at `index`, which must be a straight move.
fn touch_feed(
    plan: &InspectionPlan,
    moves: &[ProbingMove],
    index: usize,
    axes: &[Axis],
    columns: &[Option<usize>],
) -> Result<f64, ProgramError> {
    let touch = &moves[index];
    let Some(start) = index.checked_sub(1).map(|before| &moves[before]) else {
        return Err(refuse(index, touch, "there is no move to its start"));
    };
    for (axis, column) in axes.iter().zip(columns) {
        let turn = column.map_or(0.0, |column| {
            touch.axis_positions[column] - start.axis_positions[column]
        });
        if axis.letter.is_rotary() && turn.abs() > SAME_ANGLE {
            return Err(refuse(index, touch, "it turns a rotary axis"));
        }
    }
    let planned = plan.points.get(touch.point_index as usize);
    let planned = planned.ok_or_else(|| refuse(index, touch, "the plan has no such point"))?;
    let feed = if touch.feed > 0.0 {
        touch.feed
    } else {
        planned.feed
    };
    if feed.is_finite() && feed > 0.0 {
        Ok(feed)
    } else {
        Err(refuse(index, touch, &format!("its feed is {feed} m/s")))
    }
}

/// A number as programs take it: tenths of a micrometre, and always a point, without which a controller may read
/// micrometres.
pub(crate) fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0');
    if text == "-0." {
        "0.".to_owned()
    } else {
        text.to_owned()
    }
}
