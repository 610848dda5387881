//! Any message as a tree of named values, to print two of them side by side.
//!
//! Numbers print in the shortest form that reads back to the same bits (NaN payloads aside), so that values that
//! differ look different.

use std::fmt::{self, Display};

use serde::{
    Serialize, Serializer,
    de::value::Error,
    ser::{Error as _, Impossible, SerializeSeq, SerializeStruct, SerializeTuple},
};

use crate::{CdrError, Message, from_cdr};

/// A value inside a message.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A `bool`.
    Bool(bool),
    /// Any integer; wide enough for all of ROS.
    Integer(i128),
    /// A `float32` or `float64`.
    Float(f64),
    /// A `string`.
    Text(String),
    /// Elements of an array or sequence.
    List(Vec<Value>),
    /// Fields of a message, in order.
    Record(Vec<(&'static str, Value)>),
}

impl Value {
    /// The tree of a message.
    pub fn of(message: &impl Message) -> Self {
        message
            .serialize(Tree)
            .expect("messages hold numbers, texts, sequences and messages only")
    }

    /// Path and value of every leaf, in order: `("points[3].normal.x", "0.5")`. An empty list is a leaf, `[]`.
    pub fn leaves(&self) -> Vec<(String, String)> {
        let mut leaves = Vec::new();
        self.collect("", &mut leaves);
        leaves
    }

    fn collect(&self, path: &str, leaves: &mut Vec<(String, String)>) {
        match self {
            Self::List(elements) if !elements.is_empty() => {
                for (index, element) in elements.iter().enumerate() {
                    element.collect(&format!("{path}[{index}]"), leaves);
                }
            }
            Self::Record(fields) => {
                for (name, field) in fields {
                    let dot = if path.is_empty() { "" } else { "." };
                    field.collect(&format!("{path}{dot}{name}"), leaves);
                }
            }
            leaf => leaves.push((path.to_owned(), leaf.to_string())),
        }
    }
}

impl Display for Value {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => write!(formatter, "{value}"),
            Self::Integer(value) => write!(formatter, "{value}"),
            Self::Float(value) => write!(formatter, "{value:?}"),
            Self::Text(value) => write!(formatter, "{value:?}"),
            Self::List(elements) => {
                formatter.write_str("[")?;
                for (index, element) in elements.iter().enumerate() {
                    write!(formatter, "{}{element}", if index == 0 { "" } else { ", " })?;
                }
                formatter.write_str("]")
            }
            Self::Record(fields) => {
                formatter.write_str("{")?;
                for (index, (name, field)) in fields.iter().enumerate() {
                    write!(
                        formatter,
                        "{}{name}: {field}",
                        if index == 0 { "" } else { ", " }
                    )?;
                }
                formatter.write_str("}")
            }
        }
    }
}

/// Decodes and describes a message of type `M`.
pub(crate) fn of<M: Message>(cdr: &[u8]) -> Result<Value, CdrError> {
    from_cdr::<M>(cdr).map(|message| Value::of(&message))
}

/// Turns what the derived `Serialize` of a message says into a tree.
struct Tree;

struct ListBuilder(Vec<Value>);

struct RecordBuilder(Vec<(&'static str, Value)>);

/// What messages never hold.
fn foreign<T>(what: &str) -> Result<T, Error> {
    Err(Error::custom(format!("a message holds no {what}")))
}

macro_rules! integers {
    ($($method:ident: $ty:ty),*) => {
        $(fn $method(self, value: $ty) -> Result<Value, Error> {
            Ok(Value::Integer(i128::from(value)))
        })*
    };
}

impl Serializer for Tree {
    type Ok = Value;
    type Error = Error;
    type SerializeSeq = ListBuilder;
    type SerializeTuple = ListBuilder;
    type SerializeStruct = RecordBuilder;
    type SerializeTupleStruct = Impossible<Value, Error>;
    type SerializeTupleVariant = Impossible<Value, Error>;
    type SerializeMap = Impossible<Value, Error>;
    type SerializeStructVariant = Impossible<Value, Error>;

    integers!(
        serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64
    );

    fn serialize_bool(self, value: bool) -> Result<Value, Error> {
        Ok(Value::Bool(value))
    }

    fn serialize_f32(self, value: f32) -> Result<Value, Error> {
        Ok(Value::Float(f64::from(value)))
    }

    fn serialize_f64(self, value: f64) -> Result<Value, Error> {
        Ok(Value::Float(value))
    }

    fn serialize_str(self, value: &str) -> Result<Value, Error> {
        Ok(Value::Text(value.to_owned()))
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<ListBuilder, Error> {
        Ok(ListBuilder(Vec::new()))
    }

    fn serialize_tuple(self, _: usize) -> Result<ListBuilder, Error> {
        Ok(ListBuilder(Vec::new()))
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<RecordBuilder, Error> {
        Ok(RecordBuilder(Vec::new()))
    }

    fn serialize_char(self, _: char) -> Result<Value, Error> {
        foreign("character")
    }

    fn serialize_bytes(self, _: &[u8]) -> Result<Value, Error> {
        foreign("byte string")
    }

    fn serialize_none(self) -> Result<Value, Error> {
        foreign("option")
    }

    fn serialize_some<T: ?Sized + Serialize>(self, _: &T) -> Result<Value, Error> {
        foreign("option")
    }

    fn serialize_unit(self) -> Result<Value, Error> {
        foreign("unit")
    }

    fn serialize_unit_struct(self, _: &'static str) -> Result<Value, Error> {
        foreign("unit")
    }

    fn serialize_unit_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
    ) -> Result<Value, Error> {
        foreign("enumeration")
    }

    fn serialize_newtype_struct<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<Value, Error> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: &T,
    ) -> Result<Value, Error> {
        foreign("enumeration")
    }

    fn serialize_tuple_struct(
        self,
        _: &'static str,
        _: usize,
    ) -> Result<Self::SerializeTupleStruct, Error> {
        foreign("tuple")
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Self::SerializeTupleVariant, Error> {
        foreign("enumeration")
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Self::SerializeMap, Error> {
        foreign("map")
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Self::SerializeStructVariant, Error> {
        foreign("enumeration")
    }
}

impl SerializeSeq for ListBuilder {
    type Ok = Value;
    type Error = Error;

    fn serialize_element<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Error> {
        self.0.push(value.serialize(Tree)?);
        Ok(())
    }

    fn end(self) -> Result<Value, Error> {
        Ok(Value::List(self.0))
    }
}

impl SerializeTuple for ListBuilder {
    type Ok = Value;
    type Error = Error;

    fn serialize_element<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Error> {
        SerializeSeq::serialize_element(self, value)
    }

    fn end(self) -> Result<Value, Error> {
        SerializeSeq::end(self)
    }
}

impl SerializeStruct for RecordBuilder {
    type Ok = Value;
    type Error = Error;

    fn serialize_field<T: ?Sized + Serialize>(
        &mut self,
        name: &'static str,
        value: &T,
    ) -> Result<(), Error> {
        self.0.push((name, value.serialize(Tree)?));
        Ok(())
    }

    fn end(self) -> Result<Value, Error> {
        Ok(Value::Record(self.0))
    }
}
