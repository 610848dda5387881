//! The diagnosis for engines of others: names of recordings in, the same rows with their diagnoses out, as streams of Arrow IPC.
//!
//! Spark (`mapInArrow`), Ray (`map_batches`) and any program that starts a process run the function of `sql` by it. A batch is
//! answered before the next one is read, and each row is answered once, in its place.

use std::io::{BufReader, BufWriter, Read, Write};
use std::sync::Arc;

use anyhow::{Context, anyhow, bail};
use arrow_array::cast::AsArray;
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use datafusion::arrow::ipc::reader::StreamReader;
use datafusion::arrow::ipc::writer::StreamWriter;

use crate::answer::{ANSWER, diagnoses};

/// Column of the input that names the recordings.
const URI: &str = "uri";
/// Column that is added.
const DIAGNOSIS: &str = "diagnosis";

/// Answers all batches of `input` on `output`; gives the number of rows.
///
/// # Errors
/// The input is no stream of Arrow IPC, or has no column `uri` of text; the output cannot be written. A recording that
/// cannot be diagnosed is no error: its answer says why.
pub fn run(input: impl Read, output: impl Write) -> anyhow::Result<usize> {
    let reader = StreamReader::try_new(BufReader::new(input), None)
        .context("the input is no stream of Arrow IPC")?;
    let (place, schema) = answered(&reader.schema())?;
    let mut writer = StreamWriter::try_new(BufWriter::new(output), &schema)?;
    writer.flush()?;
    let mut rows = 0;
    for batch in reader {
        let batch = batch.context("cannot read the input")?;
        let names = arrow_cast::cast(batch.column(place), &DataType::Utf8)?;
        let diagnosis: ArrayRef = Arc::new(diagnoses(names.as_string::<i32>().iter())?);
        let columns = batch.columns().iter().cloned().chain([diagnosis]).collect();
        writer
            .write(&RecordBatch::try_new(schema.clone(), columns)?)
            .and_then(|()| writer.flush())
            .context("cannot write the output")?;
        rows += batch.num_rows();
    }
    writer.finish().context("cannot write the output")?;
    Ok(rows)
}

/// Place of the column with the names, and the columns of the output.
fn answered(schema: &SchemaRef) -> anyhow::Result<(usize, SchemaRef)> {
    let names: Vec<&str> = schema
        .fields()
        .iter()
        .map(|field| field.name().as_str())
        .collect();
    let place = schema
        .index_of(URI)
        .map_err(|_| anyhow!("the input has no column {URI}; it has {}", names.join(", ")))?;
    let kind = schema.field(place).data_type();
    if !matches!(
        kind,
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View
    ) {
        bail!("the column {URI} of the input is {kind}, must be text");
    }
    if names.contains(&DIAGNOSIS) {
        bail!("the input has a column {DIAGNOSIS} already");
    }
    let added = Arc::new(Field::new(
        DIAGNOSIS,
        DataType::Struct(ANSWER.clone()),
        true,
    ));
    let fields: Vec<Arc<Field>> = schema.fields().iter().cloned().chain([added]).collect();
    let schema = Schema::new_with_metadata(fields, schema.metadata().clone());
    Ok((place, Arc::new(schema)))
}
