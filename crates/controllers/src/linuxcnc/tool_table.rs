//! Reads LinuxCNC's tool table file: the only source of the offsets of tools that are not in the spindle.
//!
//! The controller writes the file anew whenever a program sets a tool's offset. `get tool_offset` of the remote shell
//! prints an integer made of other bits.

use crate::text::{ParseError, Words};

/// One tool. Offsets of its length are not kept: the cell corrects the radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// Number of the tool.
    pub number: u32,
    /// m, diameter that the controller holds.
    pub diameter: f64,
}

/// Reads the table.
///
/// # Errors
/// Line and column of what is not of the format.
pub fn parse(text: &str) -> Result<Vec<Tool>, ParseError> {
    let mut tools = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let content = line.split(';').next().unwrap_or_default();
        let mut words = Words::new(index as u64 + 1, content);
        let (mut number, mut diameter) = (None, 0.0);
        while words.clone().next_word().is_some() {
            let (letter, value) = words.take("a letter and a number", |word| {
                let mut characters = word.chars();
                let letter = characters.next()?.to_ascii_uppercase();
                let value: f64 = characters.as_str().parse().ok()?;
                (letter.is_ascii_uppercase() && value.is_finite()).then_some((letter, value))
            })?;
            match letter {
                'T' if value >= 0.0 && value.fract() == 0.0 && value <= f64::from(u32::MAX) => {
                    number = Some(value as u32);
                }
                'T' => return Err(words.error("a whole tool number before")),
                'D' => diameter = value * 1e-3,
                _ => {}
            }
        }
        match number {
            Some(number) => tools.push(Tool { number, diameter }),
            None if content.trim().is_empty() => {}
            None => return Err(words.error("a tool number T in the line")),
        }
    }
    Ok(tools)
}
