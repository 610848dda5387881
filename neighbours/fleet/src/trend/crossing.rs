//! When a level that grows will leave its tolerance.

use metrology::statistics::normal_cdf;

use super::filter::Level;
use super::spread::Spread;

/// Farthest that is looked ahead, days.
const HORIZON: f64 = 3650.0;

/// Days from now until the level is beyond its limit with a probability of 2.5 %, 50 % and 97.5 %; infinite where that is
/// not within ten years.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// 2.5 %.
    pub earliest: f64,
    /// 50 %.
    pub expected: f64,
    /// 97.5 %.
    pub latest: f64,
}

/// The crossing of |level| = `limit` (in its unit) by a level with this spread; what a day adds is left out.
pub fn crossing(level: &Level, spread: &Spread, limit: f64) -> Crossing {
    let beyond = |days: f64| {
        let then = level.at(level.time + days, spread);
        let deviation = then.covariance[0].max(0.0).sqrt().max(f64::MIN_POSITIVE);
        normal_cdf((then.level - limit) / deviation) + normal_cdf((-limit - then.level) / deviation)
    };
    Crossing {
        earliest: first(&beyond, 0.025),
        expected: first(&beyond, 0.5),
        latest: first(&beyond, 0.975),
    }
}

/// The first day on which a probability is reached: by steps that grow, then by halving.
fn first(beyond: &dyn Fn(f64) -> f64, probability: f64) -> f64 {
    if beyond(0.0) >= probability {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, 1.0);
    while beyond(high) < probability {
        low = high;
        high *= 1.2;
        if high > HORIZON {
            return f64::INFINITY;
        }
    }
    for _ in 0..50 {
        let middle = f64::midpoint(low, high);
        if beyond(middle) >= probability {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a slope that is known exactly, the quantiles of the level's error are those of the time (Φ⁻¹(0.975) = 1.959964).
    #[test]
    fn a_known_slope_crosses_when_the_line_does() {
        let level = Level {
            time: 10.0,
            level: 2.0,
            slope: 0.5,
            covariance: [0.01, 0.0, 0.0],
            day: [0.0; 4],
        };
        let found = crossing(&level, &Spread::NONE, 7.0);
        assert!((found.expected - 10.0).abs() < 1e-6);
        assert!((found.earliest - (10.0 - 1.959964 * 0.1 / 0.5)).abs() < 1e-5);
        assert!((found.latest - (10.0 + 1.959964 * 0.1 / 0.5)).abs() < 1e-5);
        let still = Level {
            slope: 0.0,
            ..level
        };
        assert_eq!(crossing(&still, &Spread::NONE, 7.0).expected, f64::INFINITY);
        let down = Level {
            slope: -0.5,
            ..level
        };
        assert!((crossing(&down, &Spread::NONE, 7.0).expected - 18.0).abs() < 1e-6);
    }
}
