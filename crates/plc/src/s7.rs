//! S7 communication of SIMATIC controllers (ISO on TCP, RFC 1006), with absolute addresses. A data block that is read must not
//! be optimised, and the controller has to permit PUT/GET.

use rust7::client::{
    S7_AREA_DB, S7_AREA_MK, S7_AREA_PA, S7_AREA_PE, S7_WL_BYTE, S7Client, S7Error,
};

use crate::{ANSWER, Connection, Controller, DataType, Protocol, ReadError, endpoint};

/// The protocol.
pub(crate) struct S7;

/// A processor in a rack.
#[derive(Debug)]
struct Processor {
    host: (String, u16),
    rack: u16,
    slot: u16,
}

/// Address of a value.
struct Place {
    area: u8,
    block: u16,
    byte: u16,
    /// Of a bool.
    bit: Option<u8>,
    /// Bytes.
    size: usize,
}

impl Protocol for S7 {
    fn scheme(&self) -> &'static str {
        "s7"
    }

    fn example(&self) -> &'static str {
        "s7://10.0.0.5/0/1"
    }

    /// Host, rack and slot.
    fn controller(&self, rest: &str) -> Option<Box<dyn Controller>> {
        let (host, place) = rest.split_once('/')?;
        let (rack, slot) = place.split_once('/')?;
        let below = |text: &str, limit: u16| text.parse().ok().filter(|number| *number < limit);
        Some(Box::new(Processor {
            host: endpoint(host, 102)?,
            rack: below(rack, 8)?,
            slot: below(slot, 32)?,
        }))
    }
}

impl Place {
    fn of(address: &str) -> Option<Self> {
        let upper = address.to_ascii_uppercase();
        let (area, block, rest) = if let Some(rest) = upper.strip_prefix("DB") {
            let (block, rest) = rest.split_once(".DB")?;
            (S7_AREA_DB, block.parse().ok()?, rest)
        } else {
            let area = match upper.chars().next()? {
                'M' => S7_AREA_MK,
                'I' | 'E' => S7_AREA_PE,
                'Q' | 'A' => S7_AREA_PA,
                _ => return None,
            };
            (area, 0, &upper[1..])
        };
        let (size, rest) = match rest.chars().next()? {
            'B' => (1, &rest[1..]),
            'W' => (2, &rest[1..]),
            'D' => (4, &rest[1..]),
            'X' => (0, &rest[1..]),
            digit if digit.is_ascii_digit() && area != S7_AREA_DB => (0, rest),
            _ => return None,
        };
        let (byte, bit) = match rest.split_once('.') {
            Some((byte, bit)) if size == 0 => {
                (byte, Some(bit.parse().ok().filter(|bit| *bit < 8)?))
            }
            None if size > 0 => (rest, None),
            _ => return None,
        };
        Some(Self {
            area,
            block,
            byte: byte.parse().ok()?,
            bit,
            size: size.max(1),
        })
    }

    fn of_type(address: &str, data_type: DataType) -> Result<Self, String> {
        let place = Self::of(address).ok_or_else(|| {
            format!(
                "{address:?} is no address of S7: DB1.DBX0.0, DB1.DBB0, DB1.DBW0, DB1.DBD0, or M0.0, MB0, MW0, MD0 and the same \
                 with I or Q"
            )
        })?;
        let name = data_type.name();
        match (place.bit.is_some(), data_type == DataType::Bool) {
            (true, false) => Err(format!(
                "{address:?} is one bit: its type is bool, not {name}"
            )),
            (false, true) => Err(format!("{address:?} is no bit: its type is not bool")),
            _ if place.size != data_type.size() => Err(format!(
                "{address:?} has {} bits: its type is not {name}",
                8 * place.size
            )),
            _ => Ok(place),
        }
    }
}

impl Controller for Processor {
    fn check(&self, address: &str, data_type: DataType) -> Result<(), String> {
        Place::of_type(address, data_type).map(drop)
    }

    fn connect(&self) -> Result<Box<dyn Connection>, String> {
        let (host, port) = &self.host;
        let wait = ANSWER.as_millis() as u64;
        let mut client = S7Client::new();
        let settings = client.set_timeout(wait, wait, wait);
        let settings = settings.and_then(|()| client.set_connection_port(*port));
        settings
            .and_then(|()| client.connect_rack_slot(host, self.rack, self.slot))
            .map_err(|error| error.to_string())?;
        Ok(Box::new(Open(client)))
    }
}

struct Open(S7Client);

impl Connection for Open {
    fn read(&mut self, address: &str, data_type: DataType) -> Result<f64, ReadError> {
        let place = Place::of_type(address, data_type).map_err(ReadError::Refused)?;
        let mut bytes = [0; 8];
        let read = self.0.read_area(
            place.area,
            place.block,
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
        Ok(data_type.decode(bytes))
    }
}
