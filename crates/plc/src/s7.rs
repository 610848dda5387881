//! S7 communication of SIMATIC controllers (ISO on TCP, RFC 1006), with absolute addresses. A data block that is read must not
//! be optimised, and the controller has to permit PUT/GET.

use crate::{Controller, DataType, Endpoint, Protocol};

/// The protocol.
pub(crate) const PROTOCOL: Protocol = Protocol {
    scheme: "s7",
    example: "s7://10.0.0.5/0/1",
    controller,
};

/// TCP port of ISO on TCP.
const PORT: u16 = 102;

/// A processor in a rack.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Processor {
    /// Where its controller is.
    pub host: Endpoint,
    /// Its rack, below 8.
    pub rack: u16,
    /// Its slot, below 32.
    pub slot: u16,
}

/// A memory of a processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Area {
    /// A data block, by its number.
    Block(u16),
    /// Flags (M).
    Flags,
    /// Image of the inputs (I, E).
    Inputs,
    /// Image of the outputs (Q, A).
    Outputs,
}

/// Address of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Where it stands.
    pub area: Area,
    /// Its first byte.
    pub byte: u16,
    /// Of a bool, from the least significant on.
    pub bit: Option<u8>,
    /// Bytes.
    pub size: usize,
}

/// Host, rack and slot.
fn controller(rest: &str) -> Option<Controller> {
    let (host, place) = rest.split_once('/')?;
    let (rack, slot) = place.split_once('/')?;
    let below = |text: &str, limit: u16| text.parse().ok().filter(|number| *number < limit);
    Some(Controller::S7(Processor {
        host: Endpoint::of(host, PORT)?,
        rack: below(rack, 8)?,
        slot: below(slot, 32)?,
    }))
}

impl Place {
    fn parsed(address: &str) -> Option<Self> {
        let upper = address.to_ascii_uppercase();
        let (area, rest) = if let Some(rest) = upper.strip_prefix("DB") {
            let (block, rest) = rest.split_once(".DB")?;
            (Area::Block(block.parse().ok()?), rest)
        } else {
            let area = match upper.chars().next()? {
                'M' => Area::Flags,
                'I' | 'E' => Area::Inputs,
                'Q' | 'A' => Area::Outputs,
                _ => return None,
            };
            (area, &upper[1..])
        };
        let is_block = matches!(area, Area::Block(_));
        let (size, rest) = match rest.chars().next()? {
            'B' => (1, &rest[1..]),
            'W' => (2, &rest[1..]),
            'D' => (4, &rest[1..]),
            'X' => (0, &rest[1..]),
            digit if digit.is_ascii_digit() && !is_block => (0, rest),
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
            byte: byte.parse().ok()?,
            bit,
            size: size.max(1),
        })
    }

    /// The place of a value of this type.
    ///
    /// # Errors
    /// One sentence that begins with the address: it is none, or holds no value of this type.
    pub fn of(address: &str, data_type: DataType) -> Result<Self, String> {
        let place = Self::parsed(address).ok_or_else(|| {
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
