//! Recorded sessions of a machine that errs while it probes: what its controller latches, from the errors of its chain.
//!
//! Metres and radians, part frame, which is the frame of the workpiece. The true ball touches the true surface, a plane
//! at each place; what the controller then reads is found from the chain with its errors, and recorded by `touches`.

use diagnosis::Session;
use machine::{Chain, ChainErrors, Target};
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use probecell_msgs::{InspectionFeature, InspectionPlan, InspectionPoint, MachiningOperation};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use crate::scenarios::ScenarioError;
use crate::scenarios::touches;

/// Radius of the ball, m.
const BALL: f64 = 0.001;
/// Steps that bring the erring ball onto the surface; each leaves the share of the errors' angles.
const STEPS: usize = 4;

/// One touch.
#[derive(Clone, Debug)]
pub(crate) struct Touch {
    /// Place in the names of the features.
    pub(crate) feature: usize,
    /// Nominal point, m.
    pub(crate) point: Point3<f64>,
    /// Outward normal.
    pub(crate) normal: Unit<Vector3<f64>>,
    /// Prescribed positions while probing, rad.
    pub(crate) rotary: Vec<f64>,
    /// The operation that cut it.
    pub(crate) operation: i32,
    /// Height along the tool that cut it, m.
    pub(crate) tool_height: f64,
    /// Material left there, m.
    pub(crate) left: f64,
}

/// A machine, and what it is given to probe.
pub(crate) struct Probed<'a> {
    pub(crate) robot_description: &'a str,
    pub(crate) errors: &'a ChainErrors,
    /// Ball centre in the probe mount, m.
    pub(crate) ball: Point3<f64>,
    pub(crate) rotary_names: &'a [&'a str],
    pub(crate) features: Vec<String>,
    /// Prescribed positions of each operation while cutting, rad.
    pub(crate) operations: Vec<Vec<f64>>,
    /// Radius of the tool of all operations, m.
    pub(crate) tool_radius: f64,
    /// True where the part was cut in this clamping.
    pub(crate) cut_here: bool,
    /// Standard deviation of a touch, m.
    pub(crate) noise: f64,
}

impl Probed<'_> {
    /// Tip error against the part (m, part frame) while the machine cuts `point` at prescribed positions.
    pub(crate) fn cutting_error(
        &self,
        chain: &Chain,
        point: &Point3<f64>,
        rotary: &[f64],
    ) -> Result<Vector3<f64>, ScenarioError> {
        let positions = self.reach(chain, point, rotary)?;
        let part = Isometry3::identity();
        Ok(chain.ball_in_part_with(&positions, &part, &self.ball, self.errors) - point)
    }

    /// The session, with noise from `seed`.
    pub(crate) fn session(
        &self,
        name: &str,
        touches: &[Touch],
        seed: u64,
    ) -> Result<Session, ScenarioError> {
        let chain = Chain::from_urdf(self.robot_description)?;
        let mut random = Pcg64::seed_from_u64(seed);
        let mut latched = Vec::with_capacity(touches.len());
        for (point, touch) in touches.iter().enumerate() {
            let noise: f64 = StandardNormal.sample(&mut random);
            let deviation = self.latched(&chain, touch, touch.left + self.noise * noise)?;
            latched.push(touches::Touch { point, deviation });
        }
        let plan = self.plan(name, touches);
        touches::session(name, self.robot_description, plan, &latched)
    }

    /// How far off the plan (m) the nominal chain has the ball when the true one is `left` and its radius away from the
    /// nominal surface.
    fn latched(&self, chain: &Chain, touch: &Touch, left: f64) -> Result<f64, ScenarioError> {
        let part = Isometry3::identity();
        let mut away = left;
        for _ in 0..STEPS {
            let ball = touch.point + touch.normal.into_inner() * (BALL + away);
            let read = self.reach(chain, &ball, &touch.rotary)?;
            let true_ball = chain.ball_in_part_with(&read, &part, &self.ball, self.errors);
            away -= touch.normal.dot(&(true_ball - touch.point)) - BALL - left;
        }
        Ok(away)
    }

    fn reach(
        &self,
        chain: &Chain,
        ball: &Point3<f64>,
        rotary: &[f64],
    ) -> Result<Vec<f64>, ScenarioError> {
        let axes = chain.axes().len();
        let mut prescribed = vec![None; axes];
        for (name, &position) in self.rotary_names.iter().zip(rotary) {
            if let Some(axis) = chain.axis_index(name) {
                prescribed[axis] = Some(position);
            }
        }
        let target = Target {
            ball: *ball,
            orientation: None,
        };
        let start = vec![0.0; axes];
        Ok(chain.reach(
            &target,
            &prescribed,
            &start,
            &Isometry3::identity(),
            &self.ball,
        )?)
    }

    fn plan(&self, name: &str, touches: &[Touch]) -> InspectionPlan {
        let of_feature = |index: usize| touches.iter().find(|touch| touch.feature == index);
        let features = self.features.iter().enumerate().map(|(index, id)| {
            let first = of_feature(index);
            InspectionFeature {
                id: id.clone(),
                kind: InspectionFeature::PLANE,
                origin: first.map_or_else(Default::default, |touch| {
                    touches::point(touch.point.coords.into())
                }),
                axis: first.map_or_else(Default::default, |touch| {
                    touches::vector(touch.normal.into_inner())
                }),
                lower_tolerance: -20e-6,
                upper_tolerance: 20e-6,
                ..InspectionFeature::default()
            }
        });
        let operations =
            self.operations
                .iter()
                .enumerate()
                .map(|(number, rotary)| MachiningOperation {
                    id: format!("operation_{}", number + 1),
                    tool_number: 1,
                    tool_radius: self.tool_radius,
                    feed: 1000.0e-3 / 60.0,
                    finish: true,
                    rotary_positions: rotary.clone(),
                });
        let points = touches.iter().map(|touch| InspectionPoint {
            feature: touch.feature as u32,
            rotary_positions: touch.rotary.clone(),
            operation: touch.operation,
            tool_height: touch.tool_height,
            ..touches::planned(touch.point.coords.into(), touch.normal.into_inner())
        });
        InspectionPlan {
            machined_on_this_machine: self.cut_here,
            rotary_names: self.rotary_names.iter().map(ToString::to_string).collect(),
            operations: operations.collect(),
            ..touches::plan(
                name,
                self.ball.coords.into(),
                BALL,
                features.collect(),
                points.collect(),
            )
        }
    }
}
