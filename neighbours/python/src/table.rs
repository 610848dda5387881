//! A table as Python gets it: Arrow by its capsule interface, which pandas, polars, DuckDB and pyarrow take over without copies.

use std::sync::Arc;

use arrow_array::{Array, ArrayRef, RecordBatch, StructArray};
use arrow_cast::display::{ArrayFormatter, FormatOptions};
use arrow_schema::{ArrowError, DataType, Field, Schema};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict, PyList};
use pyo3_arrow::ffi::{ArrayIterator, to_schema_pycapsule, to_stream_pycapsule};

use crate::errors::input;

/// Rows that a notebook shows.
const SHOWN: usize = 20;

/// A table of columns in SI units (m, rad, s), each of one type.
///
/// Any library that takes Arrow data by its capsule interface reads it as it is: `polars.DataFrame(table)`,
/// `pyarrow.table(table)`, `duckdb.from_arrow(table)`. `to_pandas()` needs pandas and nothing else.
#[pyclass(frozen, module = "probecell")]
pub(crate) struct Table {
    batch: RecordBatch,
}

impl Table {
    /// A table of named columns of equal length.
    pub(crate) fn new(columns: Vec<(String, ArrayRef)>) -> anyhow::Result<Self> {
        let fields: Vec<Field> = columns
            .iter()
            .map(|(name, column)| {
                Field::new(name, column.data_type().clone(), column.is_nullable())
            })
            .collect();
        let arrays = columns.into_iter().map(|(_, column)| column).collect();
        let batch = RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)?;
        Ok(Self { batch })
    }

    fn column(&self, name: &str) -> PyResult<&ArrayRef> {
        (self.batch.column_by_name(name)).ok_or_else(|| PyKeyError::new_err(name.to_owned()))
    }
}

#[pymethods]
impl Table {
    /// The table as an Arrow C stream, by the PyCapsule interface.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyCapsule>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        let array: ArrayRef = Arc::new(StructArray::from(self.batch.clone()));
        let field = Field::new("", array.data_type().clone(), false);
        let arrays = std::iter::once(Ok::<_, ArrowError>(array));
        let reader = Box::new(ArrayIterator::new(arrays, Arc::new(field)));
        Ok(to_stream_pycapsule(py, reader, requested_schema)?)
    }

    /// The schema as an Arrow C schema, by the PyCapsule interface.
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        Ok(to_schema_pycapsule(py, self.batch.schema().as_ref())?)
    }

    /// Names of the columns.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        let schema = self.batch.schema();
        schema
            .fields()
            .iter()
            .map(|one| one.name().clone())
            .collect()
    }

    /// Number of rows.
    fn __len__(&self) -> usize {
        self.batch.num_rows()
    }

    /// The values of a column as a list of Python numbers, texts, lists and dictionaries; instants are ns since 1970.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyList>> {
        let column = self.column(name)?;
        let values = (0..column.len()).map(|row| value(py, column, row));
        PyList::new(py, values.collect::<PyResult<Vec<_>>>()?)
    }

    /// Columns by name, each as `table[name]` gives it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        for name in self.column_names() {
            columns.set_item(&name, self.__getitem__(py, &name)?)?;
        }
        Ok(columns)
    }

    /// A `pandas.DataFrame`; instants are of type `datetime64[ns, UTC]`. Needs pandas, and no pyarrow.
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pandas = py.import("pandas")?;
        let columns = self.to_dict(py)?;
        for field in self.batch.schema().fields() {
            let convert = match field.data_type() {
                DataType::Timestamp(..) => "to_datetime",
                DataType::Duration(_) => "to_timedelta",
                _ => continue,
            };
            let options = PyDict::new(py);
            options.set_item("unit", "ns")?;
            if convert == "to_datetime" {
                options.set_item("utc", true)?;
            }
            let values = self.__getitem__(py, field.name())?;
            let values = pandas.call_method(convert, (values,), Some(&options))?;
            columns.set_item(field.name(), values)?;
        }
        pandas.call_method1("DataFrame", (columns,))
    }

    /// A `polars.DataFrame`. Needs polars.
    fn to_polars(slf: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        let polars = slf.py().import("polars")?;
        polars.call_method1("DataFrame", (slf,))
    }

    fn __repr__(&self) -> String {
        format!(
            "<probecell.Table of {} rows: {}>",
            self.batch.num_rows(),
            self.column_names().join(", ")
        )
    }

    /// The first rows as an HTML table, for a notebook.
    fn _repr_html_(&self) -> PyResult<String> {
        let escaped = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;");
        let names = self.column_names();
        let heads = names
            .iter()
            .map(|name| format!("<th>{}</th>", escaped(name)));
        let heads: String = heads.collect();
        let options = FormatOptions::default().with_null("");
        let formatters = self.batch.columns().iter();
        let formatters = formatters.map(|column| ArrayFormatter::try_new(column, &options));
        let formatters: Vec<_> = formatters.collect::<Result<_, _>>().map_err(input)?;
        let mut rows = String::new();
        for row in 0..self.batch.num_rows().min(SHOWN) {
            let cells = formatters.iter().map(|one| {
                let text = one.value(row).to_string();
                format!("<td>{}</td>", escaped(&text))
            });
            rows.extend(["<tr>".to_owned(), cells.collect(), "</tr>".to_owned()]);
        }
        let count = self.batch.num_rows();
        let more = if count > SHOWN {
            format!("<p>{SHOWN} of {count} rows</p>")
        } else {
            String::new()
        };
        Ok(format!(
            "<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>{more}"
        ))
    }
}

/// One value as Python has it.
fn value<'py>(py: Python<'py>, array: &ArrayRef, row: usize) -> PyResult<Bound<'py, PyAny>> {
    use arrow_array::cast::AsArray;
    use arrow_array::types as t;

    if array.is_null(row) {
        return Ok(py.None().into_bound(py));
    }
    macro_rules! number {
        ($of:ty) => {
            array
                .as_primitive::<$of>()
                .value(row)
                .into_pyobject(py)?
                .into_any()
        };
    }
    let list = |values: ArrayRef| -> PyResult<Bound<'py, PyAny>> {
        let values = (0..values.len()).map(|index| value(py, &values, index));
        Ok(PyList::new(py, values.collect::<PyResult<Vec<_>>>()?)?.into_any())
    };
    Ok(match array.data_type() {
        DataType::Boolean => array
            .as_boolean()
            .value(row)
            .into_pyobject(py)?
            .to_owned()
            .into_any(),
        DataType::Int8 => number!(t::Int8Type),
        DataType::UInt8 => number!(t::UInt8Type),
        DataType::Int16 => number!(t::Int16Type),
        DataType::UInt16 => number!(t::UInt16Type),
        DataType::Int32 => number!(t::Int32Type),
        DataType::UInt32 => number!(t::UInt32Type),
        DataType::Int64 => number!(t::Int64Type),
        DataType::UInt64 => number!(t::UInt64Type),
        DataType::Float32 => number!(t::Float32Type),
        DataType::Float64 => number!(t::Float64Type),
        DataType::Timestamp(..) => number!(t::TimestampNanosecondType),
        DataType::Duration(_) => number!(t::DurationNanosecondType),
        DataType::Utf8 => array
            .as_string::<i32>()
            .value(row)
            .into_pyobject(py)?
            .into_any(),
        DataType::List(_) => list(array.as_list::<i32>().value(row))?,
        DataType::FixedSizeList(..) => list(array.as_fixed_size_list().value(row))?,
        DataType::Struct(fields) => {
            let record = PyDict::new(py);
            let columns = array.as_struct().columns();
            for (field, column) in fields.iter().zip(columns) {
                record.set_item(field.name(), value(py, column, row)?)?;
            }
            record.into_any()
        }
        other => {
            return Err(crate::errors::wrong(format!(
                "no column is of type {other}"
            )));
        }
    })
}
