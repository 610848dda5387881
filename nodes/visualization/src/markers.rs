//! Points, touches, deviations and verdicts, as markers in the frame of the part.

use std::collections::BTreeMap;

use graph::Stamp;
use probecell_msgs::{
    InspectionPlan, InspectionPoint, Verdict, geometry_msgs,
    std_msgs::ColorRGBA,
    visualization_msgs::{Marker, MarkerArray},
};
use serde::{Deserialize, Serialize};

use crate::{config::Config, transforms::PART};

/// Coverage factor of the expanded uncertainty (GUM 6.2.1).
const COVERAGE: f64 = 2.0;
/// Diameter of a touch where the plan states no ball, m.
const DIAMETER: f64 = 2e-3;
/// Width of a line over the diameter of a touch.
const LINE: f64 = 0.2;

const GREY: [f32; 4] = [0.6, 0.6, 0.6, 0.6];
const GREEN: [f32; 4] = [0.1, 0.65, 0.25, 1.0];
const ORANGE: [f32; 4] = [0.9, 0.45, 0.0, 1.0];
const BLUE: [f32; 4] = [0.1, 0.4, 0.85, 1.0];
const RED: [f32; 4] = [0.8, 0.1, 0.1, 1.0];

/// What a touch said.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Touched {
    /// m, along the outward normal; material in excess is positive.
    pub deviation: f64,
    /// Standard uncertainty, m.
    pub uncertainty: f64,
}

/// What is drawn of one plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// The plan.
    pub plan: InspectionPlan,
    /// Indices of its points in the order of the measurement; empty while no order is known.
    pub order: Vec<u32>,
    /// The last touch of each point, by the point's index.
    pub touches: BTreeMap<u32, Touched>,
    /// The last verdict on each feature, by the feature's id.
    pub verdicts: BTreeMap<String, u8>,
}

impl Scene {
    /// A plan of which nothing has been touched.
    pub(crate) fn of(plan: InspectionPlan) -> Self {
        Self {
            plan,
            order: Vec::new(),
            touches: BTreeMap::new(),
            verdicts: BTreeMap::new(),
        }
    }

    /// All markers, after a request to delete all others.
    pub(crate) fn markers(&self, config: &Config, now: Stamp) -> MarkerArray {
        let radius = self.plan.stylus.ball_radius;
        let diameter = if radius > 0.0 { 2.0 * radius } else { DIAMETER };
        let draw = Draw {
            header: now.header(PART),
            diameter,
        };
        let mut markers = vec![Marker {
            action: Marker::DELETEALL,
            ..draw.marker("", Marker::POINTS, 0.0)
        }];
        let points = &self.plan.points;
        let all = points.iter().map(|point| (point.position, GREY));
        markers.push(draw.list("points", Marker::SPHERE_LIST, 0.5, all));
        let ordered = self
            .order
            .iter()
            .filter_map(|&index| points.get(index as usize));
        let path = ordered.map(|point| (point.position, GREY));
        markers.push(draw.list("order", Marker::LINE_STRIP, LINE / 2.0, path));
        let touched = || {
            let known = self.touches.iter();
            known.filter_map(|(&index, touch)| Some((points.get(index as usize)?, touch)))
        };
        let spheres = touched().map(|(point, touch)| (point.position, colour(touch)));
        markers.push(draw.list("touches", Marker::SPHERE_LIST, 1.0, spheres));
        let lines = touched().flat_map(|(point, touch)| {
            let end = along(point, touch.deviation * config.magnification);
            [point.position, end].map(|at| (at, colour(touch)))
        });
        markers.push(draw.list("deviations", Marker::LINE_LIST, LINE, lines));
        // A list without points is an error in RViz.
        markers.retain(|marker| marker.action == Marker::DELETEALL || !marker.points.is_empty());
        markers.extend(self.labels(&draw));
        markers.extend(self.composed(&draw));
        MarkerArray { markers }
    }

    fn labels(&self, draw: &Draw) -> impl Iterator<Item = Marker> {
        (0..).zip(&self.plan.features).map(|(id, feature)| {
            let verdict = self.verdicts.get(&feature.id).copied();
            let of_it = self
                .plan
                .points
                .iter()
                .filter(|point| point.feature == id as u32);
            let mut at = centre(of_it).unwrap_or(feature.origin);
            at.z += 2.0 * draw.diameter;
            draw.label("features", id, at, &feature.id, verdict)
        })
    }

    /// Verdicts on what is no feature of the plan, such as a distance of two: above the part, one above the other.
    fn composed(&self, draw: &Draw) -> impl Iterator<Item = Marker> {
        let points = &self.plan.points;
        let mut at = centre(points.iter()).unwrap_or_default();
        let heights = points.iter().map(|point| point.position.z);
        at.z = heights.fold(at.z, f64::max);
        let is_feature = |id: &String| self.plan.features.iter().any(|one| one.id == *id);
        let others = self.verdicts.iter().filter(move |(id, _)| !is_feature(id));
        (0..).zip(others).map(move |(number, (id, &verdict))| {
            let mut at = at;
            at.z += f64::from(number + 3) * 2.5 * draw.diameter;
            draw.label("characteristics", number, at, id, Some(verdict))
        })
    }
}

/// What all markers have in common.
struct Draw {
    header: probecell_msgs::std_msgs::Header,
    /// Of a touch, m.
    diameter: f64,
}

impl Draw {
    /// A marker of a size over the diameter of a touch.
    fn marker(&self, namespace: &str, kind: i32, size: f64) -> Marker {
        let scale = size * self.diameter;
        Marker {
            header: self.header.clone(),
            ns: namespace.to_owned(),
            r#type: kind,
            action: Marker::ADD,
            pose: geometry_msgs::Pose {
                orientation: geometry_msgs::Quaternion {
                    w: 1.0,
                    ..geometry_msgs::Quaternion::default()
                },
                ..geometry_msgs::Pose::default()
            },
            scale: geometry_msgs::Vector3 {
                x: scale,
                y: scale,
                z: scale,
            },
            color: rgba(GREY),
            ..Marker::default()
        }
    }

    /// Name and verdict at a position of the part.
    fn label(
        &self,
        namespace: &str,
        id: i32,
        at: geometry_msgs::Point,
        name: &str,
        verdict: Option<u8>,
    ) -> Marker {
        let mut marker = self.marker(namespace, Marker::TEXT_VIEW_FACING, 2.0);
        marker.id = id;
        marker.pose.position = at;
        marker.color = rgba(verdict.map_or(GREY, verdict_colour));
        marker.text = match verdict {
            None => name.to_owned(),
            Some(verdict) => format!("{name}: {}", Verdict::word(verdict)),
        };
        marker
    }

    fn list(
        &self,
        namespace: &str,
        kind: i32,
        size: f64,
        points: impl Iterator<Item = (geometry_msgs::Point, [f32; 4])>,
    ) -> Marker {
        let (points, colours): (Vec<_>, Vec<_>) = points.unzip();
        Marker {
            points,
            colors: colours.into_iter().map(rgba).collect(),
            ..self.marker(namespace, kind, size)
        }
    }
}

fn colour(touch: &Touched) -> [f32; 4] {
    if touch.deviation.abs() <= COVERAGE * touch.uncertainty {
        GREEN
    } else if touch.deviation > 0.0 {
        ORANGE
    } else {
        BLUE
    }
}

fn verdict_colour(verdict: u8) -> [f32; 4] {
    match verdict {
        Verdict::QUALIFIED => GREEN,
        Verdict::COMPENSABLE | Verdict::INDETERMINATE => ORANGE,
        _ => RED,
    }
}

fn rgba([r, g, b, a]: [f32; 4]) -> ColorRGBA {
    ColorRGBA { r, g, b, a }
}

/// The point moved by `length` (m) along its outward normal.
fn along(point: &InspectionPoint, length: f64) -> geometry_msgs::Point {
    let (at, normal) = (&point.position, &point.normal);
    geometry_msgs::Point {
        x: at.x + normal.x * length,
        y: at.y + normal.y * length,
        z: at.z + normal.z * length,
    }
}

/// Mean position; `None` of no points.
fn centre<'a>(points: impl Iterator<Item = &'a InspectionPoint>) -> Option<geometry_msgs::Point> {
    let mut sum = geometry_msgs::Point::default();
    let mut count = 0.0;
    for InspectionPoint { position, .. } in points {
        sum.x += position.x;
        sum.y += position.y;
        sum.z += position.z;
        count += 1.0;
    }
    (count > 0.0).then(|| geometry_msgs::Point {
        x: sum.x / count,
        y: sum.y / count,
        z: sum.z / count,
    })
}
