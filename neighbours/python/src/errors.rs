//! Errors and warnings: the sentences of the command.

use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::{PyTypeInfo, create_exception};

create_exception!(
    probecell,
    InputError,
    PyValueError,
    "What was given cannot be used; one sentence says what is wrong and where, as the command prints it."
);

create_exception!(
    probecell,
    RecordingWarning,
    PyUserWarning,
    "A recording is damaged or incomplete, and only its complete part is used."
);

/// The error of the engine as Python raises it.
pub(crate) fn input(error: impl Into<anyhow::Error>) -> PyErr {
    InputError::new_err(terminal::sentence(&error.into()))
}

/// A sentence of our own.
pub(crate) fn wrong(sentence: impl Into<String>) -> PyErr {
    InputError::new_err(sentence.into())
}

/// Warns of what a person must know of a recording; the prefix that the command prints is left out.
pub(crate) fn warn(py: Python<'_>, remarks: &[String]) -> PyResult<()> {
    let category = RecordingWarning::type_object(py);
    let warn = py.import("warnings")?.getattr("warn")?;
    for remark in remarks {
        let text = remark.strip_prefix("warning: ").unwrap_or(remark);
        warn.call1((text, &category))?;
    }
    Ok(())
}

/// Warns of damage, as the command does.
pub(crate) fn damage(py: Python<'_>, damage: &[bags::Damage]) -> PyResult<()> {
    let remarks = damage.iter();
    let remarks = remarks.map(|one| format!("{one}: only the complete part is used"));
    warn(py, &remarks.collect::<Vec<_>>())
}
