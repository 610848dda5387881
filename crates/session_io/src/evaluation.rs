//! Touches evaluated as the cell's own analysis evaluates them, on virtual time.

use std::collections::BTreeMap;

use analysis::AnalysisNode;
use graph::{Executor, Running, Stamp, topics};
use probecell_msgs::{FeatureResult, InspectionPlan, ProbeEvent, TouchDeviation, from_cdr, to_cdr};

/// Results by name of the feature.
pub type Features = BTreeMap<String, FeatureResult>;

/// Deviations and fitted features of a plan and its touches, each with the instant of its reception.
///
/// # Errors
/// What the analysis publishes cannot be read.
pub fn evaluate(
    config: analysis::Config,
    plan: &InspectionPlan,
    events: Vec<(Stamp, &ProbeEvent)>,
) -> anyhow::Result<(Vec<TouchDeviation>, Features)> {
    let start = events
        .first()
        .map_or(Stamp(0), |(first, _)| *first)
        .after_s(-1.0);
    let mut executor = Executor::new(vec![Box::new(Running::<AnalysisNode>::new(config))], start)?;
    executor.inject(start, topics::INSPECTION_PLAN.name, to_cdr(plan));
    for (instant, event) in events {
        executor.inject(instant, topics::PROBE_EVENTS.name, to_cdr(event));
    }
    executor.run_until(Stamp(i64::MAX));
    let mut deviations = Vec::new();
    let mut features = Features::new();
    for published in &executor.take_log() {
        if published.topic == topics::TOUCH_DEVIATIONS.name {
            deviations.push(from_cdr::<TouchDeviation>(&published.payload)?);
        } else if published.topic == topics::FEATURE_RESULTS.name {
            let result = from_cdr::<FeatureResult>(&published.payload)?;
            features.insert(result.feature_id.clone(), result);
        }
    }
    Ok((deviations, features))
}

/// A line for each feature: size, deviation, form, what else is said of it.
pub fn lines(features: &Features) -> impl Iterator<Item = String> {
    features.values().map(|result| {
        format!(
            "  {:<20} {:10.4} mm  {:+8.2} µm  form {:7.2} µm  {}",
            result.feature_id,
            result.size * 1e3,
            result.size_deviation * 1e6,
            result.form * 1e6,
            result.text
        )
    })
}
