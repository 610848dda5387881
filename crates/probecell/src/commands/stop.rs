//! `probecell stop`: stops the machine of a running cell, and the part that is being made.

use std::path::Path;

use cell::keys::{KeyFolder, operator_key};
use probecell_msgs::{OperatorRequest, srv};
use signatures::{Act, Kind};

use crate::{FAILED, GOOD, cell_client::call_once, output, ros_arguments::read_cell};

/// Calls the service `stop`; succeeds when the machine has confirmed that it stands.
pub(crate) fn run(file: &Path, operator: &str) -> anyhow::Result<u8> {
    let signed = signed(file, operator);
    let request = srv::StopRequest {
        operator_name: operator.to_owned(),
        signed_at: signed.signed_at,
        shown: signed.shown,
        signature: signed.signature,
    };
    let response = call_once::<srv::Stop>(file, "stop", &request)?;
    if response.accepted {
        output::line("the machine stands");
        return Ok(GOOD);
    }
    output::line(&format!(
        "the machine has not confirmed its standstill: {}",
        response.text
    ));
    Ok(FAILED)
}

/// The act with the operator's signature, where there is a key: nobody needs one to stop a machine.
fn signed(file: &Path, operator: &str) -> OperatorRequest {
    let act = OperatorRequest {
        operator_name: operator.to_owned(),
        signed_at: host::now().time(),
        ..OperatorRequest::default()
    };
    let sign = || -> anyhow::Result<Vec<u8>> {
        let cell = KeyFolder::of(&read_cell(file)?)?.public()?;
        Ok(operator_key(operator)?.sign(&Act::of_request(cell, Kind::Stop, &act)))
    };
    match sign() {
        Ok(signature) => OperatorRequest { signature, ..act },
        Err(_without) => OperatorRequest::default(),
    }
}
