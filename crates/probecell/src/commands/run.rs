//! `probecell run`: requests a part of a running cell.

use std::path::Path;

use graph::Stamp;
use probecell_msgs::srv;

use crate::cell_client::{CellClient, print_reply};

/// s after which a request that no process took in the meantime starts nothing any more; shorter than the client waits.
const VALIDITY: f64 = 8.0;

/// Calls the service `run`. The request expires, by the cell's own clock, before this command gives up.
pub(crate) fn run(file: &Path, part: &str) -> anyhow::Result<u8> {
    let client = CellClient::connect(file)?;
    let response = request(&client, part)?;
    client.close()?;
    Ok(print_reply(response.accepted, &response.text))
}

/// Requests a part of the cell that a client is connected to.
pub(crate) fn request(client: &CellClient, part: &str) -> anyhow::Result<srv::RunResponse> {
    let status = client.call::<srv::Status>("status", &srv::StatusRequest::default())?;
    let request = srv::RunRequest {
        part_id: part.to_owned(),
        plan_id: String::new(),
        expires: Stamp::from(&status.header.stamp).after_s(VALIDITY).time(),
        ..srv::RunRequest::default()
    };
    client.call::<srv::Run>("run", &request)
}
