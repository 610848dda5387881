//! Section `[compensation.work_offset]`: work offsets that follow the part.

use machine::Chain;
use serde::Deserialize;

use crate::passes::Passes;

/// As written in the cell file, section `[compensation.work_offset]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawWorkOffset {
    /// Its name in verdicts and corrections.
    #[serde(default = "default_id")]
    pub id: String,
    /// Linear axes whose work offsets follow the part.
    pub axes: Vec<String>,
    /// Largest displacement of a touched point that qualifies.
    pub tolerance_mm: f64,
    /// No work offset beyond this, either sign, is proposed.
    pub limit_mm: f64,
    /// Passes in which it decides; none: all.
    #[serde(default)]
    pub passes: Vec<String>,
}

fn default_id() -> String {
    "place of the part".to_owned()
}

/// As checked: m.
#[derive(Clone, Debug)]
pub struct WorkOffset {
    /// Its name in verdicts and corrections.
    pub id: String,
    /// The machine.
    pub chain: Chain,
    /// Names of the axes.
    pub axes: Vec<String>,
    /// m; largest displacement that qualifies.
    pub tolerance: f64,
    /// m; largest offset proposed, either sign.
    pub limit: f64,
    /// Passes in which it decides.
    pub passes: Passes,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum WorkOffsetError {
    /// Nothing to write.
    #[error("compensation.work_offset.axes is empty: no axis follows the part")]
    NoAxes,
    /// An axis that has no work offset.
    #[error(
        "compensation.work_offset.axes: {0:?} is not a linear axis of the machine, or is listed twice"
    )]
    Axis(String),
}

impl RawWorkOffset {
    /// The numbers that must be above 0, by key.
    pub(crate) fn numbers(&self) -> [(String, f64); 2] {
        [
            ("work_offset.tolerance_mm".to_owned(), self.tolerance_mm),
            ("work_offset.limit_mm".to_owned(), self.limit_mm),
        ]
    }

    /// Checks the settings against the machine; `passes` are those in which it decides.
    pub(crate) fn check(
        &self,
        chain: &Chain,
        passes: Passes,
    ) -> Result<WorkOffset, WorkOffsetError> {
        if self.axes.is_empty() {
            return Err(WorkOffsetError::NoAxes);
        }
        for (index, name) in self.axes.iter().enumerate() {
            if chain.work_offset(name).is_none() || self.axes[..index].contains(name) {
                return Err(WorkOffsetError::Axis(name.clone()));
            }
        }
        Ok(WorkOffset {
            id: self.id.clone(),
            chain: chain.clone(),
            axes: self.axes.clone(),
            tolerance: self.tolerance_mm * 1e-3,
            limit: self.limit_mm * 1e-3,
            passes,
        })
    }
}
