//! Standard output and standard error of this program: [`terminal`], whose remarks also go to the log of a process of a cell.

use diagnosis::Session;
use session_io::Measured;
use tracing::Level;

pub(crate) use terminal::{
    Colour, bytes, coloured, end_progress, json, line, position, progress, table, with_progress,
    wrapped,
};

/// A remark on standard error, and in the log of a process of a cell.
pub(crate) fn remark(text: &str) {
    terminal::remark(text);
    host::rosout::log(Level::INFO, text);
}

/// A warning on standard error, and in the log of a process of a cell.
pub(crate) fn warning(text: &str) {
    terminal::warning(text);
    host::rosout::log(Level::WARN, text);
}

/// The session of a measurement, whose remarks are printed.
pub(crate) fn with_remarks(measured: Measured) -> Session {
    for text in &measured.remarks {
        remark(text);
    }
    measured.session
}

/// Warns of the damage of a bag; gives the exit status of a command that used the intact part.
pub(crate) fn damage(found: &[bags::Damage]) -> u8 {
    terminal::damage(found)
}

/// An error as one sentence.
pub(crate) fn error(error: &anyhow::Error) {
    terminal::error("probecell", error);
}
