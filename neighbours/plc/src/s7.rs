//! S7 communication of SIMATIC controllers (ISO on TCP, RFC 1006).

use plc::{
    DataType,
    s7::{Area, Place, Processor},
};
use rust7::client::{
    S7_AREA_DB, S7_AREA_MK, S7_AREA_PA, S7_AREA_PE, S7_WL_BYTE, S7Client, S7Error,
};

use crate::{ANSWER, Connection, ReadError, decode};

/// See [`crate::connect`].
pub(crate) fn connect(processor: &Processor) -> Result<Box<dyn Connection>, String> {
    let (host, port) = (&processor.host.host, processor.host.port);
    let wait = ANSWER.as_millis() as u64;
    let mut client = S7Client::new();
    let settings = client.set_timeout(wait, wait, wait);
    let settings = settings.and_then(|()| client.set_connection_port(port));
    settings
        .and_then(|()| client.connect_rack_slot(host, processor.rack, processor.slot))
        .map_err(|error| error.to_string())?;
    Ok(Box::new(Open(client)))
}

struct Open(S7Client);

impl Connection for Open {
    fn read(&mut self, address: &str, data_type: DataType) -> Result<f64, ReadError> {
        let place = Place::of(address, data_type).map_err(ReadError::Refused)?;
        let (area, block) = match place.area {
            Area::Block(number) => (S7_AREA_DB, number),
            Area::Flags => (S7_AREA_MK, 0),
            Area::Inputs => (S7_AREA_PE, 0),
            Area::Outputs => (S7_AREA_PA, 0),
        };
        let mut bytes = [0; 8];
        let read = self.0.read_area(
            area,
            block,
            place.byte,
            S7_WL_BYTE,
            &mut bytes[..place.size],
        );
        match read {
            Ok(()) => {}
            Err(error @ (S7Error::S7NotFound | S7Error::S7InvalidAddress)) => {
                return Err(ReadError::Refused(format!(
                    "the controller answers: {error}"
                )));
            }
            Err(error) => return Err(ReadError::Lost(error.to_string())),
        }
        if let Some(bit) = place.bit {
            return Ok(f64::from(bytes[0] >> bit & 1));
        }
        Ok(decode(data_type, bytes))
    }
}
