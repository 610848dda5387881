//! The table every effect is computed on: one row per touch (and per reference value), with the chain's derivatives.
//!
//! Metres, radians, seconds from the first message of the session; vectors in the part frame. A measured row sees
//! the machine when it probed and, where the same machine cut the point, also when it cut: d = s − n·e(probing) +
//! n·e(cutting), s material left by the process. A reference row sees only the second and third term.

use std::collections::BTreeMap;

use machine::{Chain, JointKind, Nominal, Sensitivity, Surface, Target};
use nalgebra::{DMatrix, DVector, Point3, Vector3};
use probecell_msgs::{InspectionPlan, MachineState, ProbeEvent, ReferenceMeasurement};

use crate::approach_direction::{last_moves, side};
use crate::clock_check;
use crate::sensors::{Response, Series};
use crate::session::{self, Session, SessionError, seconds};

/// Fewest touches that are diagnosed.
const FEWEST: usize = 6;
/// Most touches of a session that become rows: more determine no parameter better than the model holds.
const MOST: usize = 10_000;
/// An axis reads a surface whose normal it is along by more than this cosine; its position is the deviation where their squared
/// correlation is more than this.
const ALONG: f64 = 0.7;
const READING: f64 = 0.998;
/// And where its slope is one to within this.
const SLOPE: f64 = 0.1;
/// A rounding whose errors would be larger than the gap by this factor is none: the axes stand on a grid of targets.
const CHANCE: f64 = 1.2;
/// Speeds of approach closer than this are equal, m/s.
const SAME_FEED: f64 = 1e-6;
/// Axis speed below which an axis stands, as a share of the feed.
const STANDS: f64 = 1e-6;
/// An approach along the surface has less than this cosine to its normal.
const ACROSS: f64 = 0.1;

/// The machine at one moment: probing or cutting a point, with the ball where a perfect cell would have it.
///
/// The latched positions hold the deviation themselves; effects that depend on a position must not see it there.
#[derive(Debug, Clone)]
pub struct Pose {
    /// Positions of [`Chain::axes`].
    pub positions: Vec<f64>,
    /// The positions as they were read at the latch, deviation included.
    pub latched: Vec<f64>,
    /// Derivatives of the ball centre there.
    pub sensitivity: Sensitivity,
    /// Speeds of the axes at the latch, m/s or rad/s; zeros while cutting.
    pub speeds: Vec<f64>,
    /// Sign of the last move of each axis before the latch; 0 where nobody can say.
    pub arrived: Vec<f64>,
}

/// One observed deviation.
#[derive(Debug, Clone)]
pub struct Row {
    /// Index in the plan's points.
    pub point: usize,
    /// Index in the plan's features.
    pub feature: usize,
    /// Sequence of the event; `None` for a reference value.
    pub sequence: Option<u64>,
    /// Which combination of prescribed axis positions, numbered by first use.
    pub index: usize,
    /// Seconds from the start of the session.
    pub time: f64,
    /// Speed of approach, m/s.
    pub feed: f64,
    /// Nominal point, part frame.
    pub position: Point3<f64>,
    /// Outward normal, part frame.
    pub normal: Vector3<f64>,
    /// Surface that is touched.
    pub surface: Surface,
    /// The machine while probing; `None` for a reference value.
    pub pose: Option<Pose>,
    /// The machine while cutting; `None` where it did not cut the point.
    pub cut: Option<Pose>,
    /// Part temperature above 20 °C, K; `None` where unknown.
    pub kelvin_above_20_celsius: Option<f64>,
    /// Responses to each of [`Observations::sensors`]; none for a reference value.
    pub responses: Vec<Response>,
    /// Number of the tool that cut the point.
    pub tool: Option<u32>,
    /// Path the tool had cut, m.
    pub cut_length: f64,
    /// Height along the tool, m.
    pub tool_height: f64,
    /// Distance from the clamping, m.
    pub overhang: f64,
    /// Weight against a touch of the probe: its standard uncertainty over that of this row.
    pub weight: f64,
}

impl Row {
    /// True where the surface was approached at this speed, m/s.
    pub fn is_at(&self, feed: f64) -> bool {
        (self.feed - feed).abs() < SAME_FEED
    }

    /// True where the normal points along this axis of the part more than along any other, in the direction of `sign`.
    pub fn faces(&self, axis: usize, sign: f64) -> bool {
        let along = self.normal[axis] * sign;
        along > 0.0 && (0..3).all(|other| other == axis || self.normal[other].abs() < along)
    }
}

/// All rows of a session.
#[derive(Debug, Clone)]
pub struct Observations {
    /// The machine.
    pub chain: Chain,
    /// Nominal part and probe.
    pub nominal: Nominal,
    /// Rows: touches by time, then references.
    pub rows: Vec<Row>,
    /// Deviations, m, one per row.
    pub deviations: Vec<f64>,
    /// What each declared effect was predicted to add to every row, m; `deviations` are what is left without it.
    pub declared: Vec<Vec<f64>>,
    /// Names of the plan's features.
    pub features: Vec<String>,
    /// True when the part was cut in this clamping.
    pub cut_here: bool,
    /// Axes the plan prescribes (rotary axes and spindle angle), by index in [`Chain::axes`].
    pub prescribed: Vec<usize>,
    /// Step of the grid on which the latched positions of the moving linear axes lie, m; `None` without a grid.
    pub grid: Option<f64>,
    /// Names of the sensors whose readings may drive growth.
    pub sensors: Vec<String>,
    /// Standard uncertainty of the reference rows, m; 0 without any.
    pub reference_uncertainty: f64,
    /// Touches that were not used, by sequence and reason.
    pub skipped: Vec<(u64, &'static str)>,
    /// Usable touches, of which those in excess of 25,000 are left out, evenly spread over the session.
    pub usable: usize,
}

/// How one unit of a parameter shows in every row.
#[derive(Debug, Clone)]
pub struct Column {
    /// Change of the deviation, m per unit, to first order.
    pub signature: Vec<f64>,
    /// Displacement of the ball in the part frame while probing, m per unit; empty for a change of size only.
    pub shifts: Vec<Vector3<f64>>,
}

impl Observations {
    /// Checks a session and lays out its rows, deviations as measured: nothing that is declared is subtracted
    /// ([`crate::observe`] does).
    ///
    /// # Errors
    /// [`SessionError`] names what makes the session unusable.
    pub fn from_session(session: &Session) -> Result<Self, SessionError> {
        if session.robot_description.is_empty() {
            return Err(SessionError::NoMachine);
        }
        let chain = Chain::from_urdf(&session.robot_description)?;
        let plan = session.plan.as_ref().ok_or(SessionError::NoPlan)?;
        session::check_touches(session, plan)?;
        let nominal = Nominal::from_plan(plan)?;
        let prescribed = plan
            .rotary_names
            .iter()
            .map(|name| {
                chain
                    .axis_index(name)
                    .ok_or_else(|| machine::DeviationError::PlanAxis {
                        plan: plan.plan_id.clone(),
                        axis: name.clone(),
                    })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let start = start_of(session);
        let sensors = Series::of(&session.machine_states, |state| {
            seconds(&state.header.stamp) - start
        });
        let mut builder = Builder {
            sensors: &sensors,
            chain: &chain,
            nominal: &nominal,
            plan,
            prescribed: &prescribed,
            start,
            machine_states: &session.machine_states,
            indices: BTreeMap::new(),
            skipped: Vec::new(),
            usable: 0,
            standing: false,
        };
        let (mut touches, mut deviations) = builder.touches(&session.events)?;
        let grid = clock_check::resolution(&latched(&chain, &prescribed, &touches));
        let rounds = |step: f64| rounding(step, &touches, &prescribed) <= CHANCE * rms(&deviations);
        let standing = grid.is_some_and(|step| !rounds(step));
        let grid = grid.filter(|_| !standing);
        if standing {
            builder.standing = true;
            builder.skipped.clear();
            (touches, deviations) = builder.touches(&session.events)?;
        }
        if touches.len() < FEWEST {
            return Err(SessionError::TooFew(touches.len(), FEWEST));
        }
        let mut sizes: Vec<f64> = deviations.iter().map(|deviation| deviation.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        if sizes[sizes.len() / 2] > 0.05 {
            return Err(SessionError::Unit {
                size: sizes[sizes.len() / 2],
                suspect: session::larger(session, plan, &chain),
            });
        }
        let mut uncertainty = 0.0;
        for reference in &session.references {
            uncertainty = reference.standard_uncertainty;
            builder.references(reference, &mut touches, &mut deviations)?;
        }
        let Builder {
            skipped, usable, ..
        } = builder;
        Ok(Self {
            grid,
            sensors: sensors.into_iter().map(|sensor| sensor.name).collect(),
            rows: touches,
            deviations,
            declared: Vec::new(),
            features: plan
                .features
                .iter()
                .map(|feature| feature.id.clone())
                .collect(),
            cut_here: plan.machined_on_this_machine,
            prescribed,
            reference_uncertainty: uncertainty,
            skipped,
            usable,
            chain,
            nominal,
        })
    }

    /// Number of touches; they come before the references.
    pub fn touches(&self) -> usize {
        self.rows
            .iter()
            .take_while(|row| row.pose.is_some())
            .count()
    }

    /// Column of an error of the machine: `displacement` moves the ball against the part (m per unit, part frame).
    ///
    /// With `lasting`, the machine erred in the same way while it cut the part.
    pub fn machine_column(
        &self,
        lasting: bool,
        displacement: impl Fn(&Pose, &Row) -> Vector3<f64>,
    ) -> Column {
        let mut columns = self.machine_columns(lasting, 1, |pose, row, displacements| {
            displacements[0] = displacement(pose, row);
        });
        columns.swap_remove(0)
    }

    /// Columns of so many errors of the machine, of which `displacements` gives the displacement by each at a pose, row by row: what
    /// they have in common is computed once.
    pub fn machine_columns(
        &self,
        lasting: bool,
        count: usize,
        displacements: impl Fn(&Pose, &Row, &mut [Vector3<f64>]),
    ) -> Vec<Column> {
        let empty = || Column {
            signature: Vec::with_capacity(self.rows.len()),
            shifts: Vec::with_capacity(self.rows.len()),
        };
        let mut columns: Vec<Column> = (0..count).map(|_| empty()).collect();
        let mut probing = vec![Vector3::zeros(); count];
        let mut cutting = probing.clone();
        for row in &self.rows {
            for (all, pose) in [
                (&mut probing, row.pose.as_ref()),
                (&mut cutting, row.cut.as_ref().filter(|_| lasting)),
            ] {
                match pose {
                    Some(pose) => displacements(pose, row, all),
                    None => all.fill(Vector3::zeros()),
                }
            }
            for ((column, probing), cutting) in columns.iter_mut().zip(&probing).zip(&cutting) {
                column.signature.push(row.normal.dot(&(cutting - probing)));
                column.shifts.push(probing - cutting);
            }
        }
        columns
    }

    /// Speeds at which the surface was approached, ascending, m/s.
    pub fn feeds(&self) -> Vec<f64> {
        let touches = self.rows.iter().take(self.touches());
        let mut feeds: Vec<f64> = touches.map(|row| row.feed).collect();
        feeds.sort_by(f64::total_cmp);
        feeds.dedup_by(|one, other| (*one - *other).abs() < SAME_FEED);
        feeds
    }

    /// Column of a change of the deviation itself, as the probe sees it: `change` in m per unit.
    pub fn reading_column(&self, change: impl Fn(&Row) -> f64) -> Column {
        let signature = self
            .rows
            .iter()
            .map(|row| if row.pose.is_some() { change(row) } else { 0.0 })
            .collect();
        Column {
            signature,
            shifts: Vec::new(),
        }
    }

    /// Column of material left on the part, seen by probe and reference alike: `left` in m per unit.
    pub fn material_column(&self, left: impl Fn(&Row) -> f64) -> Column {
        Column {
            signature: self.rows.iter().map(left).collect(),
            shifts: Vec::new(),
        }
    }

    /// Range of an axis (by index in [`Chain::axes`]) over the touches; a point for one whose position is the deviation.
    pub fn travel(&self, axis: usize) -> (f64, f64) {
        if self.reads_deviation(axis) {
            return (0.0, 0.0);
        }
        let positions = self
            .rows
            .iter()
            .filter_map(|row| row.pose.as_ref())
            .map(|pose| pose.positions[axis]);
        positions.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        })
    }

    /// True for an axis whose position is the deviation itself: an instrument that only it moves reads the surface with it. What
    /// is proportional to its position then says nothing of a cause.
    pub fn reads_deviation(&self, axis: usize) -> bool {
        let seen = self.rows.iter().zip(&self.deviations);
        let pairs: Vec<(f64, f64)> = seen
            .filter_map(|(row, deviation)| {
                let pose = row.pose.as_ref()?;
                let along = row.normal.dot(&pose.sensitivity.axes[axis]);
                (along.abs() > ALONG).then(|| (pose.positions[axis] * along, *deviation))
            })
            .collect();
        let count = pairs.len() as f64;
        if pairs.len() < FEWEST {
            return false;
        }
        let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
        let (x, y) = (mean(|pair| pair.0), mean(|pair| pair.1));
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for pair in &pairs {
            let (a, b) = (pair.0 - x, pair.1 - y);
            (xx, xy, yy) = (xx + a * a, xy + a * b, yy + b * b);
        }
        // A scale error is proportional to the position too, by far less than one.
        let alike = xy * xy > READING * xx * yy && (xy - xx).abs() < SLOPE * xx;
        alike && xx > 0.0
    }

    /// Time of the last touch, s from the start of the session.
    pub fn span(&self) -> f64 {
        self.rows.iter().map(|row| row.time).fold(0.0, f64::max)
    }

    /// Deviations that finite displacements of the ball would give, minus what their first order gives.
    ///
    /// `shifts` holds the displacement of each row (m, part frame). Only curved surfaces differ.
    pub fn curvature(&self, shifts: &[Vector3<f64>]) -> Vec<f64> {
        self.second_order(shifts, shifts)
    }

    /// The same where the displacements themselves differ from their first order: a large rotation.
    pub fn second_order(&self, linear: &[Vector3<f64>], finite: &[Vector3<f64>]) -> Vec<f64> {
        (self.rows.iter().zip(linear).zip(finite))
            .map(|((row, linear), finite)| {
                let Some(pose) = &row.pose else {
                    return row.normal.dot(&(linear - finite));
                };
                let ball = pose.sensitivity.ball;
                let change = row.surface.distance(&(ball + finite)) - row.surface.distance(&ball);
                row.normal.dot(linear) - change
            })
            .collect()
    }
}

/// Readings of each linear axis that nothing prescribes.
fn latched(chain: &Chain, prescribed: &[usize], rows: &[Row]) -> Vec<Vec<f64>> {
    let moving = (0..chain.axes().len()).filter(|axis| {
        chain.axis(*axis).kind == JointKind::Prismatic && !prescribed.contains(axis)
    });
    moving
        .map(|axis| {
            let read = |row: &Row| row.pose.as_ref().map(|pose| pose.latched[axis]);
            rows.iter().filter_map(read).collect()
        })
        .collect()
}

/// Root mean square that the rounding of the axes to a grid of this step leaves in the deviations, m.
fn rounding(step: f64, rows: &[Row], prescribed: &[usize]) -> f64 {
    let poses = rows
        .iter()
        .filter_map(|row| Some((row, row.pose.as_ref()?)));
    let shares = poses.map(|(row, pose)| -> f64 {
        let seen = pose.sensitivity.axes.iter().enumerate();
        seen.filter(|(axis, _)| !prescribed.contains(axis))
            .map(|(_, along)| row.normal.dot(along).powi(2))
            .sum()
    });
    let (sum, count) = shares.fold((0.0, 0.0), |(sum, count), share| (sum + share, count + 1.0));
    step * (sum / f64::max(count, 1.0) / 12.0).sqrt()
}

fn rms(values: &[f64]) -> f64 {
    let sum: f64 = values.iter().map(|value| value * value).sum();
    (sum / values.len().max(1) as f64).sqrt()
}

/// True of about [`MOST`] numbers below `count`, of all where it is not larger; evenly spread, whatever the period of the pattern that
/// is touched: by the multiples of the golden ratio (Weyl 1916).
fn is_kept(number: usize, count: usize) -> bool {
    const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
    let share = u64::MAX / count as u64;
    count <= MOST || (number as u64).wrapping_mul(GOLDEN) < share.saturating_mul(MOST as u64)
}

fn start_of(session: &Session) -> f64 {
    let stamps = (session
        .joint_states
        .iter()
        .map(|state| seconds(&state.header.stamp)))
    .chain(
        session
            .machine_states
            .iter()
            .map(|state| seconds(&state.header.stamp)),
    )
    .chain(
        session
            .events
            .iter()
            .map(|event| seconds(&event.header.stamp)),
    );
    let first = stamps.fold(f64::INFINITY, f64::min);
    if first.is_finite() { first } else { 0.0 }
}

struct Builder<'a> {
    sensors: &'a [Series],
    chain: &'a Chain,
    nominal: &'a Nominal,
    plan: &'a InspectionPlan,
    prescribed: &'a [usize],
    start: f64,
    machine_states: &'a [MachineState],
    indices: BTreeMap<Vec<i64>, usize>,
    skipped: Vec<(u64, &'static str)>,
    usable: usize,
    /// True where the axes stood at targets while an instrument measured where they were.
    standing: bool,
}

impl Builder<'_> {
    fn touches(&mut self, events: &[ProbeEvent]) -> Result<(Vec<Row>, Vec<f64>), SessionError> {
        let mut by_sequence: BTreeMap<u64, &ProbeEvent> = BTreeMap::new();
        for event in events {
            if let Some(known) = by_sequence.insert(event.sequence, event)
                && (known.point_index != event.point_index
                    || known.axis_positions != event.axis_positions)
            {
                return Err(SessionError::Conflicting(event.sequence));
            }
        }
        // What every touch needs; the rows of those that are kept are laid out afterwards, for they take a hundred times as much.
        let axes = self.chain.axes().len();
        let (mut usable, mut positions) = (Vec::new(), Vec::new());
        for (sequence, event) in by_sequence {
            if event.outcome != ProbeEvent::OUTCOME_TOUCHED {
                self.skipped.push((sequence, "no touch"));
                continue;
            }
            let latched = machine::touch_positions(self.chain, self.plan, event)?;
            let approach = [
                event.approach.x,
                event.approach.y,
                event.approach.z,
                event.feed,
            ];
            if !approach.iter().all(|value| value.is_finite()) {
                self.skipped.push((sequence, "feed or approach not finite"));
                continue;
            }
            positions.extend(latched);
            usable.push(event);
        }
        self.usable = usable.len();
        let start = self.start;
        let time = |event: &ProbeEvent| seconds(&event.header.stamp) - start;
        let mut order: Vec<usize> = (0..usable.len()).collect();
        order.sort_by(|&one, &other| time(usable[one]).total_cmp(&time(usable[other])));
        let moves: Vec<Vec<f64>> = (0..axes)
            .map(|axis| {
                let read = |&touch: &usize| positions[touch * axes + axis];
                last_moves(&order.iter().map(read).collect::<Vec<_>>())
            })
            .collect();
        let mut kept: Vec<(usize, usize)> = order
            .into_iter()
            .enumerate()
            .filter(|&(number, _)| is_kept(number, usable.len()))
            .map(|(number, touch)| (touch, number))
            .collect();
        // Combinations of axis positions are numbered in the order of the touches' numbers.
        kept.sort_unstable();
        let mut rows = Vec::with_capacity(kept.len());
        for (touch, number) in kept {
            let (event, time) = (usable[touch], time(usable[touch]));
            let latched = positions[touch * axes..][..axes].to_vec();
            let approach = Vector3::new(event.approach.x, event.approach.y, event.approach.z);
            let point = event.point_index as usize;
            let deviation = self.nominal.deviation(self.chain, point, &latched);
            let mut pose = self.pose_at_contact(point, latched, &(approach * event.feed));
            let mut row = self.row(point, Some(event.sequence));
            // Across the surface (along the circle of a ball bar) the approach itself says from where each axis comes; positions
            // before and after a turning point do not.
            let passes = event.feed == 0.0 && row.normal.dot(&approach).abs() < ACROSS;
            pose.arrived = if passes {
                let moved = pose.sensitivity.axes.iter();
                moved.map(|moved| side(moved.dot(&approach))).collect()
            } else {
                moves.iter().map(|signs| signs[number]).collect()
            };
            row.index = self.index(&pose.positions);
            row.time = time;
            row.feed = event.feed;
            row.kelvin_above_20_celsius = self.kelvin_above_20_celsius(time);
            row.responses = self.sensors.iter().map(|sensor| sensor.at(time)).collect();
            row.pose = Some(pose);
            rows.push((row, deviation));
        }
        rows.sort_by(|one, other| one.0.time.total_cmp(&other.0.time));
        Ok(rows.into_iter().unzip())
    }

    /// The machine with the ball moved from where it was latched to where it touches the nominal point.
    ///
    /// Axes that stood still while an instrument measured them stay: there the point holds the deviation, not the reading.
    fn pose_at_contact(
        &self,
        point: usize,
        mut positions: Vec<f64>,
        velocity: &Vector3<f64>,
    ) -> Pose {
        let read = positions.clone();
        let (part, ball) = (&self.nominal.part_pose, &self.nominal.ball);
        let (nominal, normal) = &self.nominal.points[point];
        let latched = self.chain.sensitivity(&positions, part, ball);
        let mut missing = nominal + normal.into_inner() * self.nominal.ball_radius - latched.ball;
        if self.standing || velocity.norm_squared() == 0.0 {
            missing = Vector3::zeros();
        }
        for (position, change) in
            positions
                .iter_mut()
                .zip(free_speeds(self.chain, self.prescribed, &latched, &missing))
        {
            *position += change;
        }
        let sensitivity = self.chain.sensitivity(&positions, part, ball);
        let speeds = free_speeds(self.chain, self.prescribed, &sensitivity, velocity);
        Pose {
            arrived: vec![0.0; read.len()],
            latched: read,
            positions,
            sensitivity,
            speeds,
        }
    }

    fn references(
        &mut self,
        reference: &ReferenceMeasurement,
        rows: &mut Vec<Row>,
        deviations: &mut Vec<f64>,
    ) -> Result<(), SessionError> {
        let bad = |what| SessionError::Reference {
            instrument: reference.instrument.clone(),
            what,
        };
        if reference.plan_id != self.plan.plan_id {
            return Err(bad("it belongs to another plan"));
        }
        if reference.point_index.len() != reference.deviation.len() {
            return Err(bad("point_index and deviation differ in length"));
        }
        if !(reference.standard_uncertainty.is_finite() && reference.standard_uncertainty > 0.0) {
            return Err(bad("standard_uncertainty is not positive"));
        }
        for (&point, &deviation) in reference.point_index.iter().zip(&reference.deviation) {
            if point as usize >= self.plan.points.len() {
                return Err(bad("it names a point the plan lacks"));
            }
            if !deviation.is_finite() {
                return Err(bad("a deviation is not finite"));
            }
            rows.push(self.row(point as usize, None));
            deviations.push(deviation);
        }
        Ok(())
    }

    fn row(&self, point: usize, sequence: Option<u64>) -> Row {
        let planned = &self.plan.points[point];
        let (position, normal) = self.nominal.points[point];
        let operation = usize::try_from(planned.operation)
            .ok()
            .and_then(|index| self.plan.operations.get(index));
        let cut_here = self.plan.machined_on_this_machine;
        let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
        Row {
            point,
            feature: planned.feature as usize,
            sequence,
            index: 0,
            time: 0.0,
            feed: 0.0,
            position,
            normal: normal.into_inner(),
            surface: self.nominal.surfaces[point],
            pose: None,
            cut: operation.filter(|_| cut_here).and_then(|operation| {
                let rotary = &operation.rotary_positions;
                cut_pose(self.chain, self.nominal, self.prescribed, &position, rotary)
            }),
            kelvin_above_20_celsius: None,
            responses: Vec::new(),
            tool: operation.map(|operation| operation.tool_number),
            cut_length: finite(planned.cut_length),
            tool_height: finite(planned.tool_height),
            overhang: finite(planned.overhang),
            weight: 1.0,
        }
    }

    fn index(&mut self, positions: &[f64]) -> usize {
        let key = self
            .prescribed
            .iter()
            .map(|&axis| (positions[axis] * 1e4).round() as i64)
            .collect();
        let next = self.indices.len();
        *self.indices.entry(key).or_insert(next)
    }

    /// Part temperature above 20 °C, interpolated between machine states.
    fn kelvin_above_20_celsius(&self, time: f64) -> Option<f64> {
        let at = |state: &MachineState| {
            let index = state
                .temperature_names
                .iter()
                .position(|name| name == "part")?;
            let value = *state.temperatures.get(index)?;
            value
                .is_finite()
                .then_some((seconds(&state.header.stamp) - self.start, value - 20.0))
        };
        let later = self
            .machine_states
            .partition_point(|state| seconds(&state.header.stamp) - self.start <= time);
        let before = later
            .checked_sub(1)
            .and_then(|index| self.machine_states.get(index))
            .and_then(at);
        let after = self.machine_states.get(later).and_then(at);
        match (before, after) {
            (Some((t0, w0)), Some((t1, w1))) if t1 > t0 => {
                Some(w0 + (w1 - w0) * (time - t0) / (t1 - t0))
            }
            (Some((_, kelvin)), _) | (None, Some((_, kelvin))) => Some(kelvin),
            (None, None) => None,
        }
    }
}

/// The machine with the tool, taken as long as the stylus, at a point; `rotary` as in the plan's operation. `None` where that
/// does not say how the tool was held: the axes that are left can turn it (an arm).
pub fn cut_pose(
    chain: &Chain,
    nominal: &Nominal,
    prescribed: &[usize],
    position: &Point3<f64>,
    rotary: &[f64],
) -> Option<Pose> {
    let mut fixed = vec![None; chain.axes().len()];
    for (&axis, &position) in prescribed.iter().zip(rotary) {
        fixed[axis] = Some(position);
    }
    let turning = (0..fixed.len())
        .filter(|&axis| fixed[axis].is_none() && chain.axis(axis).kind == JointKind::Revolute);
    if turning.count() > 3 {
        return None;
    }
    let start = vec![0.0; fixed.len()];
    let target = Target {
        ball: *position,
        orientation: None,
    };
    let (pose, ball) = (&nominal.part_pose, &nominal.ball);
    let positions = chain.reach(&target, &fixed, &start, pose, ball).ok()?;
    let sensitivity = chain.sensitivity(&positions, pose, ball);
    Some(Pose {
        speeds: vec![0.0; positions.len()],
        arrived: vec![0.0; positions.len()],
        latched: positions.clone(),
        positions,
        sensitivity,
    })
}

/// Speeds of the free axes that move the ball by `velocity` (m/s, part frame) without turning it.
pub fn free_speeds(
    chain: &Chain,
    prescribed: &[usize],
    sensitivity: &Sensitivity,
    velocity: &Vector3<f64>,
) -> Vec<f64> {
    let free: Vec<usize> = (0..chain.axes().len())
        .filter(|axis| !prescribed.contains(axis))
        .collect();
    let mut speeds = vec![0.0; chain.axes().len()];
    if free.is_empty() {
        return speeds;
    }
    let mut jacobian = DMatrix::zeros(6, free.len());
    for (column, &axis) in free.iter().enumerate() {
        jacobian
            .fixed_view_mut::<3, 1>(0, column)
            .copy_from(&sensitivity.axes[axis]);
        jacobian
            .fixed_view_mut::<3, 1>(3, column)
            .copy_from(&sensitivity.turns[axis]);
    }
    let mut wanted = DVector::zeros(6);
    wanted.fixed_rows_mut::<3>(0).copy_from(velocity);
    if let Ok(found) = jacobian.svd(true, true).solve(&wanted, 1e-9) {
        for (&axis, &speed) in free.iter().zip(found.iter()) {
            if speed.abs() > STANDS * velocity.norm() {
                speeds[axis] = speed;
            }
        }
    }
    speeds
}
