//! A message of another version as one of this: by the names of its fields, with what is new unset.
//!
//! ```text
//!   recorded definition ──┐
//!                         ├─> Migration ── changes(): a line for each field that differs
//!   definition of today ──┘       └─────── migrate(): CDR by the one to CDR by the other
//! ```
//!
//! Numbers keep their value where the new type holds it; a field whose kind has changed (a text that was a number) has no
//! migration. Source of the wire format: OMG DDSI-RTPS 2.3, clause 10.

use thiserror::Error;

use crate::definition::{self, DefinitionError, Type};
use crate::schema::MessageType;

/// Why messages of one definition cannot be read by another.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum MigrationError {
    /// The recorded definition.
    #[error("its definition cannot be read: {0}")]
    Definition(#[from] DefinitionError),
    /// A field of the same name and another kind.
    #[error("the field {0} is of another kind")]
    Kind(String),
    /// No field has the name of one of ours.
    #[error("it has no field of this version")]
    Nothing,
}

/// The bytes of a message do not follow its definition.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the bytes are not of the recorded definition")]
pub struct NotOfDefinition;

/// From the messages of a recorded definition to those of this version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Migration {
    from: Type,
    to: Type,
    changes: Vec<String>,
}

impl Migration {
    /// From a definition (`ros2msg`) to a type of this version.
    ///
    /// # Errors
    /// [`MigrationError`] where the messages cannot be read as that type.
    pub fn new(recorded: &str, to: &MessageType) -> Result<Self, MigrationError> {
        Self::between(to.name, recorded, to.definition)
    }

    /// From a definition to another of the type `name`, such as the fields of a foreign type that are of interest.
    ///
    /// # Errors
    /// [`MigrationError`] where the messages cannot be read as that definition.
    pub fn between(name: &str, recorded: &str, wanted: &str) -> Result<Self, MigrationError> {
        let from = definition::parse(name, recorded)?;
        let to = definition::parse(name, wanted)?;
        if let (Type::Record(from), Type::Record(to)) = (&from, &to)
            && !to.iter().any(|(name, _)| field(from, name).is_some())
        {
            return Err(MigrationError::Nothing);
        }
        let mut changes = Vec::new();
        compare("", &from, &to, &mut changes)?;
        Ok(Self { from, to, changes })
    }

    /// True where both definitions lay out the same bytes.
    pub fn is_identity(&self) -> bool {
        self.from == self.to
    }

    /// What differs, a field each: `name is new`, `name is gone`, `name has another type of number`.
    pub fn changes(&self) -> &[String] {
        &self.changes
    }

    /// A recorded message, header included, in the layout of this version.
    ///
    /// # Errors
    /// Bytes that do not follow the recorded definition.
    pub fn migrate(&self, cdr: &[u8]) -> Result<Vec<u8>, NotOfDefinition> {
        let ([0, order @ (0 | 1), _, _], body) =
            cdr.split_first_chunk::<4>().ok_or(NotOfDefinition)?
        else {
            return Err(NotOfDefinition);
        };
        let mut reader = Reader {
            body,
            at: 0,
            is_little: *order == 1,
        };
        let value = reader.value(&self.from)?;
        let mut writer = Writer(Vec::with_capacity(body.len()));
        writer.value(&self.to, Some((&self.from, &value)));
        Ok([&[0, 1, 0, 0], writer.0.as_slice()].concat())
    }
}

fn field<'a>(fields: &'a [(String, Type)], name: &str) -> Option<(usize, &'a Type)> {
    let mut numbered = fields.iter().enumerate();
    numbered
        .find(|(_, (known, _))| known == name)
        .map(|(index, (_, kind))| (index, kind))
}

fn is_whole(kind: &Type) -> bool {
    use Type::{Bool, I8, I16, I32, I64, U8, U16, U32, U64};
    matches!(kind, Bool | I8 | U8 | I16 | U16 | I32 | U32 | I64 | U64)
}

fn is_number(kind: &Type) -> bool {
    is_whole(kind) || matches!(kind, Type::F32 | Type::F64)
}

/// Notes what differs between two types below a path.
fn compare(
    path: &str,
    from: &Type,
    to: &Type,
    changes: &mut Vec<String>,
) -> Result<(), MigrationError> {
    match (from, to) {
        (Type::Record(from), Type::Record(to)) => {
            let below = |name: &str| match path {
                "" => name.to_owned(),
                path => format!("{path}.{name}"),
            };
            for (name, kind) in to {
                match field(from, name) {
                    Some((_, before)) => compare(&below(name), before, kind, changes)?,
                    None => changes.push(format!("{} is new", below(name))),
                }
            }
            let gone = from.iter().filter(|(name, _)| field(to, name).is_none());
            changes.extend(gone.map(|(name, _)| format!("{} is gone", below(name))));
            Ok(())
        }
        (Type::Array(from, before), Type::Array(to, now)) if before == now => {
            compare(path, from, to, changes)
        }
        (Type::List(from), Type::List(to)) => compare(path, from, to, changes),
        (from, to) if from == to => Ok(()),
        (from, to) if is_number(from) && is_number(to) => {
            changes.push(format!("{path} has another type of number"));
            Ok(())
        }
        _ => Err(MigrationError::Kind(path.to_owned())),
    }
}

/// What a field holds.
enum Datum {
    Whole(i128),
    Real(f64),
    Text(Vec<u8>),
    /// Fields of a message, or elements.
    Several(Vec<Datum>),
}

struct Reader<'a> {
    body: &'a [u8],
    at: usize,
    is_little: bool,
}

impl<'a> Reader<'a> {
    fn bytes(&mut self, count: usize) -> Result<&'a [u8], NotOfDefinition> {
        let end = self.at.checked_add(count).ok_or(NotOfDefinition)?;
        let taken = self.body.get(self.at..end).ok_or(NotOfDefinition)?;
        self.at = end;
        Ok(taken)
    }

    /// The bytes of a number of so many, aligned to its size, least first.
    fn number<const N: usize>(&mut self) -> Result<[u8; N], NotOfDefinition> {
        self.at = self.at.next_multiple_of(N);
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.bytes(N)?);
        if !self.is_little {
            bytes.reverse();
        }
        Ok(bytes)
    }

    fn count(&mut self) -> Result<usize, NotOfDefinition> {
        Ok(u32::from_le_bytes(self.number()?) as usize)
    }

    fn value(&mut self, kind: &Type) -> Result<Datum, NotOfDefinition> {
        Ok(match kind {
            Type::Bool | Type::U8 => Datum::Whole(u8::from_le_bytes(self.number()?).into()),
            Type::I8 => Datum::Whole(i8::from_le_bytes(self.number()?).into()),
            Type::I16 => Datum::Whole(i16::from_le_bytes(self.number()?).into()),
            Type::U16 => Datum::Whole(u16::from_le_bytes(self.number()?).into()),
            Type::I32 => Datum::Whole(i32::from_le_bytes(self.number()?).into()),
            Type::U32 => Datum::Whole(u32::from_le_bytes(self.number()?).into()),
            Type::I64 => Datum::Whole(i64::from_le_bytes(self.number()?).into()),
            Type::U64 => Datum::Whole(u64::from_le_bytes(self.number()?).into()),
            Type::F32 => Datum::Real(f32::from_le_bytes(self.number()?).into()),
            Type::F64 => Datum::Real(f64::from_le_bytes(self.number()?)),
            Type::Text => {
                let count = self.count()?;
                // With the zero at its end; some writers count none for an empty text.
                let text = self.bytes(count)?;
                Datum::Text(text.strip_suffix(&[0]).unwrap_or(text).to_vec())
            }
            Type::Time | Type::Duration => {
                Datum::Several(vec![self.value(&Type::I32)?, self.value(&Type::U32)?])
            }
            Type::Record(fields) => {
                let values = fields.iter().map(|(_, kind)| self.value(kind));
                Datum::Several(values.collect::<Result<_, _>>()?)
            }
            Type::Array(element, length) => self.several(element, *length)?,
            Type::List(element) => {
                let count = self.count()?;
                self.several(element, count)?
            }
        })
    }

    fn several(&mut self, element: &Type, count: usize) -> Result<Datum, NotOfDefinition> {
        // Every element takes a byte at least.
        if count > self.body.len() - self.at.min(self.body.len()) {
            return Err(NotOfDefinition);
        }
        let elements = (0..count).map(|_| self.value(element));
        Ok(Datum::Several(elements.collect::<Result<_, _>>()?))
    }
}

/// Little endian.
struct Writer(Vec<u8>);

impl Writer {
    fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        self.0.resize(self.0.len().next_multiple_of(N), 0);
        self.0.extend(bytes);
    }

    fn text(&mut self, text: &[u8]) {
        self.number((text.len() as u32 + 1).to_le_bytes());
        self.0.extend(text);
        self.0.push(0);
    }

    /// A value as one of a type; without it, what an unset field holds.
    fn value(&mut self, kind: &Type, held: Option<(&Type, &Datum)>) {
        let datum = held.map(|(_, datum)| datum);
        match kind {
            Type::F32 => self.number((real(datum) as f32).to_le_bytes()),
            Type::F64 => self.number(real(datum).to_le_bytes()),
            Type::Text => match datum {
                Some(Datum::Text(text)) => self.text(text),
                _ => self.text(b""),
            },
            Type::Time | Type::Duration => {
                let parts = elements(datum);
                for (kind, index) in [(Type::I32, 0), (Type::U32, 1)] {
                    self.whole(&kind, whole(parts.get(index)));
                }
            }
            Type::Record(fields) => {
                let from = match held {
                    Some((Type::Record(from), Datum::Several(values))) => Some((from, values)),
                    _ => None,
                };
                for (name, kind) in fields {
                    let known = from.and_then(|(from, values)| {
                        let (index, before) = field(from, name)?;
                        Some((before, values.get(index)?))
                    });
                    self.value(kind, known);
                }
            }
            Type::Array(element, length) => {
                let before = held.and_then(|(kind, _)| element_of(kind));
                for index in 0..*length {
                    let known = before.zip(elements(datum).get(index));
                    self.value(element, known);
                }
            }
            Type::List(element) => {
                let before = held.and_then(|(kind, _)| element_of(kind));
                let values = elements(datum);
                self.number((values.len() as u32).to_le_bytes());
                for value in values {
                    self.value(element, before.map(|before| (before, value)));
                }
            }
            whole_kind => self.whole(whole_kind, whole(datum)),
        }
    }

    /// A whole number; the nearest that the type holds.
    fn whole(&mut self, kind: &Type, value: i128) {
        let within = |least: i128, most: i128| value.clamp(least, most);
        match kind {
            Type::Bool => self.number([u8::from(value != 0)]),
            Type::U8 => self.number((within(0, u8::MAX.into()) as u8).to_le_bytes()),
            Type::I8 => self.number((within(i8::MIN.into(), i8::MAX.into()) as i8).to_le_bytes()),
            Type::U16 => self.number((within(0, u16::MAX.into()) as u16).to_le_bytes()),
            Type::I16 => {
                self.number((within(i16::MIN.into(), i16::MAX.into()) as i16).to_le_bytes());
            }
            Type::U32 => self.number((within(0, u32::MAX.into()) as u32).to_le_bytes()),
            Type::I32 => {
                self.number((within(i32::MIN.into(), i32::MAX.into()) as i32).to_le_bytes());
            }
            Type::U64 => self.number((within(0, u64::MAX.into()) as u64).to_le_bytes()),
            _ => self.number((within(i64::MIN.into(), i64::MAX.into()) as i64).to_le_bytes()),
        }
    }
}

fn element_of(kind: &Type) -> Option<&Type> {
    match kind {
        Type::Array(element, _) | Type::List(element) => Some(element),
        _ => None,
    }
}

fn elements(datum: Option<&Datum>) -> &[Datum] {
    match datum {
        Some(Datum::Several(values)) => values,
        _ => &[],
    }
}

fn whole(datum: Option<&Datum>) -> i128 {
    match datum {
        Some(Datum::Whole(value)) => *value,
        // A real number becomes the nearest whole one.
        Some(Datum::Real(value)) => value.round() as i128,
        _ => 0,
    }
}

fn real(datum: Option<&Datum>) -> f64 {
    match datum {
        Some(Datum::Whole(value)) => *value as f64,
        Some(Datum::Real(value)) => *value,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Message, ProbeEvent, all, from_cdr, sensor_msgs::JointState, to_cdr};

    #[test]
    fn a_definition_of_today_changes_nothing() {
        for kind in all() {
            let migration = Migration::new(kind.definition, kind).unwrap();
            assert!(migration.changes().is_empty(), "{}", kind.name);
        }
        let mut state = JointState {
            name: vec!["X".to_owned(), "A1".to_owned()],
            position: vec![0.25, -1.5],
            ..JointState::default()
        };
        state.header.frame_id = "foundation".to_owned();
        state.header.stamp.nanosec = 7;
        let migration = Migration::new(JointState::TYPE.definition, JointState::TYPE).unwrap();
        assert_eq!(migration.migrate(&to_cdr(&state)).unwrap(), to_cdr(&state));
    }

    /// A field that was not there is unset, one that is gone is left out, numbers keep their value, the order may be another.
    #[test]
    fn fields_are_taken_by_their_names() {
        const BEFORE: &str = "float32[] position\nstring note\nstd_msgs/Header header\nstring[] name\n\
            ================================================================================\n\
            MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
        let migration = Migration::new(BEFORE, JointState::TYPE).unwrap();
        let changes = [
            "position has another type of number",
            "velocity is new",
            "effort is new",
            "note is gone",
        ];
        assert_eq!(migration.changes(), changes);
        // Written by hand: two floats, "ab", stamp 3 s 4 ns, frame "w", one name "X".
        let mut bytes = vec![0, 1, 0, 0, 2, 0, 0, 0];
        bytes.extend([0.5_f32.to_le_bytes(), (-2.0_f32).to_le_bytes()].concat());
        bytes.extend([3, 0, 0, 0, b'a', b'b', 0, 0]);
        bytes.extend([3, 0, 0, 0, 4, 0, 0, 0, 2, 0, 0, 0, b'w', 0, 0, 0]);
        bytes.extend([1, 0, 0, 0, 2, 0, 0, 0, b'X', 0]);
        let read: JointState = from_cdr(&migration.migrate(&bytes).unwrap()).unwrap();
        let mut expected = JointState {
            name: vec!["X".to_owned()],
            position: vec![0.5, -2.0],
            ..JointState::default()
        };
        (expected.header.stamp.sec, expected.header.stamp.nanosec) = (3, 4);
        expected.header.frame_id = "w".to_owned();
        assert_eq!(read, expected);
        for cut in 0..bytes.len() - 1 {
            assert_eq!(
                migration.migrate(&bytes[..cut]),
                Err(NotOfDefinition),
                "{cut}"
            );
        }
    }

    #[test]
    fn a_field_of_another_kind_and_a_type_of_another_meaning_are_refused() {
        let kind = Migration::new("string[] position\n", JointState::TYPE);
        assert_eq!(kind, Err(MigrationError::Kind("position".to_owned())));
        let other = Migration::new("float64 torque\n", ProbeEvent::TYPE);
        assert_eq!(other, Err(MigrationError::Nothing));
        assert!(Migration::new("Unknown a\n", ProbeEvent::TYPE).is_err());
    }

    #[test]
    fn a_short_definition_of_very_many_fields_is_refused() {
        let rule = "=".repeat(80);
        let twice = |depth| format!("{rule}\nMSG: a/T{depth}\nT{0} one\nT{0} other\n", depth + 1);
        let nested: String = (0..30).map(twice).collect();
        let definition = format!("T0 position\n{nested}{rule}\nMSG: a/T30\nfloat64 x\n");
        let refused = Migration::between("a/msg/Many", &definition, "float64 position\n");
        assert!(
            refused
                .unwrap_err()
                .to_string()
                .contains("more than 10000 fields")
        );
    }
}
