//! Modbus TCP, after the "MODBUS Application Protocol Specification V1.1b3" (Modbus Organization, 2012).

use tokio_modbus::{
    Slave,
    client::sync::{Context, Reader, tcp},
};

use crate::{ANSWER, Connection, Controller, DataType, Protocol, ReadError, endpoint, resolve};

/// The protocol.
pub(crate) struct Modbus;

/// A unit of a server.
#[derive(Debug)]
struct Unit {
    server: (String, u16),
    unit: u8,
}

/// A table of a unit (section 4.3).
#[derive(Clone, Copy, PartialEq, Eq)]
enum Table {
    Coil,
    Discrete,
    Input,
    Holding,
}

/// Address of a value.
struct Place {
    table: Table,
    /// From 0, as on the wire; the 40001 of handbooks is `holding:0`.
    address: u16,
    bit: Option<u8>,
    /// The less significant of two registers comes first.
    is_low_first: bool,
}

impl Protocol for Modbus {
    fn scheme(&self) -> &'static str {
        "modbus"
    }

    fn example(&self) -> &'static str {
        "modbus://10.0.0.7:502/1"
    }

    fn controller(&self, rest: &str) -> Option<Box<dyn Controller>> {
        let (server, unit) = rest.split_once('/')?;
        Some(Box::new(Unit {
            server: endpoint(server, 502)?,
            unit: unit.parse().ok()?,
        }))
    }
}

impl Place {
    fn of(address: &str) -> Option<Self> {
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

    fn of_type(address: &str, data_type: DataType) -> Result<Self, String> {
        let place = Self::of(address).ok_or_else(|| {
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

impl Controller for Unit {
    fn check(&self, address: &str, data_type: DataType) -> Result<(), String> {
        Place::of_type(address, data_type).map(drop)
    }

    fn connect(&self) -> Result<Box<dyn Connection>, String> {
        let server = resolve(&self.server)?;
        let context = tcp::connect_slave_with_timeout(server, Slave(self.unit), Some(ANSWER));
        let mut context = context.map_err(|error| error.to_string())?;
        context.set_timeout(ANSWER);
        Ok(Box::new(Open(context)))
    }
}

struct Open(Context);

impl Connection for Open {
    fn read(&mut self, address: &str, data_type: DataType) -> Result<f64, ReadError> {
        let place = Place::of_type(address, data_type).map_err(ReadError::Refused)?;
        if matches!(place.table, Table::Coil | Table::Discrete) {
            let bits = match place.table {
                Table::Coil => self.0.read_coils(place.address, 1),
                _ => self.0.read_discrete_inputs(place.address, 1),
            };
            return Ok(f64::from(answered(bits)?.first() == Some(&true)));
        }
        let count = data_type.size().div_ceil(2) as u16;
        let registers = match place.table {
            Table::Input => self.0.read_input_registers(place.address, count),
            _ => self.0.read_holding_registers(place.address, count),
        };
        let mut registers = answered(registers)?;
        if let Some(bit) = place.bit {
            let first = registers.first().copied().unwrap_or_default();
            return Ok(f64::from(first >> bit & 1));
        }
        if place.is_low_first {
            registers.reverse();
        }
        let mut bytes = [0; 8];
        for (pair, register) in bytes.chunks_exact_mut(2).zip(registers) {
            pair.copy_from_slice(&register.to_be_bytes());
        }
        Ok(data_type.decode(bytes))
    }
}

/// The client has compared number and kind of what was answered with what was asked.
fn answered<T>(answer: tokio_modbus::Result<T>) -> Result<T, ReadError> {
    match answer {
        Ok(Ok(values)) => Ok(values),
        Ok(Err(exception)) => Err(ReadError::Refused(format!(
            "the controller answers: {exception}"
        ))),
        Err(error) => Err(ReadError::Lost(error.to_string())),
    }
}
