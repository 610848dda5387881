//! The limit of the statistic for a stated rate of false alarms.
//!
//! The Shiryaev–Roberts statistic reaches a limit A after at least A sessions in the mean (Pollak 1985); the excess over the limit
//! makes that a multiple of A, the same one for all large limits (Pollak 1987). The multiple depends on the spread, is counted on
//! simulated series of the model without a change, at the times and with the uncertainties of the watched ones, and the limit
//! is made smaller by it.

use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::{Point, Spread, Watch};

/// Limit at which the simulated series are watched: some alarms in each, and the excess over it is that of larger limits.
const LIMIT: f64 = 100.0;
/// Points that are simulated in all; the multiple is then known to some per cent.
const POINTS: usize = 40_000;

/// Mean number of points to a false alarm over the limit of the statistic.
pub fn excess(alike: &[&[Point]], spread: &Spread) -> f64 {
    let each: usize = alike.iter().map(|points| points.len()).sum();
    if each == 0 {
        return 1.0;
    }
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let (mut alarms, mut points) = (0, 0);
    while points < POINTS {
        for times in alike {
            let mut watch = Watch::new(*spread, LIMIT);
            let quiet = quiet(times, spread, &mut random);
            alarms += quiet
                .iter()
                .filter(|point| watch.push(point).is_some())
                .count();
            points += times.len();
        }
    }
    points as f64 / (f64::from(u32::try_from(alarms.max(1)).unwrap_or(u32::MAX)) * LIMIT)
}

/// A series of the model without a change, at the times and with the uncertainties of another.
pub fn quiet(times: &[Point], spread: &Spread, random: &mut Pcg64Mcg) -> Vec<Point> {
    let errors = spread.errors();
    let (mut level, mut day) = (0.0, 0.0);
    let mut before: Option<f64> = None;
    let point = |point: &Point| {
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        if let Some(before) = before {
            level += (spread.walk * (point.time - before)).max(0.0).sqrt() * normal();
        }
        if before.is_none_or(|before| before.floor() < point.time.floor()) {
            day = spread.daily.sqrt() * normal();
        }
        before = Some(point.time);
        let error = normal();
        let error = errors.draw(error, random.random());
        Point {
            value: level + day + spread.variance(point).sqrt() * error,
            ..*point
        }
    };
    times.iter().map(point).collect()
}
