//! Times the fits at 1e3 to 1e6 points: `cargo bench -p metrology`. `benches/scipy_fits.py` runs SciPy beside it.
//!
//! Prints one line per shape and size: shape, points, seconds (the fastest of several runs). `-- cone 1000` does only
//! that shape, at that size.

use std::io::Write;
use std::time::Instant;

use metrology::fit::{self, Point};
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;

/// Points on a feature of radius 20 mm, height 50 mm, three quarters of a turn, noise 3 µm, tilted and off the origin.
fn points(shape: &str, n: usize) -> Vec<Point> {
    let mut rng = Pcg64::seed_from_u64(n as u64);
    let noise = Normal::new(0.0, 3e-6).expect("a deviation");
    let tilt = nalgebra::Rotation3::new(Point::new(0.3, -0.5, 0.2));
    (0..n)
        .map(|_| {
            let angle = rng.random_range(0.0..4.7_f64);
            let z = rng.random_range(-0.025..0.025);
            let e = noise.sample(&mut rng);
            let (sin, cos) = angle.sin_cos();
            let local = match shape {
                "plane" => Point::new(0.02 * cos, z, e),
                "circle" => Point::new((0.02 + e) * cos, (0.02 + e) * sin, noise.sample(&mut rng)),
                "sphere" => Point::new(cos, sin, 20.0 * z).normalize() * (0.02 + e),
                "cylinder" => Point::new((0.02 + e) * cos, (0.02 + e) * sin, z),
                _ => Point::new((0.02 + 0.3 * z + e) * cos, (0.02 + 0.3 * z + e) * sin, z),
            };
            tilt * local + Point::new(0.1, 0.2, 0.05)
        })
        .collect()
}

fn main() -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    let mut wanted = std::env::args().skip(1).filter(|word| word != "--bench");
    let (only_shape, only_size) = (wanted.next(), wanted.next());
    for shape in ["plane", "circle", "sphere", "cylinder", "cone"] {
        for n in [1_000, 10_000, 100_000, 1_000_000_usize] {
            if only_shape.as_ref().is_some_and(|only| only != shape)
                || only_size
                    .as_ref()
                    .is_some_and(|only| *only != n.to_string())
            {
                continue;
            }
            let points = points(shape, n);
            let fastest = (0..3 + 30_000 / n)
                .map(|_| {
                    let begin = Instant::now();
                    let rms = match shape {
                        "plane" => fit::plane(&points).map(|f| f.rms),
                        "circle" => fit::circle(&points).map(|f| f.rms),
                        "sphere" => fit::sphere(&points).map(|f| f.rms),
                        "cylinder" => fit::cylinder(&points).map(|f| f.rms),
                        _ => fit::cone(&points).map(|f| f.rms),
                    };
                    let elapsed = begin.elapsed().as_secs_f64();
                    // A fit that failed fast is no time.
                    if rms.is_ok_and(|rms| rms < 1e-5) {
                        elapsed
                    } else {
                        f64::NAN
                    }
                })
                .fold(f64::INFINITY, f64::min);
            writeln!(out, "{shape} {n} {fastest:.6}")?;
        }
    }
    Ok(())
}
