//! Tables from Python as the importer reads them: texts in cells that know where they stand.

use arrow_array::cast::AsArray;
use arrow_array::types::{Float32Type, Float64Type};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_cast::display::{ArrayFormatter, FormatOptions};
use arrow_schema::DataType;
use exchange::ImportError;
use exchange::table::{Cell, Row, Table};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3_arrow::PyTable;

use crate::errors::{input, wrong};

/// Line of the first row: the names of the columns are line 1, as in a file.
const FIRST: u64 = 2;

/// A table from an object: what has the Arrow capsule (pandas, polars, pyarrow ...), or columns by name.
pub(crate) fn of(object: &Bound<'_, PyAny>) -> PyResult<Table> {
    if object.hasattr(intern!(object.py(), "__arrow_c_stream__"))? {
        // Pandas gives the capsule only beside pyarrow, and not of columns that hold values of several types.
        if let Ok(table) = object.extract::<PyTable>() {
            return of_arrow(&table).map_err(input);
        }
    }
    of_columns(object)
}

/// Where in a table something is wrong: the row's number from 0, as a frame counts, and the name of the column.
pub(crate) fn placed(error: &ImportError, table: &Table) -> String {
    match error.place {
        Some((line, column)) if line >= FIRST => {
            let name = table.header.get(column as usize - 1);
            let column = name.map_or(String::new(), |name| format!(", column {name:?}"));
            format!("row {}{column}: {}", line - FIRST, error.what)
        }
        _ => error.what.clone(),
    }
}

fn empty(header: Vec<String>) -> Table {
    Table {
        header,
        header_line: 1,
        ..Table::default()
    }
}

/// Adds a column of texts; all columns are of one length.
fn add(table: &mut Table, index: usize, texts: Vec<String>) {
    if index == 0 {
        let lines = (FIRST..).take(texts.len());
        table.rows = lines
            .map(|line| Row {
                line,
                cells: Vec::new(),
            })
            .collect();
    }
    for (row, text) in table.rows.iter_mut().zip(texts) {
        row.cells.push(Cell {
            text,
            column: index as u64 + 1,
        });
    }
}

fn of_arrow(given: &PyTable) -> anyhow::Result<Table> {
    let batches = given.batches();
    let fields = batches.first().map(RecordBatch::schema);
    let names = fields.iter().flat_map(|schema| schema.fields());
    let mut table = empty(names.map(|field| field.name().clone()).collect());
    for index in 0..table.header.len() {
        let mut all = Vec::new();
        for batch in batches {
            all.extend(texts(batch.column(index))?);
        }
        add(&mut table, index, all);
    }
    Ok(table)
}

/// Numbers as texts that read back to the same bits.
fn texts(column: &ArrayRef) -> anyhow::Result<Vec<String>> {
    let rows = 0..column.len();
    let float = |value: &dyn Fn(usize) -> f64| {
        let text = |row| {
            if column.is_null(row) {
                String::new()
            } else {
                value(row).to_string()
            }
        };
        rows.clone().map(text).collect()
    };
    Ok(match column.data_type() {
        DataType::Float64 => float(&|row| column.as_primitive::<Float64Type>().value(row)),
        DataType::Float32 => {
            float(&|row| f64::from(column.as_primitive::<Float32Type>().value(row)))
        }
        _ => {
            let options = FormatOptions::default().with_null("");
            let formatter = ArrayFormatter::try_new(column, &options)?;
            rows.map(|row| formatter.value(row).to_string()).collect()
        }
    })
}

/// Columns by name: a dictionary, or a frame without Arrow.
fn of_columns(object: &Bound<'_, PyAny>) -> PyResult<Table> {
    let kind = object.get_type().name()?;
    let unusable = || {
        wrong(format!(
            "a {kind} is no table: give a DataFrame, an Arrow table, a dictionary of columns, or the path of a file"
        ))
    };
    let names = object.call_method0("keys").map_err(|_| unusable())?;
    let mut header = Vec::new();
    let mut columns = Vec::new();
    for name in names.try_iter()? {
        let name = name?;
        let column = object.get_item(&name).map_err(|_| unusable())?;
        let values = match column.call_method0("tolist") {
            Ok(list) => list,
            Err(_) => column,
        };
        let mut all = Vec::new();
        for value in values.try_iter()? {
            all.push(text(&value?)?);
        }
        header.push(name.str()?.to_string());
        columns.push(all);
    }
    let mut table = empty(header);
    let length = columns.first().map_or(0, Vec::len);
    if columns.iter().any(|column| column.len() != length) {
        return Err(wrong("the columns of the table are of different lengths"));
    }
    for (index, column) in columns.into_iter().enumerate() {
        add(&mut table, index, column);
    }
    Ok(table)
}

/// A value as text; nothing where it is missing, which pandas writes as NaN.
fn text(value: &Bound<'_, PyAny>) -> PyResult<String> {
    if value.is_none() {
        return Ok(String::new());
    }
    if let Ok(text) = value.extract::<String>() {
        return Ok(text);
    }
    if value.is_instance_of::<pyo3::types::PyFloat>() {
        let number = value.extract::<f64>()?;
        return Ok(if number.is_nan() {
            String::new()
        } else {
            number.to_string()
        });
    }
    if let Ok(instant) = value.call_method0("isoformat") {
        return Ok(instant.str()?.to_string().replace("+00:00", "Z"));
    }
    Ok(value.str()?.to_string())
}
