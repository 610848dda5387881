//! The command line.

mod diagnose;

use std::io::{ErrorKind, IsTerminal, Write};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use anyhow::{Context, bail};
use clap::{Args, Parser, Subcommand};
use probecell_fleet::lake::{Added, Event, Follower, Lake, Look, Pushed};
use probecell_fleet::sql::{self, Engine, Form};
use probecell_fleet::trend::hall::{Options, conclude};
use probecell_fleet::trend::series::{events, series, without_equations};

/// Finished, with some input left out.
const LEFT_OUT: u8 = 3;

/// The sessions of many machines: kept, asked and watched.
#[derive(Parser)]
#[command(version, about, arg_required_else_help = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Make and keep a lake.
    #[command(subcommand)]
    Lake(LakeCommand),
    /// Watch the effects of every machine over time: what has changed, since when, what was done then, and when it will leave
    /// its limit.
    Trends {
        #[command(flatten)]
        lake: Where,
        /// False alarms of a machine in 1,000 of its sessions.
        #[arg(long, default_value_t = 1.0, value_name = "NUMBER")]
        false_alarms: f64,
        /// Limit of a quantity in its unit, as `axis.X.scale.k=2e-5`; may be repeated.
        #[arg(long, value_name = "QUANTITY=VALUE", value_parser = limit)]
        limit: Vec<(String, f64)>,
        /// Follow the effects that the diagnosis has named in so many sessions of one machine.
        #[arg(long, default_value_t = 5, value_name = "NUMBER")]
        named_in: usize,
        /// Keep the answer in the lake (`trends.json`), where `probecell dashboard` reads it for its pages of machines.
        #[arg(long)]
        keep: bool,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Ask the lake in SQL: tables and views as `tables` lists them, and the diagnosis and trends as functions.
    ///
    /// Example: probecell-fleet sql "SELECT * FROM causes WHERE rank <= 3"
    Sql {
        /// The question: one statement that reads; `-` takes it from standard input.
        statement: String,
        #[command(flatten)]
        lake: Where,
        #[command(flatten)]
        printed: Printed,
    },
    /// Diagnose the sessions of the lake anew, here or in a cluster, and ask the answers in SQL: how many verdicts differ from those of
    /// the lake, by machine and month, unless something else is asked.
    ///
    /// Example: probecell-fleet diagnose --where "month = '2026-03'"
    Diagnose(diagnose::Diagnose),
    /// Run the scheduler of a cluster, until it is stopped.
    #[cfg(feature = "cluster")]
    Scheduler(diagnose::cluster::Scheduler),
    /// Run an executor of a cluster, until it is stopped.
    #[cfg(feature = "cluster")]
    Executor(diagnose::cluster::Executor),
    /// Diagnose recordings for another engine: a stream of Arrow IPC with a column `uri` on standard input, the same rows with a
    /// column `diagnosis` on standard output.
    Worker,
    /// List tables with unit and description of each column, views and functions.
    Tables,
    /// Print the statements that make the views, for other engines on the same tables.
    Views,
}

// How an answer is printed: columns for people unless something else is chosen.
#[derive(Args)]
struct Printed {
    /// Print CSV.
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// Print JSON: an array with an object for each row.
    #[arg(long)]
    json: bool,
}

impl Printed {
    fn form(&self) -> Form {
        match (self.csv, self.json) {
            (true, _) => Form::Csv,
            (_, true) => Form::Json,
            _ => Form::Table,
        }
    }
}

#[derive(Args)]
struct Where {
    /// Folder of the lake; to read one also s3://BUCKET/FOLDER.
    #[arg(long = "lake", default_value = "lake", value_name = "DIR")]
    folder: PathBuf,
}

#[derive(Subcommand)]
enum LakeCommand {
    /// Add recordings; those that are in the lake are left as they are.
    Add {
        /// Recordings, or folders that hold some.
        #[arg(required = true)]
        bags: Vec<PathBuf>,
        #[command(flatten)]
        lake: Where,
    },
    /// Add each recording in folders when it ends, and hand the lake over whenever it has changed and the network is there;
    /// runs until it is stopped.
    ///
    /// Example: probecell-fleet lake follow recordings --lake hall --push s3://works/north
    Follow {
        /// Folders in which recordings are made.
        #[arg(required = true)]
        folders: Vec<PathBuf>,
        /// Hand the lake over to `s3://BUCKET/FOLDER`, as `lake push` does.
        #[arg(long, value_name = "URL")]
        push: Option<String>,
        /// Look every so many seconds.
        #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = period)]
        every: f64,
        /// Look once and end: status 3 where a recording was refused or the lake could not be handed over.
        #[arg(long)]
        once: bool,
        #[command(flatten)]
        lake: Where,
    },
    /// Note what was done to a machine: a service, a crash.
    Event {
        /// Machine.
        #[arg(long)]
        machine: String,
        /// Instant, RFC 3339 in UTC.
        #[arg(long)]
        time: String,
        /// `service`, `crash`, `tool_change` or another word.
        #[arg(long)]
        kind: String,
        /// What was done.
        #[arg(default_value = "")]
        text: String,
        #[command(flatten)]
        lake: Where,
    },
    /// Make few large files of many small ones.
    Compact {
        #[command(flatten)]
        lake: Where,
    },
    /// Hand a lake over: make the lake behind a URL a copy of it. What is there already is not sent again.
    Push {
        /// `s3://BUCKET/FOLDER`; credentials and endpoint are those of the environment (AWS_ACCESS_KEY_ID ...).
        to: String,
        #[command(flatten)]
        lake: Where,
    },
}

/// Runs a command and gives the exit status.
pub(crate) fn run(arguments: Arguments) -> anyhow::Result<u8> {
    match arguments.command {
        Command::Lake(LakeCommand::Add { bags, lake }) => add(&lake, &bags),
        Command::Lake(LakeCommand::Follow {
            folders,
            push,
            every,
            once,
            lake,
        }) => {
            let lake = Lake::open_or_create(&lake.folder)?;
            let mut follower = Follower::new(lake, folders, push);
            loop {
                let status = say(&follower.look(SystemTime::now())?)?;
                if once {
                    return Ok(status);
                }
                std::thread::sleep(Duration::from_secs_f64(every));
            }
        }
        Command::Lake(LakeCommand::Event {
            machine,
            time,
            kind,
            text,
            lake,
        }) => {
            let since = humantime::parse_rfc3339_weak(&time)
                .with_context(|| format!("{time:?} is no instant (2026-03-01T07:30:00Z)"))?
                .duration_since(std::time::UNIX_EPOCH)
                .with_context(|| format!("{time:?} is before 1970"))?;
            let event = Event {
                machine,
                time: i64::try_from(since.as_micros())?,
                kind,
                text,
            };
            let new = Lake::open_or_create(&lake.folder)?.add_events(&[event])?;
            print(&format!("{new} new\n"))
        }
        Command::Lake(LakeCommand::Compact { lake }) => {
            let (before, after) = Lake::open(&lake.folder)?.compact()?;
            print(&format!("{before} files before, {after} after\n"))
        }
        Command::Lake(LakeCommand::Push { to, lake }) => {
            handed_over(&Lake::open(&lake.folder)?.push(&to)?)
        }
        Command::Trends {
            lake,
            false_alarms,
            limit,
            named_in,
            keep,
            json,
        } => {
            if !(false_alarms > 0.0 && false_alarms <= 1000.0) {
                bail!("--false-alarms is {false_alarms}, must be above 0 and at most 1000");
            }
            let lake = Lake::open(&lake.folder)?;
            let options = Options {
                false_alarms,
                limits: limit.into_iter().collect(),
            };
            let without = without_equations(&lake)?;
            if without > 0 {
                remark(&format!(
                    "warning: {without} sessions were added by an earlier version and are left out of the trends of effects; add their recordings to a new lake"
                ));
            }
            let series = series(&lake, named_in)?;
            let conclusions = conclude(&series, &events(&lake)?, &options);
            if keep {
                conclusions.keep(&lake, &series)?;
            }
            if json {
                print(&format!(
                    "{}\n",
                    serde_json::to_string_pretty(&conclusions)?
                ))
            } else {
                print(&conclusions.text())
            }
        }
        Command::Sql {
            statement,
            lake,
            printed,
        } => {
            let statement = if statement == "-" {
                std::io::read_to_string(std::io::stdin()).context("cannot read the statement")?
            } else {
                statement
            };
            let engine = Engine::open(&Lake::open(&lake.folder)?)?;
            let answer = engine.ask(&statement)?;
            sql::write(answer, printed.form(), &mut Output::default())?;
            Ok(0)
        }
        Command::Diagnose(arguments) => diagnose::diagnose(arguments),
        #[cfg(feature = "cluster")]
        Command::Scheduler(arguments) => arguments.run(),
        #[cfg(feature = "cluster")]
        Command::Executor(arguments) => arguments.run(),
        Command::Worker => {
            probecell_fleet::worker::run(std::io::stdin().lock(), Output::default())?;
            Ok(0)
        }
        Command::Tables => print(&contents()),
        Command::Views => {
            let statements: Vec<String> = sql::VIEWS
                .iter()
                .map(|view| format!("{};\n", view.statement()))
                .collect();
            print(&statements.join("\n"))
        }
    }
}

/// `QUANTITY=VALUE`.
fn limit(text: &str) -> Result<(String, f64), String> {
    let parts = text
        .rsplit_once('=')
        .and_then(|(name, value)| Some((name, value.parse::<f64>().ok()?)));
    match parts {
        Some((name, value)) if value > 0.0 && value.is_finite() => Ok((name.to_owned(), value)),
        _ => Err("must be QUANTITY=VALUE with a value above 0".to_owned()),
    }
}

fn add(lake: &Where, bags: &[PathBuf]) -> anyhow::Result<u8> {
    let lake = Lake::open_or_create(&lake.folder)?;
    let terminal = std::io::stderr().is_terminal();
    let added = lake.add(bags, &mut |done, all| {
        if terminal && all > done {
            remark(&format!("{done} of {all}"));
        }
    })?;
    report(&added)
}

/// Says what was added and gives the exit status.
fn report(added: &Added) -> anyhow::Result<u8> {
    for text in &added.remarks {
        remark(&format!("warning: {text}"));
    }
    for text in &added.refused {
        remark(&format!("not added: {text}"));
    }
    print(&format!(
        "{} added, {} known already, {} not added\n",
        added.new,
        added.known,
        added.refused.len()
    ))?;
    Ok(if added.refused.is_empty() {
        0
    } else {
        LEFT_OUT
    })
}

fn handed_over(pushed: &Pushed) -> anyhow::Result<u8> {
    print(&format!(
        "{} files put, {} there already, {} removed\n",
        pushed.put, pushed.there, pushed.removed
    ))
}

/// Says what a look has done, if anything.
fn say(look: &Look) -> anyhow::Result<u8> {
    let added = &look.added;
    let mut status = 0;
    if added.new + added.known + added.refused.len() > 0 {
        status = report(added)?;
    }
    match &look.pushed {
        Some(Ok(pushed)) if pushed.put + pushed.removed > 0 => handed_over(pushed),
        Some(Err(error)) => {
            remark(&format!(
                "not handed over: {}",
                probecell_fleet::sentence(error)
            ));
            Ok(LEFT_OUT)
        }
        _ => Ok(0),
    }
    .map(|own| status.max(own))
}

/// s, from a hundredth to a day.
fn period(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok();
    let within = seconds.filter(|seconds| (0.01..=86_400.0).contains(seconds));
    within.ok_or_else(|| "must be a number of seconds from 0.01 to 86400".to_owned())
}

/// Tables and their columns.
fn contents() -> String {
    use probecell_fleet::lake::schema::{MONTH, TABLES, columns};
    let mut text: Vec<String> = Vec::new();
    for table in TABLES {
        text.push(format!("{}: {}\n", table.name, table.description));
        for column in columns(table) {
            let unit = if column.unit.is_empty() {
                String::new()
            } else {
                format!(" [{}]", column.unit)
            };
            text.push(format!("  {}{unit}: {}\n", column.name, column.description));
        }
        text.push(format!("  {MONTH}: year and month of the row\n"));
    }
    text.push("\nviews of `sql`:\n".to_owned());
    for view in sql::VIEWS {
        text.push(format!("  {}: {}\n", view.name, view.description));
    }
    text.push("\nfunctions of `sql`:\n".to_owned());
    for (call, answer) in sql::FUNCTIONS {
        text.push(format!("  {call}: {answer}\n"));
    }
    text.concat()
}

/// Text on standard output; a reader that has closed the pipe has seen enough.
fn print(text: &str) -> anyhow::Result<u8> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot write the output")
        }
        _ => Ok(0),
    }
}

/// Standard output; once its reader has closed the pipe nothing more is written.
#[derive(Default)]
struct Output {
    closed: bool,
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.closed {
            return Ok(bytes.len());
        }
        match std::io::stdout().lock().write(bytes) {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => {
                self.closed = true;
                Ok(bytes.len())
            }
            written => written,
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        if self.closed {
            return Ok(());
        }
        std::io::stdout().lock().flush()
    }
}

/// A remark on standard error.
#[expect(clippy::print_stderr, reason = "this is the terminal")]
pub(crate) fn remark(text: &str) {
    eprintln!("{text}");
}
