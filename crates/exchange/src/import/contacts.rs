//! A recording of somebody else's system: where the ball or the joints were, over time, and the level of a contact signal. Each rise of
//! the signal is a touch at the position interpolated to that instant, of the point of a plan that is nearest to the ball.

use machine::{Chain, Nominal};
use nalgebra::{Point3, Vector3};
use probecell_msgs::InspectionPlan;

use super::Imported;
use super::frame::identity;
use super::touches::{self, Machine};
use crate::ImportError;
use crate::table::{Cell, Layout, Row, Table};
use crate::units::Units;

/// A longer pause between two samples, s, is no motion that a line describes.
const LONGEST_PAUSE: f64 = 1.0;

/// Positions at instants.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// Joints by the names of the machine's axes; empty: the centre of the ball, in the part frame.
    pub joints: Vec<String>,
    /// s since 1970, in order, with x, y, z (m) or the position of each joint (m, rad).
    pub samples: Vec<(f64, Vec<f64>)>,
}

/// What the caller knows of a recording.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The plan whose points were touched.
    pub plan: InspectionPlan,
    /// The machine of the joints; of the ball's poses none is needed.
    pub machine: Option<Machine>,
    /// By how much the signal comes later than the contact, s.
    pub delay: f64,
    /// A touch lies no farther from its point than this, m.
    pub within: f64,
    /// Leave contacts out that belong to no point, instead of refusing the recording.
    pub skip_strays: bool,
}

/// The touches of a recording. `signal` has the level of the contact at instants, s since 1970, in order. Gives the largest speed at a
/// contact as well, m/s.
///
/// # Errors
/// A contact at which no position is known, or that belongs to no point of the plan.
pub fn read(
    motion: &Motion,
    signal: &[(f64, bool)],
    settings: &Settings,
) -> Result<(Imported, f64), ImportError> {
    let mut settings = settings.clone();
    if motion.joints.is_empty() {
        // Poses are those of the ball in the part frame, whatever machine the plan was made for.
        settings.plan.part_pose = identity();
        settings.plan.stylus.ball_center = [0.0; 3].into();
        settings.plan.rotary_names.clear();
        for point in &mut settings.plan.points {
            point.rotary_positions.clear();
        }
    }
    let seen = Seen::new(motion, &settings)?;
    let mut remarks = Vec::new();
    let mut strays = Vec::new();
    let mut rows = Vec::new();
    let mut fastest = 0.0_f64;
    let contacts = rises(signal, &mut remarks);
    for (number, at) in (1..).zip(contacts) {
        match seen.touch(at - settings.delay, &settings) {
            Ok(touch) => {
                fastest = fastest.max(touch.feed);
                rows.push(touch.row(number));
            }
            Err(what) => {
                let error = ImportError::whole(format!("contact {number} at {at:.6} s: {what}"));
                if !settings.skip_strays {
                    return Err(error);
                }
                strays.push(error);
            }
        }
    }
    if rows.is_empty() {
        return Err(ImportError::whole(
            "the contact signal never rises at a point of the plan",
        ));
    }
    let roles = seen.roles();
    let table = Table {
        header: roles.clone(),
        rows,
        ..Table::default()
    };
    let columns: Vec<String> = roles.iter().map(|role| format!("{role}={role}")).collect();
    let imported = touches::read_table(
        &table,
        &touches::Settings {
            layout: Layout::default(),
            columns: columns.join(","),
            units: Units::parse("length=m,angle=rad,time=s,feed=m/s")?,
            machine: settings.machine.filter(|_| seen.chain.is_some()),
            ball_radius: None,
            feed: None,
            name: settings.plan.plan_id.clone(),
            machined_on_this_machine: settings.plan.machined_on_this_machine,
            plan: Some(settings.plan),
            features: Vec::new(),
            skip_bad_rows: false,
        },
    );
    let mut imported = imported?;
    imported.counts.refused += strays.len() as u64;
    imported.refused.extend(strays);
    imported.remarks.extend(remarks);
    Ok((imported, fastest))
}

/// Instants at which the signal rises.
fn rises(signal: &[(f64, bool)], remarks: &mut Vec<String>) -> Vec<f64> {
    if signal.first().is_some_and(|(_, level)| *level) {
        remarks.push(
            "the contact signal is high when the recording begins: no touch is known of that"
                .to_owned(),
        );
    }
    let pairs = signal.windows(2);
    pairs
        .filter(|pair| !pair[0].1 && pair[1].1)
        .map(|pair| pair[1].0)
        .collect()
}

/// Where the ball was, and how the motion says it.
struct Seen<'a> {
    motion: &'a Motion,
    /// The machine of joints, with the place of each joint of the motion among its axes.
    chain: Option<Chain>,
    placed: Nominal,
}

/// A touch: the point, the numbers of the motion there, and the speed of the ball.
struct Touch {
    at: f64,
    point: usize,
    numbers: Vec<f64>,
    feed: f64,
}

impl Touch {
    fn row(&self, number: u64) -> Row {
        let first = [
            self.point.to_string(),
            self.at.to_string(),
            self.feed.to_string(),
        ];
        let numbers = self.numbers.iter().map(f64::to_string);
        let cells = first.into_iter().chain(numbers);
        Row {
            line: number,
            cells: (1..)
                .zip(cells)
                .map(|(column, text)| Cell { text, column })
                .collect(),
        }
    }
}

impl<'a> Seen<'a> {
    fn new(motion: &'a Motion, settings: &Settings) -> Result<Self, ImportError> {
        let whole = |error: &dyn std::fmt::Display| ImportError::whole(error.to_string());
        let placed = Nominal::from_plan(&settings.plan).map_err(|error| whole(&error))?;
        let chain = match &settings.machine {
            _ if motion.joints.is_empty() => None,
            None => {
                return Err(ImportError::whole(
                    "positions of joints mean nothing without their machine",
                ));
            }
            Some(machine) => {
                let chain = Chain::from_urdf(&machine.urdf).map_err(|error| whole(&error))?;
                for axis in chain.axis_names() {
                    if !motion.joints.iter().any(|name| name == axis) {
                        return Err(ImportError::whole(format!(
                            "the recording has no joint {axis}; it has {}",
                            motion.joints.join(", ")
                        )));
                    }
                }
                Some(chain)
            }
        };
        Ok(Self {
            motion,
            chain,
            placed,
        })
    }

    /// Axes of the machine that the recording has, with their columns.
    fn axes(&self) -> Vec<(&str, usize)> {
        let Some(chain) = &self.chain else {
            return Vec::new();
        };
        let joints = (0..).zip(&self.motion.joints);
        joints
            .filter(|(_, name)| chain.axis_index(name).is_some())
            .map(|(index, name)| (name.as_str(), index))
            .collect()
    }

    fn roles(&self) -> Vec<String> {
        let mut roles = ["point", "time", "feed"].map(str::to_owned).to_vec();
        match &self.chain {
            None => roles.extend(["ball_x", "ball_y", "ball_z"].map(str::to_owned)),
            Some(_) => roles.extend(self.axes().iter().map(|(name, _)| format!("axis.{name}"))),
        }
        roles
    }

    /// Numbers of the motion at an instant, between those of the samples before and after it.
    fn numbers(&self, at: f64) -> Result<[(f64, Vec<f64>); 3], String> {
        let samples = &self.motion.samples;
        let after = samples.partition_point(|(instant, _)| *instant <= at);
        if after == 0 || after == samples.len() {
            return Err("no position is recorded before and after it".to_owned());
        }
        let columns: Vec<usize> = match &self.chain {
            None => vec![0, 1, 2],
            Some(_) => self.axes().into_iter().map(|(_, column)| column).collect(),
        };
        let sample = |(instant, all): &(f64, Vec<f64>)| {
            (
                *instant,
                columns
                    .iter()
                    .map(|&column| all[column])
                    .collect::<Vec<_>>(),
            )
        };
        let (before, after) = (sample(&samples[after - 1]), sample(&samples[after]));
        let pause = after.0 - before.0;
        if pause > LONGEST_PAUSE {
            return Err(format!(
                "no position is recorded for {pause:.1} s around it"
            ));
        }
        let share = (at - before.0) / pause;
        let pairs = before.1.iter().zip(&after.1);
        let between = pairs.map(|(a, b)| a + share * (b - a)).collect();
        Ok([before, (at, between), after])
    }

    fn ball(&self, numbers: &[f64]) -> Result<Point3<f64>, String> {
        let Some(chain) = &self.chain else {
            return Ok(Point3::new(numbers[0], numbers[1], numbers[2]));
        };
        let names: Vec<String> = self
            .axes()
            .iter()
            .map(|(name, _)| (*name).to_owned())
            .collect();
        let all = chain
            .positions(&names, numbers)
            .map_err(|error| error.to_string())?;
        Ok(chain.ball_in_part(&all, &self.placed.part_pose, &self.placed.ball))
    }

    fn touch(&self, at: f64, settings: &Settings) -> Result<Touch, String> {
        let [before, here, after] = self.numbers(at)?;
        let ball = self.ball(&here.1)?;
        let moved = self.ball(&after.1)? - self.ball(&before.1)?;
        let radius = settings.plan.stylus.ball_radius;
        let distance = |point: &probecell_msgs::InspectionPoint| {
            let normal: [f64; 3] = point.normal.into();
            let nominal: [f64; 3] = point.position.into();
            (Vector3::from(nominal) + radius * Vector3::from(normal) - ball.coords).norm()
        };
        let distances = settings.plan.points.iter().map(distance).enumerate();
        let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1));
        match nearest {
            Some((point, distance)) if distance <= settings.within => Ok(Touch {
                at,
                point,
                numbers: here.1,
                feed: moved.norm() / (after.0 - before.0),
            }),
            _ => Err(format!(
                "the ball is at {:.3}, {:.3}, {:.3} mm of the part, and the nearest point of the plan is {:.3} mm from there",
                ball.x * 1e3,
                ball.y * 1e3,
                ball.z * 1e3,
                nearest.map_or(f64::INFINITY, |one| one.1) * 1e3
            )),
        }
    }
}
