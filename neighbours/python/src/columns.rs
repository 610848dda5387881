//! Messages of one type as Arrow columns, read from their CDR bytes without a struct for them.

use std::sync::Arc;

use anyhow::{Context, bail};
use arrow_array::builder::{BooleanBuilder, PrimitiveBuilder, StringBuilder};
use arrow_array::types::{
    DurationNanosecondType, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type,
    TimestampNanosecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{ArrayRef, FixedSizeListArray, ListArray, StructArray};
use arrow_buffer::OffsetBuffer;
use arrow_schema::{DataType, Field, FieldRef, TimeUnit};
use byteorder::{BigEndian, ByteOrder, LittleEndian};
use cdr_encoding::CdrDeserializer;
use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, SeqAccess, Visitor};

use probecell_msgs::definition::Type;

const SECOND: i64 = 1_000_000_000;

/// A column that grows by one value for each message.
pub(crate) enum Column {
    Bool(BooleanBuilder),
    I8(PrimitiveBuilder<Int8Type>),
    U8(PrimitiveBuilder<UInt8Type>),
    I16(PrimitiveBuilder<Int16Type>),
    U16(PrimitiveBuilder<UInt16Type>),
    I32(PrimitiveBuilder<Int32Type>),
    U32(PrimitiveBuilder<UInt32Type>),
    I64(PrimitiveBuilder<Int64Type>),
    U64(PrimitiveBuilder<UInt64Type>),
    F32(PrimitiveBuilder<Float32Type>),
    F64(PrimitiveBuilder<Float64Type>),
    Text(StringBuilder),
    Time(PrimitiveBuilder<TimestampNanosecondType>),
    Duration(PrimitiveBuilder<DurationNanosecondType>),
    Record(Vec<(String, Column)>),
    List(Vec<i32>, Box<Column>),
    Array(usize, Box<Column>),
}

/// Instants, ns since 1970, UTC.
pub(crate) fn instants() -> DataType {
    DataType::Timestamp(TimeUnit::Nanosecond, Some("UTC".into()))
}

impl Column {
    /// An empty column of a type.
    pub(crate) fn new(of: &Type) -> Self {
        match of {
            Type::Bool => Self::Bool(BooleanBuilder::new()),
            Type::I8 => Self::I8(PrimitiveBuilder::new()),
            Type::U8 => Self::U8(PrimitiveBuilder::new()),
            Type::I16 => Self::I16(PrimitiveBuilder::new()),
            Type::U16 => Self::U16(PrimitiveBuilder::new()),
            Type::I32 => Self::I32(PrimitiveBuilder::new()),
            Type::U32 => Self::U32(PrimitiveBuilder::new()),
            Type::I64 => Self::I64(PrimitiveBuilder::new()),
            Type::U64 => Self::U64(PrimitiveBuilder::new()),
            Type::F32 => Self::F32(PrimitiveBuilder::new()),
            Type::F64 => Self::F64(PrimitiveBuilder::new()),
            Type::Text => Self::Text(StringBuilder::new()),
            Type::Time => Self::Time(PrimitiveBuilder::new().with_data_type(instants())),
            Type::Duration => Self::Duration(PrimitiveBuilder::new()),
            Type::Record(fields) => Self::Record(
                fields
                    .iter()
                    .map(|(name, of)| (name.clone(), Self::new(of)))
                    .collect(),
            ),
            Type::List(of) => Self::List(vec![0], Box::new(Self::new(of))),
            Type::Array(of, length) => Self::Array(*length, Box::new(Self::new(of))),
        }
    }

    /// Adds a message: CDR with its header of four bytes.
    ///
    /// # Errors
    /// The bytes are not of the column's type, and the column is of no use any more.
    pub(crate) fn add(&mut self, payload: &[u8]) -> anyhow::Result<()> {
        let Some(([first, second, ..], body)) = payload.split_first_chunk::<4>() else {
            bail!("{} bytes are too few for a CDR header", payload.len());
        };
        match u16::from_be_bytes([*first, *second]) {
            0 => self.read::<BigEndian>(body),
            1 => self.read::<LittleEndian>(body),
            other => bail!("representation {other:#06x} is not plain CDR"),
        }
    }

    fn read<Order: ByteOrder>(&mut self, body: &[u8]) -> anyhow::Result<()> {
        let mut bytes = CdrDeserializer::<Order>::new(body);
        Ok(self.deserialize(&mut bytes)?)
    }

    /// Number of values.
    fn len(&self) -> usize {
        use arrow_array::builder::ArrayBuilder;
        match self {
            Self::Bool(values) => values.len(),
            Self::I8(values) => values.len(),
            Self::U8(values) => values.len(),
            Self::I16(values) => values.len(),
            Self::U16(values) => values.len(),
            Self::I32(values) => values.len(),
            Self::U32(values) => values.len(),
            Self::I64(values) => values.len(),
            Self::U64(values) => values.len(),
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
            Self::Text(values) => values.len(),
            Self::Time(values) => values.len(),
            Self::Duration(values) => values.len(),
            Self::Record(fields) => fields.first().map_or(0, |(_, field)| field.len()),
            Self::List(offsets, _) => offsets.len() - 1,
            Self::Array(length, values) => values.len() / length,
        }
    }

    /// The values as one array.
    ///
    /// # Errors
    /// More elements in lists than Arrow counts (2³¹).
    fn array(mut self) -> anyhow::Result<ArrayRef> {
        Ok(match &mut self {
            Self::Bool(values) => Arc::new(values.finish()),
            Self::I8(values) => Arc::new(values.finish()),
            Self::U8(values) => Arc::new(values.finish()),
            Self::I16(values) => Arc::new(values.finish()),
            Self::U16(values) => Arc::new(values.finish()),
            Self::I32(values) => Arc::new(values.finish()),
            Self::U32(values) => Arc::new(values.finish()),
            Self::I64(values) => Arc::new(values.finish()),
            Self::U64(values) => Arc::new(values.finish()),
            Self::F32(values) => Arc::new(values.finish()),
            Self::F64(values) => Arc::new(values.finish()),
            Self::Text(values) => Arc::new(values.finish()),
            Self::Time(values) => Arc::new(values.finish()),
            Self::Duration(values) => Arc::new(values.finish()),
            _ => return self.nested(),
        })
    }

    fn nested(self) -> anyhow::Result<ArrayRef> {
        Ok(match self {
            Self::Record(fields) => {
                let mut pairs: Vec<(FieldRef, ArrayRef)> = Vec::new();
                for (name, column) in fields {
                    let array = column.array()?;
                    let field = Field::new(name, array.data_type().clone(), false);
                    pairs.push((Arc::new(field), array));
                }
                Arc::new(StructArray::from(pairs))
            }
            Self::List(offsets, values) => {
                let values = values.array()?;
                let field = Arc::new(Field::new("item", values.data_type().clone(), false));
                let offsets = OffsetBuffer::new(offsets.into());
                Arc::new(ListArray::try_new(field, offsets, values, None)?)
            }
            Self::Array(length, values) => {
                let values = values.array()?;
                let field = Arc::new(Field::new("item", values.data_type().clone(), false));
                let length =
                    i32::try_from(length).context("an array is longer than Arrow counts")?;
                Arc::new(FixedSizeListArray::try_new(field, length, values, None)?)
            }
            single => single.array()?,
        })
    }

    /// Name and array of each column of a message: fields of messages within it are columns of their own, named as in
    /// `header.frame_id`; elements of lists stay together.
    ///
    /// # Errors
    /// As [`Column::array`].
    pub(crate) fn columns(self, name: &str) -> anyhow::Result<Vec<(String, ArrayRef)>> {
        let Self::Record(fields) = self else {
            return Ok(vec![(name.to_owned(), self.array()?)]);
        };
        let mut columns = Vec::new();
        for (field, column) in fields {
            let dot = if name.is_empty() { "" } else { "." };
            columns.extend(column.columns(&format!("{name}{dot}{field}"))?);
        }
        Ok(columns)
    }
}

/// Reads one value into the column.
impl<'de> DeserializeSeed<'de> for &mut Column {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, bytes: D) -> Result<(), D::Error> {
        match self {
            Column::Bool(values) => values.append_value(bool::deserialize(bytes)?),
            Column::I8(values) => values.append_value(i8::deserialize(bytes)?),
            Column::U8(values) => values.append_value(u8::deserialize(bytes)?),
            Column::I16(values) => values.append_value(i16::deserialize(bytes)?),
            Column::U16(values) => values.append_value(u16::deserialize(bytes)?),
            Column::I32(values) => values.append_value(i32::deserialize(bytes)?),
            Column::U32(values) => values.append_value(u32::deserialize(bytes)?),
            Column::I64(values) => values.append_value(i64::deserialize(bytes)?),
            Column::U64(values) => values.append_value(u64::deserialize(bytes)?),
            Column::F32(values) => values.append_value(f32::deserialize(bytes)?),
            Column::F64(values) => values.append_value(f64::deserialize(bytes)?),
            Column::Text(values) => values.append_value(String::deserialize(bytes)?),
            Column::Time(values) => values.append_value(nanoseconds(bytes)?),
            Column::Duration(values) => values.append_value(nanoseconds(bytes)?),
            Column::Record(fields) => {
                let count = fields.len();
                bytes.deserialize_tuple(count, Fields(fields))?;
            }
            Column::List(offsets, values) => {
                bytes.deserialize_seq(Elements(values))?;
                let end = i32::try_from(values.len());
                offsets.push(end.map_err(|_| D::Error::custom("too many elements in lists"))?);
            }
            Column::Array(length, values) => {
                bytes.deserialize_tuple(*length, Elements(values))?;
            }
        }
        Ok(())
    }
}

/// Seconds and nanoseconds as nanoseconds.
fn nanoseconds<'de, D: Deserializer<'de>>(bytes: D) -> Result<i64, D::Error> {
    let (seconds, nanoseconds) = <(i32, u32)>::deserialize(bytes)?;
    Ok(i64::from(seconds) * SECOND + i64::from(nanoseconds))
}

struct Fields<'a>(&'a mut [(String, Column)]);

impl<'de> Visitor<'de> for Fields<'_> {
    type Value = ();

    fn expecting(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "a message of {} fields", self.0.len())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut bytes: A) -> Result<(), A::Error> {
        for (name, column) in self.0 {
            let read = bytes.next_element_seed(column);
            let read = read.map_err(|error| A::Error::custom(format!("{name}: {error}")))?;
            read.ok_or_else(|| A::Error::custom(format!("{name}: no value")))?;
        }
        Ok(())
    }
}

struct Elements<'a>(&'a mut Column);

impl<'de> Visitor<'de> for Elements<'_> {
    type Value = ();

    fn expecting(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("a sequence")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut bytes: A) -> Result<(), A::Error> {
        while bytes.next_element_seed(&mut *self.0)?.is_some() {}
        Ok(())
    }
}
