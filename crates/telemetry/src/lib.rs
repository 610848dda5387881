//! Measurements of a cell as lines of JSON, for a server in a separate process. The process that follows the bus writes them, the
//! server reads them; it needs neither the bus nor a key of the cell.
//!
//! ```
//! use telemetry::{State, Update};
//!
//! let line = telemetry::line(&Update::State(State { execution: telemetry::Execution::Running, at: 1_767_225_600_000_000_000 }));
//! assert!(line.ends_with('\n'));
//! assert!(matches!(telemetry::read(&line), Ok(Update::State(state)) if state.execution == telemetry::Execution::Running));
//! ```
//!
//! Lengths are m, stamps ns since 1970. A number that is not known or not finite is absent.

use serde::{Deserialize, Serialize};

/// One line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Update {
    /// The first: whose results these are.
    Cell(Cell),
    /// The initial state is complete: the server may accept clients.
    Listen,
    /// What the machine does.
    State(State),
    /// A measurement, so far or as decided; the next one of the same identifier replaces it.
    Result(Measured),
    /// Why a measurement differs from the declared model.
    Gap(Gap),
}

/// Whose results.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Its name.
    pub name: String,
    /// Version of the program that measures.
    pub version: String,
}

/// Execution state of a machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Execution {
    /// Nobody publishes its state.
    #[default]
    Absent,
    /// Alarm or emergency stop.
    Alarm,
    /// It waits, or holds a program.
    Idle,
    /// A program runs.
    Running,
}

/// Execution state of the machine, and since when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct State {
    /// Execution state.
    pub execution: Execution,
    /// ns since 1970.
    pub at: i64,
}

/// How far a measurement has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Sizes or decisions are still to come.
    #[default]
    Processing,
    /// Whole.
    Completed,
    /// The part was stopped before.
    Aborted,
}

/// Conformity with a specification.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Evaluation {
    /// Nothing was measured validly, or there is no specification.
    #[default]
    Undefined,
    /// Proved.
    Ok,
    /// Refuted.
    NotOk,
    /// Neither, because of the uncertainty.
    NotDecidable,
}

/// One measurement of one part.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Unique.
    pub id: String,
    /// Plan that was measured.
    pub plan: String,
    /// Part.
    pub part: String,
    /// Pass of the part, such as a run and its operation.
    pub pass: String,
    /// How far it has come.
    pub stage: Stage,
    /// Clients are to be told of it.
    pub is_ready: bool,
    /// The machine is a simulation; `None`: not known.
    pub is_simulated: Option<bool>,
    /// When its plan was made, ns since 1970.
    pub begin: i64,
    /// Stamp of what came last, ns since 1970.
    pub end: i64,
    /// Conformity of all sizes together.
    pub evaluation: Evaluation,
    /// What was decided, in words.
    pub text: String,
    /// Sizes, in the order in which they came.
    pub characteristics: Vec<Characteristic>,
}

/// A size, or the zone of a geometrical tolerance. Lengths are m.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Characteristic {
    /// Name of the feature.
    pub id: String,
    /// What was measured: `diameter`, `length`, or the term of ISO 1101.
    pub class: String,
    /// Measured value; `None`: the measurement is invalid, and so of its uncertainty.
    pub value: Option<f64>,
    /// Nominal value.
    pub nominal: f64,
    /// Smallest value of the specification, where it has one.
    pub lower: Option<f64>,
    /// Largest.
    pub upper: Option<f64>,
    /// Conformity.
    pub evaluation: Evaluation,
    /// The same in the terms of QIF: PASS, FAIL, REWORK, INDETERMINATE, SYSERROR, NOT_ANALYZED.
    pub status: String,
    /// Standard uncertainty.
    pub standard_uncertainty: Option<f64>,
    /// Expanded uncertainty by standard uncertainty.
    pub coverage_factor: Option<f64>,
    /// Expanded uncertainty.
    pub expanded_uncertainty: Option<f64>,
    /// Decision rule, in words.
    pub decision_rule: String,
    /// Probability that the true value is outside of the specification (JCGM 106:2012, 7.2).
    pub nonconformity_probability: Option<f64>,
}

/// Why a measurement differs from the declared model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Plan that was measured.
    pub plan: String,
    /// ns since 1970.
    pub at: i64,
    /// `NO_GAP`, `EXPLAINED`, `PARTLY_EXPLAINED` or `UNEXPLAINED`.
    pub verdict: String,
    /// Root mean square of the deviations, m.
    pub rms: Option<f64>,
    /// That of the noise, m.
    pub noise_floor: Option<f64>,
    /// In the order in which they close the gap.
    pub causes: Vec<Cause>,
}

/// An effect that explains a part of a gap.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// Identifier of the effect.
    pub effect: String,
    /// 0 to 1.
    pub probability: Option<f64>,
    /// Effects that the session cannot tell from it: with it, one group.
    pub rivals: Vec<String>,
    /// Names of its parameters.
    pub names: Vec<String>,
    /// Values, in `units`.
    pub values: Vec<Option<f64>>,
    /// Units.
    pub units: Vec<String>,
    /// Lower ends of the intervals of 95 %, in `units`.
    pub lower: Vec<Option<f64>>,
    /// Upper ends.
    pub upper: Vec<Option<f64>>,
}

/// An update as a line, its end included.
pub fn line(update: &Update) -> String {
    // Keys are strings and no value fails, so that there is always a line.
    let mut text = serde_json::to_string(update).unwrap_or_default();
    text.push('\n');
    text
}

/// An update of a line.
///
/// # Errors
/// It is not one.
pub fn read(line: &str) -> Result<Update, serde_json::Error> {
    serde_json::from_str(line)
}
