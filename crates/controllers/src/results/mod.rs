//! Reads what other controllers report: printed lines, inspection printouts, surface-result files, logs.
//!
//! Lengths are mm as printed. Each mistake is told once, with line and column, and nothing is guessed.

mod inspection;
mod printed;
mod sinumerik;
mod surface;

pub use inspection::{Inspected, inspection_printout};
pub use printed::{Printed, PrintedTouch, printed_touches};
pub use sinumerik::{Frame, Log, LoggedTouch, sinumerik_log};
pub use surface::{SurfaceFile, SurfacePoint, surface_results};

/// Lines that are not blank, with their numbers.
fn lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    (1..)
        .zip(text.lines())
        .filter(|(_, line)| !line.trim().is_empty())
}
