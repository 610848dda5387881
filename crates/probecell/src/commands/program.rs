//! `probecell program`: the measuring program of a plan for a controller.
//!
//! Targets are positions of the joints in the machine's coordinates, in the order that `probecell plan` finds, by moves that
//! go clear of the part. Every target lies within the limits of its axis before a line is written.

use std::path::PathBuf;

use anyhow::{Context, bail};
use bags::{Bag, Session};
use cell::Cell;
use controllers::{
    axes::{Axis, Letter},
    fanuc,
    linuxcnc::{
        Config, RawConfig,
        program::{self, Settings, Touching},
    },
    sinumerik,
};
use machine::{Chain, JointKind};
use probecell_msgs::{InspectionPlan, MeasurementOrder};

use super::{plan, replay::embedded_cell, results};
use crate::report;

/// Period of LinuxCNC's position loop where no cell file says it, s.
const SERVO_PERIOD: f64 = 1e-3;

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Cell file, or a bag whose plan is programmed.
    source: PathBuf,
    /// Controller that runs the program.
    #[arg(long)]
    controller: Controller,
    /// File to write; standard output otherwise.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Letter of an axis in programs, where it is not the axis' name; once for each such axis.
    #[arg(long = "axis", value_name = "NAME=LETTER")]
    axes: Vec<String>,
    /// Axis that goes clear of the part first, and where it is clear; needed for a bag that does not hold its cell file.
    #[arg(long, value_name = "AXIS=MM")]
    clearance: Option<String>,
    /// Allowance that the cut leaves on the sizes of a cell's part.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    allowance_mm: f64,
    /// Touch only these points, for example to measure one again.
    #[arg(long, value_name = "INDEX", value_delimiter = ',')]
    points: Vec<u32>,
    /// What a program wrote before it broke off: points that it touched are not touched again.
    #[arg(long, value_name = "RESULTS")]
    measured: Vec<PathBuf>,
    /// Feed between touches, which are guarded against contact (FANUC, SINUMERIK).
    #[arg(long, value_name = "MM/MIN", default_value_t = 3000.0)]
    travel_feed_mm_per_min: f64,
    /// Log that a LinuxCNC program writes, as the controller knows it.
    #[arg(long, value_name = "PATH", default_value = "probecell.log")]
    log: String,
}

/// Whose language a program is in.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Controller {
    /// G-code of LinuxCNC; results by a log.
    Linuxcnc,
    /// FANUC custom macro; results by DPRNT.
    Fanuc,
    /// SINUMERIK; results by WRITE.
    Sinumerik,
}

/// Writes the program.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let source = Source::read(arguments)?;
    let axes = axes(&source.chain, &arguments.axes)?;
    let travel = arguments.travel_feed_mm_per_min / 60e3;
    if !(travel.is_finite() && travel > 0.0) {
        bail!("--travel-feed-mm-per-min must be a finite number above 0");
    }
    let text = match arguments.controller {
        Controller::Linuxcnc => linuxcnc_program(&source, &axes, &arguments.log)?,
        Controller::Fanuc => {
            fanuc::program::measuring_program(&source.plan, &source.order, &axes, travel)?
        }
        Controller::Sinumerik => {
            sinumerik::program::measuring_program(&source.plan, &source.order, &axes, travel)?
        }
    };
    match &arguments.output {
        None => report::line(text.trim_end()),
        Some(path) => {
            std::fs::write(path, text)
                .with_context(|| format!("the program cannot be written to {}", path.display()))?;
            report::line(&format!(
                "{}: {} touches in {}",
                source.plan.part_id,
                source.order.order.len(),
                path.display()
            ));
        }
    }
    Ok(source.status)
}

/// What is to be programmed.
struct Source {
    plan: InspectionPlan,
    order: MeasurementOrder,
    status: u8,
    chain: Chain,
    /// Settings of the cell's own LinuxCNC.
    linuxcnc: Option<Config>,
}

impl Source {
    fn read(arguments: &Arguments) -> anyhow::Result<Self> {
        if !arguments.allowance_mm.is_finite() {
            bail!("--allowance-mm must be a finite number");
        }
        let mut measured = Vec::new();
        for file in &arguments.measured {
            measured.extend(results::touched(file)?);
        }
        let wanted = |point: u32| {
            (arguments.points.is_empty() || arguments.points.contains(&point))
                && !measured.contains(&point)
        };
        if plan::is_cell(&arguments.source) {
            let mut cell = Cell::read(&arguments.source)?;
            let chain = Chain::from_urdf(&cell.text().robot_description)?;
            if let Some((axis, position)) = clearance(arguments, &chain)? {
                cell.path_planning
                    .clearance_axis
                    .clone_from(&chain.axis(axis).name);
                cell.path_planning.clearance_mm = position * 1e3;
            }
            let (plan, order, status) =
                plan::of_cell(&cell, arguments.allowance_mm * 1e-3, &wanted)?;
            left(arguments, &order)?;
            return Ok(Self {
                plan,
                order,
                status,
                chain,
                linuxcnc: cell.linuxcnc.clone().map(RawConfig::check).transpose()?,
            });
        }
        let bag = Bag::open(&arguments.source)?;
        let chain = Chain::from_urdf(&Session::read(&bag)?.robot_description)?;
        let way = match (clearance(arguments, &chain)?, embedded_cell(&bag)?) {
            (Some(way), _) => Some(way),
            (None, Some(cell)) => {
                let config = cell
                    .path_planning
                    .check(chain.clone(), &cell.part, Vec::new())?;
                config.clearance
            }
            (None, None) => bail!(
                "the bag does not hold its cell file, so nobody knows which axis goes clear of the part: give --clearance AXIS=MM"
            ),
        };
        let (plan, order, status) = plan::of_bag(&bag, way, &wanted)?;
        left(arguments, &order)?;
        Ok(Self {
            plan,
            order,
            status,
            chain,
            linuxcnc: None,
        })
    }
}

/// Refuses a program without a touch, and points that the plan does not have.
fn left(arguments: &Arguments, order: &MeasurementOrder) -> anyhow::Result<()> {
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

/// The chain's axes as the controller calls them: by their own name, or by the letter given for it.
pub(crate) fn axes(chain: &Chain, letters: &[String]) -> anyhow::Result<Vec<Axis>> {
    let mut given = Vec::new();
    for text in letters {
        let pair = text
            .split_once('=')
            .with_context(|| format!("--axis {text:?} is not NAME=LETTER"))?;
        if chain.axis_index(pair.0).is_none() {
            bail!("--axis {text:?}: the machine has no axis {:?}", pair.0);
        }
        given.push(pair);
    }
    let mut axes: Vec<Axis> = Vec::new();
    for (joint, name) in chain.axis_names().enumerate() {
        let letter = given
            .iter()
            .rev()
            .find(|(axis, _)| *axis == name)
            .map_or(name, |(_, letter)| letter);
        let letter: Letter = letter
            .parse()
            .with_context(|| format!("axis {name:?} needs a letter: give --axis {name}=LETTER"))?;
        let one = chain.axis(joint);
        if letter.is_rotary() != (one.kind == JointKind::Revolute) {
            bail!("axis {name:?} cannot be {letter}: X, Y, Z are linear, A, B, C turn");
        }
        if axes.iter().any(|axis| axis.letter == letter) {
            bail!("two axes of the machine are called {letter}: give --axis NAME=LETTER");
        }
        axes.push(Axis {
            name: name.to_owned(),
            letter,
            joint,
            limits: one.limits.map(|(lower, upper)| [lower, upper]),
        });
    }
    Ok(axes)
}

fn linuxcnc_program(source: &Source, axes: &[Axis], log: &str) -> anyhow::Result<String> {
    let config = source.linuxcnc.as_ref();
    let settings = Settings {
        axes: config.map_or(axes, |config| &config.axes),
        touching: config.map_or(Touching::Once, |config| config.touching),
        preamble: config.map_or(&[], |config| &config.preamble),
        first_moves: config.map_or(&[], |config| &config.first_moves),
        servo_period: config.map_or(SERVO_PERIOD, |config| config.servo_period),
        log_path: log,
        token: "probecell",
    };
    Ok(program::measuring_program(&source.plan, &source.order, &settings)?.text)
}
