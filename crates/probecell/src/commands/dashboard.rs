//! `probecell dashboard`: every cell of the bus and every recording as web pages.

use std::ffi::OsString;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::Context;
use cell::{Cell, TransportName, keys::KeyFolder};
use dashboard::{ActionEndpoint, Pages, Settings};
use host::bus::{BusConfig, ROUTER_ENDPOINT};
use host::clock::CellClock;

use crate::{
    GOOD,
    cell_bus::{bus_config, visitor_config},
    confined, output,
    own_socket::OwnSocket,
    ros_arguments::read_cell,
    signals,
};

/// Address unless the user chooses another.
const ADDRESS: &str = "127.0.0.1:7480";
/// Folder of a lake unless the user chooses another, as of `probecell-fleet`.
const LAKE: &str = "lake";
/// Name of the file that every lake has.
const LAKE_FILE: &str = "lake.json";
/// How often the end of the process is looked for.
const PERIOD: Duration = Duration::from_millis(50);

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    Cells of this host, and ./recordings:\n    \
    probecell dashboard\n  \
    Reachable from tablets; whoever reaches it reads everything, so on trusted networks only:\n    \
    probecell dashboard --listen 0.0.0.0:7480\n  \
    Cells behind other routers:\n    \
    probecell dashboard --connect tcp/10.0.0.5:7447 --connect tcp/10.0.0.6:7447\n  \
    With the router, user and TLS settings of a cell file; operators can act on this cell, each with a signature:\n    \
    probecell dashboard --cell launch-scripts/turn_mill.toml\n\n\
    Pages: / (hall), /?wall, /cell/NAME, /sessions, /session/NAME?t=SECONDS, /compare?a=A&b=B, /key, /metrics (Prometheus).\n\
    Foxglove, Lichtblick, PlotJuggler: open a connection to ws://127.0.0.1:7480/viewer.")]
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
    /// Folder of a lake of sessions: machine pages show the trends that `probecell fleet trends --keep` has stored there.
    /// Default: `lake`, where there is one.
    #[arg(long, value_name = "DIR")]
    lake: Option<PathBuf>,
    /// ROS domain.
    #[arg(long, default_value_t = 0)]
    domain: u32,
    /// Cell file whose router, Zenoh settings and folder of recordings are used, and on whose cell operators can act, each with
    /// a signature; may be repeated.
    #[arg(long)]
    cell: Vec<PathBuf>,
    /// Additional name of this host, besides its addresses and its host name; may be repeated.
    #[arg(long, value_name = "NAME")]
    host: Vec<String>,
    /// Origin of an external page (https://app.foxglove.dev) that may read topics at ws://ADDRESS/viewer, as applications on
    /// this computer may; may be repeated.
    #[arg(long, value_name = "ORIGIN")]
    viewer: Vec<String>,
    /// Use another port if that of --listen is in use.
    #[arg(long)]
    any_port: bool,
    /// Exit when the parent process exits.
    #[arg(long, hide = true)]
    pub(crate) supervised: bool,
    /// Clock of the cell: ns from the monotonic clock of the system to stamps, or the file of a simulated clock.
    #[arg(long, hide = true, allow_hyphen_values = true)]
    pub(crate) clock: Option<CellClock>,
}

/// Arguments of the dashboard that `up` starts for the cell of this file.
pub(crate) fn arguments(cell: &Path) -> Vec<OsString> {
    // It shows when what it hears came: a cell on simulated time is told when it acts.
    let clock = CellClock::of_system().to_string();
    let words = [
        "dashboard",
        "--supervised",
        "--any-port",
        "--clock",
        &clock,
        "--cell",
    ];
    let words = words.iter().map(OsString::from);
    words.chain([cell.into()]).collect()
}

/// How to reach each router: those of `connect`, else those of the cell files, else that of this host.
pub(super) fn buses(
    cells: &[Cell],
    connect: Vec<String>,
    domain: u32,
) -> anyhow::Result<Vec<BusConfig>> {
    let mut of_cells: Vec<BusConfig> = Vec::new();
    for cell in cells {
        if cell.bus.transport != TransportName::Zenoh {
            output::remark(&format!(
                "only Zenoh is read: cell {} speaks DDS and is not shown",
                cell.cell.name
            ));
        }
        let bus = BusConfig {
            transport: host::bus::Transport::Zenoh,
            endpoints: vec![cell.bus.router_endpoint.clone()],
            ..bus_config(cell, cell::policy::SCREEN)?
        };
        if of_cells.iter().all(|one| one.endpoints != bus.endpoints) {
            of_cells.push(bus);
        }
    }
    let buses = if connect.is_empty() && !of_cells.is_empty() {
        of_cells
    } else {
        let base = of_cells.first().cloned().unwrap_or_else(|| BusConfig {
            domain_id: domain,
            ..BusConfig::default()
        });
        let endpoints = if connect.is_empty() {
            vec![ROUTER_ENDPOINT.to_owned()]
        } else {
            connect
        };
        let each = endpoints.into_iter().map(|one| BusConfig {
            endpoints: vec![one],
            ..base.clone()
        });
        each.collect()
    };
    for bus in &buses {
        bus.check()?;
    }
    Ok(buses)
}

/// Cells that take acts: those whose key is here. Without one nothing that is signed could be for this cell.
fn desks(cells: &[Cell]) -> anyhow::Result<Vec<ActionEndpoint>> {
    let mut desks = Vec::new();
    for cell in cells
        .iter()
        .filter(|cell| cell.bus.transport == TransportName::Zenoh)
    {
        let name = &cell.cell.name;
        let folder = match KeyFolder::of(cell) {
            Ok(folder) if folder.is_public_there() => folder,
            Ok(folder) => {
                let path = folder.path().display();
                output::remark(&format!(
                    "the public key of cell {name} is not in {path}: its pages only read"
                ));
                continue;
            }
            Err(error) => {
                output::remark(&format!("{error}: the pages of cell {name} only read"));
                continue;
            }
        };
        desks.push(ActionEndpoint {
            cell: name.clone(),
            key: folder.public()?,
            private: OwnSocket::of_calls(cell).map(|socket| socket.path().to_owned()),
            // Whether the router has a private socket is seen when it runs.
            bus: Box::new({
                let cell = cell.clone();
                move || visitor_config(&cell, "operator_call").map_err(|error| format!("{error:#}"))
            }),
        });
    }
    Ok(desks)
}

/// Names of this host on its network.
fn host_names() -> Vec<String> {
    let system = rustix::system::uname();
    let name = system.nodename().to_string_lossy().into_owned();
    vec![format!("{name}.local"), name]
}

/// Serves until SIGINT or SIGTERM.
pub(crate) fn run(arguments: Arguments) -> anyhow::Result<u8> {
    let read = arguments.cell.iter().map(|file| read_cell(file));
    let cells = read.collect::<Result<Vec<Cell>, _>>()?;
    let buses = buses(&cells, arguments.connect, arguments.domain)?;
    for folder in &arguments.recordings {
        std::fs::read_dir(folder).with_context(|| {
            format!("cannot read the folder of recordings {}", folder.display())
        })?;
    }
    let mut recordings = arguments.recordings;
    if recordings.is_empty() {
        recordings.extend(cells.iter().map(|cell| cell.recorder.folder.clone()));
        recordings.dedup();
    }
    if recordings.is_empty() {
        recordings.push(PathBuf::from("recordings"));
    }
    let mut hosts = arguments.host;
    hosts.extend(host_names());
    let desks = desks(&cells)?;
    if let Some(lake) = &arguments.lake {
        std::fs::metadata(lake.join(LAKE_FILE))
            .with_context(|| format!("there is no lake in {}", lake.display()))?;
    }
    let by_default = || Some(PathBuf::from(LAKE)).filter(|lake| lake.join(LAKE_FILE).exists());
    let lake = arguments.lake.or_else(by_default);
    let folders: Vec<PathBuf> = recordings.iter().chain(&lake).cloned().collect();
    confined::server(&cells, &buses, &folders)?;
    // Of the dashboards of several cells on one host most are not looked at: each begins with its own cell.
    let own = cells.first().filter(|_| arguments.supervised);
    let first = own.map(|cell| cell.cell.name.clone());
    let settings = Settings {
        first,
        version: crate::version(),
        listen: arguments.listen,
        any_port: arguments.any_port,
        buses,
        recordings,
        lake,
        pages: Pages { report, diagnosis },
        desks,
        hosts,
        viewers: arguments.viewer,
    };
    let (end, supervised) = (signals::end_flag()?, arguments.supervised);
    let ended = async move {
        while !end.load(Ordering::SeqCst) {
            tokio::time::sleep(PERIOD).await;
        }
    };
    dashboard::run(
        settings,
        |address| {
            let text = format!("dashboard: http://{address}/");
            // The output of a cell is the cell's.
            if supervised {
                output::remark(&text);
            } else {
                output::line(&text);
            }
        },
        ended,
    )?;
    Ok(GOOD)
}

fn report(bag: &Path, part: Option<usize>) -> Result<String, String> {
    super::report::html(bag, part).map_err(|error| format!("{error:#}"))
}

fn diagnosis(bag: &Path) -> Result<String, String> {
    super::diagnose::html(bag).map_err(|error| format!("{error:#}"))
}
