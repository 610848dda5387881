//! Settings of the simulated machine, checked against its kinematic chain and the plan of the part.

use std::collections::BTreeMap;

use machine::{Chain, WorkOffset};
use probecell_msgs::InspectionPlan;

use crate::{
    joint::{Joint, JointError},
    points::{Cut, SurfacePoint, points_of, positions_by_feature},
    probe,
    raw::{HomePosition, RawConfig},
    tool::Runout,
    truth::{Truth, TruthError},
};

/// m or rad; a larger error of the clamping is no small displacement.
const LARGEST_CLAMPING: f64 = 0.01;

/// As checked: m, rad, s.
#[derive(Clone, Debug)]
pub struct Config {
    /// The machine, from its URDF.
    pub chain: Chain,
    /// Axis positions at the start, in the order of the chain's axes.
    pub home: Vec<f64>,
    /// m; true minus stored ball centre in `probe_mount`, after the calibration if there is one.
    pub center_error: [f64; 3],
    /// m; true minus stored radius of the stylus ball, after the calibration if there is one.
    pub radius_error: f64,
    /// Errors of the axes.
    pub truth: Truth,
    /// The same errors as the volumetric table of the controller has them at the start.
    pub table: Truth,
    /// Displacement of the clamped part in its nominal frame: m along, rad about x, y, z.
    pub clamping: [f64; 6],
    /// What each work offset that the controller reports moves.
    pub work_offset_axes: Vec<WorkOffset>,
    /// Faults of the joints, in the order of the chain's axes.
    pub joints: Vec<Joint>,
    /// Run-out of the tools that have one, by number.
    pub runout: BTreeMap<u32, Runout>,
    /// How each feature is cut point by point, by operation of the cell file and feature.
    pub cuts: BTreeMap<(String, String), Cut>,
    /// m; deviation that the process leaves at each point of a feature, or that an uncut feature was delivered with.
    pub surfaces: BTreeMap<String, Vec<f64>>,
    /// Points of each feature in the plan of the part: position (m) and outward normal, part frame.
    pub places: BTreeMap<String, Vec<SurfacePoint>>,
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
        "simulator.machine.work_offset_axes: {0:?} is not a linear axis of the machine, or it is listed twice"
    )]
    WorkOffset(String),
    /// An error of the machine that cannot be.
    #[error("simulator.{0}")]
    Truth(#[from] TruthError),
    /// A joint that cannot be.
    #[error("simulator.{0}")]
    Joint(#[from] JointError),
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
    ///
    /// # Errors
    /// [`ConfigError`] names the key.
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
        let (center_error, radius_error) = probe::stored(&self.probe, ball_radius);
        let truth = Truth::new(&self.machine.errors, &chain)?;
        let table = Truth::table(&self.machine.table, &chain)?;
        let mut work_offset_axes = Vec::new();
        for name in &self.machine.work_offset_axes {
            let moved = chain.work_offset(name);
            let moved = moved.filter(|moved| !work_offset_axes.contains(moved));
            work_offset_axes.push(moved.ok_or_else(|| ConfigError::WorkOffset(name.clone()))?);
        }
        let mut config = Config {
            truth,
            table,
            clamping: self.machine.clamping.displacement(),
            work_offset_axes,
            joints: Joint::of_chain(&self.machine.joints, &chain)?,
            runout: self
                .tools
                .iter()
                .filter_map(|tool| Some((tool.number, tool.runout.as_ref()?.check())))
                .collect(),
            cuts: BTreeMap::new(),
            surfaces: self.surfaces(plan)?,
            places: positions_by_feature(plan),
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
            ("stop_s", self.stop_s),
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
        if let Some(warming) = self.machine.warming {
            let far = |value: &&f64| !((**value * 1e-6).abs() <= LARGEST_CLAMPING);
            if let Some(value) = warming.shift_um.iter().find(far) {
                return Err(ConfigError::Number(format!(
                    "machine.warming.shift_um = {value} must lie within ±{} µm",
                    LARGEST_CLAMPING * 1e6
                )));
            }
            let value = warming.time_constant_s;
            if !(value.is_finite() && value > 0.0) {
                return Err(ConfigError::Number(format!(
                    "machine.warming.time_constant_s = {value} must be above 0"
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
