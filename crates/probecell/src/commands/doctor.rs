//! `probecell doctor`: what is wrong with this set-up.

use std::{
    net::{TcpStream, ToSocketAddrs},
    path::Path,
    time::Duration,
};

use cell::{Cell, Source, TransportName};
use graph::{Wiring, topics};
use host::bus::Bus;
use serde::Serialize;

use crate::{FAILED, GOOD, launcher, report};

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
    match Cell::read(file) {
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
            find("bus", bus(&cell));
            if let Some(linuxcnc) = cell
                .linuxcnc
                .as_ref()
                .filter(|_| cell.driver.source == Source::Linuxcnc)
            {
                find("linuxcnc", reach(&linuxcnc.address));
            }
        }
    }
    let good = findings.iter().all(|finding| finding.good);
    if json {
        report::json(&findings)?;
    } else {
        for finding in &findings {
            let word = if finding.good { "good" } else { "WRONG" };
            report::line(&format!("{word:<6} {}: {}", finding.what, finding.text));
        }
    }
    Ok(if good { GOOD } else { FAILED })
}

/// Every topic that is heard has somebody who speaks on it.
fn graph(cell: &Cell) -> Result<String, String> {
    let nodes = cell.nodes(false).map_err(|error| error.to_string())?;
    let wiring = Wiring::of(&nodes).map_err(|error| error.to_string())?;
    let names = cell.node_names();
    let outside = ["driver", "operator", "instrument", "recorder"];
    for node in &nodes {
        for topic in node.inputs() {
            let known =
                topics::by_name(topic.name).is_some_and(|known| outside.contains(&known.producer));
            if wiring.producer(topic.name).is_none() && !known {
                return Err(format!(
                    "{} hears {}, on which nobody speaks",
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
    std::fs::write(&probe, b"")
        .map_err(|error| format!("{} cannot be written: {error}", folder.display()))?;
    std::fs::remove_file(&probe)
        .map_err(|error| format!("{} cannot be removed: {error}", probe.display()))?;
    Ok(format!("{} can be written", folder.display()))
}

fn bus(cell: &Cell) -> Result<String, String> {
    if cell.bus.transport == TransportName::Dds {
        return Ok("DDS: needs multicast; nothing else to look at before a start".to_owned());
    }
    let endpoint = &cell.bus.router_endpoint;
    let address = endpoint
        .split_once('/')
        .map_or(endpoint.as_str(), |(_, address)| address);
    if reach(address).is_err() {
        return Ok(format!(
            "nothing listens at {endpoint} yet: `up` carries its own router"
        ));
    }
    let mut config = launcher::bus_config(cell).map_err(|error| error.to_string())?;
    config.connect_timeout = Duration::from_secs(2);
    let bus = Bus::open(&config, "doctor", &cell.namespace())
        .map_err(|error| format!("something listens at {endpoint}, but: {error}"))?;
    // Liveliness tokens of a session that has just joined arrive within a round trip.
    std::thread::sleep(Duration::from_millis(300));
    let graph = bus.graph();
    let text = format!(
        "a router answers at {endpoint}; nodes seen: {}",
        graph.nodes().join(", ")
    );
    bus.close(Duration::from_secs(2))
        .map_err(|error| error.to_string())?;
    Ok(text)
}

fn reach(address: &str) -> Result<String, String> {
    let addresses = address
        .to_socket_addrs()
        .map_err(|error| format!("{address}: {error}"))?;
    for candidate in addresses {
        if TcpStream::connect_timeout(&candidate, Duration::from_secs(2)).is_ok() {
            return Ok(format!("{address} answers"));
        }
    }
    Err(format!("nothing answers at {address}"))
}
