//! The machine, tool and parts of `docs/source_systems.md, E`, and sessions in which its planar test is probed.
//! Metres and radians.

use machine::models::XFYZBA;
use machine::{Chain, ChainErrors};
use machining::flank::simulated::{FlankCase, PlanarTest};
use machining::flank::{ConeFrustum, RadiusProfile, RuledPart, SPiece};
use nalgebra::{Point3, Vector3};

use diagnosis::Session;

use crate::scenarios::ScenarioError;
use crate::scenarios::probed::{Probed, Touch};

/// Seeds whose mean the source gives.
pub(crate) const SEEDS: u64 = 12;

/// The case with the source's defaults.
pub(crate) fn case() -> Result<FlankCase, ScenarioError> {
    Ok(FlankCase::standard(Chain::from_urdf(XFYZBA)?)?)
}

/// The two test parts for the cutter of a case.
pub(crate) struct Parts {
    pub(crate) s: SPiece,
    pub(crate) cone: ConeFrustum,
}

impl Parts {
    pub(crate) fn of(case: &FlankCase) -> Result<Self, ScenarioError> {
        Ok(Self {
            s: SPiece::new(case.tool.radius)?,
            cone: ConeFrustum::new(case.tool.radius),
        })
    }
}

/// What a planar test tells of the tool.
pub(crate) struct Told {
    /// From the face towards +y alone.
    pub(crate) one_face: RadiusProfile,
    /// From both faces.
    pub(crate) two_faces: RadiusProfile,
}

impl Told {
    pub(crate) fn by(test: &PlanarTest) -> Result<Self, ScenarioError> {
        let (heights, plus, minus) = (&test.heights, &test.plus, &test.minus);
        Ok(Self {
            one_face: RadiusProfile::from_one_face(heights, plus)?,
            two_faces: RadiusProfile::from_two_faces(heights, plus, minus)?,
        })
    }
}

/// Cells of a map of a part: along the path and up the ruling.
pub(crate) const MAP: (usize, usize) = (48, 13);

/// A map of a part: `value` (m) at path parameter and share of the ruling, over the share of the path and the height.
pub(crate) fn map(
    part: &impl RuledPart,
    label: &str,
    mut value: impl FnMut(f64, f64) -> Result<f64, ScenarioError>,
) -> Result<report::Heat, ScenarioError> {
    let (first, last) = part.domain();
    let share = |column: f64| 0.02 + 0.96 * column / MAP.0 as f64;
    let mut values = Vec::with_capacity(MAP.0 * MAP.1);
    for row in 0..MAP.1 {
        let v = (row as f64 + 0.5) / MAP.1 as f64;
        for column in 0..MAP.0 {
            values.push(value(
                first + (last - first) * share(column as f64 + 0.5),
                v,
            )?);
        }
    }
    let height = part.ruling(f64::midpoint(first, last));
    Ok(report::Heat {
        x: (0..=MAP.0).map(|column| share(column as f64)).collect(),
        y: (0..=MAP.1)
            .map(|row| height * row as f64 / MAP.1 as f64)
            .collect(),
        values,
        label: label.to_owned(),
        unit: report::Unit::UM,
        scale: None,
    })
}

/// Maps of one quantity on one scale of colours: that of the largest value of all.
pub(crate) fn on_one_scale<const N: usize>(maps: [report::Heat; N]) -> [report::Heat; N] {
    let values = maps.iter().flat_map(|map| &map.values);
    let largest = values
        .filter(|value| value.is_finite())
        .fold(0.0_f64, |most, value| most.max(value.abs()));
    maps.map(|map| report::Heat {
        scale: Some(largest),
        ..map
    })
}

/// A plot that shows a map.
pub(crate) fn map_plot(title: &str, heat: report::Heat) -> report::Plot {
    report::Plot::new(
        title,
        report::Axis::new("share of the path", report::Unit::PERCENT),
        report::Axis::new("height on the ruling", report::Unit::MM),
    )
    .with(report::Series::Heat(heat))
    .with_size(640, 240)
}

/// A rib, milled along x, as it is probed.
pub(crate) struct Rib<'a> {
    /// Faces by the sign of y.
    pub(crate) faces: &'a [f64],
    /// Heights along the tool, m.
    pub(crate) heights: &'a [f64],
    /// True where it was milled in this clamping.
    pub(crate) cut_here: bool,
    /// Touches of a gauge beside it, which no tool of the plan has cut.
    pub(crate) gauge: bool,
}

impl Rib<'_> {
    /// The session; `left` is the material left (m) on a face at a height.
    pub(crate) fn session(
        &self,
        name: &str,
        case: &FlankCase,
        left: impl Fn(f64, f64) -> f64,
        seed: u64,
    ) -> Result<Session, ScenarioError> {
        let errors = ChainErrors::none(case.chain.joints().len());
        let mut probed = Probed {
            robot_description: XFYZBA,
            errors: &errors,
            ball: case.head.tip(),
            rotary_names: &["B", "A", "S"],
            features: Vec::new(),
            operations: vec![vec![0.0; 3]],
            tool_radius: case.tool.radius,
            cut_here: self.cut_here,
            noise: case.noise,
        };
        let mut touches = Vec::new();
        let spindle = |place: usize| {
            vec![
                0.0,
                0.0,
                if place.is_multiple_of(2) {
                    0.0
                } else {
                    std::f64::consts::PI
                },
            ]
        };
        for &side in self.faces {
            let feature = probed.features.len();
            probed.features.push(
                if side > 0.0 {
                    "face_plus"
                } else {
                    "face_minus"
                }
                .to_owned(),
            );
            for station in 0..4 {
                for &height in self.heights {
                    touches.push(Touch {
                        feature,
                        point: Point3::new(0.012 * f64::from(station + 1), side * 0.005, height),
                        normal: if side > 0.0 {
                            Vector3::y_axis()
                        } else {
                            -Vector3::y_axis()
                        },
                        rotary: spindle(touches.len()),
                        operation: 0,
                        tool_height: height,
                        left: left(side, height),
                    });
                }
            }
        }
        if self.gauge {
            let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
            for (id, normal) in [
                ("gauge_x", x),
                ("gauge_-x", -x),
                ("gauge_y", y),
                ("gauge_-y", -y),
                ("gauge_z", z),
            ] {
                let feature = probed.features.len();
                probed.features.push(id.to_owned());
                for place in 0..6 {
                    let across =
                        Vector3::new(normal.y, normal.z, normal.x) * (1e-3 * f64::from(place));
                    touches.push(Touch {
                        feature,
                        point: Point3::new(0.1, 0.0, 0.02) + normal.into_inner() * 0.01 + across,
                        normal,
                        rotary: spindle(touches.len()),
                        operation: -1,
                        tool_height: 0.0,
                        left: 0.0,
                    });
                }
            }
        }
        probed.session(name, &touches, seed)
    }
}
