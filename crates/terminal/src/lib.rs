//! What every program of this project says on a terminal, and the status with which it exits.
//!
//! | function | stream |
//! |---|---|
//! | [`line`], [`wrapped`], [`table`], [`bytes`], [`json`], [`document`] | standard output; a reader that closes the pipe early (`| head`) ends the program |
//! | [`remark`], [`warning`], [`error`] | standard error |
//! | [`progress`], [`with_progress`] | standard error, if it is a terminal |
//! | [`damage`] | a warning for each damage of a recording, and the exit status that follows |
//! | [`exit`] | the status of a program, from what its `run` returns |
//!
//! [`cell_stream`] reads and writes what a cell publishes as lines of JSON on a pipe.
//!
//! Characters that would move a cursor, ring a bell or turn the direction of writing are shown escaped.

#![expect(clippy::print_stderr, reason = "this crate is the terminal")]

pub mod cell_stream;
mod end;
mod progress;

use std::borrow::Cow;
use std::fmt::Display;
use std::fs;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::process::ExitCode;

use anyhow::Context;
use probecell_msgs::is_unprintable;
use serde::Serialize;

pub use end::{end_flag, on_end};
pub use progress::{end_progress, position, progress, with_progress};

/// Exit status: success.
pub const GOOD: u8 = 0;
/// Exit status: failure or difference.
pub const FAILED: u8 = 1;
/// Exit status: wrong input or usage.
pub const BAD_INPUT: u8 = 2;
/// Exit status: finished with loss of data.
pub const LOSS: u8 = 3;

/// A text with its unprintable characters escaped; line breaks and tabulators stay.
pub fn printable(text: &str) -> Cow<'_, str> {
    let escaped = |letter: char| is_unprintable(letter) && !matches!(letter, '\n' | '\t');
    if !text.chars().any(escaped) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 8);
    for letter in text.chars() {
        if escaped(letter) {
            shown.extend(letter.escape_unicode());
        } else {
            shown.push(letter);
        }
    }
    Cow::Owned(shown)
}

/// Prints a line.
pub fn line(text: &str) {
    let text = printable(text);
    let text = fitted(&text, std::io::stdout().is_terminal());
    bytes(format!("{text}\n").as_bytes());
}

/// A colour of a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// Good.
    Green,
    /// To be looked at.
    Yellow,
    /// Bad.
    Red,
}

/// Prints a line that ends with a word in colour, where standard output is a terminal and `NO_COLOR` is not set
/// (<https://no-color.org>).
pub fn coloured(text: &str, word: &str, colour: Colour) {
    let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    if plain || !std::io::stdout().is_terminal() {
        return line(&format!("{text}{word}"));
    }
    let code = match colour {
        Colour::Green => 32,
        Colour::Yellow => 33,
        Colour::Red => 31,
    };
    let (text, word) = (printable(text), printable(word));
    bytes(format!("{text}\x1b[{code}m{word}\x1b[0m\n").as_bytes());
}

/// Prints rows below their heads in aligned columns, numbers at the right. What does not fit belongs into the last column, which goes
/// on below itself on a terminal.
pub fn table<const COUNT: usize>(heads: [&str; COUNT], rows: &[[String; COUNT]]) {
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells
            .chain([heads[column].chars().count()])
            .max()
            .unwrap_or(0)
    };
    let is_number = |column: usize| rows.iter().all(|row| row[column].parse::<f64>().is_ok());
    let layout: Vec<_> = (0..COUNT).map(|one| (width(one), is_number(one))).collect();
    for row in [heads.map(str::to_owned)].iter().chain(rows) {
        let cells = row.iter().zip(&layout).map(|(cell, &(width, is_number))| {
            if is_number {
                format!("{cell:>width$}")
            } else {
                format!("{cell:<width$}")
            }
        });
        line(cells.collect::<Vec<_>>().join("  ").trim_end());
    }
}

/// Columns that fit on every terminal.
pub const COLUMNS: usize = 100;

/// Prints a text after a head, in lines of at most [`COLUMNS`]; those after the first are indented.
pub fn wrapped(head: &str, indent: usize, text: &str) {
    line(&wrap(head, indent, text));
}

/// See [`wrapped`]. Only blanks are broken, and those at the break are left out.
pub fn wrap(head: &str, indent: usize, text: &str) -> String {
    let mut all = head.to_owned();
    let mut column = head.chars().count();
    let mut blanks = 0;
    for (number, word) in text.split(' ').enumerate() {
        blanks += usize::from(number > 0);
        let length = word.chars().count();
        if length == 0 {
            continue;
        }
        if number > 0 && column + blanks + length > COLUMNS {
            all.push('\n');
            (column, blanks) = (0, indent);
        }
        all.extend(std::iter::repeat_n(' ', blanks));
        all.push_str(word);
        column += blanks + length;
        blanks = 0;
    }
    all
}

/// Least width in which the last column of a table goes on below itself.
const LEAST: usize = 18;

/// Where a line that is too long goes on below: at the last column of a table in which a word has room, else two columns to the right
/// of where it begins. Bytes before it, and blanks below.
fn continuation(line: &str) -> (usize, usize) {
    let begin = line.len() - line.trim_start_matches(' ').len();
    let mut found = (begin, begin + 2);
    let mut blanks = 0;
    for (column, (at, letter)) in line.char_indices().enumerate().skip(begin) {
        if letter != ' ' && blanks > 1 && column + LEAST <= COLUMNS {
            found = (at, column);
        }
        blanks = if letter == ' ' { blanks + 1 } else { 0 };
    }
    found
}

/// A text as it fits a terminal: lines longer than [`COLUMNS`] go on below. A command, which somebody may copy, is not broken, and
/// nothing is where something else than a terminal reads.
fn fitted(text: &str, is_terminal: bool) -> Cow<'_, str> {
    let is_command =
        |line: &str| line.trim_start().starts_with("probecell ") || line.contains(": probecell ");
    let is_long = |line: &str| line.chars().count() > COLUMNS && !is_command(line);
    if !is_terminal || !text.lines().any(is_long) {
        return Cow::Borrowed(text);
    }
    let lines = text.split('\n').map(|line| {
        if !is_long(line) {
            return line.to_owned();
        }
        let (at, indent) = continuation(line);
        wrap(&line[..at], indent, &line[at..])
    });
    Cow::Owned(lines.collect::<Vec<_>>().join("\n"))
}

/// Prints bytes as they are. Where the reader has closed the pipe the program exits with success, as others do.
pub fn bytes(text: &[u8]) {
    let mut out = std::io::stdout().lock();
    if let Err(error) = out.write_all(text).and_then(|()| out.flush()) {
        let enough = error.kind() == ErrorKind::BrokenPipe;
        if !enough {
            remark(&format!("probecell: cannot write the output: {error}"));
        }
        std::process::exit(i32::from(if enough { GOOD } else { FAILED }));
    }
}

/// Writes a document into a file, or prints it where none is given.
///
/// # Errors
/// The file cannot be written.
pub fn document(text: &str, file: Option<&Path>) -> anyhow::Result<()> {
    let Some(file) = file else {
        bytes(text.as_bytes());
        return Ok(());
    };
    fs::write(file, text).with_context(|| format!("cannot write {}", file.display()))
}

/// Writes a document to a file that must not exist; true where it did, false where it went to standard output (no file, or `-`).
///
/// # Errors
/// A file that exists, or that cannot be written.
pub fn new_document(text: &str, file: Option<&Path>) -> anyhow::Result<bool> {
    let Some(file) = file.filter(|file| *file != Path::new("-")) else {
        bytes(text.as_bytes());
        return Ok(false);
    };
    let made = fs::File::create_new(file).with_context(|| {
        let name = file.display();
        format!("cannot write {name}: name a file that does not exist")
    });
    made?
        .write_all(text.as_bytes())
        .with_context(|| format!("cannot write {}", file.display()))?;
    Ok(true)
}

/// Prints one JSON document, indented.
///
/// # Errors
/// A value that JSON cannot hold.
pub fn json(value: &impl Serialize) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(value)?;
    bytes(format!("{}\n", printable(&text)).as_bytes());
    Ok(())
}

/// A remark on standard error.
pub fn remark(text: &str) {
    let text = printable(text);
    eprintln!("{}", fitted(&text, std::io::stderr().is_terminal()));
}

/// A warning on standard error.
pub fn warning(text: &str) {
    eprintln!("warning: {}", printable(text));
}

/// Warns of each damage of a recording; the exit status of a command that used the intact part.
pub fn damage(found: &[impl Display]) -> u8 {
    for damage in found {
        warning(&format!("{damage}: only the complete part is used"));
    }
    if found.is_empty() { GOOD } else { LOSS }
}

/// An error on standard error, as one sentence that begins with the name of the program.
pub fn error(program: &str, error: &anyhow::Error) {
    eprintln!("{program}: {}", printable(&sentence(error)));
}

/// An error and its causes as one sentence; a cause that the text before it holds is not repeated.
pub fn sentence(error: &anyhow::Error) -> String {
    let mut sentence = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !sentence.contains(&cause) {
            sentence = if sentence.is_empty() {
                cause
            } else {
                format!("{sentence}: {cause}")
            };
        }
    }
    sentence.replace('\n', " ")
}

/// The exit code of a program: the status that its `run` returns, or wrong input with the error printed.
pub fn exit(program: &str, status: anyhow::Result<u8>) -> ExitCode {
    ExitCode::from(status.unwrap_or_else(|why| {
        error(program, &why);
        BAD_INPUT
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_drive_a_terminal_is_shown_as_text() {
        assert_eq!(printable("Ø 19,8 mm\tgut\n"), "Ø 19,8 mm\tgut\n");
        assert_eq!(printable("p\u{1b}[2J\u{7}\r"), "p\\u{1b}[2J\\u{7}\\u{d}");
        // The one-byte form of the escape sequence, and a change of the direction of writing.
        assert_eq!(printable("\u{9b}2J\u{202e}"), "\\u{9b}2J\\u{202e}");
    }

    #[test]
    fn a_long_text_goes_on_below_its_beginning() {
        let text = vec!["touches"; 30].join(" ");
        let wrapped = wrap("  7 s  mill  ", 13, &text);
        let lines: Vec<&str> = wrapped.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines.iter().all(|line| line.chars().count() <= COLUMNS));
        assert!(
            lines[1..]
                .iter()
                .all(|line| line.starts_with("             touches"))
        );
        let words: Vec<&str> = wrapped.split_whitespace().skip(3).collect();
        assert_eq!(words.join(" "), text);
        assert_eq!(wrap("a ", 2, "b c"), "a b c");
        let command = format!("  probecell {}", "words ".repeat(20));
        for (kept, is_terminal) in [(&command, true), (&text, false)] {
            assert_eq!(fitted(kept, is_terminal), *kept);
        }
        let row = format!("  D1  ± 5 µm    {}    {text}", "x".repeat(40));
        let shown = fitted(&row, true);
        assert!(
            shown
                .lines()
                .skip(1)
                .all(|line| line.starts_with(&" ".repeat(58)))
        );
        assert!(shown.split_whitespace().eq(row.split_whitespace()));
        let below = format!("short\n  {text}\nshort");
        let shown = fitted(&below, true);
        assert_eq!(shown.lines().count(), 5);
        assert!(
            shown
                .lines()
                .nth(2)
                .is_some_and(|line| line.starts_with("    touches"))
        );
    }

    #[test]
    fn a_cause_is_not_repeated() {
        let error = anyhow::anyhow!("no such file").context("cannot read x: no such file");
        assert_eq!(sentence(&error), "cannot read x: no such file");
    }
}
