//! Records of parts.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::report::{Page, PartSession, SizeRecord, size_records};
use arrow_array::{ArrayRef, Float64Array, StringArray};
use pyo3::prelude::*;

use crate::errors::{damage, input, warn};
use crate::page::framed;
use crate::table::Table;

/// The record of the parts that a session made or measured: sizes with uncertainty, verdicts, corrections, faults.
///
/// `str(...)` is the text of `probecell report`, `json()` its `--json`, byte for byte; a notebook shows the page of `--html`.
#[pyclass(frozen, module = "probecell")]
pub(crate) struct PartRecord {
    path: PathBuf,
    session: PartSession,
}

impl PartRecord {
    pub(crate) fn read(py: Python<'_>, path: &Path) -> PyResult<Self> {
        let (session, found) = py
            .detach(|| session_io::record::read(path))
            .map_err(input)?;
        damage(py, &found)?;
        Ok(Self {
            path: path.to_owned(),
            session,
        })
    }

    fn page(&self, py: Python<'_>) -> PyResult<Page> {
        let mut remarks = Vec::new();
        let page = py.detach(|| {
            let mut remark = |text: &str| remarks.push(text.to_owned());
            session_io::record::page(&self.path, &self.session, &|_| None, &mut remark)
        });
        warn(py, &remarks)?;
        page.map_err(input)
    }
}

/// The record of the parts of the recording at `path`, as `probecell report`.
///
/// Raises `InputError` where no part was measured; damage that leaves enough is a `RecordingWarning`.
#[pyfunction]
pub(crate) fn report(py: Python<'_>, path: PathBuf) -> PyResult<PartRecord> {
    PartRecord::read(py, &path)
}

#[pymethods]
impl PartRecord {
    /// The sizes, a row for each: `plan`, `feature`, `nominal`, `size`, `deviation`, `expanded_uncertainty` (m), `coverage_factor`,
    /// `conformity` (ISO 14253-1:2013), `verdict` in words.
    #[getter]
    fn sizes(&self) -> PyResult<Table> {
        let records = size_records(&self.session);
        let texts =
            |values: Vec<String>| -> ArrayRef { Arc::new(StringArray::from_iter_values(values)) };
        let of = |value: &dyn Fn(&probecell_msgs::FeatureResult) -> f64| -> ArrayRef {
            let values = records.iter().map(|one| value(one.result));
            Arc::new(Float64Array::from_iter_values(values))
        };
        let result = |value: &dyn Fn(&probecell_msgs::FeatureResult) -> String| {
            texts(records.iter().map(|one| value(one.result)).collect())
        };
        let columns = vec![
            ("plan", result(&|one| one.plan_id.clone())),
            ("feature", result(&|one| one.feature_id.clone())),
            ("nominal", of(&|one| one.nominal_size)),
            ("size", of(&|one| one.size)),
            ("deviation", of(&|one| one.size_deviation)),
            (
                "expanded_uncertainty",
                of(&|one| one.coverage_factor * one.standard_uncertainty),
            ),
            ("coverage_factor", of(&|one| one.coverage_factor)),
            (
                "conformity",
                result(&|one| session_io::sizes::conformity(one).to_owned()),
            ),
            (
                "verdict",
                texts(records.iter().map(SizeRecord::judged).collect()),
            ),
        ];
        let columns = columns
            .into_iter()
            .map(|(name, column)| (name.to_owned(), column));
        Table::new(columns.collect()).map_err(input)
    }

    /// The record as `probecell report --json` prints it, schema `probecell/part-record/1`.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string_pretty(&session_io::sizes::json(&self.session)).map_err(input)
    }

    /// The record as dictionaries and lists.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (self.json()?,))
    }

    /// The self-contained, printable page of `probecell report --html`.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.page(py)?.html())
    }

    fn __str__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.page(py)?.text().trim_end().to_owned())
    }

    fn __repr__(&self) -> String {
        format!(
            "<probecell.PartRecord of {:?}: {} parts>",
            self.session.name,
            self.session.parts.len()
        )
    }

    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        Ok(framed(&self.html(py)?))
    }
}
