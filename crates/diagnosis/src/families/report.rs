//! The findings of a judgement as effects of a report.
//!
//! A family is named after the effect of its largest part. The chain of left-out sizes begins at the gap. Metres;
//! parameters in their own units.

use effects::ParameterEstimate;
use effects::observation::Observations;
use inference::cross_validation::HeldOut;
use inference::linear::add_scaled;
use inference::relevance::{Fit, Products};
use metrology::statistics::coverage_factor;

use super::judge::Judged;
use super::pool::Family;
use crate::report::{Effect, Rejected, Unexplained, Verdict, localisation};

/// A family whose evidence in the place of another is lower by less than this is not excluded, nats.
const NOT_EXCLUDED: f64 = 4.6;
/// Effects that are listed as rejected at most.
const MAX_REJECTED: usize = 12;
/// A remainder shows where more than this many times the noise is left.
const LEFT: f64 = 1.5;
/// Touches of a block over which left-out residuals are taken as one.
const BLOCK: usize = 8;

impl Judged {
    /// The fit of the first so many families without remainders, at the sizes of all.
    fn prefix(&self, families: usize) -> Option<Fit> {
        let mut sizes = self.plain.sizes.clone();
        sizes.families.truncate(families);
        sizes.variances.truncate(families);
        self.bare.fit_in(sizes, 0)
    }

    /// Residuals with the first so many families, each pose predicted from the others; `None` for rows that are not used.
    pub(crate) fn left_out(&self, families: usize) -> Vec<Option<f64>> {
        let fit = self.prefix(families);
        let left = fit.map(|fit| self.stretches.by_pose(&self.bare, &fit));
        let mut left = left.unwrap_or_default().into_iter();
        let of = |&used: &bool| if used { left.next() } else { None };
        self.active.iter().map(of).collect()
    }

    /// Deviations `y` of all rows less what the first so many families predict, without the nuisances.
    pub(crate) fn predicted(&self, families: usize, y: &[f64]) -> Vec<f64> {
        let mut left = y.to_vec();
        let Some(fit) = self.prefix(families) else {
            return left;
        };
        let members = fit.sizes.families.iter();
        let columns = members.flat_map(|&member| &self.pool.families[member].columns);
        let coefficients = fit.mean.iter().skip(self.products.nuisances());
        for (column, coefficient) in columns.zip(coefficients) {
            add_scaled(&mut left, -coefficient, column);
        }
        left
    }

    /// The families that are named, in the order in which they close the gap of this root mean square (m); `after` is what is
    /// left with the first, the first two, and so on.
    pub(crate) fn effects(&self, gap: f64, after: &[HeldOut]) -> Vec<Effect> {
        let mut before = gap;
        let mut first = self.products.nuisances();
        let covariance = self.plain.covariance();
        let freedom = self.products.data().len() as f64 - self.plain.columns.len() as f64;
        let coverage = coverage_factor(0.95, freedom.max(1.0));
        let mut effects = Vec::new();
        for (&member, after) in self.named.iter().zip(after) {
            let family = &self.pool.families[member];
            let span = first..first + family.columns.len();
            first = span.end;
            let values: Vec<(f64, f64)> = (span.clone().zip(&family.members))
                .map(|(column, member)| {
                    let size = member.parameter.plausible;
                    let deviation = covariance[(column, column)].max(0.0).sqrt();
                    (self.plain.mean[column] * size, coverage * deviation * size)
                })
                .collect();
            let largest = largest(family, &self.plain.mean.as_slice()[span]);
            let judged = self.without(member);
            let gain = judged.as_ref().map_or(0.0, |(_, gain, _)| *gain);
            let net = gain - family.price;
            effects.push(Effect {
                effect: family.members[largest].effect.clone(),
                probability: 1.0 / (1.0 + (-net).exp()),
                parameters: estimates(family, &values, largest),
                rms_before: before,
                rms_after: after.rms,
                ci95_after: after.ci95,
                held_out: true,
                indistinguishable_from: judged.map_or_else(Vec::new, |(products, _, less)| {
                    self.equals(member, products, &less)
                }),
                group: Vec::new(),
                alternatives: Vec::new(),
                joint_zero: None,
                placebo_rms_after: None,
                sessions: Vec::new(),
            });
            before = after.rms;
        }
        effects
    }

    /// Effects that are not named, with the probability that they act beside those that are.
    pub(crate) fn rejected(&self) -> Vec<Rejected> {
        let mut rejected: Vec<Rejected> = Vec::new();
        for (other, family) in self.pool.families.iter().enumerate() {
            if self.pool.excluded(&self.named, family) {
                continue;
            }
            let net = self.products.gain(&self.fit, other).0 - family.price;
            let probability = 1.0 / (1.0 + (-net).exp());
            match rejected
                .iter_mut()
                .find(|known| known.effect == family.effect)
            {
                Some(known) => known.probability = known.probability.max(probability),
                None => rejected.push(Rejected {
                    effect: family.effect.clone(),
                    probability,
                    reason: None,
                }),
            }
        }
        rejected.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        rejected.truncate(MAX_REJECTED);
        rejected
    }

    /// What the evidence loses without a named family: beside remainders where it holds the family there, without them elsewhere;
    /// with the products and the fit that are left.
    fn without(&self, family: usize) -> Option<(&Products, f64, Fit)> {
        let beside = |products: &Products, fit: Fit| {
            let mut families = fit.sizes.families.iter();
            let place = families.position(|&other| other == family)?;
            let less = products.fit(fit.sizes.without(place))?;
            Some((fit.log_evidence - less.log_evidence, less))
        };
        if let Some((gain, less)) = beside(&self.products, self.fit.clone()) {
            return Some((&self.products, gain, less));
        }
        let plain = self.bare.fit(self.plain.sizes.clone())?;
        beside(&self.bare, plain).map(|(gain, less)| (&self.bare, gain, less))
    }

    /// Effects that would explain as well in the place of a named family, `less` being the fit without it.
    fn equals(&self, member: usize, products: &Products, less: &Fit) -> Vec<String> {
        let net = |family: usize| products.gain(less, family).0 - self.pool.families[family].price;
        let least = net(member) - NOT_EXCLUDED;
        let mut equals: Vec<String> = Vec::new();
        for (other, family) in self.pool.families.iter().enumerate() {
            let known = equals.contains(&family.effect);
            if !known && !self.pool.excluded(&self.named, family) && net(other) > least {
                equals.push(family.effect.clone());
            }
        }
        equals
    }
}

/// The member of a family whose part in the deviations is largest.
fn largest(family: &Family, coefficients: &[f64]) -> usize {
    let energy = |index: usize| {
        let column = &family.columns[index];
        let sum: f64 = column.iter().map(|value| value * value).sum();
        sum * coefficients[index] * coefficients[index]
    };
    (0..family.columns.len())
        .max_by(|&a, &b| energy(a).total_cmp(&energy(b)))
        .unwrap_or(0)
}

/// Parameters of a family; of several effects the largest first, each under the name of its effect.
fn estimates(family: &Family, values: &[(f64, f64)], first: usize) -> Vec<ParameterEstimate> {
    let several = (family.members.iter()).any(|member| member.effect != family.effect);
    let mut order: Vec<usize> = (0..values.len()).collect();
    if several {
        let usual = |index: usize| family.members[index].parameter.plausible;
        let over_usual = |index: usize| (values[index].0 / usual(index)).abs();
        order.sort_by(|&a, &b| over_usual(b).total_cmp(&over_usual(a)));
        order.retain(|&index| index != first);
        order.insert(0, first);
    }
    let mut all: Vec<ParameterEstimate> = (order.into_iter())
        .map(|index| {
            let (member, (value, half)) = (&family.members[index], values[index]);
            let name = if several {
                member.effect.clone()
            } else {
                member.parameter.name.clone()
            };
            ParameterEstimate {
                name,
                value,
                unit: member.parameter.unit.to_owned(),
                ci95: [value - half, value + half],
            }
        })
        .collect();
    let constants = family.shape.iter().chain(&family.constants);
    all.extend(constants.map(|&(name, value, unit)| ParameterEstimate {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        ci95: [value, value],
    }));
    all
}

/// The size of residuals, with its interval from the scatter between runs of touches.
pub(crate) fn size(residuals: &[Option<f64>]) -> HeldOut {
    let judged: Vec<f64> = residuals.iter().flatten().copied().collect();
    let blocks: Vec<(f64, f64)> = (judged.chunks(BLOCK))
        .map(|run| {
            (
                run.iter().map(|value| value * value).sum(),
                run.len() as f64,
            )
        })
        .collect();
    HeldOut::of_blocks(&blocks)
}

/// What is said of a gap of which so many families leave `after` beside `noise` (all m), and what stays unexplained.
pub(crate) fn verdict(
    observations: &Observations,
    left: &[Option<f64>],
    (gap, after, noise): (f64, f64, f64),
    named: usize,
) -> (Verdict, Unexplained) {
    let remains = after > LEFT * noise;
    let verdict = match (remains, named) {
        (true, 0) => Verdict::Unexplained,
        (true, _) => Verdict::PartlyExplained,
        (false, 0) => Verdict::NoGap,
        (false, _) => Verdict::Explained,
    };
    if !remains {
        let unexplained = Unexplained {
            rms: 0.0,
            place: Vec::new(),
            ladder: Vec::new(),
        };
        return (verdict, unexplained);
    }
    let used: Vec<bool> = left.iter().map(Option::is_some).collect();
    let part: Vec<f64> = left.iter().map(|value| value.unwrap_or(0.0)).collect();
    let unexplained = Unexplained {
        rms: (after * after - noise * noise).max(0.0).sqrt().min(gap),
        place: localisation::of_part(observations, &part, &used),
        ladder: Vec::new(),
    };
    (verdict, unexplained)
}
