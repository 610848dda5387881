//! `probecell watch`: every cell of the bus on one screen.

use std::{io::IsTerminal, path::PathBuf, sync::atomic::Ordering, time::Duration};

use ::dashboard::{view::hall_text, watch};
use cell::Cell;

use super::dashboard;
use crate::{FAILED, GOOD, output, ros_arguments::read_cell, signals};

/// How often the screen is drawn.
const PERIOD: Duration = Duration::from_millis(500);
/// How long cells may take to be found with `--once`: latched topics come with the first exchange, `machine_state` ten times a
/// second.
const HEARD: Duration = Duration::from_secs(3);
/// Clears the screen and goes to its upper left corner (ECMA-48).
const CLEAR: &str = "\x1b[2J\x1b[H";

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    Cells of this host, drawn twice a second:\n    \
    probecell watch\n  \
    Once, for a script; exit status 1 where a cell needs a person:\n    \
    probecell watch --once\n  \
    Cells behind another router:\n    \
    probecell watch --connect tcp/10.0.0.5:7447")]
pub(crate) struct Arguments {
    /// Router to read; may be repeated. Default: that of this host, or of --cell.
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// ROS domain.
    #[arg(long, default_value_t = 0)]
    domain: u32,
    /// Cell file whose router and Zenoh settings are used.
    #[arg(long)]
    cell: Option<PathBuf>,
    /// Print what is received within three seconds, then exit.
    #[arg(long)]
    once: bool,
}

/// Draws until SIGINT or SIGTERM, or once.
pub(crate) fn run(arguments: Arguments) -> anyhow::Result<u8> {
    let cell = arguments.cell.as_deref().map(read_cell).transpose()?;
    let cells: Vec<Cell> = cell.into_iter().collect();
    let buses = dashboard::buses(&cells, arguments.connect, arguments.domain)?;
    let end = signals::end_flag()?;
    let is_drawn = std::io::stdout().is_terminal() && !arguments.once;
    let period = if arguments.once { HEARD } else { PERIOD };
    let mut needs_a_person = false;
    watch(buses, crate::version(), period, |hall, now, trouble| {
        let text = hall_text(hall, now, trouble);
        if is_drawn {
            output::bytes(CLEAR.as_bytes());
        }
        output::line(text.trim_end());
        let mut cells = hall.cells();
        needs_a_person = cells.any(|cell| cell.attention(now).0.needs_a_person());
        !arguments.once && !end.load(Ordering::SeqCst)
    })?;
    Ok(if arguments.once && needs_a_person {
        FAILED
    } else {
        GOOD
    })
}
