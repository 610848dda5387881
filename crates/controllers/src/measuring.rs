//! Turns a plan and its order into the checked moves of a measuring program, in the controller's units.
//!
//! What the writers for all controllers share: plan and order belong together, every target lies within the limits of its
//! axis, and the moves touch the points that the order names. Targets are positions of the joints in the machine's
//! coordinates, mm and degrees. It plans nothing: which way is clear of part and fixture is the order's business.

use probecell_msgs::{InspectionPlan, MeasurementOrder, ProbingMove};

use crate::axes::{Axis, Letter};

/// Joint targets of one touch may differ in a rotary axis by no more than this, rad.
const SAME_ANGLE: f64 = 1e-9;

/// Why a program cannot be written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProgramError {
    /// Plan and order do not belong together.
    #[error("the order belongs to plan {order:?}, not to plan {plan:?}")]
    OtherPlan {
        /// Plan to measure.
        plan: String,
        /// Plan of the order.
        order: String,
    },
    /// The order moves an axis that the controller does not have.
    #[error("the order moves axis {0:?}, which the controller does not have")]
    UnknownAxis(String),
    /// A move cannot be made.
    #[error("move {index} to point {point}: {reason}")]
    Move {
        /// Index of the move.
        index: usize,
        /// Index of its point.
        point: u32,
        /// What is wrong.
        reason: String,
    },
    /// The moves do not touch the points in the order that the order itself gives.
    #[error("the moves touch points {moves:?}, the order lists {order:?}")]
    OrderOfMoves {
        /// Points of the moves.
        moves: Vec<u32>,
        /// Points of the order.
        order: Vec<u32>,
    },
    /// A path or a word would end a comment of the program.
    #[error("{0:?} cannot stand in a comment of a program")]
    Comment(String),
    /// A job is beyond the limits of the dialect.
    #[error("the program would need {count} {what}; its controller takes at most {limit}")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// As asked for.
        count: usize,
        /// As permitted.
        limit: usize,
    },
    /// The cell's settings of the controller's driver cannot be used.
    #[error("{0}")]
    Driver(String),
    /// The dialect has no programs that decide.
    #[error("there are no decision programs for this controller: the cell itself corrects it")]
    NoDecisionProgram,
    /// A setting is not usable.
    #[error("{name} = {value} is not a positive finite number")]
    Setting {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

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

/// Checks that plan and order belong together; gives, for each axis, its index in the order's moves.
pub(crate) fn check_order(
    plan: &InspectionPlan,
    order: &MeasurementOrder,
    axes: &[Axis],
) -> Result<Vec<Option<usize>>, ProgramError> {
    if order.plan_id != plan.plan_id {
        return Err(ProgramError::OtherPlan {
            plan: plan.plan_id.clone(),
            order: order.plan_id.clone(),
        });
    }
    let unknown = order
        .axis_names
        .iter()
        .find(|name| axes.iter().all(|axis| axis.name != **name));
    if let Some(unknown) = unknown {
        return Err(ProgramError::UnknownAxis(unknown.clone()));
    }
    let touched: Vec<u32> = order
        .moves
        .iter()
        .filter(|one| one.kind == ProbingMove::TOUCH)
        .map(|touch| touch.point_index)
        .collect();
    if touched != order.order {
        return Err(ProgramError::OrderOfMoves {
            moves: touched,
            order: order.order.clone(),
        });
    }
    Ok(axes
        .iter()
        .map(|axis| order.axis_names.iter().position(|name| *name == axis.name))
        .collect())
}

/// Checks the numbers of one move against the axes that it moves.
pub(crate) fn check_move(
    index: usize,
    one: &ProbingMove,
    axes: &[Axis],
    columns: &[Option<usize>],
) -> Result<(), ProgramError> {
    let width = columns.iter().flatten().count();
    if one.axis_positions.len() != width {
        let reason = format!("{} positions for {width} axes", one.axis_positions.len());
        return Err(refuse(index, one, &reason));
    }
    if !(one.feed.is_finite() && one.feed >= 0.0) {
        return Err(refuse(index, one, &format!("its feed is {} m/s", one.feed)));
    }
    for (axis, column) in axes.iter().zip(columns) {
        let Some(column) = column else { continue };
        let position = one.axis_positions[*column];
        let [lower, upper] = axis.limits.unwrap_or([f64::MIN, f64::MAX]);
        if !(position >= lower && position <= upper) {
            let shown = axis.letter.to_controller(position);
            let unit = if axis.letter.is_rotary() {
                "degrees"
            } else {
                "mm"
            };
            let reason = format!("axis {} at {shown} {unit} is outside its limits", axis.name);
            return Err(refuse(index, one, &reason));
        }
    }
    Ok(())
}

pub(crate) fn refuse(index: usize, one: &ProbingMove, reason: &str) -> ProgramError {
    ProgramError::Move {
        index,
        point: one.point_index,
        reason: reason.to_owned(),
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
