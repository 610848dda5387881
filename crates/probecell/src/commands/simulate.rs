//! `probecell simulate --like BAG`: the session again, as its model would measure it, before and after its diagnosis.

use std::path::PathBuf;

use anyhow::Context;
use diagnosis::{Options, diagnose_with_residuals};
use report::predictive::{Predictive, USUAL_DRAWS};

use session_io::write;

use super::diagnose;
use crate::{FAILED, GOOD, output};

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Recording of touches whose machine, plan, touches and noise are simulated.
    #[arg(long, value_name = "BAG")]
    like: PathBuf,
    /// Plan to simulate; default: the last one measured.
    #[arg(long)]
    plan: Option<String>,
    /// Use the declared model of this cell file instead of the one embedded in the bag.
    #[arg(long, value_name = "CELL")]
    model: Option<PathBuf>,
    /// Number of simulated sessions.
    #[arg(long, default_value_t = USUAL_DRAWS)]
    draws: usize,
    /// Seed of the simulated sessions.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Write a self-contained HTML page.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Write one simulated session as a recording into this folder, which must not exist.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Diagnoses the session, and compares it with what the model before and after would have measured.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let reading = diagnose::Arguments::of(arguments.plan.clone(), arguments.model.clone());
    let session = diagnose::read(&arguments.like, &reading)?;
    let (report, residuals) = diagnose_with_residuals(&session, &Options::default())?;
    let model = Predictive::new(&session, &report, &residuals)?;
    let check = model.check(arguments.draws, arguments.seed)?;
    let page = check.page()?;
    if let Some(folder) = &arguments.out {
        let again = model.again(arguments.seed);
        write::write(folder, "cell", &again.session)
            .with_context(|| format!("cannot write {}", folder.display()))?;
    }
    if let Some(file) = &arguments.html {
        std::fs::write(file, page.html())
            .with_context(|| format!("cannot write {}", file.display()))?;
    }
    if arguments.json {
        output::json(&check)?;
    } else {
        output::line(page.text().trim_end());
    }
    Ok(if check.after.contradictions == 0 {
        GOOD
    } else {
        FAILED
    })
}
