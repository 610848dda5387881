//! The state of the simulated machine.

use std::collections::{BTreeMap, VecDeque};

use graph::{Stamp, supervision::GateWatch};
use machine::motion::Profile;
use probecell_msgs::{
    ControllerCommand, ControllerReply, InspectionPlan, MeasurementOrder, ProbeTrigger,
};
use rand::SeedableRng;
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

use crate::config::Config;

/// The state of the simulator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Name of this run, from the instant of its start.
    pub session: String,
    /// That instant.
    #[serde(default)]
    pub begun: Stamp,
    /// Source of all randomness.
    pub random: Pcg32,
    /// Wear offset of each tool on the size, m.
    pub wear: BTreeMap<u32, f64>,
    /// Cuts that each tool has made.
    #[serde(default)]
    pub cuts: BTreeMap<u32, u32>,
    /// True sizes, m.
    pub sizes: BTreeMap<String, f64>,
    /// Sizes whose last cut was turning, and whether it was a finishing cut.
    pub turned: BTreeMap<String, bool>,
    /// Features cut point by point: deviation of each of their points along the outward normal, m.
    pub surfaces: BTreeMap<String, Vec<f64>>,
    /// Corrections of the tool path of a feature, along the normal of each of its points, m.
    pub path_offsets: BTreeMap<String, Vec<f64>>,
    /// The volumetric table is enabled: from the start, since the last cut, or since it was written.
    pub volumetric: bool,
    /// Values of the entries of the volumetric table, in the order of the cell file, m or rad. A new run begins with those
    /// of the cell file, as with everything that a real controller would have kept.
    pub table: Vec<f64>,
    /// Work offset of each axis that has one, in the order of the cell file, m.
    pub work_offsets: Vec<f64>,
    /// Axis positions when no program runs, m and rad.
    pub position: Vec<f64>,
    /// What the machine is executing.
    pub program: Option<Program>,
    /// A measurement that waits for its plan or its order.
    pub awaiting: Option<ControllerCommand>,
    /// The last plan received.
    pub plan: Option<InspectionPlan>,
    /// The last order received.
    pub order: Option<MeasurementOrder>,
    /// Tool in the spindle.
    pub tool: u32,
    /// Active alarms.
    pub alarms: Vec<String>,
    /// The emergency stop is pressed.
    pub estop: bool,
    /// The controller sends nothing any more.
    pub silent: bool,
    /// Touches of this run.
    pub touches: u32,
    /// Triggers published in this session.
    pub triggers: u64,
    /// The run whose part was cut last: another one begins with a new bar.
    pub run_id: String,
    /// Numbers of the commands that were taken last in this session.
    pub taken: VecDeque<u64>,
    /// What is known of the gate.
    pub gate: GateWatch,
    /// The machine has been commanded to stop and does not stand yet.
    #[serde(default)]
    pub stopping: Option<Stopping>,
}

impl State {
    /// The state before the first input.
    pub(crate) fn new(config: &Config) -> Self {
        let raw = &config.raw;
        Self {
            session: String::new(),
            begun: Stamp::default(),
            random: Pcg32::seed_from_u64(raw.seed),
            wear: raw
                .tools
                .iter()
                .map(|tool| (tool.number, tool.wear_um * 1e-6))
                .collect(),
            cuts: BTreeMap::new(),
            sizes: raw
                .sizes
                .iter()
                .map(|size| (size.id.clone(), size.stock_mm * 1e-3))
                .collect(),
            turned: BTreeMap::new(),
            surfaces: BTreeMap::new(),
            path_offsets: BTreeMap::new(),
            volumetric: raw.machine.volumetric,
            table: config.table.entries().map(|(_, value)| value).collect(),
            work_offsets: vec![0.0; config.work_offset_axes.len()],
            position: config.home.clone(),
            program: None,
            awaiting: None,
            plan: None,
            order: None,
            tool: 0,
            alarms: Vec::new(),
            estop: false,
            silent: false,
            touches: 0,
            triggers: 0,
            run_id: String::new(),
            taken: VecDeque::new(),
            gate: GateWatch::default(),
            stopping: None,
        }
    }
}

/// A machine that is about to stand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stopping {
    /// When it stands.
    pub until: Stamp,
    /// The commands that this ends.
    pub ended: Vec<ControllerCommand>,
    /// The commands to stop.
    pub stops: Vec<ControllerCommand>,
}

/// A program under execution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Program {
    /// Its name.
    pub name: String,
    /// The command that started it.
    pub command: ControllerCommand,
    /// rad/s.
    pub spindle_speed: f64,
    /// What is left of it, in order of time.
    pub segments: VecDeque<Segment>,
}

/// A move, or a time that passes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// Begins.
    pub start: Stamp,
    /// Ends.
    pub end: Stamp,
    /// Axis positions at the start, m and rad.
    pub from: Vec<f64>,
    /// Axis positions at the end, m and rad.
    pub to: Vec<f64>,
    /// Motion of the slowest axis; `None`: constant speed.
    #[serde(default)]
    pub profile: Option<Profile>,
    /// What happens at the end.
    pub then: Then,
}

/// What happens at the end of a segment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Then {
    /// Nothing.
    Go,
    /// A probing move is over.
    Touch(ProbeTrigger),
    /// Sizes are cut by the operation of that name.
    Cut(String),
    /// The program is over.
    Finish(ControllerReply),
}

impl Segment {
    /// Axis positions at an instant, m and rad; held before the start and after the end.
    pub fn at(&self, now: Stamp) -> Vec<f64> {
        let duration = self.end.since_s(self.start);
        let elapsed = now.since_s(self.start);
        let part = match &self.profile {
            Some(profile) => profile.share_at(elapsed),
            None if duration > 0.0 => (elapsed / duration).clamp(0.0, 1.0),
            None => 1.0,
        };
        self.from
            .iter()
            .zip(&self.to)
            .map(|(from, to)| from + (to - from) * part)
            .collect()
    }

    /// Axis velocities at an instant, m/s and rad/s: at the start and at the end those of the move, 0 before and after.
    pub fn velocity_at(&self, now: Stamp) -> Vec<f64> {
        let duration = self.end.since_s(self.start);
        let elapsed = now.since_s(self.start);
        let rate = match &self.profile {
            _ if elapsed < 0.0 || elapsed > duration => 0.0,
            Some(profile) => profile.share_rate_at(elapsed),
            None if duration > 0.0 => 1.0 / duration,
            None => 0.0,
        };
        let ends = self.from.iter().zip(&self.to);
        ends.map(|(from, to)| (to - from) * rate).collect()
    }
}
