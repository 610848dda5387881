//! `probecell approve`: approves or rejects a correction that a running cell proposes.

use std::path::Path;

use probecell_msgs::srv;

use crate::cell_client::{call_once, print_reply};

/// Calls the service `approve_correction`.
pub(crate) fn run(
    file: &Path,
    correction: &str,
    operator: &str,
    approve: bool,
) -> anyhow::Result<u8> {
    let request = srv::ApproveCorrectionRequest {
        correction_id: correction.to_owned(),
        operator_name: operator.to_owned(),
        approve,
    };
    let response = call_once::<srv::ApproveCorrection>(file, "approve_correction", &request)?;
    Ok(print_reply(response.accepted, &response.text))
}
