//! The command line: start a cell, operate it, plan, replay, diagnose, report.
//!
//! ```text
//! main     --> command_line       the commands and their options
//!          --> commands/NAME.rs   one module for each command, named as it is typed
//!   up     --> launcher           embedded router, processes, restart
//!                operator         services, console, diagnostics of a running cell
//!   run, measure, approve, recording --> cell_client   calls the services of a running cell
//!   demo                          a hall of three machines, and the faults that they hide
//!   headline                      a diagnosis in one line
//!   cell_bus                      how processes join the bus of a cell
//!   confined                      what each process may do
//!   external_driver               whether a driver that others start is on the bus
//!   ros_arguments                 `--ros-args`: name, settings and outside names of a cell
//!   output                        standard output and standard error
//! ```
//!
//! ```text
//! probecell up launch-scripts/turn_mill.toml --once     makes, measures and corrects one part
//! probecell diagnose recordings/turn_mill_*             why the session differs from the declared model
//! ```
//!
//! Exit status: 0 success, 1 failure or difference, 2 wrong input or usage, 3 finished with loss of data.
//! An error is one sentence on standard error.

mod cell_bus;
mod cell_client;
mod command_line;
mod commands;
mod confined;
mod default_cell;
mod demo;
mod examples;
mod external_driver;
mod headline;
mod launcher;
mod operator;
mod output;
mod own_socket;
mod retention;
mod ros_arguments;
mod routing;
mod running;
mod signals;

use std::{io::IsTerminal, process::ExitCode};

use anyhow::Context as _;
use clap::{CommandFactory, FromArgMatches};
use host::clock::CellClock;
use tracing_subscriber::{EnvFilter, layer::SubscriberExt, util::SubscriberInitExt};

use command_line::{Arguments, Command, IN_MEMORY};

use terminal::{BAD_INPUT, FAILED, GOOD, LOSS};

/// Default cell file.
const DEFAULT_CELL: &str = terminal::cell_stream::DEFAULT_CELL;

/// Version of this program, and its source revision.
const VERSION: &str = env!("CARGO_PKG_VERSION");
const REVISION: &str = env!("PROBECELL_REVISION");

/// Both, the revision by its begin: `0.1.0 (8d17e5fa)`.
fn version() -> String {
    let begin = REVISION.get(..8).unwrap_or(REVISION);
    format!("{VERSION} ({begin})")
}

fn main() -> ExitCode {
    // A router calls it an error that a session which is ending takes back a liveliness token that went before.
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| {
        EnvFilter::new(
            "warn,zenoh=error,zenoh::net::routing::hat::broker::token=off,rustdds=off,ros2_client=off",
        )
    });
    let terminal = tracing_subscriber::fmt::layer()
        .with_writer(|| host::log_limit::Terminal)
        .with_ansi(std::io::stderr().is_terminal());
    tracing_subscriber::registry()
        .with(filter)
        .with(host::log_limit::layer())
        .with(terminal)
        .with(host::rosout::layer())
        .init();
    let words = match ros_arguments::take(std::env::args_os()) {
        Ok(words) => words,
        Err(why) => {
            output::error(&anyhow::Error::msg(why));
            return ExitCode::from(BAD_INPUT);
        }
    };
    let matches = examples::with_examples(Arguments::command()).get_matches_from(&words);
    let arguments = Arguments::from_arg_matches(&matches);
    let command = match arguments.map(|arguments| arguments.command) {
        Ok(Command::External(own)) if !commands::external::is_command(&own[0]) => {
            let text = format!("there is no command {}", own[0].to_string_lossy());
            Arguments::command()
                .error(clap::error::ErrorKind::InvalidSubcommand, text)
                .exit()
        }
        Ok(command) => command,
        Err(error) => error.exit(),
    };
    match run(command) {
        Ok(status) => ExitCode::from(status),
        Err(error) => {
            tracing::debug!("{error:?}");
            output::error(&error);
            let failed = error.chain().any(|cause| {
                cause
                    .downcast_ref::<host::bus::BusError>()
                    .is_some_and(|error| !error.is_of_input())
                    || cause.is::<host::ProcessError>()
                    || cause
                        .downcast_ref::<host::signals::ReaderEnded>()
                        .is_some_and(|ended| !ended.is_of_input)
                    || cause.is::<cell_bus::CellFailure>()
                    || cause.is::<dashboard::DashboardError>()
            });
            ExitCode::from(if failed { FAILED } else { BAD_INPUT })
        }
    }
}

/// A process of a cell ends with the launcher, and has its clock.
fn begin_process(supervised: bool, clock: Option<CellClock>) -> anyhow::Result<()> {
    if supervised {
        signals::end_with_parent()?;
    }
    let Some(clock) = clock else {
        return Ok(());
    };
    let followed = (clock.clone().follow()).and_then(|()| host::sim_time::connect());
    followed.with_context(|| format!("--clock {clock}"))
}

fn run(command: Command) -> anyhow::Result<u8> {
    if !ros_arguments::words().is_empty() && !command.is_of_a_cell() {
        anyhow::bail!(
            "--ros-args: not accepted by this command, which does not concern a running cell"
        );
    }
    host::clock::check()?;
    host::process::raise_limits();
    match command {
        Command::Up {
            cell,
            once,
            no_record,
            no_dashboard,
            verbose,
            speed,
        } => {
            default_cell::provide(&cell)?;
            let wanted = launcher::Wanted {
                once,
                recorded: !no_record,
                shown: !no_dashboard,
                verbose,
                speed,
            };
            launcher::up(&cell, wanted)
        }
        Command::Demo(arguments) => commands::demo::run(&arguments),
        Command::New(command) => commands::new::run(&command),
        Command::Node {
            name,
            cell,
            incarnation,
            no_record,
            supervised,
            clock,
        } => {
            begin_process(supervised, clock)?;
            commands::node::run(&name, &cell, incarnation, !no_record, supervised)
        }
        Command::Router {
            listen,
            join,
            strangers,
            keep,
            follow,
            cell,
            domain,
        } => {
            let keep = keep.map(|folder| commands::router::Keep {
                folder: Some(folder).filter(|folder| folder.as_os_str() != IN_MEMORY),
                follow,
                cells: cell,
                domain,
            });
            commands::router::run(&listen, &join, strangers, keep.as_ref())
        }
        Command::Record {
            cell,
            folder,
            supervised,
            clock,
        } => {
            begin_process(supervised, clock)?;
            commands::record::run(&cell, folder, supervised)
        }
        Command::Recording(command) => commands::recording::run(&command),
        Command::Run {
            part,
            wait,
            count,
            cell,
        } => commands::run::run(&cell.file()?, &part, count, wait),
        Command::Orders(arguments) => commands::orders::run(&arguments),
        Command::Stop { operator, cell } => commands::stop::run(&cell.file()?, &operator),
        Command::Status { cell, json } => commands::status::run(&cell.file()?, json),
        Command::Stream(arguments) => commands::stream::run(&arguments),
        Command::Dashboard(arguments) => {
            begin_process(arguments.supervised, arguments.clock.clone())?;
            commands::dashboard::run(arguments)
        }
        Command::Watch(arguments) => commands::watch::run(arguments),
        Command::Measure { again, cell, .. } => commands::measure::run(&cell.file()?, &again),
        Command::Approve {
            correction,
            operator,
            reject,
            cell,
        } => commands::approve::run(&cell.file()?, &correction, &operator, !reject),
        Command::Secure { cell, out, off } => commands::secure::run(&cell, out, off),
        Command::Key(command) => commands::key::run(&command),
        Command::Play(arguments) => commands::play::run(&arguments),
        Command::Replay { bag, json } => commands::replay::run(&bag, json),
        Command::Info {
            bag,
            verify,
            later,
            json,
        } => commands::info::run(&bag, verify, json, later.as_deref()),
        Command::Import(command) => commands::import::run(&command),
        Command::Export(arguments) => commands::export::run(&arguments),
        Command::Recover { bag, to, later } => commands::recover::run(&bag, &to, later.as_deref()),
        Command::Plan {
            source,
            json,
            selection,
        } => commands::plan::run(&source, json, &selection),
        Command::Diagnose(arguments) => commands::diagnose::run(&arguments),
        Command::Report(arguments) => commands::report::run(&arguments),
        Command::Adopt(arguments) => commands::adopt::run(&arguments),
        Command::Cure(arguments) => commands::cure::run(&arguments),
        Command::Simulate(arguments) => commands::simulate::run(&arguments),
        Command::Identifiability(arguments) => commands::identifiability::run(&arguments),
        Command::Conformance(arguments) => commands::conformance::run(&arguments),
        Command::Doctor { cell, json } => commands::doctor::run(&cell, json),
        Command::Layouts { cell, out } => commands::layouts::run(&cell, &out),
        Command::Schema { name } => Ok(commands::schema::run(name.as_deref())),
        #[cfg(feature = "manual")]
        Command::Man { folder } => {
            commands::man::run(examples::with_examples(Arguments::command()), &folder)
        }
        #[cfg(feature = "manual")]
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "probecell", &mut script);
            output::bytes(&script);
            Ok(GOOD)
        }
        Command::External(words) => commands::external::run(&words),
    }
}
