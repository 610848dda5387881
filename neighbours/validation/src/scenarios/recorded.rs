//! A session as a cell would have recorded it, with the effect that is hidden in it.

use diagnosis::{Options, Report, Session, Verdict, diagnose};

use crate::scenarios::{Figure, Rule, ScenarioError};

/// What the diagnosis of a session has to say.
#[derive(Clone, Debug, PartialEq)]
pub enum Expected {
    /// Nothing: the cell behaves as its model.
    NoGap,
    /// That something acts that its vocabulary does not have; no effect is blamed for it.
    Unknown,
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
    ///
    /// # Errors
    /// Why the session cannot be diagnosed.
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
        let named = if found.is_empty() {
            "nothing".to_owned()
        } else {
            found.join(", ")
        };
        let figure = Figure::new(
            format!("diagnosis_{}", self.name),
            format!("effects named in session {}", self.name),
            "",
            named,
        );
        match &self.expected {
            Expected::NoGap => {
                let holds = report.verdict == Verdict::NoGap && found.is_empty();
                vec![figure.rule(Rule::Judged("no gap".to_owned(), holds))]
            }
            Expected::Unknown => {
                let holds = report.verdict == Verdict::Unexplained && found.is_empty();
                let words = "none named, the gap left unexplained".to_owned();
                vec![figure.rule(Rule::Judged(words, holds))]
            }
            Expected::Effects(hidden, share) => {
                let holds = found.len() <= hidden.len() && hidden.iter().all(|id| stands_for(id));
                let words = format!(
                    "{}, by name or indistinguishable from it",
                    hidden.join(" and ")
                );
                let shrunk = match (report.effects.first(), report.effects.last()) {
                    (Some(first), Some(last)) => last.rms_after / first.rms_before,
                    _ => f64::NAN,
                };
                vec![
                    figure.rule(Rule::Judged(words, holds)),
                    Figure::new(
                        format!("diagnosis_{}_gap_ratio", self.name),
                        format!(
                            "held-out gap of session {}: with them in the model over without",
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
