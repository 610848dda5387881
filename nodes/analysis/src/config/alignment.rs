//! How the part is aligned before its features are evaluated.

use serde::Deserialize;

use super::error::ConfigError;

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawAlignment {
    /// Datum features in order of precedence (ISO 5459).
    #[serde(default)]
    pub datums: Vec<String>,
    /// Instead: features whose touches are best-fitted together.
    #[serde(default)]
    pub best_fit: Vec<String>,
    /// Degrees of freedom of a best fit: shifts along `x`, `y`, `z`, rotations `a`, `b`, `c` about them.
    #[serde(default = "all_free")]
    pub free: Vec<String>,
}

/// Shifts along the axes of the part frame and rotations about them.
const DISPLACEMENTS: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

fn all_free() -> Vec<String> {
    DISPLACEMENTS.map(str::to_owned).to_vec()
}

/// How the part is aligned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// By datums in order of precedence.
    Datums,
    /// By least squares of the deviations.
    BestFit,
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Alignment {
    /// How.
    pub method: Method,
    /// Features, in order of precedence.
    pub features: Vec<String>,
    /// Shifts along and rotations about x, y and z that a best fit has free.
    pub free: [bool; 6],
}

impl RawAlignment {
    pub(super) fn check(&self) -> Result<Alignment, ConfigError> {
        let (method, features) = match (&self.datums[..], &self.best_fit[..]) {
            ([], features @ [_, ..]) => (Method::BestFit, features),
            (datums @ [_, ..], []) => (Method::Datums, datums),
            _ => return Err(ConfigError::Method),
        };
        let mut free = [false; 6];
        for name in &self.free {
            let index = DISPLACEMENTS.iter().position(|known| known == name);
            free[index.ok_or_else(|| ConfigError::Displacement(name.clone()))?] = true;
        }
        if method == Method::Datums && free != [true; 6] {
            return Err(ConfigError::FreeDatums);
        }
        Ok(Alignment {
            method,
            features: features.to_vec(),
            free,
        })
    }
}
