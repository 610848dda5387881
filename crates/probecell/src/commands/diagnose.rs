//! `probecell diagnose`: why a session differs from the declared model of its cell.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, bail};
use bags::{Bag, Measurement};
use cell::Cell;
use diagnosis::{
    DeclaredEffect, Options, Report, Residuals, Session, diagnose_together_with_residuals,
};
use session_io::Diagnosed;

use super::diagnose_refine::{self, Step};
use super::diagnose_time::Timed;
use crate::{GOOD, output};

/// What the user asks for.
#[derive(clap::Args, Default)]
pub(crate) struct Arguments {
    /// Bags: folders or .mcap files. Several are diagnosed jointly, with one set of causes.
    #[arg(required_unless_present = "fit")]
    bags: Vec<PathBuf>,
    /// Bags to fit; the same as positional bags, for use before `--withhold`.
    #[arg(long, num_args = 1.., conflicts_with = "bags")]
    fit: Vec<PathBuf>,
    /// Bags withheld from the fit, on which it is judged.
    #[arg(long, num_args = 1..)]
    withhold: Vec<PathBuf>,
    /// Diagnose each bag separately.
    #[arg(long, conflicts_with = "withhold")]
    each: bool,
    /// Plan to diagnose; default: all, or where one part was measured its last.
    #[arg(long)]
    plan: Option<String>,
    /// What to compare with the model: the touches, or the time of the moves between them.
    #[arg(long, value_enum, default_value_t, conflicts_with_all = ["fit", "withhold", "refine"])]
    channel: Channel,
    /// Exclude an effect from the library; may be repeated.
    #[arg(long)]
    without: Vec<String>,
    /// Use the declared model of this cell file instead of the one embedded in the bag.
    #[arg(long, value_name = "CELL")]
    model: Option<PathBuf>,
    /// Print JSON: one object, or one for each bag with `--each`.
    #[arg(long)]
    json: bool,
    /// Write a self-contained HTML page. Not with `--each`.
    #[arg(long, value_name = "FILE", conflicts_with = "each")]
    html: Option<PathBuf>,
    /// If the explanation remains ambiguous, have the running cell that recorded the bag take discriminating touches, and
    /// diagnose both measurements jointly.
    #[arg(long, conflicts_with_all = ["each", "fit", "withhold", "plan"])]
    refine: bool,
    /// Cell file of the running cell.
    #[arg(long, default_value = crate::DEFAULT_CELL, requires = "refine")]
    cell: PathBuf,
    /// Timeout of the additional measurement, in seconds.
    #[arg(long, alias = "patience-s", default_value_t = 900, requires = "refine")]
    timeout_s: u64,
}

impl Arguments {
    /// Those with which one measurement of a bag is read.
    pub(super) fn of(plan: Option<String>, model: Option<PathBuf>) -> Self {
        Self {
            plan,
            model,
            ..Self::default()
        }
    }
}

/// What is compared with the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum Channel {
    /// Deviations of the touches; for a drive session, its efforts or motion.
    #[default]
    Touch,
    /// Durations of the moves between the touches.
    Time,
}

/// Diagnoses the bags together, or each.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let options = Options {
        without: arguments.without.clone(),
        ..Options::default()
    };
    if arguments.refine {
        return refine(arguments, &options);
    }
    let bags = if arguments.fit.is_empty() {
        &arguments.bags
    } else {
        &arguments.fit
    };
    if arguments.channel == Channel::Time {
        return times(bags, arguments, &options);
    }
    if arguments.each || (bags.len() == 1 && arguments.withhold.is_empty()) {
        for path in bags {
            let found = diagnosed(path, arguments, &options)?;
            print(arguments, &found.report, &found.residuals)?;
        }
        return Ok(GOOD);
    }
    let sessions = |paths: &[PathBuf]| {
        paths
            .iter()
            .map(|path| read(path, arguments))
            .collect::<anyhow::Result<Vec<_>>>()
    };
    if let Some(both) = bags.iter().find(|path| arguments.withhold.contains(path)) {
        bail!(
            "{} is fitted and withheld: what is fitted cannot judge",
            both.display()
        );
    }
    let (fit, withheld) = (sessions(bags)?, sessions(&arguments.withhold)?);
    let (result, residuals) = diagnose_together_with_residuals(&fit, &withheld, &options)?;
    print(arguments, &result, &residuals)?;
    Ok(GOOD)
}

/// Diagnoses the time of the moves of each bag.
fn times(bags: &[PathBuf], arguments: &Arguments, options: &Options) -> anyhow::Result<u8> {
    if bags.len() > 1 && !arguments.each {
        bail!("--channel time takes one bag, or several with --each");
    }
    for path in bags {
        let timed = Timed::read(path, arguments.plan.as_deref(), arguments.model.as_deref())?;
        let (result, residuals) = timed.diagnose(options)?;
        print(arguments, &result, &residuals)?;
    }
    Ok(GOOD)
}

/// Diagnoses the bag, has a running cell take additional touches, and diagnoses both.
fn refine(arguments: &Arguments, options: &Options) -> anyhow::Result<u8> {
    let [path] = arguments.bags.as_slice() else {
        bail!("--refine takes one bag, not {}", arguments.bags.len());
    };
    let cell = Cell::read(&arguments.cell)?;
    let first = read(path, arguments)?;
    let timeout = Duration::from_secs(arguments.timeout_s);
    let mut tell = |step: Step<'_>| {
        if !arguments.json {
            output::line(&step.to_string());
        }
    };
    let refined = diagnose_refine::refine(&cell, &first, options, timeout, &mut tell)?;
    if let Some(file) = &arguments.html {
        write_page(file, &refined.after, &refined.residuals)?;
    }
    if arguments.json {
        output::json(&refined)?;
    }
    Ok(GOOD)
}

/// The page of a recording.
pub(super) fn html(bag: &Path) -> anyhow::Result<String> {
    let found = diagnosed(bag, &Arguments::default(), &Options::default())?;
    Ok(::report::diagnosis_page(&found.report, &found.residuals)?.html())
}

/// The diagnosis of a bag; what a person has to know of it is printed.
pub(super) fn diagnosed(
    path: &Path,
    arguments: &Arguments,
    options: &Options,
) -> anyhow::Result<Diagnosed> {
    let model = declared(arguments)?;
    let bag = Bag::open(path)?;
    let found = session_io::diagnosed(&bag, arguments.plan.as_deref(), model.as_deref(), options)?;
    for remark in &found.remarks {
        output::remark(remark);
    }
    Ok(found)
}

/// The effects of the cell file that replaces the embedded one.
fn declared(arguments: &Arguments) -> anyhow::Result<Option<Vec<DeclaredEffect>>> {
    let cell = arguments.model.as_deref().map(Cell::read).transpose()?;
    Ok(cell.map(|cell| cell.model.effects))
}

fn write_page(file: &Path, result: &Report, residuals: &Residuals) -> anyhow::Result<()> {
    let page = ::report::diagnosis_page(result, residuals)?;
    std::fs::write(file, page.html()).with_context(|| format!("cannot write {}", file.display()))
}

fn print(arguments: &Arguments, result: &Report, residuals: &Residuals) -> anyhow::Result<()> {
    if let Some(file) = &arguments.html {
        write_page(file, result, residuals)?;
    }
    if arguments.json {
        output::json(result)?;
    } else {
        output::line(&result.to_string());
    }
    Ok(())
}

/// The session of a bag; damage that leaves enough is a warning. Where the measurement is one of further touches, what
/// it adds to stands before it.
pub(super) fn read(path: &Path, arguments: &Arguments) -> anyhow::Result<Session> {
    let measurement = (arguments.plan.clone()).map_or(Measurement::Last, Measurement::Named);
    let model = declared(arguments)?;
    Ok(output::with_remarks(session_io::measured(
        path,
        &measurement,
        model.as_deref(),
    )?))
}
