//! Sessions diagnosed without the effect that acts: what is named in its place, beside the truth.
//!
//! Where held-out touches are predicted as well by the false explanation as by the true one, no method can call the gap
//! unexplained; where they are predicted worse, the diagnosis is at fault. The two are counted apart. Metres.

use std::fmt;

use diagnosis::Residuals;
use diagnosis::residuals::{TouchResidual, TouchResiduals};
use serde::Serialize;

use super::{Judged, Share, Trial};

/// Natural logarithm of the likelihood ratio from which touches tell two explanations apart: 20 to 1, the least that is strong
/// evidence (Kass and Raftery 1995, section 3.2).
const STRONG: f64 = 3.0;

/// Answers to sessions whose effect was deleted from the library.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Deleted {
    /// A false effect is named without a flag, though held-out touches tell it from the truth.
    pub told: Share,
    /// A false effect is named without a flag, and held-out touches do not tell it from the truth.
    pub alike: Share,
    /// Something unknown is flagged, of all but those alike.
    pub flagged: Share,
}

impl Deleted {
    /// Counts; `None` where no effect was deleted.
    pub(super) fn of(judged: &[(Trial, Judged)]) -> Option<Self> {
        let own = || (judged.iter()).filter(|(trial, _)| *trial == Trial::Deleted);
        own().next()?;
        let told = |judged: &Judged| judged.truth_ahead.is_none_or(|ahead| ahead > STRONG);
        let alike = |judged: &Judged| judged.innocent_blamed && !told(judged);
        let others = own().filter(|(_, judged)| !alike(judged));
        Some(Self {
            told: Share::of(own().map(|(_, judged)| judged.innocent_blamed && told(judged))),
            alike: Share::of(own().map(|(_, judged)| alike(judged))),
            flagged: Share::of(others.map(|(_, judged)| judged.flagged())),
        })
    }
}

impl fmt::Display for Deleted {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(to, "| where the effect that acts was deleted | sessions |")?;
        writeln!(to, "|---|---|")?;
        let Self {
            told,
            alike,
            flagged,
        } = self;
        writeln!(
            to,
            "| false effect named that held-out touches tell from the truth | {told} |"
        )?;
        writeln!(
            to,
            "| false effect named that they do not tell from the truth | {alike} |"
        )?;
        writeln!(
            to,
            "| unknown cause flagged, of all but the latter | {flagged} |"
        )
    }
}

/// Natural logarithm of the likelihood of the held-out touches with the truth over that without it, at noise of standard deviation
/// `noise` (m); `None` for what is not touches.
///
/// A touch that is set aside may lie anywhere within the range of the deviations: setting touches aside is no prediction of them.
pub(super) fn log_likelihood_ratio(
    truth: &Residuals,
    without: &Residuals,
    noise: f64,
) -> Option<f64> {
    let (Residuals::Touches(truth), Residuals::Touches(without)) = (truth, without) else {
        return None;
    };
    let touches = |of: &'_ [TouchResiduals]| -> Vec<TouchResidual> {
        of.iter().flat_map(|part| part.touches.clone()).collect()
    };
    let (truth, without) = (touches(truth), touches(without));
    let deviations = || truth.iter().map(|touch| touch.before);
    let range =
        deviations().fold(f64::NEG_INFINITY, f64::max) - deviations().fold(f64::INFINITY, f64::min);
    let log_density = |touch: &TouchResidual| match touch.after {
        Some(left) => -0.5 * (left / noise).powi(2) - (noise * std::f64::consts::TAU.sqrt()).ln(),
        None => -range.ln(),
    };
    let ahead = truth.iter().zip(&without);
    Some(
        ahead
            .map(|(truth, without)| log_density(truth) - log_density(without))
            .sum(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn residuals(left: &[Option<f64>]) -> Residuals {
        let touch = |(number, after): (usize, &Option<f64>)| TouchResidual {
            session: 0,
            sequence: number as u64,
            feature: 0,
            position: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            time: number as f64,
            feed: 0.005,
            positions: Vec::new(),
            before: number as f64 * 1e-6,
            after: *after,
            pose: Vec::new(),
        };
        Residuals::Touches(vec![TouchResiduals {
            compared: "touches against the model",
            sessions: vec!["session".to_owned()],
            axes: Vec::new(),
            features: vec!["feature".to_owned()],
            touches: left.iter().enumerate().map(touch).collect(),
            lag1_correlation: 0.0,
        }])
    }

    /// Of residuals of 1 and 3 standard deviations, (9 - 1)/2 for each touch; a touch that only one side sets aside is compared
    /// with the uniform density over the deviations, 2 µm wide: ln 2 - ln √2π - 1/2.
    #[test]
    fn residuals_of_normal_noise_give_half_the_difference_of_their_squares() {
        let truth = residuals(&[Some(1e-6), Some(-1e-6), None]);
        let without = residuals(&[Some(3e-6), Some(-3e-6), None]);
        let ahead = log_likelihood_ratio(&truth, &without, 1e-6).unwrap_or(f64::NAN);
        assert!((ahead - 8.0).abs() < 1e-9, "{ahead}");
        let aside = residuals(&[Some(1e-6), None, None]);
        let ahead = log_likelihood_ratio(&truth, &aside, 1e-6).unwrap_or(f64::NAN);
        let expected = 2.0_f64.ln() - std::f64::consts::TAU.sqrt().ln() - 0.5;
        assert!((ahead - expected).abs() < 1e-9, "{ahead}");
    }
}
