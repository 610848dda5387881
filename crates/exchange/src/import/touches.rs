//! A table of touches, a row for each: where the ball stood, or how far the surface was from nominal.
//!
//! With columns `axis.NAME` the machine is known and the axes say where the ball was. Without them the part frame is the machine
//! ([`PART_FRAME_MACHINE`]), and the ball's centre follows from one of `deviation`, the measured point `x, y, z`, or the
//! measured centre `ball_x, ball_y, ball_z`. Rows with the same nominal point, normal, feature and rotary axes are repeated
//! touches of one point.

use std::collections::BTreeMap;

use machine::{Chain, JointKind, Nominal, PART_FRAME_MACHINE};
use nalgebra::{Point3, Vector3};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::geometry_msgs::Pose;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachineState, ProbeEvent, Stylus,
    is_unprintable, std_msgs,
};

use super::columns::Columns;
use super::features::unit;
use super::{Counts, Imported, frame};
use crate::ImportError;
use crate::table::{Layout, Row, Table};
use crate::units::{Quantity, Units};

/// s
const DAY: f64 = 86_400.0;
/// No coordinate is farther away, m: the diagnosis takes none.
const FARTHEST: f64 = 1e3;

/// What the caller knows of a table of touches.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How the file is written.
    pub layout: Layout,
    /// `ROLE=COLUMN,…`, see [`super::columns::roles`].
    pub columns: String,
    /// Units of the columns.
    pub units: Units,
    /// The machine whose axes the file has; `None`: the part frame.
    pub machine: Option<Machine>,
    /// Radius of the stylus ball, m; needed where the ball's centre is measured.
    pub ball_radius: Option<f64>,
    /// Speed of the approach of every touch, m/s; 0 where the axes stood while an instrument was read.
    pub feed: Option<f64>,
    /// A plan whose points the column `point` names; `None`: the rows make the plan.
    pub plan: Option<InspectionPlan>,
    /// Nominal features; empty: each name is a surface of its points.
    pub features: Vec<InspectionFeature>,
    /// Name of the plan and of the part.
    pub name: String,
    /// The part was cut in this clamping.
    pub machined_on_this_machine: bool,
    /// Refuse single rows, instead of the file.
    pub skip_bad_rows: bool,
}

/// A machine, and how part and probe sit in it.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Its URDF.
    pub urdf: String,
    /// Part frame in the link `workpiece`.
    pub part_pose: Pose,
    /// Stylus in the link `probe_mount`; its radius is that of [`Settings::ball_radius`] where this is given.
    pub stylus: Stylus,
}

/// Reads a table of touches.
///
/// # Errors
/// The first mistake, with line and column where there is one; with `skip_bad_rows` only what concerns the whole file.
pub fn read_table(table: &Table, settings: &Settings) -> Result<Imported, ImportError> {
    let (columns, table) = Columns::with_constants(&settings.columns, table)?;
    let mut reader = Reader::new(settings, &columns)?;
    let mut imported = Imported {
        robot_description: reader.urdf.clone(),
        counts: Counts {
            passed_over: table.passed_over + u64::from(table.header_line > 0),
            header: table.header_line > 0,
            ..Counts::default()
        },
        ..Imported::default()
    };
    for row in &table.rows {
        match reader.row(row) {
            Ok(()) => imported.counts.read += 1,
            Err(error) if settings.skip_bad_rows => {
                imported.counts.refused += 1;
                imported.refused.push(error);
            }
            Err(error) => return Err(error),
        }
    }
    if imported.counts.read == 0 {
        return Err(ImportError::whole(format!(
            "the file has no touch{}",
            table.hint()
        )));
    }
    if table.left_out > 0 {
        let (kept, all) = (table.rows.len(), table.rows.len() as u64 + table.left_out);
        imported.remarks.push(format!(
            "{kept} of {all} rows, evenly spread, are imported: the table has very many"
        ));
    }
    reader.finish(&mut imported);
    Ok(imported)
}

/// How a row says where the ball was.
enum Measured {
    Axes(Vec<(String, usize, Quantity)>),
    Deviation(usize),
    Surface([usize; 3]),
    Ball([usize; 3]),
}

/// What a row says of where the ball was, m and rad; of axes with the ball's centre that follows, part frame.
enum Raw {
    Axes(Vec<f64>, Point3<f64>),
    Deviation(f64),
    Surface([f64; 3]),
    Ball([f64; 3]),
}

/// Seconds of the day of `HH:MM` or `HH:MM:SS`, also with AM or PM.
fn clock(text: &str) -> Option<f64> {
    let text = text.trim().to_ascii_uppercase();
    let (text, half) = match (text.strip_suffix("AM"), text.strip_suffix("PM")) {
        (Some(text), _) => (text.trim(), Some(0.0)),
        (_, Some(text)) => (text.trim(), Some(12.0)),
        _ => (text.as_str(), None),
    };
    let (hours, rest) = text.split_once(':')?;
    let (minutes, seconds) = rest.split_once(':').unwrap_or((rest, "0"));
    let number = |text: &str, below: f64| {
        let digits = text
            .bytes()
            .all(|byte| byte.is_ascii_digit() || byte == b'.');
        let value = text.parse::<f64>().ok().filter(|_| digits)?;
        (value < below).then_some(value)
    };
    let whole = |text: &str, below: f64| number(text, below).filter(|value| value.fract() == 0.0);
    let hours = match half {
        Some(half) => whole(hours, 13.0).filter(|hours| *hours > 0.0)? % 12.0 + half,
        None => whole(hours, 24.0)?,
    };
    Some(hours * 3600.0 + whole(minutes, 60.0)? * 60.0 + number(seconds, 60.0)?)
}

/// Columns of angle, radius and Z of a shaft, where one of them is named.
fn shaft(columns: &Columns) -> Result<Option<[usize; 3]>, ImportError> {
    match ["angle", "radius", "nominal_z"].map(|role| columns.get(role)) {
        [None, None, _] => Ok(None),
        [Some(angle), Some(radius), Some(z)] => Ok(Some([angle, radius, z])),
        _ => Err(ImportError::whole(
            "angle, radius and nominal_z go together: name all three, or a number for all rows (radius=25,nominal_z=0)",
        )),
    }
}

/// Columns that say where a touch is made, in the part frame.
#[derive(Clone, Copy)]
enum Place {
    /// Nominal point and outward normal.
    Point([usize; 3], [usize; 3]),
    /// Angle about Z, radius and Z of a shaft.
    Shaft([usize; 3]),
}

/// A touch with the time it was made, s; sorted by it in the end.
struct Touch {
    time: f64,
    event: ProbeEvent,
    temperatures: Vec<f64>,
}

struct Reader<'a> {
    settings: &'a Settings,
    columns: &'a Columns,
    measured: Measured,
    nominal: Option<Place>,
    urdf: String,
    chain: Chain,
    placed: Nominal,
    plan: InspectionPlan,
    /// Points by their bits, so that the same row content is the same point.
    known: BTreeMap<(String, Vec<u64>), u32>,
    rotary: Vec<usize>,
    temperatures: Vec<(String, usize)>,
    /// Clock of the last row, s, and days before it.
    clock: Option<(f64, f64)>,
    touches: Vec<Touch>,
}

impl<'a> Reader<'a> {
    fn new(settings: &'a Settings, columns: &'a Columns) -> Result<Self, ImportError> {
        let (urdf, part_pose, mut stylus) = match &settings.machine {
            Some(machine) => (
                machine.urdf.clone(),
                machine.part_pose,
                machine.stylus.clone(),
            ),
            None => (
                PART_FRAME_MACHINE.to_owned(),
                frame::identity(),
                Stylus::default(),
            ),
        };
        if let Some(radius) = settings.ball_radius {
            stylus.ball_radius = radius;
        }
        let chain =
            Chain::from_urdf(&urdf).map_err(|error| ImportError::whole(error.to_string()))?;
        let measured = measured(settings, columns, &chain)?;
        let shaft = shaft(columns)?;
        let position = match shaft {
            Some(_) => columns
                .get("nominal_x")
                .or(columns.get("nominal_y"))
                .map(|one| [one; 3]),
            None => columns.triple(["nominal_x", "nominal_y", "nominal_z"])?,
        };
        let normal = columns.triple(["i", "j", "k"])?;
        let place = match (position, normal, shaft) {
            (Some(position), Some(normal), None) => Some(Place::Point(position, normal)),
            (None, None, Some(shaft)) => Some(Place::Shaft(shaft)),
            _ => None,
        };
        let nominal = match (&settings.plan, place, columns.get("point")) {
            (Some(_), None, Some(_)) if position.is_none() && normal.is_none() => None,
            (Some(_), ..) => {
                return Err(ImportError::whole(
                    "with a plan the file has a column point, and neither nominal points nor normals",
                ));
            }
            (None, Some(place), None) => Some(place),
            (None, ..) => {
                return Err(ImportError::whole(
                    "name the columns nominal_x, nominal_y, nominal_z and i, j, k, of a shaft angle, radius and nominal_z, or give a plan and name the column point",
                ));
            }
        };
        let rotary: Vec<usize> = match &measured {
            Measured::Axes(axes) => (0..axes.len())
                .filter(|&index| axes[index].2 == Quantity::Angle)
                .collect(),
            _ => Vec::new(),
        };
        let plan = settings.plan.clone().unwrap_or_else(|| InspectionPlan {
            plan_id: settings.name.clone(),
            part_id: settings.name.clone(),
            machined_on_this_machine: settings.machined_on_this_machine,
            part_pose,
            stylus,
            rotary_names: match &measured {
                Measured::Axes(axes) => rotary.iter().map(|&index| axes[index].0.clone()).collect(),
                _ => Vec::new(),
            },
            features: settings.features.clone(),
            ..InspectionPlan::default()
        });
        let placed =
            Nominal::from_plan(&plan).map_err(|error| ImportError::whole(error.to_string()))?;
        let temperatures = columns.of_prefix("temperature.");
        if settings.machine.is_some() && columns.get("feed").is_none() && settings.feed.is_none() {
            return Err(ImportError::whole(
                "the feed of the approach is not known: name the column feed, or say --feed-mm-per-min (0: the axes stood while an instrument was read)",
            ));
        }
        Ok(Self {
            temperatures: temperatures
                .map(|(name, index)| (name.to_owned(), index))
                .collect(),
            settings,
            columns,
            measured,
            nominal,
            urdf,
            chain,
            placed,
            plan,
            known: BTreeMap::new(),
            rotary,
            clock: None,
            touches: Vec::new(),
        })
    }

    /// The number in a column, in SI.
    fn si(&self, row: &Row, index: usize, quantity: Quantity) -> Result<f64, ImportError> {
        let factor = self.settings.units.of(quantity)?.1;
        let value = factor * row.number(index, self.settings.layout)?;
        let is_length = matches!(quantity, Quantity::Length | Quantity::Deviation);
        if is_length && value.abs() > FARTHEST {
            return Err(row.wrong(index, "expected a length that a machine reaches (1 km)"));
        }
        Ok(value)
    }

    fn lengths(&self, row: &Row, columns: [usize; 3]) -> Result<[f64; 3], ImportError> {
        let [a, b, c] = columns.map(|index| self.si(row, index, Quantity::Length));
        Ok([a?, b?, c?])
    }

    fn row(&mut self, row: &Row) -> Result<(), ImportError> {
        let outcome = self.outcome(row)?;
        let raw = self.raw(row)?;
        let time = match self.columns.get("time") {
            Some(index) => self.time(row, index)?,
            None => 0.0,
        };
        let feed = match self.columns.get("feed") {
            Some(index) => self.si(row, index, Quantity::Feed)?,
            None => self.settings.feed.unwrap_or(0.0),
        };
        let mut temperatures = Vec::new();
        for (_, index) in &self.temperatures {
            let value = row.number(*index, self.settings.layout)?;
            temperatures.push(self.settings.units.celsius(value)?);
        }
        let rotary: Vec<f64> = match &raw {
            Raw::Axes(positions, _) => self.rotary.iter().map(|&index| positions[index]).collect(),
            _ => Vec::new(),
        };
        // Nothing below is refused: a row adds its point only with its touch.
        let point = self.point(row, &rotary, feed)?;
        let planned = &self.plan.points[point as usize];
        let nominal = Vector3::from(<[f64; 3]>::from(planned.position));
        let normal = Vector3::from(<[f64; 3]>::from(planned.normal));
        let radius = self.plan.stylus.ball_radius;
        let (positions, tip) = match raw {
            Raw::Axes(positions, tip) => (Some(positions), tip),
            Raw::Deviation(value) => (None, Point3::from(nominal + normal * (value + radius))),
            Raw::Surface(at) => (None, Point3::from(Vector3::from(at) + normal * radius)),
            Raw::Ball(at) => (None, Point3::from(at)),
        };
        let positions = positions.unwrap_or_else(|| vec![tip.x, tip.y, tip.z]);
        let names = match &self.measured {
            Measured::Axes(axes) => axes.iter().map(|axis| axis.0.clone()).collect(),
            _ => ["X", "Y", "Z"].map(str::to_owned).to_vec(),
        };
        let event = ProbeEvent {
            plan_id: self.plan.plan_id.clone(),
            point_index: point,
            outcome,
            axis_names: names,
            axis_positions: positions,
            tip: [tip.x, tip.y, tip.z].into(),
            approach: <[f64; 3]>::from(-normal).into(),
            feed,
            ..ProbeEvent::default()
        };
        self.touches.push(Touch {
            time,
            event,
            temperatures,
        });
        Ok(())
    }

    /// Where the ball was, as the row says it.
    fn raw(&self, row: &Row) -> Result<Raw, ImportError> {
        match &self.measured {
            Measured::Axes(axes) => {
                let (mut names, mut positions) = (Vec::new(), Vec::new());
                for (name, index, quantity) in axes {
                    names.push(name.clone());
                    positions.push(self.si(row, *index, *quantity)?);
                }
                let all = self.chain.positions(&names, &positions);
                let all = all.map_err(|error| ImportError::at(row.line, 1, error.to_string()))?;
                let tip = self
                    .chain
                    .ball_in_part(&all, &self.placed.part_pose, &self.placed.ball);
                Ok(Raw::Axes(positions, tip))
            }
            Measured::Deviation(index) => {
                Ok(Raw::Deviation(self.si(row, *index, Quantity::Deviation)?))
            }
            Measured::Surface(columns) => Ok(Raw::Surface(self.lengths(row, *columns)?)),
            Measured::Ball(columns) => Ok(Raw::Ball(self.lengths(row, *columns)?)),
        }
    }

    fn outcome(&self, row: &Row) -> Result<u8, ImportError> {
        let Some(index) = self.columns.get("outcome") else {
            return Ok(ProbeEvent::OUTCOME_TOUCHED);
        };
        match row.cell(index)?.text.as_str() {
            "touched" => Ok(ProbeEvent::OUTCOME_TOUCHED),
            "no_contact" => Ok(ProbeEvent::OUTCOME_NO_CONTACT),
            "early" => Ok(ProbeEvent::OUTCOME_EARLY),
            _ => Err(row.wrong(index, "expected touched, no_contact or early")),
        }
    }

    /// Seconds of the row's instant; since 1970 where it is a date, and since the midnight before the first row where it is a clock.
    fn time(&mut self, row: &Row, index: usize) -> Result<f64, ImportError> {
        let (unit, factor) = self.settings.units.of(Quantity::Time)?;
        if unit == "clock" {
            let time = clock(&row.cell(index)?.text);
            let time =
                time.ok_or_else(|| row.wrong(index, "expected a clock as in 23:59 or 23:59:30"))?;
            let (before, days) = self.clock.unwrap_or((time, 0.0));
            // Set back by more than half a day, it has passed midnight.
            let days = days + f64::from(u8::from(time < before - DAY / 2.0));
            self.clock = Some((time, days));
            return Ok(days * DAY + time);
        }
        if unit != "rfc3339" {
            let time = factor * row.number(index, self.settings.layout)?;
            return super::instant(time, row, index);
        }
        let text = &row.cell(index)?.text;
        let instant = humantime::parse_rfc3339_weak(text).ok();
        let since = instant.and_then(|at| at.duration_since(std::time::UNIX_EPOCH).ok());
        since
            .map(|since| since.as_secs_f64())
            .ok_or_else(|| row.wrong(index, "expected a date and time as in 2026-01-31T12:00:00Z"))
    }

    /// Nominal point, m, and normal.
    fn place(&self, row: &Row, place: Place) -> Result<([f64; 3], [f64; 3]), ImportError> {
        match place {
            Place::Point(position, normal_at) => {
                let position = self.lengths(row, position)?;
                let mut normal = [0.0; 3];
                for (value, index) in normal.iter_mut().zip(normal_at) {
                    *value = row.number(index, self.settings.layout)?;
                }
                let normal = unit(normal)
                    .ok_or_else(|| row.wrong(normal_at[0], "expected i, j, k of unit length"))?;
                Ok((position, normal))
            }
            Place::Shaft([angle, radius_at, z]) => {
                let (sine, cosine) = self.si(row, angle, Quantity::Angle)?.sin_cos();
                let radius = self.si(row, radius_at, Quantity::Length)?;
                if radius <= 0.0 {
                    return Err(row.wrong(radius_at, "expected a radius above 0"));
                }
                let z = self.si(row, z, Quantity::Length)?;
                Ok(([radius * cosine, radius * sine, z], [cosine, sine, 0.0]))
            }
        }
    }

    /// The row's point in the plan, which is added to where the rows make the plan.
    fn point(&mut self, row: &Row, rotary: &[f64], feed: f64) -> Result<u32, ImportError> {
        let Some(place) = self.nominal else {
            let index = self.columns.get("point").unwrap_or_default();
            let count = self.plan.points.len();
            let found = row.cell(index)?.text.parse::<u32>().ok();
            return found
                .filter(|&point| (point as usize) < count)
                .ok_or_else(|| {
                    row.wrong(
                        index,
                        &format!("expected a point of the plan, 0 to {}", count.max(1) - 1),
                    )
                });
        };
        let (position, normal) = self.place(row, place)?;
        let name = match self.columns.get("feature") {
            Some(index) if row.cell(index)?.text.is_empty() => {
                return Err(row.wrong(index, "expected the name of a feature"));
            }
            Some(index) if row.cell(index)?.text.chars().any(is_unprintable) => {
                return Err(row.wrong(
                    index,
                    "expected the name of a feature, which can be printed",
                ));
            }
            Some(index) => row.cell(index)?.text.clone(),
            None => "surface".to_owned(),
        };
        let numbers = position.iter().chain(&normal).chain(rotary);
        let key = (name.clone(), numbers.map(|value| value.to_bits()).collect());
        if let Some(&point) = self.known.get(&key) {
            return Ok(point);
        }
        let feature = match self.plan.features.iter().position(|known| known.id == name) {
            Some(feature) => feature,
            None if !self.settings.features.is_empty() => {
                let what = "expected a feature of the table of features";
                return Err(row.wrong(self.columns.get("feature").unwrap_or_default(), what));
            }
            None => {
                self.plan.features.push(InspectionFeature {
                    id: name,
                    kind: InspectionFeature::SURFACE,
                    origin: position.into(),
                    axis: normal.into(),
                    lower_tolerance: f64::NEG_INFINITY,
                    upper_tolerance: f64::INFINITY,
                    ..InspectionFeature::default()
                });
                self.plan.features.len() - 1
            }
        };
        let point = self.plan.points.len() as u32;
        self.plan.points.push(InspectionPoint {
            feature: feature as u32,
            position: position.into(),
            normal: normal.into(),
            rotary_positions: rotary.to_vec(),
            feed,
            operation: -1,
            ..InspectionPoint::default()
        });
        self.known.insert(key, point);
        Ok(point)
    }

    /// Numbers the touches in the order of their times.
    fn finish(mut self, imported: &mut Imported) {
        let timed = self.columns.get("time").is_some();
        if !self.touches.is_sorted_by(|a, b| a.time <= b.time) {
            self.touches.sort_by(|a, b| a.time.total_cmp(&b.time));
            imported.remarks.push(
                "the rows are not in the order of their times: touches are numbered by time"
                    .to_owned(),
            );
        }
        if !timed {
            imported
                .remarks
                .push("the file has no times: nothing that drifts can be seen in it".to_owned());
        }
        let units = &self.settings.units;
        if matches!(self.measured, Measured::Deviation(_))
            && let Some(unit) = units.of_deviations_by_length()
        {
            let other = if unit == "um" { "mm" } else { "um" };
            imported.remarks.push(format!(
                "deviations are read in {unit}, the unit of length (--units deviation={other} for another)"
            ));
        }
        if self.settings.machine.is_none() {
            imported.remarks.push(
                "no machine is given: the touches are known in the part frame, and no effect of an axis or link is sought".to_owned(),
            );
        }
        for (sequence, touch) in (0..).zip(self.touches) {
            let header = std_msgs::Header {
                stamp: Time::from_nanos((touch.time * 1e9).round() as i64),
                frame_id: "part".to_owned(),
            };
            if !touch.temperatures.is_empty() {
                imported.machine_states.push(MachineState {
                    header: header.clone(),
                    machine_id: self.chain.name().to_owned(),
                    temperature_names: self.temperatures.iter().map(|one| one.0.clone()).collect(),
                    temperatures: touch.temperatures,
                    feed_override: 1.0,
                    ..MachineState::default()
                });
            }
            imported.events.push(ProbeEvent {
                header,
                sequence,
                ..touch.event
            });
        }
        imported.plan = self.plan;
    }
}

/// Which columns say where the ball was: exactly one kind.
fn measured(
    settings: &Settings,
    columns: &Columns,
    chain: &Chain,
) -> Result<Measured, ImportError> {
    let mut axes = Vec::new();
    for (name, index) in columns.of_prefix("axis.") {
        let Some(axis) = chain.axis_index(name) else {
            let known: Vec<_> = chain.axis_names().collect();
            return Err(ImportError::whole(format!(
                "the machine {} has no axis {name}; it has {}",
                chain.name(),
                known.join(", ")
            )));
        };
        let quantity = match chain.axis(axis).kind {
            JointKind::Revolute => Quantity::Angle,
            _ => Quantity::Length,
        };
        axes.push((name.to_owned(), index, quantity));
    }
    let surface = columns.triple(["x", "y", "z"])?;
    let ball = columns.triple(["ball_x", "ball_y", "ball_z"])?;
    let found = match (axes.is_empty(), columns.get("deviation"), surface, ball) {
        (false, None, None, None) if settings.machine.is_some() => Measured::Axes(axes),
        (false, ..) if settings.machine.is_none() => {
            return Err(ImportError::whole(
                "positions of axes mean nothing without their machine: say --urdf or --cell",
            ));
        }
        (true, ..) if settings.machine.is_some() => {
            return Err(ImportError::whole(
                "a machine is given, but no column axis.NAME with the positions of its axes",
            ));
        }
        (true, Some(index), None, None) => Measured::Deviation(index),
        (true, None, Some(columns), None) => Measured::Surface(columns),
        (true, None, None, Some(columns)) => {
            if settings.ball_radius.is_none() && settings.plan.is_none() {
                return Err(ImportError::whole(
                    "centres of the ball say nothing of the surface without its radius: say --ball-radius-mm",
                ));
            }
            Measured::Ball(columns)
        }
        _ => {
            return Err(ImportError::whole(
                "name the columns of exactly one of deviation; x, y, z; ball_x, ball_y, ball_z; axis.NAME",
            ));
        }
    };
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(layout: Layout, columns: &str) -> Settings {
        Settings {
            layout,
            columns: columns.to_owned(),
            units: Units::parse("length=in,angle=deg,deviation=thou").expect("units"),
            machine: None,
            ball_radius: None,
            feed: None,
            plan: None,
            features: Vec::new(),
            name: "shaft".to_owned(),
            machined_on_this_machine: false,
            skip_bad_rows: false,
        }
    }

    fn read(text: &str, columns: &str) -> Result<Imported, ImportError> {
        let layout = Layout::default();
        read_table(&Table::read(text, layout)?, &settings(layout, columns))
    }

    #[test]
    fn a_clock_passes_midnight() {
        let text = "a,d,t\n0,1,11:59:30 PM\n1,1,23:59:59.5\n2,1,00:01\n3,1,12:02 am\n";
        let roles = "angle=a,radius=1,nominal_z=0,deviation=d,time=t";
        let settings = |layout| Settings {
            units: Units::parse("length=mm,angle=deg,time=clock").expect("units"),
            ..settings(layout, roles)
        };
        let layout = Layout::default();
        let read = |text: &str| read_table(&Table::read(text, layout)?, &settings(layout));
        let times: Vec<f64> = (read(text).expect("touches").events.iter())
            .map(|event| {
                let stamp = event.header.stamp;
                f64::from(stamp.sec) + f64::from(stamp.nanosec) * 1e-9 - 86_370.0
            })
            .collect();
        assert_eq!(times, [0.0, 29.5, 90.0, 150.0]);
        for wrong in ["24:00", "7", "1:60", "13:00 PM", "1:2:3:4", "-1:00"] {
            let told = read(&text.replace("00:01", wrong))
                .expect_err(wrong)
                .to_string();
            assert!(
                told.starts_with("line 4, column 5: expected a clock"),
                "{told}"
            );
        }
    }

    #[test]
    fn readings_of_a_dial_around_a_shaft() {
        let text = "Section,Angle (deg),Reading (.001 in)\nA,0,+0.7\nA,90,-1.2\n";
        let roles =
            "angle=Angle (deg),radius=1,nominal_z=0.5,deviation=Reading (.001 in),feature=Section";
        let imported = read(text, roles).expect("touches");
        let points = &imported.plan.points;
        let close = |found: [f64; 3], wanted: [f64; 3]| {
            found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12)
        };
        assert!(close(points[0].position.into(), [0.0254, 0.0, 0.0127]));
        assert!(close(points[1].position.into(), [0.0, 0.0254, 0.0127]));
        assert!(close(points[1].normal.into(), [0.0, 1.0, 0.0]));
        let tip: [f64; 3] = imported.events[1].tip.into();
        assert!(close(tip, [0.0, 0.0254 - 1.2 * 25.4e-6, 0.0127]));
        for (from, to, says) in [
            (
                ",nominal_z=0.5",
                "",
                "angle, radius and nominal_z go together",
            ),
            ("radius=1", "radius=0", "expected a radius above 0"),
            (
                "radius=1",
                "radius=1,nominal_x=1",
                "name the columns nominal_x",
            ),
        ] {
            let wrong = read(text, &roles.replace(from, to)).expect_err(from);
            assert!(wrong.to_string().contains(says), "{wrong}");
        }
    }
}
