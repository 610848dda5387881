//! `probecell import touches`: a table of touches, a row for each.

use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use cell::{Cell, CellText};
use exchange::import::{features, touches};
use exchange::table::Table;
use exchange::table::forms::{self, Form, Formed};
use session_io::import::{self, table_text_of, text_of};
use session_io::imported::Source;

use super::{OutArguments, REVISION, TableArguments, write};
use crate::output;

/// A file of a fixed form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Fixed {
    /// Meshes that Klipper saved in printer.cfg: columns X, Y, Z, Mesh.
    KlipperMesh,
    /// Log of Klipper's PROBE or PROBE_ACCURACY: columns X, Y, Z, and Time (s) where lines have a clock.
    KlipperProbe,
    /// Marlin's Bed Topography Report (G29 T): columns X, Y, Z.
    MarlinTopography,
    /// Height map of RepRapFirmware (heightmap.csv of Duet boards): columns X, Y, Z.
    DuetMesh,
    /// Log of GRBL with [PRB:...] lines: columns X, Y, Z.
    GrblProbe,
    /// Table of characteristics of ZEISS CALYPSO (..._chr.txt): places of features.
    CalypsoTable,
    /// Text report of PC-DMIS: places of features.
    PcdmisReport,
    /// Measuring logs of HEIDENHAIN touch probe cycles (TCHPR421.TXT): centres.
    HeidenhainLog,
    /// Results of Autodesk Fusion's Inspect Surface: touched points.
    FusionSurface,
}

impl From<Fixed> for Form {
    fn from(fixed: Fixed) -> Self {
        match fixed {
            Fixed::KlipperMesh => Self::KlipperMesh,
            Fixed::KlipperProbe => Self::KlipperProbe,
            Fixed::MarlinTopography => Self::MarlinTopography,
            Fixed::DuetMesh => Self::DuetMesh,
            Fixed::GrblProbe => Self::GrblProbe,
            Fixed::CalypsoTable => Self::CalypsoTable,
            Fixed::PcdmisReport => Self::PcDmisReport,
            Fixed::HeidenhainLog => Self::HeidenhainLog,
            Fixed::FusionSurface => Self::FusionSurface,
        }
    }
}

/// What the user asks for.
#[derive(clap::Args)]
#[command(
    after_help = "Roles of columns: x, y, z (measured point on the surface), ball_x, ball_y, ball_z (measured centre of the ball), \
nominal_x, nominal_y, nominal_z, i, j, k (outward normal), deviation, axis.NAME, feature, point (of --plan), time, outcome, \
feed, temperature.NAME. See docs/exchange.md.\n\n\
Examples:\n  \
probecell import touches part.csv --columns nominal_x=X,nominal_y=Y,nominal_z=Z,i=NX,j=NY,k=NZ,deviation=Dev \\\n      \
--units length=mm,deviation=um --out part_session\n  \
probecell import touches log.csv --cell my_cell.toml --columns point=P,axis.X=X,axis.Z=Z,axis.C=C \\\n      \
--units length=mm,angle=deg --out log_session"
)]
pub(crate) struct Arguments {
    /// The table.
    file: PathBuf,
    /// Columns by role, ROLE=COLUMN,...; COLUMN is a name of the header, #N for the N-th, or a number for all rows (nominal_z=0,k=1).
    #[arg(
        long,
        required_unless_present = "form",
        default_value = "",
        hide_default_value = true
    )]
    columns: String,
    /// The file is no delimited table, but of this form.
    #[arg(long, value_enum, conflicts_with_all = ["delimiter", "decimal_comma", "no_header", "lines"])]
    form: Option<Fixed>,
    /// The table is a grid: the header has X, the first column Y, and the other cells Z, which are the columns X, Y, Z.
    #[arg(long, conflicts_with_all = ["form", "no_header"])]
    grid: bool,
    #[command(flatten)]
    table: TableArguments,
    /// The machine whose axis positions are in the columns axis.NAME; without it, the part frame serves as the machine.
    #[arg(long, value_name = "FILE", conflicts_with = "cell")]
    urdf: Option<PathBuf>,
    /// Cell file with the machine, the pose of the part, the stylus, and the plan to which the column `point` refers.
    #[arg(long, value_name = "CELL")]
    cell: Option<PathBuf>,
    /// Bag with the machine and the plan to which the column `point` refers.
    #[arg(long, value_name = "BAG", conflicts_with_all = ["urdf", "cell"])]
    plan: Option<PathBuf>,
    /// With --urdf: position of the part frame in the link `workpiece`: X Y Z.
    #[arg(
        long,
        value_name = "MM",
        num_args = 3,
        requires = "urdf",
        allow_hyphen_values = true
    )]
    part_position_mm: Vec<f64>,
    /// With --urdf: rotation of the part frame about fixed x, y and z, in this order.
    #[arg(
        long,
        value_name = "DEG",
        num_args = 3,
        requires = "urdf",
        allow_hyphen_values = true
    )]
    part_rotation_deg: Vec<f64>,
    /// With --urdf: centre of the ball in the link `probe_mount`: X Y Z.
    #[arg(
        long,
        value_name = "MM",
        num_args = 3,
        requires = "urdf",
        allow_hyphen_values = true
    )]
    stylus_mm: Vec<f64>,
    /// Radius of the stylus ball.
    #[arg(long, value_name = "MM")]
    ball_radius_mm: Option<f64>,
    /// Approach speed, if no column gives it; 0: the axes were at standstill while an instrument was read.
    #[arg(long, value_name = "MM_PER_MIN")]
    feed_mm_per_min: Option<f64>,
    /// Table of the nominal features, with the same units: id, kind, x, y, z, i, j, k, diameter, half_angle, lower, upper.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["plan"])]
    features: Option<PathBuf>,
    /// The part was cut on this machine in this clamping, so that clamping errors are unobservable.
    #[arg(long)]
    machined_here: bool,
    /// Skip and list invalid rows instead of refusing the file; the exit status is then 3.
    #[arg(long)]
    skip_bad_rows: bool,
    #[command(flatten)]
    out: OutArguments,
}

/// Imports.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let (text, assumed) = table_text_of(&arguments.file)?;
    let of_file = || arguments.file.display().to_string();
    let layout = arguments.table.layout()?;
    let formed = match arguments.form {
        Some(form) => forms::read(&text, form.into()),
        None => Table::read(&text, layout).map(|table| Formed {
            table,
            ..Formed::default()
        }),
    };
    let mut formed = formed.with_context(of_file)?;
    if arguments.grid {
        let (table, empty) = formed.table.of_grid(layout).with_context(of_file)?;
        formed.table = table;
        if empty > 0 {
            let remark = format!("{empty} cells of the grid are empty and left out");
            formed.remarks.push(remark);
        }
    }
    let columns = formed.columns(&arguments.columns).with_context(of_file)?;
    let mut settings = touches::Settings {
        layout,
        columns: columns.clone(),
        units: formed.units(&arguments.table.units).context("--units")?,
        machine: None,
        ball_radius: nonnegative(arguments.ball_radius_mm, "--ball-radius-mm", "length")?
            .map(|radius| radius * 1e-3),
        feed: nonnegative(arguments.feed_mm_per_min, "--feed-mm-per-min", "speed")?
            .map(|feed| feed * 1e-3 / 60.0),
        plan: None,
        features: Vec::new(),
        name: arguments.out.name(&arguments.file)?,
        machined_on_this_machine: arguments.machined_here,
        skip_bad_rows: arguments.skip_bad_rows,
    };
    let cell = machine(arguments, &mut settings)?;
    if let Some(file) = &arguments.features {
        let text = text_of(file)?;
        settings.features = features::read(&text, settings.layout, &settings.units)
            .with_context(|| file.display().to_string())?;
    }
    let mut imported = touches::read_table(&formed.table, &settings).with_context(of_file)?;
    imported
        .remarks
        .extend(formed.remarks.iter().cloned().chain(assumed));
    let analysis = match (&cell, arguments.out.settings()) {
        (_, Some(settings)) => Some(settings),
        (Some(cell), None) => Some(cell.analysis.clone()),
        (None, None) => None,
    };
    let mut files = vec![arguments.file.clone()];
    files.extend(arguments.features.clone());
    let source = Source {
        kind: "touches",
        files,
        settings: vec![
            ("columns", columns),
            ("units", stated(&arguments.table.units, &formed)),
        ],
        cell: cell.as_ref().map(|cell| CellText::clone(cell.text())),
        revision: REVISION,
    };
    write(&arguments.out.out, &imported, analysis.as_ref(), &source)
}

/// Units that the user and the file name.
pub(super) fn stated(said: &str, formed: &Formed) -> String {
    let said = [said.to_owned()]
        .into_iter()
        .filter(|said| !said.is_empty());
    let all: Vec<String> = said.chain(formed.units.iter().cloned()).collect();
    all.join(",")
}

/// Refuses a negative value of an option.
fn nonnegative(value: Option<f64>, option: &str, quantity: &str) -> anyhow::Result<Option<f64>> {
    let is_sound = |value: f64| value.is_finite() && value >= 0.0;
    ensure!(
        value.is_none_or(is_sound),
        "{option} must be a {quantity} that is not negative"
    );
    Ok(value)
}

/// Machine and plan of the settings; gives the cell where there is one.
fn machine(
    arguments: &Arguments,
    settings: &mut touches::Settings,
) -> anyhow::Result<Option<Cell>> {
    let by_point = arguments
        .columns
        .split(',')
        .any(|one| one.trim().starts_with("point="));
    if let Some(file) = &arguments.cell {
        let cell = Cell::read(file)?;
        let (machine, plan) =
            output::with_progress(|progress| import::machine_of_cell(&cell, progress))?;
        settings.machine = Some(machine);
        settings.plan = by_point.then_some(plan);
        return Ok(Some(cell));
    }
    if let Some(path) = &arguments.plan {
        let (machine, plan) = import::machine_of_bag(path)?;
        ensure!(
            by_point,
            "--plan needs the column `point` that names its points"
        );
        settings.machine = Some(machine);
        settings.plan = Some(plan);
        return Ok(None);
    }
    if let Some(file) = &arguments.urdf {
        let three = |values: &[f64], factor: f64| match values {
            [x, y, z] => [x * factor, y * factor, z * factor],
            _ => [0.0; 3],
        };
        if settings.ball_radius.is_none() {
            bail!(
                "--urdf needs --ball-radius-mm: positions of axes say where the centre of the ball is"
            );
        }
        let part = [
            three(&arguments.part_position_mm, 1e-3),
            three(&arguments.part_rotation_deg, 1.0_f64.to_radians()),
        ];
        let ball = three(&arguments.stylus_mm, 1e-3);
        settings.machine = Some(import::machine_of_urdf(text_of(file)?, part, ball));
    }
    Ok(None)
}
