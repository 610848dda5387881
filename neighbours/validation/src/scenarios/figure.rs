//! One figure of a scenario: what the source has, what the run gave, and the rule that judges it.
//!
//! A figure stands in the unit a person reads; its key ends in that unit. The text of a rule is made from the rule
//! itself, so that what is printed is what was checked.

use serde::Serialize;

/// A number, some numbers or a word.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// In the figure's unit.
    Number(f64),
    /// In the figure's unit, in the order its title says.
    Numbers(Vec<f64>),
    /// A verdict or a name.
    Text(String),
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl<const N: usize> From<[f64; N]> for Value {
    fn from(values: [f64; N]) -> Self {
        Self::Numbers(values.to_vec())
    }
}

impl From<Vec<f64>> for Value {
    fn from(values: Vec<f64>) -> Self {
        Self::Numbers(values)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl Value {
    fn numbers(&self) -> Option<&[f64]> {
        match self {
            Self::Number(value) => Some(std::slice::from_ref(value)),
            Self::Numbers(values) => Some(values),
            Self::Text(_) => None,
        }
    }

    /// As a person reads it.
    pub fn text(&self) -> String {
        match self {
            Self::Number(value) => number(*value),
            Self::Numbers(values) => values
                .iter()
                .map(|value| number(*value))
                .collect::<Vec<_>>()
                .join(", "),
            Self::Text(text) => text.clone(),
        }
    }
}

/// A number with four significant digits at least and no idle zeros.
fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let magnitude = value.abs().log10().floor();
    if magnitude < -5.0 {
        return format!("{value:.2e}");
    }
    let decimals = if magnitude >= 2.0 {
        2.0
    } else {
        3.0 - magnitude
    };
    let text = format!("{value:.0$}", decimals as usize);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// What a figure must be; of several numbers each one.
#[derive(Clone, Debug, PartialEq)]
pub enum Rule {
    /// It is only reported.
    Reported,
    /// No further than this from the source's figure.
    Near(f64),
    /// No further than this share of the source's figure from it.
    NearShare(f64),
    /// At most this.
    AtMost(f64),
    /// Below this.
    Below(f64),
    /// At least this.
    AtLeast(f64),
    /// Its size at most this.
    SizeAtMost(f64),
    /// This word or number.
    Equals(Value),
    /// What these words say; whether it holds was found out elsewhere.
    Judged(String, bool),
}

/// A figure of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name for programs: words joined by `_`, the unit last.
    pub key: String,
    /// Name for a person.
    pub title: String,
    /// Unit of the figure; empty for words, counts and ratios.
    pub unit: &'static str,
    /// What the source has.
    pub source: Option<Value>,
    /// What the run gave.
    pub ours: Value,
    /// What it must be.
    pub rule: Rule,
}

impl Figure {
    /// A figure that is reported and judged by nothing yet.
    pub fn new(
        key: impl Into<String>,
        title: impl Into<String>,
        unit: &'static str,
        ours: impl Into<Value>,
    ) -> Self {
        Self {
            key: key.into(),
            title: title.into(),
            unit,
            source: None,
            ours: ours.into(),
            rule: Rule::Reported,
        }
    }

    /// With the source's figure beside it.
    pub fn source(mut self, source: impl Into<Value>) -> Self {
        self.source = Some(source.into());
        self
    }

    /// Judged by a rule.
    pub fn rule(mut self, rule: Rule) -> Self {
        self.rule = rule;
        self
    }

    /// True if the rule is kept; a number that is not finite keeps none but the one that only reports.
    pub fn passes(&self) -> bool {
        let each = |keeps: &dyn Fn(f64) -> bool| {
            let numbers = self.ours.numbers();
            numbers.is_some_and(|all| !all.is_empty() && all.iter().all(|v| keeps(*v)))
        };
        match &self.rule {
            Rule::Reported => true,
            Rule::Near(tolerance) => self.beside_source(|_| *tolerance),
            Rule::NearShare(share) => self.beside_source(|source| share * source.abs()),
            Rule::AtMost(limit) => each(&|v| v <= *limit),
            Rule::Below(limit) => each(&|v| v < *limit),
            Rule::AtLeast(limit) => each(&|v| v >= *limit && v.is_finite()),
            Rule::SizeAtMost(limit) => each(&|v| v.abs() <= *limit),
            Rule::Equals(value) => self.ours == *value,
            Rule::Judged(_, holds) => *holds,
        }
    }

    fn beside_source(&self, tolerance: impl Fn(f64) -> f64) -> bool {
        let source = self.source.as_ref().and_then(Value::numbers);
        let (Some(source), Some(ours)) = (source, self.ours.numbers()) else {
            return false;
        };
        source.len() == ours.len()
            && source
                .iter()
                .zip(ours)
                .all(|(s, o)| (s - o).abs() <= tolerance(*s))
    }

    /// The rule in words, in the figure's unit; empty where there is none.
    pub fn rule_text(&self) -> String {
        let with_unit = |value: f64| {
            let text = number(value);
            if self.unit.is_empty() {
                text
            } else {
                format!("{text} {}", self.unit)
            }
        };
        match &self.rule {
            Rule::Reported => String::new(),
            // What differs only by rounding is the same.
            Rule::Near(tolerance) if *tolerance <= 1e-9 => "equal to the source".to_owned(),
            Rule::Near(tolerance) => format!("within {} of the source", with_unit(*tolerance)),
            Rule::NearShare(share) => format!("within {} % of the source", number(100.0 * share)),
            Rule::AtMost(limit) => format!("at most {}", with_unit(*limit)),
            Rule::Below(limit) => format!("below {}", with_unit(*limit)),
            Rule::AtLeast(limit) => format!("at least {}", with_unit(*limit)),
            Rule::SizeAtMost(limit) => format!("within ±{}", with_unit(*limit)),
            Rule::Equals(value) => format!("equal to {}", value.text()),
            Rule::Judged(words, _) => words.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rule_refuses_what_breaks_it_and_everything_that_is_no_number() {
        let figure = |ours: f64| Figure::new("x_um", "x", "µm", ours).source(10.0);
        for (rule, keeps, breaks) in [
            (Rule::Near(1.0), 11.0, 11.01),
            (Rule::NearShare(0.1), 9.0, 8.9),
            (Rule::AtMost(3.0), 3.0, 3.01),
            (Rule::Below(3.0), 2.9, 3.0),
            (Rule::AtLeast(3.0), 3.0, 2.9),
            (Rule::SizeAtMost(3.0), -3.0, -3.1),
            (Rule::Equals(Value::Number(4.0)), 4.0, 5.0),
        ] {
            assert!(figure(keeps).rule(rule.clone()).passes(), "{rule:?}");
            assert!(!figure(breaks).rule(rule.clone()).passes(), "{rule:?}");
            assert!(!figure(f64::NAN).rule(rule.clone()).passes(), "{rule:?}");
        }
        let none = Figure::new("x", "x", "", 1.0).rule(Rule::Near(1.0));
        assert!(!none.passes(), "near to nothing");
        let short = Figure::new("x", "x", "", [1.0, 2.0])
            .source([1.0])
            .rule(Rule::Near(1.0));
        assert!(!short.passes());
        let word = Figure::new("x", "x", "", "scale").rule(Rule::Equals("offset".into()));
        assert!(!word.passes());
        let nothing = Figure::new("x", "x", "", Vec::new()).rule(Rule::AtMost(1.0));
        assert!(!nothing.passes());
    }

    #[test]
    fn numbers_are_printed_without_idle_digits() {
        for (value, text) in [
            (-68.2, "-68.2"),
            (0.0342, "0.0342"),
            (213.64, "213.64"),
            (2e-6, "2.00e-6"),
            (-0.005583, "-0.005583"),
            (0.0, "0"),
            (7.0, "7"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
