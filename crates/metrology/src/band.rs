//! Decides how much of a measured difference goes into a tool offset: bands and running mean.
//!
//! Lengths in m. After the automatic tool offset of the SINUMERIK measuring cycles, whose names the fields bear: bands
//! `TZL < TMV < TUL/TLL < TDIF < TSA` around the middle of the tolerance. It filters random scatter out of the
//! correction; it does not know the true size and does not bound the total correction.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Bands in m. Upper and lower tolerance are deviations from the set value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bands {
    /// TZL: a running mean below this is scatter and corrects nothing.
    pub zero_offset: f64,
    /// TMV: differences below this go through the running mean, larger ones are corrected at once.
    pub mean_value: f64,
    /// TUL: upper tolerance.
    pub upper: f64,
    /// TLL: lower tolerance.
    pub lower: f64,
    /// TDIF: beyond this an operator decides.
    pub difference: f64,
    /// TSA: beyond this something other than the tool is wrong.
    pub safe_area: f64,
    /// k: weight of the running mean; 1 forgets at once.
    pub weight: f64,
}

/// What a difference leads to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum BandAction {
    /// The mean was updated, nothing is corrected.
    Hold,
    /// Take this many m off the offset in the direction of the difference.
    Correct {
        /// Amount in m.
        amount: f64,
        /// True if the size was out of tolerance.
        out_of_tolerance: bool,
    },
    /// Alarm; an operator decides about the correction.
    AskOperator,
    /// Alarm; the program is interrupted.
    Interrupt,
}

/// What a band evaluation yields: the action, and the mean to remember.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BandOutcome {
    /// What to do.
    pub action: BandAction,
    /// Running mean in m for the next evaluation; a correction clears it.
    pub mean: f64,
}

/// Bands that contradict each other, or a difference that is no number.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum BandError {
    /// Not `0 ≤ TZL ≤ TMV ≤ (TUL − TLL)/2 ≤ TDIF ≤ TSA`.
    #[error("the bands do not nest")]
    NotNested,
    /// k below 1 or not finite.
    #[error("the weight of the running mean is {0}")]
    Weight(f64),
    /// The size or the remembered mean is NaN or infinite.
    #[error("the difference is not a number")]
    NotFinite,
}

impl Bands {
    /// The set value moved to the middle of the tolerance, and half its width, in m: 10 mm with 0/−4 µm becomes
    /// 9.998 mm ± 2 µm.
    pub fn centred(&self, set_value: f64) -> (f64, f64) {
        (
            set_value + f64::midpoint(self.upper, self.lower),
            (self.upper - self.lower) / 2.0,
        )
    }

    /// Evaluates an `actual` size (m) against `set_value` (m) with the running `mean` (m) remembered so far.
    ///
    /// # Errors
    /// See [`BandError`].
    pub fn evaluate(
        &self,
        actual: f64,
        set_value: f64,
        mean: f64,
    ) -> Result<BandOutcome, BandError> {
        let (centre, half_width) = self.centred(set_value);
        let nested = [
            0.0,
            self.zero_offset,
            self.mean_value,
            half_width,
            self.difference,
            self.safe_area,
        ]
        .is_sorted();
        if !nested {
            return Err(BandError::NotNested);
        }
        if !(self.weight >= 1.0 && self.weight.is_finite()) {
            return Err(BandError::Weight(self.weight));
        }
        let difference = actual - centre;
        if !(difference.is_finite() && mean.is_finite()) {
            return Err(BandError::NotFinite);
        }
        let size = difference.abs();
        let keep = |action| Ok(BandOutcome { action, mean });
        if size > self.safe_area {
            return keep(BandAction::Interrupt);
        }
        if size > self.difference {
            return keep(BandAction::AskOperator);
        }
        if size > self.mean_value {
            return Ok(BandOutcome {
                action: BandAction::Correct {
                    amount: difference,
                    out_of_tolerance: size > half_width,
                },
                mean: 0.0,
            });
        }
        let updated = mean - (mean - difference) / self.weight;
        Ok(if updated.abs() > self.zero_offset {
            BandOutcome {
                action: BandAction::Correct {
                    amount: updated,
                    out_of_tolerance: false,
                },
                mean: 0.0,
            }
        } else {
            BandOutcome {
                action: BandAction::Hold,
                mean: updated,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bands() -> Bands {
        Bands {
            zero_offset: 2e-6,
            mean_value: 6e-6,
            upper: 10e-6,
            lower: -10e-6,
            difference: 50e-6,
            safe_area: 200e-6,
            weight: 3.0,
        }
    }

    #[test]
    fn asymmetric_tolerances_are_recentred_as_the_manual_prints() {
        let bands = Bands {
            upper: 0.0,
            lower: -4e-6,
            ..bands()
        };
        let (set, half) = bands.centred(10e-3);
        assert!((set - 9.998e-3).abs() < 1e-15 && (half - 2e-6).abs() < 1e-18);
    }

    #[test]
    fn each_band_has_its_action() {
        let act = |micrometres: f64| {
            bands()
                .evaluate(10e-3 + micrometres * 1e-6, 10e-3, 0.0)
                .unwrap()
                .action
        };
        assert_eq!(act(3.0), BandAction::Hold);
        assert!(matches!(
            act(-7.0),
            BandAction::Correct {
                out_of_tolerance: false,
                ..
            }
        ));
        assert!(matches!(
            act(12.0),
            BandAction::Correct {
                out_of_tolerance: true,
                amount,
            } if (amount - 12e-6).abs() < 1e-15
        ));
        assert_eq!(act(-60.0), BandAction::AskOperator);
        assert_eq!(act(250.0), BandAction::Interrupt);
    }

    /// A steady +5 µm shows only after the mean has grown past TZL: 1.67, then 2.78 µm; then memory starts anew.
    #[test]
    fn a_small_steady_difference_is_corrected_by_its_running_mean() {
        let first = bands().evaluate(10.005e-3, 10e-3, 0.0).unwrap();
        assert_eq!(first.action, BandAction::Hold);
        assert!((first.mean - 5e-6 / 3.0).abs() < 1e-15);
        let second = bands().evaluate(10.005e-3, 10e-3, first.mean).unwrap();
        let BandAction::Correct { amount, .. } = second.action else {
            panic!("{second:?}");
        };
        assert!((amount - 25e-6 / 9.0).abs() < 1e-15);
        assert_eq!(second.mean, 0.0);
    }

    #[test]
    fn scatter_around_the_middle_corrects_nothing() {
        let mut mean = 0.0;
        for sign in [1.0, -1.0].into_iter().cycle().take(100) {
            let outcome = bands().evaluate(10e-3 + sign * 5e-6, 10e-3, mean).unwrap();
            assert_eq!(outcome.action, BandAction::Hold);
            mean = outcome.mean;
        }
    }

    #[test]
    fn contradictory_bands_are_refused() {
        let bands = Bands {
            mean_value: 60e-6,
            ..bands()
        };
        assert_eq!(bands.evaluate(0.01, 0.01, 0.0), Err(BandError::NotNested));
        let nan = Bands {
            upper: f64::NAN,
            ..self::bands()
        };
        assert!(nan.evaluate(0.01, 0.01, 0.0).is_err());
        assert_eq!(
            self::bands().evaluate(f64::NAN, 0.01, 0.0),
            Err(BandError::NotFinite)
        );
    }
}
