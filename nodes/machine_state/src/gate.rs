//! Decides whether a correction may reach the machine.

use graph::Stamp;
use probecell_msgs::{Correction, CorrectionAcknowledgement as Ack, MachineState};

use crate::{
    config::Config,
    state::{Controller, State},
    table,
};

/// Two readings of one offset that differ by less are the same value: a controller keeps 1e-7 m or coarser.
const SAME_OFFSET: f64 = 0.5e-7;

/// Why a correction may not pass: outcome of the acknowledgement and one sentence.
pub(crate) struct Refusal {
    pub(crate) outcome: u8,
    pub(crate) text: String,
}

pub(crate) fn refuse<T>(outcome: u8, text: impl Into<String>) -> Result<T, Refusal> {
    Err(Refusal {
        outcome,
        text: text.into(),
    })
}

/// Checks an approved correction against everything on record.
pub(crate) fn check(
    config: &Config,
    state: &State,
    now: Stamp,
    correction: &Correction,
) -> Result<(), Refusal> {
    if config.replayed || correction.replayed {
        return refuse(Ack::REFUSED_REPLAY, "it was made from a recording");
    }
    if correction.approved_by.is_empty()
        || ![Correction::APPROVAL_POLICY, Correction::APPROVAL_OPERATOR]
            .contains(&correction.approval)
    {
        return refuse(
            Ack::REFUSED_NOT_APPROVED,
            "nobody is on record as having approved it",
        );
    }
    let controller = ready(state)?;
    if correction.session != controller.status.session {
        return refuse(
            Ack::REFUSED_STALE,
            "it rests on a measurement of another run of the driver",
        );
    }
    if now > Stamp::from(&correction.expires) {
        return refuse(Ack::REFUSED_STALE, "it has expired");
    }
    check_source(state, correction)?;
    let held = match correction.kind {
        Correction::TOOL_WEAR => wear_of(controller, correction.tool_number).map_or_else(
            || {
                let text = format!("the controller has no tool {}", correction.tool_number);
                refuse(Ack::FAILED, text)
            },
            Ok,
        )?,
        Correction::TOOL_PATH => {
            check_path(config, correction)?;
            path_of(state, correction)
        }
        Correction::WORK_OFFSET => work_offset_of(controller, &correction.axis).map_or_else(
            || {
                let text = format!(
                    "the controller tells no work offset of axis {:?}",
                    correction.axis
                );
                refuse(Ack::FAILED, text)
            },
            Ok,
        )?,
        Correction::VOLUMETRIC => {
            table::check(config, controller, correction)?;
            // What a table does is told by its entries; the controller knows no displacements.
            correction.previous_value
        }
        kind => {
            let text = format!("offsets of kind {kind} are not written by this cell");
            return refuse(Ack::FAILED, text);
        }
    };
    if !((held - correction.previous_value).abs() <= SAME_OFFSET) {
        let text = format!(
            "it starts from {:.1} µm, but the controller holds {:.1} µm",
            correction.previous_value * 1e6,
            held * 1e6
        );
        return refuse(Ack::REFUSED_STALE, text);
    }
    check_bounds(config, correction)
}

/// Largest offset of the path of the correction's feature that was written in this session, m.
fn path_of(state: &State, correction: &Correction) -> f64 {
    let feature = correction.feature_ids.first();
    feature
        .and_then(|feature| state.paths.get(feature))
        .copied()
        .unwrap_or(0.0)
}

/// Every offset of a path lies within its bounds, and the greatest is the one declared.
fn check_path(config: &Config, correction: &Correction) -> Result<(), Refusal> {
    let limit = config.path_limit.min(correction.upper_bound);
    let beyond = correction
        .path
        .iter()
        .position(|offset| !(offset.abs() <= limit));
    if let Some(index) = beyond {
        let text = format!(
            "offset {index} of the path, {:.1} µm, is beyond {:.1} µm",
            correction.path[index] * 1e6,
            limit * 1e6
        );
        return refuse(Ack::REFUSED_OUT_OF_BOUNDS, text);
    }
    let largest = correction
        .path
        .iter()
        .fold(0.0, |most: f64, offset| most.max(offset.abs()));
    if correction.path.is_empty() || largest != correction.new_value {
        return refuse(
            Ack::REFUSED_OUT_OF_BOUNDS,
            "its path is empty or its largest offset is not the one declared",
        );
    }
    Ok(())
}

fn ready(state: &State) -> Result<&Controller, Refusal> {
    match &state.controller {
        None => refuse(Ack::FAILED, "no controller has been heard"),
        Some(controller) if controller.lost => refuse(Ack::FAILED, "the controller is silent"),
        Some(controller) if controller.status.execution == MachineState::EXECUTION_ESTOP => {
            refuse(Ack::FAILED, "the machine is in emergency stop")
        }
        Some(controller) => Ok(controller),
    }
}

fn check_source(state: &State, correction: &Correction) -> Result<(), Refusal> {
    if correction.feature_ids.is_empty() || correction.sequences.is_empty() {
        return refuse(
            Ack::REFUSED_NO_SOURCE,
            "it names no feature or no touch that it rests on",
        );
    }
    if !(correction.measured_error.is_finite() && correction.standard_uncertainty.is_finite()) {
        return refuse(
            Ack::REFUSED_NO_SOURCE,
            "its measured error is not a finite number",
        );
    }
    let Some(asked) = state.measured.get(&correction.plan_id) else {
        let text = format!(
            "plan {:?} was not measured on this machine in this session",
            correction.plan_id
        );
        return refuse(Ack::REFUSED_NO_SOURCE, text);
    };
    if state.ended.is_some_and(|ended| *asked <= ended) {
        return refuse(
            Ack::REFUSED_STALE,
            "the part that it was made for has ended",
        );
    }
    Ok(())
}

fn check_bounds(config: &Config, correction: &Correction) -> Result<(), Refusal> {
    // A bound that is not a number is none: `max` and `min` would drop it.
    if correction.lower_bound.is_nan() || correction.upper_bound.is_nan() {
        return refuse(Ack::REFUSED_OUT_OF_BOUNDS, "its bounds are not numbers");
    }
    let limit = match correction.kind {
        Correction::TOOL_PATH => config.path_limit,
        Correction::WORK_OFFSET => config.work_offset_limit,
        // Its entries have bounds of their own, and were checked against them.
        Correction::VOLUMETRIC => f64::INFINITY,
        _ => config.wear_limit,
    };
    let lower = correction.lower_bound.max(-limit);
    let upper = correction.upper_bound.min(limit);
    // Written so that a value that is not a number is out of bounds.
    if correction.new_value >= lower && correction.new_value <= upper {
        return Ok(());
    }
    let text = format!(
        "{:.1} µm lies outside {:.1} to {:.1} µm",
        correction.new_value * 1e6,
        lower * 1e6,
        upper * 1e6
    );
    refuse(Ack::REFUSED_OUT_OF_BOUNDS, text)
}

/// Work offset of an axis as the controller last told it, m.
fn work_offset_of(controller: &Controller, axis: &str) -> Option<f64> {
    let mut axes = controller.status.work_offset_axes.iter();
    let position = axes.position(|known| known == axis)?;
    controller.status.work_offsets.get(position).copied()
}

/// Wear offset of a tool as the controller last told it.
fn wear_of(controller: &Controller, tool: u32) -> Option<f64> {
    let position = controller
        .status
        .tool_numbers
        .iter()
        .position(|&number| number == tool)?;
    controller.status.tool_wear.get(position).copied()
}
