//! Lines that show a feature: its nominal shape over the places that are touched.

use probecell_msgs::InspectionFeature;

/// Sides of a drawn circle.
const SIDES: usize = 48;

/// A vector, m.
pub(super) type V = [f64; 3];

fn add(a: V, b: V, k: f64) -> V {
    [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]]
}

fn dot(a: V, b: V) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn cross(a: V, b: V) -> V {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(a: V) -> V {
    let length = dot(a, a).sqrt();
    if length > 0.0 {
        add([0.0; 3], a, 1.0 / length)
    } else {
        [0.0, 0.0, 1.0]
    }
}

/// Two directions across an axis.
fn across(axis: V) -> (V, V) {
    let helper = if axis[2].abs() < 0.9 {
        [0.0, 0.0, 1.0]
    } else {
        [1.0, 0.0, 0.0]
    };
    let u = unit(cross(helper, axis));
    (u, cross(axis, u))
}

/// Lines of a feature in the part frame: each a closed polygon.
pub(super) fn outline(feature: &InspectionFeature, points: &[V]) -> Vec<Vec<V>> {
    let axis = unit([feature.axis.x, feature.axis.y, feature.axis.z]);
    let origin = [feature.origin.x, feature.origin.y, feature.origin.z];
    let (u, v) = across(axis);
    let along = |p: &V| dot(add(*p, origin, -1.0), axis);
    let ring = |height: f64, radius: f64| -> Vec<V> {
        (0..SIDES)
            .map(|i| {
                let (s, c) = (i as f64 / SIDES as f64 * std::f64::consts::TAU).sin_cos();
                add(add(add(origin, axis, height), u, radius * c), v, radius * s)
            })
            .collect()
    };
    let (low, high) = points
        .iter()
        .map(along)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), one| {
            (low.min(one), high.max(one))
        });
    if !(low <= high) {
        return Vec::new();
    }
    match feature.kind {
        InspectionFeature::CYLINDER | InspectionFeature::BORE => {
            let room = if high > low {
                0.1 * (high - low)
            } else {
                0.3 * feature.radius
            };
            vec![
                ring(low - room, feature.radius),
                ring(high + room, feature.radius),
            ]
        }
        InspectionFeature::CONE => [low, high]
            .map(|height| {
                ring(
                    height,
                    (feature.radius + height * feature.half_angle.tan()).abs(),
                )
            })
            .into(),
        InspectionFeature::SPHERE => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|normal: V| {
                let (u, v) = across(normal);
                (0..SIDES)
                    .map(|i| {
                        let (s, c) = (i as f64 / SIDES as f64 * std::f64::consts::TAU).sin_cos();
                        add(add(origin, u, feature.radius * c), v, feature.radius * s)
                    })
                    .collect()
            })
            .into(),
        InspectionFeature::PLANE => vec![patch(origin, u, v, points)],
        _ => vec![points.to_vec()],
    }
}

/// The rectangle of a plane that holds its points, with a little room.
fn patch(origin: V, u: V, v: V, points: &[V]) -> Vec<V> {
    let extent = |direction: V| {
        let all = points.iter().map(|p| dot(add(*p, origin, -1.0), direction));
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), one| {
            (low.min(one), high.max(one))
        })
    };
    let ((a, b), (c, d)) = (extent(u), extent(v));
    let room = 0.25 * (b - a).max(d - c).max(2e-3);
    [
        (a - room, c - room),
        (b + room, c - room),
        (b + room, d + room),
        (a - room, d + room),
    ]
    .map(|(s, t)| add(add(origin, u, s), v, t))
    .into()
}
