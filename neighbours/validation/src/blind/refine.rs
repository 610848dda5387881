//! What eight further touches are worth: chosen ones against random and repeated ones, on sealed sessions.
//!
//! Right and sure: one explanation has more than 0.95 of the posterior, and it is exactly what is hidden. Effects that no
//! touch within reach parts count as one, for all arms alike. Further touches are measured by the same plant under the
//! same hidden truth.

use rand::SeedableRng;
use rand::seq::index::sample;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

use super::{Content, Truth, measure, session};
use diagnosis::report::{Explanation, Report};
use diagnosis::{Options, diagnose};
use effects::session::joined::join;
use effects::session::{Session, SessionError};
use experiment::next::{Effort, ProposalOptions, random_plan};
use probecell_msgs::InspectionPlan;

/// Probability above which a name is sure.
const SURE: f64 = 0.95;
/// Keeps the draw of repeated points apart from the other draws of a seed.
const REPEATED: u64 = 0x5a5a_1972;

/// Whether a session was right and sure.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Arms {
    /// With the touches proposed.
    pub chosen: bool,
    /// With as many random ones, rich in feeds and positions.
    pub random: bool,
    /// With as many more of the same plan.
    pub same: bool,
}

/// One sealed session and what further touches made of it.
#[derive(Debug, Clone, Serialize)]
pub struct Trial {
    /// Seed of the session.
    pub seed: u64,
    /// Effects hidden.
    pub hidden: Vec<String>,
    /// Right and sure as measured at first.
    pub start: bool,
    /// Right and sure with the touches of each arm.
    #[serde(flatten)]
    pub sure: Arms,
    /// The chance that the proposal promised; absent when nothing was proposed.
    pub promised: Option<f64>,
    /// Explanations at first, most probable first.
    pub before: Vec<Explanation>,
    /// The same after the touches proposed.
    pub after: Vec<Explanation>,
}

/// Makes a session, and where it is not right and sure measures `touches` more in three ways.
///
/// # Errors
/// [`SessionError`] when a made session cannot be diagnosed.
pub fn trial(seed: u64, content: Content, touches: usize) -> Result<Trial, SessionError> {
    let (sealed, truth) = session(seed, content);
    let options = Options {
        next: ProposalOptions {
            touches,
            effort: Effort::Thorough,
        },
        ..Options::default()
    };
    let before = diagnose(&sealed, &options)?;
    let proposed = before.next_measurement.first();
    let equals = proposed.map_or(Vec::new(), |next| next.inseparable.clone());
    let right = |report: &Report| right_and_sure(report, &truth, &equals);
    let mut trial = Trial {
        seed,
        hidden: truth.effects.clone(),
        start: right(&before),
        sure: Arms {
            chosen: true,
            random: true,
            same: true,
        },
        promised: proposed.map(|next| next.chance),
        before: belief(&before),
        after: belief(&before),
    };
    if trial.start {
        return Ok(trial);
    }
    let after = |plan: Option<InspectionPlan>, salt: u64| -> Result<Report, SessionError> {
        let Some(plan) = plan else {
            return Ok(before.clone());
        };
        let further = measure(seed, content, &plan, salt);
        diagnose(&join(&sealed, &further)?, &options)
    };
    let report = after(proposed.and_then(|next| next.plan.clone()), 1)?;
    trial.sure.chosen = right(&report);
    trial.after = belief(&report);
    trial.sure.random = right(&after(random_plan(&sealed, touches, seed)?, 2)?);
    trial.sure.same = right(&after(repeated(&sealed, touches, seed), 3)?);
    Ok(trial)
}

/// The explanations that are possible; a report that doubts nothing has one.
fn belief(report: &Report) -> Vec<Explanation> {
    let named = || report.effects.iter().map(|effect| effect.effect.clone());
    report.next_measurement.first().map_or_else(
        || {
            vec![Explanation {
                effects: named().collect(),
                probability: 1.0,
            }]
        },
        |next| next.explanations.clone(),
    )
}

fn right_and_sure(report: &Report, truth: &Truth, equals: &[Vec<String>]) -> bool {
    let Some(Explanation {
        effects: named,
        probability,
    }) = belief(report).into_iter().next()
    else {
        return false;
    };
    let one = |a: &String, b: &String| {
        a == b
            || equals
                .iter()
                .any(|pair| pair.contains(a) && pair.contains(b))
    };
    probability > SURE
        && named.len() == truth.effects.len()
        && (truth.effects.iter()).all(|hidden| named.iter().any(|effect| one(effect, hidden)))
}

/// Points of the plan again, as they were.
fn repeated(session: &Session, touches: usize, seed: u64) -> Option<InspectionPlan> {
    let plan = session.plan.as_ref()?;
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ REPEATED);
    let count = plan.points.len();
    let points = sample(&mut random, count, touches.min(count));
    Some(InspectionPlan {
        points: points
            .iter()
            .map(|index| plan.points[index].clone())
            .collect(),
        ..plan.clone()
    })
}
