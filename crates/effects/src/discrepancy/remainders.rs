//! What is small beside every known cause and never quite absent: a form of each feature, a field over the part, a wander in
//! time, and on an arm what depends on the pose.

use nalgebra::Vector3;

use super::kernels::{Kernel, pairwise, squared_exponential};
use crate::observation::Observations;
use crate::variant::is_arm;
use inference::discrepancy::Kind;

/// Correlation length of a field, as a share of the part.
const FIELD: f64 = 0.25;
/// Correlation length of a wander, as a share of the touches.
const WANDER: f64 = 0.12;
/// Correlation length over the positions of all joints, rad.
const POSE: f64 = 0.6;
/// Fewest features that can have a form each.
const FEATURES: usize = 3;
/// A part smaller than this is a point, m.
const POINT: f64 = 1e-6;

/// Kernels of the remainders of a session, each of about unit variance at a row.
pub(super) fn kernels(observations: &Observations) -> Vec<(Kind, Kernel<'_>)> {
    let rows = &observations.rows;
    let along = |i: usize, j: usize| rows[i].normal.dot(&rows[j].normal);
    let mut all: Vec<(Kind, Kernel<'_>)> = Vec::new();
    let mut features: Vec<usize> = rows.iter().map(|row| row.feature).collect();
    features.sort_unstable();
    features.dedup();
    if features.len() >= FEATURES {
        let same = |i: usize, j: usize| f64::from(u8::from(rows[i].feature == rows[j].feature));
        all.push((Kind::Feature, pairwise(same)));
    }
    let (mut low, mut high) = (
        Vector3::repeat(f64::INFINITY),
        Vector3::repeat(f64::NEG_INFINITY),
    );
    for row in rows {
        low = low.inf(&row.position.coords);
        high = high.sup(&row.position.coords);
    }
    let size = (high - low).max();
    if size > POINT {
        let near = move |i: usize, j: usize| {
            let apart = (rows[i].position - rows[j].position).norm();
            along(i, j) * squared_exponential(apart, FIELD * size)
        };
        all.push((Kind::Region, pairwise(near)));
    }
    // By rank: a pause between two touches is no reason for them to differ. Where the time begins anew, another session does.
    let mut session = 0;
    let of_row = |row: usize| {
        session += usize::from(row > 0 && rows[row].time < rows[row - 1].time);
        session
    };
    let session: Vec<usize> = (0..rows.len()).map(of_row).collect();
    let sessions = session.last().map_or(1, |last| last + 1);
    let length = WANDER * rows.len() as f64 / sessions as f64;
    let wander = move |i: usize, j: usize| {
        let together = f64::from(u8::from(session[i] == session[j]));
        together * squared_exponential(i as f64 - j as f64, length)
    };
    all.push((Kind::Time, pairwise(wander)));
    if is_arm(&observations.chain) {
        let pose = move |i: usize, j: usize| {
            let (Some(one), Some(other)) = (&rows[i].pose, &rows[j].pose) else {
                return 0.0;
            };
            let squares = one.positions.iter().zip(&other.positions);
            let apart: f64 = squares.map(|(a, b)| (a - b) * (a - b)).sum();
            along(i, j) * squared_exponential(apart.sqrt(), POSE)
        };
        all.push((Kind::Index, pairwise(pose)));
    }
    all
}
