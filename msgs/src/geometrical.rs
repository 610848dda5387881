//! Geometrical tolerances (ISO 1101:2017) as kinds of a [`FeatureResult`].

use crate::FeatureResult;

/// Symbol and term of the geometrical tolerance whose zone a result of this kind is; `None` for a size.
pub fn named(kind: u8) -> Option<(&'static str, &'static str)> {
    Some(match kind {
        FeatureResult::ROUNDNESS => ("○", "roundness"),
        FeatureResult::CYLINDRICITY => ("⌭", "cylindricity"),
        FeatureResult::FLATNESS => ("⏥", "flatness"),
        FeatureResult::PARALLELISM => ("∥", "parallelism"),
        FeatureResult::PERPENDICULARITY => ("⟂", "perpendicularity"),
        FeatureResult::POSITION => ("⌖", "position"),
        FeatureResult::PROFILE => ("⌓", "profile of a surface"),
        FeatureResult::CIRCULAR_RUN_OUT => ("↗", "circular run-out"),
        FeatureResult::TOTAL_RUN_OUT => ("⌰", "total run-out"),
        _ => return None,
    })
}

/// Name of a result as a person reads it: of a geometrical tolerance with its symbol, its term and its datums.
pub fn label(result: &FeatureResult) -> String {
    match named(result.kind) {
        None => result.feature_id.clone(),
        Some((symbol, term)) => {
            let mut parts = vec![format!("{} {symbol} {term}", result.feature_id)];
            parts.extend(result.aligned_to.iter().cloned());
            parts.join(" | ")
        }
    }
}
