//! Definitions of message types (`ros2msg`) as a tree of types, so that any topic of a recording can be read.
//!
//! Source: ROS 2 interface definitions (`.msg`) as MCAP keeps them: the type's own text, then each type it uses after a line of
//! 80 `=` and `MSG: package/Type`. Constants and default values carry no data and are passed over.

use std::collections::BTreeMap;

use thiserror::Error;

/// Depth beyond which a type contains itself.
const DEEPEST: usize = 32;
/// Fields of a whole definition, with those of the types in it each time that they are used.
const MOST_FIELDS: usize = 10_000;

/// Why a text is no definition of a message type.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct DefinitionError(String);

fn refused<T>(text: String) -> Result<T, DefinitionError> {
    Err(DefinitionError(text))
}

/// A type of a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Type {
    /// `bool`
    Bool,
    /// `int8`
    I8,
    /// `uint8`, `byte`, `char`
    U8,
    /// `int16`
    I16,
    /// `uint16`
    U16,
    /// `int32`
    I32,
    /// `uint32`
    U32,
    /// `int64`
    I64,
    /// `uint64`
    U64,
    /// `float32`
    F32,
    /// `float64`
    F64,
    /// `string`
    Text,
    /// `builtin_interfaces/Time`: seconds (i32) and nanoseconds (u32) since 1970.
    Time,
    /// `builtin_interfaces/Duration`: the same of a duration.
    Duration,
    /// Fields of a message, by name.
    Record(Vec<(String, Type)>),
    /// A sequence of any length.
    List(Box<Type>),
    /// An array of a fixed length.
    Array(Box<Type>, usize),
}

/// The type of a whole definition, whose name is `package/msg/Type`.
///
/// # Errors
/// A line that is no field, a type that is not defined, or one that contains itself.
pub fn parse(name: &str, definition: &str) -> Result<Type, DefinitionError> {
    let mut texts: BTreeMap<String, String> = BTreeMap::new();
    let mut current = short(name);
    let mut text = String::new();
    for line in definition.lines() {
        let rule = line.len() >= 10 && line.chars().all(|letter| letter == '=');
        if let Some(next) = line.strip_prefix("MSG:") {
            texts.insert(
                std::mem::replace(&mut current, short(next.trim())),
                std::mem::take(&mut text),
            );
        } else if !rule {
            text.push_str(line);
            text.push('\n');
        }
    }
    texts.insert(current, text);
    let mut left = MOST_FIELDS;
    record(&short(name), &texts, 0, &mut left)
}

/// `package/Type` of a name with or without `msg` in between.
fn short(name: &str) -> String {
    match name.split('/').collect::<Vec<_>>().as_slice() {
        [package, _, own] => format!("{package}/{own}"),
        _ => name.to_owned(),
    }
}

fn record(
    name: &str,
    texts: &BTreeMap<String, String>,
    depth: usize,
    left: &mut usize,
) -> Result<Type, DefinitionError> {
    if depth >= DEEPEST {
        return refused(format!("the type {name} contains itself"));
    }
    let Some(text) = texts.get(name) else {
        return refused(format!("the type {name} is not defined"));
    };
    let mut fields = Vec::new();
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default().trim();
        let mut words = line.split_whitespace();
        let (Some(kind), Some(field)) = (words.next(), words.next()) else {
            if line.is_empty() {
                continue;
            }
            return refused(format!("{line:?} in {name} is no field"));
        };
        let constant =
            field.contains('=') || words.next().is_some_and(|word| word.starts_with('='));
        if !constant {
            let Some(fewer) = left.checked_sub(1) else {
                return refused(format!("{name} has more than {MOST_FIELDS} fields"));
            };
            *left = fewer;
            fields.push((field.to_owned(), of(kind, name, texts, depth, left)?));
        }
    }
    if fields.is_empty() {
        // What an empty message is on the wire.
        fields.push(("structure_needs_at_least_one_member".to_owned(), Type::U8));
    }
    Ok(Type::Record(fields))
}

/// The type of a field of the message `within`.
fn of(
    written: &str,
    within: &str,
    texts: &BTreeMap<String, String>,
    depth: usize,
    left: &mut usize,
) -> Result<Type, DefinitionError> {
    let Some((element, length)) = written
        .strip_suffix(']')
        .and_then(|one| one.split_once('['))
    else {
        return single(written, within, texts, depth, left);
    };
    let element = Box::new(single(element, within, texts, depth, left)?);
    if length.is_empty() || length.starts_with("<=") {
        return Ok(Type::List(element));
    }
    match length.parse::<usize>() {
        Ok(length) if length > 0 => Ok(Type::Array(element, length)),
        _ => refused(format!("{written:?} in {within} is no array")),
    }
}

fn single(
    written: &str,
    within: &str,
    texts: &BTreeMap<String, String>,
    depth: usize,
    left: &mut usize,
) -> Result<Type, DefinitionError> {
    let bounded = written.split("<=").next().unwrap_or_default();
    Ok(match bounded {
        "bool" => Type::Bool,
        "int8" => Type::I8,
        "uint8" | "byte" | "char" => Type::U8,
        "int16" => Type::I16,
        "uint16" => Type::U16,
        "int32" => Type::I32,
        "uint32" => Type::U32,
        "int64" => Type::I64,
        "uint64" => Type::U64,
        "float32" => Type::F32,
        "float64" => Type::F64,
        "string" => Type::Text,
        "wstring" => return refused(format!("{within} has a wstring, which is not read")),
        _ => {
            let package = within.split('/').next().unwrap_or_default();
            let name = if written.contains('/') {
                short(written)
            } else if written == "Header" && !texts.contains_key(&format!("{package}/Header")) {
                "std_msgs/Header".to_owned()
            } else {
                format!("{package}/{written}")
            };
            match name.as_str() {
                "builtin_interfaces/Time" => Type::Time,
                "builtin_interfaces/Duration" => Type::Duration,
                _ => record(&name, texts, depth + 1, left)?,
            }
        }
    })
}
