//! The lines between a cell and the program that reads its signals.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::{DataType, controller};

/// A signal of a controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Signal {
    /// Its name in the cell.
    pub name: String,
    /// Where it stands.
    pub address: String,
    /// How it stands there.
    #[serde(rename = "type")]
    pub data_type: DataType,
    /// `value = stored * scale + offset`, in `unit`.
    pub scale: f64,
    /// See `scale`.
    pub offset: f64,
    /// SI, or degC; 1 for a switch.
    pub unit: String,
    /// s; time between two readings.
    pub period_s: f64,
}

/// A controller and its signals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Poll {
    /// As the cell file names it.
    pub source: String,
    /// What is read of it.
    pub signals: Vec<Signal>,
}

/// What is to be read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Document {
    /// The controllers, each with its signals.
    pub polls: Vec<Poll>,
}

impl Document {
    /// The document of a line, checked.
    ///
    /// # Errors
    /// A sentence: the line is none, or names a source, an address or a period that is none.
    pub fn read(line: &str) -> Result<Self, String> {
        let document: Self = serde_json::from_str(line)
            .map_err(|error| format!("what is to be read cannot be read itself: {error}"))?;
        for poll in &document.polls {
            let controller = controller(&poll.source)?;
            for signal in &poll.signals {
                controller.check(&signal.address, signal.data_type)?;
                let period = signal.period_s;
                if !(period > 0.0 && period <= f64::from(u32::MAX)) {
                    return Err(format!(
                        "{:?}: period_s = {period} is no time between two readings",
                        signal.name
                    ));
                }
            }
        }
        Ok(document)
    }
}

/// What became of reading a signal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// Its value, a finite number in its unit.
    Value(f64),
    /// Why it could not be read, in a sentence.
    Failure(String),
}

/// One reading.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// The controller, as the document names it.
    pub source: String,
    /// Name of the signal.
    pub signal: String,
    /// Value or failure.
    #[serde(flatten)]
    pub outcome: Outcome,
}

impl Reading {
    /// The reading of a line.
    ///
    /// # Errors
    /// A sentence: the line is none.
    pub fn read(line: &str) -> Result<Self, String> {
        serde_json::from_str(line)
            .map_err(|error| format!("{:?} is no reading: {error}", line.trim_end()))
    }
}

/// Without an end of line.
fn line(value: &impl Serialize, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
    let text = serde_json::to_string(value).map_err(|_| fmt::Error)?;
    formatter.write_str(&text)
}

impl fmt::Display for Document {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        line(self, formatter)
    }
}

impl fmt::Display for Reading {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        line(self, formatter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As the head of the crate shows it.
    const DOCUMENT: &str = r#"{"polls":[{"source":"s7://10.0.0.5/0/1","signals":[{"name":"chuck","address":"DB1.DBX0.3","type":"bool","scale":1.0,"offset":0.0,"unit":"1","period_s":0.2}]}]}"#;

    #[test]
    fn the_document_is_written_as_the_table_shows_it() {
        let signal = Signal {
            name: "chuck".to_owned(),
            address: "DB1.DBX0.3".to_owned(),
            data_type: DataType::Bool,
            scale: 1.0,
            offset: 0.0,
            unit: "1".to_owned(),
            period_s: 0.2,
        };
        let source = "s7://10.0.0.5/0/1".to_owned();
        let signals = vec![signal];
        let document = Document {
            polls: vec![Poll { source, signals }],
        };
        assert_eq!(document.to_string(), DOCUMENT);
        assert_eq!(Document::read(DOCUMENT), Ok(document));
        let head = include_str!("lib.rs");
        assert!(
            head.contains(DOCUMENT),
            "the table at the head of the crate"
        );
    }

    #[test]
    fn a_document_that_asks_for_what_is_none_is_refused() {
        for (known, other, why) in [
            (
                "{\"polls\"",
                "{\"pols\"",
                "cannot be read itself: unknown field `pols`",
            ),
            ("s7://10.0.0.5/0/1", "s7://10.0.0.5", "must be of the form"),
            ("DB1.DBX0.3", "DB1", "is no address of S7"),
            ("\"bool\"", "\"f32\"", "its type is bool, not f32"),
            ("\"bool\"", "\"real\"", "unknown variant `real`"),
            ("0.2", "0.0", "period_s = 0 is no time"),
            ("0.2", "-1e300", "is no time"),
            ("0.2", "1e400", "number out of range"),
            ("0.2", "null", "expected f64"),
            ("]}]}", "", "EOF"),
        ] {
            let text = DOCUMENT.replacen(known, other, 1);
            let error = Document::read(&text).expect_err(&text);
            assert!(error.contains(why) && !error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn a_reading_is_a_value_or_a_failure_and_one_line() {
        let of = |outcome| Reading {
            source: "s7://10.0.0.5/0/1".to_owned(),
            signal: "chuck \u{202e}\n".to_owned(),
            outcome,
        };
        // A sum that needs its last digit, and numbers that look like integers.
        for value in [0.1 + 0.2, -0.0, 1.0, 1e300, f64::MIN_POSITIVE] {
            let text = of(Outcome::Value(value)).to_string();
            assert!(!text.contains('\n'), "{text}");
            let Outcome::Value(read) = Reading::read(&text).expect(&text).outcome else {
                panic!("{text}");
            };
            assert_eq!(read.to_bits(), value.to_bits(), "{text}");
        }
        let failure = of(Outcome::Failure("no route: \"x\"".to_owned()));
        assert_eq!(Reading::read(&failure.to_string()), Ok(failure));
        let written = r#"{"source":"s7://10.0.0.5/0/1","signal":"chuck","value":1.0}"#;
        assert_eq!(Reading::read(written).expect(written).to_string(), written);
        // An integer is a number, too.
        let whole = Reading::read(r#"{"source":"s","signal":"n","value":1}"#).expect("a reading");
        assert_eq!(whole.outcome, Outcome::Value(1.0));
        for wrong in [
            "",
            "ready",
            r#"{"source":"s","signal":"n"}"#,
            r#"{"source":"s","signal":"n","value":null}"#,
        ] {
            let text = Reading::read(wrong).expect_err(wrong);
            assert!(text.contains("is no reading"), "{text}");
        }
    }
}
