//! Progress of a plan, as one line of standard error that the next one replaces; nothing where that is not a terminal.

use std::io::{IsTerminal, Write};

use probecell_msgs::PlanProgress;

use crate::printable;

/// Shows how far a plan is.
pub fn progress(progress: &PlanProgress) {
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

/// A position in something long, as one line of standard error that the next one replaces; nothing where that is not a terminal.
pub fn position(what: &str, at: u64, of: u64) {
    replace_line(&format!("{what}: {at} of {of}"));
}

/// Ends the line of [`progress`].
pub fn end_progress() {
    replace_line("");
}

/// Plans, and shows the progress meanwhile.
pub fn with_progress<T>(plan: impl FnOnce(&mut dyn FnMut(&PlanProgress)) -> T) -> T {
    let planned = plan(&mut progress);
    end_progress();
    planned
}

/// Replaces the last line of a terminal.
fn replace_line(text: &str) {
    let mut terminal = std::io::stderr().lock();
    if terminal.is_terminal() {
        // A terminal that cannot be written to needs no progress.
        drop(write!(terminal, "\r\x1b[K{text}").and_then(|()| terminal.flush()));
    }
}
