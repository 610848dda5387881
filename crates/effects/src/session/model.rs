//! The declared model of a cell as plain data: effects that were found before, adopted, and predicted from then on.

use serde::{Deserialize, Serialize};

/// One effect of the declared model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeclaredEffect {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Its parameters, as a gap report names them.
    pub parameters: Vec<DeclaredParameter>,
    /// Effects among which a person chose it, where the session that showed it could not distinguish them.
    #[serde(default)]
    pub chosen_from: Vec<String>,
    /// The session that showed it.
    #[serde(default)]
    pub source: Option<String>,
    /// When that session was measured, RFC 3339.
    #[serde(default)]
    pub measured: Option<String>,
    /// How far it was found to close the gap.
    #[serde(default)]
    pub promised: Option<Promise>,
}

/// A parameter of a declared effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeclaredParameter {
    /// Its name in reports.
    pub name: String,
    /// Its value, in `unit`.
    pub value: f64,
    /// Its unit in reports.
    pub unit: String,
    /// 95 % interval.
    #[serde(default)]
    pub ci95: Option<[f64; 2]>,
}

/// Why an effect cannot be declared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DeclaredError {
    /// Not of the vocabulary.
    #[error("there is no effect `{name}` on this machine: did you mean `{nearest}`?")]
    Unknown {
        /// As written.
        name: String,
        /// The most similar one.
        nearest: String,
    },
    /// Of the vocabulary, but nothing that a model of touches can hold.
    #[error("`{effect}` cannot be declared: {why}")]
    NotOfTheModel {
        /// The effect.
        effect: String,
        /// Why not.
        why: &'static str,
    },
    /// A number that is none.
    #[error("`{effect}`: parameter `{parameter}` has the {what} {value}, which is not finite")]
    NotFinite {
        /// The effect.
        effect: String,
        /// Its parameter.
        parameter: String,
        /// Value or interval.
        what: &'static str,
        /// As given.
        value: f64,
    },
    /// A parameter in another unit.
    #[error("`{effect}`: parameter `{parameter}` is given in `{given}`, not in `{wanted}`")]
    Unit {
        /// The effect.
        effect: String,
        /// Its parameter.
        parameter: String,
        /// As given.
        given: String,
        /// As it must be.
        wanted: &'static str,
    },
    /// A period, time constant, exponent or harmonic that is none.
    #[error("`{effect}`: `{parameter}` is {value}, which must be positive")]
    NotPositive {
        /// The effect.
        effect: String,
        /// Its parameter.
        parameter: &'static str,
        /// As given.
        value: f64,
    },
    /// A prediction that no machine could be worked with.
    #[error(
        "`{effect}` predicts a deviation of {size:e} m: a parameter is not in the unit that it names"
    )]
    Far {
        /// The effect.
        effect: String,
        /// Largest predicted deviation, m.
        size: f64,
    },
    /// Parameters from which no action follows.
    #[error("`{effect}`: parameters ({given}) form no known combination; expected ({wanted})")]
    Parameters {
        /// The effect.
        effect: String,
        /// Names given.
        given: String,
        /// Names that it takes.
        wanted: String,
    },
}

/// How far a declared effect was found to close the gap, on touches that were not used to fit it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Promise {
    /// Held-out rms without the effect, m.
    pub rms_before_m: f64,
    /// Held-out rms with it, m.
    pub rms_after_m: f64,
    /// 95 % interval of the latter, m.
    pub ci95_after_m: [f64; 2],
}
