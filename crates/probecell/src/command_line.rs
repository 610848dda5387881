//! The commands of `probecell` and their options, as `--help`, man pages and completions print them.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Parser, Subcommand};
use host::clock::CellClock;

use crate::{
    DEFAULT_CELL,
    commands::{self, selection::Selection},
    launcher::Speed,
    running::Meant,
};

/// What the help says of ROS arguments, which are no options of any command.
const ROS_ARGUMENTS: &str = "Commands for a running cell accept ROS arguments after their own; these override the cell file:\n  \
    --ros-args -r __ns:=/NAME -p NODE:KEY:=VALUE -r /tf:=/NAME";

/// What the help says below the commands.
fn after_help() -> String {
    format!("{}\n\n{ROS_ARGUMENTS}", commands::external::help())
}

/// In the place of a folder: nothing on disk.
pub(crate) const IN_MEMORY: &str = "-";

#[derive(Parser)]
#[command(version, about, arg_required_else_help = true, after_help = after_help())]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Start a cell: router, nodes, driver and recorder; supervise and restart its processes.
    Up {
        /// Cell file.
        #[arg(default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Make one part, then exit.
        #[arg(long)]
        once: bool,
        /// Do not record.
        #[arg(long)]
        no_record: bool,
        /// Do not serve the dashboard, which otherwise prints its address: 127.0.0.1:7480, or one of the next ports.
        #[arg(long)]
        no_dashboard: bool,
        /// Print of each size what its decision rule says in full.
        #[arg(long)]
        verbose: bool,
        /// Run a simulated machine on simulated time, so many times as fast as the real time, or `max`: as fast as the processes
        /// keep up.
        #[arg(long, value_name = "TIMES")]
        speed: Option<Speed>,
    },
    /// Three simulated machines, each with a hidden fault: see each found, adopted, and the next part made without it.
    Demo(commands::demo::Arguments),
    /// Write a cell to begin with.
    #[command(subcommand)]
    New(commands::new::Command),
    /// Run one node of a cell in this process.
    Node {
        /// Name of the node.
        name: String,
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Number of earlier starts of this node in this session.
        #[arg(long, default_value_t = 0)]
        incarnation: u32,
        /// Do not wait for a recorder.
        #[arg(long)]
        no_record: bool,
        /// Exit when the parent process exits.
        #[arg(long, hide = true)]
        supervised: bool,
        /// Clock of the cell: ns from the monotonic clock of the system to stamps, or the file of a simulated clock.
        #[arg(long, hide = true, allow_hyphen_values = true)]
        clock: Option<CellClock>,
    },
    /// Run a Zenoh router, for a cell that spans several hosts.
    Router {
        /// Endpoint to listen on; use a network address of this host to accept connections from others.
        #[arg(long, default_value = host::bus::ROUTER_ENDPOINT)]
        listen: Vec<String>,
        /// Endpoint of another host's router to connect to; may be repeated.
        #[arg(long)]
        join: Vec<String>,
        /// Rights of every program that does not belong to this user on this host.
        #[arg(long, value_enum, default_value = "read")]
        strangers: commands::router::Strangers,
        /// Retain the last state of every cell for dashboards that start later: in this folder, so that it survives the router;
        /// without a folder, or with `-`, in memory.
        #[arg(long, value_name = "DIR", num_args = 0..=1, default_missing_value = IN_MEMORY)]
        keep: Option<PathBuf>,
        /// With --keep: another router whose cells are kept as well; may be repeated.
        #[arg(long, value_name = "ENDPOINT", requires = "keep")]
        follow: Vec<String>,
        /// With --keep: cell file with the router, user and TLS settings for following its cell; may be repeated.
        #[arg(long, requires = "keep")]
        cell: Vec<PathBuf>,
        /// With --keep: ROS domain.
        #[arg(long, default_value_t = 0, requires = "keep")]
        domain: u32,
    },
    /// Record a cell.
    Record {
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Output folder; must not exist.
        #[arg(long)]
        folder: Option<PathBuf>,
        /// Exit when the parent process exits.
        #[arg(long, hide = true)]
        supervised: bool,
        /// Clock of the cell: ns from the monotonic clock of the system to stamps, or the file of a simulated clock.
        #[arg(long, hide = true, allow_hyphen_values = true)]
        clock: Option<CellClock>,
    },
    /// Start or stop the recording of a running cell.
    #[command(subcommand)]
    Recording(commands::recording::Command),
    /// Order parts of a running cell.
    Run {
        /// Name of the parts.
        part: String,
        /// Wait for their end; exit status 1 as soon as one is not qualified.
        #[arg(long)]
        wait: bool,
        /// Parts of the order, made one after the other.
        #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
        count: u32,
        #[command(flatten)]
        cell: Meant,
    },
    /// List the orders of a running cell, or change them.
    Orders(commands::orders::Arguments),
    /// Stop the machine of a running cell, and the part that is being made.
    Stop {
        /// Name of the operator who stops it.
        #[arg(long, default_value = "operator")]
        operator: String,
        #[command(flatten)]
        cell: Meant,
    },
    /// Print what a running cell is doing.
    Status {
        #[command(flatten)]
        cell: Meant,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Serve every cell of the bus and every recording as web pages; operators can act on them with a signature.
    Dashboard(commands::dashboard::Arguments),
    /// Print what a running cell publishes, or what a recording holds, as lines of JSON for other programs.
    Stream(commands::stream::Arguments),
    /// Show every cell on the bus on one screen, those that need attention first.
    Watch(commands::watch::Arguments),
    /// Resume an interrupted measurement of a running cell, or repeat points of it; the part then continues.
    #[command(group(clap::ArgGroup::new("what").required(true)))]
    Measure {
        /// Measure the remaining points.
        #[arg(long, group = "what")]
        resume: bool,
        /// Repeat these points and measure the remaining ones: indices into the plan, from 0.
        #[arg(long, group = "what", value_name = "POINT", num_args = 1..)]
        again: Vec<u32>,
        #[command(flatten)]
        cell: Meant,
    },
    /// Approve or reject a correction that a running cell proposes, with the signature of an operator.
    Approve {
        /// Identifier of the correction.
        correction: String,
        /// Name of the operator who decides.
        #[arg(long)]
        operator: String,
        /// Reject instead of approving.
        #[arg(long)]
        reject: bool,
        #[command(flatten)]
        cell: Meant,
    },
    /// Make, list or withdraw the keys with which operators sign approvals.
    #[command(subcommand)]
    Key(commands::key::Command),
    /// Secure the bus of a cell: a user and password for each process, and a policy that denies everything else.
    Secure {
        /// Cell file.
        #[arg(default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Folder of the session files for ROS 2; without it, that of the cell's keys.
        #[arg(long)]
        out: Option<PathBuf>,
        /// Remove users, passwords and policy again.
        #[arg(long)]
        off: bool,
    },
    /// Play back a recording under another namespace. Commands, requests and approvals are never published.
    Play(commands::play::Arguments),
    /// Recompute every node from its recorded inputs and compare the outputs byte for byte.
    Replay {
        /// Bag: a folder or an .mcap file.
        bag: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Print the contents of a recording.
    Info {
        /// Bag: a folder or an .mcap file.
        bag: PathBuf,
        /// Read the whole recording to find all damage.
        #[arg(long)]
        verify: bool,
        /// A later recording of the same session, which shows what was lost at the end of this one.
        #[arg(long, value_name = "BAG")]
        later: Option<PathBuf>,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Import files of other systems as a recorded session.
    #[command(subcommand)]
    Import(commands::import::Command),
    /// Write sizes and touches of a recording in the format of another system.
    Export(commands::export::Arguments),
    /// Recover the readable part of a damaged recording.
    Recover {
        /// Bag: a folder or an .mcap file.
        bag: PathBuf,
        /// Output folder; must not exist.
        to: PathBuf,
        /// A later recording of the same session, which shows what was lost at the end of this one.
        #[arg(long, value_name = "BAG")]
        later: Option<PathBuf>,
    },
    /// Plan the measuring order of a cell's part, or of the plan in a recording; of a recording with several plans, list them.
    Plan {
        /// Cell file, or a bag whose plan is reordered.
        #[arg(default_value = DEFAULT_CELL)]
        source: PathBuf,
        #[command(flatten)]
        selection: Selection,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Explain why a recorded session differs from the declared model of its cell.
    Diagnose(commands::diagnose::Arguments),
    /// Write the inspection record of the parts made in a recorded session.
    Report(commands::report::Arguments),
    /// Add the effects found by a gap report to the cell's declared model, or remove them.
    Adopt(commands::adopt::Arguments),
    /// List what mends each cause of a gap report, or write it as what the machine loads: a compensation table, settings, a robot
    /// description.
    Cure(commands::cure::Arguments),
    /// Simulate a recorded session again with its model before and after the diagnosis, and compare the residuals (posterior
    /// predictive check). Exit status 1 if the session contradicts the model with the effects.
    Simulate(commands::simulate::Arguments),
    /// Analyse the identifiability of a plan: detection limits and confounded effects.
    Identifiability(commands::identifiability::Arguments),
    /// Check a driver on the bus against the driver guide by acting as its cell. The machine moves.
    Conformance(commands::conformance::Arguments),
    /// Check the installation and the cell file.
    Doctor {
        /// Cell file.
        #[arg(default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Write layouts of Foxglove, Lichtblick, RViz and PlotJuggler for the topics of a cell.
    Layouts {
        /// Cell file.
        #[arg(default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Output folder; created if it does not exist.
        #[arg(long, default_value = "layouts")]
        out: PathBuf,
    },
    /// Print the JSON Schema of what a command prints with --json, or list the schemas.
    Schema {
        /// Name of a schema.
        #[arg(value_parser = commands::schema::names())]
        name: Option<String>,
    },
    /// Print shell completions.
    #[cfg(feature = "manual")]
    Completions {
        /// Shell.
        shell: clap_complete::Shell,
    },
    /// Write man pages.
    #[cfg(feature = "manual")]
    Man {
        /// Output folder; created if it does not exist.
        folder: PathBuf,
    },
    /// A command of a program beside this one.
    #[command(external_subcommand)]
    External(Vec<OsString>),
}

impl Command {
    /// It starts a cell, or is of one that may run under ROS arguments.
    pub(crate) fn is_of_a_cell(&self) -> bool {
        if let Self::External(words) = self {
            return commands::external::is_of_a_cell(words);
        }
        matches!(
            self,
            Self::Up { .. }
                | Self::Node { .. }
                | Self::Record { .. }
                | Self::Recording(_)
                | Self::Run { .. }
                | Self::Orders(_)
                | Self::Stop { .. }
                | Self::Status { .. }
                | Self::Measure { .. }
                | Self::Approve { .. }
                | Self::Key(_)
                | Self::Secure { .. }
                | Self::Plan { .. }
                | Self::Dashboard(_)
                | Self::Watch(_)
                | Self::Stream(_)
                | Self::Conformance(_)
                | Self::Doctor { .. }
                | Self::Layouts { .. }
        )
    }
}
