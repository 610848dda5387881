//! `probecell adopt`: adds the effects found by a gap report to the cell's declared model, or removes them.
//!
//! Only the cell file changes, whole or not at all; comments and layout stay. The next session of that cell is diagnosed
//! against the larger model. Nothing is sent to a machine.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};
use cell::{Adopted, Cell, CellText};
use diagnosis::{DeclaredEffect, Report};

use super::gap_report;
use crate::{DEFAULT_CELL, GOOD, output};

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Report of `probecell diagnose --json`; `-` for standard input.
    #[arg(required_unless_present_any = ["remove", "list"])]
    report: Option<PathBuf>,
    /// Cell file.
    #[arg(long, default_value = DEFAULT_CELL)]
    cell: PathBuf,
    /// Of effects that the session could not distinguish, adopt this one.
    #[arg(long = "as", value_name = "NAME")]
    picks: Vec<String>,
    /// Combine the findings with an effect that is declared already.
    #[arg(long)]
    combine: bool,
    /// Remove an effect from the declared model.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["report", "list", "picks", "combine"])]
    remove: Option<String>,
    /// List the declared effects.
    #[arg(long, conflicts_with_all = ["report", "picks", "combine"])]
    list: bool,
}

/// Adopts, removes or lists.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let cell = Cell::read(&arguments.cell)?;
    if arguments.list {
        list(&cell);
    } else if let Some(name) = &arguments.remove {
        let (text, removed) = cell::remove(&cell, name)?;
        replace(&cell, &arguments.cell, &text)?;
        let times = if removed > 1 {
            format!(" ({removed} tables)")
        } else {
            String::new()
        };
        output::line(&format!("removed {name} from the declared model{times}"));
    } else if let Some(path) = &arguments.report {
        let (found, _) = gap_report::read(path)?;
        if found.channel == "time" {
            return adopt_motion(&cell, &found, arguments);
        }
        let adopted = cell::adopt(&cell, &found, &arguments.picks, arguments.combine)
            .with_context(|| path.display().to_string())?;
        replace(&cell, &arguments.cell, &adopted.text)?;
        print(&adopted);
    }
    Ok(GOOD)
}

/// Adds what a report has found to the declared model in a cell file; of effects that its session could not distinguish, the
/// first.
pub(crate) fn first_of_each(file: &Path, found: &Report) -> anyhow::Result<()> {
    let cell = Cell::read(file)?;
    let groups = found.effects.iter().filter(|one| one.group.len() > 1);
    let picks: Vec<String> = groups.map(|one| one.effect.clone()).collect();
    let adopted = cell::adopt(&cell, found, &picks, false)?;
    replace(&cell, file, &adopted.text)
}

/// Declares the motion that a report of the channel `time` has found.
fn adopt_motion(cell: &Cell, found: &Report, arguments: &Arguments) -> anyhow::Result<u8> {
    if arguments.combine {
        bail!(
            "--combine is for effects on touches: a report on time replaces what [motion] declares"
        );
    }
    let adopted =
        cell::adopt_motion(cell, found, &arguments.picks).with_context(|| found.bag.clone())?;
    replace(cell, &arguments.cell, &adopted.text)?;
    for (key, value) in &adopted.written {
        output::line(&format!("[motion] {key} = {value}"));
    }
    if let Some(durations) = &found.durations {
        output::line(&format!(
            "the moves of {} were promised {:.1} s and took {:.1} s; by the new limits they take {:.1} s",
            found.bag, durations.promised, durations.measured, durations.explained
        ));
    }
    Ok(GOOD)
}

/// Replaces the cell file, completely or not at all, if the new text is a valid cell file and no other program has
/// changed the file meanwhile.
fn replace(cell: &Cell, path: &Path, text: &str) -> anyhow::Result<()> {
    Cell::from_text(CellText {
        cell: text.to_owned(),
        ..cell.text().clone()
    })?;
    // A symbolic link continues to point to the file.
    let path = &fs::canonicalize(path)?;
    let folder = path.parent().unwrap_or(Path::new("/"));
    let cannot = || format!("cannot write the cell file {}", path.display());
    let mut file = tempfile::NamedTempFile::new_in(folder).with_context(cannot)?;
    file.write_all(text.as_bytes()).with_context(cannot)?;
    fs::set_permissions(file.path(), fs::metadata(path)?.permissions()).with_context(cannot)?;
    file.as_file().sync_all().with_context(cannot)?;
    if fs::read_to_string(path).with_context(cannot)? != cell.text().cell {
        bail!(
            "{} was changed meanwhile: nothing was written",
            path.display()
        );
    }
    file.persist(path).with_context(cannot)?;
    Ok(())
}

fn print(adopted: &Adopted) {
    for effect in &adopted.effects {
        output::line(&format!("adopted {}", line(effect)));
    }
    for error in &adopted.left_out {
        output::remark(&format!("skipped: {error}"));
    }
}

fn list(cell: &Cell) {
    if cell.model.effects.is_empty() {
        output::line("the declared model has no effects besides the robot description");
    }
    for effect in &cell.model.effects {
        output::line(&line(effect));
    }
}

/// One declared effect in a line.
fn line(effect: &DeclaredEffect) -> String {
    let values: Vec<String> = (effect.parameters.iter())
        .map(|one| diagnosis::in_display_units(&one.name, one.value, &one.unit, one.ci95))
        .collect();
    let mut parts = vec![format!("{}: {}", effect.effect, values.join(", "))];
    if let Some(promise) = &effect.promised {
        let [before, after] = [promise.rms_before_m, promise.rms_after_m].map(|size| size * 1e6);
        parts.push(format!("promised {before:.2} µm -> {after:.2} µm"));
    }
    if let Some(source) = &effect.source {
        parts.push(format!("found in {source}"));
    }
    if let Some(measured) = &effect.measured {
        parts.push(format!("measured {measured}"));
    }
    if !effect.chosen_from.is_empty() {
        parts.push(format!("chosen from {}", effect.chosen_from.join(", ")));
    }
    parts.join("; ")
}
