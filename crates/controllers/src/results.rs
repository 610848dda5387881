//! Reads what other controllers report: printed lines, inspection printouts, surface-result files.
//!
//! Lengths are mm as printed. Each mistake is told once, with line and column, and nothing is guessed.

use crate::text::{ParseError, Words};

/// A line printed by a measuring program of [`crate::fanuc::program`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrintedTouch {
    /// The probe tripped.
    pub touched: bool,
    /// Number of the touch, from 1.
    pub number: u32,
    /// Index into the plan's points.
    pub point_index: u32,
    /// mm, ball centre in the part frame.
    pub position: [f64; 3],
}

/// Reads the printed lines of a measuring program; blank lines are passed over.
pub fn printed_touches(text: &str) -> Result<Vec<PrintedTouch>, ParseError> {
    let mut touches = Vec::new();
    for (line, content) in lines(text) {
        let mut words = Words::new(line, content);
        let touched = words.take("TOUCH or MISS", |word| match word {
            "TOUCH" => Some(true),
            "MISS" => Some(false),
            _ => None,
        })?;
        let (number, point_index) = (words.count()?, words.count()?);
        let position = [words.number()?, words.number()?, words.number()?];
        words.end()?;
        touches.push(PrintedTouch {
            touched,
            number,
            point_index,
            position,
        });
    }
    Ok(touches)
}

/// A size or a position on an inspection printout.
#[derive(Clone, Debug, PartialEq)]
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

/// Reads an inspection printout: `COMPONENT NO`, `SIZE`, `POSN`, `OUT OF TOL`.
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

/// One point of a surface-result file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfacePoint {
    /// Number of the point.
    pub number: u32,
    /// mm, nominal point.
    pub nominal: Option<[f64; 3]>,
    /// Unit vector, outward normal.
    pub normal: Option<[f64; 3]>,
    /// mm, offset of the surface.
    pub offset: f64,
    /// mm, measured centre of the ball.
    pub center: Option<[f64; 3]>,
    /// mm, radius of the ball.
    pub tip_radius: Option<f64>,
    /// mm, deviation as the controller computed it.
    pub deviation: Option<f64>,
}

/// Reads a surface-result file: an envelope `START … END` with named lines and `G330`, `G331` in any order, and for each
/// point `G800` (nominal), `G801` (centre of the ball) and `G802` (deviation).
pub fn surface_results(text: &str) -> Result<Vec<SurfacePoint>, ParseError> {
    let mut points: Vec<SurfacePoint> = Vec::new();
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
            | "TOOLPATH" | "G330" | "G331" => {}
            "G800" | "G801" | "G802" => surface_line(&mut words, kind, &mut points)?,
            _ => return Err(words.error("a line of a surface-result file")),
        }
    }
    if ended {
        Ok(points)
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
            // Upper and lower tolerance: the plan holds the cell's.
            letter('U')?;
            letter('L')?;
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

/// Lines that are not blank, with their numbers.
fn lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    (1..)
        .zip(text.lines())
        .filter(|(_, line)| !line.trim().is_empty())
}
