//! The part of Sparkplug's payload (`sparkplug_b.proto` of Eclipse Tahu) that a cell uses; field numbers are those of that file.

use prost::{Message, Oneof};

/// What a metric holds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    /// Data type `Double`.
    Quantity(f64),
    /// Data type `UInt64`.
    Number(u64),
    /// Data type `Boolean`.
    Flag(bool),
    /// Data type `String`.
    Text(String),
    /// A `Double` that is not known.
    Nothing,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Payload {
    /// ms since 1970, UTC.
    #[prost(uint64, optional, tag = "1")]
    pub(super) timestamp: Option<u64>,
    #[prost(message, repeated, tag = "2")]
    pub(super) metrics: Vec<Metric>,
    #[prost(uint64, optional, tag = "3")]
    pub(super) seq: Option<u64>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Metric {
    #[prost(string, optional, tag = "1")]
    name: Option<String>,
    #[prost(uint64, optional, tag = "3")]
    timestamp: Option<u64>,
    #[prost(uint32, optional, tag = "4")]
    datatype: Option<u32>,
    #[prost(bool, optional, tag = "7")]
    is_null: Option<bool>,
    #[prost(message, optional, tag = "9")]
    properties: Option<PropertySet>,
    #[prost(oneof = "Content", tags = "11, 13, 14, 15")]
    value: Option<Content>,
}

#[derive(Clone, PartialEq, Oneof)]
enum Content {
    #[prost(uint64, tag = "11")]
    Long(u64),
    #[prost(double, tag = "13")]
    Double(f64),
    #[prost(bool, tag = "14")]
    Boolean(bool),
    #[prost(string, tag = "15")]
    String(String),
}

#[derive(Clone, PartialEq, Message)]
struct PropertySet {
    #[prost(string, repeated, tag = "1")]
    keys: Vec<String>,
    #[prost(message, repeated, tag = "2")]
    values: Vec<PropertyValue>,
}

#[derive(Clone, PartialEq, Message)]
struct PropertyValue {
    /// Data type.
    #[prost(uint32, optional, tag = "1")]
    kind: Option<u32>,
    #[prost(string, optional, tag = "8")]
    text: Option<String>,
}

/// Numbers of data types (section 6.4.16 of the specification).
const UINT64: u32 = 8;
const DOUBLE: u32 = 10;
const BOOLEAN: u32 = 11;
const STRING: u32 = 12;

impl Metric {
    pub(super) fn new(name: &str, value: &Value, timestamp: Option<u64>) -> Self {
        let (datatype, value) = match value {
            Value::Quantity(value) => (DOUBLE, Some(Content::Double(*value))),
            Value::Number(value) => (UINT64, Some(Content::Long(*value))),
            Value::Flag(value) => (BOOLEAN, Some(Content::Boolean(*value))),
            Value::Text(text) => (STRING, Some(Content::String(text.clone()))),
            Value::Nothing => (DOUBLE, None),
        };
        Self {
            name: Some(name.to_owned()),
            timestamp,
            datatype: Some(datatype),
            is_null: value.is_none().then_some(true),
            properties: None,
            value,
        }
    }

    /// The same with its unit; none where it is empty.
    pub(super) fn with_unit(self, unit: &str) -> Self {
        let property = PropertyValue {
            kind: Some(STRING),
            text: Some(unit.to_owned()),
        };
        let properties = PropertySet {
            keys: vec!["engUnit".to_owned()],
            values: vec![property],
        };
        Self {
            properties: (!unit.is_empty()).then_some(properties),
            ..self
        }
    }
}

impl Payload {
    pub(super) fn bytes(&self) -> Vec<u8> {
        self.encode_to_vec()
    }
}

/// Whether a command sets this flag; what is no payload does not.
pub(super) fn asks_for(payload: &[u8], name: &str) -> bool {
    let decoded = Payload::decode(payload).unwrap_or_default();
    decoded.metrics.iter().any(|metric| {
        metric.name.as_deref() == Some(name) && metric.value == Some(Content::Boolean(true))
    })
}
