//! A table of a reference: columns `point` (index into the plan, from 0) or `nominal_x, nominal_y, nominal_z`, and `deviation` or the
//! measured point `x, y, z`.

use super::columns::Columns;
use super::reference::{Found, Value, Which};
use crate::ImportError;
use crate::table::{Layout, Row, Table};
use crate::units::{Quantity, Units};

/// Reads a table of a reference.
///
/// # Errors
/// The first mistake, with line and column where there is one.
pub fn read(
    text: &str,
    columns: &str,
    layout: Layout,
    units: &Units,
) -> Result<Vec<Found>, ImportError> {
    let table = Table::read(text, layout)?;
    table.whole()?;
    let (columns, table) = Columns::with_constants(columns, &table)?;
    let nominal = columns.triple(["nominal_x", "nominal_y", "nominal_z"])?;
    let measured = columns.triple(["x", "y", "z"])?;
    let si = |row: &Row, index: usize, quantity: Quantity| -> Result<f64, ImportError> {
        Ok(units.of(quantity)?.1 * row.number(index, layout)?)
    };
    let lengths = |row: &Row, columns: [usize; 3]| -> Result<[f64; 3], ImportError> {
        let [x, y, z] = columns.map(|index| si(row, index, Quantity::Length));
        Ok([x?, y?, z?])
    };
    let mut found = Vec::new();
    for row in &table.rows {
        let of = match (columns.get("point"), nominal) {
            (Some(index), None) => {
                let point = row.cell(index)?.text.parse().ok();
                Which::Index(
                    point.ok_or_else(|| row.wrong(index, "expected the index of a point"))?,
                )
            }
            (None, Some(columns)) => Which::Nominal(lengths(row, columns)?),
            _ => {
                return Err(ImportError::whole(
                    "name either the column point or nominal_x, nominal_y, nominal_z",
                ));
            }
        };
        let value = match (columns.get("deviation"), measured) {
            (Some(index), None) => Value::Deviation(si(row, index, Quantity::Deviation)?),
            (None, Some(columns)) => Value::Point(lengths(row, columns)?),
            _ => {
                return Err(ImportError::whole(
                    "name either the column deviation or x, y, z",
                ));
            }
        };
        found.push(Found {
            place: (row.line, 1),
            of,
            value,
        });
    }
    Ok(found)
}
