//! PC-DMIS: text reports.

use std::collections::BTreeMap;

use super::{Coordinate, Number, PLACES, add_place, left_out};
use crate::ImportError;
use crate::table::forms::{Formed, Line, computed};

/// A dimension of a PC-DMIS report.
struct Dimension<'a> {
    line: Line<'a>,
    feature: String,
    /// Columns of the rows.
    columns: Vec<&'a str>,
    coordinates: Vec<Coordinate<'a>>,
}

/// `DIM NAME= LOCATION OF KIND FEATURE UNITS=MM` with its rows `X`, `Y`, `Z`; sizes and other dimensions are counted.
pub(in crate::table::forms) fn pc_dmis(lines: &[Line]) -> Result<Formed, ImportError> {
    let mut formed = Formed::with_roles(&PLACES);
    let mut others = BTreeMap::new();
    let mut unknown: BTreeMap<&str, usize> = BTreeMap::new();
    let mut open: Option<Dimension> = None;
    for line in lines {
        let words: Vec<&str> = line.text.split_whitespace().collect();
        match words[..] {
            ["DIM", ..] => {
                finish_dimension(&mut formed, open.take(), &mut unknown)?;
                match location(&words) {
                    Some((feature, unit)) => {
                        formed.length_unit(*line, unit)?;
                        open = Some(Dimension {
                            line: *line,
                            feature: feature.to_owned(),
                            columns: Vec::new(),
                            coordinates: Vec::new(),
                        });
                    }
                    None => *others.entry("other dimension".to_owned()).or_insert(0) += 1,
                }
            }
            ["AX", ..] => {
                if let Some(dimension) = &mut open {
                    dimension.columns = words;
                }
            }
            [axis, ..] => {
                let Some(dimension) = open.as_mut().filter(|one| !one.columns.is_empty()) else {
                    continue;
                };
                let Some(axis) = ["X", "Y", "Z"].iter().position(|name| *name == axis) else {
                    *others.entry(format!("row {axis}")).or_insert(0) += 1;
                    continue;
                };
                let number = |name: &str| {
                    let column = dimension.columns.iter().position(|one| *one == name);
                    let text = column.and_then(|column| words.get(column)).copied();
                    text.map(|text| Number { line: *line, text })
                };
                let (Some(nominal), Some(actual)) = (number("NOMINAL"), number("MEAS")) else {
                    return Err(line.wrong("expected the columns NOMINAL and MEAS below AX"));
                };
                let deviation = number("DEV");
                dimension.coordinates.push(Coordinate {
                    axis,
                    nominal,
                    actual,
                    deviation,
                });
            }
            // Dimensions are parted by blank lines.
            [] => finish_dimension(&mut formed, open.take(), &mut unknown)?,
        }
    }
    finish_dimension(&mut formed, open, &mut unknown)?;
    for (axis, count) in unknown {
        formed.remarks.push(format!(
            "{count} features have no {axis} in the report: it is taken for 0"
        ));
    }
    formed
        .remarks
        .extend(left_out(&others, "lines that are no coordinates"));
    Ok(formed)
}

/// The feature and the unit of a `DIM` that is a location.
fn location<'a>(words: &[&'a str]) -> Option<(&'a str, &'a str)> {
    let of = words
        .windows(2)
        .position(|pair| pair == ["LOCATION", "OF"])?;
    let feature = words.get(of + 3)?;
    let unit = words.iter().find_map(|word| word.strip_prefix("UNITS="))?;
    Some((feature, unit.trim_end_matches([',', '$'])))
}

fn finish_dimension<'a>(
    formed: &mut Formed,
    dimension: Option<Dimension<'a>>,
    unknown: &mut BTreeMap<&'a str, usize>,
) -> Result<(), ImportError> {
    let Some(dimension) = dimension else {
        return Ok(());
    };
    if dimension.columns.is_empty() {
        return Err(dimension
            .line
            .wrong("the dimension has no line that begins with AX"));
    }
    let mut place = [(); 3].map(|()| computed("0".to_owned()));
    for (axis, name) in ["X", "Y", "Z"].into_iter().enumerate() {
        let mut of_axis = dimension.coordinates.iter().filter(|one| one.axis == axis);
        match (of_axis.next(), of_axis.next()) {
            (Some(one), None) => place[axis] = one.nominal.cell(),
            (Some(_), Some(second)) => {
                return Err(second
                    .actual
                    .line
                    .wrong(format!("the dimension has two rows {name}")));
            }
            (None, _) if dimension.coordinates.is_empty() => {}
            (None, _) => *unknown.entry(name).or_insert(0) += 1,
        }
    }
    add_place(
        formed,
        &place,
        &dimension.feature,
        &dimension.coordinates,
        None,
    )
}

#[cfg(test)]
mod tests {
    use super::super::tests::{cells, refused};
    use crate::table::forms::{Form, read};

    #[test]
    fn places_of_a_pc_dmis_report() {
        let text = "  PART NAME  : PLATE   May 14, 2024   09:12\n\n\
            DIM LOC1= LOCATION OF CIRCLE CIR1  UNITS=MM ,$\n\
            AX    NOMINAL       +TOL       -TOL       MEAS        DEV     OUTTOL\n\
            X    -132.7000     0.1000     0.1000  -132.6345     0.0655     0.0000 ----#----\n\
            Y       9.0000     0.1000     0.1000     8.9651    -0.0349     0.0000 ----#----\n\
            D       8.0000     0.0500     0.0500     8.0040     0.0040     0.0000 ----#----\n\n\
            DIM D1= 2D DISTANCE FROM CIRCLE CIR1 TO CIRCLE CIR2  UNITS=MM\n\
            AX    NOMINAL       +TOL       -TOL       MEAS        DEV     OUTTOL\n\
            M      20.0000     0.1000     0.1000    20.0010     0.0010     0.0000 ----#----\n";
        let formed = read(text, Form::PcDmisReport).expect("a report");
        assert_eq!(
            cells(&formed),
            [
                "5: -132.7000 9.0000 0 1 0 0 0.0655 CIR1",
                "6: -132.7000 9.0000 0 0 1 0 -0.0349 CIR1",
            ]
        );
        assert_eq!(formed.units, ["length=mm", "deviation=mm"]);
        assert_eq!(
            formed.remarks,
            [
                "1 features have no Z in the report: it is taken for 0",
                "2 lines that are no coordinates are left out (1 other dimension, 1 row D)",
            ]
        );
        refused(
            text,
            Form::PcDmisReport,
            &[
                (
                    "UNITS=MM ,$",
                    "UNITS=FT",
                    "the unit \"FT\" is none that is read",
                ),
                (
                    "   0.0655",
                    "  -0.0655",
                    "line 5, column 52: the deviation -0.0655 is not actual less nominal",
                ),
                (
                    "\nY ",
                    "\nX ",
                    "line 6, column 1: the dimension has two rows X",
                ),
                ("MEAS", "FOUND", "expected the columns NOMINAL and MEAS"),
            ],
        );
    }
}
