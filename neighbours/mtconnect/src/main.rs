//! `probecell-mtconnect`: a running cell as an MTConnect agent. `probecell mtconnect` starts it.
//!
//! ```text
//! probecell stream --> lines --> connector::mtconnect::agent::Agent --> documents --> http --> clients
//! ```
//!
//! It has neither the bus nor a key of the cell, opens no file once it has started, and connects to nobody.

mod http;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, atomic::Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use clap::Parser;
use confinement::{Rights, Sockets, confine};
use connector::mtconnect::agent::Agent;
use probecell_msgs::CdrError;
use probecell_msgs::builtin_interfaces::Time;
use terminal::cell_stream::{DEFAULT_CELL, Line, Message, Source, Stream};
use tokio::sync::watch;

/// The port that agents use.
const ADDRESS: &str = "127.0.0.1:5000";
/// What is read of the cell.
const TOPICS: [&str; 5] = [
    "machine_state",
    "tool_offsets",
    "inspection_plan",
    "feature_results",
    "verdicts",
];
/// How often it is looked whether this process is to end.
const PERIOD: Duration = Duration::from_millis(200);

/// Serve a running cell as an MTConnect agent, read only.
#[derive(Parser)]
#[command(
    version,
    name = "probecell-mtconnect",
    bin_name = "probecell mtconnect",
    after_help = "Examples:\n  \
    The cell of this folder:\n    \
    probecell mtconnect\n    \
    curl http://127.0.0.1:5000/current\n  \
    Reachable from a shop's network; whoever reaches it reads sizes, offsets and the state of the machine:\n    \
    probecell mtconnect --cell launch-scripts/turn_mill.toml --listen 0.0.0.0:5000\n\n\
    Requests: /probe, /current[?at=N], /sample[?from=N&count=N], both with interval=MS[&heartbeat=MS] as a stream, each\n\
    also below the name of the cell."
)]
struct Arguments {
    /// Cell file.
    #[arg(long, default_value = DEFAULT_CELL)]
    cell: PathBuf,
    /// Address to listen on; port 0 takes a free one.
    #[arg(long, default_value = ADDRESS)]
    listen: SocketAddr,
}

/// The agent, and a signal for each number that it has given away.
pub(crate) struct Served {
    agent: Mutex<Agent>,
    next: watch::Sender<u64>,
}

impl Served {
    /// The agent, locked. A panic of another thread leaves it whole: each message changes it in one step.
    pub(crate) fn agent(&self) -> MutexGuard<'_, Agent> {
        self.agent.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Wakes at each observation.
    pub(crate) fn observations(&self) -> watch::Receiver<u64> {
        self.next.subscribe()
    }

    fn change(&self, change: impl FnOnce(&mut Agent)) {
        let mut agent = self.agent();
        change(&mut agent);
        let next = agent.next_sequence();
        drop(agent);
        self.next
            .send_if_modified(|last| std::mem::replace(last, next) != next);
    }

    fn take(&self, line: Line) {
        match line {
            Line::Message(message) => {
                let mut taken = Ok(());
                self.change(|agent| taken = take(agent, &message));
                if let Err(error) = taken {
                    let topic = &message.topic;
                    terminal::warning(&format!(
                        "a message of {topic} cannot be decoded as the type of its topic: {error}"
                    ));
                }
            }
            Line::Present(present) => {
                let at = Time::from_nanos(present.at);
                self.change(|agent| agent.present(at, present.is_present));
            }
            Line::Cell(_) | Line::Complete {} => {}
        }
    }
}

fn take(agent: &mut Agent, message: &Message) -> Result<(), CdrError> {
    match message.topic.as_str() {
        "machine_state" => agent.machine(&message.decode()?),
        "tool_offsets" => agent.offsets(&message.decode()?),
        "inspection_plan" => agent.plan(message.decode()?),
        "feature_results" => agent.result(message.decode()?),
        "verdicts" => agent.verdict(message.decode()?),
        _ => {}
    }
    Ok(())
}

/// The instant now.
fn now() -> Time {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    let nanos = since.unwrap_or_default().as_nanos();
    Time::from_nanos(i64::try_from(nanos).unwrap_or(i64::MAX))
}

fn main() -> ExitCode {
    terminal::exit("probecell", run(Arguments::parse()))
}

/// Serves until SIGINT or SIGTERM, or until the stream of the cell ends.
fn run(arguments: Arguments) -> anyhow::Result<u8> {
    let (cell, stream) = match Stream::start(&Source::Running(arguments.cell), &TOPICS)? {
        Ok(started) => started,
        Err(status) => return Ok(status),
    };
    confine(&Rights::default().with_sockets(Sockets {
        tcp: true,
        listens: true,
        ports: Some(Vec::new()),
        ..Sockets::default()
    }))?;
    let begin = now();
    let instance = u64::from(begin.sec.unsigned_abs());
    let served = Arc::new(Served {
        agent: Mutex::new(Agent::new(&cell.name, instance, begin)),
        next: watch::Sender::new(0),
    });
    let end = terminal::end_flag()?;
    let following = stream.follow(Arc::clone(&end), {
        let served = Arc::clone(&served);
        move |line| served.take(line)
    })?;
    let ended = async move {
        while !end.load(Ordering::SeqCst) {
            tokio::time::sleep(PERIOD).await;
        }
    };
    http::serve(arguments.listen, served, ended, |address| {
        terminal::line(&format!(
            "MTConnect agent of cell {}: http://{address}/",
            cell.name
        ));
    })?;
    following.status()
}
