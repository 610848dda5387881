//! The next measurement: a few touches that discriminate the remaining explanations.
//!
//! The explanations are the probable sets of effects, their aliases in this session, no gap and an unknown cause
//! ([`crate::design`]). Touches come from the plan's own features; those with the most expected information
//! (Box and Hill 1967) are chosen among those that the axes reach without a collision of the stylus. The answer is a plan
//! that a cell can run, with the predicted probability of success. It only proposes: the operator decides.

use machine::access::{Access, DEFAULT_CLEARANCE, TouchPose};
use probecell_msgs::{InspectionPlan, InspectionPoint, PlanId};
use rand::SeedableRng;
use rand::seq::index::sample;
use rand_pcg::Pcg64Mcg;

use crate::design::candidates::{Breadth, candidates};
use crate::design::extended_rows::{CandidateTouch, ExtendedRows};
use crate::design::hypotheses::{Posterior, Source, UNKNOWN};
use crate::design::information::{Prediction, SURE, chance, choose};
use crate::proposal::{Explanation, Named, NextMeasurement, NextPoint};
use effects::observation::{Observations, Row};
use effects::session::{Session, SessionError};
use effects::{Variant, observe};
use inference::posterior::{Model, ModelPosterior};

/// Classes below this probability are not named among those that the touches discriminate.
const WORTH_NAMING: f64 = 0.02;
/// Angles by which a thorough search turns each prescribed axis, besides half a turn, rad.
const TURNS: &[f64] = &[0.35, 1.05];
/// Probability that the true cause is among the explanations and well predicted: of 33 ambiguous blind sessions 22 were
/// resolved, where the explanations alone predicted 28.
const MODEL_COVERAGE: f64 = 0.8;
/// Explanations that a proposal lists.
const EXPLANATIONS: usize = 6;
/// Effects that a proposal names.
const NAMES: usize = 8;

/// Effort of the search for touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Effort {
    /// A small set of candidates, chosen one by one: a few milliseconds.
    #[default]
    Quick,
    /// Many candidates, and each choice tried again: for a proposal that will be measured.
    Thorough,
}

/// Options of a proposal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProposalOptions {
    /// Most touches.
    pub touches: usize,
    /// Effort of the search.
    pub effort: Effort,
}

impl Default for ProposalOptions {
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

/// A session with its attribution.
pub struct Context<'a> {
    /// The plan that was measured.
    pub plan: Option<&'a InspectionPlan>,
    /// Its rows.
    pub observations: &'a Observations,
    /// The library.
    pub variants: &'a [Variant],
    /// Its posterior.
    pub attribution: &'a ModelPosterior,
}

/// Touches that discriminate the remaining explanations; none where one is certain. `set` holds the candidates of the
/// first `effects`.
pub fn propose(
    known: &Context<'_>,
    set: &[usize],
    effects: &[Named<'_>],
    options: ProposalOptions,
) -> Vec<NextMeasurement> {
    // A thorough proposal is made even where one explanation is nearly certain.
    let sure = is_sure(known, set, effects);
    let wanted = options.effort == Effort::Thorough || !sure;
    let Some(plan) = known.plan.filter(|_| wanted) else {
        return Vec::new();
    };
    let limits = options.effort.limits();
    let wanted = candidates(known.observations, plan, limits.breadth);
    let extended = ExtendedRows::new(known.observations, plan, wanted);
    let source = Source {
        extended: &extended,
        variants: known.variants,
        attribution: known.attribution,
    };
    let posterior = source.posterior(set, effects, limits.explanations);
    let shares = shares(&posterior);
    let sure_now = shares.iter().copied().fold(0.0, f64::max);
    let proposal =
        |points: Vec<NextPoint>, plan: Option<InspectionPlan>, chance: f64| NextMeasurement {
            separates: separates(&posterior, &shares),
            points,
            plan,
            explanations: explanations(&posterior, &shares),
            chance,
            inseparable: posterior
                .indistinguishable
                .iter()
                .map(|pair| pair.to_vec())
                .collect(),
        };
    let access = access(known.observations, plan);
    let mut answers: Vec<Option<bool>> = vec![None; extended.wanted.len()];
    let mut allowed = |index: usize| {
        *answers[index].get_or_insert_with(|| access.allows(&touch_pose(&extended.rows()[index])))
    };
    let chosen = choose(
        &posterior.predictions,
        options.touches,
        limits.exchanges,
        &mut allowed,
    );
    let nothing = chosen.is_empty() && posterior.indistinguishable.is_empty();
    if nothing && options.effort == Effort::Quick {
        return Vec::new();
    }
    if chosen.is_empty() {
        let already = if sure_now > SURE { 1.0 } else { 0.0 };
        return vec![proposal(Vec::new(), None, already)];
    }
    let leading = leading(&posterior, &shares);
    let points = chosen
        .iter()
        .map(|&index| point(known.observations, &extended.wanted[index], leading, index));
    let touches = chosen.iter().map(|&index| &extended.wanted[index]);
    vec![proposal(
        points.collect(),
        Some(runnable(plan, touches)),
        if sure { 1.0 } else { MODEL_COVERAGE }
            * chance(&posterior.predictions, &chosen, limits.draws),
    )]
}

/// As many touches drawn at random from the reachable candidates of a thorough search: the baseline of a proposal.
///
/// # Errors
/// [`SessionError`] for a session that cannot be used.
pub fn random_plan(
    session: &Session,
    touches: usize,
    seed: u64,
) -> Result<Option<InspectionPlan>, SessionError> {
    let observations = observe(session)?;
    let Some(plan) = &session.plan else {
        return Ok(None);
    };
    let wanted = candidates(&observations, plan, Effort::Thorough.limits().breadth);
    let extended = ExtendedRows::new(&observations, plan, wanted);
    let access = access(&observations, plan);
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let count = extended.wanted.len();
    let drawn: Vec<&CandidateTouch> = sample(&mut random, count, count)
        .iter()
        .filter(|&index| access.allows(&touch_pose(&extended.rows()[index])))
        .take(touches)
        .map(|index| &extended.wanted[index])
        .collect();
    Ok((!drawn.is_empty()).then(|| runnable(plan, drawn.into_iter())))
}

/// Access of the stylus, with the touches of a session as known free.
fn access<'a>(observations: &'a Observations, plan: &InspectionPlan) -> Access<'a> {
    let touches = &observations.rows[..observations.touches()];
    let measured: Vec<TouchPose> = touches.iter().map(touch_pose).collect();
    Access::new(&observations.chain, &observations.nominal, plan, &measured)
}

fn touch_pose(row: &Row) -> TouchPose {
    TouchPose {
        feature: row.feature,
        position: row.position,
        normal: row.normal,
        surface: row.surface,
        positions: row.pose.as_ref().map(|pose| pose.positions.clone()),
    }
}

/// True where one explanation is certain and no effect of it is ambiguous.
fn is_sure(known: &Context<'_>, set: &[usize], effects: &[Named<'_>]) -> bool {
    let attribution = known.attribution;
    let names = |set: &[usize]| {
        let of = |&index: &usize| &known.variants[attribution.candidates[index].variant].effect;
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

/// Classes by descending probability, ties by number.
fn order(shares: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..shares.len()).collect();
    order.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]).then(a.cmp(&b)));
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
            .max_by(|a, b| a.weight.total_cmp(&b.weight))
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
    probable.take(EXPLANATIONS).map(explanation).collect()
}

/// Effects that some probable explanations contain and others do not.
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
        if !everywhere && !names.contains(name) && names.len() < NAMES {
            names.push(name.clone());
        }
    }
    if names.len() == 1 && classes.iter().any(|class| class.is_empty()) {
        names.push("no_gap".to_owned());
    }
    // The unknown cause is named last.
    names.sort_by_key(|name| name == UNKNOWN);
    names
}

fn point(
    observations: &Observations,
    wanted: &CandidateTouch,
    leading: Option<(&Prediction, &Prediction)>,
    index: usize,
) -> NextPoint {
    let at = &wanted.point.position;
    NextPoint {
        point_index: observations.rows[wanted.near].point,
        rotary_positions: wanted.point.rotary_positions.clone(),
        feed: wanted.point.feed,
        difference: leading.map_or(0.0, |(a, b)| a.mean[index] - b.mean[index]),
        feature: (observations.features)
            .get(wanted.point.feature as usize)
            .cloned()
            .unwrap_or_default(),
        position: [at.x, at.y, at.z],
        why: wanted.why.to_owned(),
    }
}

/// The plan with these touches only.
fn runnable<'a>(
    plan: &InspectionPlan,
    wanted: impl Iterator<Item = &'a CandidateTouch>,
) -> InspectionPlan {
    let clear = |value: f64| {
        if value > 0.0 {
            value
        } else {
            DEFAULT_CLEARANCE
        }
    };
    let points = wanted.map(|wanted| InspectionPoint {
        approach_distance: clear(wanted.point.approach_distance),
        retract_distance: clear(wanted.point.retract_distance),
        ..wanted.point.clone()
    });
    InspectionPlan {
        plan_id: PlanId::from(&plan.plan_id).supplement(1).to_string(),
        points: points.collect(),
        ..plan.clone()
    }
}
