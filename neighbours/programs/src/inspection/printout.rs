//! Reads inspection printouts: sizes and positions of features, and marks of what is out of tolerance.

use controllers::text::{ParseError, Words};
use serde::Serialize;

use crate::results::lines;

/// A size or a position on an inspection printout.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspected {
    /// Number of the component.
    pub component: u32,
    /// Number of the feature.
    pub feature: u32,
    /// `D` for a size, an axis letter for a position.
    pub quantity: char,
    /// mm, nominal.
    pub nominal: f64,
    /// mm, measured.
    pub actual: f64,
    /// mm, tolerance as printed (half width of a size, diameter `TP` of a position).
    pub tolerance: f64,
    /// mm, measured less nominal.
    pub deviation: f64,
    /// The printout says that it is out of tolerance, and by how much it says so.
    pub out_of_tolerance: Option<f64>,
}

/// A printed deviation may differ from the difference of the printed sizes by their rounding, mm.
const ROUNDING: f64 = 1.5e-4;

impl Inspected {
    /// The result for a person.
    pub(super) fn line(&self) -> String {
        let mark = self
            .out_of_tolerance
            .map_or(String::new(), |by| format!("  out of tolerance by {by:.4}"));
        format!(
            "component {} feature {}  {} {:.4} mm, actual {:.4} mm, deviation {:+.4} mm{mark}",
            self.component, self.feature, self.quantity, self.nominal, self.actual, self.deviation
        )
    }
}

/// Reads an inspection printout: `COMPONENT NO`, `SIZE`, `POSN`, `OUT OF TOL`.
///
/// # Errors
/// Line and column of what is not of the format.
pub fn inspection_printout(text: &str) -> Result<Vec<Inspected>, ParseError> {
    let mut results: Vec<Inspected> = Vec::new();
    let mut current = None;
    for (line, content) in lines(text) {
        let mut words = Words::new(line, content);
        let kind = words.clone().next_word().unwrap_or_default();
        match kind {
            "COMPONENT" => {
                words.keyword("COMPONENT")?;
                words.keyword("NO")?;
                let component = words.count()?;
                words.keyword("FEATURE")?;
                words.keyword("NO")?;
                current = Some((component, words.count()?));
                words.end()?;
            }
            "SIZE" | "POSN" => {
                let Some((component, feature)) = current else {
                    return Err(words.error("COMPONENT NO before any result"));
                };
                results.push(inspected(&mut words, component, feature)?);
            }
            marked if marked.starts_with("+++++") => {
                let by = out_of_tolerance(line, content)?;
                let Some(last) = results.last_mut() else {
                    return Err(words.error("a result before the mark"));
                };
                last.out_of_tolerance = Some(by);
            }
            _ => return Err(words.error("COMPONENT, SIZE, POSN or +++++OUT OF TOL+++++")),
        }
    }
    Ok(results)
}

fn inspected(words: &mut Words, component: u32, feature: u32) -> Result<Inspected, ParseError> {
    words.next_word();
    let (quantity, nominal) = words.take("a letter and a number", |word| {
        let mut characters = word.chars();
        let letter = characters.next().filter(char::is_ascii_uppercase)?;
        let value: f64 = characters.as_str().parse().ok()?;
        value.is_finite().then_some((letter, value))
    })?;
    words.keyword("ACTUAL")?;
    let actual = words.number()?;
    words.keyword("TOL")?;
    if words.clone().next_word() == Some("TP") {
        words.next_word();
    }
    let tolerance = words.number()?;
    words.keyword("DEV")?;
    let mut at_deviation = words.clone();
    let deviation = words.number()?;
    words.end()?;
    if (actual - nominal - deviation).abs() > ROUNDING {
        return Err(at_deviation.error(&format!(
            "{:.4}, the actual less the nominal value",
            actual - nominal
        )));
    }
    Ok(Inspected {
        component,
        feature,
        quantity,
        nominal,
        actual,
        tolerance,
        deviation,
        out_of_tolerance: None,
    })
}

fn out_of_tolerance(line: u64, content: &str) -> Result<f64, ParseError> {
    let mut words = Words::new(line, content);
    words.keyword("+++++OUT")?;
    words.keyword("OF")?;
    words.keyword("TOL+++++")?;
    words.keyword("ERROR")?;
    let by = words.number()?;
    words.end()?;
    Ok(by)
}
