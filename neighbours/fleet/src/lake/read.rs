//! Reading columns of a table.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type, TimestampMicrosecondType};
use arrow_array::{
    BooleanArray, Float64Array, Int64Array, RecordBatch, StringArray, TimestampMicrosecondArray,
    new_null_array,
};
use arrow_schema::{Field, SchemaRef};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::file::reader::ChunkReader;

use super::Lake;
use super::schema::{Table, schema};

impl Lake {
    /// Gives columns of all rows of a table, batch by batch. A column that a file of an older version lacks is null.
    ///
    /// # Errors
    /// A file cannot be read; `take` fails.
    pub fn scan(
        &self,
        table: &Table,
        columns: &[&str],
        take: &mut dyn FnMut(&RecordBatch) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let all = schema(table);
        let places = columns
            .iter()
            .map(|name| all.index_of(name))
            .collect::<Result<Vec<_>, _>>()?;
        let wanted = Arc::new(all.project(&places)?);
        for (_, path) in self.files(table)? {
            match self.remote() {
                Some(remote) => {
                    let content = remote
                        .get(&path)?
                        .with_context(|| format!("{} is gone", path.display()))?;
                    read_from(&wanted, content, &mut |batch| take(&batch))
                        .with_context(|| format!("cannot read {}", path.display()))?;
                }
                None => read(&wanted, &path, &mut |batch| take(&batch))?,
            }
        }
        Ok(())
    }
}

/// Gives the rows of a file with the columns of a schema; those that the file lacks are null.
pub(super) fn read(
    schema: &SchemaRef,
    path: &Path,
    take: &mut dyn FnMut(RecordBatch) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    File::open(path)
        .map_err(Into::into)
        .and_then(|file| read_from(schema, file, take))
        .with_context(|| format!("cannot read {}", path.display()))
}

/// As [`read`], of what holds the content of a file.
fn read_from(
    schema: &SchemaRef,
    content: impl ChunkReader + 'static,
    take: &mut dyn FnMut(RecordBatch) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let builder = ParquetRecordBatchReaderBuilder::try_new(content)?;
    let names = schema.fields().iter().map(|field| field.name().as_str());
    let mask = ProjectionMask::columns(builder.parquet_schema(), names);
    for batch in builder.with_projection(mask).build()? {
        let batch = batch?;
        let column = |field: &Arc<Field>| {
            let known = batch.column_by_name(field.name()).cloned();
            known.unwrap_or_else(|| new_null_array(field.data_type(), batch.num_rows()))
        };
        let columns = schema.fields().iter().map(column).collect();
        take(RecordBatch::try_new(schema.clone(), columns)?)?;
    }
    Ok(())
}

/// A column of texts.
///
/// # Errors
/// It holds something else; the same for the others.
pub fn texts(batch: &RecordBatch, column: usize) -> anyhow::Result<&StringArray> {
    batch
        .column(column)
        .as_string_opt()
        .context("a column is no text")
}

/// A column of numbers.
///
/// # Errors
/// As [`texts`].
pub fn numbers(batch: &RecordBatch, column: usize) -> anyhow::Result<&Float64Array> {
    batch
        .column(column)
        .as_primitive_opt::<Float64Type>()
        .context("a column is no number")
}

/// A column of integers.
///
/// # Errors
/// As [`texts`].
pub fn counts(batch: &RecordBatch, column: usize) -> anyhow::Result<&Int64Array> {
    batch
        .column(column)
        .as_primitive_opt::<Int64Type>()
        .context("a column is no integer")
}

/// A column of flags.
///
/// # Errors
/// As [`texts`].
pub fn flags(batch: &RecordBatch, column: usize) -> anyhow::Result<&BooleanArray> {
    batch
        .column(column)
        .as_boolean_opt()
        .context("a column is no flag")
}

/// A column of instants, µs since 1970.
///
/// # Errors
/// As [`texts`].
pub fn moments(batch: &RecordBatch, column: usize) -> anyhow::Result<&TimestampMicrosecondArray> {
    batch
        .column(column)
        .as_primitive_opt::<TimestampMicrosecondType>()
        .context("a column is no instant")
}
