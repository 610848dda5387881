//! The gap report, as published to people, programs and the bus. Field names are those of the interface contract.
//!
//! SI units throughout; `summary` renders it as text.

pub(crate) mod declared;
mod finish;
mod joint_zero;
pub(crate) mod localisation;
pub mod measurements;
pub mod noise;
pub(crate) mod numbers;
mod remedy;
pub mod residuals;
pub(crate) mod summary;

pub use effects::{ParameterEstimate, Promise};
pub use experiment::proposal::{Explanation, NextMeasurement, NextPoint};
pub use joint_zero::JointZero;
use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_128;

/// Identifier of this form of report.
pub const SCHEMA: &str = "probecell/gap-report/1";

/// How a session compares with its model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing beyond the noise.
    NoGap,
    /// The named effects explain all of it.
    Explained,
    /// The named effects explain part of it; an unknown cause acts as well.
    PartlyExplained,
    /// A cause outside the vocabulary acts.
    Unexplained,
}

/// What a person may conclude.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Nothing beyond the noise.
    NoGap,
    /// The named effects are the cause, each alone or as one of its group.
    Cause,
    /// The named effects close most of the gap on samples that were not used to fit; a remainder is left.
    MainCause,
    /// A small part of the gap follows the named effects: no reason to go to the machine.
    Pattern,
    /// No known effect accounts for the gap.
    #[default]
    Unknown,
}

/// A diagnosis, schema [`SCHEMA`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: String,
    /// Where the session came from; several names joined by ` + ` in a joint diagnosis.
    pub bag: String,
    /// Names of the sessions the model was fitted to; empty where it is one alone.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub fitted: Vec<String>,
    /// Names of the sessions that judged it without being fitted.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub withheld: Vec<String>,
    /// When its first touch was taken, RFC 3339, by the stamps.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub measured: Option<String>,
    /// The machine that was measured.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub machine: Option<Machine>,
    /// Of an arm in motion the link in whose frame a load at `probe_mount` is given.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub mount: Option<String>,
    /// Number of touches (or samples) used.
    pub samples: usize,
    /// The verdict.
    pub verdict: Verdict,
    /// What a person may conclude from it.
    #[serde(default)]
    pub level: Level,
    /// What was judged: `touch`, of drives `effort` or `motion`, of the moves between touches `time`.
    #[serde(default = "touches")]
    pub channel: String,
    /// Size of the gap.
    pub gap: Gap,
    /// The noise of a touch with its interval: of all, and by feed and by direction where there are enough touches.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub noise: Vec<Noise>,
    /// Localisation of the energy of the gap.
    #[serde(rename = "where")]
    pub place: Vec<Place>,
    /// Effects that the model declares; the gap is relative to the model with them.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub declared: Vec<Declared>,
    /// Effects added to the model, in the order in which they close the gap.
    pub effects: Vec<Effect>,
    /// The unexplained part of the gap.
    pub unexplained: Unexplained,
    /// Effects that were considered and rejected, most probable first.
    pub rejected: Vec<Rejected>,
    /// Measurements that would discriminate the remaining explanations.
    pub next_measurement: Vec<NextMeasurement>,
    /// Of the channel `time`: how long the compared moves were to take, and took.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub durations: Option<Durations>,
    /// Of a recording in which several parts were measured: which measurements were diagnosed together.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub measurements: Option<measurements::Measurements>,
    /// Remarks on the input: skipped events, rejected outliers, approximations.
    pub warnings: Vec<String>,
}

/// The machine that was measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Name in its robot description.
    pub name: String,
    /// Fingerprint of the text of its robot description: two reports with the same are of one model.
    pub fingerprint: String,
}

impl Machine {
    /// The machine of a robot description (URDF text); an unnamed one where there is none.
    pub fn of(robot_description: &str, name: &str) -> Self {
        let fingerprint = XxHash3_128::oneshot(robot_description.as_bytes());
        Self {
            name: name.to_owned(),
            fingerprint: format!("{fingerprint:032x}"),
        }
    }
}

/// How long the compared moves of a session take together, s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Durations {
    /// By the declared model.
    pub promised: f64,
    /// By the stamps.
    pub measured: f64,
    /// By the model with the named effects.
    pub explained: f64,
}

/// An effect of the declared model with its promised and its achieved reduction of the gap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Declared {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Its declared parameters.
    pub parameters: Vec<ParameterEstimate>,
    /// Effects among which a person chose it.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub chosen_from: Vec<String>,
    /// The session in which it was found.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub source: Option<String>,
    /// When that session was measured, RFC 3339.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub measured: Option<String>,
    /// Reduction of the gap there, on touches that were not fitted.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub promised: Option<Sizes>,
    /// Reduction of the gap here, where nothing was fitted; absent in a joint diagnosis.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub achieved: Option<Sizes>,
    /// True where the 95 % intervals of the remaining gap overlap, or less remains than promised; evaluated with all effects
    /// of the same source, since they were fitted together.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub kept: Option<bool>,
}

impl Declared {
    /// True for two effects that were found in the same session.
    pub fn found_with(&self, other: &Self) -> bool {
        self.source.is_some() && self.source == other.source && self.measured == other.measured
    }
}

/// Size of the gap without and with an effect, in [`Gap::unit`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sizes {
    /// Rms without it.
    pub rms_before: f64,
    /// Rms with it.
    pub rms_after: f64,
    /// 95 % interval of `rms_after`, in [`Gap::unit`].
    pub ci95_after: [f64; 2],
}

/// Size of the gap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Unit of every root mean square of the report: `m`, `rad`, or that of an effort channel (`N`, `N m`, `A`), or `s`.
    #[serde(default = "metres")]
    pub unit: String,
    /// Root mean square of the deviations, in [`Self::unit`].
    pub rms: f64,
    /// Standard deviation of the noise, in [`Self::unit`].
    pub noise_floor: f64,
    /// `rms` over `noise_floor`.
    pub ratio: f64,
}

/// The noise of some touches.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// `all`, `feed` or `direction`.
    pub of: String,
    /// Which of them: a feed in mm/s, or the axis of the part that the normals point along most; empty for all.
    pub key: String,
    /// How many touches.
    pub touches: usize,
    /// Standard deviation, m.
    pub floor: f64,
    /// Its 95 % interval, m.
    pub ci95: [f64; 2],
}

fn touches() -> String {
    "touch".to_owned()
}

fn metres() -> String {
    "m".to_owned()
}

/// A feature, direction or interval of a coordinate, with its share of an energy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// `component`, `axis`, `feature`, `direction`, `time` or `region`.
    pub dimension: String,
    /// Which one: a name, or the coordinate of an interval.
    pub key: String,
    /// Beginning of the interval, m, rad or s.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub from: Option<f64>,
    /// End of the interval, m, rad or s.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub to: Option<f64>,
    /// Share of the energy, 0 to 1.
    pub share: f64,
}

/// One effect that was added to the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Probability that it or one of its equivalence class acts.
    pub probability: f64,
    /// Its parameters.
    pub parameters: Vec<ParameterEstimate>,
    /// Held-out rms without it, in [`Gap::unit`].
    pub rms_before: f64,
    /// Held-out rms with it, in [`Gap::unit`].
    pub rms_after: f64,
    /// 95 % interval of `rms_after`, in [`Gap::unit`].
    pub ci95_after: [f64; 2],
    /// True: judged on touches that were not used to fit.
    pub held_out: bool,
    /// Its equivalence class: effects that are indistinguishable from it in this session.
    pub indistinguishable_from: Vec<String>,
    /// All of which one acts and these data cannot tell which, itself first: what a headline names.
    #[serde(default)]
    pub group: Vec<String>,
    /// Parameters of each of those in its place, where they can be fitted.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub alternatives: Vec<Alternative>,
    /// The same where it is the zero of a joint.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub joint_zero: Option<JointZero>,
    /// Held-out rms with another effect of as many parameters in its place, in [`Gap::unit`].
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub placebo_rms_after: Option<f64>,
    /// The same for each session of the cross-validation, where there are several.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub sessions: Vec<SessionGap>,
}

impl Effect {
    /// True for a family of effects that act together: its parameters have the names of their effects.
    pub fn is_family(&self) -> bool {
        let first = self.parameters.first();
        first.is_some_and(|one| effects::registry::find(&one.name).is_some())
    }
}

/// An effect that could substitute another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Alternative {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Its parameters in that place.
    pub parameters: Vec<ParameterEstimate>,
}

/// Reduction of the held-out gap of one session, and of one axis of it for drives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SessionGap {
    /// Name of the session.
    pub bag: String,
    /// Axis, in a drive session.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub axis: Option<String>,
    /// Held-out rms without the effect, in [`Gap::unit`].
    pub rms_before: f64,
    /// Held-out rms with it, in [`Gap::unit`].
    pub rms_after: f64,
    /// 95 % interval of `rms_after`, in [`Gap::unit`].
    pub ci95_after: [f64; 2],
}

/// The part of the gap that no named effect explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unexplained {
    /// Its root mean square beyond the noise, in [`Gap::unit`].
    pub rms: f64,
    /// Its localisation.
    #[serde(rename = "where")]
    pub place: Vec<Place>,
    /// How far named effects could explain it: not proven, in the order in which they would close the gap.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub ladder: Vec<Rung>,
}

/// An effect that could explain a part of what stays unexplained, beside those before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rung {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Held-out rms without it, in [`Gap::unit`].
    pub rms_before: f64,
    /// Held-out rms with it, in [`Gap::unit`].
    pub rms_after: f64,
}

/// An effect that was considered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rejected {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Probability that it acts.
    pub probability: f64,
    /// Why it is not named although it is probable.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub reason: Option<String>,
}
