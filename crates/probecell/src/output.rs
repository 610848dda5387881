//! Standard output and standard error.

#![expect(clippy::print_stderr, reason = "this module is the terminal")]

use std::{
    borrow::Cow,
    io::{ErrorKind, IsTerminal, Write},
};

use diagnosis::Session;
use probecell_msgs::{PlanProgress, is_unprintable};
use serde::Serialize;
use session_io::Measured;
use tracing::Level;

/// A text whose characters that would move a cursor, ring a bell or turn the direction of writing are escaped; a line
/// break and a tabulator stay.
fn printable(text: &str) -> Cow<'_, str> {
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

/// A line on standard output.
pub(crate) fn line(text: &str) {
    bytes(format!("{}\n", printable(text)).as_bytes());
}

/// Bytes on standard output. A reader may close the pipe early (`| head`): then the program exits, as others do.
pub(crate) fn bytes(text: &[u8]) {
    let mut out = std::io::stdout().lock();
    if let Err(error) = out.write_all(text).and_then(|()| out.flush()) {
        let enough = error.kind() == ErrorKind::BrokenPipe;
        if !enough {
            remark(&format!("probecell: cannot write the output: {error}"));
        }
        std::process::exit(i32::from(if enough { crate::GOOD } else { crate::FAILED }));
    }
}

/// A remark on standard error, and in the log of a process of a cell.
pub(crate) fn remark(text: &str) {
    eprintln!("{}", printable(text));
    host::rosout::log(Level::INFO, text);
}

/// The session of a measurement, whose remarks are printed.
pub(crate) fn with_remarks(measured: Measured) -> Session {
    for text in &measured.remarks {
        remark(text);
    }
    measured.session
}

/// A warning on standard error, and in the log of a process of a cell.
pub(crate) fn warning(text: &str) {
    eprintln!("warning: {}", printable(text));
    host::rosout::log(Level::WARN, text);
}

/// Progress of a plan, as one line of standard error that the next one replaces; nothing where that is not a terminal.
pub(crate) fn progress(progress: &PlanProgress) {
    let plan = if progress.plan_id.is_empty() {
        "planning"
    } else {
        &progress.plan_id
    };
    let (touches, percent) = (progress.touches, 100.0 * progress.share);
    let text = match progress.phase {
        PlanProgress::TRANSITS => {
            format!("{plan}: {touches} touches, computing moves between them: {percent:.0} %")
        }
        PlanProgress::SEARCHING => format!(
            "{plan}: {touches} touches, {:.1} s of air moves instead of {:.1} s, search {percent:.0} %",
            progress.air_time, progress.given_air_time
        ),
        _ => String::new(),
    };
    replace_line(&printable(&text));
}

/// Ends the line of [`progress`].
pub(crate) fn end_progress() {
    replace_line("");
}

/// Replaces the last line of a terminal.
fn replace_line(text: &str) {
    let mut terminal = std::io::stderr().lock();
    if terminal.is_terminal() {
        // A terminal that cannot be written to needs no progress.
        drop(write!(terminal, "\r\x1b[K{text}").and_then(|()| terminal.flush()));
    }
}

/// One JSON object on standard output.
pub(crate) fn json(value: &impl Serialize) -> anyhow::Result<()> {
    line(&serde_json::to_string_pretty(value)?);
    Ok(())
}

/// Warns of the damage of a bag; gives the exit status of a command that used the intact part.
pub(crate) fn damage(found: &[bags::Damage]) -> u8 {
    for damage in found {
        warning(&format!("{damage}: only the complete part is used"));
    }
    if found.is_empty() {
        crate::GOOD
    } else {
        crate::LOSS
    }
}

/// An error as one sentence.
pub(crate) fn error(error: &anyhow::Error) {
    eprintln!("probecell: {}", printable(&session_io::sentence(error)));
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
}
