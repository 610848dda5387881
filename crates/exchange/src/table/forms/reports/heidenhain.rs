//! HEIDENHAIN: measuring logs of touch probe cycles.

use std::collections::BTreeMap;

use super::{Coordinate, Number, PLACES, add_place, left_out};
use crate::ImportError;
use crate::table::forms::printers::clock;
use crate::table::forms::{Formed, Line, computed};

/// Words of a HEIDENHAIN log in English and German.
const NOMINAL: [&str; 2] = ["Nominal values:", "Sollwerte:"];
const ACTUAL: [&str; 2] = ["Actual values:", "Istwerte:"];
const DEVIATIONS: [&str; 2] = ["Deviations:", "Abweichungen:"];
const OTHER_SECTIONS: [&str; 3] = ["Given limit values:", "Vorgegebene Grenzwerte:", "Further"];
const CENTRES: [[&str; 2]; 2] = [
    ["Center in reference axis", "Mitte Hauptachse"],
    ["Center in minor axis", "Mitte Nebenachse"],
];
const HEIGHTS: [&str; 2] = ["Measuring height:", "Messhöhe:"];

/// Centres of the logs of cycles 421, 422 and the like.
pub(in crate::table::forms) fn heidenhain(lines: &[Line]) -> Result<Formed, ImportError> {
    let mut formed = Formed::with_roles(&PLACES);
    let begins: Vec<usize> = (0..lines.len())
        .filter(|&index| cycle(lines[index].text).is_some())
        .collect();
    let ends = begins.iter().skip(1).copied().chain([lines.len()]);
    let mut others = BTreeMap::new();
    let mut logs = Vec::new();
    for (begin, end) in begins.iter().copied().zip(ends) {
        let log = log(&lines[begin..end], &mut formed)?;
        let cycle = cycle(lines[begin].text).unwrap_or_default();
        if log.coordinates.is_empty() {
            *others.entry(format!("of cycle {cycle}")).or_insert(0) += 1;
        } else {
            logs.push((cycle, log));
        }
    }
    let timed = logs.iter().all(|(_, log)| log.time.is_some());
    if timed {
        formed.table.header.push("time".to_owned());
        formed.columns.push_str(",time=time");
        formed.units.push("time=s".to_owned());
    }
    let first = logs.first().and_then(|(_, log)| log.time).unwrap_or(0.0);
    for (cycle, log) in &logs {
        let place = [0, 1].map(|axis| log.coordinates[axis].nominal.cell());
        let [x, y] = place;
        let height = log
            .height
            .map_or_else(|| computed("0".to_owned()), |height| height.cell());
        let time = log.time.filter(|_| timed).map(|time| time - first);
        add_place(
            &mut formed,
            &[x, y, height],
            &format!("cycle {cycle}"),
            &log.coordinates,
            time,
        )?;
    }
    if !logs.is_empty() {
        formed.remarks.push(
            "reference and minor axis of the logs are X and Y, as with tool axis Z".to_owned(),
        );
    }
    formed
        .remarks
        .extend(left_out(&others, "logs without a centre"));
    Ok(formed)
}

/// Number of the cycle in the first line of a log.
fn cycle(text: &str) -> Option<&str> {
    let begins = text
        .trim_start()
        .starts_with("Measuring log for touch probe cycle")
        || text.trim_start().starts_with("Messprotokoll ") && text.contains("yklus ");
    let number = |word: &&str| word.len() == 3 && word.bytes().all(|byte| byte.is_ascii_digit());
    begins
        .then(|| text.split_whitespace().find(number))
        .flatten()
}

/// What one log says.
struct Log<'a> {
    /// Of reference and minor axis; empty without a centre.
    coordinates: Vec<Coordinate<'a>>,
    height: Option<Number<'a>>,
    /// s since 1970, of the control's clock.
    time: Option<f64>,
}

fn log<'a>(lines: &[Line<'a>], formed: &mut Formed) -> Result<Log<'a>, ImportError> {
    // Nominal, actual, deviation by axis.
    let mut found: [[Option<Number>; 2]; 3] = [[None; 2]; 3];
    let mut section = None;
    let (mut date, mut of_day, mut height) = (None, None, None);
    for line in lines {
        let text = line.text.trim();
        if let Some(index) = [NOMINAL, ACTUAL, DEVIATIONS]
            .iter()
            .position(|words| words.contains(&text))
        {
            section = Some(index);
        } else if OTHER_SECTIONS.iter().any(|word| text.starts_with(word)) {
            section = None;
        }
        if let Some(place) = HEIGHTS.iter().find_map(|word| line.text.split_once(word)) {
            height = Some(Number {
                line: *line,
                text: place.1,
            });
        }
        let Some((name, value)) = line.text.split_once(':') else {
            continue;
        };
        match name.trim() {
            "Date" | "Datum" => date = day(value),
            "Time" | "Uhrzeit" => of_day = clock(value),
            name if name.starts_with("Type of dimension") => {
                // The words in parentheses have no colon.
                let unit = match value.trim() {
                    "0" => "mm",
                    "1" => "inch",
                    other => {
                        return Err(line.wrong(format!(
                            "the type of dimension is {other:?}, expected 0 or 1"
                        )));
                    }
                };
                formed.length_unit(*line, unit)?;
            }
            name => {
                let axis = CENTRES.iter().position(|words| words.contains(&name));
                if let (Some(axis), Some(section)) = (axis, section) {
                    found[section][axis] = Some(Number {
                        line: *line,
                        text: value,
                    });
                }
            }
        }
    }
    let [nominal, actual, deviation] = found;
    let mut coordinates = Vec::new();
    for axis in 0..2 {
        match (nominal[axis], actual[axis]) {
            (Some(nominal), Some(actual)) => coordinates.push(Coordinate {
                axis,
                nominal,
                actual,
                deviation: deviation[axis],
            }),
            (None, None) => {}
            _ => {
                return Err(
                    lines[0].wrong("the log has a centre without both nominal and actual value")
                );
            }
        }
    }
    if coordinates.len() == 1 {
        return Err(
            lines[0].wrong("the log has one coordinate of the centre, and two are expected")
        );
    }
    Ok(Log {
        coordinates,
        height,
        time: date.zip(of_day).map(|(date, of_day)| date + of_day),
    })
}

/// s since 1970 of a day like `14-05-2024`.
fn day(text: &str) -> Option<f64> {
    let parts: Vec<u32> = text
        .trim()
        .split(['-', '.'])
        .map_while(|part| part.parse().ok())
        .collect();
    let [day, month, year] = parts[..] else {
        return None;
    };
    let date = format!("{year:04}-{month:02}-{day:02}T00:00:00Z");
    let since = humantime::parse_rfc3339(&date)
        .ok()?
        .duration_since(std::time::UNIX_EPOCH)
        .ok()?;
    Some(since.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::super::tests::{cells, refused};
    use crate::table::forms::{Form, read};

    #[test]
    fn centres_of_heidenhain_logs() {
        let log = |time: &str, x: &str| {
            format!(
                "\nMeasuring log for touch probe cycle 421 Hole measuring\n\nDate: 14-05-2024\nTime: {time}\n\
                 Type of dimension (0 = MM / 1 = INCH): 0\n\nNominal values:\nCenter in reference axis:       100.0000\n\
                 Center in minor axis:            55.0000\nDiameter:                        10.0000\n\nGiven limit values:\n\
                 Maximum limit for center in reference axis:     100.1000\n\nActual values:\nCenter in reference axis:  {x}\n\
                 Center in minor axis:            54.9824\nDiameter:   10.0065\n\nDeviations:\nCenter in reference axis:         0.0305\n\
                 Center in minor axis:            -0.0176\n\nFurther measuring results: Measuring height: -5.0000\n\nEnd of log\n"
            )
        };
        let text =
            log("23:59:30", "100.0305") + &log("7:00:30", "100.0305").replace("14-05", "15-05");
        let formed = read(&text, Form::HeidenhainLog).expect("logs");
        assert_eq!(
            cells(&formed),
            [
                "17: 100.0000 55.0000 -5.0000 1 0 0 0.0305 cycle 421 0",
                "18: 100.0000 55.0000 -5.0000 0 1 0 -0.0176 cycle 421 0",
                "44: 100.0000 55.0000 -5.0000 1 0 0 0.0305 cycle 421 25260",
                "45: 100.0000 55.0000 -5.0000 0 1 0 -0.0176 cycle 421 25260",
            ]
        );
        assert_eq!(formed.units, ["length=mm", "deviation=mm", "time=s"]);
        let german = "Messprotokoll Tastsystemzyklus 421 Bohrung messen\nSollwerte:\nMitte Hauptachse: 50.0000\nMitte Nebenachse: 65.0000\n\
            Istwerte:\nMitte Hauptachse: 50.0810\nMitte Nebenachse: 64.9530\nAbweichungen:\nMitte Hauptachse: 0.0810\nMitte Nebenachse: -0.0470\n";
        let formed = read(german, Form::HeidenhainLog).expect("a log");
        assert_eq!(
            cells(&formed)[1],
            "7: 50.0000 65.0000 0 0 1 0 -0.0470 cycle 421"
        );
        assert!(formed.units.is_empty());
        refused(
            &text,
            Form::HeidenhainLog,
            &[
                (
                    "Actual values:",
                    "Actual:",
                    "line 2, column 1: the log has a centre without both nominal and actual value",
                ),
                ("INCH): 0", "INCH): 2", "expected 0 or 1"),
                ("100.0305", "100.0315", "is not actual less nominal"),
            ],
        );
    }
}
