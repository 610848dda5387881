//! Fields over the part, their size and roughness estimated apart from what effects of the vocabulary do to the whole part.
//!
//! A sufficiently smooth field is nearly a displacement with scales and shears: it absorbs a tilt or a scale of similar size,
//! and since its prior allows any size it pays less for them than they pay for themselves. Where there are readings enough,
//! its variance and correlation length are taken from the contrasts that displacements linear in the place do not reach
//! (restricted maximum likelihood: Patterson and Thompson 1971; Harville 1977), and only then effects are searched beside it:
//! a module of the model that does not learn from the others (Liu, Bayarri and Berger 2009). How probable a field is stays
//! as it was. Metres.

use std::rc::Rc;

use inference::candidate::Candidate;
use inference::discrepancy::{Discrepancy, Kind};
use inference::evidence::{InnerProducts, log_sum};
use inference::linear::{SPANNED, orthonormal};
use inference::posterior::Model;
use inference::whitened::Design;
use nalgebra::{DMatrix, DVector};

use super::candidate_pool::CandidatePool;
use super::with_discrepancy::{powers, search_beside};

/// Fields together less probable than this are left alone.
const SEEN: f64 = 1e-3;
/// Variances and lengths with less than this share of the best restricted likelihood are left out.
const SHARE: f64 = 0.05;
/// Fields beside which the library is searched, at most.
const MOST: usize = 4;
/// Rows for each column that is taken out of them, at least: of fewer, what the columns reach says more about the field than
/// the contrasts do.
const ROWS_FOR_EACH: usize = 40;

/// Replaces the models with a field over the part by those beside fields of restricted likelihood, of the same probability
/// together; false where they stay as they are.
pub(super) fn restrict(
    pool: &CandidatePool<'_>,
    discrepancies: &[Rc<Discrepancy>],
    models: &mut Vec<Model>,
) -> bool {
    let is_field = |model: &Model| {
        (model.discrepancy).is_some_and(|(index, _)| discrepancies[index].kind == Kind::Region)
    };
    let best = |fields: bool| {
        let own = models.iter().filter(|model| is_field(model) == fields);
        own.max_by(|one, other| one.log_posterior.total_cmp(&other.log_posterior))
    };
    let Some(leader) = best(true) else {
        return false;
    };
    let highest = best(false).map_or(leader.log_posterior, |other| {
        other.log_posterior.max(leader.log_posterior)
    });
    let scores = models.iter().filter(|model| is_field(model));
    let all = log_sum(scores.map(|model| model.log_posterior));
    if all < highest + SEEN.ln() {
        return false;
    }
    let Some(fields) = fields(pool, discrepancies, &leader.set) else {
        return false;
    };
    let design = Design::new(pool.candidates.iter(), pool.y, &pool.rows());
    let mut found: Vec<Model> = Vec::new();
    for (weight, index, power) in fields {
        let mut beside = search_beside(pool, &design, &discrepancies[index], (index, power));
        let sum = log_sum(beside.iter().map(|model| model.log_posterior));
        for model in &mut beside {
            model.log_posterior += all + weight - sum;
        }
        found.extend(beside);
    }
    models.retain(|model| !is_field(model));
    models.extend(found);
    true
}

/// Fields by restricted likelihood: the logarithm of their share, the index of the discrepancy and its variance over that of
/// the noise; `None` where too few rows are left.
fn fields(
    pool: &CandidatePool<'_>,
    discrepancies: &[Rc<Discrepancy>],
    set: &[usize],
) -> Option<Vec<(f64, usize, f64)>> {
    let touches = pool.shapes.observations.touches();
    if touches < pool.active.len() {
        return None;
    }
    let mut columns = linear_in_place(pool);
    let members = set
        .iter()
        .flat_map(|&member| &pool.candidates[member].block);
    columns.extend(members.cloned());
    for column in &mut columns {
        let unused = column
            .iter_mut()
            .zip(pool.active)
            .filter(|(_, used)| !**used);
        unused.for_each(|(value, _)| *value = 0.0);
    }
    let basis = orthonormal(columns.into_iter(), SPANNED);
    let used = pool.active.iter().filter(|used| **used).count();
    if used < ROWS_FOR_EACH * basis.len() {
        return None;
    }
    let columns = candidate(basis);
    let block = [columns.block.as_slice()];
    let plain =
        InnerProducts::with_lag1(&block, pool.y, pool.active, touches, pool.lag1_correlation);
    let design = Design::new(std::iter::once(&columns), pool.y, &pool.rows());
    let mut all: Vec<(f64, usize, f64)> = Vec::new();
    for (index, discrepancy) in discrepancies.iter().enumerate() {
        if discrepancy.kind != Kind::Region {
            continue;
        }
        let whitened = design.with_discrepancy(discrepancy);
        for &power in powers(discrepancy) {
            let likelihood = restricted_log_likelihood(&whitened.products(power, &plain))?;
            all.push((likelihood + discrepancy.log_prior, index, power));
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let best = all.first()?.0;
    all.truncate(MOST);
    all.retain(|field| field.0 > best + SHARE.ln());
    let sum = log_sum(all.iter().map(|field| field.0));
    for field in &mut all {
        field.0 -= sum;
    }
    Some(all)
}

/// Columns as a candidate, each with its coefficient as a parameter.
fn candidate(block: Vec<Vec<f64>>) -> Candidate {
    Candidate {
        variant: 0,
        shape: 0.0,
        plausible: vec![1.0; block.len()],
        parameters_from_block: DMatrix::identity(block.len(), block.len()),
        log_prior: 0.0,
        second_order: false,
        block,
    }
}

/// What is alike for all touches, and what displacements that are linear in the place do to the weighted rows.
fn linear_in_place(pool: &CandidatePool<'_>) -> Vec<Vec<f64>> {
    let rows = &pool.shapes.observations.rows;
    let mut columns = vec![rows.iter().map(|row| row.weight).collect::<Vec<f64>>()];
    for along in 0..3 {
        let seen = rows.iter().map(|row| row.normal[along] * row.weight);
        columns.push(seen.clone().collect());
        columns.extend((0..3).map(|place| {
            let places = rows.iter().map(|row| row.position[place]);
            seen.clone()
                .zip(places)
                .map(|(seen, at)| seen * at)
                .collect()
        }));
    }
    columns
}

/// Logarithm of the likelihood of the contrasts that the columns do not reach, at the noise that is most likely; `None` where
/// the columns cannot be told apart.
fn restricted_log_likelihood(products: &InnerProducts) -> Option<f64> {
    let count = products.qy.len();
    let along = DVector::from_column_slice(&products.qy);
    let factor = DMatrix::from_row_slice(count, count, &products.qq).cholesky()?;
    let left = products.yy - along.dot(&factor.solve(&along));
    let roots = factor.l_dirty().diagonal();
    let log_determinant: f64 = roots.iter().map(|root| root.ln()).sum();
    let freedom = products.rows - count as f64;
    Some(-0.5 * freedom * left.max(f64::MIN_POSITIVE).ln() - log_determinant - products.offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the density of orthonormal contrasts: the columns' orthogonal complement, with the same covariance.
    #[test]
    fn the_restricted_likelihood_is_that_of_the_contrasts() {
        let (rows, count, power) = (14, 3, 2.5);
        let value =
            |row: usize, column: usize| ((row * 37 + column * 101 + 7) % 23) as f64 / 23.0 - 0.4;
        let columns = |from: usize, many: usize| -> Vec<Vec<f64>> {
            let column = |number| (0..rows).map(|row| value(row, from + number)).collect();
            (0..many).map(column).collect()
        };
        let basis = orthonormal(columns(0, count).into_iter(), SPANNED);
        let y: Vec<f64> = (0..rows).map(|row| value(row * row, 5)).collect();
        let made = columns(11, 4);
        let field = Discrepancy::new(Kind::Region, &made, 0.0);
        let active = vec![true; rows];
        let block = candidate(basis.clone());
        let plain = InnerProducts::with_lag1(&[basis.as_slice()], &y, &active, rows, 0.0);
        let all = inference::columns::Rows {
            active,
            touches: rows,
            lag1_correlation: 0.0,
        };
        let likelihood = |power: f64| {
            let design = Design::new(std::iter::once(&block), &y, &all);
            restricted_log_likelihood(&design.with_discrepancy(&field).products(power, &plain))
                .expect("columns")
        };
        // Contrasts: the rest of a complete basis.
        let units =
            (0..rows).map(|unit| (0..rows).map(move |row| f64::from(u8::from(row == unit))));
        let mut whole = basis.clone();
        for unit in units {
            inference::linear::append(&mut whole, unit.collect(), 1e-6);
        }
        let contrasts = DMatrix::from_fn(rows, rows - count, |row, k| whole[count + k][row]);
        let down = DMatrix::from_vec(rows, 4, made.concat());
        let exact = |power: f64| {
            let covariance = DMatrix::identity(rows, rows) + &down * down.transpose() * power;
            let seen = contrasts.transpose() * covariance * &contrasts;
            let along = contrasts.transpose() * DVector::from_column_slice(&y);
            let factor = seen.cholesky().expect("positive definite");
            let left = along.dot(&factor.solve(&along));
            -0.5 * along.len() as f64 * left.ln() - 0.5 * factor.determinant().ln()
        };
        let difference = likelihood(power) - likelihood(0.1);
        assert!((difference - (exact(power) - exact(0.1))).abs() < 1e-9);
    }
}
