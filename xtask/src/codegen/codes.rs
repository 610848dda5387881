//! The enumerations that interface files carry as `uint8` constants: which constants a field takes, and the Rust enum.
//!
//! A `uint8` field says in its comment which constants of its message it takes:
//!
//! ```text
//! uint8 kind       # one of the constants above              every uint8 constant of the message
//! uint8 approval   # one of APPROVAL_*                       those with that prefix, which the variants drop
//! uint8 decision   # one of CONFORMS to INVALID, of the fit  from the first to the second, as declared
//! ```
//!
//! A field that takes constants of another message as well is no enumeration of either, and says so:
//!
//! ```text
//! uint8 kind       # InspectionFeature kind, or one of ROUNDNESS to TOTAL_RUN_OUT
//! ```
//!
//! The message keeps the byte, as on the wire; the enum is named after message and field (`CorrectionKind`).

use std::fmt::Write as _;

use anyhow::{Context, Result, bail, ensure};

use super::{
    interface::{Constant, Element, Field, Message, Primitive, Shape},
    item::{doc, rust_name},
};

/// The enumeration that a field takes its values from.
#[derive(Clone, Debug, PartialEq)]
pub struct Code<'a> {
    /// Name of the enum.
    pub name: String,
    /// `Message.field`.
    pub field: String,
    /// Name and constant of each variant, in the order of the file.
    pub variants: Vec<(String, &'a Constant)>,
}

/// The enumerations of a message, in the order of its fields.
///
/// # Errors
/// A comment that names constants which the message does not have, or two that have the same value.
pub fn codes(message: &Message) -> Result<Vec<Code<'_>>> {
    let single = |field: &&Field| {
        field.element == Element::Primitive(Primitive::U8) && field.shape == Shape::One
    };
    let mut codes = Vec::new();
    for field in message.fields.iter().filter(single) {
        let Some(range) = field
            .doc
            .last()
            .and_then(|line| line.strip_prefix("one of "))
        else {
            continue;
        };
        let what = || format!("{}.{}: one of {range}", message.name, field.name);
        let variants = variants(message, range).with_context(what)?;
        let name = camel(&field.name);
        let message_name = rust_name(message);
        codes.push(Code {
            name: if message_name.ends_with(&name) {
                format!("{message_name}Code")
            } else {
                format!("{message_name}{name}")
            },
            field: format!("{}.{}", message.name, field.name),
            variants,
        });
    }
    Ok(codes)
}

/// Names of the `uint8` constants of a message that no field takes.
///
/// # Errors
/// As of [`codes`].
pub fn unread(message: &Message) -> Result<Vec<&str>> {
    let mut read: Vec<&Constant> = Vec::new();
    for code in codes(message)? {
        read.extend(code.variants.iter().map(|(_, constant)| *constant));
    }
    let comments = message.fields.iter().filter_map(|field| field.doc.last());
    for (_, range) in comments.filter_map(|comment| comment.split_once(", or one of ")) {
        let shared =
            variants(message, range).with_context(|| format!("{}: {range}", message.name))?;
        read.extend(shared.into_iter().map(|(_, constant)| constant));
    }
    let bytes = message.constants.iter();
    let bytes = bytes.filter(|one| one.primitive == Primitive::U8 && !read.contains(one));
    Ok(bytes.map(|one| one.name.as_str()).collect())
}

fn variants<'a>(message: &'a Message, range: &str) -> Result<Vec<(String, &'a Constant)>> {
    let bytes = message.constants.iter();
    let bytes: Vec<&Constant> = bytes.filter(|one| one.primitive == Primitive::U8).collect();
    let mut words = range
        .split([' ', ',', ';', ':'])
        .filter(|word| !word.is_empty());
    let first = words.next().context("no constant is named")?;
    let mut prefix = "";
    let chosen: Vec<&Constant> = if range.starts_with("the constants above") {
        bytes
    } else if let Some(common) = first.strip_suffix('*') {
        prefix = common;
        let named = |one: &&Constant| one.name.starts_with(common);
        bytes.into_iter().filter(named).collect()
    } else {
        ensure!(words.next() == Some("to"), "expected `A to B`");
        let last = words.next().context("no last constant is named")?;
        let index = |name: &str| {
            let found = bytes.iter().position(|one| one.name == name);
            found.with_context(|| format!("there is no constant {name}"))
        };
        let (first, last) = (index(first)?, index(last)?);
        ensure!(first <= last, "the constants are declared in another order");
        bytes[first..=last].to_vec()
    };
    ensure!(!chosen.is_empty(), "there is no such constant");
    for (index, one) in chosen.iter().enumerate() {
        if let Some(other) = chosen[..index]
            .iter()
            .find(|other| other.value == one.value)
        {
            bail!("{} and {} are both {}", other.name, one.name, one.value);
        }
    }
    let named = |one: &'a Constant| (camel(&one.name[prefix.len()..]), one);
    Ok(chosen.into_iter().map(named).collect())
}

/// `NOT_CONVERGED` or `not_converged` as `NotConverged`.
fn camel(name: &str) -> String {
    let word = |word: &str| {
        let (first, rest) = word.split_at(word.len().min(1));
        first.to_uppercase() + &rest.to_lowercase()
    };
    name.split('_').map(word).collect()
}

/// The Rust of an enumeration: a call of the macro `codes!` of the messages' crate.
pub fn code(code: &Code<'_>) -> Result<String> {
    let (name, field) = (&code.name, &code.field);
    let mut text = format!(
        "crate::code::codes! {{\n    /// Values of `{field}`.\n    pub enum {name} of {field:?} {{\n"
    );
    for (variant, constant) in &code.variants {
        let lines = if constant.doc.is_empty() {
            vec![format!("`{}`.", constant.name)]
        } else {
            constant.doc.clone()
        };
        for line in doc(&lines).lines() {
            writeln!(text, "        {line}")?;
        }
        writeln!(text, "        {variant} = {},", constant.value)?;
    }
    text += "    }\n}\n\n";
    Ok(text)
}
