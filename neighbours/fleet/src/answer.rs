//! A diagnosis as a value of Arrow: what the functions of SQL and the worker answer.

use std::sync::{Arc, LazyLock};

use anyhow::Context;
use arrow_array::{Array, StructArray};
use arrow_buffer::NullBuffer;
use arrow_schema::{DataType, Field, Fields, Schema, TimeUnit};
use diagnosis::Report;
use serde::Serialize;

use crate::bag::words;

/// What a diagnosis says, or why there is none.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Answer {
    sessions: usize,
    verdict: Option<&'static str>,
    samples: Option<usize>,
    gap_unit: Option<String>,
    rms: Option<f64>,
    noise_floor: Option<f64>,
    unexplained_rms: Option<f64>,
    effects: Vec<Finding>,
    warnings: Vec<String>,
    refusal: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Finding {
    effect: String,
    probability: f64,
    group: Vec<String>,
    rms_before: f64,
    rms_after: f64,
    parameters: Vec<Parameter>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Parameter {
    name: String,
    unit: String,
    value: f64,
    lower: f64,
    upper: f64,
}

impl Answer {
    /// Of a diagnosis of so many sessions.
    pub(crate) fn of(sessions: usize, diagnosed: anyhow::Result<Report>) -> Self {
        match diagnosed {
            Ok(report) => Self::told(sessions, report),
            Err(error) => Self {
                sessions,
                refusal: Some(crate::sentence(&error)),
                ..Self::default()
            },
        }
    }

    fn told(sessions: usize, report: Report) -> Self {
        let parameter = |one: effects::ParameterEstimate| Parameter {
            name: one.name,
            unit: one.unit,
            value: one.value,
            lower: one.ci95[0],
            upper: one.ci95[1],
        };
        let effect = |one: diagnosis::report::Effect| Finding {
            effect: one.effect,
            probability: one.probability,
            group: one.group,
            rms_before: one.rms_before,
            rms_after: one.rms_after,
            parameters: one.parameters.into_iter().map(parameter).collect(),
        };
        Self {
            sessions,
            verdict: Some(words::gap(report.verdict)),
            samples: Some(report.samples),
            gap_unit: Some(report.gap.unit),
            rms: Some(report.gap.rms),
            noise_floor: Some(report.gap.noise_floor),
            unexplained_rms: Some(report.unexplained.rms),
            effects: report.effects.into_iter().map(effect).collect(),
            warnings: report.warnings,
            refusal: None,
        }
    }
}

/// Fields of a diagnosis.
pub(crate) static ANSWER: LazyLock<Fields> = LazyLock::new(|| {
    let parameter = structure([
        ("name", DataType::Utf8),
        ("unit", DataType::Utf8),
        ("value", DataType::Float64),
        ("lower", DataType::Float64),
        ("upper", DataType::Float64),
    ]);
    let effect = structure([
        ("effect", DataType::Utf8),
        ("probability", DataType::Float64),
        ("group", list(DataType::Utf8)),
        ("rms_before", DataType::Float64),
        ("rms_after", DataType::Float64),
        ("parameters", list(DataType::Struct(parameter))),
    ]);
    structure([
        ("sessions", DataType::Int64),
        ("verdict", DataType::Utf8),
        ("samples", DataType::Int64),
        ("gap_unit", DataType::Utf8),
        ("rms", DataType::Float64),
        ("noise_floor", DataType::Float64),
        ("unexplained_rms", DataType::Float64),
        ("effects", list(DataType::Struct(effect))),
        ("warnings", list(DataType::Utf8)),
        ("refusal", DataType::Utf8),
    ])
});

/// Fields that may be null.
pub(crate) fn structure<const N: usize>(fields: [(&str, DataType); N]) -> Fields {
    fields
        .into_iter()
        .map(|(name, kind)| Field::new(name, kind, true))
        .collect()
}

/// A list of values that may be null.
pub(crate) fn list(of: DataType) -> DataType {
    DataType::List(Arc::new(Field::new_list_field(of, true)))
}

/// An instant of the lake.
pub(crate) fn instant() -> DataType {
    DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into()))
}

/// Values as a column of structures with these fields; null where there is none.
///
/// # Errors
/// The values do not have these fields.
pub(crate) fn column<T: Serialize + Default>(
    fields: &Fields,
    values: Vec<Option<T>>,
) -> anyhow::Result<StructArray> {
    let nulls: NullBuffer = values.iter().map(Option::is_some).collect();
    let rows: Vec<T> = values.into_iter().map(Option::unwrap_or_default).collect();
    let schema = Arc::new(Schema::new(fields.clone()));
    let mut decoder = arrow_json::ReaderBuilder::new(schema)
        .with_batch_size(rows.len().max(1))
        .build_decoder()?;
    decoder.serialize(&rows)?;
    let Some(batch) = decoder.flush()? else {
        return Ok(StructArray::new_null(fields.clone(), 0));
    };
    StructArray::try_new(fields.clone(), batch.columns().to_vec(), Some(nulls))
        .context("a column of diagnoses")
}

/// Diagnoses of recordings, by name; none where there is no name.
///
/// # Errors
/// See [`column`]; a recording that cannot be diagnosed is no error, its answer says why.
pub(crate) fn diagnoses<'n>(
    names: impl IntoIterator<Item = Option<&'n str>>,
) -> anyhow::Result<StructArray> {
    let names: Vec<Option<&str>> = names.into_iter().collect();
    let answers = crate::parallel::map(&names, |name| {
        name.map(|name| Answer::of(1, crate::diagnose::diagnose_bag(name)))
    });
    let answers = column(&ANSWER, answers)?;
    anyhow::ensure!(
        answers.len() == names.len(),
        "{} recordings have {} answers",
        names.len(),
        answers.len()
    );
    Ok(answers)
}
