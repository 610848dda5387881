//! Answers as a table for people, as CSV, and as JSON.

use std::io::Write;
use std::sync::Arc;

use arrow_array::{ArrayRef, RecordBatch, StringArray};
use arrow_json::writer::{EncoderOptions, JsonArray, WriterBuilder, make_encoder};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use datafusion::arrow::csv;
use datafusion::arrow::util::pretty::pretty_format_batches_with_schema;

use super::Answer;

/// How an answer is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Columns for people.
    Table,
    /// A line for each row after one with the names; lists and structures as JSON.
    Csv,
    /// An array of objects.
    Json,
}

/// Writes an answer.
///
/// # Errors
/// The question fails while it is answered; `out` cannot be written.
pub fn write(answer: Answer<'_>, form: Form, out: &mut dyn Write) -> anyhow::Result<()> {
    let schema = answer.schema();
    match form {
        Form::Table => {
            let batches = answer.collect::<anyhow::Result<Vec<_>>>()?;
            writeln!(
                out,
                "{}",
                pretty_format_batches_with_schema(schema, &batches)?
            )?;
        }
        Form::Csv => {
            let flat = flat_schema(&schema);
            let mut writer = csv::WriterBuilder::new().with_header(true).build(&mut *out);
            // The names also where there is no row.
            writer.write(&RecordBatch::new_empty(flat.clone()))?;
            for batch in answer {
                writer.write(&flattened(&batch?, &flat)?)?;
            }
        }
        Form::Json => {
            let mut writer = WriterBuilder::new()
                .with_explicit_nulls(true)
                .build::<_, JsonArray>(&mut *out);
            for batch in answer {
                writer.write(&batch?)?;
            }
            writer.finish()?;
            drop(writer);
            writeln!(out)?;
        }
    }
    Ok(())
}

/// The columns with lists and structures as text.
fn flat_schema(schema: &SchemaRef) -> SchemaRef {
    let fields = schema.fields().iter().map(|field| {
        if field.data_type().is_nested() {
            Arc::new(Field::new(field.name(), DataType::Utf8, true))
        } else {
            field.clone()
        }
    });
    Arc::new(Schema::new(fields.collect::<Vec<_>>()))
}

fn flattened(batch: &RecordBatch, flat: &SchemaRef) -> anyhow::Result<RecordBatch> {
    let columns = batch
        .schema()
        .fields()
        .iter()
        .zip(batch.columns())
        .map(|(field, column)| {
            if field.data_type().is_nested() {
                as_json(field, column)
            } else {
                Ok(column.clone())
            }
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    Ok(RecordBatch::try_new(flat.clone(), columns)?)
}

fn as_json(field: &Arc<Field>, column: &ArrayRef) -> anyhow::Result<ArrayRef> {
    let options = EncoderOptions::default().with_explicit_nulls(true);
    let mut encoder = make_encoder(field, column.as_ref(), &options)?;
    let texts = (0..column.len()).map(|row| {
        if encoder.is_null(row) {
            return Ok(None);
        }
        let mut text = Vec::new();
        encoder.encode(row, &mut text);
        Ok(Some(String::from_utf8(text)?))
    });
    let texts = texts.collect::<anyhow::Result<Vec<Option<String>>>>()?;
    Ok(Arc::new(StringArray::from(texts)))
}
