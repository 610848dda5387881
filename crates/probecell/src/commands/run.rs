//! `probecell run`: requests a part of a running cell.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use graph::{Stamp, topics};
use probecell_msgs::{PartReport, srv};

use crate::{
    FAILED, GOOD,
    cell_client::{CellClient, Followed, print_reply},
    output,
};

/// s after which a request that no process took in the meantime starts nothing any more; shorter than the client waits.
const VALIDITY: f64 = 8.0;

/// While a part is made, the cell is asked so often whether it is still there.
const PERIOD: Duration = Duration::from_secs(10);

/// Calls the service `run`. The request expires, by the cell's own clock, before this command gives up.
pub(crate) fn run(file: &Path, part: &str) -> anyhow::Result<u8> {
    let client = CellClient::connect(file)?;
    let response = request(&client, part)?;
    client.close()?;
    Ok(print_reply(response.accepted, &response.text))
}

/// Makes parts one after the other and prints how each ended, until one is not qualified.
pub(crate) fn run_and_wait(file: &Path, part: &str, count: u32) -> anyhow::Result<u8> {
    let client = CellClient::connect(file)?;
    let reports = client.follow::<PartReport>(topics::PART_REPORTS)?;
    let mut good = true;
    for number in 1..=count {
        let asked = now(&client)?;
        let response = request(&client, part)?;
        if !response.accepted {
            output::line(&response.text);
            good = false;
            break;
        }
        let report = report_since(&client, &reports, part, asked)?;
        let of = if count > 1 {
            format!(" ({number} of {count})")
        } else {
            String::new()
        };
        let word = PartReport::word(report.verdict);
        let passes = match report.passes {
            1 => "1 machining pass".to_owned(),
            passes => format!("{passes} machining passes"),
        };
        output::line(&format!(
            "part {part}{of}: {word} after {passes}: {}",
            report.text
        ));
        good = report.verdict == PartReport::QUALIFIED;
        if !good {
            break;
        }
    }
    client.close()?;
    Ok(if good { GOOD } else { FAILED })
}

/// How the part that was asked for after an instant ended.
fn report_since(
    client: &CellClient,
    reports: &Followed<PartReport>,
    part: &str,
    asked: Stamp,
) -> anyhow::Result<PartReport> {
    loop {
        match reports.next(Instant::now() + PERIOD)? {
            Some(report)
                if report.part_id == part
                    && Stamp::from(&report.header.stamp) >= asked
                    && !report.is_revocation() =>
            {
                return Ok(report);
            }
            Some(_) => {}
            // A cell that is gone reports nothing any more.
            None => {
                now(client)?;
            }
        }
    }
}

/// By the clock of the cell.
fn now(client: &CellClient) -> anyhow::Result<Stamp> {
    let status = client.call::<srv::Status>("status", &srv::StatusRequest::default())?;
    Ok(Stamp::from(&status.header.stamp))
}

/// Requests a part of the cell that a client is connected to.
pub(crate) fn request(client: &CellClient, part: &str) -> anyhow::Result<srv::RunResponse> {
    let request = srv::RunRequest {
        part_id: part.to_owned(),
        plan_id: String::new(),
        expires: now(client)?.after_s(VALIDITY).time(),
        ..srv::RunRequest::default()
    };
    client.call::<srv::Run>("run", &request)
}
