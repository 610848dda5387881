//! `probecell import readings`: what an instrument read while the axes stood.

use std::path::PathBuf;

use anyhow::{Context, bail};
use cell::Cell;
use clap::ValueEnum;
use exchange::import::readings::{self, Settings, Test};
use exchange::table::Table;
use exchange::table::forms::{self, Form, Formed};
use session_io::import::{name_of, table_text_of, text_of};
use session_io::imported::Source;

use super::{REVISION, TableArguments, write};

/// A test of a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// ISO 230-2: axis, target, direction (+ or -), repeat, deviation.
    Positioning,
    /// ISO 230-4 (ball bar): angle, direction (cw or ccw), deviation.
    Circular,
    /// R-test: axis.NAME of each axis that moves, dx, dy, dz in the part frame.
    RTest,
}

/// A file of a fixed form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Fixed {
    /// Report of a positioning test with tables of tgt_pos(i) and ref_pos(i,j): all but the axis.
    Iso230Report,
}

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
probecell import readings x_axis.csv --test positioning --units length=mm,deviation=um --out x_axis\n  \
probecell import readings ball_bar.csv --test circular --plane X Y --radius-mm 150 --at X=0,Y=0 \\\n      \
--units length=mm,angle=deg,deviation=um --out ball_bar\n\n\
Columns have the names that the test lists, or those that --columns gives; `time` is read where it is there. For the deviation of a \
positioning test --columns may name `measured` (position, with `target` or `commanded`), or `forward` and `reverse` side by side.")]
pub(crate) struct Arguments {
    /// The table.
    file: PathBuf,
    /// Kind of test.
    #[arg(long, value_enum)]
    test: Kind,
    /// Columns by role, ROLE=COLUMN,..., where they are not named like their roles; COLUMN is a name of the header, #N for the
    /// N-th, or a value for all rows (axis=X, repeat=1). Those that a form has need not be named.
    #[arg(long, default_value = "", hide_default_value = true)]
    columns: String,
    /// The file is no delimited table, but of this form.
    #[arg(long, value_enum, conflicts_with_all = ["delimiter", "decimal_comma", "no_header", "lines"])]
    form: Option<Fixed>,
    #[command(flatten)]
    table: TableArguments,
    /// The machine; without it, the axes X, Y, Z of the test are slides stacked in this order.
    #[arg(long, value_name = "FILE", conflicts_with = "cell")]
    urdf: Option<PathBuf>,
    /// Cell file with the machine.
    #[arg(long, value_name = "CELL")]
    cell: Option<PathBuf>,
    /// Positions of axes that the table does not move, in mm and degrees; of a circle its centre: NAME=VALUE,...
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true)]
    at: Vec<String>,
    /// Axes of the plane of a circle; the angle counts from the first to the second.
    #[arg(long, num_args = 2, value_name = "AXIS")]
    plane: Vec<String>,
    /// Radius of a circle.
    #[arg(long, value_name = "MM")]
    radius_mm: Option<f64>,
    /// Name of the plan; default: that of the file.
    #[arg(long)]
    name: Option<String>,
    /// Folder of the recording to be written; must not exist.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

/// Imports.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let test = match (arguments.test, &arguments.plane[..], arguments.radius_mm) {
        (Kind::Positioning, ..) => Test::Positioning,
        (Kind::RTest, ..) => Test::RTest,
        (Kind::Circular, [a, b], Some(radius)) if radius > 0.0 => Test::Circular {
            axes: [a.clone(), b.clone()],
            radius: radius * 1e-3,
        },
        (Kind::Circular, ..) => bail!("--test circular needs --plane A B and --radius-mm above 0"),
    };
    let cell = arguments
        .cell
        .as_ref()
        .map(|file| Cell::read(file))
        .transpose()?;
    let urdf = match (&cell, &arguments.urdf) {
        (Some(cell), _) => Some(cell.text().robot_description.clone()),
        (None, Some(file)) => Some(text_of(file)?),
        (None, None) => None,
    };
    let (text, assumed) = table_text_of(&arguments.file)?;
    let of_file = || arguments.file.display().to_string();
    let formed = match arguments.form {
        Some(Fixed::Iso230Report) => forms::read(&text, Form::Iso230Report),
        None => Table::read(&text, arguments.table.layout()?).map(|table| Formed {
            table,
            ..Formed::default()
        }),
    };
    let formed = formed.with_context(of_file)?;
    let columns = [&formed.columns, &arguments.columns];
    let columns: Vec<&str> = columns
        .into_iter()
        .map(String::as_str)
        .filter(|one| !one.is_empty())
        .collect();
    let settings = Settings {
        layout: arguments.table.layout()?,
        columns: columns.join(","),
        units: formed.units(&arguments.table.units).context("--units")?,
        standing: standing(&arguments.at, urdf.as_deref())?,
        urdf,
        name: name_of(arguments.name.as_deref(), &arguments.file)?,
    };
    let mut imported =
        readings::read_table(&formed.table, &test, &settings).with_context(of_file)?;
    imported
        .remarks
        .extend(formed.remarks.iter().cloned().chain(assumed));
    let source = Source {
        kind: "readings",
        files: vec![arguments.file.clone()],
        settings: vec![
            ("columns", settings.columns.clone()),
            (
                "units",
                super::touches::stated(&arguments.table.units, &formed),
            ),
        ],
        cell: cell.map(|cell| cell.text().clone()),
        revision: REVISION,
    };
    write(&arguments.out, &imported, None, &source)
}

/// Positions of axes, m and rad.
fn standing(at: &[String], urdf: Option<&str>) -> anyhow::Result<Vec<(String, f64)>> {
    let chain = urdf.map(machine::Chain::from_urdf).transpose()?;
    let mut all = Vec::new();
    for text in at {
        let pair = text.split_once('=').and_then(|(name, value)| {
            let value = value
                .parse::<f64>()
                .ok()
                .filter(|value| value.is_finite())?;
            Some((name.trim(), value))
        });
        let (name, value) = pair.with_context(|| format!("--at {text:?} is not NAME=VALUE"))?;
        let kind = chain
            .as_ref()
            .and_then(|chain| Some(chain.axis(chain.axis_index(name)?).kind));
        let value = match kind {
            Some(machine::JointKind::Revolute) => value.to_radians(),
            None if chain.is_some() => bail!("--at {text:?}: the machine has no axis {name}"),
            _ => value * 1e-3,
        };
        all.push((name.to_owned(), value));
    }
    Ok(all)
}
