//! `probecell node`: runs one node, the driver of a controller, or what publishes signals beside the machine, in this process.

use std::{collections::BTreeMap, path::Path, sync::atomic::Ordering};

use anyhow::Context;
use cell::{Cell, keys::KeyFolder};
use controllers::driver::{ConnectError, Connection, Role};
use graph::{Wiring, topics};
use host::{NodeProcess, bus::Bus, run_driver, run_node, run_signals, signals::Reader};

use super::external;
use crate::{GOOD, cell_bus, confined, ros_arguments::read_cell, routing::refuse_unheard, signals};

/// Runs the node until SIGINT or SIGTERM. `supervised`: `up` has started it, and has looked at the bus.
pub(crate) fn run(
    name: &str,
    file: &Path,
    incarnation: u32,
    recorded: bool,
    supervised: bool,
) -> anyhow::Result<u8> {
    let cell = read_cell(file)?;
    if name == cell.driver.source {
        match cell.driver_role() {
            Role::Process(controller) => {
                return drive(&cell, supervised, |session, _| controller.connect(session));
            }
            Role::Robot(robot) => {
                let chain = cell.chain()?;
                return drive(&cell, supervised, |session, bus| {
                    robot.join(session, chain, bus)
                });
            }
            Role::Node(_) | Role::External | Role::Playback => {}
        }
    }
    if cell.signals_process() == Some(name) {
        return publish_signals(&cell, name, recorded, supervised);
    }
    let folder = KeyFolder::of(&cell)?;
    // The private key goes to the one node that signs, and to no other.
    let cell = if name == "compensation" {
        cell.with_private_key(folder.private()?)
    } else {
        cell.with_key(folder.public()?)
    };
    let bus = cell_bus::bus_config(&cell, name)?;
    confined::node(&bus)?;
    let instance = cell.instance(name, cell.is_playback())?;
    if !supervised {
        refuse_unheard(&cell)?;
    }
    let bus = Bus::open(&bus, name, &cell.namespace())?;
    cell_bus::show(&bus, &cell, name)?;
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

/// Number of subscriptions of each topic once all processes of the cell have started.
fn awaited(cell: &Cell, recorded: bool) -> anyhow::Result<BTreeMap<String, usize>> {
    let wiring = Wiring::of(&cell.nodes(false)?)?;
    let (names, topics) = (cell.node_names(), cell.topics()?);
    let mut awaited = if recorded {
        let recorded = host::recording::topic_names(&topics, &names).into_iter();
        recorded.map(|name| (name, 1)).collect()
    } else {
        BTreeMap::new()
    };
    for topic in &topics {
        *awaited.entry(topic.name.to_owned()).or_default() += wiring.subscribers(topic.name).len();
    }
    if cell.driver_process().is_some() {
        for topic in host::SUBSCRIBED {
            *awaited.entry(topic.name.to_owned()).or_default() += 1;
        }
    }
    Ok(awaited)
}

/// Publishes what a program reads of controllers beside the machine, until it is asked to end. That program has the network; this
/// process has the bus.
fn publish_signals(
    cell: &Cell,
    name: &str,
    recorded: bool,
    supervised: bool,
) -> anyhow::Result<u8> {
    let program = external::signals_reader(cell)?.context("the cell has no signals")?;
    let bus = cell_bus::bus_config(cell, name)?;
    // Afterwards this process starts no program.
    let reader = Reader::start(&program)?;
    confined::node(&bus)?;
    if !supervised {
        refuse_unheard(cell)?;
    }
    let bus = Bus::open(&bus, name, &cell.namespace())?;
    cell_bus::show(&bus, cell, name)?;
    let end = signals::end_flag()?;
    let subscribers = awaited(cell, recorded)?.remove(topics::SIGNALS.name);
    let ended = run_signals(
        bus,
        reader,
        &cell.polls(),
        &cell.namespace(),
        subscribers.unwrap_or_default(),
        &|| end.load(Ordering::SeqCst),
    )?;
    ended.map_or(Ok(GOOD), |ended| Err(ended.into()))
}

/// Runs the driver of a real controller until it is asked to end.
fn drive(
    cell: &Cell,
    supervised: bool,
    connect: impl FnOnce(&str, &Bus) -> Result<Box<dyn Connection>, ConnectError>,
) -> anyhow::Result<u8> {
    let name = &cell.driver.source;
    let session = format!("{name}-{}", host::now().0);
    let bus = cell_bus::bus_config(cell, name)?;
    confined::driver(cell, &bus)?;
    if !supervised {
        refuse_unheard(cell)?;
    }
    let bus = Bus::open(&bus, name, &cell.namespace())?;
    cell_bus::show(&bus, cell, name)?;
    let connection = connect(&session, &bus).map_err(anyhow::Error::from_boxed)?;
    let end = signals::end_flag()?;
    run_driver(bus, connection, &cell.namespace(), &|| {
        end.load(Ordering::SeqCst)
    })?;
    Ok(GOOD)
}
