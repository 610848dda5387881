//! What a measurement says of the machine or of the place of the part, beside its sizes.

use metrology::decision::Verdict;
use probecell_msgs::Correction;

/// Expanded over standard uncertainty (about 95 %).
pub(crate) const COVERAGE: f64 = 2.0;

/// What follows from the touches; `P` is what would put it right.
pub(crate) struct Judged<P> {
    /// As of a size.
    pub(crate) verdict: Verdict,
    /// m; largest displacement by the errors found, NaN where there are none.
    pub(crate) error: f64,
    /// What was found, or why nothing was.
    pub(crate) text: String,
    /// What would put it right.
    pub(crate) proposal: Option<P>,
}

/// The same of something with a name and a tolerance.
pub(crate) struct Finding {
    /// Its name in verdicts and corrections.
    pub(crate) id: String,
    /// m; largest displacement that qualifies.
    pub(crate) tolerance: f64,
    /// What follows, with the corrections that would put it right.
    pub(crate) judged: Judged<Vec<Correction>>,
}

impl<P> Judged<P> {
    /// With the corrections that ask for what is proposed.
    pub(crate) fn asking(
        self,
        corrections: impl FnOnce(P) -> Vec<Correction>,
    ) -> Judged<Vec<Correction>> {
        Judged {
            verdict: self.verdict,
            error: self.error,
            text: self.text,
            proposal: self.proposal.map(corrections),
        }
    }
}
