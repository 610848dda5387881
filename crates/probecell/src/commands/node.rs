//! `probecell node`: one node, or the driver of a real controller, in this process.

use std::{collections::BTreeMap, path::Path, sync::atomic::Ordering};

use anyhow::Context;
use cell::{Cell, Source};
use graph::{Wiring, topics};
use host::{NodeProcess, bus::Bus, run_driver, run_node};

use crate::{GOOD, launcher, signals};

/// Runs the node until it is told to end.
pub(crate) fn run(
    name: &str,
    file: &Path,
    incarnation: u32,
    recorded: bool,
    supervised: bool,
) -> anyhow::Result<u8> {
    if supervised {
        signals::end_with_parent()?;
    }
    let cell = Cell::read(file)?;
    if name == launcher::LINUXCNC {
        return drive_linuxcnc(&cell);
    }
    let instance = cell.instance(name, cell.driver.source == Source::Bag)?;
    let bus = Bus::open(&launcher::bus_config(&cell)?, name, &cell.namespace())?;
    let settings = NodeProcess {
        namespace: cell.namespace(),
        incarnation,
        awaited: awaited(&cell, recorded)?,
    };
    let mut trouble = None;
    run_node(bus, instance, &settings, |stop| {
        trouble = signals::on_end(move || stop.stop()).err();
    })?;
    trouble.map_or(Ok(GOOD), Err)
}

/// How many subscriptions each topic of the cell has once everybody is there.
fn awaited(cell: &Cell, recorded: bool) -> anyhow::Result<BTreeMap<String, usize>> {
    let wiring = Wiring::of(&cell.nodes(false)?)?;
    let names = cell.node_names();
    let mut awaited = if recorded {
        host::recording::heard_by_recorder(&names)
    } else {
        BTreeMap::new()
    };
    for topic in topics::ALL {
        *awaited.entry(topic.name.to_owned()).or_default() += wiring.subscribers(topic.name).len();
    }
    if cell.driver.source == Source::Linuxcnc {
        for topic in [
            topics::CONTROLLER_COMMANDS,
            topics::INSPECTION_PLAN,
            topics::MEASUREMENT_ORDER,
        ] {
            *awaited.entry(topic.name.to_owned()).or_default() += 1;
        }
    }
    Ok(awaited)
}

fn drive_linuxcnc(cell: &Cell) -> anyhow::Result<u8> {
    let section = cell
        .linuxcnc
        .clone()
        .context("the cell file has no section [linuxcnc]")?;
    let config = section.check()?;
    let name = format!("linuxcnc-{}", host::now().0);
    let driver = controllers::linuxcnc::Driver::connect(config, &name)?;
    let bus = Bus::open(
        &launcher::bus_config(cell)?,
        launcher::LINUXCNC,
        &cell.namespace(),
    )?;
    let end = signals::end_flag()?;
    run_driver(bus, driver, &cell.namespace(), &|| {
        end.load(Ordering::SeqCst)
    })?;
    Ok(GOOD)
}
