//! The turn-mill of `docs/source_systems.md, A`, run on virtual time: the project's own cell files and nodes, the
//! simulated machine behind the driver's topics.
//!
//! Sizes in µm where the name says it, as the source's tables have them; everything else m.

use std::collections::BTreeMap;

use cell::{Cell, CellText};
use diagnosis::Session;
use graph::{Executor, Published, Stamp, Topic, topics};
use probecell_msgs::{
    FeatureResult, InspectionPlan, Message, OperatorRequest, PartReport, PassDecision, ProbeEvent,
    RecordingStatus, ReferenceMeasurement, ToolOffsets, TouchDeviation, Verdict, from_cdr,
    std_msgs, to_cdr,
};

use crate::scenarios::ScenarioError;

/// When a virtual session begins: 2026-01-01 00:00 UTC.
const BEGIN: Stamp = Stamp(1_767_225_600_000_000_000);
/// Its robot description.
pub(crate) const MACHINE: &str = include_str!("../../../../launch-scripts/turn_mill.urdf");
/// Longest virtual time that a part may take, s.
const PART_LIMIT: f64 = 600.0;

/// The sizes of the punch, with the features that carry them and the drawing size in mm.
pub(crate) const SIZES: [(&str, &[&str], f64); 5] = [
    ("D1", &["D1"], 19.8),
    ("D2", &["D2"], 23.5),
    ("L1", &["flat_1", "flat_4"], 17.8),
    ("L2", &["flat_2", "flat_5"], 17.8),
    ("L3", &["flat_3", "flat_6"], 17.8),
];

/// State of the probe when the session begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ProbeState {
    /// Never calibrated: the machine of Table 3.
    Uncalibrated,
    /// Calibrated: the machine of Table 4.
    Calibrated,
}

impl ProbeState {
    fn cell_file(self) -> &'static str {
        match self {
            Self::Uncalibrated => {
                include_str!("../../../../launch-scripts/turn_mill_uncalibrated.toml")
            }
            Self::Calibrated => include_str!("../../../../launch-scripts/turn_mill.toml"),
        }
    }
}

/// A part that the cell has made.
pub(crate) struct Punch {
    /// What the cell says of it.
    pub(crate) report: PartReport,
    /// Everything that was published.
    log: Vec<Published>,
}

/// Makes one punch. `edit` changes the cell file, whose search for a measuring order is short here.
pub(crate) fn make(
    probe: ProbeState,
    seed: u64,
    edit: &dyn Fn(&str) -> String,
) -> Result<Punch, ScenarioError> {
    let text = probe
        .cell_file()
        .replacen("[path_planning]\n", "[path_planning]\nkicks = 50\n", 1)
        .replacen("seed = 1\n", &format!("seed = {seed}\n"), 1);
    let cell = Cell::from_text(CellText {
        name: "turn_mill".to_owned(),
        cell: edit(&text),
        robot_description: MACHINE.to_owned(),
        ..CellText::default()
    })?
    .simulated();
    let mut executor = Executor::new(cell.nodes(false)?, BEGIN)?;
    let request = OperatorRequest {
        subject: "punch".to_owned(),
        operator_name: "scenario".to_owned(),
        ..OperatorRequest::default()
    };
    let waived = RecordingStatus {
        state: RecordingStatus::WAIVED,
        ..RecordingStatus::default()
    };
    executor.inject(BEGIN, topics::RECORDING_STATUS.name, to_cdr(&waived));
    executor.inject(
        BEGIN.after_s(1.0),
        topics::RUN_REQUESTS.name,
        to_cdr(&request),
    );
    let end = BEGIN.after_s(PART_LIMIT);
    if !executor.run_until_published(topics::PART_REPORTS.name, end) {
        return Err(ScenarioError::Course(format!(
            "the turn-mill gave no part report within {PART_LIMIT} s of virtual time"
        )));
    }
    // What the report itself causes still belongs to the session.
    executor.run_until(executor.now());
    let log = executor.take_log();
    let report = last::<PartReport>(&log, topics::PART_REPORTS)?;
    Ok(Punch { report, log })
}

/// The messages on a topic.
fn all<M: Message>(log: &[Published], topic: Topic) -> Result<Vec<M>, ScenarioError> {
    log.iter()
        .filter(|published| published.topic == topic.name)
        .map(|published| Ok(from_cdr(&published.payload)?))
        .collect()
}

fn last<M: Message>(log: &[Published], topic: Topic) -> Result<M, ScenarioError> {
    all(log, topic)?
        .pop()
        .ok_or_else(|| ScenarioError::Course(format!("the turn-mill published no {}", topic.name)))
}

impl Punch {
    /// The messages on a topic.
    pub(crate) fn all<M: Message>(&self, topic: Topic) -> Result<Vec<M>, ScenarioError> {
        all(&self.log, topic)
    }

    /// True if the cell calls the part good by its own readings, whatever the reference instrument says of them.
    pub(crate) fn qualified(&self) -> bool {
        let decisions = self.all::<PassDecision>(topics::PASS_DECISIONS);
        let decided = decisions.ok().and_then(|mut decisions| {
            decisions.retain(|one| one.decision != PassDecision::REVOKED);
            decisions.pop()
        });
        decided.is_some_and(|last| last.decision == PassDecision::NEXT)
    }

    /// (reading less drawing, reference less drawing) of each of [`SIZES`], µm.
    pub(crate) fn errors_um(&self) -> Result<Vec<(f64, f64)>, ScenarioError> {
        let results: Vec<FeatureResult> = self.all(topics::FEATURE_RESULTS)?;
        let plan: InspectionPlan = last(&self.log, topics::INSPECTION_PLAN)?;
        let reference: ReferenceMeasurement = last(&self.log, topics::REFERENCE)?;
        let of = |(size, features, _): &(&str, &[&str], f64)| {
            let read = results
                .iter()
                .rev()
                .find(|result| result.feature_id == *size)?;
            let carried: Vec<f64> = plan
                .points
                .iter()
                .zip(&reference.deviation)
                .filter(|(point, _)| {
                    let feature = plan.features.get(point.feature as usize);
                    feature.is_some_and(|feature| features.contains(&feature.id.as_str()))
                })
                .map(|(_, deviation)| *deviation)
                .collect();
            // Both sides of a diameter or width.
            let mean = carried.iter().sum::<f64>() / carried.len() as f64;
            Some((read.size_deviation * 1e6, 2.0 * mean * 1e6))
        };
        SIZES
            .iter()
            .map(|size| {
                of(size).ok_or_else(|| {
                    ScenarioError::Course(format!("the turn-mill did not measure {}", size.0))
                })
            })
            .collect()
    }

    /// The plan that was measured last.
    pub(crate) fn last_plan(&self) -> Result<String, ScenarioError> {
        Ok(last::<InspectionPlan>(&self.log, topics::INSPECTION_PLAN)?.plan_id)
    }

    /// X-wear of each tool at the end, µm, by tool number.
    pub(crate) fn wear_um(&self) -> Result<BTreeMap<u32, f64>, ScenarioError> {
        let offsets: ToolOffsets = last(&self.log, topics::TOOL_OFFSETS)?;
        let pairs = offsets.tool_numbers.iter().zip(&offsets.wear);
        Ok(pairs.map(|(tool, wear)| (*tool, wear * 1e6)).collect())
    }

    /// The verdicts on a size, in the order in which they were given.
    pub(crate) fn verdicts(&self, size: &str) -> Result<Vec<Verdict>, ScenarioError> {
        let mut verdicts: Vec<Verdict> = self.all(topics::VERDICTS)?;
        verdicts.retain(|verdict| verdict.feature_id == size);
        Ok(verdicts)
    }

    /// The plan of that id and the deviations (m) of its touches, point by point, as the analysis has them.
    pub(crate) fn deviations(
        &self,
        plan_id: &str,
    ) -> Result<(InspectionPlan, Vec<(usize, f64)>), ScenarioError> {
        let plans: Vec<InspectionPlan> = self.all(topics::INSPECTION_PLAN)?;
        let plan = plans
            .into_iter()
            .rev()
            .find(|plan| plan.plan_id == plan_id)
            .ok_or_else(|| ScenarioError::Course(format!("{plan_id} was not measured")))?;
        let touches: Vec<TouchDeviation> = self.all(topics::TOUCH_DEVIATIONS)?;
        let found = touches
            .iter()
            .filter(|touch| touch.plan_id == plan_id)
            .map(|touch| (touch.point_index as usize, touch.deviation))
            .collect();
        Ok((plan, found))
    }

    /// What a recorder would have kept of a measurement of these features, the reference left out.
    pub(crate) fn session(
        &self,
        name: &str,
        plan_id: &str,
        features: &[&str],
    ) -> Result<Session, ScenarioError> {
        let (plan, _) = self.deviations(plan_id)?;
        let model: std_msgs::String = last(&self.log, topics::ROBOT_DESCRIPTION)?;
        let mut events: Vec<ProbeEvent> = self.all(topics::PROBE_EVENTS)?;
        events.retain(|event| {
            let point = plan.points.get(event.point_index as usize);
            let feature = point.and_then(|point| plan.features.get(point.feature as usize));
            event.plan_id == plan_id
                && feature.is_some_and(|feature| features.contains(&feature.id.as_str()))
        });
        // A session numbers its touches from 0.
        for (sequence, event) in events.iter_mut().enumerate() {
            event.sequence = sequence as u64;
        }
        Ok(Session {
            name: name.to_owned(),
            robot_description: model.data,
            plan: Some(plan),
            events,
            joint_states: self.all(topics::JOINT_STATES)?,
            joint_commands: self.all(topics::JOINT_COMMANDS)?,
            machine_states: self.all(topics::MACHINE_STATE)?,
            references: Vec::new(),
            declared: Vec::new(),
        })
    }

    /// What a recorder would have kept of the last measurement, with what the reference instrument found.
    pub(crate) fn session_with_reference(&self, name: &str) -> Result<Session, ScenarioError> {
        let reference: ReferenceMeasurement = last(&self.log, topics::REFERENCE)?;
        let features = SIZES.iter().flat_map(|(_, features, _)| *features);
        let features: Vec<&str> = features.copied().collect();
        let mut session = self.session(name, &reference.plan_id, &features)?;
        session.references.push(reference);
        Ok(session)
    }
}
