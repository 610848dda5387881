//! Diagnoses.

use std::path::PathBuf;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, StringArray, UInt64Array};
use diagnosis::residuals::{DriveResiduals, MoveResiduals, TouchResiduals};
use diagnosis::{
    Options, Report, Residuals, diagnose_together_with_residuals, diagnose_with_residuals,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{input, wrong};
use crate::import::{Described, sessions};
use crate::page::framed;
use crate::table::Table;

/// Why a session differs from its model.
///
/// `str(...)` is the text of `probecell diagnose`, `json()` its `--json`, byte for byte; a notebook shows the page of `--html`.
#[pyclass(frozen, module = "probecell")]
pub(crate) struct Diagnosis {
    report: Report,
    residuals: Residuals,
}

impl Diagnosis {
    /// Diagnoses sessions jointly, judged on those that are withheld.
    pub(crate) fn of(
        py: Python<'_>,
        fitted: &[Arc<diagnosis::Session>],
        withheld: &[Arc<diagnosis::Session>],
        without: Vec<String>,
    ) -> PyResult<Self> {
        let options = Options {
            without,
            ..Options::default()
        };
        let plain = |all: &[Arc<diagnosis::Session>]| -> Vec<diagnosis::Session> {
            all.iter()
                .map(|one| diagnosis::Session::clone(one))
                .collect()
        };
        let (report, residuals) = py
            .detach(|| match (fitted, withheld) {
                ([one], []) => diagnose_with_residuals(one, &options),
                _ => diagnose_together_with_residuals(&plain(fitted), &plain(withheld), &options),
            })
            .map_err(input)?;
        Ok(Self { report, residuals })
    }
}

/// Why sessions differ from their model.
///
/// `data`: a recording (path of a folder or an `.mcap` file), a `Session`, or a table of touches (a pandas or polars `DataFrame`, any
/// Arrow table, a dictionary of columns, or the path of a CSV file with `columns`); or a list of these, which are diagnosed jointly,
/// with one set of causes. `withhold`: sessions that are not fitted, on which the diagnosis is judged. `without`: effects left out of
/// the library. `plan` and `model` as in `read_session`; all other keywords as in `import_touches`.
///
/// Raises `InputError` with the sentence of the command.
#[pyfunction]
#[pyo3(signature = (data, *, withhold=None, without=Vec::new(), plan=None, model=None, **table))]
pub(crate) fn diagnose(
    py: Python<'_>,
    data: &Bound<'_, PyAny>,
    withhold: Option<&Bound<'_, PyAny>>,
    without: Vec<String>,
    plan: Option<String>,
    model: Option<PathBuf>,
    table: Option<&Bound<'_, PyDict>>,
) -> PyResult<Diagnosis> {
    let described = Described { plan, model, table };
    let fitted = sessions(data, &described)?;
    let withheld = match withhold {
        Some(data) => sessions(data, &described)?,
        None => Vec::new(),
    };
    if fitted.is_empty() {
        return Err(wrong("there is no session to diagnose"));
    }
    Diagnosis::of(py, &fitted, &withheld, without)
}

#[pymethods]
impl Diagnosis {
    /// `no_gap`, `explained`, `partly_explained` or `unexplained`.
    #[getter]
    fn verdict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.to_dict(py)?.get_item("verdict")
    }

    /// Touches, samples or moves that were used.
    #[getter]
    fn samples(&self) -> usize {
        self.report.samples
    }

    /// Remarks on the input, a sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.report.warnings.clone()
    }

    /// The named effects, a row for each parameter: `effect`, `probability` (that it or one of its `group` acts), `group` (effects that
    /// these data cannot distinguish, itself first), `parameter`, `value`, `low`, `high` (95 % interval), `unit`, `rms_before`,
    /// `rms_after` (held out, without and with the effect).
    #[getter]
    fn effects(&self) -> PyResult<Table> {
        effects(&self.report).map_err(input)
    }

    /// What the model misses each touch, sample or move by, before and after the named effects (`after` is null where it was set aside).
    ///
    /// Touches: `compared`, `session`, `sequence`, `feature`, `x`, `y`, `z` (m, part frame), `i`, `j`, `k`, `time` (s from the start),
    /// `feed` (m/s), `before`, `after` (m), `axis.NAME` (m or rad). Drives: `session`, `axis`, `unit`, `time`, `position`, `speed`,
    /// `measured`, `before`, `after`. Moves: `session`, `from_point`, `to_point`, `time`, `promised`, `measured`, `before`, `after` (s).
    #[getter]
    fn residuals(&self) -> PyResult<Table> {
        let table = match &self.residuals {
            Residuals::Touches(all) => touches(all),
            Residuals::Drives(all) => drives(all),
            Residuals::Moves(moves) => of_moves(moves),
        };
        table.map_err(input)
    }

    /// The report as `probecell diagnose --json` prints it, schema `probecell/gap-report/1`.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string_pretty(&self.report).map_err(input)
    }

    /// The report as dictionaries and lists.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (self.json()?,))
    }

    /// The self-contained page of `probecell diagnose --html`.
    fn html(&self) -> PyResult<String> {
        let page = report::diagnosis_page(&self.report, &self.residuals);
        Ok(page.map_err(input)?.html())
    }

    fn __str__(&self) -> String {
        self.report.to_string()
    }

    fn __repr__(&self) -> String {
        let names: Vec<&str> = self
            .report
            .effects
            .iter()
            .map(|one| one.effect.as_str())
            .collect();
        format!(
            "<probecell.Diagnosis of {:?}: {:?}, effects: {}>",
            self.report.bag,
            self.report.verdict,
            names.join(", ")
        )
    }

    fn _repr_html_(&self) -> PyResult<String> {
        Ok(framed(&self.html()?))
    }
}

fn numbers(values: impl IntoIterator<Item = f64>) -> ArrayRef {
    Arc::new(Float64Array::from_iter_values(values))
}

fn texts<'a>(values: impl IntoIterator<Item = &'a str>) -> ArrayRef {
    // Arrow wants to know the number of texts beforehand.
    let values: Vec<&str> = values.into_iter().collect();
    Arc::new(StringArray::from_iter_values(values))
}

fn named(columns: Vec<(&str, ArrayRef)>) -> anyhow::Result<Table> {
    let columns = columns.into_iter();
    Table::new(
        columns
            .map(|(name, column)| (name.to_owned(), column))
            .collect(),
    )
}

fn effects(report: &Report) -> anyhow::Result<Table> {
    let rows = || {
        let effects = report.effects.iter();
        effects.flat_map(|effect| effect.parameters.iter().map(move |one| (effect, one)))
    };
    let groups: Vec<String> = rows().map(|(effect, _)| effect.group.join(" ")).collect();
    named(vec![
        (
            "effect",
            texts(rows().map(|(effect, _)| effect.effect.as_str())),
        ),
        (
            "probability",
            numbers(rows().map(|(effect, _)| effect.probability)),
        ),
        ("group", texts(groups.iter().map(String::as_str))),
        ("parameter", texts(rows().map(|(_, one)| one.name.as_str()))),
        ("value", numbers(rows().map(|(_, one)| one.value))),
        ("low", numbers(rows().map(|(_, one)| one.ci95[0]))),
        ("high", numbers(rows().map(|(_, one)| one.ci95[1]))),
        ("unit", texts(rows().map(|(_, one)| one.unit.as_str()))),
        (
            "rms_before",
            numbers(rows().map(|(effect, _)| effect.rms_before)),
        ),
        (
            "rms_after",
            numbers(rows().map(|(effect, _)| effect.rms_after)),
        ),
    ])
}

fn touches(all: &[TouchResiduals]) -> anyhow::Result<Table> {
    let rows = || {
        all.iter()
            .flat_map(|one| one.touches.iter().map(move |touch| (one, touch)))
    };
    let after: Float64Array = rows().map(|(_, touch)| touch.after).collect();
    let mut columns: Vec<(&str, ArrayRef)> = vec![
        ("compared", texts(rows().map(|(one, _)| one.compared))),
        (
            "session",
            texts(rows().map(|(one, touch)| one.sessions[touch.session].as_str())),
        ),
        (
            "sequence",
            Arc::new(UInt64Array::from_iter_values(
                rows().map(|(_, touch)| touch.sequence),
            )),
        ),
        (
            "feature",
            texts(rows().map(|(one, touch)| one.features[touch.feature].as_str())),
        ),
    ];
    for (index, name) in ["x", "y", "z"].into_iter().enumerate() {
        columns.push((
            name,
            numbers(rows().map(|(_, touch)| touch.position[index])),
        ));
    }
    for (index, name) in ["i", "j", "k"].into_iter().enumerate() {
        columns.push((name, numbers(rows().map(|(_, touch)| touch.normal[index]))));
    }
    columns.push(("time", numbers(rows().map(|(_, touch)| touch.time))));
    columns.push(("feed", numbers(rows().map(|(_, touch)| touch.feed))));
    columns.push(("before", numbers(rows().map(|(_, touch)| touch.before))));
    columns.push(("after", Arc::new(after)));
    let axes = all.first().map_or(&[][..], |one| one.axes.as_slice());
    let names: Vec<String> = axes
        .iter()
        .map(|axis| format!("axis.{}", axis.name))
        .collect();
    for (index, name) in names.iter().enumerate() {
        let positions: Float64Array = rows()
            .map(|(_, touch)| touch.positions.get(index).copied())
            .collect();
        columns.push((name.as_str(), Arc::new(positions)));
    }
    named(columns)
}

fn drives(all: &[DriveResiduals]) -> anyhow::Result<Table> {
    let rows = || {
        all.iter()
            .flat_map(|one| (0..one.time.len()).map(move |index| (one, index)))
    };
    named(vec![
        (
            "session",
            texts(rows().map(|(one, _)| one.session.as_str())),
        ),
        ("axis", texts(rows().map(|(one, _)| one.axis.name.as_str()))),
        ("unit", texts(rows().map(|(one, _)| one.unit.as_str()))),
        ("time", numbers(rows().map(|(one, at)| one.time[at]))),
        (
            "position",
            numbers(rows().map(|(one, at)| one.position[at])),
        ),
        ("speed", numbers(rows().map(|(one, at)| one.speed[at]))),
        (
            "measured",
            numbers(rows().map(|(one, at)| one.measured[at])),
        ),
        ("before", numbers(rows().map(|(one, at)| one.before[at]))),
        ("after", numbers(rows().map(|(one, at)| one.after[at]))),
    ])
}

fn of_moves(all: &MoveResiduals) -> anyhow::Result<Table> {
    let moves = || all.moves.iter();
    let point = |which: usize| -> ArrayRef {
        Arc::new(UInt64Array::from_iter_values(
            moves().map(|one| u64::from(one.points[which])),
        ))
    };
    let after: Float64Array = moves().map(|one| one.after).collect();
    named(vec![
        ("session", texts(moves().map(|_| all.session.as_str()))),
        ("from_point", point(0)),
        ("to_point", point(1)),
        ("time", numbers(moves().map(|one| one.time))),
        ("promised", numbers(moves().map(|one| one.promised))),
        ("measured", numbers(moves().map(|one| one.measured))),
        ("before", numbers(moves().map(|one| one.before))),
        ("after", Arc::new(after)),
    ])
}
