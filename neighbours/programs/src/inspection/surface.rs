//! Reads surface-result files: nominal points, centres of the ball, deviations.

use controllers::text::{ParseError, Words};
use serde::Serialize;

use crate::results::lines;

/// One point of a surface-result file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SurfacePoint {
    /// Number of the point.
    pub number: u32,
    /// mm, nominal point.
    pub nominal: Option<[f64; 3]>,
    /// Unit vector, outward normal.
    pub normal: Option<[f64; 3]>,
    /// mm, offset of the surface.
    pub offset: f64,
    /// mm, upper and lower tolerance.
    pub tolerance: Option<[f64; 2]>,
    /// mm, measured centre of the ball.
    pub center: Option<[f64; 3]>,
    /// mm, radius of the ball.
    pub tip_radius: Option<f64>,
    /// mm, deviation as the controller computed it.
    pub deviation: Option<f64>,
}

/// A surface-result file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SurfaceFile {
    /// Lines about the file and its tool paths: their first word, and the rest.
    pub header: Vec<(String, String)>,
    /// The points.
    pub points: Vec<SurfacePoint>,
}

/// Reads a surface-result file: an envelope `START … END` with named lines and `G330`, `G331` in any order, and for each
/// point `G800` (nominal), `G801` (centre of the ball) and `G802` (deviation).
///
/// # Errors
/// Line and column of what is not of the format.
pub fn surface_results(text: &str) -> Result<SurfaceFile, ParseError> {
    let mut file = SurfaceFile::default();
    let (mut begun, mut ended) = (false, false);
    let mut last = 1;
    for (line, content) in lines(text) {
        last = line;
        let mut words = Words::new(line, content);
        let kind = words.clone().next_word().unwrap_or_default();
        if ended {
            return Err(words.error("nothing after END"));
        }
        match kind {
            "START" if !begun => begun = true,
            _ if !begun => return Err(words.error("START")),
            "END" => ended = true,
            "RESULTSFILE" | "DOCUMENTID" | "MODELVERSION" | "TIMESTAMP" | "TOOLPATHID"
            | "TOOLPATH" | "G330" | "G331" => {
                words.next_word();
                file.header.push((kind.to_owned(), words.rest().to_owned()));
            }
            "G800" | "G801" | "G802" => surface_line(&mut words, kind, &mut file.points)?,
            _ => return Err(words.error("a line of a surface-result file")),
        }
    }
    if ended {
        Ok(file)
    } else {
        let expected = if begun { "END" } else { "START" };
        Err(ParseError {
            line: last,
            column: 1,
            expected: expected.to_owned(),
            found: "the end of the file".to_owned(),
        })
    }
}

fn surface_line(
    words: &mut Words,
    kind: &str,
    points: &mut Vec<SurfacePoint>,
) -> Result<(), ParseError> {
    words.next_word();
    let mut at_number = words.clone();
    let number = words.take("N and a number", |word| {
        word.strip_prefix('N')?.parse::<u32>().ok()
    })?;
    let index = points
        .iter()
        .rposition(|point| point.number == number)
        .unwrap_or_else(|| {
            points.push(SurfacePoint {
                number,
                ..SurfacePoint::default()
            });
            points.len() - 1
        });
    let point = &mut points[index];
    let mut letter = |wanted: char| {
        words.take(&format!("{wanted} and a number"), |word| {
            word.strip_prefix(wanted)?
                .parse()
                .ok()
                .filter(|value: &f64| value.is_finite())
        })
    };
    let again = match kind {
        "G800" => {
            let again = point.nominal.is_some();
            point.nominal = Some([letter('X')?, letter('Y')?, letter('Z')?]);
            point.normal = Some([letter('I')?, letter('J')?, letter('K')?]);
            point.offset = letter('O')?;
            point.tolerance = Some([letter('U')?, letter('L')?]);
            again
        }
        "G801" => {
            let again = point.center.is_some();
            point.center = Some([letter('X')?, letter('Y')?, letter('Z')?]);
            point.tip_radius = Some(letter('R')?);
            again
        }
        _ => {
            let again = point.deviation.is_some();
            words.keyword("DEVIATION")?;
            point.deviation = Some(words.number()?);
            again
        }
    };
    if again {
        return Err(at_number.error(&format!("a point without {kind} so far")));
    }
    words.end()
}
