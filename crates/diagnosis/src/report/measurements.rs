//! What a report of several measurements of one recording says of them. Metres; instants in ns since 1970.

use effects::session::utc;
use probecell_msgs::builtin_interfaces::Time;
use serde::{Deserialize, Serialize};

use crate::onset::Change;
use crate::report::{Effect, numbers::grouped};

/// Plans that are named of those left out for one reason.
const NAMED: usize = 3;

/// The measurements of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measurements {
    /// Touches of which the means were taken.
    pub touches: usize,
    /// Measurements that were diagnosed together.
    pub measurements: usize,
    /// Parts that were measured.
    pub parts: usize,
    /// Stretches of consecutive measurements whose touches were averaged point by point.
    pub stretches: usize,
    /// Measurements before the last change, which were compared with those since.
    pub before_change: usize,
    /// Changes of the gap, in the order of their detection.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub changes: Vec<Changed>,
    /// Tools that wear or have broken: `process.tool_wear` over the parts.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub tools: Vec<ToolTrend>,
    /// Tools whose constant material was fitted in each stretch: corrected, or cut again by a later pass.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub corrected_tools: Vec<u32>,
    /// Measurements that were not used.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub left_out: Vec<LeftOut>,
}

/// What a tool leaves from pass to pass, along the normal of what it cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToolTrend {
    /// Its number.
    pub tool: u32,
    /// Passes that were measured.
    pub passes: usize,
    /// 95 % interval of the material that each pass leaves more than the one before, m; none where it is not sure to be other than 0.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub per_pass: Option<[f64; 2]>,
    /// All tools with a trend have the same one: a drift of machine, probe or parts would look the same.
    pub is_like_others: bool,
    /// Steps, in the order of time.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub steps: Vec<ToolStep>,
}

/// A tool leaves more or less from one pass on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToolStep {
    /// The first measurement of it.
    pub plan_id: String,
    /// Its first touch, ns since 1970.
    pub since: i64,
    /// 95 % interval of the change, m.
    pub change: [f64; 2],
}

/// Measurements that were not used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Why, a sentence.
    pub reason: String,
    /// Their plans.
    pub plans: Vec<String>,
}

/// A change of the gap from one measurement on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Changed {
    /// The first measurement that has changed.
    pub plan_id: String,
    /// Its first touch, ns since 1970.
    pub since: i64,
    /// Root mean square of the change over the points, and of what the cause leaves of it, m.
    pub rms: [f64; 2],
    /// What has changed; none where no known effect explains it.
    pub cause: Option<Effect>,
}

impl From<&Change> for Changed {
    fn from(change: &Change) -> Self {
        Self {
            plan_id: change.plan_id.clone(),
            since: change.since,
            rms: change.rms,
            cause: change.cause.clone(),
        }
    }
}

impl Measurements {
    /// `8,120 touches of 191 measurements, 92 parts`.
    pub fn heading(&self) -> String {
        let all = [self.touches, self.measurements, self.parts].map(grouped);
        format!(
            "{} touches of {} measurements, {} parts",
            all[0], all[1], all[2]
        )
    }

    /// How they were taken, what has changed, and what was left out: a sentence each, without its stop.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "averaged point by point over {} stretches of consecutive measurements",
            self.stretches
        )];
        lines.extend(self.changes.iter().map(Changed::text));
        lines.extend(self.tools.iter().flat_map(ToolTrend::lines));
        if self.before_change > 0 {
            let count = grouped(self.before_change);
            lines.push(format!(
                "{count} measurements before the last change are compared in it alone"
            ));
        }
        if !self.corrected_tools.is_empty() {
            let tools: Vec<String> = self.corrected_tools.iter().map(u32::to_string).collect();
            let tools = tools.join(", ");
            lines.push(format!(
                "corrected or cut again: the constant material of tool {tools} is no cause here"
            ));
        }
        lines.extend(self.left_out.iter().map(|left| {
            let named = left.plans[..left.plans.len().min(NAMED)].join(", ");
            let more = if left.plans.len() > NAMED {
                ", …"
            } else {
                ""
            };
            let count = grouped(left.plans.len());
            format!("left out: {count} ({named}{more}): {}", left.reason)
        }));
        lines
    }
}

impl ToolTrend {
    fn lines(&self) -> Vec<String> {
        let amount = |[low, high]: [f64; 2], digits: usize| {
            let (value, half) = (f64::midpoint(low, high) * 1e6, (high - low) * 0.5e6);
            let more = if value < 0.0 { "less" } else { "more" };
            format!("{:.digits$} ± {half:.digits$} µm {more}", value.abs())
        };
        let tool = self.tool;
        let wear = self.per_pass.map(|per_pass| {
            let cause = if self.is_like_others {
                "wear of all tools alike, or a drift of machine, probe or parts"
            } else if per_pass[0] > 0.0 {
                "it wears (process.tool_wear)"
            } else {
                "a built-up edge grows, or the machine drifts"
            };
            let more = amount(per_pass, 2);
            format!(
                "tool {tool} leaves {more} with each of {} passes: {cause}",
                self.passes
            )
        });
        let steps = self.steps.iter().map(|step| {
            let (more, from) = (amount(step.change, 1), &step.plan_id);
            let at = utc(Time::from_nanos(step.since));
            format!("tool {tool} leaves {more} from {from} on ({at}): its edge broke, or it was moved or changed")
        });
        wear.into_iter().chain(steps).collect()
    }
}

impl Changed {
    fn text(&self) -> String {
        let [before, after] = self.rms.map(|rms| rms * 1e6);
        let cause = self.cause.as_ref();
        let cause = cause.map_or_else(|| "no known effect".to_owned(), Effect::of_group);
        let from = &self.plan_id;
        format!("changed from {from} on by {before:.2} µm rms: {cause} (leaves {after:.2} µm)")
    }
}
