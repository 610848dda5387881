//! Reports of measuring machines and logs of controls: places of features, nominal and actual, and touched points.

mod calypso;
mod fusion;
mod heidenhain;
mod pc_dmis;

use std::collections::BTreeMap;

use super::{Formed, Line, computed};
use crate::ImportError;
use crate::table::Cell;

pub(super) use calypso::calypso;
pub(super) use fusion::fusion_surface;
pub(super) use heidenhain::heidenhain;
pub(super) use pc_dmis::pc_dmis;

/// Roles of a table of places: a row for each coordinate that is measured.
const PLACES: [&str; 8] = [
    "nominal_x",
    "nominal_y",
    "nominal_z",
    "i",
    "j",
    "k",
    "deviation",
    "feature",
];

/// A number of a report and where it stands.
#[derive(Clone, Copy)]
struct Number<'a> {
    line: Line<'a>,
    text: &'a str,
}

impl Number<'_> {
    fn value(&self) -> Result<f64, ImportError> {
        let value = self
            .text
            .trim()
            .parse::<f64>()
            .ok()
            .filter(|value| value.is_finite());
        value.ok_or_else(|| {
            let column = self.line.cell(self.text).column;
            ImportError::at(
                self.line.number,
                column,
                format!("expected a number, found {:?}", self.text.trim()),
            )
        })
    }

    fn cell(&self) -> Cell {
        self.line.cell(self.text)
    }

    /// Digits behind the point.
    fn decimals(&self) -> usize {
        let parts = self.text.trim().split_once('.');
        parts.map_or(0, |(_, behind)| behind.len())
    }
}

/// One coordinate of a place.
struct Coordinate<'a> {
    axis: usize,
    nominal: Number<'a>,
    actual: Number<'a>,
    /// As the file has it; empty: it has none.
    deviation: Option<Number<'a>>,
}

impl Coordinate<'_> {
    /// Actual less nominal, as it is printed, which has to agree with both.
    fn deviation(&self) -> Result<Cell, ImportError> {
        let found = self.actual.value()? - self.nominal.value()?;
        let Some(printed) = self.deviation else {
            let decimals = self.actual.decimals().max(self.nominal.decimals());
            return Ok(computed(format!("{found:.decimals$}")));
        };
        let numbers = [self.nominal, self.actual, printed];
        let fewest = numbers.iter().map(Number::decimals).min().unwrap_or(0);
        // Of three rounded numbers the last digits may not add up.
        let rounding = 2.0 * 0.1_f64.powi(i32::try_from(fewest).unwrap_or(i32::MAX));
        if (printed.value()? - found).abs() > rounding {
            let column = printed.line.cell(printed.text).column;
            return Err(ImportError::at(
                printed.line.number,
                column,
                format!(
                    "the deviation {} is not actual less nominal, {} less {}",
                    printed.text.trim(),
                    self.actual.text.trim(),
                    self.nominal.text.trim()
                ),
            ));
        }
        Ok(printed.cell())
    }
}

/// Adds a row for each coordinate of a place.
fn add_place(
    formed: &mut Formed,
    place: &[Cell; 3],
    feature: &str,
    coordinates: &[Coordinate<'_>],
    time: Option<f64>,
) -> Result<(), ImportError> {
    for coordinate in coordinates {
        let mut cells = place.to_vec();
        cells.extend((0..3).map(|axis| computed(u8::from(axis == coordinate.axis).to_string())));
        cells.push(coordinate.deviation()?);
        cells.push(computed(feature.to_owned()));
        cells.extend(time.map(|time| computed(time.to_string())));
        formed.table.add(coordinate.actual.line.row(cells))?;
    }
    Ok(())
}

/// A sentence about what is left out, by kind.
fn left_out(counts: &BTreeMap<String, usize>, what: &str) -> Option<String> {
    let total: usize = counts.values().sum();
    let kinds: Vec<String> = counts
        .iter()
        .map(|(kind, count)| format!("{count} {kind}"))
        .collect();
    (total > 0).then(|| format!("{total} {what} are left out ({})", kinds.join(", ")))
}

#[cfg(test)]
mod tests {
    //! What the tests of the forms share.

    use crate::table::forms::{Form, Formed, read};

    pub(super) fn cells(formed: &Formed) -> Vec<String> {
        let rows = formed.table.rows.iter();
        let text = |row: &crate::table::Row| {
            let cells: Vec<&str> = row.cells.iter().map(|cell| cell.text.as_str()).collect();
            format!("{}: {}", row.line, cells.join(" "))
        };
        rows.map(text).collect()
    }

    #[track_caller]
    pub(super) fn refused(text: &str, form: Form, replaced: &[(&str, &str, &str)]) {
        for (from, to, says) in replaced {
            assert!(text.contains(from), "{from}");
            let wrong = read(&text.replacen(from, to, 1), form).expect_err(from);
            assert!(
                wrong.to_string().contains(says),
                "{wrong}\nexpected: {says}"
            );
        }
    }
}
