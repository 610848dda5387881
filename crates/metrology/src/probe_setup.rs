//! Decides which step of the probe calibration comes next, and computes what is stored.
//!
//! Lengths in m, angles in rad. `docs/source_systems.md, A.5`: find the spindle axis, bring the probe there, turn an
//! indicator with the spindle round the ball until it stands still, store the X and Y offsets, and only then measure
//! the ball radius and the length. The order matters: a radius measured before the offsets are stored absorbs δx on
//! one side (A.3), and every later size carries the difference.
//!
//! The machine is a value; the caller performs each step and reports it. It moves nothing itself.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Largest total indicator reading in m at which the needle counts as still: one division of the indicator.
pub const ACCEPTED_READING: f64 = 2e-6;

/// The step that has to be done next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Step {
    /// 1: diameter cycle P9082 finds the spindle axis in X.
    #[default]
    FindAxis,
    /// 2: the probe is moved onto it.
    MoveToAxis,
    /// 3: the indicator is put on the spindle jaw, near the ball.
    MountIndicator,
    /// 4: the spindle is turned and the indicator read.
    Rotate,
    /// 5: X and Y are adjusted; then step 4 again.
    Adjust,
    /// 6: the X and Y offsets are stored.
    StoreOffsets,
    /// 7: P9082 again, the ball radius is computed and stored.
    BallRadius,
    /// 8: P9801, the length in Z.
    Length,
    /// Everything is stored.
    Complete,
}

/// A step that has been done, with what it measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Done {
    /// Step 1: machine X of the spindle axis, m.
    AxisFound {
        /// Machine X in m.
        x: f64,
    },
    /// Step 2.
    MovedToAxis,
    /// Step 3.
    IndicatorMounted,
    /// Step 4: readings `(spindle angle in rad, indicator in m)`.
    Rotated {
        /// The pairs, at least three different angles.
        readings: Vec<(f64, f64)>,
    },
    /// Step 5: the probe was moved by these amounts, m.
    Adjusted {
        /// Along X.
        x: f64,
        /// Along Y.
        y: f64,
    },
    /// Step 6.
    OffsetsStored,
    /// Step 7: machine X (as radius, m) of the touch on a turned reference.
    ReferenceTouched {
        /// x_touch in m from the spindle axis.
        x: f64,
        /// Known diameter of the reference, m.
        diameter: f64,
    },
    /// Step 8: machine Z of the touch on a reference face of known Z, m.
    LengthTouched {
        /// Machine Z at the touch.
        z: f64,
        /// True Z of the face.
        reference: f64,
    },
}

impl Done {
    /// The step this report belongs to.
    pub fn step(&self) -> Step {
        match self {
            Self::AxisFound { .. } => Step::FindAxis,
            Self::MovedToAxis => Step::MoveToAxis,
            Self::IndicatorMounted => Step::MountIndicator,
            Self::Rotated { .. } => Step::Rotate,
            Self::Adjusted { .. } => Step::Adjust,
            Self::OffsetsStored => Step::StoreOffsets,
            Self::ReferenceTouched { .. } => Step::BallRadius,
            Self::LengthTouched { .. } => Step::Length,
        }
    }
}

/// What a completed calibration has stored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoredProbe {
    /// X of the ball centre on the spindle axis, machine coordinates, m.
    pub offset_x: f64,
    /// Y adjustment summed over step 5, m.
    pub offset_y: f64,
    /// r_c, m.
    pub ball_radius: f64,
    /// Length correction in Z, m.
    pub length: f64,
}

/// A calibration under way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    next: Step,
    axis_x: f64,
    adjusted: [f64; 2],
    indicator: Option<IndicatorFit>,
    ball_radius: f64,
    length: f64,
}

/// Why a report was refused; the calibration is unchanged.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum CalibrationError {
    /// Another step comes next.
    #[error("step {given:?} was reported, but {expected:?} comes next")]
    OutOfOrder {
        /// The step that comes next.
        expected: Step,
        /// The step reported.
        given: Step,
    },
    /// A reported value is NaN or infinite.
    #[error("a value reported for step {0:?} is not a number")]
    NotFinite(Step),
    /// The indicator readings have no answer.
    #[error(transparent)]
    Indicator(#[from] IndicatorError),
    /// The computed ball radius is not positive.
    #[error("the touch gives a ball radius of {0} m")]
    BallRadius(f64),
}

impl Calibration {
    /// A calibration of which nothing is done yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The step that comes next.
    pub fn next(&self) -> Step {
        self.next
    }

    /// The indicator readings fitted last.
    pub fn indicator(&self) -> Option<IndicatorFit> {
        self.indicator
    }

    /// What is stored, once step 8 is done.
    pub fn stored(&self) -> Option<StoredProbe> {
        (self.next == Step::Complete).then_some(StoredProbe {
            offset_x: self.axis_x + self.adjusted[0],
            offset_y: self.adjusted[1],
            ball_radius: self.ball_radius,
            length: self.length,
        })
    }

    /// Takes the report of a step and returns the step that comes next.
    ///
    /// # Errors
    /// The report is out of order or unusable; the calibration then stays as it was.
    pub fn report(&mut self, done: &Done) -> Result<Step, CalibrationError> {
        let given = done.step();
        if given != self.next {
            return Err(CalibrationError::OutOfOrder {
                expected: self.next,
                given,
            });
        }
        let finite = |values: &[f64]| {
            let all = values.iter().all(|v| v.is_finite());
            all.then_some(()).ok_or(CalibrationError::NotFinite(given))
        };
        self.next = match *done {
            Done::AxisFound { x } => {
                finite(&[x])?;
                self.axis_x = x;
                Step::MoveToAxis
            }
            Done::MovedToAxis => Step::MountIndicator,
            Done::IndicatorMounted => Step::Rotate,
            Done::Rotated { ref readings } => {
                let fit = fit_indicator(readings)?;
                self.indicator = Some(fit);
                if fit.total_reading <= ACCEPTED_READING {
                    Step::StoreOffsets
                } else {
                    Step::Adjust
                }
            }
            Done::Adjusted { x, y } => {
                finite(&[x, y])?;
                self.adjusted[0] += x;
                self.adjusted[1] += y;
                Step::Rotate
            }
            Done::OffsetsStored => Step::BallRadius,
            Done::ReferenceTouched { x, diameter } => {
                finite(&[x, diameter])?;
                let radius = x - diameter / 2.0;
                if radius <= 0.0 {
                    return Err(CalibrationError::BallRadius(radius));
                }
                self.ball_radius = radius;
                Step::Length
            }
            Done::LengthTouched { z, reference } => {
                finite(&[z, reference])?;
                self.length = z - reference;
                Step::Complete
            }
        };
        Ok(self.next)
    }
}

/// `m(θ) = a + δx cos θ + δy sin θ`, fitted to indicator readings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IndicatorFit {
    /// a, m.
    pub mean: f64,
    /// δx, m.
    pub offset_x: f64,
    /// δy, m.
    pub offset_y: f64,
    /// TIR = 2√(δx² + δy²), m.
    pub total_reading: f64,
    /// Root mean square residual, m.
    pub rms: f64,
}

/// Readings without a fit.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum IndicatorError {
    /// Fewer than three readings, or all at too few different angles.
    #[error("the indicator has to be read at three or more different angles")]
    TooFewAngles,
    /// A reading or angle is NaN or infinite.
    #[error("indicator reading {0} is not a number")]
    NotFinite(usize),
}

/// What an indicator of scale division `division` (m) shows of `value` (m).
pub fn quantised(value: f64, division: f64) -> f64 {
    if division > 0.0 {
        (value / division).round() * division
    } else {
        value
    }
}

/// Least squares of the indicator model on pairs (angle in rad, reading in m).
///
/// # Errors
/// See [`IndicatorError`].
pub fn fit_indicator(readings: &[(f64, f64)]) -> Result<IndicatorFit, IndicatorError> {
    if let Some(index) = readings
        .iter()
        .position(|(angle, reading)| !(angle.is_finite() && reading.is_finite()))
    {
        return Err(IndicatorError::NotFinite(index));
    }
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for &(angle, reading) in readings {
        let (sin, cos) = angle.sin_cos();
        let row = Vector3::new(1.0, cos, sin);
        normal += row * row.transpose();
        right += row * reading;
    }
    let smallest = normal.symmetric_eigenvalues().min();
    if readings.len() < 3 || smallest <= 1e-9 * readings.len() as f64 {
        return Err(IndicatorError::TooFewAngles);
    }
    let solution = normal
        .cholesky()
        .ok_or(IndicatorError::TooFewAngles)?
        .solve(&right);
    let [mean, offset_x, offset_y] = solution.into();
    let squares: f64 = readings
        .iter()
        .map(|(angle, reading)| {
            (mean + offset_x * angle.cos() + offset_y * angle.sin() - reading).powi(2)
        })
        .sum();
    Ok(IndicatorFit {
        mean,
        offset_x,
        offset_y,
        total_reading: 2.0 * offset_x.hypot(offset_y),
        rms: (squares / readings.len() as f64).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe_model::Probe;

    fn readings(offset_x: f64, offset_y: f64) -> Vec<(f64, f64)> {
        (0..36)
            .map(|i| {
                let angle = f64::from(i) * std::f64::consts::TAU / 36.0;
                let value = 0.3127e-3 + offset_x * angle.cos() + offset_y * angle.sin();
                (angle, quantised(value, 2e-6))
            })
            .collect()
    }

    /// A.5: least squares over 36 angles recovers offsets to about 0.2 µm although the indicator shows 2 µm steps.
    #[test]
    fn offsets_are_recovered_through_the_indicators_scale() {
        let (mut squares, mut count) = (0.0, 0.0);
        for i in 0..400 {
            let (x, y) = (
                f64::from(i) * 0.137e-6 + 3e-6,
                -f64::from(i) * 0.091e-6 + 10e-6,
            );
            let fit = fit_indicator(&readings(x, y)).unwrap();
            squares += (fit.offset_x - x).powi(2) + (fit.offset_y - y).powi(2);
            count += 2.0;
        }
        let rms: f64 = f64::sqrt(squares / count);
        assert!(rms < 0.2e-6, "{rms:e}");
    }

    #[test]
    fn readings_at_one_or_two_angles_are_refused() {
        let two = [(0.0, 1e-6), (1.0, 2e-6), (0.0, 1e-6), (1.0, 2e-6)];
        assert_eq!(fit_indicator(&two), Err(IndicatorError::TooFewAngles));
        assert_eq!(fit_indicator(&[]), Err(IndicatorError::TooFewAngles));
        assert_eq!(
            fit_indicator(&[(0.0, f64::NAN)]),
            Err(IndicatorError::NotFinite(0))
        );
    }

    fn one_of_each() -> Vec<Done> {
        vec![
            Done::AxisFound { x: 0.1 },
            Done::MovedToAxis,
            Done::IndicatorMounted,
            Done::Rotated {
                readings: readings(20e-6, -5e-6),
            },
            Done::Adjusted { x: -20e-6, y: 5e-6 },
            Done::OffsetsStored,
            Done::ReferenceTouched {
                x: 13e-3,
                diameter: 20e-3,
            },
            Done::LengthTouched {
                z: 0.25,
                reference: 0.1,
            },
        ]
    }

    /// At every point of the procedure exactly one report is taken; the radius never before the offsets.
    #[test]
    fn no_step_can_be_taken_out_of_order() {
        use Step::{
            Adjust, BallRadius, Complete, Length, MountIndicator, MoveToAxis, Rotate, StoreOffsets,
        };
        let mut calibration = Calibration::new();
        let mut path = Vec::new();
        while calibration.next() != Step::Complete {
            let before = calibration.clone();
            let mut taken = 0;
            for done in one_of_each() {
                let mut copy = before.clone();
                if let Ok(next) = copy.report(&done) {
                    taken += 1;
                    path.push(next);
                    calibration = copy;
                } else {
                    assert_eq!(copy, before, "a refused report changed the calibration");
                }
            }
            assert_eq!(taken, 1, "{:?}", before.next());
            if path.ends_with(&[Step::Adjust, Step::Rotate]) {
                let still = Done::Rotated {
                    readings: readings(0.4e-6, 0.1e-6),
                };
                path.push(calibration.report(&still).unwrap());
            }
        }
        assert_eq!(
            path,
            [
                MoveToAxis,
                MountIndicator,
                Rotate,
                Adjust,
                Rotate,
                StoreOffsets,
                BallRadius,
                Length,
                Complete
            ]
        );
        let stored = calibration.stored().unwrap();
        assert!((stored.offset_x - 0.09998).abs() < 1e-15);
        assert!((stored.offset_y - 5e-6).abs() < 1e-18);
        assert!((stored.ball_radius - 3e-3).abs() < 1e-15);
        assert!((stored.length - 0.15).abs() < 1e-15);
        for done in one_of_each() {
            assert!(calibration.report(&done).is_err());
        }
    }

    #[test]
    fn a_needle_that_moves_sends_back_to_adjusting() {
        let mut calibration = Calibration::new();
        for done in &one_of_each()[..4] {
            calibration.report(done).unwrap();
        }
        for _ in 0..3 {
            assert_eq!(calibration.next(), Step::Adjust);
            calibration
                .report(&Done::Adjusted { x: 1e-6, y: 0.0 })
                .unwrap();
            let restless = Done::Rotated {
                readings: readings(4e-6, 0.0),
            };
            calibration.report(&restless).unwrap();
        }
    }

    #[test]
    fn a_calibration_survives_being_stored_halfway() {
        let mut calibration = Calibration::new();
        for done in &one_of_each()[..3] {
            calibration.report(done).unwrap();
        }
        let text = serde_json::to_string(&calibration).unwrap();
        assert_eq!(
            serde_json::from_str::<Calibration>(&text).unwrap(),
            calibration
        );
    }

    /// A radius measured with δx still in the machine hides δx: sizes look right from that side only (A.3).
    #[test]
    fn a_radius_from_the_same_side_absorbs_the_x_error() {
        let mut probe = Probe {
            radius: 3e-3,
            stored_radius: 3e-3,
            offset_x: 20e-6,
            offset_y: 0.0,
        };
        let reference = 25e-3;
        probe.stored_radius = probe.touch_x(reference).unwrap() - reference / 2.0;
        assert!(probe.size_error().abs() < 1e-15);
        let other_side = Probe {
            offset_x: -probe.offset_x,
            ..probe
        };
        assert!((other_side.size_error() - 40e-6).abs() < 1e-15);
    }

    #[test]
    fn bad_values_are_refused_and_change_nothing() {
        let mut calibration = Calibration::new();
        assert_eq!(
            calibration.report(&Done::AxisFound { x: f64::NAN }),
            Err(CalibrationError::NotFinite(Step::FindAxis))
        );
        assert_eq!(calibration, Calibration::new());
    }
}
