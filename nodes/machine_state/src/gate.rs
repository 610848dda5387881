//! Decides whether a correction may reach the machine.

use crate::quantity::Length;
use graph::Stamp;
use probecell_msgs::{
    Correction, CorrectionAcknowledgement as Ack, CorrectionKind, MachineState, offset,
};

use crate::{
    config::Config,
    drivers, part,
    refusal::{Refusal, refusal, refuse},
    state::{Controller, State},
    table,
};

/// Checks a correction against everything on record, in the order in which it could do harm; gives its kind.
pub(crate) fn check(
    config: &Config,
    state: &State,
    now: Stamp,
    correction: &Correction,
) -> Result<CorrectionKind, Refusal> {
    if config.replayed || correction.replayed {
        return refuse(Ack::REFUSED_REPLAY, "it was made from a recording");
    }
    check_approval(config, state, correction)?;
    let controller = ready(state)?;
    if correction.session != controller.status.session {
        return refuse(
            Ack::REFUSED_STALE,
            "its source was measured in another session of the driver",
        );
    }
    if now > Stamp::from(&correction.expires) {
        return refuse(Ack::REFUSED_STALE, "it has expired");
    }
    check_source(state, correction)?;
    part::check(config, state, now, correction)?;
    let kind = CorrectionKind::try_from(correction.kind);
    let kind = kind.or_else(|unknown| refuse(Ack::FAILED, unknown.to_string()))?;
    let held = match kind {
        CorrectionKind::ToolWear => {
            wear_of(controller, correction.tool_number).ok_or_else(|| {
                let tool = correction.tool_number;
                refusal(Ack::FAILED, format!("the controller has no tool {tool}"))
            })?
        }
        CorrectionKind::ToolPath => {
            check_path(config, correction)?;
            path_of(state, correction)
        }
        CorrectionKind::WorkOffset => {
            work_offset_of(controller, &correction.axis).ok_or_else(|| {
                let axis = &correction.axis;
                let text = format!("the controller reports no work offset of axis {axis:?}");
                refusal(Ack::FAILED, text)
            })?
        }
        CorrectionKind::Volumetric => {
            table::check(config, controller, correction)?;
            // The controller holds entries, which were compared above; it knows no displacement of the tip.
            correction.previous_value
        }
    };
    if !offset::is_same(held, correction.previous_value) {
        let from = Length::from_m(correction.previous_value);
        let held = Length::from_m(held);
        let text = format!("it was computed from {from}, but the controller holds {held}");
        return refuse(Ack::REFUSED_STALE, text);
    }
    check_bounds(config, kind, correction)?;
    Ok(kind)
}

/// The approval is signed by who may approve, for exactly this correction, and since this gate began. The word of the
/// correction itself counts for nothing.
pub(crate) fn check_approval(
    config: &Config,
    state: &State,
    correction: &Correction,
) -> Result<(), Refusal> {
    let approved = config.trust.check(state.keys.as_ref(), correction);
    approved.map_err(|why| refusal(Ack::REFUSED_NOT_APPROVED, why.to_string()))?;
    if Stamp::from(&correction.approved_at).0 < state.started as i64 {
        let text = "it was approved before this gate began: what was written then is not known";
        return refuse(Ack::REFUSED_STALE, text);
    }
    Ok(())
}

/// Largest offset of the path of the correction's feature that was written in this session, m.
fn path_of(state: &State, correction: &Correction) -> f64 {
    let feature = correction.feature_ids.first();
    feature
        .and_then(|feature| state.paths.get(feature))
        .copied()
        .unwrap_or(0.0)
}

/// Every offset of a path lies within its bounds, and the largest is the one declared.
fn check_path(config: &Config, correction: &Correction) -> Result<(), Refusal> {
    let limit = (config.path_limit).min(Length::from_m(correction.upper_bound));
    let offsets = correction.path.iter().map(|&offset| Length::from_m(offset));
    if let Some((index, offset)) = offsets.clone().enumerate().find(|(_, o)| !o.within(limit)) {
        let text = format!("offset {index} of the path, {offset}, is beyond {limit}");
        return refuse(Ack::REFUSED_OUT_OF_BOUNDS, text);
    }
    let largest = offsets.map(Length::abs).reduce(Length::max);
    if largest != Some(Length::from_m(correction.new_value)) {
        return refuse(
            Ack::REFUSED_OUT_OF_BOUNDS,
            "its path is empty or its largest offset is not the one declared",
        );
    }
    Ok(())
}

fn ready(state: &State) -> Result<&Controller, Refusal> {
    match &state.controller {
        None => refuse(Ack::FAILED, "no sample of the controller has been received"),
        Some(controller) if controller.lost => {
            refuse(Ack::FAILED, "the controller sends no samples")
        }
        Some(controller) if controller.status.execution == MachineState::EXECUTION_ESTOP => {
            refuse(Ack::FAILED, "the machine is in emergency stop")
        }
        Some(_) if drivers::are_several(state) => refuse(Ack::FAILED, drivers::SEVERAL),
        Some(controller) => Ok(controller),
    }
}

fn check_source(state: &State, correction: &Correction) -> Result<(), Refusal> {
    if correction.feature_ids.is_empty() || correction.sequences.is_empty() {
        return refuse(
            Ack::REFUSED_NO_SOURCE,
            "it names no source feature or no source touch",
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

fn check_bounds(
    config: &Config,
    kind: CorrectionKind,
    correction: &Correction,
) -> Result<(), Refusal> {
    // A bound that is not a number is none: `max` and `min` would drop it.
    if correction.lower_bound.is_nan() || correction.upper_bound.is_nan() {
        return refuse(Ack::REFUSED_OUT_OF_BOUNDS, "its bounds are not numbers");
    }
    let limit = match kind {
        CorrectionKind::ToolPath => config.path_limit,
        CorrectionKind::WorkOffset => config.work_offset_limit,
        // Its entries have bounds of their own, and were checked against them.
        CorrectionKind::Volumetric => Length::from_m(f64::INFINITY),
        CorrectionKind::ToolWear => config.wear_limit,
    };
    let value = Length::from_m(correction.new_value);
    let lower = Length::from_m(correction.lower_bound).max(-limit);
    let upper = Length::from_m(correction.upper_bound).min(limit);
    // Written so that a value that is not a number is out of bounds.
    if value >= lower && value <= upper {
        return Ok(());
    }
    let (lower, upper) = (lower.um(), upper.um());
    let text = format!("{value} lies outside {lower:.1} to {upper:.1} µm");
    refuse(Ack::REFUSED_OUT_OF_BOUNDS, text)
}

/// Work offset of an axis as the controller last reported it, m.
fn work_offset_of(controller: &Controller, axis: &str) -> Option<f64> {
    let mut axes = controller.status.work_offset_axes.iter();
    let position = axes.position(|known| known == axis)?;
    controller.status.work_offsets.get(position).copied()
}

/// Wear offset of a tool as the controller last reported it, m.
fn wear_of(controller: &Controller, tool: u32) -> Option<f64> {
    let position = controller
        .status
        .tool_numbers
        .iter()
        .position(|&number| number == tool)?;
    controller.status.tool_wear.get(position).copied()
}
