//! How a displacement that comes and goes shows in each touch: in the reading, of the ball in its mount, of the part.

use inference::linear::dot;
use nalgebra::Vector3;

use crate::observation::{Observations, Row};

/// Directions that show in the touches by less than this share of the largest are left out.
const SHOWN: f64 = 1e-3;

/// For each thing that could switch, its directions over all weighted rows; zero for references, which are no touches.
pub fn switching(observations: &Observations) -> Vec<Vec<Vec<f64>>> {
    let rows = &observations.rows;
    let column = |of: &dyn Fn(&Row) -> Option<f64>| -> Vec<f64> {
        let value = |row: &Row| of(row).map_or(0.0, |value| value * row.weight);
        rows.iter().map(value).collect()
    };
    let reading = vec![column(&|row| row.pose.as_ref().map(|_| 1.0))];
    let mount = |axis: usize| {
        column(&|row| {
            let pose = row.pose.as_ref()?;
            Some(pose.sensitivity.mount[axis].dot(&row.normal))
        })
    };
    let part = |axis: usize| {
        let along = Vector3::ith(axis, 1.0);
        column(&|row| row.pose.as_ref().map(|_| row.normal.dot(&along)))
    };
    let mut all = vec![reading, shown([0, 1, 2].map(mount))];
    let of_part = shown([0, 1, 2].map(part));
    // Where the mount does not turn against the part, a displacement of one is a displacement of the other.
    let turned = |axis: usize| {
        let other = part(axis);
        all[1].iter().all(|own| apart(own, &other))
    };
    if (0..3).any(turned) {
        all.push(of_part);
    }
    all.retain(|columns| !columns.is_empty());
    all
}

/// Columns that show.
fn shown(columns: [Vec<f64>; 3]) -> Vec<Vec<f64>> {
    let powers = columns.each_ref().map(|column| dot(column, column));
    let most = powers.iter().copied().fold(0.0, f64::max);
    let mut columns: Vec<Vec<f64>> = columns.into();
    let mut powers = powers.iter();
    columns.retain(|_| {
        powers
            .next()
            .is_some_and(|&power| power > SHOWN * SHOWN * most)
    });
    columns
}

/// True for columns that differ in more than their sign.
fn apart(one: &[f64], other: &[f64]) -> bool {
    let (own, its) = (dot(one, one), dot(other, other));
    dot(one, other).abs() < (1.0 - SHOWN) * (own * its).sqrt()
}
