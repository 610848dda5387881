//! `probecell-plc`: reads signals of controllers beside the machine (PLCs), each at its period, and writes each reading as a line.
//!
//! ```text
//! standard input: one Document --> connect(Controller) --> Connection --read("DB1.DBD4", F32)--> number
//!                                                              |
//!                     a thread of its own for each controller: Polling, scaled to SI --> Reading, a line of standard output
//! ```
//!
//! The lines are those of the crate `plc`. The process `signals` of a cell starts this program, and `probecell doctor` with `--once`.
//! Nothing is ever written to a controller. It has neither the bus nor a key of the cell, and opens no file once it has been told what
//! to read.
//!
//! A protocol is one file of this program that implements [`Connection`], and one line in [`connect`].

mod ads;
mod modbus;
mod polling;
mod s7;

use std::{
    collections::BTreeSet,
    io::{self, BufRead},
    net::{IpAddr, SocketAddr, ToSocketAddrs},
    process::ExitCode,
    thread,
    time::Duration,
};

use anyhow::{Context, bail};
use clap::Parser;
use confinement::{Rights, Sockets, confine};
use plc::{Controller, DataType, Document, Endpoint, Reading, controller};
use terminal::{FAILED, GOOD};

use polling::Polling;

/// Longest wait for a connection, and for an answer.
const ANSWER: Duration = Duration::from_secs(1);
/// TCP port of servers of names, for answers that do not fit into a datagram.
const NAMES: u16 = 53;

/// A connection to a controller.
trait Connection {
    /// The value at an address that [`Controller::check`] takes; a bool is 0 or 1.
    ///
    /// # Errors
    /// See [`ReadError`].
    fn read(&mut self, address: &str, data_type: DataType) -> Result<f64, ReadError>;
}

/// Why a value cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
enum ReadError {
    /// The controller answers that it has no such value; the connection remains usable.
    Refused(String),
    /// The connection is of no use any more.
    Lost(String),
}

/// Connects; takes a second at most.
///
/// # Errors
/// One sentence.
fn connect(controller: &Controller) -> Result<Box<dyn Connection>, String> {
    match controller {
        Controller::Modbus(unit) => modbus::connect(unit),
        Controller::S7(processor) => s7::connect(processor),
        Controller::Ads(runtime) => ads::connect(runtime),
    }
}

/// Where a controller is reached.
fn endpoint(controller: &Controller) -> &Endpoint {
    match controller {
        Controller::Modbus(unit) => &unit.server,
        Controller::S7(processor) => &processor.host,
        Controller::Ads(runtime) => &runtime.host,
    }
}

/// The first address of a host.
fn resolve(endpoint: &Endpoint) -> Result<SocketAddr, String> {
    let found = (endpoint.to_string().to_socket_addrs()).map(|mut all| all.next());
    match found {
        Ok(Some(address)) => Ok(address),
        Ok(None) => Err(format!("{endpoint}: this host has no address")),
        Err(error) => Err(format!("{endpoint}: {error}")),
    }
}

/// The number in the first bytes, as many as the type has, the most significant first.
fn decode(data_type: DataType, bytes: [u8; 8]) -> f64 {
    let raw = u64::from_be_bytes(bytes) >> (64 - 8 * data_type.size());
    match data_type {
        DataType::Bool => f64::from(raw != 0),
        DataType::U8 | DataType::U16 | DataType::U32 => raw as f64,
        DataType::I8 => f64::from(raw as i8),
        DataType::I16 => f64::from(raw as i16),
        DataType::I32 => f64::from(raw as i32),
        DataType::F32 => f64::from(f32::from_bits(raw as u32)),
        DataType::F64 => f64::from_bits(raw),
    }
}

/// Read signals of controllers beside the machine, for a cell with [[signals]].
#[derive(Parser)]
#[command(
    version,
    bin_name = "probecell-plc",
    after_help = "A cell starts this program by itself. By hand:\n    \
    echo '{\"polls\":[{\"source\":\"modbus://10.0.0.7/1\",\"signals\":[{\"name\":\"oil\",\"address\":\"input:30\",\"type\":\"i16\",\
    \"scale\":0.1,\"offset\":0,\"unit\":\"degC\",\"period_s\":1}]}]}' | probecell-plc --once\n\n\
    Sources and addresses: docs/howto/plc-signals.md."
)]
struct Arguments {
    /// Read each signal once, and exit with status 1 where one could not be read. Without it they are read until standard input closes.
    #[arg(long)]
    once: bool,
}

fn main() -> ExitCode {
    terminal::exit("probecell-plc", run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let mut told = String::new();
    let mut input = io::stdin().lock();
    input
        .read_line(&mut told)
        .context("cannot read standard input")?;
    if told.trim().is_empty() {
        bail!(
            "standard input does not say what to read; a cell with [[signals]] starts this program by itself"
        );
    }
    let document = Document::read(&told).map_err(anyhow::Error::msg)?;
    let mut all = Vec::new();
    for poll in document.polls {
        let controller = controller(&poll.source).map_err(anyhow::Error::msg)?;
        all.push(Polling { poll, controller });
    }
    let endpoints = all.iter().map(|one| endpoint(&one.controller));
    confine(&Rights::default().with_sockets(sockets(endpoints)))?;
    if arguments.once {
        let mut has_failed = false;
        for one in &all {
            for reading in one.once() {
                has_failed |= matches!(reading.outcome, plc::Outcome::Failure(_));
                tell(&reading);
            }
        }
        return Ok(if has_failed { FAILED } else { GOOD });
    }
    for one in all {
        // It ends with the process.
        let run = thread::Builder::new().name("controller".to_owned());
        run.spawn(move || one.run(tell))
            .context("cannot start a thread")?;
    }
    // Who has asked is gone then.
    io::copy(&mut input, &mut io::sink()).context("cannot read standard input")?;
    Ok(GOOD)
}

/// What it takes to reach these, and no more: their ports, and the look-up of names where there are any.
fn sockets<'a>(endpoints: impl Iterator<Item = &'a Endpoint>) -> Sockets {
    let (mut ports, mut is_named) = (BTreeSet::new(), false);
    for endpoint in endpoints {
        ports.insert(endpoint.port);
        let bare = endpoint.host.trim_matches(['[', ']']);
        is_named |= bare.parse::<IpAddr>().is_err();
    }
    if is_named {
        ports.insert(NAMES);
    }
    Sockets {
        tcp: true,
        udp: is_named,
        ports: Some(ports.into_iter().collect()),
        ..Sockets::default()
    }
}

/// Where nobody listens any more this ends the process.
fn tell(reading: &Reading) {
    terminal::bytes(format!("{reading}\n").as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_decoded_from_its_most_significant_byte_on() {
        let bytes = |first: &[u8]| {
            let mut all = [0xaa; 8];
            all[..first.len()].copy_from_slice(first);
            all
        };
        for (data_type, stored, value) in [
            (DataType::Bool, &[1][..], 1.0),
            (DataType::U8, &[0xfe], 254.0),
            (DataType::I8, &[0xfe], -2.0),
            (DataType::U16, &[0x01, 0x02], 258.0),
            (DataType::I16, &[0xff, 0x38], -200.0),
            (DataType::U32, &[0x80, 0, 0, 1], 2_147_483_649.0),
            (DataType::I32, &[0xff, 0xff, 0xff, 0xff], -1.0),
            (DataType::F32, &[0x41, 0xac, 0, 0], 21.5),
            (DataType::F64, &[0x40, 0x35, 0x80, 0, 0, 0, 0, 0], 21.5),
        ] {
            assert_eq!(decode(data_type, bytes(stored)), value, "{data_type:?}");
        }
    }

    #[test]
    fn only_a_host_with_a_name_takes_datagrams() {
        let of = |sources: &[&str]| {
            let all: Vec<_> = sources
                .iter()
                .map(|one| controller(one).expect(one))
                .collect();
            sockets(all.iter().map(endpoint))
        };
        let numbers = of(&[
            "modbus://10.0.0.7/1",
            "s7://[::1]:1102/0/1",
            "modbus://10.0.0.8/1",
        ]);
        let tcp = Sockets {
            tcp: true,
            ports: Some(vec![502, 1102]),
            ..Sockets::default()
        };
        assert_eq!(numbers, tcp);
        let named = of(&["ads://plc.shop/10.0.0.9.1.1:851"]);
        assert_eq!((named.udp, named.ports), (true, Some(vec![53, 48898])));
    }
}
