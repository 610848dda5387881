//! Tables of touches as sessions.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::ensure;
use cell::Cell;
use exchange::import::columns::Columns;
use exchange::import::touches::{self, Settings};
use exchange::import::{Imported, features};
use exchange::table::{Layout, Table};
use exchange::units::Units;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString, PyTuple};
use session_io::import::text_of;

use crate::errors::{input, wrong};
use crate::frame;
use crate::session::Session;

/// How sessions are read from what Python gives.
pub(crate) struct Described<'a, 'py> {
    pub(crate) plan: Option<String>,
    pub(crate) model: Option<PathBuf>,
    /// Keywords of [`import_touches`].
    pub(crate) table: Option<&'a Bound<'py, PyDict>>,
}

/// One session or several.
pub(crate) fn sessions(
    data: &Bound<'_, PyAny>,
    described: &Described<'_, '_>,
) -> PyResult<Vec<Arc<diagnosis::Session>>> {
    if data.is_instance_of::<PyList>() || data.is_instance_of::<PyTuple>() {
        let all = data.try_iter()?.map(|one| session(&one?, described));
        return all.collect();
    }
    Ok(vec![session(data, described)?])
}

fn session(
    data: &Bound<'_, PyAny>,
    described: &Described<'_, '_>,
) -> PyResult<Arc<diagnosis::Session>> {
    let py = data.py();
    if let Ok(session) = data.cast::<Session>() {
        return Ok(Arc::clone(&session.get().measured));
    }
    let is_table = described.table.is_some_and(|table| !table.is_empty());
    if !is_table && let Ok(path) = data.extract::<PathBuf>() {
        let bag = py.detach(|| bags::Bag::open(path)).map_err(input)?;
        let read = Session::of_bag(py, &bag, described.plan.clone(), described.model.clone())?;
        return Ok(read.measured);
    }
    let import = py.import("probecell")?.getattr("import_touches")?;
    let imported = import.call((data,), described.table)?;
    Ok(Arc::clone(&imported.cast::<Session>()?.get().measured))
}

/// A table of touches as a session, a row for each touch, as `probecell import touches`.
///
/// `table`: a pandas or polars `DataFrame`, any Arrow table, a dictionary of columns, or the path of a CSV file.
///
/// `columns`: which column plays which role, `{"nominal_x": "X", ...}` or `"nominal_x=X,..."`; without it, columns that are named as a
/// role play it. Roles: `nominal_x`, `nominal_y`, `nominal_z` (nominal point, part frame), `i`, `j`, `k` (outward normal), and one of
/// `deviation` (measured less nominal along the normal, material in excess positive), `x`, `y`, `z` (measured point on the surface),
/// `ball_x`, `ball_y`, `ball_z` (measured centre of the ball) or `axis.NAME` (latched positions of the axes); `feature`, `time`, `outcome`,
/// `feed`, `temperature.NAME`, and `point` (index into the plan of `cell` or `plan`).
///
/// `units`: `{"length": "mm", "deviation": "um", ...}` or `"length=mm,..."`; no unit is guessed. Quantities and units:
/// length, deviation: m, mm, um, in, thou; angle: rad, deg; time: s, ms, min, h, clock, rfc3339; feed: m/s, mm/s, mm/min, in/min; temperature: degC, K.
///
/// `name` of plan, part and session. `features`: a table of nominal features (`id`, `kind`, `x`, `y`, `z`, `i`, `j`, `k`, `diameter`,
/// `half_angle`, `lower`, `upper`), in the same units. The machine whose axes the columns hold is that of `cell` (a cell file), `plan` (a
/// recording) or `urdf` (a robot description, with `part_position` (m), `part_rotation` (rad about fixed x, y, z) and `stylus` (m: centre of
/// the ball in the link `probe_mount`)); without one the part frame is the machine, and no effect of an axis is sought. `ball_radius`: m.
/// `feed`: m/s, where no column holds it. `machined_here`: the part was cut in this clamping. `skip_bad_rows`: leave single rows out
/// that are wrong; they are listed in `Session.notes`. `delimiter`, `decimal_comma`, `header`: how a CSV file is written.
///
/// Raises `InputError` that names row and column, of a file line and column.
#[pyfunction]
#[pyo3(signature = (table, *, columns=None, units=None, name=None, features=None, cell=None, plan=None, urdf=None,
    part_position=[0.0; 3], part_rotation=[0.0; 3], stylus=[0.0; 3], ball_radius=None, feed=None, machined_here=false,
    skip_bad_rows=false, delimiter=",".to_owned(), decimal_comma=false, header=true))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
#[expect(clippy::fn_params_excessive_bools, reason = "keywords of Python")]
pub(crate) fn import_touches(
    py: Python<'_>,
    table: &Bound<'_, PyAny>,
    columns: Option<&Bound<'_, PyAny>>,
    units: Option<&Bound<'_, PyAny>>,
    name: Option<String>,
    features: Option<&Bound<'_, PyAny>>,
    cell: Option<PathBuf>,
    plan: Option<PathBuf>,
    urdf: Option<PathBuf>,
    part_position: [f64; 3],
    part_rotation: [f64; 3],
    stylus: [f64; 3],
    ball_radius: Option<f64>,
    feed: Option<f64>,
    machined_here: bool,
    skip_bad_rows: bool,
    delimiter: String,
    decimal_comma: bool,
    header: bool,
) -> PyResult<Session> {
    let layout = layout(&delimiter, decimal_comma, header)?;
    let given = Given::of(table, layout)?;
    let units =
        Units::parse(&joined(units, "units")?).map_err(|error| wrong(format!("units: {error}")))?;
    for (value, name) in [(ball_radius, "ball_radius"), (feed, "feed")] {
        if value.is_some_and(|value| !(value.is_finite() && value >= 0.0)) {
            return Err(wrong(format!(
                "{name} must be a number that is not negative"
            )));
        }
    }
    let columns = by_number(&roles(columns, &given.table)?, &given.table).map_err(input)?;
    let name = name
        .or(given.name.clone())
        .unwrap_or_else(|| "touches".to_owned());
    if name.is_empty() || name.chars().any(probecell_msgs::is_unprintable) {
        return Err(wrong("name must be a printable name"));
    }
    let nominal = match features {
        Some(table) => {
            let given = Given::of(table, layout)?;
            let read = features::read_table(&given.table, given.layout, &units);
            read.map_err(|error| given.wrong(&error))?
        }
        None => Vec::new(),
    };
    let by_point = columns.split(',').any(|one| one.starts_with("point="));
    let mut settings = Settings {
        layout: given.layout,
        columns,
        units,
        machine: None,
        ball_radius,
        feed,
        plan: None,
        features: nominal,
        name: name.clone(),
        machined_on_this_machine: machined_here,
        skip_bad_rows,
    };
    let machine = Machine {
        cell,
        plan,
        urdf,
        part: [part_position, part_rotation],
        stylus,
    };
    let cell = py
        .detach(|| machine.place(&mut settings, by_point))
        .map_err(input)?;
    let read = py.detach(|| touches::read_table(&given.table, &settings));
    let imported = read.map_err(|error| given.wrong(&error))?;
    Ok(of_imported(&imported, name, cell.as_ref(), &given))
}

fn of_imported(imported: &Imported, name: String, cell: Option<&Cell>, given: &Given) -> Session {
    let mut notes = imported.remarks.clone();
    let refused = imported.refused.iter();
    notes.extend(refused.map(|error| format!("refused: {}", given.sentence(error))));
    let declared = cell.map(|cell| cell.model.effects.clone());
    Session {
        measured: Arc::new(diagnosis::Session {
            name,
            declared: declared.unwrap_or_default(),
            ..session_io::import::session(imported)
        }),
        analysis: cell.map(|cell| cell.analysis.clone()),
        notes,
    }
}

/// A table, and what its errors call it.
struct Given {
    table: Table,
    layout: Layout,
    /// Of a file.
    path: Option<PathBuf>,
    /// Of a file, without its ending.
    name: Option<String>,
}

impl Given {
    fn of(object: &Bound<'_, PyAny>, layout: Layout) -> PyResult<Self> {
        let Ok(path) = object.extract::<PathBuf>() else {
            return Ok(Self {
                table: frame::of(object)?,
                layout: Layout::default(),
                path: None,
                name: None,
            });
        };
        let text = text_of(&path).map_err(input)?;
        let stem = path
            .file_stem()
            .map(|stem| stem.to_string_lossy().into_owned());
        let mut given = Self {
            table: Table::default(),
            layout,
            path: Some(path),
            name: stem,
        };
        given.table = Table::read(&text, layout).map_err(|error| given.wrong(&error))?;
        Ok(given)
    }

    fn sentence(&self, error: &exchange::ImportError) -> String {
        match &self.path {
            Some(path) => format!("{}: {error}", path.display()),
            None => frame::placed(error, &self.table),
        }
    }

    fn wrong(&self, error: &exchange::ImportError) -> PyErr {
        wrong(self.sentence(error))
    }
}

fn layout(delimiter: &str, decimal_comma: bool, header: bool) -> PyResult<Layout> {
    let delimiter = match (delimiter, delimiter.chars().count()) {
        ("tab", _) => '\t',
        ("blanks", _) => ' ',
        (text, 1) => text.chars().next().unwrap_or(','),
        _ => return Err(wrong("delimiter must be one character, tab or blanks")),
    };
    if decimal_comma && delimiter == ',' {
        return Err(wrong("decimal_comma needs another delimiter than a comma"));
    }
    Ok(Layout {
        delimiter,
        decimal_comma,
        header,
        ..Layout::default()
    })
}

/// `NAME=VALUE,...` of a dictionary or of such a text.
fn joined(given: Option<&Bound<'_, PyAny>>, what: &str) -> PyResult<String> {
    let pairs = pairs(given, what)?;
    let pairs = pairs.iter().map(|(name, value)| format!("{name}={value}"));
    Ok(pairs.collect::<Vec<_>>().join(","))
}

/// Names and values of a dictionary, or of a text `NAME=VALUE,...` in which a comma without a name belongs to the value.
fn pairs(given: Option<&Bound<'_, PyAny>>, what: &str) -> PyResult<Vec<(String, String)>> {
    let Some(given) = given else {
        return Ok(Vec::new());
    };
    if let Ok(text) = given.cast::<PyString>() {
        let mut pairs: Vec<(String, String)> = Vec::new();
        for piece in text
            .to_string()
            .split(',')
            .filter(|piece| !piece.trim().is_empty())
        {
            match (piece.split_once('='), pairs.last_mut()) {
                (Some((name, value)), _) => {
                    pairs.push((name.trim().to_owned(), value.trim().to_owned()));
                }
                (None, Some((_, value))) => *value = format!("{value},{piece}"),
                (None, None) => return Err(wrong(format!("{what}: {piece:?} is no NAME=VALUE"))),
            }
        }
        return Ok(pairs);
    }
    let given = given.cast::<PyDict>().map_err(|_| {
        wrong(format!(
            "{what} must be a dictionary, or a text NAME=VALUE,..."
        ))
    })?;
    let pairs = given
        .iter()
        .map(|(name, value)| Ok((name.str()?.to_string(), value.str()?.to_string())));
    pairs.collect()
}

/// Columns by role: as given, or those that are named as a role.
fn roles(given: Option<&Bound<'_, PyAny>>, table: &Table) -> PyResult<Vec<(String, String)>> {
    if given.is_some() {
        return pairs(given, "columns");
    }
    let is_role = |name: &&String| {
        !name.contains([',', '=']) && Columns::parse(&format!("{name}=#1"), table).is_ok()
    };
    let named = table.header.iter().filter(is_role);
    Ok(named.map(|name| (name.clone(), name.clone())).collect())
}

/// The same by the numbers of the columns, so that any name will do.
fn by_number(roles: &[(String, String)], table: &Table) -> anyhow::Result<String> {
    ensure!(
        !roles.is_empty(),
        "no column has a role: say columns={{ROLE: COLUMN}}; roles are {}",
        exchange::import::columns::roles()
    );
    let mut all = Vec::new();
    for (role, name) in roles {
        let index = table
            .column(name)
            .map_err(|error| anyhow::anyhow!(error.what))?;
        all.push(format!("{role}=#{}", index + 1));
    }
    Ok(all.join(","))
}

/// Where the machine is described.
struct Machine {
    cell: Option<PathBuf>,
    plan: Option<PathBuf>,
    urdf: Option<PathBuf>,
    part: [[f64; 3]; 2],
    stylus: [f64; 3],
}

impl Machine {
    /// Machine and plan of the settings; gives the cell where there is one.
    fn place(&self, settings: &mut Settings, by_point: bool) -> anyhow::Result<Option<Cell>> {
        let given = [&self.cell, &self.plan, &self.urdf];
        ensure!(
            given.iter().filter(|one| one.is_some()).count() < 2,
            "give one of cell, plan and urdf"
        );
        if let Some(file) = &self.cell {
            let cell = Cell::read(file)?;
            let (machine, plan) = session_io::import::machine_of_cell(&cell, &mut |_| {})?;
            settings.machine = Some(machine);
            settings.plan = by_point.then_some(plan);
            return Ok(Some(cell));
        }
        if let Some(path) = &self.plan {
            let (machine, plan) = session_io::import::machine_of_bag(path)?;
            ensure!(
                by_point,
                "plan needs the column `point` that names its points"
            );
            settings.machine = Some(machine);
            settings.plan = Some(plan);
        }
        if let Some(file) = &self.urdf {
            ensure!(
                settings.ball_radius.is_some(),
                "urdf needs ball_radius: positions of axes say where the centre of the ball is"
            );
            let text = text_of(file)?;
            settings.machine = Some(session_io::import::machine_of_urdf(
                text,
                self.part,
                self.stylus,
            ));
        }
        Ok(None)
    }
}
