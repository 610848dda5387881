//! Why an arm takes another effort than its description says: families of causes over the equation of motion of the whole tree.
//!
//! Measured effort less inverse dynamics and declared friction is linear in friction, rotor inertia, a load at the flange, inertial parameters of the
//! links and gains of the efforts (Gautier and Khalil 1990; Swevers et al. 1997). Each family has one size, all sizes by the
//! evidence ([`inference::relevance`]), joints weighted by what they leave, correlated samples counted as fewer. A family is named
//! where the evidence holds it and left-out stretches of time, or withheld motions, shrink. N m or N, as recorded.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use inference::relevance::{Fit, Products, Sizes};
use machine::{Dynamics, PARAMETERS};
use metrology::statistics::rms;
use nalgebra::{DMatrix, DVector};

use super::STRETCHES;
use super::contact::{Contact, contacts};
use super::left::{Left, Named, half_width, named_effect, size, stretches};
use super::track::Track;
use crate::blocks::{better, independent_share};
use crate::report::{Effect, ParameterEstimate};

/// Families that are spoken of by name.
const PAYLOAD: &str = "drive.payload";
const LINKS: &str = "drive.link_inertia";
const COULOMB: &str = "drive.coulomb_friction";

/// A family must add so much log evidence, nats.
const NATS: f64 = 7.0;
/// A family that replaces another at less loss than this is not told from it, nats.
const NOT_TOLD: f64 = 4.6;
/// Families whose sizes are fitted at each step, and how small those in use begin once more.
const TRIED: usize = 4;
const SHRUNK: f64 = 0.01;
/// Least share of what is left of left-out stretches, and of the judging motion, that a family closes (rms).
const CLOSES: f64 = 0.01;
/// The arm moves where a joint is faster than this share of its usual speed.
const MOVING: f64 = 0.02;
/// Usual friction, and usual effort of a rotor, over the usual effort of a joint.
const USUAL: f64 = 0.3;
/// Usual error of a gain.
const GAIN: f64 = 0.1;
/// Usual load over the mass of the arm, and its distance from the flange over the longest link.
const LOAD: f64 = 0.05;
const LOAD_REACH: f64 = 0.25;
/// Least mass of a body over the mean of all, so that a link without mass may have one.
const LIGHT: f64 = 0.02;
/// An effort has both signs where the smaller side is more than this share of the larger.
const BOTH_SIGNS: f64 = 0.2;

/// Columns of one family, each scaled to a parameter of usual size.
#[derive(Clone)]
struct Family {
    effect: &'static str,
    /// Sessions that it acts in; `None` for all.
    sessions: Option<Vec<usize>>,
    span: Range<usize>,
    /// Name, unit and usual size of each parameter.
    parameters: Vec<(String, String, f64)>,
}

/// Rows of one joint in one stretch of a session.
struct Block {
    session: usize,
    withheld: bool,
    stretch: usize,
    joint: usize,
    y: DVector<f64>,
    matrix: DMatrix<f64>,
    qq: DMatrix<f64>,
    qy: DVector<f64>,
    /// Samples of the track that are its rows.
    samples: Vec<usize>,
}

/// Efforts of all sessions, ready to be judged.
pub(super) struct Efforts<'a> {
    dynamics: &'a Dynamics,
    fitted: &'a [Track],
    withheld: &'a [Track],
    families: Vec<Family>,
    blocks: Vec<Block>,
    /// Weight of each joint's rows: independent share over the variance of what remains.
    weights: Vec<f64>,
    /// Independent share of each joint's rows.
    shares: Vec<f64>,
    width: usize,
    /// Weighted inner products of the fitted rows, and those of each stretch of each session.
    whole: Sums,
    stretches: BTreeMap<(usize, usize), Sums>,
    /// Stretches of time in which something outside presses on the arm.
    contacts: Vec<Contact>,
    /// The inner products of all families, and the fit of those of highest evidence.
    selected: Option<(Products, Fit)>,
}

/// Columns and their coefficients.
type Coefficients = (Vec<usize>, DVector<f64>);
/// Weighted inner products of columns, and of columns with the data.
type Sums = (DMatrix<f64>, DVector<f64>);

impl<'a> Efforts<'a> {
    /// Rows of the sessions; `None` where an effort is missing or no sample moves.
    pub(super) fn new(
        dynamics: &'a Dynamics,
        fitted: &'a [Track],
        withheld: &'a [Track],
        unit: &str,
    ) -> Option<Self> {
        let mut efforts = Self::without(dynamics, fitted, withheld, unit, Vec::new())?;
        let found = efforts.touched();
        // Causes are fitted without what something outside does.
        if !found.is_empty() {
            efforts = Self::without(dynamics, fitted, withheld, unit, found)?;
            efforts.contacts = efforts.touched();
        }
        Some(efforts)
    }

    /// The same without the samples of these contacts in the fitted sessions.
    fn without(
        dynamics: &'a Dynamics,
        fitted: &'a [Track],
        withheld: &'a [Track],
        unit: &str,
        contacts: Vec<Contact>,
    ) -> Option<Self> {
        let first = fitted.first()?;
        let all = || fitted.iter().chain(withheld);
        if all().any(|track| track.effort.iter().any(Vec::is_empty)) {
            return None;
        }
        let sizes = UsualSizes::of(dynamics, first);
        let families = families(dynamics, &sizes, fitted.len(), unit);
        let width = families.last().map_or(0, |last| last.span.end);
        let mut efforts = Self {
            dynamics,
            fitted,
            withheld,
            families,
            blocks: Vec::new(),
            weights: Vec::new(),
            shares: Vec::new(),
            width,
            whole: (DMatrix::zeros(0, 0), DVector::zeros(0)),
            stretches: BTreeMap::new(),
            contacts,
            selected: None,
        };
        for (session, track) in all().enumerate() {
            let withheld = session >= fitted.len();
            efforts.add(session, withheld, track, &sizes);
        }
        if efforts.blocks.is_empty() {
            return None;
        }
        efforts.weigh();
        let products = efforts.products();
        efforts.selected = efforts.select(&products).map(|fit| (products, fit));
        Some(efforts)
    }

    /// A session of which nothing can be compared.
    pub(super) fn still(&self) -> Option<&str> {
        let tracks = self.tracks();
        let is_seen = |session: &usize| self.blocks.iter().any(|one| one.session == *session);
        let still = (0..tracks.len()).find(|session| !is_seen(session))?;
        Some(tracks[still].session.as_str())
    }

    /// A joint whose effort never changes its sign although that of its weight does: a magnitude, which cannot be compared.
    pub(super) fn magnitude(&self) -> Option<&str> {
        let count = self.dynamics.bodies().len();
        let sides = |values: &[f64]| {
            let both = (0.0_f64, 0.0_f64);
            values.iter().fold(both, |(low, high), value| {
                (low.min(*value), high.max(*value))
            })
        };
        let both = |(low, high): (f64, f64)| low.abs().min(high) > BOTH_SIGNS * low.abs().max(high);
        let mut turning = 0;
        let mut one_sided = Vec::new();
        for joint in 0..count {
            let track = &self.fitted[0];
            let measured = sides(&track.effort[joint]);
            let blocks = self
                .fit_blocks()
                .filter(|block| block.session == 0 && block.joint == joint);
            let nominal = blocks.flat_map(|block| {
                let pairs = block.samples.iter().zip(block.y.iter());
                pairs.map(|(&sample, y)| track.effort[joint][sample] - y)
            });
            if both(sides(&nominal.collect::<Vec<_>>())) {
                turning += 1;
                if measured.0 >= 0.0 && measured.1 > 0.0 {
                    one_sided.push(joint);
                }
            }
        }
        let first = one_sided.first()?;
        (2 * one_sided.len() > turning).then(|| self.dynamics.bodies()[*first].joint.as_str())
    }

    /// Adds the moving samples of a session.
    fn add(&mut self, session: usize, withheld: bool, track: &Track, sizes: &UsualSizes) {
        let count = self.dynamics.bodies().len();
        let mut rows: Vec<Vec<(usize, f64, Vec<f64>)>> = vec![Vec::new(); count * STRETCHES];
        for sample in 0..track.len() {
            let speed = Track::row(&track.speed, sample);
            let moving = |joint: usize| {
                track.moves[joint] && speed[joint].abs() > MOVING * sizes.speed[joint]
            };
            let mut outside = self.contacts.iter();
            let pressed = outside.any(|one| !withheld && one.holds(session, track.time[sample]));
            if pressed || !track.whole[sample] || !(0..count).any(moving) {
                continue;
            }
            let position = Track::row(&track.position, sample);
            let acceleration = Track::row(&track.acceleration, sample);
            let links = self.dynamics.regressor(&position, &speed, &acceleration);
            let load = self
                .dynamics
                .load_regressor(&position, &speed, &acceleration);
            let stretch = track.stretch(sample, STRETCHES);
            for (joint, links) in links.iter().enumerate() {
                let nominal = self.dynamics.nominal(links);
                let sign = track.sign[joint][sample];
                let body = &self.dynamics.bodies()[joint];
                let declared = body.damping * speed[joint] + body.friction * sign;
                let mut row = vec![0.0; self.width];
                for family in &self.families {
                    // Whether a withheld session has a load that only some have is asked of it (`without_loads`).
                    let acts = (family.sessions.as_ref()).is_none_or(|of| of.contains(&session));
                    if !acts && !withheld {
                        continue;
                    }
                    let own = &mut row[family.span.clone()];
                    match family.effect {
                        COULOMB => {
                            own[2 * joint] = sign;
                            own[2 * joint + 1] = sign * (nominal.abs() - sizes.load[joint]);
                        }
                        "drive.viscous_friction" => own[joint] = speed[joint],
                        "drive.friction_offset" => own[joint] = 1.0,
                        "drive.inertia" => own[joint] = acceleration[joint],
                        "drive.effort_gain" => own[joint] = nominal + declared,
                        PAYLOAD => own.copy_from_slice(&load[joint]),
                        _ => own.copy_from_slice(links),
                    }
                    for (value, (_, _, usual)) in own.iter_mut().zip(&family.parameters) {
                        *value *= usual;
                    }
                }
                let y = track.effort[joint][sample] - nominal - declared;
                rows[joint * STRETCHES + stretch].push((sample, y, row));
            }
        }
        for (index, rows) in rows
            .into_iter()
            .enumerate()
            .filter(|(_, rows)| !rows.is_empty())
        {
            let y = DVector::from_iterator(rows.len(), rows.iter().map(|row| row.1));
            let flat = rows.iter().flat_map(|row| row.2.iter().copied());
            let matrix = DMatrix::from_row_iterator(rows.len(), self.width, flat);
            self.blocks.push(Block {
                session,
                withheld,
                stretch: index % STRETCHES,
                joint: index / STRETCHES,
                qq: matrix.tr_mul(&matrix),
                qy: matrix.tr_mul(&y),
                y,
                matrix,
                samples: rows.into_iter().map(|row| row.0).collect(),
            });
        }
    }

    /// Weighs the joints by what all families together leave of them.
    fn weigh(&mut self) {
        let count = self.dynamics.bodies().len();
        let of = |joint: usize| self.fit_blocks().filter(move |block| block.joint == joint);
        let mut variance: Vec<f64> = (0..count)
            .map(|joint| {
                let y: Vec<f64> = of(joint)
                    .flat_map(|block| block.y.iter().copied())
                    .collect();
                rms(&y).powi(2).max(f64::MIN_POSITIVE)
            })
            .collect();
        let mut share = vec![1.0; count];
        for _ in 0..2 {
            let weights: Vec<f64> = variance.iter().map(|one| 1.0 / one).collect();
            let (qq, qy) = self.sums(&weights, |_| true);
            let ridge = qq + DMatrix::identity(self.width, self.width);
            let Some(theta) = ridge.cholesky().map(|factor| factor.solve(&qy)) else {
                break;
            };
            for joint in 0..count {
                let left: Vec<f64> = of(joint)
                    .flat_map(|block| (&block.y - &block.matrix * &theta).as_slice().to_vec())
                    .collect();
                variance[joint] = rms(&left).powi(2).max(1e-12 * variance[joint]);
                share[joint] = independent_share(&left);
            }
        }
        self.weights = (0..count)
            .map(|joint| share[joint] / variance[joint])
            .collect();
        self.shares = share;
        self.whole = self.sums(&self.weights, |_| true);
        let all = self
            .fit_blocks()
            .map(|block| (block.session, block.stretch));
        let all: BTreeSet<(usize, usize)> = all.collect();
        let of = |of| self.sums(&self.weights, |block| (block.session, block.stretch) == of);
        self.stretches = all
            .into_iter()
            .map(|stretch| (stretch, of(stretch)))
            .collect();
    }

    fn fit_blocks(&self) -> impl Iterator<Item = &Block> {
        self.blocks.iter().filter(|block| !block.withheld)
    }

    /// Weighted inner products of the fitted rows that are used.
    fn sums(&self, weights: &[f64], used: impl Fn(&Block) -> bool) -> Sums {
        let mut qq = DMatrix::zeros(self.width, self.width);
        let mut qy = DVector::zeros(self.width);
        for block in self.fit_blocks().filter(|block| used(block)) {
            qq += &block.qq * weights[block.joint];
            qy += &block.qy * weights[block.joint];
        }
        (qq, qy)
    }

    fn products(&self) -> Products {
        let (qq, qy) = self.whole.clone();
        let mut yy = 0.0;
        let mut rows = 0.0;
        for block in self.fit_blocks() {
            yy += block.y.norm_squared() * self.weights[block.joint];
            rows += block.y.len() as f64 * self.shares[block.joint];
        }
        let spans = self
            .families
            .iter()
            .map(|family| family.span.clone())
            .collect();
        Products::of_inner(rows, yy, qy, qq, spans)
    }

    /// The families of highest evidence, each of which it needs.
    fn select(&self, products: &Products) -> Option<Fit> {
        let mut fit = products.fit(products.start())?;
        loop {
            let unused = (0..self.families.len()).filter(|one| !fit.sizes.families.contains(one));
            let mut gains: Vec<(f64, f64, usize)> = unused
                .map(|family| {
                    let (gain, variance) = products.gain(&fit, family);
                    (gain, variance, family)
                })
                .collect();
            gains.sort_by(|a, b| b.0.total_cmp(&a.0));
            gains.truncate(TRIED);
            let tried = gains.iter().filter_map(|&(_, variance, family)| {
                let fit = best_fit(products, &fit.sizes.with(family, variance))?;
                self.has_weight(&fit).then_some(fit)
            });
            let best = tried.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence));
            match best {
                Some(best) if best.log_evidence > fit.log_evidence + NATS => fit = best,
                _ => break,
            }
        }
        fit = self.narrowed(products, &fit).unwrap_or(fit);
        while let Some((without, loss)) = cheapest(products, &fit) {
            if loss >= NATS {
                break;
            }
            fit = without;
        }
        while let Some(load) = self.weightless(&fit) {
            fit = products.fit(fit.sizes.without(load))?;
        }
        Some(fit)
    }

    /// Place in a fit of a load in all motions whose mass may be none beside what the links can do in its place.
    fn weightless(&self, fit: &Fit) -> Option<usize> {
        let families = &fit.sizes.families;
        let links = families.iter().any(|&one| self.is_links(one));
        let mut loads = (0..families.len()).filter(|&place| {
            let family = families[place];
            self.is_load(family) && self.families[family].sessions.is_none()
        });
        loads.find(|&place| links && !(self.estimates(fit, families[place])[0].ci95[0] > 0.0))
    }

    /// Contacts in what the causes of highest evidence leave of each session.
    fn touched(&self) -> Vec<Contact> {
        let selected = self.selected.as_ref();
        let fitted = selected.and_then(|(_, fit)| Some((fit, self.coefficients(fit, None)?)));
        let Some((fit, theta)) = fitted else {
            return Vec::new();
        };
        let tracks = self.tracks();
        let mut found: Vec<Contact> = Vec::new();
        for (session, track) in tracks.iter().enumerate() {
            let (columns, theta) = if session < self.fitted.len() {
                theta.clone()
            } else {
                self.without_loads(fit, &theta, session).0
            };
            let joints = self.dynamics.bodies().len();
            let mut left: Vec<Vec<f64>> = vec![Vec::new(); joints];
            let (mut dry, mut time) = (left.clone(), Vec::new());
            for block in self.blocks.iter().filter(|block| block.session == session) {
                let own = &block.y - block.matrix.select_columns(&columns) * &theta;
                left[block.joint].extend(own.iter());
                if block.joint == 0 {
                    time.extend(block.samples.iter().map(|&sample| track.time[sample]));
                }
                // Around standstill dry friction may be anything up to its size.
                let size = self.dry_friction(block.joint, (&columns, &theta));
                let free = |&sample: &usize| size * (1.0 - track.sign[block.joint][sample].abs());
                dry[block.joint].extend(block.samples.iter().map(free));
            }
            found.extend(contacts(session, &time, (&left, &dry)));
        }
        // What was left out of the fit is known already.
        let known = self
            .contacts
            .iter()
            .filter(|one| one.session < self.fitted.len());
        found.extend(known.cloned());
        found
    }

    /// Dry friction of a joint, declared and found.
    fn dry_friction(&self, joint: usize, (columns, theta): (&[usize], &DVector<f64>)) -> f64 {
        let coulomb = self.families.iter().find(|one| one.effect == COULOMB);
        let found = coulomb.and_then(|family| {
            let place = columns
                .iter()
                .position(|&one| one == family.span.start + 2 * joint)?;
            Some(theta[place] * family.parameters[2 * joint].2)
        });
        (self.dynamics.bodies()[joint].friction + found.unwrap_or(0.0)).abs()
    }

    /// Stretches of time in which something outside presses on the arm.
    pub(super) fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// True where no load has less than no mass.
    fn has_weight(&self, fit: &Fit) -> bool {
        let mass = |family: usize| -> f64 {
            let first = self.families[family].span.start;
            let place = fit.columns.iter().position(|&column| column == first);
            place.map_or(0.0, |place| fit.mean[place])
        };
        let mut loads = fit.sizes.families.iter();
        loads.all(|&family| !self.is_load(family) || mass(family) >= 0.0)
    }

    /// The same with a load in the place of the links, where the data do not refuse it: the links can do what a load does.
    fn narrowed(&self, products: &Products, fit: &Fit) -> Option<Fit> {
        let mut families = fit.sizes.families.iter();
        let links = families.clone().position(|&one| self.is_links(one))?;
        if families.any(|&one| self.is_load(one)) {
            return None;
        }
        let rest = products.fit(fit.sizes.without(links))?;
        let loads = (0..self.families.len()).filter(|&one| self.is_load(one));
        let with = loads.filter_map(|load| {
            let (_, variance) = products.gain(&rest, load);
            best_fit(products, &rest.sizes.with(load, variance)).filter(|fit| self.has_weight(fit))
        });
        let best = with.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))?;
        (best.log_evidence > fit.log_evidence - NATS).then_some(best)
    }

    /// Columns and coefficients of the families of a fit at its sizes, from all fitted rows, or from those that are not `left_out`.
    fn coefficients(&self, fit: &Fit, left_out: Option<&Sums>) -> Option<Coefficients> {
        let mut columns = Vec::new();
        let mut precision = Vec::new();
        for (&family, variance) in fit.sizes.families.iter().zip(&fit.sizes.variances) {
            let span = self.families[family].span.clone();
            precision.extend(span.clone().map(|_| 1.0 / variance));
            columns.extend(span);
        }
        if columns.is_empty() {
            return Some((columns, DVector::zeros(0)));
        }
        let of = |(qq, qy): &Sums| {
            let qq = qq.select_rows(&columns).select_columns(&columns);
            (
                qq / fit.sizes.noise,
                qy.select_rows(&columns) / fit.sizes.noise,
            )
        };
        let (mut own, mut right) = of(&self.whole);
        if let Some(part) = left_out {
            let (qq, qy) = of(part);
            own -= qq;
            right -= qy;
        }
        for (index, precision) in precision.iter().enumerate() {
            own[(index, index)] += precision;
        }
        Some((columns, own.cholesky()?.solve(&right)))
    }

    /// What a fit leaves of the judging rows: of withheld sessions where there are any and `judged`, else of each stretch in
    /// turn.
    fn left(&self, fit: &Fit, judged: bool) -> Option<Vec<Left>> {
        let mut all = Vec::new();
        let residual = |block: &Block, (columns, theta): &Coefficients| Left {
            session: block.session,
            stretch: block.stretch,
            joint: block.joint,
            residuals: (&block.y - block.matrix.select_columns(columns) * theta)
                .as_slice()
                .to_vec(),
            samples: block.samples.clone(),
        };
        if judged && !self.withheld.is_empty() {
            let theta = self.coefficients(fit, None)?;
            for session in self.fitted.len()..self.fitted.len() + self.withheld.len() {
                let (theta, _) = self.without_loads(fit, &theta, session);
                let blocks = self.blocks.iter().filter(|block| block.session == session);
                all.extend(blocks.map(|block| residual(block, &theta)));
            }
            return Some(all);
        }
        let columns = self.coefficients(fit, None)?.0;
        for (of, theta) in self.left_out(fit) {
            let own = self
                .fit_blocks()
                .filter(|block| (block.session, block.stretch) == of);
            let theta = (columns.clone(), theta);
            all.extend(own.map(|block| residual(block, &theta)));
        }
        Some(all)
    }

    /// Coefficients for a withheld session, and the families of loads that it does not have: of those that act in some sessions only
    /// it has those that leave less of it.
    fn without_loads(
        &self,
        fit: &Fit,
        (columns, theta): &Coefficients,
        session: usize,
    ) -> (Coefficients, Vec<usize>) {
        let left = |theta: &DVector<f64>| -> f64 {
            let blocks = self.blocks.iter().filter(|block| block.session == session);
            let squares = blocks.map(|block| {
                let left = &block.y - block.matrix.select_columns(columns) * theta;
                left.norm_squared() * self.weights[block.joint]
            });
            squares.sum()
        };
        let (mut theta, mut absent) = (theta.clone(), Vec::new());
        let some = fit.sizes.families.iter();
        for &family in some.filter(|one| self.families[**one].sessions.is_some()) {
            let mut without = theta.clone();
            let span = &self.families[family].span;
            for (place, _) in columns
                .iter()
                .enumerate()
                .filter(|(_, one)| span.contains(*one))
            {
                without[place] = 0.0;
            }
            if left(&without) < left(&theta) {
                theta = without;
                absent.push(family);
            }
        }
        ((columns.clone(), theta), absent)
    }

    fn fit_of(products: &Products, families: &[usize], fit: &Fit) -> Option<Fit> {
        let variance = |family: usize| {
            let place = fit.sizes.families.iter().position(|&one| one == family);
            place.map_or(1.0, |place| fit.sizes.variances[place])
        };
        products.fit(Sizes {
            families: families.to_vec(),
            variances: families.iter().map(|&family| variance(family)).collect(),
            noise: fit.sizes.noise,
        })
    }

    /// Names the causes.
    pub(super) fn named(&self) -> Option<Named> {
        let (products, fit) = self.selected.as_ref()?;
        let mut order = self.order(products, fit)?;
        let left = |families: &[usize], judged: bool| {
            self.left(&Self::fit_of(products, families, fit)?, judged)
        };
        let mut before = [left(&[], false)?, left(&[], true)?];
        let beginning = before[1].clone();
        let (mut kept, mut steps): (Vec<usize>, Vec<[Vec<Left>; 2]>) = (Vec::new(), Vec::new());
        // What does not help stretches that were left out and another motion is no cause, unless it does beside one that comes later.
        let mut next = 0;
        while let Some(&family) = order.get(next) {
            kept.push(family);
            let after = [left(&kept, false)?, left(&kept, true)?];
            let mut pairs = before.iter().zip(&after);
            let closes = pairs.all(|(before, after)| size(after) < (1.0 - CLOSES) * size(before));
            if !closes || !better(&stretches(&before[0]), &stretches(&after[0])) {
                kept.pop();
                next += 1;
                continue;
            }
            steps.push([before[1].clone(), after[1].clone()]);
            before = after;
            order.remove(next);
            next = 0;
        }
        let fit = Self::fit_of(products, &kept, fit)?;
        let named = kept.iter().zip(&steps);
        let effects = named
            .map(|(&family, [before, after])| self.effect(products, &fit, family, (before, after)));
        let effects = effects.collect();
        let theta = self.coefficients(&fit, None)?;
        let loads = (kept.iter().copied()).filter(|&family| self.is_load(family));
        let remark = |family: usize| match &self.families[family].sessions {
            None => {
                "a load and heavier links are told apart by a motion without the load".to_owned()
            }
            Some(sessions) => {
                let judging = self.fitted.len()..self.fitted.len() + self.withheld.len();
                let judging = judging
                    .filter(|&one| !self.without_loads(&fit, &theta, one).1.contains(&family));
                let tracks = self.tracks();
                let acts = sessions.iter().copied().chain(judging);
                let names: Vec<&str> = acts.map(|one| tracks[one].session.as_str()).collect();
                format!("the load acts in {} only", names.join(" and "))
            }
        };
        Some(Named {
            effects,
            remarks: loads.map(remark).collect(),
            before: beginning,
            after: before[1].clone(),
        })
    }

    /// The families of a fit, the one first without which all others leave most of left-out stretches; of what is wider the narrower
    /// comes first.
    fn order(&self, products: &Products, fit: &Fit) -> Option<Vec<usize>> {
        let (mut rest, mut order) = (fit.sizes.families.clone(), Vec::new());
        while !rest.is_empty() {
            let without = |family: usize| -> Option<(f64, usize)> {
                let others: Vec<usize> =
                    rest.iter().copied().filter(|&one| one != family).collect();
                let left = self.left(&Self::fit_of(products, &others, fit)?, false)?;
                Some((size(&left), family))
            };
            let wide = rest.iter().find(|&&one| self.is_wider(one, &rest)).copied();
            let left = rest
                .iter()
                .filter(|&&one| wide.is_none_or(|wide| wide == one || !self.is_load(one)));
            let least = left.filter_map(|&family| without(family));
            let (_, family) = least.min_by(|a, b| a.0.total_cmp(&b.0))?;
            rest.retain(|&one| one != family);
            order.insert(0, family);
        }
        Some(order)
    }

    fn is_load(&self, family: usize) -> bool {
        self.families[family].effect == PAYLOAD
    }

    fn is_links(&self, family: usize) -> bool {
        self.families[family].effect == LINKS
    }

    /// True where a family can do what another of these does: the parameters of the links hold those of a load.
    fn is_wider(&self, family: usize, rest: &[usize]) -> bool {
        self.is_links(family) && rest.iter().any(|&one| self.is_load(one))
    }

    fn effect(
        &self,
        products: &Products,
        fit: &Fit,
        family: usize,
        (before, after): (&[Left], &[Left]),
    ) -> Effect {
        let place = fit
            .sizes
            .families
            .iter()
            .position(|&one| one == family)
            .unwrap_or(0);
        let rest = products.fit(fit.sizes.without(place));
        let loss = rest
            .as_ref()
            .map_or(f64::INFINITY, |rest| fit.log_evidence - rest.log_evidence);
        let unused = (0..self.families.len()).filter(|one| !fit.sizes.families.contains(one));
        let mut group: Vec<String> = Vec::new();
        for other in unused {
            let Some(rest) = &rest else { break };
            let (_, variance) = products.gain(rest, other);
            let replaced = products.fit(rest.sizes.with(other, variance));
            let effect = self.families[other].effect;
            let is_told = replaced.is_none_or(|one| one.log_evidence < fit.log_evidence - NOT_TOLD);
            let known =
                effect == self.families[family].effect || group.iter().any(|one| one == effect);
            if !is_told && !known {
                group.push(effect.to_owned());
            }
        }
        named_effect(
            self.families[family].effect,
            1.0 / (1.0 + (-loss).exp()),
            self.estimates(fit, family),
            group,
            (before, after),
            &self.tracks(),
            self.dynamics,
        )
    }

    /// All sessions, in the order of the blocks.
    pub(super) fn tracks(&self) -> Vec<&Track> {
        self.fitted.iter().chain(self.withheld).collect()
    }

    /// Parameters of a family in a fit, with 95 % intervals.
    fn estimates(&self, fit: &Fit, family: usize) -> Vec<ParameterEstimate> {
        let own = &self.families[family];
        let is_load = self.is_load(family);
        let covariance = match self.beside_usual_links(fit) {
            Some(covariance) if is_load && own.sessions.is_none() => covariance,
            _ => fit.covariance(),
        };
        let places: Vec<usize> = (own.span.clone())
            .filter_map(|column| fit.columns.iter().position(|&one| one == column))
            .collect();
        // Reported values from coefficients: those of a load are its mass and the centre of it.
        let values = |theta: &DVector<f64>| -> Vec<f64> {
            let pairs = places.iter().zip(&own.parameters);
            let mut values: Vec<f64> = pairs
                .map(|(&place, (_, _, usual))| theta[place] * usual)
                .collect();
            if is_load {
                values.truncate(4);
                let mass = values[0];
                values[1..].iter_mut().for_each(|moment| *moment /= mass);
            }
            values
        };
        let replicates: Vec<Vec<f64>> = (self.left_out(fit).iter())
            .map(|(_, theta)| values(theta))
            .collect();
        let mean = values(&fit.mean);
        let spread = |one: usize, other: usize| {
            covariance[(places[one], places[other])]
                * own.parameters[one].2
                * own.parameters[other].2
        };
        let estimates = mean.iter().enumerate().map(|(number, &value)| {
            let (name, unit, _) = &own.parameters[number];
            let mut variance = spread(number, number);
            let (mut name, mut unit) = (name.as_str(), unit.as_str());
            if is_load && number > 0 {
                // First order of the quotient (GUM, JCGM 100:2008, 5.2).
                variance += value * value * spread(0, 0) - 2.0 * value * spread(0, number);
                variance /= mean[0] * mean[0];
                (name, unit) = (["mass", "x", "y", "z"][number], "m");
            }
            let scatter: Vec<f64> = replicates.iter().map(|values| values[number]).collect();
            let half = half_width(variance.max(0.0).sqrt(), &scatter);
            ParameterEstimate {
                name: name.to_owned(),
                value,
                unit: unit.to_owned(),
                ci95: [value - half, value + half],
            }
        });
        let mut estimates: Vec<ParameterEstimate> = estimates.collect();
        if self.is_links(family) {
            // Those that differ from the description for sure come first.
            let certainty = |one: &ParameterEstimate| {
                let half = 0.5 * (one.ci95[1] - one.ci95[0]);
                (one.value / half.max(f64::MIN_POSITIVE)).abs()
            };
            estimates.sort_by(|one, other| certainty(other).total_cmp(&certainty(one)));
        }
        estimates
    }

    /// Covariance of the coefficients where the links may have any size of theirs: a load that acts in all
    /// motions has no other bound towards them.
    fn beside_usual_links(&self, fit: &Fit) -> Option<DMatrix<f64>> {
        let (mut columns, mut precision) = (Vec::new(), Vec::new());
        let links = (0..self.families.len()).filter(|one| self.is_links(*one));
        let more = links
            .filter(|one| !fit.sizes.families.contains(one))
            .map(|one| (one, 0.0));
        let own = fit
            .sizes
            .families
            .iter()
            .copied()
            .zip(fit.sizes.variances.iter().copied());
        for (family, variance) in own.chain(more) {
            let usual = if self.is_links(family) { 1.0 } else { 0.0 };
            let span = self.families[family].span.clone();
            precision.extend(span.clone().map(|_| 1.0 / variance.max(usual)));
            columns.extend(span);
        }
        let own = self.whole.0.select_rows(&columns).select_columns(&columns) / fit.sizes.noise;
        let own = own + DMatrix::from_diagonal(&DVector::from_vec(precision));
        Some(own.cholesky()?.inverse())
    }

    /// Session and stretch of each stretch of the fitted sessions, and the coefficients without it.
    fn left_out(&self, fit: &Fit) -> Vec<((usize, usize), DVector<f64>)> {
        let without = |(&of, part): (&(usize, usize), &Sums)| {
            Some((of, self.coefficients(fit, Some(part))?.1))
        };
        self.stretches.iter().filter_map(without).collect()
    }

    /// Noise of the compared efforts: of the sensor, and of the acceleration on the inertia of each joint; mean over the joints.
    pub(super) fn floor(&self) -> f64 {
        let track = &self.fitted[0];
        let count = self.dynamics.bodies().len();
        let zero = vec![0.0; count];
        let middle = Track::row(&track.position, track.len() / 2);
        let weight = self.dynamics.efforts(&middle, &zero, &zero);
        let squares = (0..count).map(|joint| {
            let mut unit = zero.clone();
            unit[joint] = 1.0;
            let inertia = self.dynamics.efforts(&middle, &zero, &unit)[joint] - weight[joint];
            track.effort_noise[joint]
                .hypot(inertia * track.acceleration_noise[joint])
                .powi(2)
        });
        (squares.sum::<f64>() / count as f64).sqrt()
    }

    /// Number of fitted values.
    pub(super) fn samples(&self) -> usize {
        self.fit_blocks().map(|block| block.y.len()).sum()
    }
}

/// Usual sizes of the motion and of the arm.
struct UsualSizes {
    speed: Vec<f64>,
    acceleration: Vec<f64>,
    effort: Vec<f64>,
    /// Mean size of the efforts of the description: friction that grows with the load is told from that at the usual one.
    load: Vec<f64>,
}

impl UsualSizes {
    fn of(dynamics: &Dynamics, track: &Track) -> Self {
        let upper = |values: &Vec<f64>| {
            let mut sizes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
            sizes.sort_by(f64::total_cmp);
            sizes[sizes.len() * 19 / 20].max(1e-9)
        };
        let each = |values: &[Vec<f64>]| -> Vec<f64> { values.iter().map(upper).collect() };
        let (speed, acceleration, effort) = (
            each(&track.speed),
            each(&track.acceleration),
            each(&track.effort),
        );
        debug_assert_eq!(speed.len(), dynamics.bodies().len());
        let mut load = vec![0.0; speed.len()];
        for sample in 0..track.len() {
            let [position, speed, acceleration] =
                [&track.position, &track.speed, &track.acceleration]
                    .map(|values| Track::row(values, sample));
            let efforts = dynamics.efforts(&position, &speed, &acceleration);
            for (sum, effort) in load.iter_mut().zip(efforts) {
                *sum += effort.abs() / track.len() as f64;
            }
        }
        Self {
            speed,
            acceleration,
            effort,
            load,
        }
    }
}

/// The families of an arm; a load may also act in one of several sessions, or in all but one.
fn families(dynamics: &Dynamics, sizes: &UsualSizes, sessions: usize, unit: &str) -> Vec<Family> {
    let bodies = dynamics.bodies();
    let mut families: Vec<Family> = Vec::new();
    let mut add = |effect, sessions, parameters: Vec<(String, String, f64)>| {
        let first = families.last().map_or(0, |last: &Family| last.span.end);
        families.push(Family {
            effect,
            sessions,
            span: first..first + parameters.len(),
            parameters,
        });
    };
    let of = |joint: usize, name: &str| format!("{}.{name}", bodies[joint].joint);
    let joints = 0..bodies.len();
    let per = |what: &str| format!("{unit} per ({what})");
    let two = joints.clone().flat_map(|joint| {
        let usual = USUAL * sizes.effort[joint];
        [
            (of(joint, "coefficient"), unit.to_owned(), usual),
            (of(joint, "by_load"), "1".to_owned(), GAIN),
        ]
    });
    add(COULOMB, None, two.collect());
    let one = |name: &'static str, unit: String, usual: &dyn Fn(usize) -> f64| {
        let parameter = |joint: usize| (of(joint, name), unit.clone(), usual(joint));
        joints.clone().map(parameter).collect::<Vec<_>>()
    };
    let effort = |joint: usize| USUAL * sizes.effort[joint];
    add(
        "drive.viscous_friction",
        None,
        one("coefficient", per("rad/s"), &|joint| {
            effort(joint) / sizes.speed[joint]
        }),
    );
    add(
        "drive.friction_offset",
        None,
        one("offset", unit.to_owned(), &effort),
    );
    add(
        "drive.inertia",
        None,
        one("inertia", per("rad/s²"), &|joint| {
            effort(joint) / sizes.acceleration[joint]
        }),
    );
    add(
        "drive.effort_gain",
        None,
        one("gain", "1".to_owned(), &|_| GAIN),
    );
    let total: f64 = bodies.iter().map(|body| body.parameters[0]).sum();
    if total <= 0.0 {
        return families;
    }
    let parameters = |name: &str, mass: f64, reach: f64| -> Vec<(String, String, f64)> {
        let names = [
            "mass", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz",
        ];
        let part = |(number, what): (usize, &str)| {
            let (unit, usual) = match number {
                0 => ("kg", mass),
                1..4 => ("kg m", mass * reach),
                _ => ("kg m²", mass * reach * reach),
            };
            (format!("{name}{what}"), unit.to_owned(), usual)
        };
        names.into_iter().enumerate().map(part).collect()
    };
    let least = LIGHT * total / bodies.len() as f64;
    let links = bodies.iter().flat_map(|body| {
        parameters(
            &format!("{}.", body.link),
            body.parameters[0].max(least),
            body.reach.max(0.05),
        )
    });
    let links: Vec<_> = links.collect();
    debug_assert_eq!(links.len(), PARAMETERS * bodies.len());
    add(LINKS, None, links);
    if dynamics.has_mount() {
        let reach = bodies.iter().map(|body| body.reach).fold(0.0, f64::max);
        let load = || parameters("", LOAD * total, LOAD_REACH * reach);
        add(PAYLOAD, None, load());
        if sessions > 1 {
            for session in 0..sessions {
                add(PAYLOAD, Some(vec![session]), load());
                let others: Vec<usize> = (0..sessions).filter(|&one| one != session).collect();
                if others.len() > 1 {
                    add(PAYLOAD, Some(others), load());
                }
            }
        }
    }
    families
}

/// The fit of highest evidence from some sizes on, or from small ones of all families but the last: a size that has grown for
/// want of a better family shrinks only slowly.
fn best_fit(products: &Products, sizes: &Sizes) -> Option<Fit> {
    let mut small = sizes.clone();
    if let Some((_, others)) = small.variances.split_last_mut() {
        for variance in others {
            *variance *= SHRUNK;
        }
    }
    let fits = [sizes.clone(), small].into_iter();
    let fits = fits.filter_map(|sizes| products.fit(sizes));
    fits.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
}

/// The family whose loss costs least, and the fit without it.
fn cheapest(products: &Products, fit: &Fit) -> Option<(Fit, f64)> {
    (0..fit.sizes.families.len())
        .filter_map(|place| products.fit(fit.sizes.without(place)))
        .map(|without| {
            let loss = fit.log_evidence - without.log_evidence;
            (without, loss)
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
}
