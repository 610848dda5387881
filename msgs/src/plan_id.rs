//! The identifiers of inspection plans and of runs, which messages carry as strings.
//!
//! ```text
//! shaft 7/finish/2        second measurement of the pass `finish` of the part `shaft 7`   (made by `cycle`)
//! shaft 7/finish/2/next   first supplement of that measurement: further touches of the same clamping
//! shaft 7/finish/2/next/3 its third supplement
//! bore check              a plan that an operator has named
//! ```
//!
//! This is the one place that reads and writes that grammar. [`PlanId`] and its text are the same value: parsing a text
//! and displaying the result gives the text again.

use std::{convert::Infallible, fmt, str::FromStr};

use serde::{Deserialize, Serialize};

/// True for a character that a name must not hold and a terminal must not get: controls of the sets C0 and C1, line and
/// paragraph separators, and what turns the direction of writing (Unicode 16.0, 23.1, 23.2 and UAX #9).
pub fn is_unprintable(letter: char) -> bool {
    let turns = matches!(letter, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    letter.is_control() || turns || matches!(letter, '\u{2028}' | '\u{2029}')
}

/// What follows the identifier of a plan in that of its first supplement.
const SUPPLEMENT: &str = "/next";

/// One machining pass of one part: what is measured, corrected and measured again under one identifier.
///
/// Its text is `PART/PASS`. A part identifier may itself contain a slash, so the text cannot be taken apart again.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct RunId(String);

impl RunId {
    /// The run of pass `pass` of the part `part_id`.
    pub fn new(part_id: &str, pass: &str) -> Self {
        Self(format!("{part_id}/{pass}"))
    }
}

impl fmt::Display for RunId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Identifier of an inspection plan, as `plan_id` carries it in messages.
///
/// ```
/// use probecell_msgs::{PlanId, RunId};
///
/// let plan = PlanId::measurement(RunId::new("shaft 7", "finish"), 2);
/// assert_eq!(plan.to_string(), "shaft 7/finish/2");
///
/// let further = PlanId::from("shaft 7/finish/2/next/3");
/// assert_eq!(further.supplemented(), Some("shaft 7/finish/2"));
/// assert_eq!(further.supplement_number(), 3);
/// ```
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum PlanId {
    /// A measurement of a run; `number` counts from 1.
    Measurement {
        /// The run.
        run: RunId,
        /// Number of the measurement in the run, from 1.
        number: u32,
    },
    /// Further touches that are evaluated together with the plan `of`; `number` counts from 1.
    Supplement {
        /// Identifier of the plan that is supplemented.
        of: String,
        /// Number of the supplement, from 1.
        number: u32,
    },
    /// Any other name.
    Named(String),
}

impl PlanId {
    /// The `number`-th measurement (from 1) of a run.
    pub fn measurement(run: RunId, number: u32) -> Self {
        Self::Measurement { run, number }
    }

    /// The `number`-th supplement (from 1) of this plan.
    pub fn supplement(&self, number: u32) -> Self {
        Self::Supplement {
            of: self.to_string(),
            number: number.max(1),
        }
    }

    /// The run that a measurement belongs to; a plan of no run counts as one of its own.
    pub fn run(&self) -> RunId {
        match self {
            Self::Measurement { run, .. } => run.clone(),
            Self::Supplement { .. } | Self::Named(_) => RunId(self.to_string()),
        }
    }

    /// Identifier of the plan that a supplement adds touches to; `None` for every other plan.
    pub fn supplemented(&self) -> Option<&str> {
        match self {
            Self::Supplement { of, .. } => Some(of),
            Self::Measurement { .. } | Self::Named(_) => None,
        }
    }

    /// Number of a supplement, from 1; 0 for every other plan.
    pub fn supplement_number(&self) -> u32 {
        match self {
            Self::Supplement { number, .. } => *number,
            Self::Measurement { .. } | Self::Named(_) => 0,
        }
    }
}

impl fmt::Display for PlanId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Measurement { run, number } => write!(f, "{run}/{number}"),
            Self::Supplement { of, number: 1 } => write!(f, "{of}{SUPPLEMENT}"),
            Self::Supplement { of, number } => write!(f, "{of}{SUPPLEMENT}/{number}"),
            Self::Named(name) => f.write_str(name),
        }
    }
}

/// A count as it is written: decimal digits, no leading zero, so that it displays as it was read.
fn count(digits: &str) -> Option<u32> {
    let canonical = !digits.starts_with(['0', '+']);
    digits.parse().ok().filter(|_| canonical)
}

impl From<&str> for PlanId {
    fn from(text: &str) -> Self {
        let named = || Self::Named(text.to_owned());
        let supplement = |of: &str, number| Self::Supplement {
            of: of.to_owned(),
            number,
        };
        if let Some(of) = text.strip_suffix(SUPPLEMENT).filter(|of| !of.is_empty()) {
            return supplement(of, 1);
        }
        let Some((before, last)) = text.rsplit_once('/').filter(|(run, _)| !run.is_empty()) else {
            return named();
        };
        let Some(number) = count(last) else {
            return named();
        };
        match before.strip_suffix(SUPPLEMENT) {
            // The first supplement carries no number.
            Some(of) if !of.is_empty() && number > 1 => supplement(of, number),
            Some(_) => named(),
            None => Self::measurement(RunId(before.to_owned()), number),
        }
    }
}

impl From<String> for PlanId {
    fn from(text: String) -> Self {
        Self::from(text.as_str())
    }
}

impl From<&String> for PlanId {
    fn from(text: &String) -> Self {
        Self::from(text.as_str())
    }
}

impl From<PlanId> for String {
    fn from(plan: PlanId) -> Self {
        plan.to_string()
    }
}

impl FromStr for PlanId {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(Self::from(text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_text_is_displayed_as_it_was_read() {
        for text in [
            "",
            "/",
            "a",
            "a/1",
            "a/b/12",
            "a/b/0",
            "a/b/01",
            "a/b/+1",
            "/1",
            "//1",
            "/next",
            "a/next",
            "a/next/1",
            "a/next/2",
            "a/next/02",
            "a/next/next",
            "a/next/2/next/3",
            "a/nextly",
            "a/next/4294967296",
            "a/b/4294967296",
            "a b/ü/3",
        ] {
            assert_eq!(PlanId::from(text).to_string(), text);
        }
    }

    #[test]
    fn identifiers_are_read_as_they_were_made() {
        let run = RunId::new("lot/7", "finish");
        for number in [1, 2, 10, u32::MAX] {
            let plan = PlanId::measurement(run.clone(), number);
            assert_eq!(PlanId::from(plan.to_string()), plan);
            assert_eq!(plan.run().to_string(), "lot/7/finish");
            for base in [plan, PlanId::from("punch"), PlanId::from("punch/next")] {
                let further = base.supplement(number);
                assert_eq!(PlanId::from(further.to_string()), further);
                assert_eq!(further.supplemented(), Some(base.to_string().as_str()));
                assert_eq!(further.supplement_number(), number);
                assert_eq!(further.run().to_string(), further.to_string());
            }
        }
    }

    #[test]
    fn what_is_neither_measurement_nor_supplement_is_a_name() {
        for text in [
            "bore check",
            "fixture/left",
            "/next",
            "/3",
            "a/next/1",
            "a/b/03",
        ] {
            let plan = PlanId::from(text);
            assert_eq!(plan, PlanId::Named(text.to_owned()));
            assert_eq!((plan.supplemented(), plan.supplement_number()), (None, 0));
            assert_eq!(plan.run().to_string(), text);
        }
    }

    #[test]
    fn it_is_serialised_as_its_text() {
        use serde::de::{IntoDeserializer, value::Error};
        let text = IntoDeserializer::<Error>::into_deserializer("punch/next/2");
        let plan = PlanId::deserialize(text);
        assert_eq!(plan, Ok(PlanId::from("punch").supplement(2)));
    }
}
