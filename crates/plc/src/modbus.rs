//! Modbus TCP, after the "MODBUS Application Protocol Specification V1.1b3" (Modbus Organization, 2012).

use crate::{Controller, DataType, Endpoint, Protocol};

/// The protocol.
pub(crate) const PROTOCOL: Protocol = Protocol {
    scheme: "modbus",
    example: "modbus://10.0.0.7:502/1",
    controller,
};

/// TCP port of the protocol.
const PORT: u16 = 502;

/// A unit of a server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Where the server is.
    pub server: Endpoint,
    /// Its number.
    pub unit: u8,
}

/// A table of a unit (section 4.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// Bits that can be written.
    Coil,
    /// Bits that can be read.
    Discrete,
    /// Registers that can be read.
    Input,
    /// Registers that can be written.
    Holding,
}

/// Address of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Where it stands.
    pub table: Table,
    /// From 0, as on the wire; the 40001 of handbooks is `holding:0`.
    pub address: u16,
    /// Of a bool in a register, from the least significant on.
    pub bit: Option<u8>,
    /// The less significant of two registers comes first.
    pub is_low_first: bool,
}

fn controller(rest: &str) -> Option<Controller> {
    let (server, unit) = rest.split_once('/')?;
    Some(Controller::Modbus(Unit {
        server: Endpoint::of(server, PORT)?,
        unit: unit.parse().ok()?,
    }))
}

impl Place {
    fn parsed(address: &str) -> Option<Self> {
        let (address, is_low_first) = match address.strip_suffix(":low_first") {
            Some(address) => (address, true),
            None => (address, false),
        };
        let (table, number) = address.split_once(':')?;
        let (number, bit) = match number.split_once('.') {
            Some((number, bit)) => (number, Some(bit.parse().ok().filter(|bit| *bit < 16)?)),
            None => (number, None),
        };
        Some(Self {
            table: match table {
                "coil" => Table::Coil,
                "discrete" => Table::Discrete,
                "input" => Table::Input,
                "holding" => Table::Holding,
                _ => return None,
            },
            address: number.parse().ok()?,
            bit,
            is_low_first,
        })
    }

    /// The place of a value of this type.
    ///
    /// # Errors
    /// One sentence that begins with the address: it is none, or holds no value of this type.
    pub fn of(address: &str, data_type: DataType) -> Result<Self, String> {
        let place = Self::parsed(address).ok_or_else(|| {
            format!(
                "{address:?} is no address of Modbus: coil:N, discrete:N, input:N or holding:N from 0, N.BIT for a bit of a \
                 register, and :low_first after two registers whose less significant one comes first"
            )
        })?;
        let is_bit = matches!(place.table, Table::Coil | Table::Discrete);
        let name = data_type.name();
        match (is_bit, place.bit, data_type) {
            (true, Some(_), _) => Err(format!("{address:?} is one bit: it has no bits")),
            (true, None, DataType::Bool) | (false, Some(_), DataType::Bool) => Ok(place),
            (true, None, _) | (false, Some(_), _) => Err(format!(
                "{address:?} is one bit: its type is bool, not {name}"
            )),
            (false, None, DataType::Bool) => Err(format!(
                "{address:?} is a register: a bool is one bit of it, such as \"{address}.0\""
            )),
            (false, None, DataType::U8 | DataType::I8) => Err(format!(
                "{address:?} is a register of 16 bits: its type is not {name}"
            )),
            (false, None, _) if place.is_low_first && data_type.size() < 4 => Err(format!(
                "{address:?} is one register: there is no order of registers"
            )),
            (false, None, _) => Ok(place),
        }
    }
}
