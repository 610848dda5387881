//! The diagnosis and the trends as functions of SQL.

mod diagnose;
mod joint_fit;
mod trend;

use datafusion::common::DataFusionError;
use datafusion::logical_expr::{AggregateUDF, ScalarUDF};
use datafusion::prelude::SessionContext;

/// Functions with their arguments, and what they answer.
pub const FUNCTIONS: &[(&str, &str)] = &[
    (
        "diagnose(uri)",
        "the diagnosis of a recording as this program makes it today: a structure of verdict, samples, gap_unit, rms, noise_floor, \
         unexplained_rms, effects (effect, probability, group, rms_before, rms_after, parameters), warnings, and refusal where \
         there is none",
    ),
    (
        "joint_fit(uri)",
        "aggregate: the joint diagnosis of the recordings of a group, which must be of one machine; the same structure",
    ),
    (
        "trend(time, value, standard_uncertainty [, sessions])",
        "aggregate: the level of a series now, its slope per day, and its changes (kind, onset, alarm, size) with one false \
         alarm in so many sessions in the mean, 1000 unless given",
    ),
];

/// The function `diagnose`.
pub(super) fn diagnose() -> ScalarUDF {
    ScalarUDF::from(diagnose::Diagnose::new())
}

/// Makes the functions known, beside the built-in ones.
pub(crate) fn register(context: &SessionContext) {
    context.register_udf(diagnose());
    context.register_udaf(AggregateUDF::from(joint_fit::JointFit::new()));
    context.register_udaf(AggregateUDF::from(trend::Trend::new()));
}

/// An error of ours as one of the engine.
fn failed(error: &anyhow::Error) -> DataFusionError {
    DataFusionError::Execution(crate::sentence(error))
}
