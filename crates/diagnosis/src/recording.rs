//! The diagnosis of all measurements of a recording in which several parts were made.
//!
//! ```text
//!   measurements, one at a time   rows of equal points; each kind of plan watched for a change (onset)
//!   since the last change         stretches: means of consecutive measurements, point by point, chips left out
//!   stretches                     joint: machine, probe and process common to all, each clamping's pose and what was corrected apart
//! ```
//!
//! [`tools`] looks over all passes of each tool for wear and for an edge that broke. A kind is a pass of the parts with its points. What a pass leaves that another pass cuts away, and what a wear correction has
//! changed, is a constant of the tool in each stretch and names no cause. Cost and memory do not grow with the measurements but
//! for their deviations. Times count from the first message of the recording. Metres, seconds.

mod tools;

use std::collections::{BTreeMap, BTreeSet};

use effects::observation::{Observations, Row};
use effects::observe;
use effects::session::{Session, SessionError};
use metrology::statistics::{MAD_FACTOR, median};
use probecell_msgs::PlanId;

use crate::diagnose::REFERENCE_WEIGHTS;
use crate::joint::{Heading, Joined, diagnose_joined};
use crate::onset::{Change, ChangeMonitor};
use crate::options::Options;
use crate::report::Report;
use crate::report::measurements::{Changed, LeftOut, Measurements};
use crate::report::residuals::TouchResiduals;

/// Stretches over all kinds, and rows over all stretches, at most.
const MAX_STRETCHES: usize = 24;
const MAX_ROWS: usize = 4000;
/// A touch this many standard deviations from those of its stretch at its point met a chip; and the least count that tells.
const CHIP_DEVIATIONS: f64 = 6.0;
const MIN_READINGS: usize = 5;
/// Share of the touches of a part that met a chip at most.
const MAX_CHIP_SHARE: f64 = 0.1;
/// Least standard deviation of a touch, m.
const MIN_TOUCH_SD: f64 = 5e-8;
/// False alarms in 1,000 parts at which a change is reported: the default of the node `gap`.
const FALSE_ALARMS: f64 = 1.0;

/// The part and the pass of a measurement, by the identifier of its plan; a plan of no run is its own part.
pub fn part_and_pass(plan_id: &str) -> (String, String) {
    match PlanId::from(plan_id) {
        PlanId::Supplement { of, .. } => part_and_pass(&of),
        PlanId::Named(name) => (name, String::new()),
        PlanId::Measurement { run, .. } => {
            let run = run.to_string();
            let (part, pass) = run.rsplit_once('/').unwrap_or((&run, ""));
            (part.to_owned(), pass.to_owned())
        }
    }
}

/// What was corrected before a measurement.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Corrected {
    /// Corrections of the wear of each tool so far.
    pub wear: BTreeMap<u32, usize>,
    /// Corrections of other kinds so far.
    pub others: usize,
}

impl Corrected {
    /// Corrections of any kind so far.
    fn count(&self) -> usize {
        self.others + self.wear.values().sum::<usize>()
    }
}

/// One measurement, reduced to its deviations.
struct Taken {
    plan_id: String,
    /// First touch, ns since 1970.
    at: i64,
    corrected: Corrected,
    readings: Vec<Reading>,
}

impl Taken {
    /// Tools whose wear was corrected before it.
    fn tools(&self) -> impl Iterator<Item = &u32> {
        self.corrected.wear.keys()
    }
}

/// One touch.
struct Reading {
    /// Place among the rows of its kind.
    row: usize,
    deviation: f64,
    time: f64,
    kelvin: Option<f64>,
    responses: Vec<[f64; 9]>,
}

/// What makes two rows the same touch: point, how often it was touched before, side of arrival of each axis, reference or not.
type Key = (usize, usize, Vec<i8>, bool);

/// Measurements of one pass with the same points.
struct Kind {
    pass: String,
    session: Session,
    rows: Observations,
    keys: BTreeMap<Key, usize>,
    taken: Vec<Taken>,
    watch: ChangeMonitor,
}

/// The measurements of a recording so far.
#[derive(Default)]
pub struct Recording {
    kinds: Vec<Kind>,
    corrections: usize,
    parts: BTreeMap<String, String>,
    /// Passes after which a part was cut again.
    superseded: BTreeSet<String>,
    left_out: BTreeMap<String, Vec<String>>,
    changes: Vec<Change>,
    measured: Option<String>,
}

impl Recording {
    /// Takes a measurement; one that cannot be used is left out with the reason.
    ///
    /// # Errors
    /// It is of another machine, or cannot be watched.
    pub fn add(
        &mut self,
        session: &Session,
        corrected: &Corrected,
        options: &Options,
    ) -> Result<(), SessionError> {
        let Some(plan) = &session.plan else {
            return Err(SessionError::NoPlan);
        };
        let observed = match observe(session) {
            Ok(observed) => observed,
            Err(problem) => {
                self.leave_out(&plan.plan_id, problem.to_string());
                return Ok(());
            }
        };
        if self.measured.is_none() {
            self.measured = session.measured();
        }
        let (part, pass) = part_and_pass(&plan.plan_id);
        if let Some(before) = self.parts.insert(part, pass.clone())
            && before != pass
        {
            self.superseded.insert(before);
        }
        // As in the node `gap`: what is corrected changes, and is no finding.
        if corrected.count() > self.corrections {
            self.corrections = corrected.count();
            for kind in &mut self.kinds {
                kind.watch = ChangeMonitor::default();
            }
        }
        let is_same = |kind: &Kind| kind.pass == pass && kind.is_of(session);
        let index = self.kinds.iter().position(is_same).unwrap_or_else(|| {
            self.kinds.push(Kind::new(pass.clone(), session, &observed));
            self.kinds.len() - 1
        });
        let kind = &mut self.kinds[index];
        if let Some(change) = kind.watch.part(session, options, FALSE_ALARMS)? {
            self.changes.push(change);
        }
        let stamps = session
            .events
            .iter()
            .map(|event| event.header.stamp.nanos());
        let taken = Taken {
            plan_id: plan.plan_id.clone(),
            at: stamps.min().unwrap_or(0),
            corrected: corrected.clone(),
            readings: kind.readings(observed),
        };
        kind.taken.push(taken);
        Ok(())
    }

    /// Notes a measurement that is not used, and why.
    pub fn leave_out(&mut self, plan_id: &str, reason: String) {
        let plans = self.left_out.entry(reason).or_default();
        plans.push(plan_id.to_owned());
    }

    /// Number of parts that were measured.
    pub fn parts(&self) -> usize {
        self.parts.len()
    }

    /// The joint report of what was taken, and the residuals of its means.
    ///
    /// # Errors
    /// Nothing was taken, or the means cannot be explained.
    pub fn report(
        mut self,
        name: &str,
        options: &Options,
    ) -> Result<(Report, TouchResiduals), SessionError> {
        let since = self.changes.iter().map(|change| change.since).max();
        let trends = tools::trends(&self.kinds);
        let mut before = Vec::new();
        for kind in &mut self.kinds {
            let is_before = |taken: &Taken| since.is_some_and(|since| taken.at < since);
            let earlier = kind.taken.extract_if(.., |taken| is_before(taken));
            before.extend(earlier.map(|taken| taken.plan_id));
        }
        let compared = before.len();
        self.kinds.retain(|kind| !kind.taken.is_empty());
        let kinds = self.kinds.len();
        // Evenly over the recording, whose order the kinds have.
        let stride = kinds.div_ceil(MAX_STRETCHES).max(1);
        let mut number = 0;
        let left_out = &mut self.left_out;
        self.kinds.retain(|kind| {
            number += 1;
            let is_used = (number - 1) % stride == 0;
            if !is_used {
                let reason = format!("one of every {stride} kinds of plan is diagnosed");
                let plans = left_out.entry(reason).or_default();
                plans.extend(kind.taken.iter().map(|taken| taken.plan_id.clone()));
            }
            is_used
        });
        let first = self.kinds.first().ok_or(SessionError::NoPlan)?;
        let (text, declared) = (
            first.session.robot_description.clone(),
            first.session.declared.clone(),
        );
        let rows: usize = self.kinds.iter().map(|kind| kind.rows.rows.len()).sum();
        let each = (MAX_STRETCHES / self.kinds.len())
            .min(MAX_ROWS / rows.max(1))
            .max(1);
        let superseded = &self.superseded;
        let mut stretches: Vec<Stretch> = (self.kinds.iter())
            .flat_map(|kind| kind.stretches(each, superseded.contains(&kind.pass)))
            .collect();
        weigh(&mut stretches);
        let tools: BTreeSet<u32> = stretches.iter().flat_map(|one| one.tools.clone()).collect();
        let (touches, chips) = stretches.iter().fold((0, 0), |(touches, chips), one| {
            (touches + one.touches, chips + one.chips)
        });
        let heading = Heading {
            fitted: stretches.iter().map(|one| one.name.clone()).collect(),
            withheld: Vec::new(),
            measured: self.measured.clone(),
            robot_description: Some(&text),
            declared: &declared,
            has_one_clock: true,
        };
        let registered: Vec<Vec<u32>> = (stretches.iter())
            .map(|one| one.tools.iter().copied().collect())
            .collect();
        let taken = self
            .kinds
            .iter()
            .map(|kind| kind.taken.len())
            .sum::<usize>();
        let averaged = stretches.len();
        let joined = Joined::of(stretches.into_iter().map(|one| Ok(one.rows)), &registered)?;
        let (mut report, residuals) = diagnose_joined(&heading, &joined, options)?;
        name.clone_into(&mut report.bag);
        report.samples = touches;
        if chips > 0 {
            let text = format!(
                "{chips} touches far from the others at their points are left out: data.outliers"
            );
            report.warnings.insert(0, text);
        }
        report.measurements = Some(Measurements {
            touches,
            measurements: taken,
            parts: self.parts.len(),
            stretches: averaged,
            before_change: compared,
            changes: self.changes.iter().map(Changed::from).collect(),
            tools: trends,
            corrected_tools: tools.into_iter().collect(),
            left_out: (self.left_out.into_iter())
                .map(|(reason, plans)| LeftOut { reason, plans })
                .collect(),
        });
        Ok((report, residuals))
    }
}

impl Kind {
    fn new(pass: String, session: &Session, observed: &Observations) -> Self {
        let mut rows = observed.clone();
        rows.rows.clear();
        rows.deviations.clear();
        rows.skipped.clear();
        Self {
            pass,
            session: Session {
                machine_states: Vec::new(),
                joint_states: Vec::new(),
                events: Vec::new(),
                ..session.clone()
            },
            rows,
            keys: BTreeMap::new(),
            taken: Vec::new(),
            watch: ChangeMonitor::default(),
        }
    }

    /// True for a session of this machine, model and plan but for the names.
    fn is_of(&self, session: &Session) -> bool {
        let own = &self.session;
        let is_plan = own.plan.as_ref().zip(session.plan.as_ref());
        let is_plan = is_plan.is_some_and(|(one, other)| {
            one.part_pose == other.part_pose
                && one.stylus == other.stylus
                && one.rotary_names == other.rotary_names
                && one.machined_on_this_machine == other.machined_on_this_machine
                && one.features == other.features
                && one.operations == other.operations
                && one.points == other.points
        });
        is_plan
            && own.robot_description == session.robot_description
            && own.declared == session.declared
    }

    /// The readings of a measurement; rows that were not touched so before are added.
    fn readings(&mut self, observed: Observations) -> Vec<Reading> {
        let uncertainty = &mut self.rows.reference_uncertainty;
        *uncertainty = uncertainty.max(observed.reference_uncertainty);
        let mut seen: BTreeMap<(usize, bool), usize> = BTreeMap::new();
        let pairs = observed.rows.into_iter().zip(observed.deviations);
        pairs
            .map(|(row, deviation)| {
                let is_touch = row.pose.is_some();
                let times = seen.entry((row.point, is_touch)).or_default();
                let sides = row.pose.iter().flat_map(|pose| &pose.arrived);
                let sides = sides.map(|side| *side as i8).collect();
                let key = (row.point, *times, sides, is_touch);
                *times += 1;
                let (time, kelvin) = (row.time, row.kelvin_above_20_celsius);
                let responses = row.responses.clone();
                let rows = &mut self.rows.rows;
                let row = *self.keys.entry(key).or_insert_with(|| {
                    rows.push(row);
                    rows.len() - 1
                });
                Reading {
                    row,
                    deviation,
                    time,
                    kelvin,
                    responses,
                }
            })
            .collect()
    }

    /// Means of consecutive measurements, at most so many, parted where another tool has been corrected.
    fn stretches(&self, most: usize, is_superseded: bool) -> Vec<Stretch> {
        let runs: Vec<&[Taken]> = (self
            .taken
            .chunk_by(|one, other| one.tools().eq(other.tools())))
        .collect();
        let own = |run: &[Taken]| (most * run.len() / self.taken.len()).max(1);
        let parts = runs.iter().flat_map(|run| {
            let (chips, spread) = self.chips(run);
            let length = run.len().div_ceil(own(run));
            let means = (run.chunks(length).zip(chips.chunks(length)))
                .map(|(taken, chips)| self.mean((taken, chips), spread, is_superseded));
            means.collect::<Vec<_>>()
        });
        parts.collect()
    }

    /// The deviations of some measurements at each row.
    fn by_row(&self, taken: &[Taken]) -> Vec<Vec<f64>> {
        let mut by_row: Vec<Vec<f64>> = vec![Vec::new(); self.rows.rows.len()];
        for reading in taken.iter().flat_map(|taken| &taken.readings) {
            by_row[reading.row].push(reading.deviation);
        }
        by_row
    }

    /// Which readings of each measurement are far from the others at their point, and the robust deviation of all, m. Where many of
    /// one measurement are, its part differs and no chip was met.
    fn chips(&self, taken: &[Taken]) -> (Vec<Vec<bool>>, f64) {
        let by_row = self.by_row(taken);
        let middles: Vec<f64> = by_row.iter().map(|all| median(all)).collect();
        let off = |reading: &Reading| (reading.deviation - middles[reading.row]).abs();
        let told = |reading: &&Reading| by_row[reading.row].len() >= MIN_READINGS;
        let all = taken.iter().flat_map(|taken| &taken.readings).filter(told);
        let spread = (MAD_FACTOR * median(&all.map(off).collect::<Vec<f64>>())).max(MIN_TOUCH_SD);
        let of_part = |taken: &Taken| {
            let is_far =
                |reading: &Reading| told(&reading) && off(reading) > CHIP_DEVIATIONS * spread;
            let far: Vec<bool> = taken.readings.iter().map(is_far).collect();
            let most = ((MAX_CHIP_SHARE * far.len() as f64) as usize).max(1);
            let few = far.iter().filter(|&&far| far).count() <= most;
            far.into_iter().map(|far| far && few).collect()
        };
        (taken.iter().map(of_part).collect(), spread)
    }

    fn mean(
        &self,
        (taken, chips): (&[Taken], &[Vec<bool>]),
        spread: f64,
        is_superseded: bool,
    ) -> Stretch {
        let mut by_row: Vec<Vec<&Reading>> = self.rows.rows.iter().map(|_| Vec::new()).collect();
        let readings = taken.iter().flat_map(|taken| &taken.readings);
        let (mut touches, mut left_out) = (0, 0);
        for (reading, &is_chip) in readings.zip(chips.iter().flatten()) {
            let is_touch = usize::from(self.rows.rows[reading.row].pose.is_some());
            if is_chip {
                left_out += is_touch;
            } else {
                touches += is_touch;
                by_row[reading.row].push(reading);
            }
        }
        // As of one session: what an instrument errs by is common to its measurements.
        let of_reference = spread / self.rows.reference_uncertainty.max(f64::MIN_POSITIVE);
        let mut rows = Observations {
            rows: Vec::new(),
            deviations: Vec::new(),
            ..self.rows.clone()
        };
        for (template, readings) in self.rows.rows.iter().zip(&by_row) {
            let Some(first) = readings.first() else {
                continue;
            };
            let count = readings.len() as f64;
            let mean = |of: &dyn Fn(&Reading) -> f64| {
                readings.iter().map(|reading| of(reading)).sum::<f64>() / count
            };
            let kelvin = readings.iter().all(|reading| reading.kelvin.is_some());
            let responses = (0..first.responses.len()).map(|sensor| {
                std::array::from_fn(|lag| mean(&|reading| reading.responses[sensor][lag]))
            });
            rows.deviations.push(mean(&|reading| reading.deviation));
            rows.rows.push(Row {
                time: mean(&|reading| reading.time),
                kelvin_above_20_celsius: kelvin
                    .then(|| mean(&|reading| reading.kelvin.unwrap_or(0.0))),
                responses: responses.collect(),
                weight: match template.pose {
                    Some(_) => count.sqrt(),
                    None => of_reference.clamp(REFERENCE_WEIGHTS.0, REFERENCE_WEIGHTS.1),
                },
                ..template.clone()
            });
        }
        let cut_by = rows.rows.iter().filter_map(|row| row.tool);
        let mut tools: BTreeSet<u32> = cut_by.collect();
        if !is_superseded {
            tools.retain(|tool| {
                taken
                    .iter()
                    .any(|taken| taken.corrected.wear.contains_key(tool))
            });
        }
        let ends =
            [taken.first(), taken.last()].map(|one| one.map_or("", |one| one.plan_id.as_str()));
        let name = match ends {
            [first, last] if first == last => first.to_owned(),
            [first, last] => format!("{first} to {last} ({})", taken.len()),
        };
        Stretch {
            name,
            rows,
            tools,
            touches,
            chips: left_out,
        }
    }
}

/// The mean of consecutive measurements.
struct Stretch {
    name: String,
    rows: Observations,
    /// Tools whose constant material is its own.
    tools: BTreeSet<u32>,
    touches: usize,
    chips: usize,
}

/// Scales the weights of means so that their mean square is that of touches.
fn weigh(stretches: &mut [Stretch]) {
    let rows = || stretches.iter().flat_map(|one| &one.rows.rows);
    let count = rows().count().max(1) as f64;
    let scale = (rows().map(|row| row.weight * row.weight).sum::<f64>() / count).sqrt();
    for row in stretches.iter_mut().flat_map(|one| &mut one.rows.rows) {
        row.weight /= scale;
    }
}
