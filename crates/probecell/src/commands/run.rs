//! `probecell run`: requests a part of a running cell.

use std::path::Path;

use probecell_msgs::srv;

use crate::cell_client::{call_once, print_reply};

/// Calls the service `run`.
pub(crate) fn run(file: &Path, part: &str) -> anyhow::Result<u8> {
    let request = srv::RunRequest {
        part_id: part.to_owned(),
        plan_id: String::new(),
    };
    let response = call_once::<srv::Run>(file, "run", &request)?;
    Ok(print_reply(response.accepted, &response.text))
}
