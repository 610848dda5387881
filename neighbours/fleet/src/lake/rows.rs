//! Rows of a table before they are written.

use std::sync::Arc;

use anyhow::{Context, bail};
use arrow_array::builder::{
    BooleanBuilder, Float64Builder, Int64Builder, ListBuilder, StringBuilder,
    TimestampMicrosecondBuilder,
};
use arrow_array::{ArrayRef, RecordBatch};

use super::schema::{Kind, Table, columns, schema};

/// One value; a number that is not finite is none.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Nothing.
    Null,
    /// A text.
    Text(String),
    /// A number in the unit of its column.
    Number(f64),
    /// An integer.
    Count(i64),
    /// True or false.
    Flag(bool),
    /// µs since 1970.
    Moment(i64),
    /// Texts.
    Texts(Vec<String>),
    /// Numbers.
    Numbers(Vec<f64>),
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<i64> for Value {
    fn from(count: i64) -> Self {
        Self::Count(count)
    }
}

impl From<u64> for Value {
    fn from(count: u64) -> Self {
        i64::try_from(count).map_or(Self::Null, Self::Count)
    }
}

impl From<usize> for Value {
    fn from(count: usize) -> Self {
        i64::try_from(count).map_or(Self::Null, Self::Count)
    }
}

impl From<u32> for Value {
    fn from(count: u32) -> Self {
        Self::Count(i64::from(count))
    }
}

impl From<bool> for Value {
    fn from(flag: bool) -> Self {
        Self::Flag(flag)
    }
}

impl From<Vec<String>> for Value {
    fn from(texts: Vec<String>) -> Self {
        Self::Texts(texts)
    }
}

impl From<Vec<f64>> for Value {
    fn from(numbers: Vec<f64>) -> Self {
        Self::Numbers(numbers)
    }
}

impl<T: Into<Value>> From<Option<T>> for Value {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Null, Into::into)
    }
}

/// A row: the values of its columns in their order.
pub type Row = Vec<Value>;

enum Builder {
    Text(StringBuilder),
    Number(Float64Builder),
    Count(Int64Builder),
    Flag(BooleanBuilder),
    Moment(TimestampMicrosecondBuilder),
    Texts(ListBuilder<StringBuilder>),
    Numbers(ListBuilder<Float64Builder>),
}

impl Builder {
    fn new(kind: Kind) -> Self {
        match kind {
            Kind::Text => Self::Text(StringBuilder::new()),
            Kind::Number => Self::Number(Float64Builder::new()),
            Kind::Count => Self::Count(Int64Builder::new()),
            Kind::Flag => Self::Flag(BooleanBuilder::new()),
            Kind::Moment => Self::Moment(TimestampMicrosecondBuilder::new().with_timezone("UTC")),
            Kind::Texts => Self::Texts(ListBuilder::new(StringBuilder::new())),
            Kind::Numbers => Self::Numbers(ListBuilder::new(Float64Builder::new())),
        }
    }

    /// `None` where the value is of another kind.
    fn push(&mut self, value: &Value) -> Option<()> {
        let finite = |number: &f64| number.is_finite().then_some(*number);
        match (self, value) {
            (Self::Text(to), Value::Text(text)) => to.append_value(text),
            (Self::Text(to), Value::Null) => to.append_null(),
            (Self::Number(to), Value::Number(number)) => to.append_option(finite(number)),
            (Self::Number(to), Value::Null) => to.append_null(),
            (Self::Count(to), Value::Count(count)) => to.append_value(*count),
            (Self::Count(to), Value::Null) => to.append_null(),
            (Self::Flag(to), Value::Flag(flag)) => to.append_value(*flag),
            (Self::Flag(to), Value::Null) => to.append_null(),
            (Self::Moment(to), Value::Moment(moment)) => to.append_value(*moment),
            (Self::Moment(to), Value::Null) => to.append_null(),
            (Self::Texts(to), Value::Texts(texts)) => {
                for text in texts {
                    to.values().append_value(text);
                }
                to.append(true);
            }
            (Self::Texts(to), Value::Null) => to.append_null(),
            (Self::Numbers(to), Value::Numbers(numbers)) => {
                for number in numbers {
                    to.values().append_option(finite(number));
                }
                to.append(true);
            }
            (Self::Numbers(to), Value::Null) => to.append_null(),
            _ => return None,
        }
        Some(())
    }

    fn finish(&mut self) -> ArrayRef {
        match self {
            Self::Text(builder) => Arc::new(builder.finish()),
            Self::Number(builder) => Arc::new(builder.finish()),
            Self::Count(builder) => Arc::new(builder.finish()),
            Self::Flag(builder) => Arc::new(builder.finish()),
            Self::Moment(builder) => Arc::new(builder.finish()),
            Self::Texts(builder) => Arc::new(builder.finish()),
            Self::Numbers(builder) => Arc::new(builder.finish()),
        }
    }
}

/// The rows as columns.
///
/// # Errors
/// A row does not have the columns of the table.
pub fn batch<'r>(
    table: &Table,
    rows: impl IntoIterator<Item = &'r Row>,
) -> anyhow::Result<RecordBatch> {
    let mut builders: Vec<Builder> = columns(table)
        .map(|column| Builder::new(column.kind))
        .collect();
    for row in rows {
        if row.len() != builders.len() {
            bail!(
                "a row of {} has {} values, not {}",
                table.name,
                row.len(),
                builders.len()
            );
        }
        for ((builder, value), column) in builders.iter_mut().zip(row).zip(columns(table)) {
            builder
                .push(value)
                .with_context(|| format!("{}.{} cannot hold {value:?}", table.name, column.name))?;
        }
    }
    let arrays = builders.iter_mut().map(Builder::finish).collect();
    Ok(RecordBatch::try_new(schema(table), arrays)?)
}
