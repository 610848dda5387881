//! `probecell scenario`: the register of known gaps, run and judged.
//!
//! Exit status: 0 all rules kept, 1 one broken, 2 wrong usage.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde_json::{Map, json};
use validation::scenarios::{Judged, Run, Scenario, Value};

use session_io::write;
use terminal::{FAILED, GOOD};

/// What the user asks for.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// List the scenarios.
    #[command(after_help = "Example:\n  probecell scenario list")]
    List {
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Run scenarios and compare them with the figures of their source.
    #[command(after_help = "Examples:\n  \
        probecell scenario run A-probe-offset --html page.html\n  \
        probecell scenario run --all")]
    Run(RunArguments),
}

/// What is to be run.
#[derive(clap::Args)]
pub(crate) struct RunArguments {
    /// Names of scenarios, as printed by `list`.
    #[arg(required_unless_present = "all")]
    names: Vec<String>,
    /// Run all scenarios.
    #[arg(long, conflicts_with = "names")]
    all: bool,
    /// Random seed. Rules on a proportion of runs that is close to its limit may fail with another seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Write a page for each scenario into this folder, or of a single scenario into this .html file.
    #[arg(long, value_name = "PATH")]
    html: Option<PathBuf>,
    /// Write the sessions of each scenario as recordings below this folder.
    #[arg(long, value_name = "DIR")]
    bag: Option<PathBuf>,
}

/// The JSON object.
#[derive(Serialize)]
struct Document<'a> {
    scenarios: Vec<Row<'a>>,
}

/// One scenario in it.
#[derive(Serialize)]
struct Row<'a> {
    name: &'a str,
    /// Figures of the source, by key.
    source: Map<String, serde_json::Value>,
    /// Figures of the run, by key.
    ours: Map<String, serde_json::Value>,
    pass: bool,
    effect: &'a str,
    seed: u64,
    reference: &'a str,
    figures: Vec<serde_json::Value>,
    sessions: Vec<serde_json::Value>,
    remarks: &'a [String],
}

/// Lists or runs.
pub(super) fn run(command: &Command) -> anyhow::Result<u8> {
    match command {
        Command::List { json } => list(*json),
        Command::Run(arguments) => run_all(arguments),
    }
}

fn list(as_json: bool) -> anyhow::Result<u8> {
    let all = validation::scenarios::register();
    if as_json {
        let rows = all
            .iter()
            .map(|one| json!({ "name": one.name, "effect": one.effect, "reference": one.source }));
        terminal::json(&json!({ "scenarios": rows.collect::<Vec<_>>() }))?;
    } else {
        for one in all {
            terminal::line(&format!("{:<16} {}", one.name, one.effect));
        }
    }
    Ok(GOOD)
}

fn run_all(arguments: &RunArguments) -> anyhow::Result<u8> {
    let chosen: Vec<&Scenario> = if arguments.all {
        validation::scenarios::register().iter().collect()
    } else {
        let found = arguments
            .names
            .iter()
            .map(|name| validation::scenarios::find(name));
        found.collect::<Result<_, _>>()?
    };
    let pages = arguments
        .html
        .as_deref()
        .map(|path| Pages::at(path, chosen.len()));
    let pages = pages.transpose()?;
    let bar = progress_bar(chosen.len())?;
    let mut judged = Vec::new();
    for (index, scenario) in chosen.iter().enumerate() {
        bar.set_message(scenario.name);
        let run = Run {
            seed: arguments.seed,
            progress: &|share| bar.set_position(position(index, share)),
        };
        let one = scenario
            .judge(&run)
            .with_context(|| format!("scenario {}", scenario.name))?;
        bar.set_position(position(index + 1, 0.0));
        if let Some(folder) = &arguments.bag {
            record(folder, scenario, &one)?;
        }
        if let Some(pages) = &pages {
            page(&pages.of(scenario), scenario, &one, arguments.seed)?;
        }
        judged.push(one);
    }
    bar.finish_and_clear();
    if arguments.json {
        let rows: Vec<Row<'_>> = chosen
            .iter()
            .zip(&judged)
            .map(|(scenario, one)| row(scenario, one, arguments.seed))
            .collect();
        terminal::json(&Document { scenarios: rows })?;
    } else {
        for (scenario, one) in chosen.iter().zip(&judged) {
            print(scenario, one);
        }
    }
    let all_pass = judged.iter().all(Judged::passes);
    Ok(if all_pass { GOOD } else { FAILED })
}

/// Steps of the progress bar that one scenario has.
const STEPS: u64 = 1000;

fn position(index: usize, share: f64) -> u64 {
    index as u64 * STEPS + (share.clamp(0.0, 1.0) * STEPS as f64) as u64
}

fn progress_bar(count: usize) -> anyhow::Result<ProgressBar> {
    let style = ProgressStyle::with_template("{wide_bar} {percent} % {msg}")?;
    Ok(ProgressBar::new(position(count, 0.0)).with_style(style))
}

/// Where the pages go.
enum Pages<'a> {
    /// One for each scenario, named after it.
    Folder(&'a Path),
    /// The only one.
    File(&'a Path),
}

impl<'a> Pages<'a> {
    fn at(path: &'a Path, count: usize) -> anyhow::Result<Self> {
        let file = path.extension().is_some_and(|end| end == "html") && !path.is_dir();
        if file && count > 1 {
            bail!(
                "{count} scenarios do not go into one page: --html needs a folder, not {}",
                path.display()
            );
        }
        Ok(if file {
            Self::File(path)
        } else {
            Self::Folder(path)
        })
    }

    fn of(&self, scenario: &Scenario) -> PathBuf {
        match self {
            Self::Folder(folder) => folder.join(format!("{}.html", scenario.name)),
            Self::File(file) => file.to_path_buf(),
        }
    }
}

fn page(file: &Path, scenario: &Scenario, judged: &Judged, seed: u64) -> anyhow::Result<()> {
    let made_by = concat!(
        "probecell ",
        env!("CARGO_PKG_VERSION"),
        ", revision ",
        env!("PROBECELL_REVISION")
    );
    let html = validation::scenarios::page(scenario, judged, seed, made_by)?.html();
    let folder = file.parent().unwrap_or(Path::new(""));
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(file, html))
        .with_context(|| format!("cannot write {}", file.display()))
}

fn record(folder: &Path, scenario: &Scenario, judged: &Judged) -> anyhow::Result<()> {
    for (recorded, _) in &judged.sessions {
        let name = format!("{}-{}", scenario.name, recorded.name);
        write::write(&folder.join(name), "scenario", &recorded.session)?;
    }
    Ok(())
}

fn row<'a>(scenario: &'a Scenario, judged: &'a Judged, seed: u64) -> Row<'a> {
    let figures = &judged.outcome.figures;
    let value = |value: &Value| serde_json::to_value(value).unwrap_or_default();
    Row {
        name: scenario.name,
        effect: scenario.effect,
        source: figures
            .iter()
            .filter_map(|figure| Some((figure.key.clone(), value(figure.source.as_ref()?))))
            .collect(),
        ours: figures
            .iter()
            .map(|figure| (figure.key.clone(), value(&figure.ours)))
            .collect(),
        pass: judged.passes(),
        seed,
        reference: scenario.source,
        figures: figures
            .iter()
            .map(|figure| {
                json!({
                    "name": figure.key, "title": figure.title, "unit": figure.unit,
                    "source": figure.source, "ours": figure.ours,
                    "rule": figure.rule_text(), "pass": figure.passes(),
                })
            })
            .collect(),
        sessions: judged
            .sessions
            .iter()
            .map(|(recorded, report)| json!({ "name": recorded.name, "diagnosis": report }))
            .collect(),
        remarks: &judged.outcome.remarks,
    }
}

fn print(scenario: &Scenario, judged: &Judged) {
    let verdict = if judged.passes() { "pass" } else { "FAIL" };
    terminal::line(&format!(
        "{}: {verdict}  ({})",
        scenario.name, scenario.effect
    ));
    for figure in &judged.outcome.figures {
        let mark = if figure.passes() { ' ' } else { '!' };
        let source = figure
            .source
            .as_ref()
            .map_or_else(String::new, |source| format!("  source {}", source.text()));
        let rule = match figure.rule_text() {
            text if text.is_empty() => text,
            text => format!("  ({text})"),
        };
        terminal::line(&format!(
            " {mark} {}: {} {}{source}{rule}",
            figure.title,
            figure.ours.text(),
            figure.unit
        ));
    }
    for remark in &judged.outcome.remarks {
        terminal::line(&format!("   {remark}"));
    }
}
