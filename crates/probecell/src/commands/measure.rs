//! `probecell measure`: resumes a running cell's interrupted measurement, or repeats points of it.

use std::path::Path;

use anyhow::{Context, bail};
use probecell_msgs::srv;

use crate::{
    FAILED,
    cell_client::{CellClient, print_reply},
    output,
};

/// With what the cell begins the refusal of a measurement that is not there any more, or void.
const NOTHING_RESUMED: &str = "nothing can be resumed";

/// Continues the plan that the cell published last; `again` are indices of points that are measured once more.
pub(crate) fn run(file: &Path, again: &[u32]) -> anyhow::Result<u8> {
    let client = CellClient::connect(file)?;
    let plan = client.last_plan()?;
    let mut points = Vec::new();
    for &index in again {
        let point = plan.points.get(index as usize);
        points.push(point.cloned().with_context(|| {
            let (id, count) = (&plan.plan_id, plan.points.len());
            format!("point {index} is not in plan {id:?}, which has {count} points from 0")
        })?);
    }
    let plan_id = plan.plan_id;
    let planned = client.plan(&srv::PlanRequest {
        plan_id: plan_id.clone(),
        points,
    })?;
    let touches = format!("{plan_id}: {}", planned.text);
    if !planned.accepted {
        output::line(&touches);
        client.close()?;
        return Ok(FAILED);
    }
    let request = srv::RunRequest {
        part_id: String::new(),
        plan_id,
        ..srv::RunRequest::default()
    };
    let started = client.call::<srv::Run>("run", &request)?;
    client.close()?;
    if !started.accepted && started.text.starts_with(NOTHING_RESUMED) {
        bail!("{}", started.text);
    }
    // Touches that are not made would only mislead.
    if started.accepted {
        output::line(&touches);
    }
    Ok(print_reply(started.accepted, &started.text))
}
