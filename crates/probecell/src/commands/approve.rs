//! `probecell approve`: approves or rejects a correction that a running cell proposes, with the operator's signature.

use std::path::Path;

use cell::keys::{KeyError, KeyFolder, operator_key};
use probecell_msgs::{Correction, srv};
use signatures::approval;

use crate::{
    cell_client::{CellClient, print_reply},
    operator::described,
    output,
};

/// Signs the correction as the cell proposes it, and calls the service `approve_correction`.
pub(crate) fn run(
    file: &Path,
    correction: &str,
    operator: &str,
    approve: bool,
) -> anyhow::Result<u8> {
    let client = CellClient::connect(file)?;
    let mut answer = Correction {
        approval: if approve {
            Correction::APPROVAL_OPERATOR
        } else {
            Correction::APPROVAL_REJECTED
        },
        approved_by: operator.to_owned(),
        ..client.proposed(correction)?
    };
    answer.shown = described(&answer);
    output::line(&answer.shown);
    sign(&client, operator, &mut answer)?;
    let request = srv::ApproveCorrectionRequest {
        correction_id: correction.to_owned(),
        operator_name: operator.to_owned(),
        approve,
        signed_at: answer.approved_at,
        shown: answer.shown,
        signature: answer.signature,
    };
    let response = client.call::<srv::ApproveCorrection>("approve_correction", &request)?;
    client.close()?;
    Ok(print_reply(response.accepted, &response.text))
}

/// Signs by the clock of the cell. Without a key nothing is signed where the cell file allows that.
fn sign(client: &CellClient, operator: &str, answer: &mut Correction) -> anyhow::Result<()> {
    let cell = client.cell();
    let key = match operator_key(operator) {
        Err(KeyError::NoOperatorKey { .. }) if cell.approvals.unsigned_operators => return Ok(()),
        key => key?,
    };
    let status = client.call::<srv::Status>("status", &srv::StatusRequest::default())?;
    answer.approved_at = status.header.stamp;
    answer.signature = approval::sign(&key, &KeyFolder::of(cell)?.public()?, answer);
    Ok(())
}
