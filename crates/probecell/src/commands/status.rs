//! `probecell status`: what a running cell is doing.

use std::{collections::BTreeSet, path::Path};

use cell::TransportName;
use graph::Stamp;
use host::bus::{BusConfig, BusError};
use probecell_msgs::{MachineState, Orders, PartReport, PartStatus, srv};
use serde_json::json;

use super::{dashboard::buses, orders};
use crate::{
    FAILED, GOOD,
    cell_client::CellClient,
    output,
    own_socket::COMMAND_PATIENCE,
    ros_arguments::{self, read_cell},
};

/// Calls the service `status`. Where nobody answers, what a router has kept of the cell is printed as such. Fails when a
/// process does not run, or the machine says nothing or shows an alarm.
pub(crate) fn run(file: &Path, as_json: bool) -> anyhow::Result<u8> {
    let Asked {
        status,
        waiting,
        last,
        orders,
    } = match ask(file, !as_json) {
        Ok(answer) => answer,
        Err(error) => {
            let no_router = matches!(error.downcast_ref(), Some(BusError::NoRouter { .. }));
            if !as_json
                && !no_router
                && let Ok(Some(text)) = kept(file)
            {
                output::line(text.trim_end());
            }
            return Err(error);
        }
    };
    let sound = status.machine_known
        && status.alarms.is_empty()
        && status.running.iter().all(|&running| running);
    if as_json {
        let mut all = report(&status, &waiting);
        all["orders"] = orders::json(&orders)["orders"].take();
        all["held"] = orders.held.into();
        output::json(&all)?;
    } else {
        print(&status, &waiting, last.as_ref(), file);
        orders::print(&orders);
    }
    Ok(if sound { GOOD } else { FAILED })
}

/// What a cell answers.
struct Asked {
    status: srv::StatusResponse,
    /// Corrections of its part that wait for an operator.
    waiting: BTreeSet<String>,
    /// Where no part is being made: the one before.
    last: Option<PartReport>,
    orders: Orders,
}

fn ask(file: &Path, with_last: bool) -> anyhow::Result<Asked> {
    let client = CellClient::connect(file)?;
    let status = client.call::<srv::Status>("status", &srv::StatusRequest::default())?;
    let waiting = match status.part.stage {
        PartStatus::CORRECTING => client.waiting(&status.part.plan_id)?,
        _ => BTreeSet::new(),
    };
    let last = match status.part.stage {
        PartStatus::NONE if with_last => client.last_part()?,
        _ => None,
    };
    let orders = client.orders()?;
    client.close()?;
    Ok(Asked {
        status,
        waiting,
        last,
        orders,
    })
}

/// `qualified`, and why.
fn verdict(part: &PartReport) -> String {
    let word = PartReport::word(part.verdict);
    if part.text.starts_with(word) {
        part.text.clone()
    } else {
        format!("{word}, {}", part.text)
    }
}

/// What some storage has kept of the cell.
fn kept(file: &Path) -> anyhow::Result<Option<String>> {
    let cell = read_cell(file)?;
    if cell.bus.transport == TransportName::Dds {
        return Ok(None);
    }
    for bus in buses(std::slice::from_ref(&cell), Vec::new(), 0)? {
        let bus = BusConfig {
            connect_timeout: COMMAND_PATIENCE,
            ..bus
        };
        let text = ::dashboard::kept_text(&bus, &cell.cell.name, host::now())?;
        if text.is_some() {
            return Ok(text);
        }
    }
    Ok(None)
}

fn machine(status: &srv::StatusResponse) -> &'static str {
    match status.execution {
        _ if !status.machine_known => "unknown",
        MachineState::EXECUTION_IDLE => "idle",
        MachineState::EXECUTION_RUNNING => "running",
        MachineState::EXECUTION_HOLD => "hold",
        MachineState::EXECUTION_ALARM => "alarm",
        _ => "emergency stop",
    }
}

/// s since the stage began.
fn since(status: &srv::StatusResponse) -> f64 {
    Stamp::from(&status.header.stamp).since_s(Stamp::from(&status.part.since))
}

fn report(status: &srv::StatusResponse, waiting: &BTreeSet<String>) -> serde_json::Value {
    let part = &status.part;
    let made = (part.stage != PartStatus::NONE).then(|| {
        json!({
            "part_id": part.part_id, "run_id": part.run_id, "stage": PartStatus::word(part.stage), "pass_number": part.pass_number,
            "operation": part.operation, "plan_id": part.plan_id, "since_s": since(status), "waiting_for_approval": waiting,
        })
    });
    let processes = status.processes.iter().zip(&status.running);
    let processes = processes.zip(&status.starts).map(
        |((name, running), starts)| json!({ "name": name, "running": running, "starts": starts }),
    );
    json!({
        "schema": "probecell/status/1",
        "machine": machine(status),
        "alarms": status.alarms,
        "part": made,
        "recording": { "state": status.recording.word(), "uri": status.recording.uri },
        "processes": processes.collect::<Vec<_>>(),
        "faults": status.faults,
    })
}

fn print(
    status: &srv::StatusResponse,
    waiting: &BTreeSet<String>,
    last: Option<&PartReport>,
    file: &Path,
) {
    output::line(&format!("machine: {}", machine(status)));
    for alarm in &status.alarms {
        output::line(&format!("  alarm: {alarm}"));
    }
    let part = &status.part;
    if part.stage == PartStatus::NONE {
        output::line(&last.map_or_else(
            || "part: none yet".to_owned(),
            |part| format!("part: none; the last, {}: {}", part.part_id, verdict(part)),
        ));
    } else {
        let what = [&part.operation, &part.plan_id]
            .map(String::as_str)
            .concat();
        let stage = if waiting.is_empty() {
            PartStatus::word(part.stage)
        } else {
            "waiting for an operator's approval of corrections after"
        };
        output::line(&format!(
            "part: {} (run {}), {stage} {what} for {:.0} s",
            part.part_id,
            part.run_id,
            since(status)
        ));
        let (file, more) = (file.display(), ros_arguments::for_commands());
        for correction in waiting {
            output::line(&format!(
                "  waits for approval: probecell approve {correction} --operator NAME --cell {file}{more}"
            ));
        }
    }
    let uri = &status.recording.uri;
    output::line(format!("recording: {} {uri}", status.recording.word()).trim_end());
    let processes = status.processes.iter().zip(&status.running);
    for ((name, running), starts) in processes.zip(&status.starts) {
        if !running || *starts > 1 {
            let state = match (*running, *starts) {
                (true, _) => format!("runs, started {starts} times"),
                (false, 0) => "is not there yet".to_owned(),
                (false, _) => format!("has ended, started {starts} times"),
            };
            output::line(&format!("process {name}: {state}"));
        }
    }
    for fault in &status.faults {
        output::line(&format!("fault: {fault}"));
    }
}
