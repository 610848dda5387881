//! `probecell mtconnect`: a running cell as an MTConnect agent.

mod http;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, atomic::Ordering};
use std::time::Duration;

use anyhow::Context;
use exchange::export::mtconnect::agent::Agent;
use graph::topics::{self, Topic};
use probecell_msgs::from_cdr;
use tokio::sync::watch;

use super::{dashboard, following::follow};
use crate::{DEFAULT_CELL, GOOD, confined, output, ros_arguments::read_cell, signals};

/// The port that agents use.
const ADDRESS: &str = "127.0.0.1:5000";
/// What is read of the cell.
const READ: [Topic; 5] = [
    topics::MACHINE_STATE,
    topics::TOOL_OFFSETS,
    topics::INSPECTION_PLAN,
    topics::FEATURE_RESULTS,
    topics::VERDICTS,
];
/// How often it is looked whether this process is to end.
const PERIOD: Duration = Duration::from_millis(200);

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    The cell of this folder:\n    \
    probecell mtconnect\n    \
    curl http://127.0.0.1:5000/current\n  \
    Reachable from a shop's network; whoever reaches it reads sizes, offsets and the state of the machine:\n    \
    probecell mtconnect --cell launch-scripts/turn_mill.toml --listen 0.0.0.0:5000\n\n\
    Requests: /probe, /current[?at=N], /sample[?from=N&count=N], both with interval=MS[&heartbeat=MS] as a stream, each\n\
    also below the name of the cell.")]
pub(crate) struct Arguments {
    /// Cell file.
    #[arg(long, default_value = DEFAULT_CELL)]
    cell: PathBuf,
    /// Address to listen on; port 0 takes a free one.
    #[arg(long, default_value = ADDRESS)]
    listen: SocketAddr,
}

/// The agent, and a signal for each number that it has given away.
pub(super) struct Served {
    agent: Mutex<Agent>,
    next: watch::Sender<u64>,
}

impl Served {
    /// The agent, locked. A panic of another thread leaves it whole: each message changes it in one step.
    pub(super) fn agent(&self) -> MutexGuard<'_, Agent> {
        self.agent.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Wakes at each observation.
    pub(super) fn observations(&self) -> watch::Receiver<u64> {
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

    /// Takes a message; one that cannot be decoded as the type of its topic is left out and logged.
    fn take(&self, topic: &str, payload: &[u8]) {
        let taken = match topic {
            _ if topic == topics::MACHINE_STATE.name => {
                from_cdr(payload).map(|state| self.change(|agent| agent.machine(&state)))
            }
            _ if topic == topics::TOOL_OFFSETS.name => {
                from_cdr(payload).map(|offsets| self.change(|agent| agent.offsets(&offsets)))
            }
            _ if topic == topics::INSPECTION_PLAN.name => {
                from_cdr(payload).map(|plan| self.change(|agent| agent.plan(plan)))
            }
            _ if topic == topics::FEATURE_RESULTS.name => {
                from_cdr(payload).map(|result| self.change(|agent| agent.result(result)))
            }
            _ => from_cdr(payload).map(|verdict| self.change(|agent| agent.verdict(verdict))),
        };
        if let Err(error) = taken {
            tracing::warn!(%topic, %error, "a message cannot be decoded as the type of its topic");
        }
    }
}

/// Serves until SIGINT or SIGTERM.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let cell = read_cell(&arguments.cell)?;
    let bus = dashboard::buses(std::slice::from_ref(&cell), Vec::new(), 0)?;
    let bus = bus.into_iter().next().context("the cell has no bus")?;
    confined::server(std::slice::from_ref(&cell), std::slice::from_ref(&bus), &[])?;
    let now = host::now().time();
    let instance = u64::from(now.sec.unsigned_abs());
    let served = Arc::new(Served {
        agent: Mutex::new(Agent::new(&cell.cell.name, instance, now)),
        next: watch::Sender::new(0),
    });
    let name = cell.cell.name.clone();
    std::thread::Builder::new()
        .name("mtconnect bus".to_owned())
        .spawn({
            let served = Arc::clone(&served);
            move || -> () {
                let heard = Arc::clone(&served);
                follow(
                    &bus,
                    &name,
                    &READ,
                    move |topic, payload| heard.take(topic, payload),
                    |is_present| {
                        served.change(|agent| agent.present(host::now().time(), is_present));
                    },
                )
            }
        })?;
    let end = signals::end_flag()?;
    let ended = async move {
        while !end.load(Ordering::SeqCst) {
            tokio::time::sleep(PERIOD).await;
        }
    };
    http::serve(arguments.listen, served, ended, |address| {
        output::line(&format!(
            "MTConnect agent of cell {}: http://{address}/",
            cell.cell.name
        ));
    })?;
    Ok(GOOD)
}
