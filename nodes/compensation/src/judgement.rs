//! A judgement of the machine's volumetric table or of the position of the part.

use metrology::decision::Verdict;

use crate::correction::Proposal;

/// Coverage factor of the displacements found (GUM 6.3.3). Their standard uncertainties already hold the few degrees of
/// freedom that they are estimated with (`machining::calibration`), so that k = 2 covers at least 95 % by Student's t.
pub(crate) const COVERAGE: f64 = 2.0;

/// What follows from the touches for the table or the position.
pub(crate) struct Judgement {
    /// Its name in verdicts.
    pub(crate) id: String,
    /// m; largest displacement that qualifies.
    pub(crate) tolerance: f64,
    /// As of a size.
    pub(crate) verdict: Verdict,
    /// m; largest displacement by the errors found, NaN where none could be found.
    pub(crate) error: f64,
    /// What was found, or why nothing was.
    pub(crate) text: String,
    /// What would correct it, where it is [`Verdict::Compensable`].
    pub(crate) proposals: Option<Vec<Proposal>>,
}

#[cfg(test)]
mod tests {
    use metrology::statistics::coverage_factor;

    use super::*;

    /// JCGM 101 6.4.9.4: the standard deviation of Student's t is √(ν/(ν − 2)) times its scale; three degrees of freedom are
    /// the fewest that the calibration accepts.
    #[test]
    fn the_coverage_factor_covers_95_percent_with_few_degrees_of_freedom() {
        for degrees_of_freedom in (3..200).map(f64::from) {
            let widened = (degrees_of_freedom / (degrees_of_freedom - 2.0)).sqrt();
            assert!(COVERAGE * widened >= coverage_factor(0.95, degrees_of_freedom));
        }
    }
}
