//! Results of measuring cycles and inspection software that run on a controller of their own accord.
//!
//! | module | content |
//! |---|---|
//! | [`printout`] | printout of inspection cycles: sizes, positions, marks |
//! | [`surface`] | surface-result files: nominal points, measured ball centres, deviations |

pub mod printout;
pub mod surface;

use controllers::text::ParseError;
use serde_json::json;

use self::{
    printout::{Inspected, inspection_printout},
    surface::{SurfaceFile, surface_results},
};
use crate::{
    dialect::Dialect,
    results::{Results, ResultsFormat},
};

/// Measuring cycles and inspection software: results only.
#[derive(Clone, Copy, Debug)]
pub struct Inspection;

impl Dialect for Inspection {
    fn name(&self) -> &'static str {
        "inspection"
    }

    fn description(&self) -> &'static str {
        "measuring cycles and inspection software; results only"
    }

    fn formats(&self) -> &'static [&'static dyn ResultsFormat] {
        &[&Printout, &Surface]
    }
}

struct Printout;

impl ResultsFormat for Printout {
    fn name(&self) -> &'static str {
        "inspection"
    }

    fn description(&self) -> &'static str {
        "printout of inspection cycles: sizes, positions, tolerance marks"
    }

    fn content(&self) -> &'static str {
        "an inspection printout"
    }

    fn recognises(&self, first_line: &str) -> bool {
        let word = first_line.split_whitespace().next().unwrap_or_default();
        matches!(word, "COMPONENT" | "SIZE" | "POSN")
    }

    fn read(&self, text: &str) -> Result<Results, ParseError> {
        let results = inspection_printout(text)?;
        let lines = results.iter().map(Inspected::line).collect();
        Ok(Results::of_content(json!({ "inspected": results }), lines))
    }
}

struct Surface;

impl ResultsFormat for Surface {
    fn name(&self) -> &'static str {
        "surface"
    }

    fn description(&self) -> &'static str {
        "surface-result file, START to END"
    }

    fn content(&self) -> &'static str {
        "a surface-result file"
    }

    fn recognises(&self, first_line: &str) -> bool {
        first_line.split_whitespace().next() == Some("START")
    }

    fn read(&self, text: &str) -> Result<Results, ParseError> {
        let SurfaceFile { header, points } = surface_results(text)?;
        let mut lines: Vec<_> = header
            .iter()
            .map(|(word, rest)| format!("{word} {rest}"))
            .collect();
        lines.extend(points.iter().map(|point| {
            let deviation = point.deviation.map_or("no deviation".to_owned(), |value| {
                format!("deviation {value:+.4} mm")
            });
            format!("point {}: {deviation}", point.number)
        }));
        let content = json!({ "header": header, "points": points });
        Ok(Results::of_content(content, lines))
    }
}
