//! Sealed sessions drawn from the classes in which machines are measured: layout, causes, sizes, noise and what disturbs it all
//! come from a seed. Beside each stands what a plain least-squares expert leaves on withheld readings who knows its causes.

mod classes;

use std::f64::consts::TAU;

use diagnosis::Session;
use nalgebra::{DMatrix, DVector};

use super::Chance;

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Class {
    /// A linear axis against an interferometer.
    Axis,
    /// A plate of 640 holes.
    Plate,
    /// A tilted and bowed bed.
    Bed,
    /// A block that lies turned and shifted.
    Block,
    /// The same while something unknown acts.
    BlockAndUnknown,
    /// A spindle that warms over several days.
    Spindle,
    /// An arm followed by a tracker.
    Arm,
}

impl Class {
    pub(crate) const ALL: [Self; 7] = [
        Self::Axis,
        Self::Plate,
        Self::Bed,
        Self::Block,
        Self::BlockAndUnknown,
        Self::Spindle,
        Self::Arm,
    ];
}

/// A session, or several of one machine, with its truth.
pub(crate) struct Sealed {
    pub(crate) fit: Vec<Session>,
    pub(crate) withheld: Vec<Session>,
    /// Causes that must be named.
    pub(crate) causes: Vec<&'static str>,
    /// What may be named beside them: small, or another name of the same.
    pub(crate) allowed: Vec<&'static str>,
    /// Something outside the vocabulary acts.
    pub(crate) unknown: bool,
    /// Standard deviation of the readings, m.
    pub(crate) noise: f64,
    /// Rms that an expert leaves on withheld readings, m.
    pub(crate) expert: f64,
    /// Sizes of parameters whose convention leaves only the sign open: effect, parameter, SI.
    pub(crate) truths: Vec<(&'static str, &'static str, f64)>,
    /// For a person: what was drawn.
    pub(crate) drawn: String,
}

/// Seed of the session of a number in the set of a seed, as `examples/machines.rs` draws it.
pub(crate) fn seed_in_set(set: u64, number: u64) -> u64 {
    set.wrapping_mul(1_000_003).wrapping_add(number)
}

/// Draws a session of a class.
pub(crate) fn draw(class: Class, seed: u64) -> Sealed {
    let mut chance = Chance::new(seed);
    match class {
        Class::Axis => classes::axis(&mut chance),
        Class::Plate => classes::drilled(&mut chance),
        Class::Bed => classes::bed(&mut chance),
        Class::Block => classes::blocks(&mut chance, false),
        Class::BlockAndUnknown => classes::blocks(&mut chance, true),
        Class::Spindle => classes::spindle(&mut chance),
        Class::Arm => classes::tracked(&mut chance),
    }
}

fn between(chance: &mut Chance, low: f64, high: f64) -> f64 {
    low + (high - low) * chance.uniform()
}

/// Of either sign, its size log-uniform.
fn sized(chance: &mut Chance, least: f64, most: f64) -> f64 {
    let size = least * (most / least).powf(chance.uniform());
    if chance.uniform() < 0.5 { -size } else { size }
}

/// Noise as readings have it: white, larger in one half of them, or like that of the reading before; and stray ones.
struct Grain {
    deviation: f64,
    correlation: f64,
    uneven: f64,
    stray: f64,
}

impl Grain {
    fn draw(chance: &mut Chance, deviation: f64) -> Self {
        let kind = chance.uniform();
        Self {
            deviation,
            correlation: if kind > 0.75 { 0.5 } else { 0.0 },
            uneven: if (0.5..0.75).contains(&kind) {
                1.8
            } else {
                1.0
            },
            stray: if chance.uniform() < 0.25 { 0.012 } else { 0.0 },
        }
    }

    /// Errors of the readings of a session, m, one after the other in time; `noisier` are of larger deviation where it is
    /// uneven.
    fn errors(&self, chance: &mut Chance, session: &Session, noisier: &[bool]) -> Vec<f64> {
        let fresh = (1.0 - self.correlation * self.correlation).sqrt();
        let mut last = chance.normal();
        let stamp = |row: usize| {
            let at = &session.events[row].header.stamp;
            (at.sec, at.nanosec)
        };
        let mut order: Vec<usize> = (0..noisier.len()).collect();
        order.sort_by_key(|&row| stamp(row));
        let drawn: Vec<f64> = (order.iter())
            .map(|&row| {
                let more = noisier[row];
                last = self.correlation * last + fresh * chance.normal();
                let wider = if more { self.uneven } else { 1.0 };
                let off = if chance.uniform() < self.stray {
                    sized(chance, 15.0, 60.0)
                } else {
                    0.0
                };
                self.deviation * (wider * last + off)
            })
            .collect();
        let mut errors = vec![0.0; drawn.len()];
        for (row, error) in order.into_iter().zip(drawn) {
            errors[row] = error;
        }
        errors
    }
}

/// Displaces each reading along its normal: where an instrument saw it, or where a machine's slides X, Y, Z were read.
fn displace(session: &mut Session, instrument: bool, by: &[f64]) {
    let plan = session.plan.as_mut().unwrap();
    for ((point, event), by) in plan.points.iter_mut().zip(&mut session.events).zip(by) {
        let normal = [point.normal.x, point.normal.y, point.normal.z];
        if instrument {
            point.position.x += by * normal[0];
            point.position.y += by * normal[1];
            point.position.z += by * normal[2];
            event.tip = point.position;
        } else {
            for (axis, normal) in event.axis_positions.iter_mut().zip(normal) {
                *axis += by * normal;
            }
        }
    }
}

/// A smooth random function of unit size: a few waves of random direction and phase, none shorter than `length`.
fn smooth(chance: &mut Chance, length: f64) -> impl Fn(f64, f64) -> f64 + use<> {
    let waves: Vec<[f64; 4]> = (0..7)
        .map(|_| {
            let (about, phase) = (TAU * chance.uniform(), TAU * chance.uniform());
            let rate = TAU / length * between(chance, 0.1, 1.0);
            [
                rate * about.cos(),
                rate * about.sin(),
                phase,
                chance.normal(),
            ]
        })
        .collect();
    let power: f64 = waves.iter().map(|wave| 0.5 * wave[3] * wave[3]).sum();
    move |x, y| {
        let of = |[u, v, phase, a]: &[f64; 4]| a * (u * x + v * y + phase).sin();
        waves.iter().map(of).sum::<f64>() / power.sqrt()
    }
}

fn deviations(session: &Session) -> Vec<f64> {
    effects::observe(session).unwrap().deviations
}

/// What least squares of the true model leaves on readings withheld in runs of ten, m: the model is the layout itself, its
/// derivatives differences of layouts.
fn expert(
    model: &dyn Fn(&[f64]) -> Session,
    truth: &[f64],
    steps: &[f64],
    measured: &Session,
) -> f64 {
    let base = deviations(&model(truth));
    let error: Vec<f64> = (deviations(measured).iter().zip(&base))
        .map(|(measured, base)| measured - base)
        .collect();
    let columns: Vec<Vec<f64>> = (0..truth.len())
        .map(|own| {
            let mut other = truth.to_vec();
            other[own] += steps[own];
            let moved = deviations(&model(&other));
            moved.iter().zip(&base).map(|(a, b)| a - b).collect()
        })
        .collect();
    // Stray readings are left out by an expert, and judged by nobody.
    let mut sizes: Vec<f64> = error.iter().map(|value| value.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let bound = 7.0 * sizes[sizes.len() / 2];
    let fold = |row: usize| (row / 10) % 5;
    let mut left = Vec::new();
    for held in 0..5 {
        let usable = |row: &usize| error[*row].abs() < bound;
        let fit: Vec<usize> = (0..error.len())
            .filter(usable)
            .filter(|&row| fold(row) != held)
            .collect();
        let matrix = DMatrix::from_fn(fit.len(), columns.len(), |row, own| columns[own][fit[row]]);
        let right = DVector::from_iterator(fit.len(), fit.iter().map(|&row| error[row]));
        let found = matrix.svd(true, true).solve(&right, 1e-12).unwrap();
        for row in (0..error.len())
            .filter(usable)
            .filter(|&row| fold(row) == held)
        {
            let predicted: f64 = columns.iter().zip(&found).map(|(c, v)| c[row] * v).sum();
            left.push(error[row] - predicted);
        }
    }
    rms(&left)
}

fn sizes(values: &[f64]) -> String {
    let each = values.iter().map(|value| format!("{value:.1e}"));
    each.collect::<Vec<_>>().join(" ")
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}
