//! The gap report: what is told to a person, a program and the bus. Field names are the interface contract's.
//!
//! SI units throughout, as the contract fixes; text for people is made in `summary`.

use probecell_msgs::InspectionPlan;
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
    /// Named effects explain part of it; something unknown acts besides.
    PartlyExplained,
    /// Something acts that the vocabulary does not know.
    Unexplained,
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
    /// Number of touches (or samples) used.
    pub samples: usize,
    /// The answer in a word.
    pub verdict: Verdict,
    /// Size of the gap.
    pub gap: Gap,
    /// The noise of a touch with its interval: of all, and by feed and by direction where the touches tell.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub noise: Vec<Noise>,
    /// Where the gap's energy lies.
    #[serde(rename = "where")]
    pub place: Vec<Place>,
    /// Effects that the model held already; the gap is what they leave.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub declared: Vec<Declared>,
    /// Effects added to the model, in the order in which they close the gap.
    pub effects: Vec<Effect>,
    /// What remains.
    pub unexplained: Unexplained,
    /// Effects that were considered and are improbable, most probable first.
    pub rejected: Vec<Rejected>,
    /// What to measure to part the rivals.
    pub next_measurement: Vec<NextMeasurement>,
    /// Remarks on the input: skipped events, set-aside touches, approximations.
    pub warnings: Vec<String>,
}

/// Which machine it was.
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

/// An effect of the declared model, and what became of its promise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Declared {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Its declared parameters.
    pub parameters: Vec<ParameterEstimate>,
    /// Effects among which a person chose it.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub chosen_from: Vec<String>,
    /// The session that had shown it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub source: Option<String>,
    /// When that session was measured, RFC 3339.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub measured: Option<String>,
    /// How far it closed the gap there, on touches that were not fitted.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub promised: Option<Sizes>,
    /// How far it closes the gap here, where nothing was fitted; absent in a joint diagnosis.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub achieved: Option<Sizes>,
    /// True where the 95 % intervals of what remains reach each other, or less remains than promised; judged with all
    /// effects that the same session showed, since they were fitted together.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub kept: Option<bool>,
}

impl Declared {
    /// True for two effects that one session showed.
    pub fn found_with(&self, other: &Self) -> bool {
        self.source.is_some() && self.source == other.source && self.measured == other.measured
    }
}

/// Size of the gap without and with an effect, m.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sizes {
    /// Rms without it.
    pub rms_before: f64,
    /// Rms with it.
    pub rms_after: f64,
    /// 95 % interval of `rms_after`.
    pub ci95_after: [f64; 2],
}

/// The promise of an adopted effect, as a cell file holds it.
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

/// Size of the gap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Unit of every root mean square of the report: `m`, `rad`, or that of an effort channel (`N`, `N m`, `A`).
    #[serde(default = "metres")]
    pub unit: String,
    /// Root mean square of the deviations.
    pub rms: f64,
    /// Standard deviation of the noise.
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

fn metres() -> String {
    "m".to_owned()
}

/// A place and its share of an energy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// `component`, `axis`, `feature`, `direction`, `time` or `region`.
    pub dimension: String,
    /// Which one: a name, or the coordinate of an interval.
    pub key: String,
    /// Beginning of the interval, m, rad or s.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub from: Option<f64>,
    /// End of the interval.
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
    /// Probability that it acts, it or one it cannot be told from.
    pub probability: f64,
    /// Its parameters.
    pub parameters: Vec<ParameterEstimate>,
    /// Held-out rms without it, m.
    pub rms_before: f64,
    /// Held-out rms with it, m.
    pub rms_after: f64,
    /// 95 % interval of `rms_after`.
    pub ci95_after: [f64; 2],
    /// True: judged on touches that were not used to fit.
    pub held_out: bool,
    /// Effects this session cannot tell from it.
    pub indistinguishable_from: Vec<String>,
    /// The same with each of those in its place, where it can be fitted so.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub alternatives: Vec<Alternative>,
    /// Held-out rms when a wrong effect with as many parameters stands in its place, m.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub placebo_rms_after: Option<f64>,
    /// The same for each session that judges, where several do.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub sessions: Vec<OfSession>,
}

/// An effect that could stand in another's place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Alternative {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Its parameters there.
    pub parameters: Vec<ParameterEstimate>,
}

/// What an effect does to the gap of one session (and one axis of it) that judges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OfSession {
    /// Name of the session.
    pub bag: String,
    /// Axis, in a drive session.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub axis: Option<String>,
    /// Held-out rms without the effect.
    pub rms_before: f64,
    /// Held-out rms with it.
    pub rms_after: f64,
    /// 95 % interval of `rms_after`.
    pub ci95_after: [f64; 2],
}

/// A parameter with its uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterEstimate {
    /// Name.
    pub name: String,
    /// Best value.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// 95 % interval.
    pub ci95: [f64; 2],
}

/// What no named effect explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unexplained {
    /// Its root mean square beyond the noise, m.
    pub rms: f64,
    /// Where it lies.
    #[serde(rename = "where")]
    pub place: Vec<Place>,
}

/// An effect that was considered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rejected {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Probability that it acts.
    pub probability: f64,
}

/// Touches that part explanations which are still possible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextMeasurement {
    /// What the touches part: effects, and `unknown` for what the vocabulary lacks.
    pub separates: Vec<String>,
    /// The touches, most telling first.
    pub points: Vec<NextPoint>,
    /// The same touches as a plan that a cell can run; its points in the order of `points`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub plan: Option<InspectionPlan>,
    /// The most probable explanations now, most probable first.
    #[serde(default)]
    pub explanations: Vec<Explanation>,
    /// Predicted chance that after the touches one explanation is more probable than 0.95.
    #[serde(default)]
    pub chance: f64,
    /// Pairs of effects that are possible here and that no touch within reach parts: they count as one.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub inseparable: Vec<Vec<String>>,
}

/// One explanation that is still possible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// Its effects; none for no gap, `unknown` among them where something outside the vocabulary acts.
    pub effects: Vec<String>,
    /// Its probability.
    pub probability: f64,
}

/// A touch worth taking.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextPoint {
    /// Point of the plan whose place (or the place nearest to the new one) and direction are used.
    pub point_index: usize,
    /// Prescribed axis positions, in the order of the plan's rotary_names, rad.
    pub rotary_positions: Vec<f64>,
    /// Speed of approach, m/s.
    pub feed: f64,
    /// How far apart the two most probable explanations predict the deviation, m.
    pub difference: f64,
    /// Id of the feature.
    #[serde(default)]
    pub feature: String,
    /// Nominal point in the part frame, m.
    #[serde(default)]
    pub position: [f64; 3],
    /// What the touch does that the plan did not.
    #[serde(default)]
    pub why: String,
}
