//! Blind sessions: a plant that shares no code with the signatures, measured by a made-up plan, with its truth sealed.
//!
//! The plant moves finite rigid bodies and solves every contact for the true ball on the true surface; its effects are
//! parametrised in other ways than the library's, some lie outside the vocabulary. Metres, radians, seconds, kelvins.
//! All randomness comes from the seed. Collisions, dynamics and drives are not modelled.

mod causes;
mod plant;
mod scene;

use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

pub use causes::Cause;

use crate::session::Session;
use plant::Plant;
use scene::Scene;

/// What a blind session holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// Nothing but noise.
    Clean,
    /// This many effects of the vocabulary.
    Known(usize),
    /// Only something outside the vocabulary.
    Strange,
    /// One effect of the vocabulary and something outside it.
    Mixed,
}

/// What was hidden in a session.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Identifiers; those outside the vocabulary begin with `x.`.
    pub effects: Vec<String>,
    /// Standard deviation of the noise, m.
    pub noise: f64,
    /// Root mean square of each effect's own signature, m.
    pub sizes: Vec<f64>,
    /// Name of the machine.
    pub machine: String,
}

/// Makes a session and its truth from a seed.
pub fn session(seed: u64, content: Content) -> (Session, Truth) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let scene = Scene::random(&mut random);
    let noise = 10.0_f64.powf(random.random_range(-6.4..-5.7));
    let (known, strange) = match content {
        Content::Clean => (0, 0),
        Content::Known(count) => (count, 0),
        Content::Strange => (0, 1),
        Content::Mixed => (1, 1),
    };
    let mut causes: Vec<Cause> = Vec::new();
    let mut sizes = Vec::new();
    let still = Plant::new(&scene, &[]).deviations();
    while causes.len() < known + strange {
        let outside = causes.len() >= known;
        let mut cause = Cause::random(&mut random, &scene, outside);
        if causes.iter().any(|other| other.id() == cause.id()) {
            continue;
        }
        let wanted = noise * 10.0_f64.powf(random.random_range(0.5..1.4));
        let mut size = 0.0;
        for _ in 0..3 {
            let moved = Plant::new(&scene, std::slice::from_ref(&cause)).deviations();
            let sum: f64 = moved
                .iter()
                .zip(&still)
                .map(|(one, other)| (one - other).powi(2))
                .sum();
            size = (sum / moved.len() as f64).sqrt();
            if size < 1e-12 {
                break;
            }
            cause.resize(wanted / size);
        }
        if size > 0.5 * wanted && size < 2.0 * wanted && cause.sensible() {
            sizes.push(size);
            causes.push(cause);
        }
    }
    let normal = Normal::new(0.0, noise)
        .unwrap_or_else(|_| unreachable!("the noise is finite and positive"));
    let errors: Vec<f64> = (0..scene.touches.len())
        .map(|_| normal.sample(&mut random))
        .collect();
    let session = Plant::new(&scene, &causes).session(seed, &errors);
    let effects = causes.iter().map(Cause::id).collect();
    (
        session,
        Truth {
            effects,
            noise,
            sizes,
            machine: scene.machine.clone(),
        },
    )
}
