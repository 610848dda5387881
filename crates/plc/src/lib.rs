//! How are signals of a programmable controller read? Clamping, presence of the part, temperatures: values at addresses of an
//! auxiliary controller, over its own protocol.
//!
//! ```text
//! "s7://10.0.0.5/0/1" --controller()--> Controller --connect()--> Connection --read("DB1.DBD4", F32)--> number
//!        scheme = Protocol                  |                          |
//!                                       check(address, type)       Poll::run: each signal at its period, scaled to SI
//! ```
//!
//! A protocol is one file of this crate that implements [`Protocol`], and one line in [`PROTOCOLS`]. Nothing is ever written to
//! a controller. This crate knows no bus and no clock of the cell: `host` publishes what [`Poll`] gives.
//!
//! ```
//! use plc::{DataType, controller};
//!
//! let modbus = controller("modbus://10.0.0.7/1")?;
//! modbus.check("input:30", DataType::I16)?;
//! let wrong = modbus.check("input:30", DataType::Bool).unwrap_err();
//! assert_eq!(wrong, "\"input:30\" is a register: a bool is one bit of it, such as \"input:30.0\"");
//! let other = controller("profinet://10.0.0.7").unwrap_err();
//! assert!(other.ends_with("there are modbus, s7, ads"), "{other}");
//! # Ok::<(), String>(())
//! ```

mod ads;
mod modbus;
mod poll;
mod s7;

use std::{fmt::Debug, net::SocketAddr, net::ToSocketAddrs, time::Duration};

use serde::Deserialize;

pub use poll::{Poll, Signal};

/// Every protocol of this crate.
const PROTOCOLS: &[&dyn Protocol] = &[&modbus::Modbus, &s7::S7, &ads::Ads];

/// Longest wait for a connection, and for an answer.
const ANSWER: Duration = Duration::from_secs(1);

/// A way to speak to controllers.
trait Protocol: Sync {
    /// URL scheme of a source.
    fn scheme(&self) -> &'static str;

    /// A source of it, for error messages.
    fn example(&self) -> &'static str;

    /// The controller at what follows `://`; none where that is not of the form of [`Protocol::example`].
    fn controller(&self, rest: &str) -> Option<Box<dyn Controller>>;
}

/// A controller, not yet connected.
pub trait Controller: Debug + Send + Sync {
    /// Checks that a value of this type can stand at this address.
    ///
    /// # Errors
    /// One sentence that begins with the address.
    fn check(&self, address: &str, data_type: DataType) -> Result<(), String>;

    /// Connects; takes a second at most.
    ///
    /// # Errors
    /// One sentence.
    fn connect(&self) -> Result<Box<dyn Connection>, String>;
}

/// A connection to a controller.
pub trait Connection {
    /// The value at an address that [`Controller::check`] takes; a bool is 0 or 1.
    ///
    /// # Errors
    /// See [`ReadError`].
    fn read(&mut self, address: &str, data_type: DataType) -> Result<f64, ReadError>;
}

/// Why a value cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReadError {
    /// The controller answers that it has no such value; the connection remains usable.
    Refused(String),
    /// The connection is of no use any more.
    Lost(String),
}

impl ReadError {
    /// What happened, as the protocol says it.
    pub fn text(&self) -> &str {
        match self {
            Self::Refused(text) | Self::Lost(text) => text,
        }
    }
}

/// Representation of a value in the memory of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
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
    const fn size(self) -> usize {
        match self {
            Self::Bool | Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number in the first [`DataType::size`] of these bytes, the most significant first.
    fn decode(self, bytes: [u8; 8]) -> f64 {
        let raw = u64::from_be_bytes(bytes) >> (64 - 8 * self.size());
        match self {
            Self::Bool => f64::from(raw != 0),
            Self::U8 | Self::U16 | Self::U32 => raw as f64,
            Self::I8 => f64::from(raw as i8),
            Self::I16 => f64::from(raw as i16),
            Self::I32 => f64::from(raw as i32),
            Self::F32 => f64::from(f32::from_bits(raw as u32)),
            Self::F64 => f64::from_bits(raw),
        }
    }

    /// As a cell file names it.
    const fn name(self) -> &'static str {
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
pub fn controller(source: &str) -> Result<Box<dyn Controller>, String> {
    let schemes = || {
        let names: Vec<_> = PROTOCOLS.iter().map(|one| one.scheme()).collect();
        names.join(", ")
    };
    let (scheme, rest) = source.split_once("://").unwrap_or((source, ""));
    let known = PROTOCOLS.iter().find(|one| one.scheme() == scheme);
    let protocol = known.ok_or_else(|| {
        format!(
            "{source:?}: {scheme:?} is no protocol of a controller; there are {}",
            schemes()
        )
    })?;
    let controller = protocol.controller(rest);
    controller.ok_or_else(|| format!("{source:?} must be of the form {:?}", protocol.example()))
}

/// Host and port, the latter where it is not written.
fn endpoint(text: &str, port: u16) -> Option<(String, u16)> {
    let is_bare = |host: &str| !host.is_empty() && (!host.contains(':') || host.ends_with(']'));
    if is_bare(text) {
        return Some((text.to_owned(), port));
    }
    let (host, port) = text.rsplit_once(':')?;
    Some((host.to_owned(), port.parse().ok()?)).filter(|(host, _)| is_bare(host))
}

/// The first address of a host.
fn resolve((host, port): &(String, u16)) -> Result<SocketAddr, String> {
    let text = format!("{host}:{port}");
    let found = text.to_socket_addrs().map(|mut all| all.next());
    match found {
        Ok(Some(address)) => Ok(address),
        Ok(None) => Err(format!("{text}: this host has no address")),
        Err(error) => Err(format!("{text}: {error}")),
    }
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
            assert_eq!(data_type.decode(bytes(stored)), value, "{data_type:?}");
        }
    }

    #[test]
    fn a_source_is_of_the_form_of_its_protocol() {
        for source in [
            "modbus://10.0.0.7/1",
            "modbus://plc.shop:1502/255",
            "modbus://[::1]:502/1",
            "s7://10.0.0.5/0/1",
            "ads://10.0.0.9/10.0.0.9.1.1:851",
        ] {
            assert!(controller(source).is_ok(), "{source}");
        }
        for source in [
            "modbus://10.0.0.7",
            "modbus://10.0.0.7:x/1",
            "modbus://:502/1",
            "modbus://10.0.0.7/256",
            "s7://10.0.0.5/0",
            "s7://10.0.0.5/0/32",
            "ads://10.0.0.9/10.0.0.9:851",
            "10.0.0.7",
        ] {
            let text = controller(source).expect_err(source);
            assert!(text.starts_with(&format!("{source:?}")), "{text}");
        }
    }
}
