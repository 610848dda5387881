//! The part in three dimensions: an orthographic projection as SVG, with touches, deviations and tolerance colours.

mod labels;
mod outline;
mod scene;

use maud::{Markup, html};
use probecell_msgs::{InspectionFeature, InspectionPlan, InspectionPoint};

use self::labels::labels;
use self::outline::{V, outline};
use self::scene::scene;
use super::numbers::signed_um;
use super::sizes::judged;
use crate::state::{CellState, Touch};

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 460.0;
const EDGE: f64 = 46.0;
/// Pixels of the longest arrow.
const ARROW: f64 = 34.0;

/// Where the part is looked at from, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// About the part's z axis, counter-clockwise seen from above.
    pub azimuth: f64,
    /// Above the part's x-y plane.
    pub elevation: f64,
}

impl Default for View {
    fn default() -> Self {
        Self {
            azimuth: -60.0,
            elevation: 25.0,
        }
    }
}

impl View {
    /// A view of these angles, or the default one for those that are missing or no numbers; elevation is kept within ± 90°.
    pub fn of(azimuth: Option<f64>, elevation: Option<f64>) -> Self {
        let known = |value: Option<f64>, default: f64| {
            value.filter(|one| one.is_finite()).unwrap_or(default)
        };
        let standard = Self::default();
        Self {
            azimuth: known(azimuth, standard.azimuth).rem_euclid(360.0),
            elevation: known(elevation, standard.elevation).clamp(-90.0, 90.0),
        }
    }

    /// Right, up and towards the eye, m.
    fn project(self, p: [f64; 3]) -> [f64; 3] {
        let (sa, ca) = self.azimuth.to_radians().sin_cos();
        let (se, ce) = self.elevation.to_radians().sin_cos();
        let right = -sa * p[0] + ca * p[1];
        let towards = ca * p[0] + sa * p[1];
        [right, ce * p[2] - se * towards, ce * towards + se * p[2]]
    }
}

/// Maps projected metres to pixels.
struct Scale {
    middle: [f64; 2],
    factor: f64,
}

impl Scale {
    fn around(all: &[V]) -> Self {
        let range = |i: usize| {
            let values = all.iter().map(move |p| p[i]).filter(|one| one.is_finite());
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), one| {
                (low.min(one), high.max(one))
            })
        };
        let ((a, b), (c, d)) = (range(0), range(1));
        let factor = ((WIDTH - 2.0 * EDGE) / (b - a).max(1e-6))
            .min((HEIGHT - 2.0 * EDGE) / (d - c).max(1e-6));
        Self {
            middle: [f64::midpoint(a, b), f64::midpoint(c, d)],
            factor,
        }
    }

    fn place(&self, p: V) -> (f64, f64) {
        (
            WIDTH / 2.0 + (p[0] - self.middle[0]) * self.factor,
            HEIGHT / 2.0 - (p[1] - self.middle[1]) * self.factor,
        )
    }
}

struct Drawn<'a> {
    index: usize,
    at: (f64, f64),
    depth: f64,
    /// Pixels per metre of deviation, along the projected normal.
    along: (f64, f64),
    hidden: bool,
    touch: Option<&'a Touch>,
    class: &'static str,
}

/// The picture, its legend and its controls.
pub(super) fn picture(cell: &CellState, view: View, path: &str) -> Markup {
    html! {
        @if let Some(plan) = cell.plan.as_ref().filter(|plan| !plan.points.is_empty()) {
            (drawing(cell, plan, view))
            (scene(cell, plan, path))
            (controls(view, path))
        } @else { p.none { "No inspection plan has been published yet." } }
    }
}

fn position(point: &InspectionPoint) -> V {
    let p = &point.position;
    [p.x, p.y, p.z]
}

/// Lines that show the features, each with the number of its feature, in the part's frame.
fn outlines(plan: &InspectionPlan) -> Vec<(usize, Vec<V>)> {
    let of = |number: usize| -> Vec<V> {
        let own = plan
            .points
            .iter()
            .filter(|one| one.feature as usize == number);
        own.map(position).collect()
    };
    let features = plan.features.iter().enumerate();
    let lines = features.flat_map(|(number, feature)| {
        let lines = outline(feature, &of(number)).into_iter();
        lines.map(move |one| (number, one))
    });
    lines.collect()
}

/// m, of the largest deviation, at least a micrometre.
fn largest(cell: &CellState) -> f64 {
    let deviations = cell.touches.values().map(|one| one.deviation.abs());
    let finite = deviations.filter(|one| one.is_finite());
    finite.fold(1e-6, f64::max)
}

fn drawing(cell: &CellState, plan: &InspectionPlan, view: View) -> Markup {
    let outlines: Vec<(usize, Vec<V>)> = outlines(plan)
        .into_iter()
        .map(|(number, line)| (number, line.into_iter().map(|p| view.project(p)).collect()))
        .collect();
    let mut all: Vec<V> = outlines
        .iter()
        .flat_map(|(_, line)| line.iter().copied())
        .collect();
    all.extend(plan.points.iter().map(|one| view.project(position(one))));
    let scale = Scale::around(&all);
    let classes: Vec<&'static str> = classes(cell, plan);
    let nice = nice(largest(cell));
    let drawn = points(cell, plan, view, &scale, &classes, ARROW / nice);
    let newest = cell
        .touches
        .iter()
        .max_by_key(|(_, one)| one.sequence)
        .map(|(index, _)| *index as usize);
    let text = format!(
        "Part {} with {} of {} points touched; table of sizes below",
        plan.part_id,
        cell.touches.len(),
        plan.points.len()
    );
    html! {
        svg.part viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label=(text) {
            defs { @for class in ["good", "unsure", "bad", "plain"] {
                marker #{ "head-" (class) } viewBox="0 0 8 8" refX="6" refY="4" markerWidth="6" markerHeight="6" orient="auto-start-reverse" { path.head.(class) d="M0 0L8 4L0 8z" {} }
            } }
            @for (number, line) in &outlines {
                polygon.face.(classes[*number]) points=(line.iter().map(|p| { let (x, y) = scale.place(*p); format!("{x:.1},{y:.1}") }).collect::<Vec<_>>().join(" ")) { title { (plan.features[*number].id) } }
            }
            @for one in &drawn { (point(one, newest)) }
            @for one in labels(&foremost(&drawn, plan)) { text.name x=(format!("{:.1}", one.x)) y=(format!("{:.1}", one.y)) text-anchor=(if one.right { "end" } else { "start" }) { (one.text) } }
            (axes(view))
            g.scale { line x1="16" x2=(16.0 + ARROW) y1="20" y2="20" {} text x=(22.0 + ARROW) y="24" { (signed_um(nice).trim_start_matches('+')) " µm deviation" } }
        }
    }
}

/// Class of each feature: what the decision rule says of it.
fn classes(cell: &CellState, plan: &InspectionPlan) -> Vec<&'static str> {
    let sizes = judged(cell);
    plan.features
        .iter()
        .map(|feature| {
            let own = sizes.iter().find(|one| {
                one.result.feature_id == feature.id && one.result.plan_id == plan.plan_id
            });
            own.map_or("plain", |one| {
                if one.class.is_empty() {
                    "plain"
                } else {
                    one.class
                }
            })
        })
        .collect()
}

/// The next of 1, 2, 5 times a power of ten.
fn nice(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|step| step * power)
        .into_iter()
        .find(|one| *one >= value * 0.999)
        .unwrap_or(value)
}

fn points<'a>(
    cell: &'a CellState,
    plan: &InspectionPlan,
    view: View,
    scale: &Scale,
    classes: &[&'static str],
    gain: f64,
) -> Vec<Drawn<'a>> {
    let mut drawn: Vec<Drawn<'a>> = plan
        .points
        .iter()
        .enumerate()
        .map(|(index, point)| {
            let p = view.project([point.position.x, point.position.y, point.position.z]);
            let n = view.project([point.normal.x, point.normal.y, point.normal.z]);
            Drawn {
                index,
                at: scale.place(p),
                depth: p[2],
                along: (n[0] * gain, -n[1] * gain),
                hidden: n[2] < -0.05,
                touch: cell.touches.get(&(index as u32)),
                class: classes
                    .get(point.feature as usize)
                    .copied()
                    .unwrap_or("plain"),
            }
        })
        .collect();
    drawn.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    drawn
}

fn point(one: &Drawn<'_>, newest: Option<usize>) -> Markup {
    let (x, y) = one.at;
    let class = format!(
        "{}{}{}",
        one.class,
        if one.hidden { " hidden" } else { "" },
        if newest == Some(one.index) {
            " newest"
        } else {
            ""
        }
    );
    html! {
        @if let Some(touch) = one.touch {
            @let (dx, dy) = (one.along.0 * touch.deviation, one.along.1 * touch.deviation);
            g.touch.(class) data-point=(one.index) data-made=(touch.made.0 / 1_000_000) {
                @if dx.hypot(dy) > 1.5 { line.arrow x1=(format!("{x:.1}")) y1=(format!("{y:.1}")) x2=(format!("{:.1}", x + dx)) y2=(format!("{:.1}", y + dy)) marker-end={ "url(#head-" (one.class) ")" } {} }
                circle cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="3.6" { title { "point " (one.index) ": " (signed_um(touch.deviation)) " µm, standard uncertainty " (format!("{:.1}", touch.standard_uncertainty * 1e6)) " µm" } }
            }
        } @else {
            circle.open.(class) cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="2.6" { title { "point " (one.index) ", not touched yet" } }
        }
    }
}

/// Each feature that is seen, with its foremost point.
fn foremost<'a>(drawn: &[Drawn<'_>], plan: &'a InspectionPlan) -> Vec<(&'a str, (f64, f64))> {
    let of = |(number, feature): (usize, &'a InspectionFeature)| {
        let is_own = |one: &&Drawn<'_>| plan.points[one.index].feature as usize == number;
        let own = drawn.iter().rev().find(is_own)?;
        (!own.hidden).then_some((feature.id.as_str(), own.at))
    };
    plan.features.iter().enumerate().filter_map(of).collect()
}

/// The axes of the part frame in the corner.
fn axes(view: View) -> Markup {
    let (x, y) = (40.0, HEIGHT - 40.0);
    html! { g.frame { @for (name, axis) in [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])] {
        @let p = view.project(axis);
        line x1=(x) y1=(y) x2=(format!("{:.1}", x + 26.0 * p[0])) y2=(format!("{:.1}", y - 26.0 * p[1])) {}
        text x=(format!("{:.1}", x + 34.0 * p[0] - 3.0)) y=(format!("{:.1}", y - 34.0 * p[1] + 4.0)) { (name) }
    } } }
}

/// Links that turn the part; scripts take them over.
fn controls(view: View, path: &str) -> Markup {
    let to = |azimuth: f64, elevation: f64| {
        let turned = View::of(Some(azimuth), Some(elevation));
        let mark = if path.contains('?') { '&' } else { '?' };
        format!(
            "{path}{mark}az={}&el={}#part",
            turned.azimuth, turned.elevation
        )
    };
    let (az, el) = (view.azimuth, view.elevation);
    html! {
        nav.turn aria-label="Turn the part" {
            a href=(to(az - 15.0, el)) data-key="ArrowLeft" aria-label="Turn left" { "◀" }
            a href=(to(az + 15.0, el)) data-key="ArrowRight" aria-label="Turn right" { "▶" }
            a href=(to(az, el + 15.0)) data-key="ArrowUp" aria-label="Tilt up" { "▲" }
            a href=(to(az, el - 15.0)) data-key="ArrowDown" aria-label="Tilt down" { "▼" }
            a href=(to(View::default().azimuth, View::default().elevation)) { "Iso" }
            a href=(to(-90.0, 0.0)) { "Front" }
            a href=(to(0.0, 0.0)) { "Side" }
            a href=(to(-90.0, 90.0)) { "Top" }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seen from +x, y points right and z up; from above with the front below, x points right and y up.
    #[test]
    fn standard_views_are_those_of_a_drawing() {
        let close = |found: V, told: V| {
            assert!(
                found.iter().zip(told).all(|(a, b)| (a - b).abs() < 1e-12),
                "{found:?}"
            );
        };
        let side = View::of(Some(0.0), Some(0.0));
        close(side.project([0.0, 1.0, 0.0]), [1.0, 0.0, 0.0]);
        close(side.project([0.0, 0.0, 1.0]), [0.0, 1.0, 0.0]);
        close(side.project([1.0, 0.0, 0.0]), [0.0, 0.0, 1.0]);
        let top = View::of(Some(-90.0), Some(90.0));
        close(top.project([1.0, 0.0, 0.0]), [1.0, 0.0, 0.0]);
        close(top.project([0.0, 1.0, 0.0]), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn scales_of_arrows_are_round() {
        for (value, told) in [(3.1e-6, 5e-6), (1e-6, 1e-6), (12e-6, 20e-6), (0.9e-6, 1e-6)] {
            assert!((nice(value) - told).abs() < 1e-12, "{value}");
        }
    }
}
