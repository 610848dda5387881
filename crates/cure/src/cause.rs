//! Causes of a report that are certain enough to be written into a machine.

use diagnosis::Report;
use diagnosis::report::{Effect, JointZero, Level, ParameterEstimate};
use effects::effect::Subject;
use effects::{DeclaredEffect, DeclaredParameter, registry};

use crate::CureError;

/// Least probability of a cause that is written.
const PROBABLE: f64 = 0.95;

/// Channel of a report on efforts.
const EFFORT: &str = "effort";

/// An interval narrower than this share of its value is what rounding leaves of a constant.
const CONSTANT: f64 = 1e-9;

/// A cause that may be written.
#[derive(Debug, Clone)]
pub(crate) struct Cause {
    /// Identifier of the vocabulary.
    pub(crate) name: String,
    /// Its parameters, SI.
    pub(crate) parameters: Vec<ParameterEstimate>,
    /// Equals among which a person chose it, itself included; empty where there was no choice.
    pub(crate) chosen_from: Vec<String>,
    /// True where its interval is wider than the effect, and a person chose to write it.
    pub(crate) is_vague: bool,
    /// Held-out root mean square of the gap without it and with it, in the unit of the report.
    pub(crate) gap: [f64; 2],
    /// The same as the zero of a joint.
    pub(crate) joint_zero: Option<JointZero>,
}

/// An effect that is not written.
#[derive(Debug, Clone)]
pub(crate) struct Refused {
    /// Identifier of the vocabulary.
    pub(crate) effect: String,
    /// Why not.
    pub(crate) why: String,
}

/// What a report says of one of its effects.
pub(crate) type Judged = Result<Cause, Refused>;

impl Cause {
    /// Identifier of its kind, such as `axis.<A>.scale`.
    pub(crate) fn kind(&self) -> &'static str {
        kind(&self.name)
    }

    /// Name of its axis; empty for one that has none.
    pub(crate) fn axis(&self) -> &str {
        registry::find(&self.name).map_or("", |(_, of)| of.axis)
    }

    /// A parameter.
    pub(crate) fn parameter(&self, name: &str) -> Option<&ParameterEstimate> {
        self.parameters.iter().find(|one| one.name == name)
    }

    /// Value of a parameter; 0 where it has none of that name.
    pub(crate) fn value(&self, name: &str) -> f64 {
        self.parameter(name).map_or(0.0, |one| one.value)
    }

    /// 95 % interval of a parameter.
    pub(crate) fn interval(&self, name: &str) -> [f64; 2] {
        self.parameter(name).map_or([0.0; 2], |one| one.ci95)
    }

    /// The same as an effect of a declared model, which the library predicts.
    pub(crate) fn declared(&self) -> DeclaredEffect {
        let parameter = |one: &ParameterEstimate| DeclaredParameter {
            name: one.name.clone(),
            value: one.value,
            unit: one.unit.clone(),
            ci95: None,
        };
        DeclaredEffect {
            effect: self.name.clone(),
            parameters: self.parameters.iter().map(parameter).collect(),
            chosen_from: Vec::new(),
            source: None,
            measured: None,
            promised: None,
        }
    }
}

/// Identifier of the kind of an effect; empty outside the vocabulary.
pub(crate) fn kind(name: &str) -> &'static str {
    registry::find(name).map_or("", |(effect, _)| effect.id())
}

/// What a report says of each of its effects: a cause that may be written, or why not.
///
/// `members` are those of groups of equals that a person has chosen.
///
/// # Errors
/// [`CureError::Report`] for a report that is neither of touches nor of efforts, and for a member of no group.
pub(crate) fn causes(report: &Report, members: &[String]) -> Result<Vec<Judged>, CureError> {
    let displaces = report.channel == "touch" && report.gap.unit == "m";
    if !displaces && report.channel != EFFORT {
        return Err(CureError::Report(format!(
            "the report of {} is on the channel {}: only causes that displace a touch, or take an effort, are written into a machine",
            report.bag, report.channel
        )));
    }
    let in_group = |name: &String| {
        let mut groups = report.effects.iter().map(group);
        groups.any(|group| group.contains(name))
    };
    if let Some(other) = members.iter().find(|name| !in_group(name)) {
        let known: Vec<String> = report.effects.iter().flat_map(group).collect();
        return Err(CureError::Report(format!(
            "--member {other} is in no group of this report, which names {}",
            known.join(", ")
        )));
    }
    Ok(report
        .effects
        .iter()
        .map(|effect| judged(report, effect, members))
        .collect())
}

/// All of which one acts, the named one first.
fn group(effect: &Effect) -> Vec<String> {
    let mut all = vec![effect.effect.clone()];
    let others = effect.group.iter().chain(&effect.indistinguishable_from);
    for other in others {
        if !all.contains(other) {
            all.push(other.clone());
        }
    }
    all
}

fn judged(report: &Report, effect: &Effect, members: &[String]) -> Judged {
    let refused = |name: &str, why: String| {
        Err(Refused {
            effect: name.to_owned(),
            why,
        })
    };
    let group = group(effect);
    let chosen = members.iter().find(|name| group.contains(name));
    let name = chosen.unwrap_or(&effect.effect);
    let of_machine = |name: &String| not_of_a_machine(name, report).is_none();
    if group.len() > 1 && chosen.is_none() && group.iter().any(of_machine) {
        let why = format!(
            "this session cannot tell it from {}; measure what tells them apart, or say which by --member",
            group[1..].join(", ")
        );
        return refused(name, why);
    }
    if let Some(why) = not_of_a_machine(name, report) {
        return refused(name, why.to_owned());
    }
    if report.level == Level::Pattern {
        let why = "it closes a small part of the gap only, and something unknown the rest";
        return refused(name, why.to_owned());
    }
    if !(effect.probability >= PROBABLE) {
        let why = format!(
            "its probability is {:.3}, less than {PROBABLE}",
            effect.probability
        );
        return refused(name, why);
    }
    let Some(parameters) = parameters(effect, name) else {
        return refused(name, "the report has no parameters of it".to_owned());
    };
    // What the data do not say of a link stays as it is declared.
    let shrinks = name == "drive.link_inertia";
    let is_vague = is_vague(&parameters) && !shrinks;
    if is_vague && chosen.is_none() {
        let more = if name == "drive.payload" {
            "fit a motion without the load beside one with it"
        } else {
            "measure more that shows it"
        };
        let why = format!(
            "its 95 % interval is wider than the effect itself: {more}, or take it as it is by --member {name}"
        );
        return refused(name, why);
    }
    Ok(Cause {
        name: name.clone(),
        parameters,
        chosen_from: if group.len() > 1 { group } else { Vec::new() },
        is_vague,
        gap: [effect.rms_before, effect.rms_after],
        joint_zero: (effect.joint_zero.clone()).filter(|_| *name == effect.effect),
    })
}

fn parameters(effect: &Effect, name: &str) -> Option<Vec<ParameterEstimate>> {
    if effect.effect == name {
        return (!effect.is_family()).then(|| effect.parameters.clone());
    }
    let mut others = effect.alternatives.iter();
    let other = others.find(|other| other.effect == name)?;
    Some(other.parameters.clone())
}

/// Why an effect is none that a machine could be told; `None` for one of machine or probe that lasts.
fn not_of_a_machine(name: &str, report: &Report) -> Option<&'static str> {
    if name.starts_with("thermal.") {
        return Some("it drifts, and is not frozen into a table");
    }
    let Some(acts_on) = registry::acts_on(name) else {
        return Some("it is outside the vocabulary, and nobody knows what would mend it");
    };
    match acts_on.subject {
        Subject::Machine | Subject::Probe => None,
        Subject::Part | Subject::Session | Subject::Cutting => Some(
            "it belongs to the part, its clamping or the process, which are not written into a machine",
        ),
        Subject::Record => Some("it belongs to the records of one session, not to the machine"),
        Subject::Drive if report.channel == EFFORT => None,
        Subject::Drive | Subject::Motion => {
            Some("it belongs to a drive or the time of moves, and displaces no touch")
        }
    }
}

/// True where the size of an effect is not known well enough: the interval is wider than the effect. Of several numbers, such as the errors of
/// a table, their root sums of squares are compared; constants have no interval, and a phase is none of them.
fn is_vague(parameters: &[ParameterEstimate]) -> bool {
    let Some(ParameterEstimate { unit, .. }) = parameters.first() else {
        return false;
    };
    let width = |one: &ParameterEstimate| one.ci95[1] - one.ci95[0];
    let fitted: Vec<&ParameterEstimate> = (parameters.iter())
        .filter(|one| one.unit == *unit && width(one) > CONSTANT * one.value.abs())
        .collect();
    let norm = |of: &dyn Fn(&ParameterEstimate) -> f64| {
        let squares = fitted.iter().map(|one| of(one).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let (size, wide) = (norm(&|one| one.value), norm(&width));
    !fitted.is_empty() && !(wide <= size)
}
