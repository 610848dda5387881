//! RIHS01 type hashes.
//!
//! Source: REP 2016 and `type_description_interfaces`: SHA-256 of the JSON of a type description, with its keys in
//! the order of the message definition, `", "` and `": "` between tokens, and the referenced types sorted by name.
//! Constants, comments and default values do not enter. An empty type has the one field that IDL needs.

use anyhow::Result;
use sha2::{Digest, Sha256};

use super::{
    interface::{Element, Field, Message, Primitive, Shape},
    package::Interfaces,
};

/// Field that stands in for no fields at all, in the hash and on the wire.
pub const EMPTY_MEMBER: &str = "structure_needs_at_least_one_member";

/// Numbers of `type_description_interfaces/msg/FieldType` added to that of the element.
const ARRAY: u8 = 48;
const BOUNDED_SEQUENCE: u8 = 96;
const SEQUENCE: u8 = 144;
/// Numbers of a nested type and of a text with a bound.
const NESTED: u8 = 1;
const BOUNDED_STRING: u8 = 21;

/// `RIHS01_<64 hex>` of a message, or of a service or action as its description stands for it: it holds request,
/// response and event of a service, and of an action all messages and services of which it consists.
pub fn type_hash(interfaces: &Interfaces, message: &Message) -> Result<String> {
    let mut referenced = Vec::new();
    for nested in interfaces.dependencies(message)? {
        referenced.push((nested.full_name(), description(nested)));
    }
    Ok(rihs01(&description(message), referenced))
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
    let fields: Vec<String> = members(message).iter().map(Member::json).collect();
    format!(
        "{{\"type_name\": \"{}\", \"fields\": [{}]}}",
        message.full_name(),
        fields.join(", ")
    )
}

/// A field as `type_description_interfaces` describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Member<'a> {
    /// Its name.
    pub name: &'a str,
    /// `FieldType` of its element and shape together.
    pub type_id: u8,
    /// Elements that it holds, or may hold; 0: one, or any number.
    pub capacity: usize,
    /// Bytes that its text may have; 0: any number.
    pub string_capacity: usize,
    /// Full name of its type, or empty.
    pub nested_type_name: &'a str,
}

/// The fields of a message, at least one.
pub fn members(message: &Message) -> Vec<Member<'_>> {
    if message.fields.is_empty() {
        return vec![Member {
            name: EMPTY_MEMBER,
            type_id: primitive_number(Primitive::U8),
            capacity: 0,
            string_capacity: 0,
            nested_type_name: "",
        }];
    }
    message.fields.iter().map(member).collect()
}

fn member(field: &Field) -> Member<'_> {
    let (number, string_capacity, nested_type_name) = match &field.element {
        Element::Primitive(primitive) => (primitive_number(*primitive), 0, ""),
        Element::BoundedString(bound) => (BOUNDED_STRING, *bound, ""),
        Element::Nested(name) => (NESTED, 0, name.as_str()),
    };
    let (shape, capacity) = match field.shape {
        Shape::One => (0, 0),
        Shape::Array(length) => (ARRAY, length),
        Shape::Bounded(bound) => (BOUNDED_SEQUENCE, bound),
        Shape::Sequence => (SEQUENCE, 0),
    };
    Member {
        name: &field.name,
        type_id: shape + number,
        capacity,
        string_capacity,
        nested_type_name,
    }
}

impl Member<'_> {
    /// Names are letters, digits, `_` and `/` (checked by the parser), so that JSON needs no escapes.
    fn json(&self) -> String {
        format!(
            "{{\"name\": \"{}\", \"type\": {{\"type_id\": {}, \"capacity\": {}, \
             \"string_capacity\": {}, \"nested_type_name\": \"{}\"}}}}",
            self.name, self.type_id, self.capacity, self.string_capacity, self.nested_type_name
        )
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
