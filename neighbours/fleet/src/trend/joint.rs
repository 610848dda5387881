//! The effects that are followed on a type of machine, estimated jointly and alike in every session.
//!
//! A diagnosis names the fewest effects that explain a session. Where effects resemble one another it names now one and now
//! another, and an estimate beside those that are named jumps although the machine has not changed. So the effects that it
//! names anywhere on a type of machine are followed in all of its sessions, named there or not, estimated jointly from the normal
//! equations that the lake holds.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, bail};
use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::quantity::{Estimate, Quantity, days};
use crate::lake::schema::{EFFECTS, INFORMATION};
use crate::lake::{Lake, counts, flags, moments, numbers, texts};

/// Smallest singular value of columns of unit length at which they are told apart.
const TOLD_APART: f64 = 0.03;
/// Largest share of a parameter in directions that a session does not determine.
const LEAKS: f64 = 1e-3;
/// Smallest eigenvalue of products of columns of unit length that is no rounding.
const SINGULAR: f64 = 1e-10;
/// Sessions of a machine that are fitted together.
const WINDOW: usize = 50;
/// Sessions of a type by which it is judged what they tell apart.
const SAMPLE: usize = 50;

/// Series by machine, type and quantity.
pub(super) type Estimates = BTreeMap<(String, String, Quantity), Vec<Estimate>>;

/// The normal equations of a session, of the effects that may be followed.
#[derive(Clone, Default)]
struct Equations {
    machine: String,
    time: f64,
    squares: f64,
    freedom: f64,
    numbers: Vec<usize>,
    quantities: Vec<Quantity>,
    gradient: Vec<f64>,
    /// Lower triangle by rows.
    information: Vec<Vec<f64>>,
}

impl Equations {
    fn at(&self, a: usize, b: usize) -> f64 {
        self.information[a.max(b)][a.min(b)]
    }

    /// Places of the parameters of an effect.
    fn of(&self, effect: &str) -> impl Iterator<Item = usize> {
        (0..self.quantities.len()).filter(move |place| self.quantities[*place].effect == effect)
    }

    /// Products of columns of unit length.
    fn scaled(&self, places: &[usize]) -> (DMatrix<f64>, Vec<f64>) {
        let lengths: Vec<f64> = places
            .iter()
            .map(|place| self.at(*place, *place).max(f64::MIN_POSITIVE).sqrt())
            .collect();
        let matrix = DMatrix::from_fn(places.len(), places.len(), |a, b| {
            self.at(places[a], places[b]) / (lengths[a] * lengths[b])
        });
        (matrix, lengths)
    }

    /// True where the session tells the parameters of these effects apart.
    fn tells_apart(&self, effects: &[&str]) -> bool {
        let places: Vec<usize> = effects.iter().flat_map(|effect| self.of(effect)).collect();
        let (matrix, _) = self.scaled(&places);
        self.freedom > places.len() as f64 + 1.0
            && matrix.symmetric_eigenvalues().min() >= TOLD_APART * TOLD_APART
    }

    /// True where an effect takes part in a direction in which these effects are not told apart.
    fn confounds(&self, effects: &[&str], effect: &str) -> bool {
        let places: Vec<usize> = effects.iter().flat_map(|one| self.of(one)).collect();
        if places.is_empty() {
            return false;
        }
        let (matrix, _) = self.scaled(&places);
        let eigen = SymmetricEigen::new(matrix);
        let own = |one: &usize| self.quantities[places[*one]].effect == effect;
        (0..places.len())
            .filter(|direction| eigen.eigenvalues[*direction] < TOLD_APART * TOLD_APART)
            .any(|direction| {
                let share = |one: usize| eigen.eigenvectors[(one, direction)].powi(2);
                (0..places.len()).filter(own).map(share).sum::<f64>() > LEAKS
            })
    }

    /// By how much these effects reduce the sum of squares.
    fn explained(&self, effects: &[&str]) -> f64 {
        let places: Vec<usize> = effects.iter().flat_map(|one| self.of(one)).collect();
        if places.is_empty() {
            return 0.0;
        }
        let (matrix, lengths) = self.scaled(&places);
        let eigen = SymmetricEigen::new(matrix);
        let gradient = DVector::from_fn(places.len(), |one, _| {
            self.gradient[places[one]] / lengths[one]
        });
        (0..places.len())
            .filter(|one| eigen.eigenvalues[*one] > SINGULAR)
            .map(|one| {
                eigen.eigenvectors.column(one).dot(&gradient).powi(2) / eigen.eigenvalues[one]
            })
            .sum()
    }

    /// The least squares estimate of the parameters of these effects, as far as the session determines them: quantity, value,
    /// standard uncertainty, noise and degrees of freedom.
    fn estimates(&self, effects: &[&str]) -> Vec<(Quantity, Estimate)> {
        let places: Vec<usize> = effects.iter().flat_map(|effect| self.of(effect)).collect();
        if places.is_empty() {
            return Vec::new();
        }
        let (matrix, lengths) = self.scaled(&places);
        let eigen = SymmetricEigen::new(matrix);
        let count = places.len();
        let determined: Vec<usize> = (0..count)
            .filter(|one| eigen.eigenvalues[*one] >= TOLD_APART * TOLD_APART)
            .collect();
        let freedom = self.freedom - determined.len() as f64;
        if freedom < 2.0 {
            return Vec::new();
        }
        let gradient = DVector::from_fn(count, |one, _| self.gradient[places[one]] / lengths[one]);
        let mut solution = DVector::zeros(count);
        for one in &determined {
            let direction = eigen.eigenvectors.column(*one);
            solution += direction * (direction.dot(&gradient) / eigen.eigenvalues[*one]);
        }
        let noise = ((self.squares - solution.dot(&gradient)).max(0.0) / freedom).sqrt();
        let estimate = |one: usize| {
            let share = |direction: &usize| eigen.eigenvectors[(one, *direction)].powi(2);
            if determined.iter().map(share).sum::<f64>() < 1.0 - LEAKS {
                return None;
            }
            let of = |direction: &usize| share(direction) / eigen.eigenvalues[*direction];
            let variance: f64 = determined.iter().map(of).sum();
            let estimate = Estimate {
                time: self.time,
                value: solution[one] / lengths[one],
                uncertainty: variance.sqrt() * noise / lengths[one],
                noise,
                freedom,
            };
            Some((self.quantities[places[one]].clone(), estimate))
        };
        (0..count).filter_map(estimate).collect()
    }
}

/// Estimates of all effects that are followed: of a type of machine those that the diagnosis has named in at least `sessions`
/// sessions of one machine of that type.
///
/// # Errors
/// The lake cannot be read.
pub(super) fn estimates(lake: &Lake, sessions: usize) -> anyhow::Result<Estimates> {
    let named = named(lake, sessions)?;
    let mut found = Estimates::new();
    for (machine_type, equations) in equations(lake, &named)? {
        let followed = followed(&named[&machine_type], &equations);
        for own in &equations {
            for (quantity, estimate) in own.estimates(&followed) {
                let key = (own.machine.clone(), machine_type.clone(), quantity);
                found.entry(key).or_default().push(estimate);
            }
        }
    }
    Ok(found)
}

/// An effect that the diagnosis has named on a type of machine.
struct Named {
    effect: String,
    /// Sessions in which it was named.
    sessions: usize,
    /// True: in as many sessions of one machine as are asked for.
    often: bool,
}

/// By type of machine the effects that are named, those that are named in most sessions of the type first.
fn named(lake: &Lake, sessions: usize) -> anyhow::Result<BTreeMap<String, Vec<Named>>> {
    let mut bags: BTreeMap<(String, String), BTreeMap<String, BTreeSet<String>>> = BTreeMap::new();
    let columns = ["bag", "machine", "machine_type", "effect", "named"];
    lake.scan(&EFFECTS, &columns, &mut |batch| {
        let (keys, machines, types) = (texts(batch, 0)?, texts(batch, 1)?, texts(batch, 2)?);
        let (effects, named) = (texts(batch, 3)?, flags(batch, 4)?);
        for row in (0..batch.num_rows()).filter(|row| named.value(*row)) {
            let key = [types, effects].map(|column| column.value(row).to_owned());
            let of_machine = bags.entry(key.into()).or_default();
            let own = of_machine
                .entry(machines.value(row).to_owned())
                .or_default();
            own.insert(keys.value(row).to_owned());
        }
        Ok(())
    })?;
    let mut all: BTreeMap<String, Vec<Named>> = BTreeMap::new();
    for ((machine_type, effect), machines) in bags {
        all.entry(machine_type).or_default().push(Named {
            effect,
            sessions: machines.values().map(BTreeSet::len).sum(),
            often: machines.values().any(|bags| bags.len() >= sessions),
        });
    }
    for effects in all.values_mut() {
        effects.sort_by(|a, b| b.sessions.cmp(&a.sessions).then(a.effect.cmp(&b.effect)));
    }
    Ok(all)
}

/// The normal equations of the sessions of each type, of these effects.
fn equations(
    lake: &Lake,
    named: &BTreeMap<String, Vec<Named>>,
) -> anyhow::Result<BTreeMap<String, Vec<Equations>>> {
    let mut all: BTreeMap<String, BTreeMap<String, Equations>> = BTreeMap::new();
    let columns = [
        "bag",
        "machine",
        "machine_type",
        "time",
        "effect",
        "parameter",
        "number",
        "unit",
        "gradient",
        "information",
        "squares",
        "degrees_of_freedom",
    ];
    lake.scan(&INFORMATION, &columns, &mut |batch| {
        let text = |column| texts(batch, column);
        let (keys, machines, types, times) = (text(0)?, text(1)?, text(2)?, moments(batch, 3)?);
        let (effects, parameters, places) = (text(4)?, text(5)?, counts(batch, 6)?);
        let (units, gradients) = (text(7)?, numbers(batch, 8)?);
        let (squares, freedoms) = (numbers(batch, 10)?, numbers(batch, 11)?);
        let products = batch
            .column(9)
            .as_list_opt::<i32>()
            .context("information is no list")?;
        for row in 0..batch.num_rows() {
            let Some(of_type) = named.get(types.value(row)) else {
                continue;
            };
            if !of_type.iter().any(|one| one.effect == effects.value(row)) {
                continue;
            }
            let of_type = all.entry(types.value(row).to_owned()).or_default();
            let session = of_type.entry(keys.value(row).to_owned()).or_default();
            machines.value(row).clone_into(&mut session.machine);
            session.time = days(times.value(row));
            session.squares = squares.value(row);
            session.freedom = freedoms.value(row);
            let number = places.value(row) as usize;
            session.numbers.push(number);
            session.quantities.push(Quantity {
                effect: effects.value(row).to_owned(),
                parameter: parameters.value(row).to_owned(),
                unit: units.value(row).to_owned(),
            });
            session.gradient.push(gradients.value(row));
            let products = products.value(row);
            let products = products.as_primitive_opt::<Float64Type>();
            let product = |place: &usize| {
                products
                    .filter(|all| all.len() > *place)?
                    .value(*place)
                    .into()
            };
            let products: Option<Vec<f64>> = session.numbers.iter().map(product).collect();
            let Some(products) = products else {
                bail!("the information of {} is not in order", keys.value(row));
            };
            session.information.push(products);
        }
        Ok(())
    })?;
    let by_type = all
        .into_iter()
        .map(|(kind, sessions)| (kind, sessions.into_values().collect()));
    Ok(by_type.collect())
}

/// The effects that are followed: those that were named often, as far as most sessions tell them apart.
///
/// Of effects that cannot be told apart in a session those are kept that explain many sessions with the same size: a scale of
/// each axis, say, and not an expansion whose coefficient would have to follow the temperature. An effect that was named
/// rarely takes part in that choice where sessions confound it with those named often. All are fitted to windows of
/// consecutive sessions of each machine, and the one whose removal adds least to the residuals is left out, until the rest is
/// told apart.
fn followed<'e>(named: &'e [Named], sessions: &[Equations]) -> Vec<&'e str> {
    let sample: Vec<&Equations> = sessions
        .iter()
        .step_by(sessions.len().div_ceil(SAMPLE).max(1))
        .collect();
    let often = || named.iter().filter(|one| one.often);
    let mut followed: Vec<&str> = often().map(|one| one.effect.as_str()).collect();
    for rare in named.iter().filter(|one| !one.often) {
        let with: Vec<&str> = often()
            .chain([rare])
            .map(|one| one.effect.as_str())
            .collect();
        let confounded = sample
            .iter()
            .filter(|session| session.confounds(&with, &rare.effect));
        if !followed.is_empty() && 2 * confounded.count() > sample.len() {
            followed.push(&rare.effect);
        }
    }
    let windows = windows(sessions);
    while followed.len() > 1 {
        let apart = sample
            .iter()
            .filter(|session| session.tells_apart(&followed))
            .count();
        if 2 * apart > sample.len() {
            break;
        }
        // In half of the sessions at least an effect must take part in what they cannot tell apart.
        let confounded = |effect: &&str| {
            let lost = sample
                .iter()
                .filter(|session| session.confounds(&followed, effect));
            2 * lost.count() >= sample.len() - apart
        };
        let mut removable: Vec<&str> = followed.iter().copied().filter(confounded).collect();
        if removable.is_empty() {
            removable.clone_from(&followed);
        }
        let cost = |effect: &&str| -> f64 {
            let rest: Vec<&str> = followed
                .iter()
                .copied()
                .filter(|one| one != effect)
                .collect();
            let explained = windows.iter().map(|window| window.explained(&rest));
            -explained.sum::<f64>()
        };
        // Of equals the one that was named least goes.
        let costs: Vec<(f64, &str)> = removable
            .iter()
            .rev()
            .map(|one| (cost(one), *one))
            .collect();
        let Some((_, least)) = costs.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)) else {
            break;
        };
        followed.retain(|one| *one != least);
    }
    followed
}

/// Sums of the normal equations of [`WINDOW`] consecutive sessions of a machine each, of those that have the same parameters.
fn windows(sessions: &[Equations]) -> Vec<Equations> {
    let mut by_machine: BTreeMap<&str, Vec<&Equations>> = BTreeMap::new();
    for session in sessions {
        by_machine
            .entry(&session.machine)
            .or_default()
            .push(session);
    }
    let mut windows = Vec::new();
    for mut own in by_machine.into_values() {
        own.sort_by(|a, b| a.time.total_cmp(&b.time));
        let alike = own.chunk_by(|a, b| a.quantities == b.quantities);
        for window in alike.flat_map(|alike| alike.chunks(WINDOW)) {
            let mut sum = window[0].clone();
            for other in &window[1..] {
                sum.squares += other.squares;
                sum.freedom += other.freedom;
                for (to, from) in sum.gradient.iter_mut().zip(&other.gradient) {
                    *to += from;
                }
                let rows = sum.information.iter_mut().zip(&other.information);
                for (to, from) in rows.flat_map(|(to, from)| to.iter_mut().zip(from)) {
                    *to += from;
                }
            }
            windows.push(sum);
        }
    }
    windows
}
