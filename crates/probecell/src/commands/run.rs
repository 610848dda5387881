//! `probecell run`: orders parts of a running cell.

use std::{
    collections::BTreeMap,
    path::Path,
    time::{Duration, Instant},
};

use graph::topics;
use probecell_msgs::{Order, OrderRequest, Orders, PartReport, srv};

use super::orders::{SERVICE, print_held};
use crate::{
    FAILED, GOOD,
    cell_client::{CellClient, Followed},
    output,
};

/// While a part is made, the cell is asked so often whether it is still there.
const PERIOD: Duration = Duration::from_secs(10);

/// Places an order. `wait`: prints how its parts end until one is not qualified.
pub(crate) fn run(file: &Path, part: &str, count: u32, wait: bool) -> anyhow::Result<u8> {
    let client = CellClient::connect(file)?;
    // Followed before the order is placed: none of its parts is missed.
    let followed = if wait {
        let reports = client.follow::<PartReport>(topics::PART_REPORTS)?;
        Some((client.follow::<Orders>(topics::ORDERS)?, reports))
    } else {
        None
    };
    let request = srv::ManageOrdersRequest {
        kind: OrderRequest::ADD,
        part_id: part.to_owned(),
        count,
        ..srv::ManageOrdersRequest::default()
    };
    let placed = client.call::<srv::ManageOrders>(SERVICE, &request)?;
    if !placed.accepted {
        output::line(&placed.text);
        client.close()?;
        return Ok(FAILED);
    }
    let id = placed.order_id;
    let parts = if count == 1 { "part" } else { "parts" };
    output::line(&format!("order {id}: {part}, {count} {parts}"));
    if !placed.orders.held.is_empty() {
        print_held(&placed.orders);
    }
    let good = match followed {
        Some((orders, reports)) => wait_for(&client, id, count, &orders, &reports)?,
        None => true,
    };
    client.close()?;
    Ok(if good { GOOD } else { FAILED })
}

/// Prints how the parts of an order end. False as soon as one is not qualified, or the order is cancelled.
fn wait_for(
    client: &CellClient,
    id: u64,
    count: u32,
    orders: &Followed<Orders>,
    reports: &Followed<PartReport>,
) -> anyhow::Result<bool> {
    // Runs of the order that are known, and whether each was reported.
    let mut runs: BTreeMap<String, bool> = BTreeMap::new();
    let (mut known, mut reported) = (client.orders()?, 0);
    loop {
        let order = known.orders.iter().find(|one| one.order_id == id);
        if let Some(order) = order.filter(|one| !one.run_id.is_empty()) {
            runs.entry(order.run_id.clone()).or_default();
        }
        let current = order.filter(|one| one.state == Order::UNDERWAY);
        let is_awaited = |(run, is_reported): (&String, &bool)| {
            !is_reported && current.is_none_or(|one| one.run_id != *run)
        };
        let deadline = Instant::now() + PERIOD;
        if runs.iter().any(is_awaited) {
            match reports.next(deadline)? {
                Some(report) if !report.is_revocation() => {
                    let Some(is_reported) = runs.get_mut(&report.run_id) else {
                        continue;
                    };
                    *is_reported = true;
                    reported += 1;
                    print(&report, reported, count);
                    if report.verdict != PartReport::QUALIFIED {
                        print_held(&client.orders()?);
                        return Ok(false);
                    }
                }
                Some(_) => {}
                None if order.is_some_and(|one| one.state == Order::INTERRUPTED) => {
                    print_held(&known);
                    return Ok(false);
                }
                // A cell that is gone reports nothing any more.
                None => known = client.orders()?,
            }
        } else if order.is_none() {
            if reported < count {
                output::line(&format!("order {id} was cancelled"));
            }
            return Ok(reported == count);
        } else {
            known = match orders.next(deadline)? {
                Some(orders) => orders,
                None => client.orders()?,
            };
        }
    }
}

fn print(report: &PartReport, number: u32, count: u32) {
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
        "part {}{of}: {word} after {passes}: {}",
        report.part_id, report.text
    ));
}
