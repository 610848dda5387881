//! Modbus TCP, after the "MODBUS Application Protocol Specification V1.1b3" (Modbus Organization, 2012).

use plc::{
    DataType,
    modbus::{Place, Table, Unit},
};
use tokio_modbus::{
    Slave,
    client::sync::{Context, Reader, tcp},
};

use crate::{ANSWER, Connection, ReadError, decode, resolve};

/// See [`crate::connect`].
pub(crate) fn connect(unit: &Unit) -> Result<Box<dyn Connection>, String> {
    let server = resolve(&unit.server)?;
    let context = tcp::connect_slave_with_timeout(server, Slave(unit.unit), Some(ANSWER));
    let mut context = context.map_err(|error| error.to_string())?;
    context.set_timeout(ANSWER);
    Ok(Box::new(Open(context)))
}

struct Open(Context);

impl Connection for Open {
    fn read(&mut self, address: &str, data_type: DataType) -> Result<f64, ReadError> {
        let place = Place::of(address, data_type).map_err(ReadError::Refused)?;
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
        Ok(decode(data_type, bytes))
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
