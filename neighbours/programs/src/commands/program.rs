//! `probecell program`: the measuring program of a plan for a controller.
//!
//! Targets are positions of the joints in the machine's coordinates, in the order that `probecell plan` finds, by moves that
//! go clear of the part. Every target lies within the limits of its axis before a line is written.

use std::path::PathBuf;

use anyhow::{Context, bail};
use bags::{Bag, Session};
use cell::Cell;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use machine::{Chain, JointKind};
use path_planning::Planned;
use probecell_msgs::{InspectionPlan, MeasurementOrder};
use programs::dialect::{Characteristic, Dialect, Job, ProgramWriter, by_name};
use programs::registry::DIALECTS;
use session_io::order::measuring_order;
use session_io::{embedded, is_cell_file};
use terminal::{GOOD, with_progress};

use super::controller_files::{axes, touched_points};

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  probecell program my_cell.toml --controller fanuc")]
pub(crate) struct Arguments {
    /// Cell file, or bag whose plan is programmed.
    source: PathBuf,
    /// Dialect of the controller that runs the program.
    #[arg(long, value_parser = writers())]
    controller: &'static dyn Dialect,
    /// Output file; default: standard output.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Address letter of an axis, if it differs from the axis name; may be repeated.
    #[arg(long = "axis", value_name = "NAME=LETTER")]
    axes: Vec<String>,
    /// Axis that retracts clear of the part first, and its clear position; required for a bag without an embedded cell file.
    #[arg(long, value_name = "AXIS=MM")]
    clearance: Option<String>,
    /// Machining allowance left on the sizes of a cell's part.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    allowance_mm: f64,
    /// Measure only these points (indices into the plan, from 0).
    #[arg(long, value_name = "INDEX", value_delimiter = ',')]
    points: Vec<u32>,
    /// Results of an interrupted program; points touched there are skipped. May be repeated.
    #[arg(long, value_name = "RESULTS")]
    measured: Vec<PathBuf>,
    /// Maximum feed of the moves between touches, which are guarded against contact (FANUC, SINUMERIK).
    #[arg(long, value_name = "MM/MIN", default_value_t = 3000.0)]
    travel_feed_mm_per_min: f64,
    /// Log file written by a LinuxCNC program, as a path of the controller.
    #[arg(long, value_name = "PATH", default_value = "probecell.log")]
    log: String,
    /// Write instead the program that cuts, measures and decides on this characteristic of a cell file, on the controller
    /// alone (FANUC, SINUMERIK): correct the tool wear and cut again, finish, or stop. It calls programs that you supply for
    /// roughing, finishing and measuring.
    #[arg(
        long,
        value_name = "CHARACTERISTIC",
        conflicts_with_all = ["points", "measured", "clearance", "axes"]
    )]
    decision: Option<String>,
}

/// The dialects that programs can be written in.
fn writers() -> impl TypedValueParser<Value = &'static dyn Dialect> {
    let writers = DIALECTS.iter().filter(|dialect| dialect.writer().is_some());
    let values =
        writers.map(|dialect| PossibleValue::new(dialect.name()).help(dialect.description()));
    PossibleValuesParser::new(values)
        .try_map(|name| by_name(DIALECTS, &name).ok_or("there is no such controller"))
}

/// Writes the program.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let writer = arguments.controller.writer();
    let writer = writer.context("no programs are written for this controller")?;
    if let Some(id) = &arguments.decision {
        let text = decision_program(arguments, id, writer)?;
        write(arguments, &text, &format!("decision on {id}"))?;
        return Ok(GOOD);
    }
    let source = Source::read(arguments)?;
    let axes = axes(&source.chain, &arguments.axes)?;
    let travel_feed = arguments.travel_feed_mm_per_min / 60e3;
    if !(travel_feed.is_finite() && travel_feed > 0.0) {
        bail!("--travel-feed-mm-per-min must be a finite number above 0");
    }
    let text = writer.measuring_program(&Job {
        plan: &source.plan,
        order: &source.order,
        axes: &axes,
        travel_feed,
        log_path: &arguments.log,
        settings: source.settings(arguments.controller),
    })?;
    let (part, touches) = (&source.plan.part_id, source.order.order.len());
    write(arguments, &text, &format!("{part}: {touches} touches"))?;
    Ok(source.status)
}

fn write(arguments: &Arguments, text: &str, what: &str) -> anyhow::Result<()> {
    match &arguments.output {
        None => terminal::line(text.trim_end()),
        Some(path) => {
            std::fs::write(path, text)
                .with_context(|| format!("the program cannot be written to {}", path.display()))?;
            terminal::line(&format!("{what} in {}", path.display()));
        }
    }
    Ok(())
}

/// The decision program of a characteristic of a cell file.
fn decision_program(
    arguments: &Arguments,
    id: &str,
    writer: &dyn ProgramWriter,
) -> anyhow::Result<String> {
    if !is_cell_file(&arguments.source) {
        bail!("--decision needs a cell file, which alone contains tolerances and limits");
    }
    let cell = Cell::read(&arguments.source)?;
    let mut characteristics = cell.compensation.characteristics.iter();
    let characteristic = characteristics
        .find(|characteristic| characteristic.id == id)
        .with_context(|| {
            format!("--decision: {id:?} is not one of compensation.characteristics")
        })?;
    let tool_number = characteristic
        .tool_number
        .with_context(|| format!("--decision: no tool corrects {id:?}"))?;
    let mut features = cell.part.features.iter();
    let nominal = features
        .find(|feature| feature.id == id && matches!(feature.kind.as_str(), "cylinder" | "bore"))
        .map(|feature| feature.radius_mm * 2e-3)
        .with_context(|| format!("--decision: {id:?} is not a diameter of the part"))?;
    Ok(writer.decision_program(&Characteristic {
        nominal,
        tolerance: characteristic.tolerance_mm * 1e-3,
        wear_limit: -cell.compensation.wear_limit_mm * 1e-3,
        max_corrections: cell.compensation.max_corrections,
        inner: characteristic.inner,
        tool_number,
    })?)
}

/// What is to be programmed.
struct Source {
    plan: InspectionPlan,
    order: MeasurementOrder,
    status: u8,
    chain: Chain,
    cell: Option<Cell>,
}

impl Source {
    fn read(arguments: &Arguments) -> anyhow::Result<Self> {
        if !arguments.allowance_mm.is_finite() {
            bail!("--allowance-mm must be a finite number");
        }
        let mut measured = Vec::new();
        for file in &arguments.measured {
            measured.extend(touched_points(file)?);
        }
        let wanted = |point: u32| {
            (arguments.points.is_empty() || arguments.points.contains(&point))
                && !measured.contains(&point)
        };
        if is_cell_file(&arguments.source) {
            let mut cell = Cell::read(&arguments.source)?;
            let chain = Chain::from_urdf(&cell.text().robot_description)?;
            if let Some((axis, position)) = clearance(arguments, &chain)? {
                cell.path_planning
                    .clearance_axis
                    .clone_from(&chain.axis(axis).name);
                cell.path_planning.clearance_mm = position * 1e3;
            }
            let allowance = arguments.allowance_mm * 1e-3;
            let plan =
                |progress: &mut dyn FnMut(&_)| cell.measuring_order(allowance, &wanted, progress);
            let Planned { plan, order } = with_progress(plan)?;
            check_points(arguments, &order)?;
            return Ok(Self {
                plan,
                order,
                status: GOOD,
                chain,
                cell: Some(cell),
            });
        }
        let bag = Bag::open(&arguments.source)?;
        let chain = Chain::from_urdf(&Session::read(&bag)?.robot_description)?;
        let clearance = match (clearance(arguments, &chain)?, embedded::cell(&bag)?) {
            (Some(clearance), _) => Some(clearance),
            (None, Some(cell)) => {
                let config = cell
                    .path_planning
                    .check(chain.clone(), &cell.part, Vec::new())?;
                config.clearance
            }
            (None, None) => bail!(
                "the bag does not contain its cell file, which names the axis that retracts clear of the part: give --clearance AXIS=MM"
            ),
        };
        let plan =
            |progress: &mut dyn FnMut(&_)| measuring_order(&bag, clearance, &wanted, progress);
        let (Planned { plan, order }, damage) = with_progress(plan)?;
        let status = terminal::damage(&damage);
        check_points(arguments, &order)?;
        Ok(Self {
            plan,
            order,
            status,
            chain,
            cell: None,
        })
    }
}

impl Source {
    /// Settings of the driver of the dialect's name, where the cell file has them.
    fn settings(&self, dialect: &dyn Dialect) -> Option<&dyn std::any::Any> {
        Some(self.cell.as_ref()?.driver_settings(dialect.name())?)
    }
}

/// Refuses a program without a touch, and points that the plan does not have.
fn check_points(arguments: &Arguments, order: &MeasurementOrder) -> anyhow::Result<()> {
    let known = |point: &&u32| !order.order.contains(point);
    if arguments.measured.is_empty()
        && let Some(missing) = arguments.points.iter().find(known)
    {
        bail!("--points: point {missing} is not among those that can be touched");
    }
    if order.order.is_empty() {
        bail!("no point is left to touch");
    }
    Ok(())
}

/// Axis (index in the chain's axes) and position (m) that the user calls clear.
fn clearance(arguments: &Arguments, chain: &Chain) -> anyhow::Result<Option<(usize, f64)>> {
    let Some(text) = &arguments.clearance else {
        return Ok(None);
    };
    let parts = text.split_once('=').and_then(|(axis, position)| {
        let position: f64 = position.parse().ok()?;
        let axis = chain.axis_index(axis)?;
        let linear = chain.axis(axis).kind == JointKind::Prismatic;
        (linear && position.is_finite()).then_some((axis, position * 1e-3))
    });
    parts
        .map(Some)
        .with_context(|| format!("--clearance {text:?} is not a linear axis of the machine and mm"))
}
