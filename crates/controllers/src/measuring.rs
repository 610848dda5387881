//! Checks of a plan and its order before a measuring program is written of them.
//!
//! What the writers for all controllers share: plan and order belong together, every target lies within the limits of its
//! axis, and the moves touch the points that the order names. Which way is clear of part and fixture is the order's business.

use probecell_msgs::{InspectionPlan, MeasurementOrder, ProbingMove};

use crate::axes::Axis;

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
    /// A setting is not usable.
    #[error("{name} = {value} is not a positive finite number")]
    Setting {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

/// Checks that plan and order belong together; gives, for each axis, its index in the order's moves.
///
/// # Errors
/// [`ProgramError`]: an order that is not of the plan, or an axis that the controller does not have.
pub fn check_order(
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

/// Checks the numbers of the move at `index` against the axes that it moves (`columns` as [`check_order`] gives them).
///
/// # Errors
/// [`ProgramError::Move`].
pub fn check_move(
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

/// Why the move at `index` cannot be made.
pub fn refuse(index: usize, one: &ProbingMove, reason: &str) -> ProgramError {
    ProgramError::Move {
        index,
        point: one.point_index,
        reason: reason.to_owned(),
    }
}
