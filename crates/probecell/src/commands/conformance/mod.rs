//! `probecell conformance`: plays the gate, `machine_state`, against a driver on the bus, and says line by line what the
//! driver does as docs/driver-guide.md demands and what it does not.
//!
//! ```text
//!   discovery --> samples --> commands --> [cut] --> measuring --> supervision
//!   types, QoS    fields,     STOP,        only on   touches,      STOP in mid-measurement,
//!                 clock       offsets      request   order         silent or replaced gate
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`gate`] | this end of the driver's topics, and all that was received on them |
//! | [`judge`] | the lines that are printed |
//! | [`discovery`], [`samples`], [`commands`], [`measuring`], [`supervision`] | the checks |

mod commands;
mod discovery;
mod gate;
mod judge;
mod measuring;
mod samples;
mod supervision;

use std::{path::PathBuf, time::Duration};

use anyhow::bail;
use cell::Cell;
use host::bus::{Bus, Followed};

use self::{gate::Gate, judge::Judge};
use crate::{
    DEFAULT_CELL, FAILED, GOOD,
    cell_bus::{bus_config, own_socket, users},
    output,
    ros_arguments::read_cell,
    routing::Routing,
};

/// Time in which a session that has joined discovers the other nodes.
const DISCOVERY: Duration = Duration::from_secs(1);

/// What is checked.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Cell file: machine, part, and what is corrected.
    #[arg(long, default_value = DEFAULT_CELL)]
    cell: PathBuf,
    /// Wait this long for the driver, s.
    #[arg(long, default_value_t = 30.0, value_parser = seconds)]
    wait: f64,
    /// Cut this operation before measuring; may be repeated. Without it, a finished part must already be clamped.
    #[arg(long, value_name = "OPERATION")]
    cut: Vec<String>,
    /// Check samples and commands only: no axis moves.
    #[arg(long, conflicts_with = "cut")]
    no_motion: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    let value: f64 = text
        .parse()
        .map_err(|_| "it is not a number of seconds".to_owned())?;
    if value.is_finite() && (0.0..=86400.0).contains(&value) {
        Ok(value)
    } else {
        Err("it must be between 0 and 86400 s".to_owned())
    }
}

/// Checks the driver.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let cell = read_cell(&arguments.cell)?;
    let known: Vec<&str> = (cell.cycle.passes.iter())
        .flat_map(|pass| pass.operations.iter().map(String::as_str))
        .collect();
    for operation in &arguments.cut {
        if !known.contains(&operation.as_str()) {
            bail!(
                "--cut {operation:?} is not an operation of {}; it has {}",
                arguments.cell.display(),
                known.join(", ")
            );
        }
    }
    if users(&cell)?.is_some() {
        bail!(
            "{}: the cell is secured, and this command speaks for two of its processes: probecell secure --off takes that back",
            arguments.cell.display()
        );
    }
    if let Some(socket) = own_socket(&cell)? {
        socket.prepare()?;
    }
    let routing = Routing::start(&cell)?;
    let mut config = bus_config(&cell, "machine_state")?;
    // The driver may be a node of another namespace.
    config.graph = Followed::Domain;
    let bus = Bus::open(&config, "machine_state", &cell.namespace())?;
    refuse_beside_a_cell(&bus, &cell)?;
    let mut judge = Judge::default();
    let mut gate = Gate::join(bus, &cell)?;
    let finished = check(&mut gate, &mut judge, &cell, arguments)?;
    gate.leave()?;
    routing.close()?;
    output::line(&judge.summary(finished));
    Ok(if finished && judge.is_good() {
        GOOD
    } else {
        FAILED
    })
}

/// All checks; false when one failed without which the others cannot be made.
fn check(
    gate: &mut Gate,
    judge: &mut Judge,
    cell: &Cell,
    arguments: &Arguments,
) -> anyhow::Result<bool> {
    let wait = Duration::from_secs_f64(arguments.wait);
    if !discovery::check(gate, judge, wait) || !samples::check(gate, judge, cell)? {
        return Ok(false);
    }
    if !commands::stop(gate, judge) {
        return Ok(false);
    }
    commands::refusals(gate, judge, &arguments.cut);
    commands::offsets(gate, judge, cell);
    if arguments.no_motion {
        judge.skip("measurement", "--no-motion");
        return Ok(true);
    }
    if arguments.cut.is_empty() {
        judge.skip("cut", "no operation was named (--cut OPERATION)");
    }
    for operation in &arguments.cut {
        commands::cut(gate, judge, cell, operation);
    }
    if measuring::whole(gate, judge, cell)? {
        supervision::check(gate, judge, cell)?;
        commands::orders_that_never_come(gate, judge);
    } else {
        judge.skip("supervision", "nothing was measured");
    }
    samples::nothing_lost(gate, judge);
    Ok(true)
}

/// Two gates would command one driver.
fn refuse_beside_a_cell(bus: &Bus, cell: &Cell) -> anyhow::Result<()> {
    let deadline = std::time::Instant::now() + DISCOVERY;
    let own = format!("{}/machine_state", cell.namespace());
    while std::time::Instant::now() < deadline {
        if bus.graph().sessions_of(&own) > 1 {
            bail!(
                "{}: the cell {:?} runs on this bus: end it first, for its gate commands the driver",
                cell.text().name,
                cell.cell.name
            );
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}
