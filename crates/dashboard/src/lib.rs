//! Every cell on the bus and every recording of the host as web pages: which machine needs attention, whether a part conforms and with
//! what certainty, why not, what to do, and whether it helped. Acts of operators are forwarded with their signature.
//!
//! ```text
//!  bus ── viewer (WebSocket: Foxglove, Lichtblick)
//!  bus ── live ────────┐
//!                      ├─► state::Hall ─► view (HTML, SVG) ─┬─► server (pages, /metrics)
//!  bags ── recordings ─┘    a pure reducer                  └─► stream (what has changed)
//!  cell ◄─ acts ◄── what an operator's key has signed, from a page
//! ```
//!
//! It publishes nothing, announces nothing and serves nothing on the bus. It holds no operator's key: what an operator has
//! signed on a page is handed to the services of the cell by a session of its own, as the command line would. Cells are found by what they publish; a session is shown by the reducer and the views of a live cell. Pages are
//! written here, work without scripts as far as reading goes, and load nothing from elsewhere. Memory is bounded: see
//! [`state`], [`CellState`](state::CellState), and the constants of each module.
//!
//! A message of a cell, reduced and shown as text:
//!
//! ```
//! use dashboard::{state::Hall, view::hall_text};
//! use graph::Stamp;
//! use probecell_msgs::{MachineState, to_cdr};
//!
//! let mut hall = Hall::default();
//! hall.apply("/lathe/machine_state", &to_cdr(&MachineState::default()), Stamp(0));
//! assert!(hall_text(&hall, Stamp(0), "").contains("lathe"));
//! ```

mod acts;
mod download;
mod heard;
mod history;
mod keep;
mod live;
mod metrics;
mod observed;
mod recordings;
mod server;
pub mod state;
mod stream;
mod trends;
mod versions;
pub mod view;
mod viewer;

use std::future::Future;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use graph::Stamp;
use host::bus::BusConfig;
use tokio::sync::Semaphore;

pub use acts::{ActionEndpoint, Way};
pub use keep::{keep, kept_text};
pub use live::kept;
pub use server::{MakePage, Pages};

/// Ports that are tried from the chosen one on.
const NEXT_PORTS: u16 = 20;

/// What the dashboard reads, and where it is served.
pub struct Settings {
    /// Address to listen on.
    pub listen: SocketAddr,
    /// Where its port is taken: one of the next ports, or any that is free.
    pub any_port: bool,
    /// How to reach each router.
    pub buses: Vec<BusConfig>,
    /// Version of this program, as cells publish theirs.
    pub version: String,
    /// The cell that is read from the start, the others as soon as a page is asked for; without one all are from the start.
    pub first: Option<String>,
    /// Folders of recordings.
    pub recordings: Vec<PathBuf>,
    /// Folder of a lake whose trends the pages of machines show.
    pub lake: Option<PathBuf>,
    /// Pages that the program makes of a recording.
    pub pages: Pages,
    /// Cells that take acts.
    pub desks: Vec<ActionEndpoint>,
    /// Names of this host, besides its addresses and `localhost`.
    pub hosts: Vec<String>,
    /// Origins of pages from elsewhere that may read topics as a viewer.
    pub viewers: Vec<String>,
}

/// Why the dashboard cannot run.
#[derive(Debug, thiserror::Error)]
pub enum DashboardError {
    /// Somebody else listens there.
    #[error(
        "{0} is in use, perhaps by another dashboard, which shows every cell of its bus; choose another with --listen"
    )]
    AddressTaken(SocketAddr),
    /// It cannot listen there.
    #[error("cannot listen on {0}: {1}")]
    Listen(SocketAddr, std::io::Error),
    /// No random numbers.
    #[error("the dashboard failed: {0}")]
    Random(getrandom::Error),
    /// Anything else.
    #[error("the dashboard failed: {0}")]
    Failed(#[from] std::io::Error),
}

/// Reads the buses and hands over the hall every `period`, first after one, with the instant and what is wrong with the
/// connection (empty when nothing is), for as long as `on_period` answers true. Nothing is served. `version`: that of this
/// program, as cells publish theirs.
///
/// # Errors
/// [`DashboardError::Failed`] when no thread can be started.
pub fn watch(
    buses: Vec<BusConfig>,
    version: String,
    period: Duration,
    mut on_period: impl FnMut(&state::Hall, Stamp, &str) -> bool,
) -> Result<(), DashboardError> {
    let acts = acts::Acts::new(Vec::new()).map_err(DashboardError::Random)?;
    let live = live::Live::new(Arc::new(acts), None, version);
    for bus in buses {
        live::read(Arc::clone(&live), bus)?;
    }
    loop {
        std::thread::sleep(period);
        let trouble = live.trouble();
        if !on_period(&live.hall(), host::now(), &trouble) {
            return Ok(());
        }
    }
}

/// Runs the dashboard until `end`; `ready` is told the address once it is reachable.
///
/// # Errors
/// [`DashboardError`], when it cannot listen or serve. A bus that is not reachable is no error: it is looked for until it is.
pub fn run(
    settings: Settings,
    ready: impl FnOnce(SocketAddr),
    end: impl Future<Output = ()> + Send + 'static,
) -> Result<(), DashboardError> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let listener = listen(settings.listen, settings.any_port).await?;
        let acts = Arc::new(acts::Acts::new(settings.desks).map_err(DashboardError::Random)?);
        let live = live::Live::new(Arc::clone(&acts), settings.first, settings.version);
        let buses: Arc<[BusConfig]> = settings.buses.into();
        for bus in buses.iter() {
            live::read(Arc::clone(&live), bus.clone())?;
        }
        ready(listener.local_addr()?);
        let shared = server::Shared {
            live,
            recordings: Arc::new(recordings::Recordings::new(settings.recordings)),
            trends: Arc::new(trends::Trends::new(settings.lake)),
            pages: settings.pages,
            epoch: host::now().0.unsigned_abs(),
            clients: stream::Clients::default(),
            acts,
            hosts: settings.hosts.into(),
            buses,
            viewers: settings.viewers.into(),
            watching: stream::Clients::default(),
            making: Arc::new(Semaphore::new(1)),
            made: Arc::default(),
        };
        Ok(server::serve(listener, shared, end).await?)
    })
}

/// Listens on an address; where its port is taken and any will do, on one of the next, else on any.
async fn listen(
    address: SocketAddr,
    any_port: bool,
) -> Result<tokio::net::TcpListener, DashboardError> {
    let port = address.port();
    let mut ports = vec![port];
    if any_port {
        ports.extend((1..NEXT_PORTS).filter_map(|step| port.checked_add(step)));
        ports.push(0);
    }
    let mut taken = DashboardError::AddressTaken(address);
    for port in ports {
        let address = SocketAddr::new(address.ip(), port);
        match tokio::net::TcpListener::bind(address).await {
            Ok(listener) => return Ok(listener),
            Err(error) if error.kind() == std::io::ErrorKind::AddrInUse => {}
            Err(error) => taken = DashboardError::Listen(address, error),
        }
    }
    Err(taken)
}
