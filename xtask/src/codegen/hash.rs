//! RIHS01 type hashes.
//!
//! Source: REP 2016 and `type_description_interfaces`: SHA-256 of the JSON of a type description, with its keys in
//! the order of the message definition, `", "` and `": "` between tokens, and the referenced types sorted by name.
//! Constants, comments and default values do not enter. An empty type has the one field that IDL needs.

use anyhow::Result;
use sha2::{Digest, Sha256};

use super::{
    interface::{Element, Field, Message, Primitive, Service, Shape},
    package::Interfaces,
};

/// Field that stands in for no fields at all, in the hash and on the wire.
pub const EMPTY_MEMBER: &str = "structure_needs_at_least_one_member";

/// Numbers of `type_description_interfaces/msg/FieldType` added to that of the element.
const ARRAY: u8 = 48;
const BOUNDED_SEQUENCE: u8 = 96;
const SEQUENCE: u8 = 144;
/// Number of a nested type.
const NESTED: u8 = 1;

/// `RIHS01_<64 hex>` of a message.
pub fn message_hash(interfaces: &Interfaces, message: &Message) -> Result<String> {
    let mut referenced = Vec::new();
    for nested in interfaces.dependencies(message)? {
        referenced.push((nested.full_name(), description(nested)));
    }
    Ok(rihs01(&description(message), referenced))
}

/// `RIHS01_<64 hex>` of a service: of its description with request, response and event types.
pub fn service_hash(interfaces: &Interfaces, service: &Service) -> Result<String> {
    let base = format!("{}/srv/{}", service.package, service.name);
    let [request, response, event] =
        ["Request", "Response", "Event"].map(|part| format!("{base}_{part}"));
    let info = interfaces.message("service_msgs/msg/ServiceEventInfo")?;
    let description_of_service = structure(
        &base,
        &[
            field("request_message", NESTED, 0, &request),
            field("response_message", NESTED, 0, &response),
            field("event_message", NESTED, 0, &event),
        ],
    );
    let description_of_event = structure(
        &event,
        &[
            field("info", NESTED, 0, &info.full_name()),
            field("request", BOUNDED_SEQUENCE + NESTED, 1, &request),
            field("response", BOUNDED_SEQUENCE + NESTED, 1, &response),
        ],
    );
    let mut referenced = vec![(event.clone(), description_of_event)];
    for part in [&service.request, &service.response, info] {
        referenced.push((part.full_name(), description(part)));
        for nested in interfaces.dependencies(part)? {
            referenced.push((nested.full_name(), description(nested)));
        }
    }
    Ok(rihs01(&description_of_service, referenced))
}

fn rihs01(description: &str, mut referenced: Vec<(String, String)>) -> String {
    referenced.sort();
    referenced.dedup();
    let referenced: Vec<String> = referenced
        .into_iter()
        .map(|(_, description)| description)
        .collect();
    let json = format!(
        "{{\"type_description\": {description}, \"referenced_type_descriptions\": [{}]}}",
        referenced.join(", ")
    );
    format!("RIHS01_{:x}", Sha256::digest(json.as_bytes()))
}

fn description(message: &Message) -> String {
    let mut fields: Vec<String> = message.fields.iter().map(field_of).collect();
    if fields.is_empty() {
        fields.push(field(EMPTY_MEMBER, primitive_number(Primitive::U8), 0, ""));
    }
    structure(&message.full_name(), &fields)
}

fn field_of(source: &Field) -> String {
    let (number, nested) = match &source.element {
        Element::Primitive(primitive) => (primitive_number(*primitive), ""),
        Element::Nested(name) => (NESTED, name.as_str()),
    };
    match source.shape {
        Shape::One => field(&source.name, number, 0, nested),
        Shape::Array(length) => field(&source.name, ARRAY + number, length, nested),
        Shape::Sequence => field(&source.name, SEQUENCE + number, 0, nested),
    }
}

fn primitive_number(primitive: Primitive) -> u8 {
    match primitive {
        Primitive::I8 => 2,
        Primitive::U8 => 3,
        Primitive::I16 => 4,
        Primitive::U16 => 5,
        Primitive::I32 => 6,
        Primitive::U32 => 7,
        Primitive::I64 => 8,
        Primitive::U64 => 9,
        Primitive::F32 => 10,
        Primitive::F64 => 11,
        Primitive::Bool => 15,
        Primitive::Byte => 16,
        Primitive::String => 17,
    }
}

/// Names are letters, digits, `_` and `/` (checked by the parser), so that JSON needs no escapes.
fn field(name: &str, number: u8, capacity: usize, nested: &str) -> String {
    format!(
        "{{\"name\": \"{name}\", \"type\": {{\"type_id\": {number}, \"capacity\": {capacity}, \
         \"string_capacity\": 0, \"nested_type_name\": \"{nested}\"}}}}"
    )
}

fn structure(name: &str, fields: &[String]) -> String {
    format!(
        "{{\"type_name\": \"{name}\", \"fields\": [{}]}}",
        fields.join(", ")
    )
}
