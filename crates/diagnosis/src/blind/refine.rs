//! What eight further touches are worth: chosen ones against random and repeated ones, on sealed sessions.
//!
//! "Right and sure" is strict: every hidden effect named by its own name and nothing else, each with more than 0.95 and
//! no equal left, and the verdict right. Further touches are measured by the same plant under the same hidden truth.

use rand::seq::index::sample;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

use super::{Content, Truth, measure, session};
use crate::diagnose::{Options, diagnose};
use crate::joined::join;
use crate::next::{Effort, Wish, random_plan};
use crate::report::{Report, Verdict};
use crate::session::{DiagnoseError, Session};
use probecell_msgs::InspectionPlan;

/// Probability above which a name is sure.
const SURE: f64 = 0.95;
/// Keeps the draw of repeated points apart from the other draws of a seed.
const REPEATED: u64 = 0x5a5a_1972;

/// One sealed session and what further touches made of it.
#[derive(Debug, Clone, Serialize)]
pub struct Trial {
    /// Seed of the session.
    pub seed: u64,
    /// Effects hidden.
    pub hidden: Vec<String>,
    /// Right and sure as measured at first.
    pub start: bool,
    /// The chance that the proposal promised; absent when nothing was proposed.
    pub promised: Option<f64>,
    /// Right and sure with the touches proposed.
    pub chosen: bool,
    /// Right and sure with as many random ones, rich in feeds and positions.
    pub random: bool,
    /// Right and sure with as many more of the same plan.
    pub same: bool,
    /// The verdict after the touches proposed is sure of one explanation, right or not.
    pub chosen_sure: bool,
}

/// Makes a session, and where it is not right and sure measures `touches` more in three ways.
///
/// # Errors
/// [`DiagnoseError`] when a made session cannot be diagnosed.
pub fn trial(seed: u64, content: Content, touches: usize) -> Result<Trial, DiagnoseError> {
    let (sealed, truth) = session(seed, content);
    let plain = Options::default();
    let before = diagnose(&sealed, &plain)?;
    let start = right_and_sure(&before, &truth);
    let mut trial = Trial {
        seed,
        hidden: truth.effects.clone(),
        start,
        promised: None,
        chosen: start,
        random: start,
        same: start,
        chosen_sure: is_sure(&before),
    };
    if start {
        return Ok(trial);
    }
    let wish = Wish {
        touches,
        effort: Effort::Thorough,
    };
    let options = Options {
        next: wish,
        ..Options::default()
    };
    let after = |plan: Option<InspectionPlan>, salt: u64| -> Result<Report, DiagnoseError> {
        let Some(plan) = plan else {
            return Ok(before.clone());
        };
        let further = measure(seed, content, &plan, salt);
        diagnose(&join(&sealed, &further)?, &plain)
    };
    let proposed = diagnose(&sealed, &options)?.next_measurement;
    let first = proposed.into_iter().next();
    trial.promised = first.as_ref().map(|next| next.chance);
    let report = after(first.and_then(|next| next.plan), 1)?;
    trial.chosen = right_and_sure(&report, &truth);
    trial.chosen_sure = is_sure(&report);
    let random = random_plan(&sealed, touches, seed)?;
    trial.random = right_and_sure(&after(random, 2)?, &truth);
    let same = repeated(&sealed, touches, seed);
    trial.same = right_and_sure(&after(same, 3)?, &truth);
    Ok(trial)
}

fn is_sure(report: &Report) -> bool {
    report
        .effects
        .iter()
        .all(|effect| effect.probability > SURE && effect.indistinguishable_from.is_empty())
}

fn right_and_sure(report: &Report, truth: &Truth) -> bool {
    let verdict = if truth.effects.is_empty() {
        Verdict::NoGap
    } else {
        Verdict::Explained
    };
    report.verdict == verdict
        && report.effects.len() == truth.effects.len()
        && is_sure(report)
        && report
            .effects
            .iter()
            .all(|effect| truth.effects.contains(&effect.effect))
}

/// Points of the plan again, as they were.
fn repeated(session: &Session, touches: usize, seed: u64) -> Option<InspectionPlan> {
    let plan = session.plan.as_ref()?;
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ REPEATED);
    let count = plan.points.len();
    let points = sample(&mut random, count, touches.min(count));
    Some(InspectionPlan {
        points: points.iter().map(|index| plan.points[index].clone()).collect(),
        ..plan.clone()
    })
}
