//! The command line of the cell.
//!
//! Exit status: 0 good, 1 something failed or differs, 2 the input or the usage is wrong, 3 finished, but with loss.
//! An error is one sentence on standard error.

mod commands;
mod launcher;
mod operator;
mod report;
mod signals;

use std::{io::IsTerminal, path::PathBuf, process::ExitCode};

use clap::{CommandFactory, Parser, Subcommand};
use tracing_subscriber::EnvFilter;

/// Finished as it should.
const GOOD: u8 = 0;
/// Something failed or differs.
const FAILED: u8 = 1;
/// The input or the usage is wrong.
const BAD_INPUT: u8 = 2;
/// Finished, but something was lost.
const LOSS: u8 = 3;

/// Cell file that is taken when none is named.
const DEFAULT_CELL: &str = "launch-scripts/turn_mill.toml";

#[derive(Parser)]
#[command(version, about, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Start a cell: router, nodes, driver and recorder, watched and restarted.
    Up {
        /// Cell file.
        #[arg(default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Make one part, then end.
        #[arg(long)]
        once: bool,
        /// Do not record.
        #[arg(long)]
        no_record: bool,
    },
    /// Run one node of a cell in this process.
    Node {
        /// Its name.
        name: String,
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Starts of this node in this session before this one.
        #[arg(long, default_value_t = 0)]
        incarnation: u32,
        /// Do not wait for a recorder.
        #[arg(long)]
        no_record: bool,
        /// End when the process that started this one ends.
        #[arg(long, hide = true)]
        supervised: bool,
    },
    /// Run a Zenoh router, for a cell that spans machines.
    Router {
        /// Where it listens; with an address of this machine's network it can be reached from others.
        #[arg(long, default_value = host::bus::ROUTER_ENDPOINT)]
        listen: Vec<String>,
        /// Routers of other machines to join.
        #[arg(long)]
        join: Vec<String>,
    },
    /// Record a cell.
    Record {
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Folder to write; it must not exist.
        #[arg(long)]
        folder: Option<PathBuf>,
        /// End when the process that started this one ends.
        #[arg(long, hide = true)]
        supervised: bool,
    },
    /// End the recording of a running cell, or begin another one.
    #[command(subcommand)]
    Recording(Recording),
    /// Ask a running cell for a part.
    Run {
        /// Name of the part.
        part: String,
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
    },
    /// Go on with a running cell's measurement that broke off, or measure points of it again; the part goes on with it.
    #[command(group(clap::ArgGroup::new("what").required(true)))]
    Measure {
        /// Measure what is left of it.
        #[arg(long, group = "what")]
        resume: bool,
        /// Measure these points once more, and what is left: numbers of points of the plan, from 0.
        #[arg(long, group = "what", value_name = "POINT", num_args = 1..)]
        again: Vec<u32>,
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
    },
    /// Approve or reject a correction that a running cell proposes.
    Approve {
        /// The correction.
        correction: String,
        /// Who decides.
        #[arg(long)]
        operator: String,
        /// Reject it.
        #[arg(long)]
        reject: bool,
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
    },
    /// Publish a recording again, under another namespace. Commands to a machine are never published.
    Play(commands::play::Arguments),
    /// Recompute every node of a recording and compare with what was recorded.
    Replay {
        /// Bag: a folder or an .mcap file.
        bag: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Say what a recording holds.
    Info {
        /// Bag: a folder or an .mcap file.
        bag: PathBuf,
        /// Read everything, to find all damage.
        #[arg(long)]
        verify: bool,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Write what can be read of a damaged recording as a whole one.
    Recover {
        /// Bag: a folder or an .mcap file.
        bag: PathBuf,
        /// Folder to write; it must not exist.
        to: PathBuf,
    },
    /// Plan the measuring order of a cell's part, or of the plan in a recording.
    Plan {
        /// Cell file, or a bag whose plan is ordered again.
        #[arg(default_value = DEFAULT_CELL)]
        source: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Write the measuring program of a plan for a controller: LinuxCNC, FANUC or SINUMERIK.
    Program(commands::program::Arguments),
    /// Read what a controller printed or wrote, and compute sizes from it.
    Results(commands::results::Arguments),
    /// Say why a recorded session differs from the declared model of its cell.
    Diagnose(commands::diagnose::Arguments),
    /// Write the record of the parts that a recorded session made, as one page to be filed.
    Report(commands::part_record::Arguments),
    /// Make what a gap report has found part of the cell's declared model, or take it out again.
    Adopt(commands::adopt::Arguments),
    /// Say what a plan can tell before anything is measured: smallest effects, and effects that it cannot part.
    Identifiability(commands::identifiability::Arguments),
    /// Check the diagnosis on sealed sessions, and print the score card.
    Blind {
        /// Sessions, shared out over the kinds of content.
        #[arg(long, default_value_t = 120, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
        trials: u64,
        /// Instead judge eight further touches, chosen, random and repeated, on this many sessions that are not right
        /// and sure at first.
        #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
        refine: Option<u64>,
        /// Seed of the sessions.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// A cell file or a bag: sessions on its machine and plan instead of made-up ones.
        #[arg(long, value_name = "CELL_OR_BAG", conflicts_with = "refine")]
        on: Option<PathBuf>,
        /// Write every session as a recording, and what was hidden in it, into this folder.
        #[arg(long, value_name = "DIR", conflicts_with = "refine")]
        keep: Option<PathBuf>,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Say how the next part of a free-form profile is cut, and write its program.
    Correct(commands::correct::Arguments),
    /// Run the register of known gaps between a cell and its model.
    #[command(subcommand)]
    Scenario(commands::scenario::Command),
    /// Say what is wrong with this set-up.
    Doctor {
        /// Cell file.
        #[arg(default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Print completions for a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

#[derive(Subcommand)]
enum Recording {
    /// Begin a recording.
    Start {
        /// Name of its folder inside the cell's folder of recordings; the recorder chooses when none is given.
        #[arg(default_value = "")]
        name: String,
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
    },
    /// End the recording and close its files.
    Stop {
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
    },
}

fn main() -> ExitCode {
    let filter = EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| EnvFilter::new("warn,zenoh=error,rustdds=off,ros2_client=off"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
    match run(Arguments::parse().command) {
        Ok(status) => ExitCode::from(status),
        Err(error) => {
            tracing::debug!("{error:?}");
            report::error(&error);
            let failed = error.chain().any(|cause| {
                cause
                    .downcast_ref::<host::bus::BusError>()
                    .is_some_and(|error| !error.is_of_input())
                    || cause.is::<host::ProcessError>()
                    || cause.is::<launcher::Failed>()
            });
            ExitCode::from(if failed { FAILED } else { BAD_INPUT })
        }
    }
}

fn run(command: Command) -> anyhow::Result<u8> {
    match command {
        Command::Up {
            cell,
            once,
            no_record,
        } => launcher::up(&cell, once, !no_record),
        Command::Node {
            name,
            cell,
            incarnation,
            no_record,
            supervised,
        } => commands::node::run(&name, &cell, incarnation, !no_record, supervised),
        Command::Router { listen, join } => commands::router::run(&listen, &join),
        Command::Record {
            cell,
            folder,
            supervised,
        } => commands::record::run(&cell, folder, supervised),
        Command::Recording(Recording::Start { name, cell }) => {
            operator::start_recording(&cell, &name)
        }
        Command::Recording(Recording::Stop { cell }) => operator::stop_recording(&cell),
        Command::Run { part, cell } => operator::ask_for_part(&cell, &part),
        Command::Measure { again, cell, .. } => operator::measure(&cell, &again),
        Command::Approve {
            correction,
            operator,
            reject,
            cell,
        } => operator::approve(&cell, &correction, &operator, !reject),
        Command::Play(arguments) => commands::play::run(&arguments),
        Command::Replay { bag, json } => commands::replay::run(&bag, json),
        Command::Info { bag, verify, json } => commands::info::run(&bag, verify, json),
        Command::Recover { bag, to } => commands::recover::run(&bag, &to),
        Command::Plan { source, json } => commands::plan::run(&source, json),
        Command::Program(arguments) => commands::program::run(&arguments),
        Command::Results(arguments) => commands::results::run(&arguments),
        Command::Diagnose(arguments) => commands::diagnose::run(&arguments),
        Command::Report(arguments) => commands::part_record::run(&arguments),
        Command::Adopt(arguments) => commands::adopt::run(&arguments),
        Command::Blind {
            refine: Some(wanted),
            seed,
            json,
            ..
        } => commands::refine::run(wanted, seed, json),
        Command::Blind {
            trials,
            seed,
            on,
            keep,
            json,
            ..
        } => commands::blind::run(trials, seed, on.as_deref(), keep.as_deref(), json),
        Command::Identifiability(arguments) => commands::identifiability::run(&arguments),
        Command::Correct(arguments) => commands::correct::run(&arguments),
        Command::Scenario(command) => commands::scenario::run(&command),
        Command::Doctor { cell, json } => commands::doctor::run(&cell, json),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "probecell", &mut script);
            report::bytes(&script);
            Ok(GOOD)
        }
    }
}
