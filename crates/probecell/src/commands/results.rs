//! `probecell results`: what a controller printed or wrote.
//!
//! A file that is not what it should be is refused as a whole, with line and column: half a measurement is none.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use bags::{Bag, Session};
use cell::Cell;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use controllers::{
    axes::Axis,
    dialect::{DIALECTS, formats},
    results::{Frame, Outcome, Results, ResultsFormat, Touch},
};
use graph::Stamp;
use machine::Chain;
use probecell_msgs::{InspectionPlan, ProbeEvent};
use serde_json::{Value, json};

use super::{
    controller_files::{axes, read_results},
    plan,
};
use crate::{GOOD, LOSS, output};

/// The value of `--format` that stands for none.
const AUTO: &str = "auto";

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Files written by the controller: one, or those of an interrupted program and of its continuation. A touch in a later
    /// file replaces that of the same point in an earlier one.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Format of the files.
    #[arg(long, default_value = AUTO, value_parser = format_names())]
    format: String,
    /// Cell file or bag with the plan that was measured; sizes are computed from the touches.
    #[arg(long, value_name = "CELL_OR_BAG")]
    plan: Option<PathBuf>,
    /// Address letter of an axis, if it differs from the axis name; as in `probecell program`.
    #[arg(long = "axis", value_name = "NAME=LETTER")]
    axes: Vec<String>,
    /// Machining allowance left on the sizes of a cell's part.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    allowance_mm: f64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

fn format_names() -> impl TypedValueParser<Value = String> {
    let auto = PossibleValue::new(AUTO).help("as the first line shows");
    let known = formats(DIALECTS)
        .map(|format| PossibleValue::new(format.name()).help(format.description()));
    PossibleValuesParser::new(std::iter::once(auto).chain(known))
}

/// A file in its format.
type Found = (&'static dyn ResultsFormat, Results);

/// Reads and prints.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let mut all = Vec::new();
    let format = formats(DIALECTS).find(|format| format.name() == arguments.format);
    for path in &arguments.files {
        all.push(read_results(path, format)?);
    }
    let complete = all.last().is_some_and(|(_, found)| found.complete);
    let sizes = match &arguments.plan {
        Some(source) => Some(sizes(arguments, source, &all)?),
        None => None,
    };
    if !complete {
        output::remark("warning: the program did not come to its end");
    }
    if arguments.json {
        let files = arguments.files.iter().zip(&all);
        let files = files.map(|(path, (format, found))| {
            json!({
                "file": path,
                "format": format.name(),
                "complete": found.complete,
                "content": found.content,
            })
        });
        let mut whole =
            json!({ "schema": "probecell/results/1", "files": files.collect::<Value>() });
        if let Some((deviations, features)) = &sizes {
            whole["deviations"] = serde_json::to_value(deviations)?;
            whole["features"] = serde_json::to_value(features)?;
        }
        output::json(&whole)?;
    } else {
        for line in all.iter().flat_map(|(_, found)| &found.lines) {
            output::line(line);
        }
        if let Some((_, features)) = &sizes {
            plan::print_features(features);
        }
    }
    Ok(if complete { GOOD } else { LOSS })
}

type Sizes = (Vec<probecell_msgs::TouchDeviation>, plan::Features);

/// Deviations and sizes from the touches and the plan, as the cell's own analysis computes them.
fn sizes(arguments: &Arguments, source: &Path, files: &[Found]) -> anyhow::Result<Sizes> {
    let mut touches: Vec<&Touch> = Vec::new();
    for (_, found) in files {
        let replaced = |old: &Touch| {
            let same = |new: &Touch| new.point_index == old.point_index;
            found.touches.iter().any(same)
        };
        touches.retain(|old| !replaced(old));
        touches.extend(&found.touches);
    }
    ensure!(
        !touches.is_empty(),
        "there is no touch to compare with the plan"
    );
    ensure!(
        touches.iter().all(|touch| touch.frame == Frame::Machine),
        "the touches are in work coordinates, from which the positions of the machine's axes do not follow"
    );
    let (plan, chain, axes) = planned(arguments, source)?;
    let mut events = Vec::new();
    for (sequence, touch) in (0..).zip(touches) {
        if touch.point_index as usize >= plan.points.len() {
            bail!(
                "touch {} is of point {}, but the plan has {} points",
                touch.number,
                touch.point_index,
                plan.points.len()
            );
        }
        let (axis_names, axis_positions) = positions(touch, &axes)?;
        chain
            .positions(&axis_names, &axis_positions)
            .with_context(|| format!("touch {}", touch.number))?;
        events.push(ProbeEvent {
            sequence,
            plan_id: plan.plan_id.clone(),
            point_index: touch.point_index,
            outcome: match touch.outcome {
                Outcome::Touch => ProbeEvent::OUTCOME_TOUCHED,
                Outcome::Miss => ProbeEvent::OUTCOME_NO_CONTACT,
                Outcome::Stuck => ProbeEvent::OUTCOME_EARLY,
            },
            axis_names,
            axis_positions,
            ..ProbeEvent::default()
        });
    }
    let stamped = (0..).map(Stamp).zip(&events);
    plan::analyse(chain, &plan, stamped.collect())
}

/// Names and positions (m, rad) of the axes of a touch.
fn positions(touch: &Touch, axes: &[Axis]) -> anyhow::Result<(Vec<String>, Vec<f64>)> {
    let mut names = Vec::new();
    let mut values = Vec::new();
    if let Some(letters) = &touch.axes {
        for (letter, value) in letters.iter().zip(&touch.position) {
            let axis = axes.iter().find(|axis| axis.letter == *letter);
            let axis = axis.with_context(|| {
                format!("touch {}: the machine has no axis {letter}", touch.number)
            })?;
            names.push(axis.name.clone());
            values.push(*value);
        }
    } else {
        ensure!(
            touch.position.len() == axes.len(),
            "touch {} has {} positions for {} axes",
            touch.number,
            touch.position.len(),
            axes.len()
        );
        for (axis, value) in axes.iter().zip(&touch.position) {
            names.push(axis.name.clone());
            values.push(axis.letter.from_controller(*value));
        }
    }
    Ok((names, values))
}

/// The plan that was measured, its machine, and the axes as the controller calls them.
fn planned(
    arguments: &Arguments,
    source: &Path,
) -> anyhow::Result<(InspectionPlan, Chain, Vec<Axis>)> {
    if plan::is_cell(source) {
        let cell = Cell::read(source)?;
        let chain = Chain::from_urdf(&cell.text().robot_description)?;
        let axes = match cell.controller_axes()? {
            Some(axes) => axes,
            None => axes(&chain, &arguments.axes)?,
        };
        ensure!(
            arguments.allowance_mm.is_finite(),
            "--allowance-mm must be a finite number"
        );
        let plan = super::plan::part_of(&cell, arguments.allowance_mm * 1e-3)?;
        return Ok((plan, chain, axes));
    }
    let session = Session::read(&Bag::open(source)?)?;
    let chain = Chain::from_urdf(&session.robot_description)?;
    let axes = axes(&chain, &arguments.axes)?;
    let plan = session
        .plan
        .with_context(|| format!("{} has no inspection plan", source.display()))?;
    Ok((plan, chain, axes))
}
