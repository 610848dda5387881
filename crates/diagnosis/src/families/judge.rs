//! The judge: families enter by the evidence of the whole beside small remainders, and stay where they close left-out stretches.
//!
//! Forward selection by evidence with all sizes fitted anew, then backward elimination; stray touches are set aside. Metres.

use std::collections::BTreeSet;

use effects::Variant;
use effects::discrepancy::remainders;
use effects::observation::Observations;
use inference::columns::Rows;
use inference::relevance::{Fit, Products, Remainder, over_rows, used};
use metrology::statistics::rms;

use super::pool::{PRICE, Pool};
use super::stretches::Stretches;
use crate::report::Effect;

/// Usual standard deviation of what is not known, over the gap.
const SMALL: f64 = 0.08;
/// Families at most.
const MOST: usize = 12;
/// Families whose sizes are fitted at each step: those of the largest gains at present sizes.
const TRIED: usize = 6;
/// Columns from which on only the best three are compared.
const WIDE: usize = 120;
/// Updates of the sizes where families are compared.
const COMPARED: usize = 12;
/// A touch whose left-out residual is beyond this many of its deviations is set aside.
const STRAY: f64 = 4.5;
/// Rounds of setting aside, and the least share of touches that stays.
const ROUNDS: usize = 4;
const KEPT: f64 = 0.85;
/// Least share of the mean square of left-out stretches that a family closes.
const CLOSES: f64 = 0.02;
/// The same for a form of guideways, and for a family that the evidence has left to the remainders, which is named only while
/// more than this share of the gap is left.
const CLOSES_MUCH: f64 = 0.5;
const MAIN: f64 = 0.35;
/// Of an effect that acts more rarely by so many nats, the share that it closes is larger: half for 3 nats.
const RARE: f64 = 0.23;
/// Variances over that of the noise that are tried for what families leave: few rows fit many parameters better than they
/// determine them.
const MODEL_ERRORS: [f64; 4] = [3.0, 10.0, 30.0, 100.0];
/// Standard deviation of the noise of a good probe, m.
const FLOOR: f64 = 5e-8;

/// The rows that are judged.
pub(crate) struct Table<'a> {
    pub(crate) observations: &'a Observations,
    /// Columns that every fit contains: the pose of each of several sessions.
    pub(crate) nuisances: &'a [Vec<f64>],
    /// Weighted deviations of all rows.
    pub(crate) y: &'a [f64],
}

/// What a judgement names, in the order in which it closes left-out stretches.
pub(crate) struct Judged {
    pub(super) pool: Pool,
    pub(super) products: Products,
    /// The same without remainders.
    pub(super) bare: Products,
    /// Rows that are not stray.
    pub(crate) active: Vec<bool>,
    /// Sizes beside the remainders.
    pub(super) fit: Fit,
    /// Standard deviation of the noise where what remains may have any size, m.
    pub(crate) noise: f64,
    /// Families in the order in which they close the gap.
    pub(crate) named: Vec<usize>,
    /// Sizes of those without remainders.
    pub(super) plain: Fit,
    /// Left-out mean square with no family, the first, the first two, and so on, m².
    pub(super) closure: Vec<f64>,
    pub(super) stretches: Stretches,
}

/// An effect that the first opinion names.
pub(super) struct Named<'a> {
    pub(super) effect: &'a str,
    /// Over all rows, of parameters of usual size.
    pub(super) columns: Vec<Vec<f64>>,
}

/// What is left beside known effects.
pub(super) struct Left {
    /// At each row, m; 0 where it is not used.
    pub(super) part: Vec<f64>,
    /// Standard deviation of the noise, m.
    pub(super) noise: f64,
}

impl Judged {
    /// True where the evidence beside remainders holds each effect of a report, or one that is not told from it: another may be a
    /// part of what is not known. What depends on an axis or a temperature has shapes that are not refined here, and is not
    /// judged.
    pub(super) fn supports(&self, effects: &[Effect]) -> bool {
        let members = self.fit.sizes.families.iter();
        let members = members.flat_map(|&family| &self.pool.families[family].members);
        let evident: BTreeSet<&str> = members.map(|member| member.effect.as_str()).collect();
        let held = |effect: &Effect| {
            let mut group = std::iter::once(&effect.effect).chain(&effect.indistinguishable_from);
            is_shaped(&effect.effect) || group.any(|name| evident.contains(name.as_str()))
        };
        effects.iter().filter(|effect| effect.held_out).all(held)
    }

    /// Some products with the columns of named effects as families, and the fit of these alone.
    fn with_named(&self, mut products: Products, named: &[Named<'_>]) -> Option<(Products, Fit)> {
        let mut sizes = products.start();
        for one in named {
            sizes = sizes.with(products.families(), 1.0);
            products.extend(&over_rows(&one.columns, &self.active));
        }
        let fit = products.fit(sizes)?;
        Some((products, fit))
    }

    /// The fit of named effects without remainders.
    pub(super) fn without_remainders(&self, named: &[Named<'_>]) -> Option<(Products, Fit)> {
        self.with_named(self.bare.clone(), named)
    }

    /// True where named effects have more evidence beside remainders than the families that it holds there, each at its price; also
    /// where one of them has a shape, which is not refined here.
    pub(super) fn is_surpassed_by(&self, named: &[Named<'_>]) -> bool {
        if named.iter().any(|one| is_shaped(one.effect)) {
            return true;
        }
        let families = &self.pool.families;
        let own = self.fit.sizes.families.iter();
        let own: f64 = own.map(|&family| families[family].price).sum();
        let prices = named.iter().map(|one| {
            let known = families.iter().filter(|family| family.effect == one.effect);
            known.map(|family| family.price).fold(f64::NAN, f64::min)
        });
        // What is no family is a step at any touch.
        let any = PRICE + (self.products.data().len() as f64).ln();
        let theirs: f64 = prices
            .map(|price| if price.is_nan() { any } else { price })
            .sum();
        let fit = self.with_named(self.products.clone(), named);
        fit.is_some_and(|(_, fit)| fit.log_evidence - theirs > self.fit.log_evidence - own)
    }

    /// What is left of the deviations `y` (over all rows) beside named effects: remainders of any size, where they gain as much as
    /// a family must over noise of the lag-1 correlation of `rows`.
    pub(super) fn left_beside(&self, named: &[Named<'_>], y: &[f64], rows: &Rows) -> Option<Left> {
        let (beside, fit) = self.with_named(self.products.with_any_remainders(), named)?;
        let white = |values: &Vec<f64>| rows.white(values);
        let columns: Vec<Vec<Vec<f64>>> = (named.iter())
            .map(|one| one.columns.iter().map(white).collect())
            .collect();
        let y = rows.white(y);
        let families = columns.iter().map(Vec::as_slice);
        let noise = Products::new(&[], &[], families, &y, &vec![true; y.len()], beside.floor());
        let alone = (0..named.len()).fold(noise.start(), |sizes, family| sizes.with(family, 1.0));
        let alone = noise.fit(alone)?;
        if fit.log_evidence < alone.log_evidence - rows.offset() + PRICE {
            return None;
        }
        let values = beside.remainder(&fit);
        let mut values = values.iter();
        let mut of = |&used: &bool| if used { values.next().copied() } else { None };
        Some(Left {
            part: (self.active.iter())
                .map(|used| of(used).unwrap_or(0.0))
                .collect(),
            noise: fit.sizes.noise.sqrt(),
        })
    }

    /// True where it names a form of guideways.
    pub(super) fn has_form(&self) -> bool {
        let guideways = &self.pool.form.1;
        let mut named = self.named.iter();
        named.any(|&family| self.pool.excluded(guideways, &self.pool.families[family]))
    }

    /// True where it names the effects of a report and no others.
    pub(super) fn names(&self, effects: &[Effect]) -> bool {
        let theirs = effects.iter().filter(|effect| effect.held_out);
        let theirs: BTreeSet<&str> = theirs.map(|effect| effect.effect.as_str()).collect();
        let own = self.named.iter();
        let own = own.map(|&family| self.pool.families[family].effect.as_str());
        theirs == own.collect()
    }
}

/// True for an effect of an axis or of temperatures.
fn is_shaped(effect: &str) -> bool {
    ["axis.", "thermal."]
        .iter()
        .any(|head| effect.starts_with(head))
}

impl Table<'_> {
    /// Judges the rows in `active` by the families of some variants.
    pub(crate) fn judge(&self, variants: &[Variant], active: &[bool]) -> Option<Judged> {
        let mut active = active.to_vec();
        let all = remainders(self.observations);
        let rows = active.iter().filter(|&&used| used).count() as f64;
        let offered = Pool::new(self.observations, variants);
        let mut kept = None;
        for round in 0..ROUNDS {
            let gap = rms(&used(self.y, &active));
            let beside: Vec<Remainder<'_>> = (all.iter())
                .map(|columns| Remainder {
                    columns,
                    usual: (SMALL * gap).max(1e-9),
                })
                .collect();
            let mut pool = offered.clone();
            let floor = FLOOR.max(self.observations.grid.unwrap_or(0.0) / 12.0_f64.sqrt());
            let mut products = Products::new(
                self.nuisances,
                &beside,
                pool.columns(),
                self.y,
                &active,
                floor,
            );
            let fit = select(&mut pool, &mut products, &active)?;
            let strays = stray(&products, &fit, &active);
            let left = active.iter().filter(|&&used| used).count() as f64;
            let done = strays.is_empty() || left - strays.len() as f64 <= KEPT * rows;
            let judged = active.clone();
            if !done {
                for row in strays {
                    active[row] = false;
                }
            }
            kept = Some((pool, products, fit, judged));
            if done || round + 1 == ROUNDS {
                break;
            }
        }
        let (pool, products, fit, active) = kept?;
        let beside = products.with_any_remainders().fit(fit.sizes.clone())?;
        let noise = beside.sizes.noise.sqrt();
        let stretches = Stretches::new(self.observations, &active);
        let bare = products.without_remainders();
        let parts = confirm(&pool, &bare, &fit.sizes.families, &stretches)?;
        let form = formed(&pool, &bare, (&fit, &parts), &stretches);
        let (plain, closure) = form.unwrap_or(parts);
        Some(Judged {
            pool,
            products,
            bare,
            active,
            fit,
            noise,
            named: plain.sizes.families.clone(),
            plain,
            closure,
            stretches,
        })
    }
}

/// Rows whose residual, predicted by all others, is beyond [`STRAY`] of its deviations, the worst half of them.
fn stray(products: &Products, fit: &Fit, active: &[bool]) -> Vec<usize> {
    let residuals = products.residuals(fit);
    let spread = fit.predictive_variances(&products.solved(fit).transpose());
    let noise = fit.sizes.noise;
    let mut beyond: Vec<(f64, usize)> = Vec::new();
    let rows = (0..active.len()).filter(|&row| active[row]);
    for ((row, residual), spread) in rows.zip(residuals.iter()).zip(spread) {
        // Left out, a residual is r/(1 − h) with variance σ²/(1 − h) for the leverage h.
        let free = (1.0 - spread / noise).max(1e-6);
        let size = residual.abs() / (noise * free).sqrt();
        if size > STRAY {
            beyond.push((size, row));
        }
    }
    beyond.sort_by(|a, b| b.0.total_cmp(&a.0));
    beyond.truncate(beyond.len() / 2 + 1);
    beyond.into_iter().map(|(_, row)| row).collect()
}

/// Families by evidence, and the sizes of everything beside them.
fn select(pool: &mut Pool, products: &mut Products, active: &[bool]) -> Option<Fit> {
    let mut fit = products.fit(products.start())?;
    while fit.sizes.families.len() < MOST {
        pool.scan(products, &fit, active);
        let Some(next) = best_addition(pool, products, &fit) else {
            break;
        };
        fit = next;
    }
    while let Some(less) = best_removal(pool, products, &fit) {
        fit = less;
    }
    products.fit(fit.sizes)
}

/// How many families are compared beside a fit: each costs the cube of its columns.
fn tried(fit: &Fit) -> usize {
    if fit.columns.len() > WIDE { 3 } else { TRIED }
}

/// The fit with the family that gains most beyond its price, all sizes fitted anew.
fn best_addition(pool: &Pool, products: &Products, fit: &Fit) -> Option<Fit> {
    let mut offered = by_gain(pool, products, fit);
    let mut names: Vec<&str> = Vec::new();
    offered.retain(|&(_, index, _)| {
        let name = pool.families[index].effect.as_str();
        let few = names.iter().filter(|known| **known == name).count() < 2;
        names.push(name);
        few
    });
    let best = offered.into_iter().take(tried(fit));
    let grown = best.filter_map(|(_, index, variance)| {
        let more = products.fit_in(products.grown(&fit.sizes, index, variance), COMPARED)?;
        let net = more.log_evidence - fit.log_evidence - pool.families[index].price;
        (net > 0.0).then_some((net, more))
    });
    grown
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, more)| more)
}

/// The fit without the first family that the others have made superfluous, the cheapest first.
fn best_removal(pool: &Pool, products: &Products, fit: &Fit) -> Option<Fit> {
    let each = fit.sizes.families.iter().enumerate();
    let reduced = each.filter_map(|(index, &family)| {
        let less = products.fit_in(fit.sizes.without(index), COMPARED)?;
        let loss = fit.log_evidence - less.log_evidence - pool.families[family].price;
        (loss < 0.0).then_some((loss, less))
    });
    reduced
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, less)| less)
}

/// What is confirmed with a form of guideways. Beside a remainder over the place, which follows the same, it is not evident: it is
/// named where it is evident without one, and closes most of what is left without it and more than the evident `parts` do.
fn formed(
    pool: &Pool,
    bare: &Products,
    (evident, parts): (&Fit, &(Fit, Vec<f64>)),
    stretches: &Stretches,
) -> Option<(Fit, Vec<f64>)> {
    let (pose, guideways) = &pool.form;
    let own = |of: &[usize], family: usize| pool.excluded(of, &pool.families[family]);
    // In a height, where an axis is located looks like the pose of the part.
    let lies =
        |family: usize| own(pose, family) || pool.families[family].effect.starts_with("link.");
    let others = evident.sizes.families.iter();
    let others = others.filter(|&&family| !lies(family) && !own(guideways, family));
    let mut all = bare.start();
    for &family in others.chain(pose).chain(guideways) {
        all = all.with(family, 1.0);
    }
    let mut fit = bare.fit(all).filter(|_| !guideways.is_empty())?;
    while let Some(less) = best_removal(pool, bare, &fit) {
        fit = less;
    }
    let (fit, closure) = confirm(pool, bare, &fit.sizes.families, stretches)?;
    let mut without = fit.sizes.clone();
    let is_guideway = |&family: &usize| own(guideways, family);
    while let Some(place) = without.families.iter().position(is_guideway) {
        without = without.without(place);
    }
    let without = stretches.left_out(bare, &bare.fit(without)?);
    let (left, least) = (*closure.last()?, *parts.1.last()?);
    (left < CLOSES_MUCH * without && left < (1.0 - CLOSES) * least).then_some((fit, closure))
}

/// The fit without remainders of families in the order in which they close left-out stretches, and what is left out with none of
/// them, the first, and so on: those of `evident` as far as they close anything, then any other without which the main cause is
/// missing.
fn confirm(
    pool: &Pool,
    bare: &Products,
    evident: &[usize],
    stretches: &Stretches,
) -> Option<(Fit, Vec<f64>)> {
    let mut fit = bare.fit(bare.start())?;
    let mut closure = vec![stretches.left_out(bare, &fit)];
    let mut rest = evident.to_vec();
    loop {
        let evident = !rest.is_empty();
        let offered = if evident {
            rest.clone()
        } else {
            promising(pool, bare, &fit)
        };
        let before = closure.last().copied().unwrap_or(0.0);
        if !evident && before < MAIN * MAIN * closure[0] {
            break;
        }
        let usual = if evident { CLOSES } else { CLOSES_MUCH };
        let mut offered: Vec<((f64, f64), usize)> = (offered.into_iter())
            .map(|family| (bare.gain(&fit, family), family))
            .collect();
        offered.sort_by(|a, b| b.0.0.total_cmp(&a.0.0).then(a.1.cmp(&b.1)));
        offered.truncate(tried(&fit));
        let closes = offered.iter().filter_map(|&((_, variance), family)| {
            let more = bare.fit_in(fit.sizes.with(family, variance), COMPARED)?;
            let square = stretches.left_out(bare, &more);
            let rare = 1.0 - (-RARE * pool.families[family].rarity).exp();
            (square < before * (1.0 - usual.max(rare))).then_some((square, family, more))
        });
        match closes.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((square, family, more)) => {
                rest.retain(|&other| other != family);
                closure.push(square);
                fit = more;
            }
            None if evident => {
                rest.retain(|&other| offered.iter().all(|(_, tried)| *tried != other));
            }
            None => break,
        }
        if fit.sizes.families.len() >= MOST {
            break;
        }
    }
    let last = closure.last_mut()?;
    for factor in MODEL_ERRORS {
        let mut sizes = fit.sizes.clone();
        sizes.noise *= factor;
        let Some(wider) = bare.fit_in(sizes, 0) else {
            continue;
        };
        let square = stretches.left_out(bare, &wider);
        if square < *last {
            (*last, fit) = (square, wider);
        }
    }
    Some((fit, closure))
}

/// Families that the evidence favours beside a fit, best first.
fn promising(pool: &Pool, products: &Products, fit: &Fit) -> Vec<usize> {
    let offered = by_gain(pool, products, fit).into_iter();
    let gaining = offered.take(TRIED).take_while(|(net, ..)| *net > 0.0);
    gaining.map(|(_, index, _)| index).collect()
}

/// Families that can stand beside those of a fit: what each gains beyond its price at present sizes, its index, and the variance at
/// which it gains most; best first.
fn by_gain(pool: &Pool, products: &Products, fit: &Fit) -> Vec<(f64, usize, f64)> {
    let mut offered: Vec<(f64, usize, f64)> = (pool.families.iter().enumerate())
        .filter(|(_, family)| !pool.excluded(&fit.sizes.families, family))
        .map(|(index, family)| {
            let (gain, variance) = products.gain(fit, index);
            (gain - family.price, index, variance)
        })
        .collect();
    offered.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    offered
}
