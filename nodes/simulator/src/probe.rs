//! The true probe against what the controller has stored of it, before and after the calibration cycle.
//!
//! The cycle is that of `docs/source_systems.md, A.5`, run on the simulated machine: the indicator sees the ball
//! centre's offset through its scale division, X and Y are adjusted until the needle is still, and the ball radius is
//! computed from a touch on a gauge whose diameter is known with an error. What is left is the true less the stored
//! value.

use metrology::probe_setup::{self, Calibration, Done, Step};

use crate::raw::RawProbe;

/// Scale division of the indicator, m (`docs/source_systems.md, A.1`).
const DIVISION: f64 = 2e-6;
/// Spindle angles at which the indicator is read.
const ANGLES: u32 = 36;
/// Radius of the gauge that is touched, m.
const GAUGE_RADIUS: f64 = 10e-3;
/// Rounds of reading and adjusting after which the machine gives the adjustment up.
const ROUNDS: u32 = 10;

/// True minus stored: ball centre in `probe_mount` (m) and ball radius (m).
pub(crate) fn stored(probe: &RawProbe, ball_radius: f64) -> ([f64; 3], f64) {
    let center = probe.center_error_um.map(|error| error * 1e-6);
    let radius_error = probe.radius_error_um * 1e-6;
    if !probe.calibrated {
        return (center, radius_error);
    }
    calibrate(center, ball_radius, probe.gauge_error_um * 1e-6).unwrap_or((center, radius_error))
}

/// Runs the cycle; `None` when it does not come to its end.
fn calibrate(mut center: [f64; 3], ball_radius: f64, gauge_error: f64) -> Option<([f64; 3], f64)> {
    let mut cycle = Calibration::new();
    for _ in 0..4 * ROUNDS {
        let [dx, dy, dz] = center;
        let done = match cycle.next() {
            Step::FindAxis => Done::AxisFound { x: 0.0 },
            Step::MoveToAxis => Done::MovedToAxis,
            Step::MountIndicator => Done::IndicatorMounted,
            Step::Rotate => {
                let reading = |index: u32| {
                    let angle = f64::from(index) / f64::from(ANGLES) * std::f64::consts::TAU;
                    (
                        angle,
                        probe_setup::quantised(dx * angle.cos() + dy * angle.sin(), DIVISION),
                    )
                };
                Done::Rotated {
                    readings: (0..ANGLES).map(reading).collect(),
                }
            }
            Step::Adjust => {
                let fit = cycle.indicator()?;
                center[0] -= fit.offset_x;
                center[1] -= fit.offset_y;
                Done::Adjusted {
                    x: -fit.offset_x,
                    y: -fit.offset_y,
                }
            }
            Step::StoreOffsets => Done::OffsetsStored,
            Step::BallRadius => {
                let x = ((GAUGE_RADIUS + ball_radius).powi(2) - dy * dy).sqrt() - dx;
                Done::ReferenceTouched {
                    x,
                    diameter: 2.0 * GAUGE_RADIUS + gauge_error,
                }
            }
            Step::Length => {
                center[2] = 0.0;
                Done::LengthTouched {
                    z: dz,
                    reference: 0.0,
                }
            }
            Step::Complete => {
                return Some((center, ball_radius - cycle.stored()?.ball_radius));
            }
        };
        cycle.report(&done).ok()?;
    }
    None
}
