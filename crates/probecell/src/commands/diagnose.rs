//! `probecell diagnose`: why a session differs from the declared model of its cell.

use std::path::{Path, PathBuf};

use bags::{Bag, Measurement};
use diagnosis::{Options, Session, diagnose, diagnose_drives};

use crate::{GOOD, report};

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Bags: folders or .mcap files.
    #[arg(required = true)]
    bags: Vec<PathBuf>,
    /// The plan to diagnose where a bag holds several; the last one measured if none is named.
    #[arg(long)]
    plan: Option<String>,
    /// Drive bags that judge what the others were fitted to.
    #[arg(long, num_args = 1..)]
    withhold: Vec<PathBuf>,
    /// Leave an effect out of the library.
    #[arg(long)]
    without: Vec<String>,
    /// Print JSON, one object for each bag.
    #[arg(long)]
    json: bool,
}

/// Diagnoses each bag.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    if !arguments.withhold.is_empty() {
        return drives(arguments);
    }
    let options = Options {
        without: arguments.without.clone(),
    };
    for path in &arguments.bags {
        let session = read(path, arguments.plan.as_deref())?;
        let result = diagnose(&session, &options)?;
        if arguments.json {
            report::json(&result)?;
        } else {
            report::line(&result.to_string());
        }
    }
    Ok(GOOD)
}

/// Fits drive bags together and judges on those withheld.
fn drives(arguments: &Arguments) -> anyhow::Result<u8> {
    let sessions = |paths: &[PathBuf]| {
        paths
            .iter()
            .map(|path| read(path, None))
            .collect::<anyhow::Result<Vec<_>>>()
    };
    let result = diagnose_drives(&sessions(&arguments.bags)?, &sessions(&arguments.withhold)?)?;
    if arguments.json {
        report::json(&result)?;
    } else {
        report::line(&result.to_string());
    }
    Ok(GOOD)
}

fn read(path: &Path, plan: Option<&str>) -> anyhow::Result<Session> {
    let bag = Bag::open(path)?;
    let measurement = plan.map_or(Measurement::Last, |plan| {
        Measurement::Named(plan.to_owned())
    });
    let session = bags::Session::read_measurement(&bag, &measurement)?;
    for damage in &session.damage {
        report::remark(&format!(
            "warning: {damage}: only the complete part is diagnosed"
        ));
    }
    Ok(Session {
        name: path
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        robot_description: session.robot_description,
        plan: session.plan,
        events: session
            .events
            .into_iter()
            .map(|stamped| stamped.message)
            .collect(),
        joint_states: session
            .joint_states
            .into_iter()
            .map(|stamped| stamped.message)
            .collect(),
        joint_commands: session
            .joint_commands
            .into_iter()
            .map(|stamped| stamped.message)
            .collect(),
        machine_states: session
            .machine_states
            .into_iter()
            .map(|stamped| stamped.message)
            .collect(),
        references: session
            .references
            .into_iter()
            .map(|stamped| stamped.message)
            .collect(),
    })
}
