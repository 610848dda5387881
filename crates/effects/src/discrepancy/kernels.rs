//! Covariance kernels of smooth discrepancies: over the part's surface, time, the probe's direction, features, indexations
//! and axis positions.
//!
//! A kernel is the prior covariance of two rows, for a process of about unit variance over the rows.

use std::ops::Neg;
use std::rc::Rc;

use machine::JointKind;
use nalgebra::{Point3, Vector3};

use crate::observation::{Observations, Pose, Row};

/// Correlation length of an angular displacement along an axis, as a share of its travel.
const TURNING: f64 = 0.25;
/// Correlation length of a displacement of an axis along itself that has its own value at every place, as a share of its travel.
const AT_A_PLACE: f64 = 0.005;
/// Levers of an angular displacement below this are rounding, m.
const SHORT: f64 = 1e-5;
/// Rows farther apart than this many correlation lengths are uncorrelated: a part in 10¹³.
const DISTANT: f64 = 8.0;
/// Normals with a larger product are those of one flat surface.
const PARALLEL: f64 = 0.999;
/// Directions whose squared cosine over the rows is larger are one.
const SAME_DIRECTION: f64 = 0.999;
/// An axis that moves less than this (m or rad) causes no discrepancy.
pub(super) const STILL: f64 = 1e-3;

/// Appends a column of the covariance matrix: that of each of some rows with one row.
pub(super) type Kernel<'a> = Box<dyn Fn(&[usize], usize, &mut Vec<f64>) + 'a>;

/// A kernel from the covariance of two rows.
pub(super) fn pairwise<'a>(common: impl Fn(usize, usize) -> f64 + 'a) -> Kernel<'a> {
    Box::new(move |rows, with, column| column.extend(rows.iter().map(|&row| common(row, with))))
}

pub(super) fn pose(row: &Row) -> Option<&Pose> {
    row.pose.as_ref()
}

/// A squared exponential; 0 beyond [`DISTANT`] correlation lengths.
pub(super) fn squared_exponential(distance: f64, length: f64) -> f64 {
    let along = distance / length;
    if along.abs() > DISTANT {
        return 0.0;
    }
    (-0.5 * along * along).exp()
}

pub(super) fn region(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    let places: Rc<[(Point3<f64>, Vector3<f64>)]> =
        rows.iter().map(|row| (row.position, row.normal)).collect();
    let mut size = 0.0_f64;
    for (position, _) in &*places {
        size = size.max((position - places[0].0).norm());
    }
    if size <= 0.0 {
        return Vec::new();
    }
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    for share in [0.05, 0.08, 0.12, 0.19, 0.3, 0.5, 0.8] {
        // Displacements that change over the part, and material that does.
        let near = move |one: &Point3<f64>, other: &Point3<f64>| {
            squared_exponential((one - other).norm(), share * size)
        };
        let displaced = Rc::clone(&places);
        kernels.push(pairwise(move |i, j| {
            let ((one, along), (other, across)) = (&displaced[i], &displaced[j]);
            along.dot(across) * near(one, other)
        }));
        let left = Rc::clone(&places);
        kernels.push(pairwise(move |i, j| near(&left[i].0, &left[j].0)));
    }
    // The part warps: a field of displacements, of second and third order in the place. What is constant or linear in the place is
    // on a single surface its displacement or turn, and not for a field to take with it.
    let single = (places.iter()).all(|(_, normal)| normal.dot(&places[0].1) > PARALLEL);
    let middle = (places.iter()).fold(Vector3::zeros(), |sum, place| sum + place.0.coords)
        / rows.len() as f64;
    for order in [2, 3] {
        let warped: Vec<(Vector3<f64>, Vector3<f64>)> = (places.iter())
            .map(|(position, normal)| ((position.coords - middle) * (2.0 / size), *normal))
            .collect();
        kernels.push(pairwise(move |i, j| {
            let ((one, along), (other, across)) = (&warped[i], &warped[j]);
            let product = one.dot(other);
            let rigid = if single {
                1.0 + f64::from(order) * product
            } else {
                0.0
            };
            along.dot(across) * ((1.0 + product).powi(order) - rigid)
        }));
    }
    kernels
}

pub(super) fn time(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    let begin = rows[0].time;
    let span = observations.span() - begin;
    if span <= 0.0 {
        return Vec::new();
    }
    // Time and direction; reference values have neither.
    let touches: Rc<[(f64, f64, Vector3<f64>)]> = (rows.iter())
        .map(|row| {
            let measured = if row.pose.is_some() { 1.0 } else { 0.0 };
            (row.time - begin, measured, row.normal * measured)
        })
        .collect();
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    for share in [0.015, 0.04, 0.12] {
        let touches = Rc::clone(&touches);
        kernels.push(pairwise(move |i, j| {
            let ((one, is, _), (other, was, _)) = (&touches[i], &touches[j]);
            is * was * squared_exponential(one - other, share * span)
        }));
    }
    for share in [0.04, 0.2] {
        let touches = Rc::clone(&touches);
        kernels.push(pairwise(move |i, j| {
            let ((one, _, along), (other, _, across)) = (&touches[i], &touches[j]);
            along.dot(across) * squared_exponential(one - other, share * span)
        }));
    }
    kernels.extend(time_along_machine(rows, begin, span));
    // Steps and random walk: Brownian motion of the reading, and of the part against the probe.
    let wandering = Rc::clone(&touches);
    kernels.push(pairwise(move |i, j| {
        let ((one, is, _), (other, was, _)) = (&wandering[i], &wandering[j]);
        is * was * one.min(*other) / span
    }));
    kernels.push(pairwise(move |i, j| {
        let ((one, _, along), (other, _, across)) = (&touches[i], &touches[j]);
        along.dot(across) * one.min(*other) / span
    }));
    kernels
}

/// Displacements of the ball over time along one direction of the probe's mount or of the foundation, each direction once: what
/// warms grows along the machine, however the part is turned under it. Smooth, and Brownian motion from the start.
fn time_along_machine(rows: &[Row], begin: f64, span: f64) -> Vec<Kernel<'static>> {
    let mut directions: Vec<Vec<f64>> = Vec::new();
    for frame in [
        |pose: &Pose| pose.sensitivity.mount,
        |pose: &Pose| pose.sensitivity.foundation,
    ] {
        for axis in 0..3 {
            let seen = |row: &Row| pose(row).map_or(0.0, |pose| frame(pose)[axis].dot(&row.normal));
            let seen: Vec<f64> = rows.iter().map(seen).collect();
            let power: f64 = seen.iter().map(|value| value * value).sum();
            let alike = |known: &Vec<f64>| {
                let product: f64 = known
                    .iter()
                    .zip(&seen)
                    .map(|(one, other)| one * other)
                    .sum();
                let other: f64 = known.iter().map(|value| value * value).sum();
                product * product > SAME_DIRECTION * power * other
            };
            if power > 0.0 && !directions.iter().any(alike) {
                directions.push(seen);
            }
        }
    }
    let mut kernels: Vec<Kernel<'static>> = Vec::new();
    for seen in directions {
        let touches: Rc<[(f64, f64)]> = (rows.iter().zip(seen))
            .map(|(row, seen)| (row.time - begin, seen))
            .collect();
        let smooth = Rc::clone(&touches);
        kernels.push(pairwise(move |i, j| {
            let ((one, along), (other, across)) = (smooth[i], smooth[j]);
            along * across * squared_exponential(one - other, 0.2 * span)
        }));
        kernels.push(pairwise(move |i, j| {
            let ((one, along), (other, across)) = (touches[i], touches[j]);
            along * across * one.min(other) / span
        }));
    }
    kernels
}

pub(super) fn measured(rows: &[Row], i: usize, j: usize) -> f64 {
    f64::from(u8::from(rows[i].pose.is_some() && rows[j].pose.is_some()))
}

pub(super) fn direction(observations: &Observations) -> Vec<Kernel<'_>> {
    // The normal in the probe's frame.
    let facing = |row: &Row| {
        let mount = &row.pose.as_ref()?.sensitivity.mount;
        Some(Vector3::from_fn(|axis, _| mount[axis].dot(&row.normal)))
    };
    let directions: Rc<[Option<Vector3<f64>>]> = observations.rows.iter().map(facing).collect();
    [0.25, 0.7]
        .map(|length| {
            let directions = Rc::clone(&directions);
            pairwise(move |i, j| match (&directions[i], &directions[j]) {
                (Some(one), Some(other)) => squared_exponential((one - other).norm(), length),
                _ => 0.0,
            })
        })
        .into()
}

pub(super) fn feature(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    if rows.iter().all(|row| row.feature == rows[0].feature) {
        return Vec::new();
    }
    let same = |i: usize, j: usize| f64::from(u8::from(rows[i].feature == rows[j].feature));
    let mut kernels: Vec<Kernel<'_>> = vec![pairwise(same)];
    for length in [0.2, 0.45] {
        // Form: what depends on where a curved feature is touched.
        kernels.push(pairwise(move |i, j| {
            same(i, j) * squared_exponential((rows[i].normal - rows[j].normal).norm(), length)
        }));
    }
    kernels
}

pub(super) fn index(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    if rows.iter().all(|row| row.index == rows[0].index) {
        return Vec::new();
    }
    let same = move |i: usize, j: usize| {
        f64::from(u8::from(rows[i].index == rows[j].index)) * measured(rows, i, j)
    };
    let reach = rows
        .iter()
        .map(|row| row.position.coords.norm())
        .fold(0.0, f64::max)
        .max(f64::MIN_POSITIVE);
    vec![
        pairwise(move |i, j| same(i, j) * rows[i].normal.dot(&rows[j].normal)),
        // At each index the whole part lies elsewhere: displaced and turned.
        pairwise(move |i, j| {
            let (one, other) = (&rows[i], &rows[j]);
            let lever = |row: &Row| row.position.coords.cross(&row.normal) / reach;
            same(i, j) * (one.normal.dot(&other.normal) + lever(one).dot(&lever(other)))
        }),
    ]
}

/// Where and how strongly a displacement that depends on an axis is seen: probing, then cutting.
pub(super) type Displacements<T> = Vec<[(T, f64); 2]>;

/// Displacements that depend on one axis: in any direction of the foundation, or in one direction of the axis's frame.
pub(super) fn displacement_along_axis(observations: &Observations, axis: usize) -> Vec<Kernel<'_>> {
    let (low, high) = observations.travel(axis);
    if high - low < STILL {
        return Vec::new();
    }
    let range = high - low;
    let joint = observations.chain.axes()[axis];
    let turns = observations.chain.axis(axis).kind == JointKind::Revolute;
    let rows = &observations.rows;
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    let all: Rc<Displacements<Vector3<f64>>> = Rc::new(displacements(rows, axis, |row, pose| {
        let foundation = &pose.sensitivity.foundation;
        Vector3::from_fn(|k, _| row.normal.dot(&foundation[k]))
    }));
    for share in [0.03, 0.08, 0.25] {
        let all = Rc::clone(&all);
        kernels.push(pairwise(move |i, j| {
            shared_displacement(&all[i], &all[j], share * range, Vector3::dot)
        }));
    }
    for component in 0..3 {
        let one = Rc::new(in_direction_of_joint(observations, axis, component));
        for share in [0.04, 0.1, 0.3] {
            let one = Rc::clone(&one);
            kernels.push(pairwise(move |i, j| {
                shared_displacement(&one[i], &one[j], share * range, |one, other| one * other)
            }));
        }
    }
    // Along its own direction anything from place to place: short waves, which readings at the same place share, and noise does not.
    let along = Rc::new(displacements(rows, axis, |row, pose| {
        row.normal.dot(&pose.sensitivity.axes[axis])
    }));
    if !turns {
        kernels.push(pairwise(move |i, j| {
            shared_displacement(&along[i], &along[j], AT_A_PLACE * range, |one, other| {
                one * other
            })
        }));
    }
    // Turns that depend on the axis, at the size of the displacement that they make.
    for component in 3..6 {
        let mut one = displacements(rows, axis, |row, pose| {
            row.normal.dot(&pose.sensitivity.motion[joint][component])
        });
        let levers = one.iter().flatten();
        let reach = levers.map(|atom| atom.0.abs()).fold(0.0, f64::max);
        if reach < SHORT {
            continue;
        }
        for atom in one.iter_mut().flatten() {
            atom.0 /= reach;
        }
        kernels.push(pairwise(move |i, j| {
            shared_displacement(&one[i], &one[j], TURNING * range, |one, other| one * other)
        }));
    }
    kernels
}

/// Displacements in one direction of the frame of an axis: of where it is carried if it turns, else of what it carries.
pub(super) fn in_direction_of_joint(
    observations: &Observations,
    axis: usize,
    component: usize,
) -> Displacements<f64> {
    let joint = observations.chain.axes()[axis];
    let turns = observations.chain.axis(axis).kind == JointKind::Revolute;
    displacements(&observations.rows, axis, |row, pose| {
        let frames = if turns {
            &pose.sensitivity.location
        } else {
            &pose.sensitivity.motion
        };
        row.normal.dot(&frames[joint][component])
    })
}

/// Displacement of each row while probing (which moves the ball against the part), and while cutting.
fn displacements<T>(rows: &[Row], axis: usize, seen: impl Fn(&Row, &Pose) -> T) -> Displacements<T>
where
    T: Default + Neg<Output = T>,
{
    let atom = |row: &Row, pose: Option<&Pose>| {
        pose.map_or((T::default(), 0.0), |pose| {
            (seen(row, pose), pose.positions[axis])
        })
    };
    let both = |row: &Row| {
        let (probing, at) = atom(row, row.pose.as_ref());
        [(-probing, at), atom(row, row.cut.as_ref())]
    };
    rows.iter().map(both).collect()
}

/// Covariance of two rows under a displacement with correlation length `length`.
pub(super) fn shared_displacement<T>(
    one: &[(T, f64); 2],
    other: &[(T, f64); 2],
    length: f64,
    product: impl Fn(&T, &T) -> f64,
) -> f64 {
    let mut sum = 0.0;
    for (seen, at) in one {
        for (also, there) in other {
            let product = product(seen, also);
            if product != 0.0 {
                sum += product * squared_exponential(at - there, length);
            }
        }
    }
    sum
}
