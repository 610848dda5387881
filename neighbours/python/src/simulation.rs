//! Sessions simulated again: posterior predictive checks.

use std::path::PathBuf;
use std::sync::Arc;

use diagnosis::{Options, diagnose_with_residuals};
use pyo3::prelude::*;
use report::predictive::{Check, Predictive, USUAL_DRAWS};

use crate::errors::input;
use crate::page::framed;
use crate::session::{Session, read_session};

/// A session compared with what its model would have measured, before and after its diagnosis: a posterior predictive check.
///
/// `str(...)` is the text of `probecell simulate --like`, `json()` its `--json`, byte for byte; a notebook shows the page of `--html`.
#[pyclass(frozen, module = "probecell")]
pub(crate) struct PredictiveCheck {
    model: Predictive,
    check: Check,
}

impl PredictiveCheck {
    pub(crate) fn of(
        py: Python<'_>,
        session: &diagnosis::Session,
        draws: usize,
        seed: u64,
    ) -> PyResult<Self> {
        let made = || -> anyhow::Result<Self> {
            let (report, residuals) = diagnose_with_residuals(session, &Options::default())?;
            let model = Predictive::new(session, &report, &residuals)?;
            let check = model.check(draws, seed)?;
            Ok(Self { model, check })
        };
        py.detach(made).map_err(input)
    }
}

/// The session of the recording at `path` again, as its model would measure it, as `probecell simulate --like`.
///
/// `plan` and `model` as in `read_session`; `draws`: simulated sessions; `seed`: of their noise.
#[pyfunction]
#[pyo3(signature = (path, plan=None, *, model=None, draws=USUAL_DRAWS, seed=1))]
pub(crate) fn simulate(
    py: Python<'_>,
    path: PathBuf,
    plan: Option<String>,
    model: Option<PathBuf>,
    draws: usize,
    seed: u64,
) -> PyResult<PredictiveCheck> {
    let read = read_session(py, path, plan, model)?;
    PredictiveCheck::of(py, &read.measured, draws, seed)
}

#[pymethods]
impl PredictiveCheck {
    /// Statistics that contradict the model with the effects of the diagnosis; 0: it would have measured such a session.
    #[getter]
    fn contradictions(&self) -> usize {
        self.check.after.contradictions
    }

    /// One simulated session, with parameters and noise drawn from `seed`.
    #[pyo3(signature = (seed=1))]
    fn again(&self, seed: u64) -> Session {
        Session {
            measured: Arc::new(self.model.again(seed).session),
            analysis: None,
            notes: Vec::new(),
        }
    }

    /// The check as `probecell simulate --json` prints it.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string_pretty(&self.check).map_err(input)
    }

    /// The check as dictionaries and lists.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (self.json()?,))
    }

    /// The self-contained page of `probecell simulate --html`.
    fn html(&self) -> PyResult<String> {
        Ok(self.check.page().map_err(input)?.html())
    }

    fn __str__(&self) -> PyResult<String> {
        Ok(self
            .check
            .page()
            .map_err(input)?
            .text()
            .trim_end()
            .to_owned())
    }

    fn __repr__(&self) -> String {
        format!(
            "<probecell.PredictiveCheck of {:?}: {} contradictions>",
            self.check.bag, self.check.after.contradictions
        )
    }

    fn _repr_html_(&self) -> PyResult<String> {
        Ok(framed(&self.html()?))
    }
}
