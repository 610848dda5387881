//! `probecell dashboard`: every cell of the bus and every recording as web pages, read only.

use std::ffi::OsString;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::Context;
use cell::{Cell, TransportName};
use dashboard::{Pages, Settings};
use host::bus::{BusConfig, ROUTER_ENDPOINT};

use crate::{GOOD, cell_bus::bus_config, output, signals};

/// Address unless the user chooses another.
const ADDRESS: &str = "127.0.0.1:7480";
/// How often the end of the process is looked for.
const PERIOD: Duration = Duration::from_millis(50);

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    Cells of this host, and ./recordings:\n    \
    probecell dashboard\n  \
    Reachable from tablets; there is no password, so on trusted networks only:\n    \
    probecell dashboard --listen 0.0.0.0:7480\n  \
    Cells behind other routers:\n    \
    probecell dashboard --connect tcp/10.0.0.5:7447 --connect tcp/10.0.0.6:7447\n  \
    With the router, user and TLS settings of a cell file:\n    \
    probecell dashboard --cell launch-scripts/turn_mill.toml\n\n\
    Pages: / (hall), /?wall, /cell/NAME, /sessions, /session/NAME?t=SECONDS, /compare?a=A&b=B, /metrics (Prometheus).")]
pub(crate) struct Arguments {
    /// Address to listen on; port 0 takes a free one.
    #[arg(long, default_value = ADDRESS)]
    listen: SocketAddr,
    /// Router to read; may be repeated. Default: that of this host, or of --cell.
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// Folder of recordings; may be repeated. Default: `recordings`, or that of --cell.
    #[arg(long, value_name = "DIR")]
    recordings: Vec<PathBuf>,
    /// ROS domain.
    #[arg(long, default_value_t = 0)]
    domain: u32,
    /// Cell file whose router, Zenoh settings and folder of recordings are used.
    #[arg(long)]
    cell: Option<PathBuf>,
    /// Exit when the parent process exits.
    #[arg(long, hide = true)]
    pub(crate) supervised: bool,
    /// Clock of the cell: ns from the monotonic clock of the system to stamps.
    #[arg(long, hide = true, allow_hyphen_values = true)]
    pub(crate) clock: Option<i64>,
}

/// Arguments of the dashboard that `up` starts for the cell of this file.
pub(crate) fn arguments(cell: &Path) -> Vec<OsString> {
    let clock = host::clock::offset().to_string();
    let words = ["dashboard", "--supervised", "--clock", &clock, "--cell"];
    let words = words.iter().map(OsString::from);
    words.chain([cell.into()]).collect()
}

/// How to reach each router: those of `connect`, else that of the cell file, else that of this host.
pub(super) fn buses(
    cell: Option<&Cell>,
    connect: Vec<String>,
    domain: u32,
) -> anyhow::Result<Vec<BusConfig>> {
    let base = match cell {
        Some(cell) => {
            if cell.bus.transport != TransportName::Zenoh {
                output::remark("only Zenoh is read: this cell speaks DDS and is not shown");
            }
            bus_config(cell, cell::policy::SCREEN)?
        }
        None => BusConfig {
            domain_id: domain,
            ..BusConfig::default()
        },
    };
    let endpoints = match (connect.is_empty(), cell) {
        (false, _) => connect,
        (true, Some(cell)) => vec![cell.bus.router_endpoint.clone()],
        (true, None) => vec![ROUTER_ENDPOINT.to_owned()],
    };
    let buses = endpoints.into_iter().map(|one| BusConfig {
        transport: host::bus::Transport::Zenoh,
        endpoints: vec![one],
        ..base.clone()
    });
    let buses: Vec<BusConfig> = buses.collect();
    for bus in &buses {
        bus.check()?;
    }
    Ok(buses)
}

/// Serves until SIGINT or SIGTERM.
pub(crate) fn run(arguments: Arguments) -> anyhow::Result<u8> {
    let cell = arguments.cell.as_deref().map(Cell::read).transpose()?;
    let buses = buses(cell.as_ref(), arguments.connect, arguments.domain)?;
    for folder in &arguments.recordings {
        std::fs::read_dir(folder).with_context(|| {
            format!("cannot read the folder of recordings {}", folder.display())
        })?;
    }
    let recordings = match (arguments.recordings.is_empty(), &cell) {
        (false, _) => arguments.recordings,
        (true, Some(cell)) => vec![cell.recorder.folder.clone()],
        (true, None) => vec![PathBuf::from("recordings")],
    };
    let settings = Settings {
        listen: arguments.listen,
        buses,
        recordings,
        pages: Pages { report, diagnosis },
    };
    let end = signals::end_flag()?;
    let ended = async move {
        while !end.load(Ordering::SeqCst) {
            tokio::time::sleep(PERIOD).await;
        }
    };
    dashboard::run(
        settings,
        |address| output::line(&format!("dashboard: http://{address}/")),
        ended,
    )?;
    Ok(GOOD)
}

fn report(bag: &Path) -> Result<String, String> {
    super::report::html(bag).map_err(|error| format!("{error:#}"))
}

fn diagnosis(bag: &Path) -> Result<String, String> {
    super::diagnose::html(bag).map_err(|error| format!("{error:#}"))
}
