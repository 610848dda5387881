//! A judgement of the machine's volumetric table or of the position of the part.

use metrology::decision::Verdict;

use crate::correction::Proposal;

/// Coverage factor of the displacements found (GUM 6.3.3). Their standard uncertainties already hold the few degrees of
/// freedom that they are estimated with (`machining::location_errors`), so that k = 2 covers at least 95 % by Student's t.
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

/// A displacement that was found, before it is judged.
pub(crate) struct Found<'a> {
    /// Its name in verdicts.
    pub(crate) id: &'a str,
    /// What is displaced, in words.
    pub(crate) subject: &'static str,
    /// m; the largest displacement that qualifies.
    pub(crate) tolerance: f64,
    /// m; the largest displacement by the errors found, and its standard uncertainty.
    pub(crate) displacement: (f64, f64),
    /// What was found, in a sentence.
    pub(crate) summary: String,
    /// Corrections made in this pass, and the most that may be made.
    pub(crate) corrections: (u32, u32),
}

impl Found<'_> {
    /// The verdict, with what corrects the displacement where `propose` can; its error says why not.
    pub(crate) fn judge(
        self,
        propose: impl FnOnce() -> Result<Vec<Proposal>, String>,
    ) -> Judgement {
        let Self {
            subject,
            tolerance,
            displacement: (error, uncertainty),
            summary,
            corrections: (corrections, most),
            ..
        } = self;
        let expanded = COVERAGE * uncertainty;
        let (verdict, text, proposals) = if !(expanded <= tolerance) {
            let (expanded, tolerance) = (expanded * 1e6, tolerance * 1e6);
            let text = format!(
                "{subject} is known only to ±{expanded:.1} µm; its tolerance is {tolerance:.1} µm"
            );
            (Verdict::MeasurementInvalid, text, None)
        } else if error <= tolerance {
            (Verdict::Qualified, summary, None)
        } else if corrections >= most {
            let text = format!("{summary}; still out of tolerance after {corrections} corrections");
            (Verdict::NotConverged, text, None)
        } else {
            match propose() {
                Ok(proposals) => (Verdict::Compensable, summary, Some(proposals)),
                Err(why) => (Verdict::NotConverged, format!("{summary}; {why}"), None),
            }
        };
        Judgement {
            id: self.id.to_owned(),
            tolerance,
            verdict,
            error,
            text,
            proposals,
        }
    }
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
