//! What follows from the fields of a [`FeatureResult`].

use crate::FeatureResult;

impl FeatureResult {
    /// Expanded uncertainty U = k·u, m (GUM 6.2.1).
    pub fn expanded_uncertainty(&self) -> f64 {
        self.coverage_factor * self.standard_uncertainty
    }

    /// The deviations by which two results are compared, m: of a profile that of each point, else that of the size.
    pub fn compared_deviations(&self) -> &[f64] {
        if self.deviations.is_empty() {
            std::slice::from_ref(&self.size_deviation)
        } else {
            &self.deviations
        }
    }
}
