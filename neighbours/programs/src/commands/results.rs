//! `probecell results`: what a controller printed or wrote.
//!
//! With `--out` the touches become a session that `report`, `diagnose` and `adopt` take like any other.
//!
//! A file that is not what it should be is refused as a whole, with line and column: half a measurement is none.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use bags::{Bag, Session};
use cell::{Cell, CellText};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use controllers::axes::Axis;
use exchange::import::{Counts, Imported};
use graph::Stamp;
use machine::{Chain, Nominal};
use probecell_msgs::{FeatureResult, InspectionPlan, ProbeEvent};
use programs::{
    dialect::formats,
    registry::DIALECTS,
    results::{Frame, Outcome, Results, ResultsFormat, Touch},
};
use serde_json::{Value, json};
use session_io::evaluation::{Features, evaluate};
use session_io::sizes::conformity;
use session_io::{embedded, imported, is_cell_file};
use terminal::{GOOD, LOSS, with_progress};

use super::controller_files::{axes, read_results};

/// The value of `--format` that stands for none.
const AUTO: &str = "auto";

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
probecell results O9000.txt --plan my_cell.toml\n  \
probecell results O9000.txt --plan my_cell.toml --out my_session && probecell report my_session")]
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
    /// Standard uncertainty of one touch, from which U follows; default: that of the cell file.
    #[arg(long, value_name = "UM", requires = "plan")]
    touch_uncertainty_um: Option<f64>,
    /// Folder of a recording to be written with plan, touches and sizes; must not exist.
    #[arg(long, value_name = "FOLDER", requires = "plan")]
    out: Option<PathBuf>,
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
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let mut all = Vec::new();
    let format = formats(DIALECTS).find(|format| format.name() == arguments.format);
    for path in &arguments.files {
        all.push(read_results(path, format)?);
    }
    let complete = all.last().is_some_and(|(_, found)| found.complete);
    let measured = match &arguments.plan {
        Some(source) => Some(measured(arguments, source, &all)?),
        None => None,
    };
    let sizes = match &measured {
        Some(measured) => Some(measured.sizes()?),
        None => None,
    };
    if let (Some(measured), Some(folder)) = (&measured, &arguments.out) {
        measured.write(folder, &arguments.files)?;
    }
    if !complete {
        terminal::warning("the measuring program did not finish");
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
        terminal::json(&whole)?;
    } else {
        for line in all.iter().flat_map(|(_, found)| &found.lines) {
            terminal::line(line);
        }
        if let (Some((_, features)), Some(measured)) = (&sizes, &measured) {
            measured.print(features);
        }
    }
    Ok(if complete { GOOD } else { LOSS })
}

type Sizes = (Vec<probecell_msgs::TouchDeviation>, Features);

/// Touches of a plan on their machine, and how sizes follow from them.
struct Measured {
    imported: Imported,
    analysis: analysis::RawConfig,
    cell: Option<CellText>,
}

impl Measured {
    /// Deviations and sizes, as the cell's own analysis computes them.
    fn sizes(&self) -> anyhow::Result<Sizes> {
        let chain = Chain::from_urdf(&self.imported.robot_description)?;
        let stamped = (0..).map(Stamp).zip(&self.imported.events);
        let config = self.analysis.check(chain)?;
        evaluate(config, &self.imported.plan, stamped.collect())
    }

    /// A line for each size: deviation with U, limits and conformity.
    fn print(&self, features: &Features) {
        for result in features.values() {
            if result.decision == FeatureResult::INVALID {
                terminal::line(&format!("  {:<20} {}", result.feature_id, result.text));
                continue;
            }
            let nominal = self.imported.plan.features.iter();
            let nominal = nominal.into_iter().find(|one| one.id == result.feature_id);
            let limits = nominal.map(|one| [one.lower_tolerance, one.upper_tolerance]);
            let limits = limits.filter(|limits| limits.iter().any(|limit| limit.is_finite()));
            let judged = limits.map_or(String::new(), |[lower, upper]| {
                format!(
                    "  limits {:+.2} to {:+.2} µm  {}",
                    lower * 1e6,
                    upper * 1e6,
                    conformity(result).replace('_', " ")
                )
            });
            terminal::line(&format!(
                "  {:<20} {:10.4} mm  {:+8.2} µm  U {:.2} µm (k = {})  form {:7.2} µm{judged}  {}",
                result.feature_id,
                result.size * 1e3,
                result.size_deviation * 1e6,
                result.expanded_uncertainty() * 1e6,
                result.coverage_factor,
                result.form * 1e6,
                result.text
            ));
        }
    }

    /// Writes the session.
    fn write(&self, folder: &Path, files: &[PathBuf]) -> anyhow::Result<()> {
        let source = imported::Source {
            kind: "results",
            files: files.to_vec(),
            settings: Vec::new(),
            cell: self.cell.clone(),
            revision: env!("PROBECELL_REVISION"),
        };
        imported::write(folder, &self.imported, Some(&self.analysis), &source)?;
        Ok(())
    }
}

/// The touches of all files as events of the plan; a later file replaces points of an earlier one.
fn measured(arguments: &Arguments, source: &Path, files: &[Found]) -> anyhow::Result<Measured> {
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
    let planned = planned(arguments, source)?;
    let (plan, chain) = (&planned.plan, &planned.chain);
    let nominal = Nominal::from_plan(plan)?;
    let mut events = Vec::new();
    for (sequence, touch) in (0..).zip(touches) {
        let Some(point) = plan.points.get(touch.point_index as usize) else {
            bail!(
                "touch {} is of point {}, but the plan has {} points",
                touch.number,
                touch.point_index,
                plan.points.len()
            );
        };
        let (axis_names, axis_positions) = positions(touch, &planned.axes)?;
        let all = chain
            .positions(&axis_names, &axis_positions)
            .with_context(|| format!("touch {}", touch.number))?;
        let tip = chain.ball_in_part(&all, &nominal.part_pose, &nominal.ball);
        let normal: [f64; 3] = point.normal.into();
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
            tip: [tip.x, tip.y, tip.z].into(),
            approach: normal.map(|part| -part).into(),
            // The program approaches by the feed of the plan.
            feed: point.feed,
            ..ProbeEvent::default()
        });
    }
    let mut analysis = planned.analysis;
    if let Some(touch) = arguments.touch_uncertainty_um {
        analysis.touch_standard_uncertainty_um = touch;
    }
    let counts = Counts {
        read: events.len() as u64,
        ..Counts::default()
    };
    Ok(Measured {
        imported: Imported {
            robot_description: planned.urdf,
            plan: planned.plan,
            events,
            counts,
            ..Imported::default()
        },
        analysis,
        cell: planned.cell,
    })
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

/// The plan that was measured, its machine, the axes as the controller calls them, and how sizes are evaluated.
struct PlannedOn {
    plan: InspectionPlan,
    urdf: String,
    chain: Chain,
    axes: Vec<Axis>,
    analysis: analysis::RawConfig,
    cell: Option<CellText>,
}

fn planned(arguments: &Arguments, source: &Path) -> anyhow::Result<PlannedOn> {
    if is_cell_file(source) {
        let cell = Cell::read(source)?;
        let urdf = cell.text().robot_description.clone();
        let chain = Chain::from_urdf(&urdf)?;
        let axes = match cell.controller_axes()? {
            Some(axes) => axes,
            None => axes(&chain, &arguments.axes)?,
        };
        let allowance = arguments.allowance_mm * 1e-3;
        ensure!(
            allowance.is_finite(),
            "--allowance-mm must be a finite number"
        );
        return Ok(PlannedOn {
            plan: with_progress(|progress| cell.inspection_plan(allowance, progress))?,
            urdf,
            chain,
            axes,
            analysis: cell.analysis.clone(),
            cell: Some(cell.text().clone()),
        });
    }
    let bag = Bag::open(source)?;
    let session = Session::read(&bag)?;
    let chain = Chain::from_urdf(&session.robot_description)?;
    let recorded = embedded::cell(&bag)?;
    Ok(PlannedOn {
        plan: session
            .plan
            .with_context(|| format!("{} has no inspection plan", source.display()))?,
        urdf: session.robot_description,
        axes: axes(&chain, &arguments.axes)?,
        chain,
        analysis: recorded
            .as_ref()
            .map(|cell| cell.analysis.clone())
            .unwrap_or_default(),
        cell: recorded.map(|cell| cell.text().clone()),
    })
}
