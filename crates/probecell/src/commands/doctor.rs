//! `probecell doctor`: checks the installation and the cell file.

use std::{
    net::{TcpListener, ToSocketAddrs},
    path::Path,
    time::{Duration, Instant},
};

use cell::{Cell, TransportName};
use controllers::driver::tcp_answers;
use graph::{Wiring, topics};
use host::{
    bus::{Bus, BusConfig},
    signals::Reader,
};
use plc::{Outcome, Poll, Reading};
use serde::Serialize;

use super::external;
use crate::{
    BAD_INPUT, FAILED, GOOD, cell_bus, output,
    retention::{self, Forecast},
    ros_arguments::read_cell,
};

/// Timeout of discovery between two participants on one machine.
const DISCOVERY_TIMEOUT: Duration = Duration::from_secs(10);
/// Timeout of closing the bus.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// One thing looked at.
#[derive(Serialize)]
struct Finding {
    what: String,
    good: bool,
    text: String,
}

/// Looks at everything that a cell needs, and at the running cell if there is one.
pub(crate) fn run(file: &Path, json: bool) -> anyhow::Result<u8> {
    let mut findings = Vec::new();
    let mut find = |what: &str, result: Result<String, String>| {
        let (good, text) = match result {
            Ok(text) => (true, text),
            Err(text) => (false, text),
        };
        findings.push(Finding {
            what: what.to_owned(),
            good,
            text,
        });
    };
    let cell = read_cell(file);
    // The cell file can be read, and the programs are there that it needs.
    let mut complete = cell.is_ok();
    match cell {
        Err(error) => find("cell file", Err(error.to_string())),
        Ok(cell) => {
            find(
                "cell file",
                Ok(format!(
                    "{}: {}",
                    file.display(),
                    cell.node_names().join(", ")
                )),
            );
            find("graph", graph(&cell));
            find("recordings", recordings(&cell));
            find("bus settings", settings(&cell));
            find("bus", bus(&cell));
            if let Some(driver) = cell.driver_settings(&cell.driver.source) {
                for check in driver.doctor_checks() {
                    find(&check.subject, check.result);
                }
            }
            let polls = cell.polls();
            match external::file(external::PLC) {
                _ if polls.is_empty() => {}
                Err(missing) => {
                    complete = false;
                    find("[[signals]]", Err(missing.to_string()));
                }
                Ok(program) => match Reader::once(&program, &polls) {
                    Err(ended) => find("[[signals]]", Err(ended.to_string())),
                    Ok(read) => {
                        for poll in &polls {
                            find(&poll.source, values(poll, &read));
                        }
                    }
                },
            }
        }
    }
    let good = findings.iter().all(|finding| finding.good);
    if json {
        output::json(&findings)?;
    } else {
        for finding in &findings {
            let word = if finding.good { "good" } else { "WRONG" };
            output::line(&format!("{word:<6} {}: {}", finding.what, finding.text));
        }
    }
    Ok(match (complete, good) {
        (false, _) => BAD_INPUT,
        (true, false) => FAILED,
        (true, true) => GOOD,
    })
}

/// What a controller beside the machine holds now, or why the first signal that cannot be read cannot.
fn values(poll: &Poll, read: &[Reading]) -> Result<String, String> {
    let texts = poll.signals.iter().map(|signal| {
        let (name, unit) = (&signal.name, signal.unit.as_str());
        let mut own = (read.iter()).filter(|one| one.source == poll.source && one.signal == *name);
        match own.next().map(|one| &one.outcome) {
            Some(Outcome::Value(value)) if unit == "1" => Ok(format!("{name} = {value}")),
            Some(Outcome::Value(value)) => Ok(format!("{name} = {value} {unit}")),
            Some(Outcome::Failure(text)) => Err(text.clone()),
            None => Err(format!("{name:?} was not read")),
        }
    });
    Ok(texts.collect::<Result<Vec<_>, _>>()?.join(", "))
}

/// Every topic with a subscription has a publisher.
fn graph(cell: &Cell) -> Result<String, String> {
    let nodes = cell.nodes(false).map_err(|error| error.to_string())?;
    let wiring = Wiring::of(&nodes).map_err(|error| error.to_string())?;
    let names = cell.node_names();
    let outside = ["driver", "signals", "operator", "instrument", "recorder"];
    for node in &nodes {
        for topic in node.inputs() {
            let known =
                topics::by_name(topic.name).is_some_and(|known| outside.contains(&known.producer));
            if wiring.producer(topic.name).is_none() && !known {
                return Err(format!(
                    "{} subscribes to {}, which has no publisher",
                    node.name(),
                    topic.name
                ));
            }
        }
    }
    Ok(format!(
        "{} nodes, {} topics, each with one producer",
        names.len(),
        topics::ALL.len()
    ))
}

fn recordings(cell: &Cell) -> Result<String, String> {
    let folder = &cell.recorder.folder;
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("{} cannot be made: {error}", folder.display()))?;
    let probe = folder.join(".probecell_doctor");
    // Made new, so that nothing that is there is written to.
    std::fs::File::create_new(&probe)
        .map_err(|error| format!("{} cannot be written: {error}", folder.display()))?;
    std::fs::remove_file(&probe)
        .map_err(|error| format!("{} cannot be removed: {error}", probe.display()))?;
    let forecast = Forecast::of(folder, &retention::finished(cell));
    let forecast = forecast.map_or(String::new(), |forecast| format!(", {forecast}"));
    Ok(format!("{} can be written{forecast}", folder.display()))
}

/// Zenoh accepts the settings of sessions and of the router, whether that router is needed now or not.
fn settings(cell: &Cell) -> Result<String, String> {
    let text = |error: anyhow::Error| error.to_string();
    let session = cell_bus::bus_config(cell, "doctor").map_err(text)?;
    let router = cell_bus::router_config(cell).map_err(text)?;
    session
        .check()
        .map_err(|error| format!("bus.zenoh: {error}"))?;
    router
        .check()
        .map_err(|error| format!("bus.router_zenoh: {error}"))?;
    Ok("accepted by Zenoh".to_owned())
}

fn bus(cell: &Cell) -> Result<String, String> {
    let mut config = cell_bus::bus_config(cell, "doctor").map_err(|error| error.to_string())?;
    config.connect_timeout = Duration::from_secs(2);
    if cell.bus.transport == TransportName::Dds {
        return dds(cell, &config);
    }
    let endpoint = &cell.bus.router_endpoint;
    let address = endpoint
        .split_once('/')
        .map_or(endpoint.as_str(), |(_, address)| address);
    if let Err(silent) = tcp_answers(address) {
        return if is_of_this_machine(address) {
            Ok(format!(
                "nothing listens at {endpoint} yet: `up` will start its embedded router"
            ))
        } else {
            Err(format!(
                "{silent}, which is not an address of this machine: start a router there"
            ))
        };
    }
    let bus = Bus::open(&config, "doctor", &cell.namespace())
        .map_err(|error| format!("something listens at {endpoint}, but: {error}"))?;
    // Liveliness tokens of a session that has just joined arrive within a round trip.
    std::thread::sleep(Duration::from_millis(300));
    let graph = bus.graph();
    let text = format!(
        "a router answers at {endpoint}; nodes seen: {}",
        graph.nodes().join(", ")
    );
    bus.close(CLOSE_TIMEOUT)
        .map_err(|error| error.to_string())?;
    Ok(text)
}

/// Two participants of this process find each other, as those of a cell must.
fn dds(cell: &Cell, config: &BusConfig) -> Result<String, String> {
    let open = |name| {
        Bus::open(config, name, &cell.namespace())
            .map_err(|error| format!("DDS cannot be opened: {error}"))
    };
    let (here, there) = (open("doctor")?, open("doctor_seen")?);
    let wanted = format!("{}/doctor_seen", cell.namespace());
    let deadline = Instant::now() + DISCOVERY_TIMEOUT;
    let found = loop {
        if here.graph().nodes().contains(&wanted) {
            break true;
        }
        if Instant::now() > deadline {
            break false;
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    let nodes = here.graph().nodes().join(", ");
    for bus in [here, there] {
        bus.close(CLOSE_TIMEOUT)
            .map_err(|error| error.to_string())?;
    }
    if found {
        Ok(format!(
            "two participants find each other in domain {}; nodes seen: {nodes}",
            config.domain_id
        ))
    } else {
        Err(format!(
            "two participants on this machine do not find each other within {} s: the loopback interface needs \
             multicast (ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo)",
            DISCOVERY_TIMEOUT.as_secs()
        ))
    }
}

/// A socket can be bound to it.
fn is_of_this_machine(address: &str) -> bool {
    address.to_socket_addrs().is_ok_and(|mut addresses| {
        addresses.any(|address| TcpListener::bind((address.ip(), 0)).is_ok())
    })
}
