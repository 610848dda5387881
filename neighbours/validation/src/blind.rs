//! Blind sessions: a plant that shares no code with the signatures, measured by a made-up plan, with its truth sealed.
//!
//! The plant moves finite rigid bodies and solves every contact for the true ball on the true surface; its effects are
//! parametrised in other ways than the library's, some lie outside the vocabulary. Metres, radians, seconds, kelvins.
//! All randomness comes from the seed. Collisions, dynamics and drives are not modelled.

pub mod card;
mod causes;
mod given;
mod plant;
mod reach;
pub mod refine;
mod scene;

use probecell_msgs::InspectionPlan;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, Normal, StandardNormal};
use rand_pcg::Pcg64Mcg;

pub use causes::Cause;

use effects::session::perfect::with_nominal_touches;
use effects::session::{Session, SessionError};
use plant::Plant;
use scene::Scene;

/// Correlation of one touch's noise with the next one's in [`Content::Correlated`].
const CORRELATION: f64 = 0.7;
/// Draws of a cause asked for by name that may show in no touch, before any other outside the vocabulary is taken.
const FRUITLESS: usize = 60;
/// Share of stray touches in [`Content::Stray`].
const STRAY: f64 = 0.03;

/// What a blind session holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Content {
    /// Nothing but noise.
    Clean,
    /// This many effects of the vocabulary.
    Known(usize),
    /// Only something outside the vocabulary.
    Strange,
    /// One effect of the vocabulary and something outside it.
    Mixed,
    /// This many effects of the vocabulary, under noise that remembers the touch before.
    Correlated(usize),
    /// One effect of the vocabulary, and 3 % false touches.
    Stray,
    /// Something outside the vocabulary, under noise that remembers the touch before.
    StrangeCorrelated,
    /// This many effects of the vocabulary, and this outside it.
    Beside(usize, Outsider),
}

/// A cause outside the vocabulary that is asked for by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outsider {
    /// The stylus lies in one of two seats and changes between them now and then.
    LooseStylus,
    /// The part is displaced by a quadratic form of the place.
    QuadraticField,
    /// An axis runs over a bump.
    Bump,
}

impl Outsider {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::LooseStylus, Self::QuadraticField, Self::Bump];

    /// What it is called on a card.
    pub fn name(self) -> &'static str {
        match self {
            Self::LooseStylus => "a loose stylus",
            Self::QuadraticField => "a quadratic field",
            Self::Bump => "a bump on an axis",
        }
    }
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
    /// Parameters of each effect as a report names them, in its units; only those that mean the same there.
    pub parameters: Vec<Vec<(String, f64)>>,
    /// Name of the machine.
    pub machine: String,
}

/// The machine, part and plan on which sessions are made.
#[derive(Debug, Clone, Default)]
pub struct Stage {
    given: Option<Scene>,
    /// Touches of a plan that is made up; drawn where there is none.
    touches: Option<usize>,
}

impl Stage {
    /// Machines, parts and plans made up anew for each session.
    pub fn made_up() -> Self {
        Self::default()
    }

    /// The same with plans of this many touches.
    pub fn made_up_with(touches: usize) -> Self {
        Self {
            touches: Some(touches),
            ..Self::default()
        }
    }

    /// Those of a session: its description, its plan, and when each point was touched. What its touches found is not
    /// looked at; a plan that was not measured yet is taken as measured in its order.
    ///
    /// # Errors
    /// [`SessionError`] for a session that could not be diagnosed either.
    pub fn of(session: &Session) -> Result<Self, SessionError> {
        Ok(Self {
            given: Some(given::scene(&with_nominal_touches(session)?)?),
            touches: None,
        })
    }
}

/// What is hidden in a session, before anything is measured.
struct Hidden {
    scene: Scene,
    causes: Vec<Cause>,
    sizes: Vec<f64>,
    noise: f64,
}

/// Measures another plan of the part of [`session`] after it, with the same causes at work; `salt` draws the noise.
pub fn measure(seed: u64, content: Content, plan: &InspectionPlan, salt: u64) -> Session {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let Hidden {
        scene,
        causes,
        noise,
        ..
    } = hide(&Stage::made_up(), &mut random, content);
    let planned = scene.touches.len();
    let scene = scene.with(plan);
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ salt.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let errors: Vec<f64> = (0..scene.touches.len())
        .map(|_| noise * random.sample::<f64, _>(StandardNormal))
        .collect();
    Plant::further(&scene, &causes, planned).measured(seed, &errors, plan)
}

/// Makes a session and its truth from a seed, on a machine made up for it.
pub fn session(seed: u64, content: Content) -> (Session, Truth) {
    session_on(&Stage::made_up(), seed, content)
}

/// Makes a session and its truth from a seed.
pub fn session_on(stage: &Stage, seed: u64, content: Content) -> (Session, Truth) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let Hidden {
        scene,
        causes,
        sizes,
        noise,
    } = hide(stage, &mut random, content);
    let errors = errors(&mut random, content, noise, scene.touches.len());
    let session = Plant::new(&scene, &causes).session(seed, &errors);
    let effects = causes.iter().map(Cause::id).collect();
    let span = scene.touches.last().map_or(1.0, |last| last.time);
    let parameters = causes.iter().map(|cause| cause.parameters(span)).collect();
    (
        session,
        Truth {
            effects,
            noise,
            sizes,
            parameters,
            machine: scene.machine.clone(),
        },
    )
}

fn hide(stage: &Stage, random: &mut Pcg64Mcg, content: Content) -> Hidden {
    let made_up = || Scene::random(random, stage.touches);
    let scene = stage.given.clone().unwrap_or_else(made_up);
    let noise = 10.0_f64.powf(random.random_range(-6.4..-5.7));
    let (known, strange) = match content {
        Content::Clean => (0, 0),
        Content::Known(count) | Content::Correlated(count) => (count, 0),
        Content::Strange | Content::StrangeCorrelated => (0, 1),
        Content::Mixed => (1, 1),
        Content::Stray => (1, 0),
        Content::Beside(count, _) => (count, 1),
    };
    let asked = match content {
        Content::Beside(_, outsider) => Some(outsider),
        _ => None,
    };
    let mut causes: Vec<Cause> = Vec::new();
    let mut sizes = Vec::new();
    let still = Plant::new(&scene, &[]).deviations();
    let mut fruitless = 0;
    while causes.len() < known + strange {
        let outside = causes.len() >= known;
        let mut cause = match (outside, asked) {
            (false, _) => Cause::random(random, &scene, false),
            (true, Some(outsider)) if fruitless < FRUITLESS => {
                fruitless += 1;
                Cause::outsider(random, &scene, outsider)
            }
            (true, _) => Cause::random(random, &scene, true),
        };
        if causes.iter().any(|other| other.id() == cause.id()) || !cause.shows_as_itself(&scene) {
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
    Hidden {
        scene,
        causes,
        sizes,
        noise,
    }
}

/// Errors of the touches, m, in their order.
fn errors(random: &mut Pcg64Mcg, content: Content, noise: f64, count: usize) -> Vec<f64> {
    let normal = Normal::new(0.0, noise)
        .unwrap_or_else(|_| unreachable!("the noise is finite and positive"));
    let mut errors: Vec<f64> = (0..count).map(|_| normal.sample(random)).collect();
    match content {
        Content::Correlated(_) | Content::StrangeCorrelated => {
            let fresh = (1.0 - CORRELATION * CORRELATION).sqrt();
            for index in 1..count {
                errors[index] = CORRELATION * errors[index - 1] + fresh * errors[index];
            }
        }
        Content::Stray => {
            for error in &mut errors {
                if random.random_bool(STRAY) {
                    *error += 10.0_f64.powf(random.random_range(-4.7..-4.0));
                }
            }
        }
        _ => {}
    }
    errors
}
