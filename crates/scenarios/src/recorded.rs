//! A session as a cell would have recorded it, with the effect that is hidden in it.

use diagnosis::{Options, Report, Session, Verdict, diagnose};

use crate::{Figure, Rule, ScenarioError};

/// What the diagnosis of a session has to say.
#[derive(Clone, Debug, PartialEq)]
pub enum Expected {
    /// Nothing: the cell behaves as its model.
    NoGap,
    /// These effects, each by name or as indistinguishable from one that is named, and nothing besides; with them in the
    /// model the held-out rms falls to this share of what it was, or below.
    Effects(&'static [&'static str], f64),
}

/// A recorded session.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// Which one of the scenario, for a folder name: lower case, `_`.
    pub name: &'static str,
    /// The messages; `name` in it is for reports.
    pub session: Session,
    /// What is hidden in it.
    pub expected: Expected,
}

impl Recorded {
    /// Diagnoses the session.
    pub fn diagnose(&self) -> Result<Report, ScenarioError> {
        Ok(diagnose(&self.session, &Options::default())?)
    }

    /// The figures by which a diagnosis of this session is judged.
    pub fn judge(&self, report: &Report) -> Vec<Figure> {
        let found: Vec<&str> = report
            .effects
            .iter()
            .map(|effect| effect.effect.as_str())
            .collect();
        let stands_for = |id: &str| {
            report.effects.iter().any(|effect| {
                effect.effect == id
                    || effect
                        .indistinguishable_from
                        .iter()
                        .any(|other| other == id)
            })
        };
        match &self.expected {
            Expected::NoGap => {
                let verdict = match (report.verdict, found.is_empty()) {
                    (Verdict::NoGap, true) => "no gap".to_owned(),
                    (verdict, _) => format!("{verdict:?}: {}", found.join(", ")),
                };
                vec![
                    Figure::new(
                        format!("diagnosis_{}", self.name),
                        format!("diagnosis of session {}", self.name),
                        "",
                        verdict,
                    )
                    .rule(Rule::Equals("no gap".into())),
                ]
            }
            Expected::Effects(hidden, share) => {
                let right = found.len() <= hidden.len() && hidden.iter().all(|id| stands_for(id));
                let text = if right {
                    hidden.join(", ")
                } else {
                    format!("{:?}: {}", report.verdict, found.join(", "))
                };
                let shrunk = match (report.effects.first(), report.effects.last()) {
                    (Some(first), Some(last)) => last.rms_after / first.rms_before,
                    _ => 1.0,
                };
                vec![
                    Figure::new(
                        format!("diagnosis_{}", self.name),
                        format!("diagnosis of session {}", self.name),
                        "",
                        text,
                    )
                    .rule(Rule::Equals(hidden.join(", ").into())),
                    Figure::new(
                        format!("diagnosis_{}_gap_ratio", self.name),
                        format!(
                            "held-out gap of session {}: with the effect, over without",
                            self.name
                        ),
                        "",
                        shrunk,
                    )
                    .rule(Rule::AtMost(*share)),
                ]
            }
        }
    }
}
