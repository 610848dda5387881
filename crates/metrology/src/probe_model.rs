//! Models what a touch probe on a turn-mill reads of turned diameters and of flats, and the loop closed on it.
//!
//! Lengths in m; X is read as diameter. `docs/source_systems.md, A.3`: ball radius r against the stored r_c, error δx
//! of the ball centre's stored X position, offset δy of the ball centre from the spindle axis. Both kinds of feature
//! carry the same error 2e, e = (r − r_c) − δx; only round ones see δy. No pretravel, lobing or form of the part.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A probe as it is and as the controller believes it to be, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Probe {
    /// r: ball radius.
    pub radius: f64,
    /// r_c: stored ball radius.
    pub stored_radius: f64,
    /// δx: X position of the ball centre relative to the stored one.
    pub offset_x: f64,
    /// δy: Y offset of the ball centre from the spindle axis.
    pub offset_y: f64,
}

/// The ball misses the part.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error(
    "a ball {offset} m off the axis does not touch a part of radius plus ball radius {reach} m"
)]
pub struct ProbeMiss {
    /// |δy| in m.
    pub offset: f64,
    /// D/2 + r in m.
    pub reach: f64,
}

impl Probe {
    /// e = (r − r_c) − δx in m: half of what every size reads too large.
    pub fn size_error(&self) -> f64 {
        (self.radius - self.stored_radius) - self.offset_x
    }

    /// x_touch in m: machine X (as radius) at which the ball touches the turned diameter `diameter` from +X.
    ///
    /// # Errors
    /// The ball misses the part.
    pub fn touch_x(&self, diameter: f64) -> Result<f64, ProbeMiss> {
        let reach = diameter / 2.0 + self.radius;
        let square = reach * reach - self.offset_y * self.offset_y;
        if reach > 0.0 && square >= 0.0 {
            Ok(square.sqrt() - self.offset_x)
        } else {
            Err(ProbeMiss {
                offset: self.offset_y.abs(),
                reach,
            })
        }
    }

    /// D_read = 2(x_touch − r_c) in m of a turned diameter.
    ///
    /// # Errors
    /// The ball misses the part.
    pub fn read_diameter(&self, diameter: f64) -> Result<f64, ProbeMiss> {
        Ok(2.0 * (self.touch_x(diameter)? - self.stored_radius))
    }

    /// L_read = (x₁ − r_c) + (x₂ − r_c) in m of a distance `across` two flats, touched by the same side of the ball
    /// before and after C has turned by half a turn.
    pub fn read_flats(&self, across: f64) -> f64 {
        across + 2.0 * self.size_error()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A.3: δy = 0.5, r = 3 mm: −19.4 µm on D1, −17.0 on D2, 0 on flats.
    #[test]
    fn an_offset_in_y_shows_on_round_features_only() {
        let probe = Probe {
            radius: 3e-3,
            stored_radius: 3e-3,
            offset_y: 0.5e-3,
            ..Probe::default()
        };
        for (diameter, printed) in [(19.8e-3, -19.4e-6), (23.5e-3, -17.0e-6)] {
            let error = probe.read_diameter(diameter).unwrap() - diameter;
            assert!((error - printed).abs() < 0.05e-6, "{error:e}");
            let approximate = -probe.offset_y.powi(2) / (diameter / 2.0 + probe.radius);
            assert!((error - approximate).abs() < 0.02e-6);
        }
        assert_eq!(probe.read_flats(17.8e-3), 17.8e-3);
    }

    #[test]
    fn radius_and_x_errors_hit_turned_and_milled_sizes_alike() {
        let probe = Probe {
            radius: 3.010e-3,
            stored_radius: 3e-3,
            offset_x: -25.5e-6,
            offset_y: 0.0,
        };
        assert!((probe.size_error() - 35.5e-6).abs() < 1e-15);
        for size in [19.8e-3, 23.5e-3, 17.8e-3] {
            assert!((probe.read_diameter(size).unwrap() - size - 71e-6).abs() < 1e-15);
            assert!((probe.read_flats(size) - size - 71e-6).abs() < 1e-15);
        }
    }

    #[test]
    fn a_ball_beside_the_part_reads_nothing() {
        let probe = Probe {
            radius: 3e-3,
            stored_radius: 3e-3,
            offset_y: 20e-3,
            ..Probe::default()
        };
        assert!(probe.read_diameter(19.8e-3).is_err());
        assert!(probe.read_diameter(f64::NAN).is_err());
    }
}
