//! Families of the library over the rows of a table: every cause with all its parameters.
//!
//! Columns are scaled to parameters of their largest usual size. An effect that acts in several ways at once (both
//! straightnesses of a slide, all location errors of an arm) is one family. A nonlinear parameter is scanned against what a
//! fit leaves; its best value becomes a family. Metres.

use effects::observation::{Column, Observations};
use effects::registry::acts_on;
use effects::variant::{ChainError, is_arm};
use effects::{Parameter, Variant};
use inference::relevance::{Columns, Fit, Products, over_rows};
use machine::JointKind;
use nalgebra::DMatrix;

/// What choosing a family must gain, nats: one cause among the some fifty that a machine can have, with a size of its own.
pub(super) const PRICE: f64 = 7.0;
/// Harmonics of a smooth function of an angle, and the width over which they fall off.
const MANY: usize = 8;
const WIDTH: f64 = 20.0;
/// Zeros of the joints of an arm over its other location errors: ridge regression over eight arms with nominal parameters gave
/// 1.6 mrad, against 0.1 to 0.8 mm or mrad.
const ZERO: f64 = 3.0;
/// Cosine from which on a component is that of an axis.
const ALONG: f64 = 0.9;
/// What a parameter of usual size does to no touch more than this does not show, m.
const HIDDEN: f64 = 1e-12;
/// Name of the constant that counts harmonics.
const HARMONIC: &str = "k";

/// A parameter of a family: the effect that it belongs to, and what it is.
#[derive(Debug, Clone)]
pub(super) struct Member {
    /// Identifier of the effect.
    pub(super) effect: String,
    /// Name, unit, and the size of which a coefficient is the multiple.
    pub(super) parameter: Parameter,
}

/// A cause with all its parameters.
#[derive(Debug, Clone)]
pub(super) struct Family {
    /// Its identifier: that of its effect, or of the first of several.
    pub(super) effect: String,
    /// Columns over all rows, weighted, of parameters of usual size.
    pub(super) columns: Vec<Vec<f64>>,
    /// The parameter of each column.
    pub(super) members: Vec<Member>,
    /// Value of its nonlinear parameter, with name and unit.
    pub(super) shape: Option<(&'static str, f64, &'static str)>,
    /// Constants of its variant.
    pub(super) constants: Vec<(&'static str, f64, &'static str)>,
    /// How much more rarely than usual it acts, nats.
    pub(super) rarity: f64,
    /// What choosing it must gain, nats.
    pub(super) price: f64,
}

impl Family {
    /// True where the two cannot stand beside one another: ways in which the same effects act.
    pub(super) fn excludes(&self, other: &Self) -> bool {
        let owns = |effect: &str| self.members.iter().any(|own| own.effect == effect);
        other.members.iter().any(|member| owns(&member.effect))
    }

    /// The value of a constant of its variant.
    fn constant(&self, name: &str) -> Option<f64> {
        let mut constants = self.constants.iter();
        constants.find_map(|&(own, value, _)| (own == name).then_some(value))
    }
}

/// A variant with a nonlinear parameter, at all its tried values.
#[derive(Clone)]
struct Scanned {
    trials: Vec<Family>,
    used: Vec<usize>,
}

/// All families, and those that must be scanned.
#[derive(Clone)]
pub(super) struct Pool {
    pub(super) families: Vec<Family>,
    /// What a height over several slides follows where it is all that is seen: the pose of the part; straightness of each slide and
    /// the rotations of its carriage.
    pub(super) form: (Vec<usize>, Vec<usize>),
    scanned: Vec<Scanned>,
}

impl Pool {
    /// The families of some variants over the rows.
    pub(super) fn new(observations: &Observations, variants: &[Variant]) -> Self {
        let still = observations.rows.iter().all(|row| row.feed == 0.0);
        let triggered = |effect: &str| acts_on(effect).is_some_and(|acts| acts.triggered);
        let arm = is_arm(&observations.chain);
        let mut families: Vec<Family> = Vec::new();
        let mut scanned = Vec::new();
        let mut links: Option<Family> = None;
        for variant in variants {
            // A step in time imitates what a place or a feature does; the first opinion knows when it is one.
            if variant.effect == "process.slip" || still && triggered(&variant.effect) {
                continue;
            }
            let ways = variants.iter().filter(|one| one.effect == variant.effect);
            let weights: f64 = ways.map(|one| one.prior_weight).sum();
            let price =
                PRICE + rarity(&variant.effect) - (variant.prior_weight / weights.max(1e-9)).ln();
            match &variant.shape {
                None => {
                    let mut family = family(observations, variant, 0.0, price);
                    if arm && variant.effect.starts_with("link.") {
                        if is_zero(observations, variant) {
                            scale(&mut family, ZERO);
                        }
                        links = Some(match links.take() {
                            Some(all) => joined(all, family),
                            None => Family {
                                price: PRICE,
                                ..family
                            },
                        });
                    } else {
                        families.push(family);
                    }
                }
                Some(shape) if shape.name == HARMONIC && shape.trials.len() >= MANY => {
                    let waves = shape.trials.iter().map(|&k| {
                        let mut wave = family(observations, variant, k, price);
                        scale(&mut wave, (-0.5 * (k / WIDTH).powi(2)).exp());
                        for member in &mut wave.members {
                            member.parameter.name = format!("{}(k={k})", member.parameter.name);
                        }
                        wave.shape = None;
                        wave
                    });
                    families.extend(waves.reduce(joined));
                }
                Some(shape) => {
                    let dearer = price + shape.distinct.max(1.0).ln();
                    let trials = shape.trials.iter();
                    scanned.push(Scanned {
                        trials: trials
                            .map(|&value| family(observations, variant, value, dearer))
                            .filter(|family| !family.columns.is_empty())
                            .collect(),
                        used: Vec::new(),
                    });
                }
            }
        }
        families.extend(links);
        families.retain(|family| !family.columns.is_empty());
        let straight = together(&families, ".straightness", |of| of.members.len() == 4);
        // A guideway that turns at rest bows besides, which straightness says.
        let bent = |of: &Family| of.members.len() == 2 && of.constant("moved") == Some(1.0);
        let bent = together(&families, ".angular", bent);
        let linear = |of: &Family| of.members.len() == 1 && of.constant("mid") != Some(0.0);
        let turned = together(&families, ".angular", linear);
        let known = families.len();
        let slides = straight.len();
        families.extend(straight);
        let mut form = (Vec::new(), Vec::new());
        if slides > 1 && is_height(observations) {
            families.extend(bent);
            let is_pose = |&index: &usize| families[index].effect.starts_with("fixture.");
            form = (
                (0..known).filter(is_pose).collect(),
                (known..families.len()).collect(),
            );
        }
        families.extend(turned);
        Self {
            families,
            form,
            scanned,
        }
    }

    /// True where a family cannot stand beside one of some others.
    pub(super) fn excluded(&self, others: &[usize], family: &Family) -> bool {
        let mut others = others.iter().map(|&other| &self.families[other]);
        others.any(|other| other.excludes(family))
    }

    /// Columns of each family.
    pub(super) fn columns(&self) -> impl Iterator<Item = Columns<'_>> {
        self.families.iter().map(|family| family.columns.as_slice())
    }

    /// Adds the best value of each nonlinear parameter beside a fit as a family.
    pub(super) fn scan(&mut self, products: &mut Products, fit: &Fit, active: &[bool]) {
        let solved = products.solved(fit);
        for scanned in &mut self.scanned {
            let gains = scanned.trials.iter().map(|family| {
                let columns = matrix(family, active);
                products.gain_of(fit, &solved, &columns).0
            });
            let best = gains.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((index, _)) = best.filter(|(index, gain)| {
                !scanned.used.contains(index) && *gain > scanned.trials[*index].price * 0.5
            }) else {
                continue;
            };
            scanned.used.push(index);
            let family = &scanned.trials[index];
            products.extend(&matrix(family, active));
            self.families.push(family.clone());
        }
    }
}

/// Multiplies the usual sizes of the parameters of a family.
fn scale(family: &mut Family, factor: f64) {
    for value in family.columns.iter_mut().flatten() {
        *value *= factor;
    }
    for member in &mut family.members {
        member.parameter.plausible *= factor;
    }
}

/// True for a location error that turns a joint about its own axis: its zero.
fn is_zero(observations: &Observations, variant: &Variant) -> bool {
    variant.errors.iter().any(|error| match *error {
        ChainError::Location { joint, component } => {
            let joint = &observations.chain.joints()[joint];
            let turns = joint.kind == JointKind::Revolute;
            turns && component >= 3 && joint.axis[component - 3].abs() > ALONG
        }
        _ => false,
    })
}

/// How much rarer than usual an effect acts, nats.
fn rarity(effect: &str) -> f64 {
    let last = effect.rsplit('.').next().unwrap_or(effect);
    match last {
        "lag" | "cyclic" | "trigger_latency" | "error_motion" => 2.0,
        "drift" | "spindle_growth" | "part_expansion" => 1.0,
        "indexing" => 0.5,
        // A clamped part is always displaced a little.
        "shift" | "tilt" => -2.0,
        _ => 0.0,
    }
}

/// The columns of a family over the rows in use.
pub(super) fn matrix(family: &Family, active: &[bool]) -> DMatrix<f64> {
    over_rows(&family.columns, active)
}

/// A variant at a value of its nonlinear parameter.
fn family(observations: &Observations, variant: &Variant, value: f64, price: f64) -> Family {
    let weighted = |column: Column, parameter: &Parameter| -> Vec<f64> {
        let rows = column.signature.iter().zip(&observations.rows);
        rows.map(|(part, row)| part * row.weight * parameter.plausible)
            .collect()
    };
    let member = |parameter: &Parameter| Member {
        effect: variant.effect.clone(),
        parameter: parameter.clone(),
    };
    let built = variant.columns(observations, value).into_iter();
    let (columns, members) = (built.zip(&variant.parameters))
        .map(|(column, parameter)| (weighted(column, parameter), member(parameter)))
        .filter(|(column, _)| column.iter().any(|value| value.abs() > HIDDEN))
        .unzip();
    Family {
        effect: variant.effect.clone(),
        columns,
        members,
        shape: (variant.shape.as_ref()).map(|shape| (shape.name, value, shape.unit)),
        constants: variant.constants.clone(),
        rarity: rarity(&variant.effect),
        price,
    }
}

/// Two families as one, at the price of the first.
fn joined(mut all: Family, other: Family) -> Family {
    all.columns.extend(other.columns);
    all.members.extend(other.members);
    all
}

/// All ways in which each effect of a pattern acts, as one family.
fn together(families: &[Family], tail: &str, is_way: impl Fn(&Family) -> bool) -> Vec<Family> {
    let is_one = |family: &&Family| family.effect.ends_with(tail) && is_way(family);
    let mut all: Vec<Family> = Vec::new();
    for family in families.iter().filter(is_one) {
        match all.iter_mut().find(|known| known.effect == family.effect) {
            Some(known) => *known = joined(known.clone(), family.clone()),
            None => all.push(Family {
                price: PRICE,
                ..family.clone()
            }),
        }
    }
    all
}

/// True where slides alone move and all touches look along one line, so that a height is all that is seen.
fn is_height(observations: &Observations) -> bool {
    let chain = &observations.chain;
    let stands = |axis: usize| {
        let (low, high) = observations.travel(axis);
        chain.axis(axis).kind == JointKind::Prismatic || high <= low
    };
    let mut normals = observations.rows.iter().map(|row| row.normal);
    let first = normals.next();
    (0..chain.axes().len()).all(stands)
        && first.is_some_and(|first| normals.all(|normal| normal.dot(&first).abs() > ALONG))
}
