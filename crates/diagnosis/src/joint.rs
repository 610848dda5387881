//! The joint diagnosis of several sessions of touches on one machine: common causes, a pose for each session.
//!
//! The part's pose is fitted anew in every session and is never a cause here; on an arm so is where the probe sits on
//! the flange, since tool and workpiece are registered together. Effects are those of the library that act alike in
//! every session; growth is by evidence, judgement on touches that were not used to fit: whole withheld sessions where
//! given, blocks of touches of every session elsewhere. Slips and drifts, which belong to one session, and the second
//! order on curved surfaces are left to the diagnosis of one session.

mod blocks;
mod cross_validation;
pub mod rows;
mod selection;

use effects::discrepancy::{discrepancies, within_sessions};
use effects::library;
use effects::session::{Session, SessionError};
use inference::discrepancy::{Discrepancy, Kind};
use inference::gram::{BlockSet, Gram, Solution, active_columns, active_values, combination};
use metrology::statistics::{MAD_FACTOR, coverage_factor, rms};

use crate::drives::diagnose_drives_with_residuals;
use crate::nonnegativity::ExcludedParameters;
use crate::options::Options;
use crate::report::residuals::{self, Residuals, TouchResiduals};
use crate::report::{
    Effect, Gap, Machine, ParameterEstimate, Rejected, Report, SCHEMA, Unexplained, Verdict,
    declared, localisation,
};
use blocks::BlockPool;
use cross_validation::{HeldOutEvaluator, HeldOutScores, superfluous};
use rows::Joined;
use selection::{Rows, Selection, contains_effect, price};

/// Touches whose residual exceeds this many robust standard deviations are rejected as outliers.
const OUTLIER: f64 = 6.0;
/// Rounds of rejection.
const ROUNDS: usize = 3;
/// Log odds against something unknown, before the data.
const UNKNOWN: f64 = 4.6;
/// A substitute whose log evidence is lower by less than this is not excluded.
const NOT_EXCLUDED: f64 = 4.6;
/// Harmonics of a smooth function that are reported at most.
const HARMONICS: usize = 5;

/// Explains several sessions together, touches or drives; fits on `fit`, judges on `withheld` where given; gives the report, and the residual of every
/// judging touch or sample.
///
/// # Errors
/// [`SessionError`] names what makes a session unusable.
pub fn diagnose_together_with_residuals(
    fit: &[Session],
    withheld: &[Session],
    options: &Options,
) -> Result<(Report, Residuals), SessionError> {
    let drives = |session: &Session| session.plan.is_none() && session.events.is_empty();
    if fit.iter().chain(withheld).all(drives) {
        return diagnose_drives_with_residuals(fit, withheld);
    }
    let mut impossible = ExcludedParameters::default();
    let sessions: Vec<&Session> = fit.iter().chain(withheld).collect();
    let joined = Joined::new(&sessions)?;
    let variants = library(&joined.observations);
    loop {
        let (report, touches) =
            joint_with_residuals((fit, withheld), &joined, &impossible, options)?;
        if !impossible.found_in(&report, &variants) {
            return Ok((report, Residuals::Touches(vec![touches])));
        }
    }
}

fn joint_with_residuals(
    (fit, withheld): (&[Session], &[Session]),
    joined: &Joined,
    impossible: &ExcludedParameters,
    options: &Options,
) -> Result<(Report, TouchResiduals), SessionError> {
    let observations = &joined.observations;
    let y: Vec<f64> = (observations.deviations.iter().zip(&observations.rows))
        .zip(&joined.second_order)
        .map(|((deviation, row), second)| (deviation - second) * row.weight)
        .collect();
    let free: Vec<Vec<f64>> = joined.poses.concat();
    let excluded: Vec<String> = options
        .without
        .iter()
        .cloned()
        .chain(joined.registered.iter().map(|&effect| effect.to_owned()))
        .collect();
    let mut active: Vec<bool> = joined.session.iter().map(|&of| of < fit.len()).collect();
    let mut pool = BlockPool::new(observations, &excluded, impossible);
    let mut last: Option<(Selection, Vec<bool>)> = None;
    for _ in 0..ROUNDS {
        let rows = Rows {
            observations,
            free: &free,
            y: &y,
            active: &active,
        };
        let start = last
            .as_ref()
            .map_or_else(BlockSet::default, |(selection, _)| selection.set.clone());
        let Some(selection) = rows.select(&mut pool, &start) else {
            break;
        };
        let residuals = rows.residuals(
            &pool,
            &selection.solution.columns,
            selection.solution.mean.as_slice(),
        );
        let outliers = outliers(&residuals, &active);
        last = Some((selection, active.clone()));
        if outliers.is_empty() {
            break;
        }
        for row in outliers {
            active[row] = false;
        }
    }
    let (selection, active) = last.ok_or(SessionError::TooFew(0, 1))?;
    let rows = Rows {
        observations,
        free: &free,
        y: &y,
        active: &active,
    };
    let judge = HeldOutEvaluator::new(&rows, joined, fit.len(), false);
    let withheld_judge =
        (!withheld.is_empty()).then(|| HeldOutEvaluator::new(&rows, joined, fit.len(), true));
    Ok(Reporter {
        fit,
        withheld,
        joined,
        rows: &rows,
        pool: &pool,
        judge: &judge,
        withheld_judge: withheld_judge.as_ref(),
    }
    .report(selection))
}

/// Rows in use whose residual exceeds [`OUTLIER`] robust standard deviations.
fn outliers(residuals: &[f64], active: &[bool]) -> Vec<usize> {
    let mut sizes: Vec<f64> = active_values(residuals, active)
        .iter()
        .map(|v| v.abs())
        .collect();
    sizes.sort_by(f64::total_cmp);
    let Some(&middle) = sizes.get(sizes.len() / 2) else {
        return Vec::new();
    };
    let bound = OUTLIER * MAD_FACTOR * middle.max(1e-9);
    (0..residuals.len())
        .filter(|&row| active[row] && residuals[row].abs() > bound)
        .collect()
}

struct Reporter<'a> {
    fit: &'a [Session],
    withheld: &'a [Session],
    joined: &'a Joined,
    rows: &'a Rows<'a>,
    pool: &'a BlockPool,
    /// Decides what is named: never the withheld sessions.
    judge: &'a HeldOutEvaluator<'a>,
    withheld_judge: Option<&'a HeldOutEvaluator<'a>>,
}

impl Reporter<'_> {
    fn report(&self, selection: Selection) -> (Report, TouchResiduals) {
        let Selection {
            mut set,
            gram,
            mut solution,
        } = selection;
        // An effect without which the others predict held-out touches as well is no cause.
        while let Some(index) = superfluous(&self.judge.without_each(self.pool, &gram, &set)) {
            set = set.without(index);
            let Some(again) = gram.maximise(&mut set, 1) else {
                break;
            };
            solution = again;
        }
        let judge = self.withheld_judge.unwrap_or(self.judge);
        let judged = judge.prefixes(self.pool, &gram, &set);
        let variance = solution.variance();
        let unknown = self.unknown(&gram, &solution);
        let floor =
            (unknown.as_ref()).map_or(variance.sqrt(), |one| one.noise.min(variance.sqrt()));
        let verdict = match (unknown.is_some(), set.members.is_empty()) {
            (true, true) => Verdict::Unexplained,
            (true, false) => Verdict::PartlyExplained,
            (false, true) => Verdict::NoGap,
            (false, false) => Verdict::Explained,
        };
        let effects = self.effects(&gram, &set, &solution, &judged, variance);
        let all = &self.joined.observations.deviations;
        let used: Vec<f64> = active_values(all, self.rows.active);
        let size = rms(&used);
        let touches = self.residuals(&gram, &set);
        let report = Report {
            schema: SCHEMA.to_owned(),
            bag: names(self.fit).join(" + "),
            fitted: names(self.fit),
            withheld: names(self.withheld),
            measured: self.fit.first().and_then(Session::measured),
            machine: self.fit.first().map(|session| {
                let name = self.joined.observations.chain.name();
                Machine::of(&session.robot_description, name)
            }),
            samples: used.len(),
            verdict,
            channel: "touch".to_owned(),
            gap: Gap {
                unit: "m".to_owned(),
                rms: size,
                noise_floor: floor,
                ratio: if floor > 0.0 { size / floor } else { 0.0 },
            },
            noise: Vec::new(),
            place: localisation::shares(&self.joined.observations, all, self.rows.active),
            rejected: self.rejected(&gram, &set, &solution),
            declared: (self.fit.iter().take(1))
                .flat_map(|session| &session.declared)
                .map(|effect| declared::report_entry(effect, None))
                .collect(),
            effects,
            unexplained: unknown.map_or_else(nothing, |one| one.unexplained),
            next_measurement: Vec::new(),
            durations: None,
            warnings: self.warnings(),
        };
        (report.finished(), touches)
    }

    /// Held-out residuals of the judging touches without any effect and with the named ones.
    fn residuals(&self, gram: &Gram, set: &BlockSet) -> TouchResiduals {
        let judge = self.withheld_judge.unwrap_or(self.judge);
        let residuals = judge.residuals(self.pool, gram, set);
        let observations = &self.joined.observations;
        let weight = |row: usize| observations.rows[row].weight;
        let first = self.withheld_judge.map_or(0, |_| self.fit.len());
        residuals::touches(
            observations,
            "touches against the model, the pose of each session fitted",
            self.names_judged(),
            |row| {
                let judges = judge.judges(row);
                judges.then(|| self.joined.session[row] - first)
            },
            |row| {
                residuals
                    .first()
                    .map_or(f64::NAN, |residuals| residuals[row])
                    / weight(row)
            },
            |row| {
                residuals
                    .last()
                    .map(|residuals| residuals[row] / weight(row))
            },
        )
    }

    fn warnings(&self) -> Vec<String> {
        let observations = &self.joined.observations;
        let mut warnings: Vec<String> = (observations.skipped.iter())
            .map(|(sequence, why)| format!("event {sequence} not used: {why}"))
            .collect();
        if !self.joined.registered.is_empty() {
            warnings.push(format!(
                "fitted separately in each session: {}",
                self.joined.registered.join(", ")
            ));
        }
        let of_fit = |row: &usize| self.joined.session[*row] < self.fit.len();
        let outliers = (0..self.rows.active.len())
            .filter(of_fit)
            .filter(|&row| !self.rows.active[row])
            .count();
        if outliers > 0 {
            warnings.push(format!("{outliers} touches rejected as outliers"));
        }
        warnings
    }

    fn effects(
        &self,
        gram: &Gram,
        set: &BlockSet,
        solution: &Solution,
        judged: &[HeldOutScores],
        variance: f64,
    ) -> Vec<Effect> {
        let covariance = solution.covariance();
        let freedom = (gram.rows() - solution.columns.len() as f64).max(1.0);
        let coverage = coverage_factor(0.95, freedom);
        let mut next = self.rows.free.len();
        let mut effects = Vec::new();
        for (index, &member) in set.members.iter().enumerate() {
            let block = &self.pool.blocks[member];
            let span = next..next + block.columns.len();
            next = span.end;
            let coefficients = solution.mean.rows(span.start, span.len()).into_owned();
            let spread = covariance.view((span.start, span.start), (span.len(), span.len()));
            let values = &block.back * coefficients;
            let uncertainty = &block.back * spread * block.back.transpose() * variance;
            let (before, after) = (&judged[index], &judged[index + 1]);
            let (equals, probability) = self.equivalence_class(gram, set, index);
            effects.push(Effect {
                effect: block.effect.clone(),
                probability,
                parameters: estimates(block, values.as_slice(), &uncertainty, coverage),
                rms_before: before.all.rms,
                rms_after: after.all.rms,
                ci95_after: after.all.ci95,
                held_out: true,
                indistinguishable_from: equals,
                group: Vec::new(),
                alternatives: Vec::new(),
                placebo_rms_after: None,
                sessions: after.of_sessions(before, &self.names_judged()),
            });
        }
        effects
    }

    fn names_judged(&self) -> Vec<String> {
        let judged = if self.withheld.is_empty() {
            self.fit
        } else {
            self.withheld
        };
        names(judged)
    }

    /// Effects that are indistinguishable from a member, and the probability that it or one of them acts.
    fn equivalence_class(&self, gram: &Gram, set: &BlockSet, index: usize) -> (Vec<String>, f64) {
        let rest = set.without(index);
        let Some(solution) = gram.solve(&rest) else {
            return (Vec::new(), 0.0);
        };
        let member = set.members[index];
        let with = gram.gain(&solution, member).0 - price(self.pool, member);
        let name = &self.pool.blocks[member].effect;
        let mut equals: Vec<String> = Vec::new();
        for (other, block) in self.pool.blocks.iter().enumerate() {
            if block.effect == *name
                || contains_effect(self.pool, set, other)
                || equals.contains(&block.effect)
            {
                continue;
            }
            if gram.gain(&solution, other).0 - price(self.pool, other) > with - NOT_EXCLUDED {
                equals.push(block.effect.clone());
            }
        }
        (equals, 1.0 / (1.0 + (-with).exp()))
    }

    /// Effects that were considered, with the probability that they act beside the set.
    fn rejected(&self, gram: &Gram, set: &BlockSet, solution: &Solution) -> Vec<Rejected> {
        let mut rejected: Vec<Rejected> = Vec::new();
        for (other, block) in self.pool.blocks.iter().enumerate() {
            if contains_effect(self.pool, set, other) {
                continue;
            }
            let odds = gram.gain(solution, other).0 - price(self.pool, other);
            let probability = 1.0 / (1.0 + (-odds).exp());
            match rejected.iter_mut().find(|r| r.effect == block.effect) {
                Some(known) => known.probability = known.probability.max(probability),
                None => rejected.push(Rejected {
                    effect: block.effect.clone(),
                    probability,
                    reason: None,
                }),
            }
        }
        rejected.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        rejected.truncate(12);
        rejected
    }

    /// The discrepancy that acts beside the set, if one does: how large it is, on what it depends, and the noise beside it.
    fn unknown(&self, gram: &Gram, solution: &Solution) -> Option<Unknown> {
        let observations = &self.joined.observations;
        let active = self.rows.active;
        let all = self.rows.columns(self.pool);
        let spread = |values: &[f64]| -> Vec<f64> {
            let mut used = values.iter();
            let of_row = |&used_row: &bool| {
                if used_row {
                    used.next().copied()
                } else {
                    Some(0.0)
                }
            };
            active
                .iter()
                .map(of_row)
                .map(Option::unwrap_or_default)
                .collect()
        };
        let (known, groups): (Vec<Discrepancy>, Vec<Vec<Vec<f64>>>) =
            discrepancies(observations, active)
                .into_iter()
                .filter(|discrepancy| discrepancy.kind != Kind::Time)
                .chain(within_sessions(observations, active, &self.joined.session))
                .filter_map(|discrepancy| {
                    let columns = discrepancy.columns()?;
                    Some((
                        discrepancy,
                        columns.iter().map(|column| spread(column)).collect(),
                    ))
                })
                .unzip();
        let kinds = known.len().max(1) as f64;
        let slices: Vec<&[Vec<f64>]> = groups.iter().map(Vec::as_slice).collect();
        let gains = gram.gains_of(solution, &all, &slices, self.rows.y, active);
        let least = (kinds.ln() + UNKNOWN).max(selection::least(gram));
        // What depends on a covariate is left to the effects here; over time only what no place says as well.
        let over_time = |index: usize| known[index].kind == Kind::Time;
        let best = (gains.into_iter().enumerate())
            .filter(|(index, _)| !matches!(known[*index].kind, Kind::Covariate(_)))
            .max_by(|a, b| {
                let placed = |of: &(usize, (f64, f64))| !over_time(of.0) && of.1.0 >= least;
                placed(a).cmp(&placed(b)).then(a.1.0.total_cmp(&b.1.0))
            });
        let (index, (gain, size)) = best?;
        let columns = &groups[index];
        if gain < least {
            return None;
        }
        let residuals = self
            .rows
            .residuals(self.pool, &solution.columns, solution.mean.as_slice());
        let chosen: Vec<&Vec<f64>> = columns.iter().collect();
        let matrix = active_columns(&chosen, active);
        let products = matrix.tr_mul(&matrix);
        let mut normal = products.clone();
        for diagonal in 0..columns.len() {
            normal[(diagonal, diagonal)] += 1.0 / size;
        }
        let left = nalgebra::DVector::from_vec(active_values(&residuals, active));
        let factor = nalgebra::Cholesky::new(normal)?;
        let part = combination(&chosen, factor.solve(&matrix.tr_mul(&left)).as_slice());
        let own = active_values(&part, active);
        let beside: Vec<f64> = left.iter().zip(&own).map(|(all, own)| all - own).collect();
        // Degrees of freedom that the process takes up beside those of the effects.
        let taken = factor.solve(&products).trace() + solution.columns.len() as f64;
        let free = (1.0 - taken / beside.len() as f64).max(1.0 / beside.len() as f64);
        Some(Unknown {
            noise: rms(&beside) / free.sqrt(),
            unexplained: Unexplained {
                rms: rms(&own),
                place: localisation::of_discrepancy(observations, &known[index].kind, &part, 1.0),
                ladder: Vec::new(),
            },
        })
    }
}

/// Something unknown beside a set of effects.
struct Unknown {
    unexplained: Unexplained,
    /// Standard deviation of the noise beside it, m.
    noise: f64,
}

fn nothing() -> Unexplained {
    Unexplained {
        rms: 0.0,
        place: Vec::new(),
        ladder: Vec::new(),
    }
}

fn names(sessions: &[Session]) -> Vec<String> {
    sessions
        .iter()
        .map(|session| session.name.clone())
        .collect()
}

/// Parameters with their intervals at a coverage factor; of many harmonics the largest, as amplitudes.
fn estimates(
    block: &blocks::Block,
    values: &[f64],
    covariance: &nalgebra::DMatrix<f64>,
    coverage: f64,
) -> Vec<ParameterEstimate> {
    let estimate = |name: &str, value: f64, unit: &str, half: f64| ParameterEstimate {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        ci95: [value - half, value + half],
    };
    let mut result = Vec::new();
    if block.harmonics {
        let mut waves: Vec<ParameterEstimate> = (0..values.len() / 2)
            .map(|wave| {
                let (sine, cosine) = (values[2 * wave], values[2 * wave + 1]);
                let spread =
                    covariance[(2 * wave, 2 * wave)] + covariance[(2 * wave + 1, 2 * wave + 1)];
                let about = &block.parameters[2 * wave];
                let name = about.name.replace("sin", "a");
                estimate(
                    &name,
                    sine.hypot(cosine),
                    about.unit,
                    coverage * (0.5 * spread).max(0.0).sqrt(),
                )
            })
            .collect();
        waves.sort_by(|a, b| b.value.total_cmp(&a.value));
        waves.truncate(HARMONICS);
        return waves;
    }
    for (index, (value, about)) in values.iter().zip(&block.parameters).enumerate() {
        let half = coverage * covariance[(index, index)].max(0.0).sqrt();
        result.push(estimate(&about.name, *value, about.unit, half));
    }
    if let Some((name, value, unit)) = block.shape {
        result.push(estimate(name, value, unit, 0.0));
    }
    result
}
