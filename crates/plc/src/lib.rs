//! Which signals of programmable controllers (PLCs) are read, and how are they told? Clamping, presence of the part, temperatures:
//! values at addresses of an auxiliary controller.
//!
//! ```text
//! cell file --> Poll --> controller(source) --> Controller::check(address, type): what is wrong, before anything is read
//!                |
//!                |  Document, one line on standard input
//!                v
//!           probecell-plc <--> the controllers, over Modbus TCP, S7, ADS
//!                |
//!                |  Reading, one line each on standard output
//!                v
//!           process `signals` of the cell: stamps each when it arrives, and publishes it
//! ```
//!
//! This crate knows the form of sources and addresses and the lines, and opens no connection: the program `probecell-plc`
//! (`neighbours/plc`) does, with the libraries of the protocols.
//!
//! | line | from, to | meaning |
//! |---|---|---|
//! | `{"polls":[{"source":"s7://10.0.0.5/0/1","signals":[{"name":"chuck","address":"DB1.DBX0.3","type":"bool","scale":1.0,"offset":0.0,"unit":"1","period_s":0.2}]}]}` | cell, reader | the first and only one ([`Document`]): the controllers, each with its signals, where each stands, how, and s between two readings |
//! | `{"source":"s7://10.0.0.5/0/1","signal":"chuck","value":1.0}` | reader, cell | a reading ([`Reading`]): `stored * scale + offset`, a finite number in the unit of the signal; a bool is stored as 0 or 1 |
//! | `{"source":"s7://10.0.0.5/0/1","signal":"chuck","failure":"s7://10.0.0.5/0/1: Connection refused"}` | reader, cell | it could not be read, and why, in a sentence that names the source, and the address where that is what is wrong |
//!
//! Readings have no stamp: that of a reading is when it arrives. The reader ends when its standard input closes, and at its next
//! reading when its standard output does. With `--once` it reads each signal once, and exits with status 0, or 1 where one could not
//! be read; a document that it cannot take is status 2.
//!
//! A protocol is one file of this crate, one variant of [`Controller`] and one line in `PROTOCOLS`; and one file of the reader.
//!
//! ```
//! use plc::{DataType, Document, Outcome, Poll, Reading, Signal, controller};
//!
//! let modbus = controller("modbus://10.0.0.7/1")?;
//! modbus.check("input:30", DataType::I16)?;
//! let wrong = modbus.check("input:30", DataType::Bool).unwrap_err();
//! assert_eq!(wrong, "\"input:30\" is a register: a bool is one bit of it, such as \"input:30.0\"");
//! let other = controller("profinet://10.0.0.7").unwrap_err();
//! assert!(other.ends_with("there are modbus, s7, ads"), "{other}");
//!
//! let coolant = Signal {
//!     name: "coolant".to_owned(),
//!     address: "input:30".to_owned(),
//!     data_type: DataType::I16,
//!     scale: 0.1,
//!     offset: 0.0,
//!     unit: "degC".to_owned(),
//!     period_s: 0.2,
//! };
//! let polls = vec![Poll { source: "modbus://10.0.0.7/1".to_owned(), signals: vec![coolant] }];
//! let told = Document { polls };
//! assert_eq!(Document::read(&told.to_string())?, told);
//!
//! let read = Reading::read(r#"{"source":"modbus://10.0.0.7/1","signal":"coolant","value":21.5}"#)?;
//! assert_eq!(read.outcome, Outcome::Value(21.5));
//! # Ok::<(), String>(())
//! ```

pub mod ads;
mod lines;
pub mod modbus;
pub mod s7;

use std::fmt;

use serde::{Deserialize, Serialize};

pub use lines::{Document, Outcome, Poll, Reading, Signal};

/// A way to speak to controllers.
struct Protocol {
    /// URL scheme of a source.
    scheme: &'static str,
    /// A source of it, for error messages.
    example: &'static str,
    /// The controller at what follows `://`; none where that is not of the form of the example.
    controller: fn(&str) -> Option<Controller>,
}

/// Every protocol of this crate.
const PROTOCOLS: [Protocol; 3] = [modbus::PROTOCOL, s7::PROTOCOL, ads::PROTOCOL];

/// A controller, and how it is spoken to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Controller {
    /// Over Modbus TCP.
    Modbus(modbus::Unit),
    /// Over S7 communication.
    S7(s7::Processor),
    /// Over ADS.
    Ads(ads::Runtime),
}

impl Controller {
    /// Checks that a value of this type can stand at this address.
    ///
    /// # Errors
    /// One sentence that begins with the address.
    pub fn check(&self, address: &str, data_type: DataType) -> Result<(), String> {
        match self {
            Self::Modbus(_) => modbus::Place::of(address, data_type).map(drop),
            Self::S7(_) => s7::Place::of(address, data_type).map(drop),
            Self::Ads(_) => ads::check(address),
        }
    }
}

/// Where a controller is reached by TCP. It is shown as `host:port`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Endpoint {
    /// Its name, IPv4 address, or IPv6 address in brackets.
    pub host: String,
    /// Its port.
    pub port: u16,
}

impl Endpoint {
    /// `HOST` or `HOST:PORT`; `port` is the one of a host without.
    fn of(text: &str, port: u16) -> Option<Self> {
        let is_bare = |host: &str| !host.is_empty() && (!host.contains(':') || host.ends_with(']'));
        let (host, port) = if is_bare(text) {
            (text, port)
        } else {
            let (host, port) = text.rsplit_once(':')?;
            (host, port.parse().ok()?)
        };
        let host = Some(host).filter(|host| is_bare(host))?.to_owned();
        Some(Self { host, port })
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}", self.host, self.port)
    }
}

/// Representation of a value in the memory of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DataType {
    /// One bit.
    Bool,
    /// Unsigned, 8 bits.
    U8,
    /// Two's complement, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Two's complement, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Two's complement, 32 bits.
    I32,
    /// IEEE 754, 32 bits.
    F32,
    /// IEEE 754, 64 bits.
    F64,
}

impl DataType {
    /// Bytes that it takes; of a bool the one that holds it.
    pub const fn size(self) -> usize {
        match self {
            Self::Bool | Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// As a cell file names it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
}

/// The controller that a source names, such as `modbus://10.0.0.7:502/1`.
///
/// # Errors
/// One sentence that begins with the source.
pub fn controller(source: &str) -> Result<Controller, String> {
    let (scheme, rest) = source.split_once("://").unwrap_or((source, ""));
    let known = PROTOCOLS.iter().find(|one| one.scheme == scheme);
    let protocol = known.ok_or_else(|| {
        let schemes = PROTOCOLS.each_ref().map(|one| one.scheme).join(", ");
        format!("{source:?}: {scheme:?} is no protocol of a controller; there are {schemes}")
    })?;
    let controller = (protocol.controller)(rest);
    controller.ok_or_else(|| format!("{source:?} must be of the form {:?}", protocol.example))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_is_of_the_form_of_its_protocol() {
        for (source, endpoint) in [
            ("modbus://10.0.0.7/1", "10.0.0.7:502"),
            ("modbus://plc.shop:1502/255", "plc.shop:1502"),
            ("modbus://[::1]:502/1", "[::1]:502"),
            ("s7://10.0.0.5/0/1", "10.0.0.5:102"),
            ("ads://10.0.0.9/10.0.0.9.1.1:851", "10.0.0.9:48898"),
        ] {
            let (Controller::Modbus(modbus::Unit { server: at, .. })
            | Controller::S7(s7::Processor { host: at, .. })
            | Controller::Ads(ads::Runtime { host: at, .. })) = controller(source).expect(source);
            assert_eq!(at.to_string(), endpoint);
        }
        for source in [
            "modbus://10.0.0.7",
            "modbus://10.0.0.7:x/1",
            "modbus://:502/1",
            "modbus://10.0.0.7/256",
            "s7://10.0.0.5/0",
            "s7://10.0.0.5/0/32",
            "ads://10.0.0.9/10.0.0.9:851",
            "ads://10.0.0.9/10.0.0.9.1.1.1:851",
            "ads://10.0.0.9/10.0.0.9.1.256:851",
            "ads://10.0.0.9/10.0.0.9.1.1:851:1",
            "10.0.0.7",
        ] {
            let text = controller(source).expect_err(source);
            assert!(text.starts_with(&format!("{source:?}")), "{text}");
        }
    }

    #[test]
    fn an_address_is_of_the_form_of_its_protocol_and_holds_the_type() {
        let (modbus, s7) = ("modbus://10.0.0.7/1", "s7://10.0.0.5/0/1");
        let ads = "ads://10.0.0.9/10.0.0.9.1.1:851";
        for (source, address, data_type) in [
            (modbus, "coil:0", DataType::Bool),
            (modbus, "holding:7.15", DataType::Bool),
            (modbus, "input:30", DataType::U16),
            (modbus, "holding:50:low_first", DataType::F32),
            (s7, "DB1.DBX0.3", DataType::Bool),
            (s7, "m4.1", DataType::Bool),
            (s7, "EW2", DataType::I16),
            (s7, "DB1.DBD4", DataType::F32),
            (ads, "MAIN.axes[2].clamped", DataType::Bool),
        ] {
            let checked = controller(source).and_then(|one| one.check(address, data_type));
            assert_eq!(checked, Ok(()), "{address}");
        }
        for (source, address, data_type, why) in [
            (
                modbus,
                "register 5",
                DataType::F32,
                "is no address of Modbus",
            ),
            (
                modbus,
                "holding:7.16",
                DataType::Bool,
                "is no address of Modbus",
            ),
            (
                modbus,
                "holding:65536",
                DataType::U16,
                "is no address of Modbus",
            ),
            (
                modbus,
                "coil:5.1",
                DataType::Bool,
                "is one bit: it has no bits",
            ),
            (modbus, "coil:5", DataType::U16, "its type is bool, not u16"),
            (modbus, "input:5", DataType::U8, "its type is not u8"),
            (
                modbus,
                "input:5:low_first",
                DataType::I16,
                "there is no order of registers",
            ),
            (s7, "DB1.DBX0.8", DataType::Bool, "is no address of S7"),
            (s7, "DB1.0.3", DataType::Bool, "is no address of S7"),
            (s7, "DB1.DBX0.3", DataType::F32, "its type is bool, not f32"),
            (s7, "MW0", DataType::Bool, "is no bit"),
            (s7, "MW0", DataType::F32, "has 16 bits: its type is not f32"),
            (ads, "", DataType::Bool, "is no name of a symbol"),
            (
                ads,
                "MAIN clamped",
                DataType::Bool,
                "is no name of a symbol",
            ),
        ] {
            let checked = controller(source).and_then(|one| one.check(address, data_type));
            let text = checked.expect_err(address);
            assert!(
                text.starts_with(&format!("{address:?}")) && text.contains(why),
                "{text}"
            );
        }
    }
}
