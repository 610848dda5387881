//! What changes for clients. Lengths are m, stamps ns since 1970. A number that is not known or not finite is absent.

/// One change.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Update {
    /// What the machine does.
    State(State),
    /// A measurement, so far or as decided; the next one of the same identifier replaces it.
    Result(Measured),
    /// Why a measurement differs from the declared model.
    Gap(Gap),
}

/// Execution state of a machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Execution {
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct State {
    /// Execution state.
    pub(crate) execution: Execution,
    /// ns since 1970.
    pub(crate) at: i64,
}

/// How far a measurement has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Stage {
    /// Sizes or decisions are still to come.
    #[default]
    Processing,
    /// Whole.
    Completed,
    /// The part was stopped before.
    Aborted,
}

/// Conformity with a specification.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Evaluation {
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
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Measured {
    /// Unique.
    pub(crate) id: String,
    /// Plan that was measured.
    pub(crate) plan: String,
    /// Part.
    pub(crate) part: String,
    /// Pass of the part, such as a run and its operation.
    pub(crate) pass: String,
    /// How far it has come.
    pub(crate) stage: Stage,
    /// Clients are to be told of it.
    pub(crate) is_ready: bool,
    /// The machine is a simulation; `None`: not known.
    pub(crate) is_simulated: Option<bool>,
    /// When its plan was made, ns since 1970.
    pub(crate) begin: i64,
    /// Stamp of what came last, ns since 1970.
    pub(crate) end: i64,
    /// Conformity of all sizes together.
    pub(crate) evaluation: Evaluation,
    /// What was decided, in words.
    pub(crate) text: String,
    /// Sizes, in the order in which they came.
    pub(crate) characteristics: Vec<Characteristic>,
}

/// A size, or the zone of a geometrical tolerance. Lengths are m.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Characteristic {
    /// Name of the feature.
    pub(crate) id: String,
    /// What was measured: `diameter`, `length`, or the term of ISO 1101.
    pub(crate) class: String,
    /// Measured value; `None`: the measurement is invalid, and so of its uncertainty.
    pub(crate) value: Option<f64>,
    /// Nominal value.
    pub(crate) nominal: f64,
    /// Smallest value of the specification, where it has one.
    pub(crate) lower: Option<f64>,
    /// Largest.
    pub(crate) upper: Option<f64>,
    /// Conformity.
    pub(crate) evaluation: Evaluation,
    /// The same in the terms of QIF: PASS, FAIL, REWORK, INDETERMINATE, SYSERROR, NOT_ANALYZED.
    pub(crate) status: String,
    /// Standard uncertainty.
    pub(crate) standard_uncertainty: Option<f64>,
    /// Expanded uncertainty by standard uncertainty.
    pub(crate) coverage_factor: Option<f64>,
    /// Expanded uncertainty.
    pub(crate) expanded_uncertainty: Option<f64>,
    /// Decision rule, in words.
    pub(crate) decision_rule: String,
    /// Probability that the true value is outside of the specification (JCGM 106:2012, 7.2).
    pub(crate) nonconformity_probability: Option<f64>,
}

/// Why a measurement differs from the declared model.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Gap {
    /// Plan that was measured.
    pub(crate) plan: String,
    /// ns since 1970.
    pub(crate) at: i64,
    /// `NO_GAP`, `EXPLAINED`, `PARTLY_EXPLAINED` or `UNEXPLAINED`.
    pub(crate) verdict: String,
    /// Root mean square of the deviations, m.
    pub(crate) rms: Option<f64>,
    /// That of the noise, m.
    pub(crate) noise_floor: Option<f64>,
    /// In the order in which they close the gap.
    pub(crate) causes: Vec<Cause>,
}

/// An effect that explains a part of a gap.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Cause {
    /// Identifier of the effect.
    pub(crate) effect: String,
    /// 0 to 1.
    pub(crate) probability: Option<f64>,
    /// Effects that the session cannot tell from it: with it, one group.
    pub(crate) rivals: Vec<String>,
    /// Names of its parameters.
    pub(crate) names: Vec<String>,
    /// Values, in `units`.
    pub(crate) values: Vec<Option<f64>>,
    /// Units.
    pub(crate) units: Vec<String>,
    /// Lower ends of the intervals of 95 %, in `units`.
    pub(crate) lower: Vec<Option<f64>>,
    /// Upper ends.
    pub(crate) upper: Vec<Option<f64>>,
}
