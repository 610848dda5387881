//! Settings of the simulated machine.

use std::collections::BTreeMap;

use machine::{Chain, Nominal, PositionError, Target};
use nalgebra::{Point3, Vector3};
use probecell_msgs::InspectionPlan;
use serde::{Deserialize, Serialize};

use crate::{
    probe,
    tool::{RawRunout, Runout},
    truth::{RawMachine, Truth, TruthError},
};

/// As written in the cell file, section `[simulator]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfig {
    /// Seed of all randomness.
    pub seed: u64,
    /// Axis positions at the start, by axis name.
    #[serde(default)]
    pub home: BTreeMap<String, HomePosition>,
    /// The true probe.
    pub probe: RawProbe,
    /// How tools cut.
    pub plant: RawPlant,
    /// How the machine really is beside its robot description.
    #[serde(default)]
    pub machine: RawMachine,
    /// The tools.
    #[serde(default)]
    pub tools: Vec<RawTool>,
    /// The sizes of the part.
    #[serde(default)]
    pub sizes: Vec<RawSize>,
    /// Features whose surface is what it is point by point.
    #[serde(default)]
    pub surfaces: Vec<RawSurface>,
    /// The operations that cut them.
    #[serde(default)]
    pub operations: Vec<RawOperation>,
    /// The reference instrument that measures each measured part again; none if absent.
    pub cmm: Option<RawCmm>,
    /// Something that goes wrong.
    pub fault: Option<RawFault>,
}

/// A home position in the unit of its axis.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, untagged)]
pub enum HomePosition {
    /// Of a linear axis.
    Linear {
        /// Position.
        position_mm: f64,
    },
    /// Of a rotary axis.
    Rotary {
        /// Position.
        position_deg: f64,
    },
}

/// The true probe against what the controller has stored of it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawProbe {
    /// True ball centre less the stored one, in `probe_mount`.
    pub center_error_um: [f64; 3],
    /// True ball radius less the stored one.
    pub radius_error_um: f64,
    /// Standard deviation of one touch.
    pub touch_sd_um: f64,
    /// Run the calibration cycle (source systems A.5) at the start.
    #[serde(default)]
    pub calibrated: bool,
    /// Error of the diameter of the gauge that the calibration trusts.
    #[serde(default)]
    pub gauge_error_um: f64,
}

/// How tools cut (source systems A.4, plant).
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawPlant {
    /// Share of the depth of cut that springs back.
    pub spring_back: f64,
    /// Standard deviation of a size cut.
    pub cut_sd_um: f64,
    /// Error of the diameter near the chuck and at the free end after rough turning (source systems A.6).
    #[serde(default)]
    pub deflection_um: [f64; 2],
    /// Length over which it grows, from the part's origin.
    #[serde(default = "default_length")]
    pub deflection_length_mm: f64,
    /// Share of that error that a finishing cut leaves.
    #[serde(default = "default_finish_share")]
    pub finish_share: f64,
}

fn default_length() -> f64 {
    90.0
}

fn default_finish_share() -> f64 {
    0.1
}

/// A tool: what it leaves too much, and the wear offset that the controller starts with.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawTool {
    /// Its number.
    pub number: u32,
    /// Material that it leaves on a size when its offsets are right.
    pub error_um: f64,
    /// Wear offset at the start (on the size).
    #[serde(default)]
    pub wear_um: f64,
    /// How it runs out.
    pub runout: Option<RawRunout>,
}

/// A feature whose surface is known point by point.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawSurface {
    /// The feature.
    pub feature: String,
    /// How far outside its nominal place each touched point lies, in the order of the plan: of an uncut feature as it
    /// came, of a cut one what the process leaves every time.
    pub deviation_um: Vec<f64>,
}

/// A size of the part.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawSize {
    /// Its name.
    pub id: String,
    /// The features that carry it: one round one, or the two planes of a width.
    pub features: Vec<String>,
    /// Drawing size.
    pub nominal_mm: f64,
    /// Size before machining.
    pub stock_mm: f64,
    /// What the reference instrument finds too much on this size alone: the residuals of the source's Tables 3 and 4,
    /// which lie within its repeatability.
    #[serde(default)]
    pub cmm_residual_um: f64,
}

/// An operation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a switch of the cell file"
)]
pub struct RawOperation {
    /// Its name.
    pub id: String,
    /// Tool that cuts.
    pub tool_number: u32,
    /// Sizes that it cuts.
    #[serde(default)]
    pub sizes: Vec<String>,
    /// Features whose surface it leaves where the machine, with its errors, really leads the tool.
    #[serde(default)]
    pub features: Vec<String>,
    /// It begins with a new blank: what an earlier cut took off too much is there again.
    #[serde(default)]
    pub new_blank: bool,
    /// The controller goes by its volumetric table, in this cut and in the measurement after it.
    #[serde(default)]
    pub volumetric: bool,
    /// Allowance that it leaves.
    #[serde(default)]
    pub allowance_mm: f64,
    /// It turns a part that is held at one end: the part bends away.
    #[serde(default)]
    pub turning: bool,
    /// It is a finishing cut.
    #[serde(default)]
    pub finish: bool,
    /// How long it takes.
    pub duration_s: f64,
    /// Spindle speed.
    pub spindle_rpm: f64,
}

/// The reference instrument.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawCmm {
    /// Its name.
    pub instrument: String,
    /// Standard uncertainty of a deviation, as it declares it.
    pub standard_uncertainty_um: f64,
    /// Standard deviation of its single touches; what else it errs is common to a size.
    #[serde(default)]
    pub touch_sd_um: f64,
}

/// Something that goes wrong after some touches.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawFault {
    /// What.
    pub kind: Injected,
    /// Touches of the session before it does.
    #[serde(default)]
    pub after_touches: u32,
    /// Touches that a probe fails at before it is well again; none: all that follow.
    #[serde(default)]
    pub touches: Option<u32>,
}

/// What can go wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Injected {
    /// The probe does not trigger.
    DeadProbe,
    /// The probe stays triggered.
    StuckProbe,
    /// The probe triggers in a move that is not a probing move.
    UnplannedTouch,
    /// Somebody presses the button.
    Estop,
    /// The controller says nothing more.
    Silence,
}

/// m or rad; a part that is clamped farther off is no small displacement.
const LARGEST_CLAMPING: f64 = 0.01;

/// Position (m) and outward normal of a touch, part frame.
pub(crate) type Place = (Point3<f64>, Vector3<f64>);

/// As checked: m, rad, s.
#[derive(Clone, Debug)]
pub struct Config {
    /// The machine, from its URDF.
    pub chain: Chain,
    /// Axis positions at the start, in the order of the chain's axes.
    pub home: Vec<f64>,
    /// m; true ball centre less the stored one in `probe_mount`, after the calibration if there is one.
    pub center_error: [f64; 3],
    /// m; true radius of the stylus ball less the stored one, after the calibration if there is one.
    pub radius_error: f64,
    /// Errors of the axes.
    pub truth: Truth,
    /// What the controller's volumetric table takes them for as the controller starts.
    pub table: Truth,
    /// Displacement of the clamped part in its nominal frame: m along, rad about x, y, z.
    pub clamping: [f64; 6],
    /// Indices of the axes (in the chain's axes) whose work offset the controller tells.
    pub work_offset_axes: Vec<usize>,
    /// Run-out of the tools that have one, by number.
    pub runout: BTreeMap<u32, Runout>,
    /// How each feature is cut point by point, by operation of the cell file and feature.
    pub cuts: BTreeMap<(String, String), Cut>,
    /// m; what the process leaves at each point of a feature, or how an uncut one came.
    pub surfaces: BTreeMap<String, Vec<f64>>,
    /// Where the part's own touches of each feature lie: position (m) and outward normal, part frame.
    pub places: BTreeMap<String, Vec<Place>>,
    /// As written, lengths still in the units of their names.
    pub raw: RawConfig,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// A number out of range.
    #[error("simulator.{0}")]
    Number(String),
    /// A home position of an axis that the machine lacks, or in the unit of the other kind of axis.
    #[error(
        "simulator.home.{0}: not an axis of the machine, or mm for a rotary or deg for a linear axis"
    )]
    Home(String),
    /// An axis whose work offset cannot be.
    #[error(
        "simulator.machine.work_offset_axes: {0:?} is not a linear axis of the machine, or it stands there twice"
    )]
    WorkOffset(String),
    /// An error of the machine that cannot be.
    #[error("simulator.{0}")]
    Truth(#[from] TruthError),
    /// A feature with another number of points than deviations.
    #[error(
        "simulator.surfaces: {feature:?} is touched at {points} points, but deviation_um has {given}"
    )]
    Points {
        /// The feature.
        feature: String,
        /// Points of the plan.
        points: usize,
        /// Deviations given.
        given: usize,
    },
    /// A point that the tool cannot reach.
    #[error(
        "simulator.operations.{operation}: point {point} of {feature:?} cannot be cut: {reason}"
    )]
    Cut {
        /// The operation.
        operation: String,
        /// The feature.
        feature: String,
        /// Index of the point in the plan.
        point: usize,
        /// Why not.
        reason: String,
    },
    /// A name that is not defined.
    #[error("simulator.{place}: {kind} {name:?} is not defined")]
    Unknown {
        /// Where.
        place: String,
        /// Kind of thing.
        kind: &'static str,
        /// Its name.
        name: String,
    },
}

impl RawConfig {
    /// Checks the settings against the machine and the plan of the finished part.
    pub fn check(&self, chain: Chain, plan: &InspectionPlan) -> Result<Config, ConfigError> {
        let mut home: Vec<f64> = (0..chain.axes().len())
            .map(|index| {
                chain
                    .axis(index)
                    .limits
                    .map_or(0.0, |(lower, upper)| 0.0_f64.clamp(lower, upper))
            })
            .collect();
        for (name, position) in &self.home {
            let bad = || ConfigError::Home(name.clone());
            let index = chain.axis_index(name).ok_or_else(bad)?;
            home[index] = match (position, chain.axis(index).kind) {
                (HomePosition::Linear { position_mm }, machine::JointKind::Prismatic) => {
                    position_mm * 1e-3
                }
                (HomePosition::Rotary { position_deg }, machine::JointKind::Revolute) => {
                    position_deg.to_radians()
                }
                _ => return Err(bad()),
            };
        }
        self.check_numbers()?;
        self.check_names()?;
        let ball_radius = plan.stylus.ball_radius + self.probe.radius_error_um * 1e-6;
        let (center_error, radius_error) = probe::stored(self, ball_radius);
        let truth = Truth::new(&self.machine.errors, &chain)?;
        let table = Truth::table(&self.machine.table, &chain)?;
        let mut work_offset_axes = Vec::new();
        for name in &self.machine.work_offset_axes {
            let axis = chain.axis_index(name);
            let axis = axis.filter(|&axis| chain.axis(axis).kind == machine::JointKind::Prismatic);
            let axis = axis.filter(|axis| !work_offset_axes.contains(axis));
            work_offset_axes.push(axis.ok_or_else(|| ConfigError::WorkOffset(name.clone()))?);
        }
        let mut config = Config {
            truth,
            table,
            clamping: self.machine.clamping.displacement(),
            work_offset_axes,
            runout: self
                .tools
                .iter()
                .filter_map(|tool| Some((tool.number, tool.runout.as_ref()?.check())))
                .collect(),
            cuts: BTreeMap::new(),
            surfaces: self.surfaces(plan)?,
            places: places(plan),
            chain,
            home,
            center_error,
            radius_error,
            raw: self.clone(),
        };
        for operation in &self.operations {
            for feature in &operation.features {
                let cut = config.cut_by_machine(operation, feature, plan)?;
                let key = (operation.id.clone(), feature.clone());
                config.cuts.insert(key, cut);
            }
        }
        Ok(config)
    }

    /// Deviations (m) of the features that are known point by point.
    fn surfaces(&self, plan: &InspectionPlan) -> Result<BTreeMap<String, Vec<f64>>, ConfigError> {
        let mut surfaces = BTreeMap::new();
        for raw in &self.surfaces {
            let points = points_of(plan, &raw.feature).count();
            if raw.deviation_um.len() != points {
                return Err(ConfigError::Points {
                    feature: raw.feature.clone(),
                    points,
                    given: raw.deviation_um.len(),
                });
            }
            let metres = raw.deviation_um.iter().map(|value| value * 1e-6);
            surfaces.insert(raw.feature.clone(), metres.collect());
        }
        Ok(surfaces)
    }

    fn check_numbers(&self) -> Result<(), ConfigError> {
        let not_negative = [
            ("probe.touch_sd_um", self.probe.touch_sd_um),
            ("plant.cut_sd_um", self.plant.cut_sd_um),
            (
                "cmm.standard_uncertainty_um",
                self.cmm
                    .as_ref()
                    .map_or(0.0, |cmm| cmm.standard_uncertainty_um),
            ),
            (
                "cmm.touch_sd_um",
                self.cmm.as_ref().map_or(0.0, |cmm| cmm.touch_sd_um),
            ),
        ];
        let clamping = self.machine.clamping.displacement();
        if let Some(value) = clamping
            .iter()
            .find(|value| !(value.abs() <= LARGEST_CLAMPING))
        {
            return Err(ConfigError::Number(format!(
                "machine.clamping: {value} m or rad must lie within ±{LARGEST_CLAMPING}"
            )));
        }
        for (key, value) in not_negative {
            if !(value.is_finite() && value >= 0.0) {
                return Err(ConfigError::Number(format!(
                    "{key} = {value} must be a finite number that is not negative"
                )));
            }
        }
        if !(0.0..1.0).contains(&self.plant.spring_back) {
            let value = self.plant.spring_back;
            return Err(ConfigError::Number(format!(
                "plant.spring_back = {value} must be at least 0 and below 1"
            )));
        }
        for operation in &self.operations {
            if !(operation.duration_s.is_finite() && operation.duration_s > 0.0) {
                let (id, value) = (&operation.id, operation.duration_s);
                return Err(ConfigError::Number(format!(
                    "operations.{id}.duration_s = {value} must be above 0"
                )));
            }
        }
        Ok(())
    }

    fn check_names(&self) -> Result<(), ConfigError> {
        for operation in &self.operations {
            let place = format!("operations.{}", operation.id);
            let tooled = !operation.sizes.is_empty() || operation.tool_number > 0;
            if tooled
                && !self
                    .tools
                    .iter()
                    .any(|tool| tool.number == operation.tool_number)
            {
                return Err(ConfigError::Unknown {
                    place,
                    kind: "tool",
                    name: operation.tool_number.to_string(),
                });
            }
            for size in &operation.sizes {
                if !self.sizes.iter().any(|known| known.id == *size) {
                    return Err(ConfigError::Unknown {
                        place,
                        kind: "size",
                        name: size.clone(),
                    });
                }
            }
        }
        Ok(())
    }
}

/// Position and normal of every point, by feature, in the order of the plan.
fn places(plan: &InspectionPlan) -> BTreeMap<String, Vec<Place>> {
    let mut places: BTreeMap<String, Vec<Place>> = BTreeMap::new();
    for point in &plan.points {
        if let Some(feature) = plan.features.get(point.feature as usize) {
            let (at, out) = (&point.position, &point.normal);
            let place = (
                Point3::new(at.x, at.y, at.z),
                Vector3::new(out.x, out.y, out.z),
            );
            places.entry(feature.id.clone()).or_default().push(place);
        }
    }
    places
}

/// Index in the plan of every point of a feature.
pub(crate) fn points_of<'a>(
    plan: &'a InspectionPlan,
    feature: &'a str,
) -> impl Iterator<Item = usize> + 'a {
    let owner = plan.features.iter().position(|known| known.id == feature);
    (0..plan.points.len()).filter(move |&point| Some(plan.points[point].feature as usize) == owner)
}

/// How a feature is cut point by point.
#[derive(Clone, Debug)]
pub struct Cut {
    part: Nominal,
    /// The controller goes by its volumetric table.
    volumetric: bool,
    points: Vec<CutPoint>,
}

/// One point of it.
#[derive(Clone, Debug)]
struct CutPoint {
    place: Place,
    /// Programme positions of the axes, m and rad.
    positions: Vec<f64>,
    /// m; what the tool's run-out cuts too deep.
    swells: f64,
}

impl Cut {
    /// Points that are cut.
    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }
}

impl Config {
    /// The volumetric table with those values of its entries.
    pub(crate) fn table_of(&self, values: &[f64]) -> Truth {
        self.table.with_entries(values)
    }

    /// Positions of the axes that a programme with these work offsets (m) is led to.
    pub(crate) fn offset(&self, positions: &[f64], work_offsets: &[f64]) -> Vec<f64> {
        let mut offset = positions.to_vec();
        for (&axis, value) in self.work_offset_axes.iter().zip(work_offsets) {
            offset[axis] += value;
        }
        offset
    }

    /// What is really off at axis positions (m, rad): the axes, and the part as it is clamped.
    pub(crate) fn errors(&self, positions: &[f64]) -> machine::ChainErrors {
        let mut errors = self.truth.at(&self.chain, positions);
        for (error, own) in errors.part.iter_mut().zip(self.clamping) {
            *error += own;
        }
        errors
    }

    /// How far outside its nominal place (m) the machine leaves each point: the tool stands where the errors lead it in
    /// the pose of the operation that cuts the point, and its effective radius is what its run-out makes of it.
    /// The programme runs with these work offsets (m).
    pub(crate) fn left(
        &self,
        cut: &Cut,
        table: &Truth,
        work_offsets: &[f64],
    ) -> Result<Vec<f64>, PositionError> {
        let (part_pose, ball) = (&cut.part.part_pose, &cut.part.ball);
        let left = cut.points.iter().map(|point| {
            let told = self.offset(&point.positions, work_offsets);
            let led = if cut.volumetric {
                table.corrected(&self.chain, &told, part_pose, ball)?
            } else {
                told
            };
            let errors = self.errors(&led);
            let tip = self.chain.ball_in_part_with(&led, part_pose, ball, &errors);
            let (position, normal) = point.place;
            Ok(normal.dot(&(tip - position)) - point.swells)
        });
        left.collect()
    }

    /// The poses in which an operation cuts the points of a feature.
    fn cut_by_machine(
        &self,
        operation: &RawOperation,
        feature: &str,
        plan: &InspectionPlan,
    ) -> Result<Cut, ConfigError> {
        let refused = |point: usize, reason: String| ConfigError::Cut {
            operation: operation.id.clone(),
            feature: feature.to_owned(),
            point,
            reason,
        };
        let part = Nominal::from_plan(plan).map_err(|error| refused(0, error.to_string()))?;
        let mut start: Vec<f64> = self.home.clone();
        let mut points = Vec::new();
        for point in points_of(plan, feature) {
            let nominal = &plan.points[point];
            let turned = usize::try_from(nominal.operation)
                .ok()
                .and_then(|index| plan.operations.get(index))
                .map_or(&nominal.rotary_positions, |cut| &cut.rotary_positions);
            let mut prescribed = vec![None; self.chain.axes().len()];
            for (name, &position) in plan.rotary_names.iter().zip(turned) {
                if let Some(axis) = self.chain.axis_index(name) {
                    prescribed[axis] = Some(position);
                }
            }
            let (position, normal) = part.points[point];
            let target = Target {
                ball: position,
                orientation: None,
            };
            let positions = self
                .chain
                .reach(&target, &prescribed, &start, &part.part_pose, &part.ball)
                .map_err(|error| refused(point, error.to_string()))?;
            let swells = self
                .runout
                .get(&operation.tool_number)
                .map_or(0.0, |runout| runout.radius_change(nominal.tool_height));
            start.clone_from(&positions);
            points.push(CutPoint {
                place: (position, normal.into_inner()),
                positions,
                swells,
            });
        }
        let cut = Cut {
            part,
            volumetric: operation.volumetric,
            points,
        };
        self.left(&cut, &self.table, &[])
            .map_err(|error| refused(0, error.to_string()))?;
        Ok(cut)
    }
}
