//! `probecell stop`: stops the machine of a running cell, and the part that is being made.

use std::path::Path;

use probecell_msgs::srv;

use crate::{FAILED, GOOD, cell_client::call_once, output};

/// Calls the service `stop`; succeeds when the machine has confirmed that it stands.
pub(crate) fn run(file: &Path, operator: &str) -> anyhow::Result<u8> {
    let request = srv::StopRequest {
        operator_name: operator.to_owned(),
        ..srv::StopRequest::default()
    };
    let response = call_once::<srv::Stop>(file, "stop", &request)?;
    if response.accepted {
        output::line("the machine stands");
        return Ok(GOOD);
    }
    output::line(&format!(
        "the machine has not confirmed that it stands: {}",
        response.text
    ));
    Ok(FAILED)
}
