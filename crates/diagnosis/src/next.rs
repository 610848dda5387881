//! What to measure next: a few touches that resolve explanations which are still possible.
//!
//! The explanations are the probable sets of effects, their equals in this session, no gap and the unknown
//! ([`crate::design`]). Touches come from the plan's own features; chosen are those with the most expected information
//! (after Box and Hill 1967) that the axes reach and the stylus gets to without hitting the part. The answer is a plan a
//! cell can run, with the predicted chance to resolve. It only proposes: what is measured is the operator's word.

use machine::access::{Access, Aim, CLEAR};
use probecell_msgs::{InspectionPlan, InspectionPoint};
use rand::SeedableRng;
use rand::seq::index::sample;
use rand_pcg::Pcg64Mcg;

use crate::attribution::{Attribution, Model};
use crate::design::candidates::{Breadth, candidates};
use crate::design::hypotheses::{Posterior, Source, UNKNOWN};
use crate::design::imagined::{Imagined, Wanted};
use crate::design::information::{Prediction, SURE, chance, choose};
use crate::effects::Variant;
use crate::joined::FURTHER;
use crate::observation::{Observations, Row};
use crate::report::{Effect, Explanation, NextMeasurement, NextPoint};
use crate::session::{DiagnoseError, Session};

/// Classes under this probability are not named among what the touches part.
const WORTH_NAMING: f64 = 0.02;
/// Angles by which a thorough search turns each prescribed axis beside half a turn, rad.
const TURNS: &[f64] = &[0.35, 1.05];
/// How often what is hidden is among the explanations and predicted rightly, where something is in doubt: of 33 unsure
/// blind sessions 22 were resolved, where the explanations alone promised 28.
const AMONG_THEM: f64 = 0.8;
/// Explanations told.
const TOLD: usize = 6;
/// Names told.
const NAMED: usize = 8;

/// How much is spent on the search for touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Effort {
    /// A small set of candidates, chosen one by one: a few milliseconds.
    #[default]
    Quick,
    /// Many candidates, and each choice tried again: for a proposal that will be measured.
    Thorough,
}

/// What is wanted of a proposal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wish {
    /// Most touches.
    pub touches: usize,
    /// How much is spent.
    pub effort: Effort,
}

impl Default for Wish {
    fn default() -> Self {
        Self {
            touches: 8,
            effort: Effort::Quick,
        }
    }
}

struct Limits {
    breadth: Breadth,
    explanations: usize,
    exchanges: usize,
    draws: usize,
}

impl Effort {
    fn limits(self) -> Limits {
        let breadth = |places, positions, turns| Breadth {
            places,
            positions,
            turns,
        };
        match self {
            Self::Quick => Limits {
                breadth: breadth(9, 2, &[]),
                explanations: 12,
                exchanges: 0,
                draws: 400,
            },
            Self::Thorough => Limits {
                breadth: breadth(20, 4, TURNS),
                explanations: 24,
                exchanges: 2,
                draws: 4000,
            },
        }
    }
}

/// A session as far as the attribution got.
pub(crate) struct Known<'a> {
    pub(crate) plan: Option<&'a InspectionPlan>,
    pub(crate) observations: &'a Observations,
    pub(crate) variants: &'a [Variant],
    pub(crate) attribution: &'a Attribution,
}

/// Touches that resolve what is not sure; nothing where all is. `set` holds the candidates of the first `effects`.
pub(crate) fn propose(
    known: &Known<'_>,
    set: &[usize],
    effects: &[Effect],
    wish: Wish,
) -> Vec<NextMeasurement> {
    // Who asks for a thorough proposal wants one even where little is in doubt.
    let sure = is_sure(known, set, effects);
    let wanted = wish.effort == Effort::Thorough || !sure;
    let Some(plan) = known.plan.filter(|_| wanted) else {
        return Vec::new();
    };
    let limits = wish.effort.limits();
    let wanted = candidates(known.observations, plan, limits.breadth);
    let imagined = Imagined::new(known.observations, plan, wanted);
    let source = Source {
        imagined: &imagined,
        variants: known.variants,
        attribution: known.attribution,
    };
    let posterior = source.posterior(set, effects, limits.explanations);
    let shares = shares(&posterior);
    let sure_now = shares.iter().copied().fold(0.0, f64::max);
    let told =
        |points: Vec<NextPoint>, plan: Option<InspectionPlan>, chance: f64| NextMeasurement {
            separates: separates(&posterior, &shares),
            points,
            plan,
            explanations: explanations(&posterior, &shares),
            chance,
            inseparable: posterior.equals.iter().map(|pair| pair.to_vec()).collect(),
        };
    let access = access(known.observations, plan);
    let mut answers: Vec<Option<bool>> = vec![None; imagined.wanted.len()];
    let mut allowed = |place: usize| {
        *answers[place].get_or_insert_with(|| access.allows(&aim(&imagined.rows()[place])))
    };
    let chosen = choose(
        &posterior.predictions,
        wish.touches,
        limits.exchanges,
        &mut allowed,
    );
    let nothing = chosen.is_empty() && posterior.equals.is_empty();
    if nothing && wish.effort == Effort::Quick {
        return Vec::new();
    }
    if chosen.is_empty() {
        let already = if sure_now > SURE { 1.0 } else { 0.0 };
        return vec![told(Vec::new(), None, already)];
    }
    let leading = leading(&posterior, &shares);
    let points = chosen
        .iter()
        .map(|&place| point(known.observations, &imagined.wanted[place], leading, place));
    let touches = chosen.iter().map(|&place| &imagined.wanted[place]);
    vec![told(
        points.collect(),
        Some(runnable(plan, touches)),
        if sure { 1.0 } else { AMONG_THEM } * chance(&posterior.predictions, &chosen, limits.draws),
    )]
}

/// As many touches drawn at random from the candidates of a thorough search, all allowed: what a proposal is judged by.
///
/// # Errors
/// [`DiagnoseError`] for a session that cannot be used.
pub fn random_plan(
    session: &Session,
    touches: usize,
    seed: u64,
) -> Result<Option<InspectionPlan>, DiagnoseError> {
    let observations = Observations::from_session(session)?;
    let Some(plan) = &session.plan else {
        return Ok(None);
    };
    let wanted = candidates(&observations, plan, Effort::Thorough.limits().breadth);
    let imagined = Imagined::new(&observations, plan, wanted);
    let access = access(&observations, plan);
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let count = imagined.wanted.len();
    let drawn: Vec<&Wanted> = sample(&mut random, count, count)
        .iter()
        .filter(|&place| access.allows(&aim(&imagined.rows()[place])))
        .take(touches)
        .map(|place| &imagined.wanted[place])
        .collect();
    Ok((!drawn.is_empty()).then(|| runnable(plan, drawn.into_iter())))
}

/// What is known of access from the touches of a session.
fn access<'a>(observations: &'a Observations, plan: &InspectionPlan) -> Access<'a> {
    let touches = &observations.rows[..observations.touches()];
    let met: Vec<Aim> = touches.iter().map(aim).collect();
    Access::new(&observations.chain, &observations.nominal, plan, &met)
}

fn aim(row: &Row) -> Aim {
    Aim {
        feature: row.feature,
        position: row.position,
        normal: row.normal,
        surface: row.surface,
        positions: row.pose.as_ref().map(|pose| pose.positions.clone()),
    }
}

/// One explanation is as probable as it needs to be, and nothing is its equal.
fn is_sure(known: &Known<'_>, set: &[usize], effects: &[Effect]) -> bool {
    let attribution = known.attribution;
    let names = |set: &[usize]| {
        let of = |&place: &usize| &known.variants[attribution.candidates[place].variant].effect;
        let mut names: Vec<&String> = set.iter().map(of).collect();
        names.sort();
        names
    };
    let own = names(set);
    let share = |unknown: bool| -> f64 {
        let same =
            |model: &&Model| attribution.is_unknown(model) == unknown && names(&model.set) == own;
        let models = attribution.models.iter().filter(same);
        models.map(|model| model.probability).sum()
    };
    let alone = effects
        .iter()
        .all(|effect| effect.indistinguishable_from.is_empty());
    alone && share(false).max(share(true)) > SURE
}

fn shares(posterior: &Posterior) -> Vec<f64> {
    let mut shares = vec![0.0; posterior.classes.len()];
    for own in &posterior.predictions {
        shares[own.class] += own.weight;
    }
    shares
}

/// Classes by probability, the first of equals first.
fn order(shares: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..shares.len()).collect();
    order.sort_by(|&one, &other| shares[other].total_cmp(&shares[one]).then(one.cmp(&other)));
    order
}

/// The strongest explanation of each of the two most probable classes.
fn leading<'a>(
    posterior: &'a Posterior,
    shares: &[f64],
) -> Option<(&'a Prediction, &'a Prediction)> {
    let strongest = |class: usize| {
        (posterior.predictions.iter())
            .filter(|own| own.class == class)
            .max_by(|one, other| one.weight.total_cmp(&other.weight))
    };
    let order = order(shares);
    Some((strongest(*order.first()?)?, strongest(*order.get(1)?)?))
}

fn explanations(posterior: &Posterior, shares: &[f64]) -> Vec<Explanation> {
    let explanation = |class: usize| Explanation {
        effects: posterior.classes[class].clone(),
        probability: shares[class],
    };
    let probable = order(shares)
        .into_iter()
        .filter(|&class| shares[class] > 0.0);
    probable.take(TOLD).map(explanation).collect()
}

/// Effects that some probable explanations hold and others do not.
fn separates(posterior: &Posterior, shares: &[f64]) -> Vec<String> {
    let order = order(shares);
    let classes: Vec<&Vec<String>> = order
        .iter()
        .enumerate()
        .filter(|&(rank, &class)| shares[class] > if rank < 2 { 0.0 } else { WORTH_NAMING })
        .map(|(_, &class)| &posterior.classes[class])
        .collect();
    let mut names: Vec<String> = Vec::new();
    for name in classes.iter().copied().flatten() {
        let everywhere = classes.iter().all(|class| class.contains(name));
        if !everywhere && !names.contains(name) && names.len() < NAMED {
            names.push(name.clone());
        }
    }
    if names.len() == 1 && classes.iter().any(|class| class.is_empty()) {
        names.push("no_gap".to_owned());
    }
    // The unknown goes last: it is what remains.
    names.sort_by_key(|name| name == UNKNOWN);
    names
}

fn point(
    observations: &Observations,
    wanted: &Wanted,
    leading: Option<(&Prediction, &Prediction)>,
    place: usize,
) -> NextPoint {
    let at = &wanted.point.position;
    NextPoint {
        point_index: observations.rows[wanted.near].point,
        rotary_positions: wanted.point.rotary_positions.clone(),
        feed: wanted.point.feed,
        difference: leading.map_or(0.0, |(one, other)| one.mean[place] - other.mean[place]),
        feature: (observations.features)
            .get(wanted.point.feature as usize)
            .cloned()
            .unwrap_or_default(),
        position: [at.x, at.y, at.z],
        why: wanted.why.to_owned(),
    }
}

/// The plan with these touches only.
fn runnable<'a>(plan: &InspectionPlan, wanted: impl Iterator<Item = &'a Wanted>) -> InspectionPlan {
    let clear = |value: f64| if value > 0.0 { value } else { CLEAR };
    let points = wanted.map(|wanted| InspectionPoint {
        approach_distance: clear(wanted.point.approach_distance),
        retract_distance: clear(wanted.point.retract_distance),
        ..wanted.point.clone()
    });
    InspectionPlan {
        plan_id: format!("{}{FURTHER}", plan.plan_id),
        points: points.collect(),
        ..plan.clone()
    }
}
