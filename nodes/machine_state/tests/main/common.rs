//! A gate of the cell `mill`, what its machine reports, and a correction that it takes.

use graph::Stamp;
use machine_state::{Config, RawConfig};
use probecell_msgs::{ControllerStatus, Correction};
use signatures::{SecretKey, Trust, approval};

/// Settings as they are without any, where the cell's own approvals count.
pub(crate) fn config() -> Config {
    let checked = RawConfig::default().check("<robot/>".to_owned(), "mill", false);
    checked.expect("defaults").with_trust(Trust {
        cell: Some(key().public()),
        automatic: true,
        unsigned_operators: false,
    })
}

/// Of the cell.
pub(crate) fn key() -> SecretKey {
    SecretKey::from_seed([7; 32])
}

/// Of session `run 1`.
pub(crate) fn sample() -> ControllerStatus {
    ControllerStatus {
        session: "run 1".to_owned(),
        axis_names: vec!["X".to_owned()],
        axis_positions: vec![0.25],
        tool_numbers: vec![2],
        tool_wear: vec![0.0],
        ..ControllerStatus::default()
    }
}

/// Of tool wear, from a measurement of plan `p/1`; not yet approved.
pub(crate) fn correction() -> Correction {
    Correction {
        correction_id: "c".to_owned(),
        session: "run 1".to_owned(),
        kind: Correction::TOOL_WEAR,
        tool_number: 2,
        new_value: -20e-6,
        lower_bound: -50e-6,
        upper_bound: 50e-6,
        plan_id: "p/1".to_owned(),
        feature_ids: vec!["D1".to_owned()],
        sequences: vec![0],
        measured_error: 20e-6,
        standard_uncertainty: 1e-6,
        approval: Correction::APPROVAL_POLICY,
        approved_by: "policy".to_owned(),
        expires: Stamp(0).after_s(100.0).time(),
        ..Correction::default()
    }
}

/// The correction, approved at that instant with the key of the cell.
pub(crate) fn approved(mut correction: Correction, now: Stamp) -> Correction {
    correction.approved_at = now.time();
    correction.signature = approval::sign(&key(), &key().public(), &correction);
    correction
}
