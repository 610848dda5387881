//! A figure of the part: nominal points in oblique view, parallel projection, deviations as arrows along the normals.
//!
//! The part frame's z is up; the eye stands at +x, −y, +z. A length in the plane of the picture keeps its length; one
//! towards the eye is foreshortened. Metres.

use crate::kit::{Arrow, Axis, Name, Plot, Series, Side, Unit};

/// Direction of the eye from the part: angle from +x about z, and above the x–y plane, rad.
const AZIMUTH: f64 = -std::f64::consts::FRAC_PI_3;
const ELEVATION: f64 = 0.5;

/// Right and up of a direction or place of the part frame in the picture.
pub(crate) fn seen([x, y, z]: [f64; 3]) -> (f64, f64) {
    let ((sin_a, cos_a), (sin_e, cos_e)) = (AZIMUTH.sin_cos(), ELEVATION.sin_cos());
    let right = -sin_a * x + cos_a * y;
    let up = -sin_e * (cos_a * x + sin_a * y) + cos_e * z;
    (right, up)
}

/// A deviation at a nominal point, m.
#[derive(Clone, Copy)]
pub(crate) struct Deviation {
    pub(crate) position: [f64; 3],
    pub(crate) normal: [f64; 3],
    pub(crate) size: f64,
}

/// Deviations as arrows; a deviation of `scale` (m) is drawn longest.
pub(crate) fn view(title: &str, caption: &str, deviations: &[Deviation], scale: f64) -> Plot {
    let arrows = |more: bool| -> Vec<Arrow> {
        let own = deviations.iter().filter(|one| (one.size >= 0.0) == more);
        own.map(|one| Arrow {
            at: seen(one.position),
            vector: seen(one.normal.map(|part| part * one.size)),
        })
        .collect()
    };
    let points: Vec<[f64; 3]> = deviations.iter().map(|one| one.position).collect();
    let plot = Plot::new(
        title,
        Axis::new("to the right", Unit::MM),
        Axis::new("up", Unit::MM),
    )
    .with(Series::arrows(
        "material in excess (outwards)",
        arrows(true),
        Unit::UM,
        scale,
    ))
    .with(Series::arrows(
        "material missing (inwards)",
        arrows(false),
        Unit::UM,
        scale,
    ));
    plot.with(frame(&points))
        .with_same_scale()
        .with_size(480, 400)
        .with_caption(caption)
}

/// The box around the points with the ranges of the part's coordinates.
fn frame(points: &[[f64; 3]]) -> Series {
    let range = |axis: usize| {
        let values = points.iter().map(|point| point[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        })
    };
    let [x, y, z] = [range(0), range(1), range(2)];
    let corner = |number: usize| {
        let pick = |(low, high): (f64, f64), bit: usize| {
            if number & bit == 0 { low } else { high }
        };
        [pick(x, 1), pick(y, 2), pick(z, 4)]
    };
    let mut lines = Vec::new();
    for number in 0..8 {
        for bit in [1, 2, 4] {
            if number & bit == 0 {
                lines.push([seen(corner(number)), seen(corner(number | bit))]);
            }
        }
    }
    let middle = |(low, high): (f64, f64)| 0.5 * (low + high);
    let text = |name: &str, (low, high): (f64, f64)| {
        let shown = |value: f64| format!("{:.0}", value * Unit::MM.factor);
        format!("{name}: {} to {} mm", shown(low), shown(high))
    };
    let name = |at: [f64; 3], text: String, side: Side| Name {
        at: seen(at),
        text,
        side,
    };
    // The edges of the box that face the eye below, and the end of the farthest upright one.
    let names = vec![
        name([middle(x), y.0, z.0], text("x", x), Side::BelowLeft),
        name([x.1, middle(y), z.0], text("y", y), Side::BelowRight),
        name([x.0, y.1, z.1], text("z", z), Side::Above),
    ];
    Series::Frame { lines, names }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The directions of the picture are perpendicular and of length one, so lengths in its plane are kept.
    #[test]
    fn the_projection_is_orthographic() {
        let columns = [
            seen([1.0, 0.0, 0.0]),
            seen([0.0, 1.0, 0.0]),
            seen([0.0, 0.0, 1.0]),
        ];
        let dot = |pick: &dyn Fn(&(f64, f64)) -> f64| columns.iter().map(pick).sum::<f64>();
        assert!((dot(&|c| c.0 * c.0) - 1.0).abs() < 1e-12);
        assert!((dot(&|c| c.1 * c.1) - 1.0).abs() < 1e-12);
        assert!(dot(&|c| c.0 * c.1).abs() < 1e-12);
        assert!(columns[0].0 > 0.0, "x goes to the right");
        assert!(
            columns[2].1 > 0.0 && columns[2].0.abs() < 1e-12,
            "z goes up"
        );
    }
}
