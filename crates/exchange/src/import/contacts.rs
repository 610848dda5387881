//! A recording of somebody else's system: where the ball or the joints were, over time, and the level of a contact signal. Each rise of
//! the signal is a touch at the position of that instant, by the line of the approach, of the point of a plan that is nearest to the ball.

mod signal;
#[cfg(test)]
mod tests;

use machine::contact_position::{Sample, locate};
use machine::{Chain, Nominal};
use nalgebra::{Point3, Vector3};
use probecell_msgs::InspectionPlan;

use self::signal::{lateness, rises};
use super::Imported;
use super::frame::identity;
use super::touches::{self, Machine};
use crate::ImportError;
use crate::table::{Cell, Layout, Row, Table};
use crate::units::Units;

/// A pause between two samples of more than so many of their periods is no motion that a line describes.
const LONGEST_PAUSE: f64 = 10.0;
/// Pairs of samples whose largest speed bounds that of the ball at a contact.
const FEW: usize = 4;
/// Samples before a contact among which its approach is sought.
const NEAR: usize = 32;
/// What is nearer to a contact than this many standard uncertainties of its instant may be of after it.
const CERTAIN: f64 = 3.0;
/// m; whoever is farther from the samples on both sides of it has jumped there and back.
const JUMP: f64 = 100e-6;
/// s; a second publisher repeats positions of this age at most.
const REPEATED: f64 = 0.5;
/// One such sample may be a fault of the recorder.
const FEW_REPEATED: usize = 5;

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
    /// Standard uncertainty of the instant of a contact, s.
    pub time_uncertainty: f64,
    /// A touch lies no farther from its point than this, m.
    pub within: f64,
    /// By how much the position at a contact may be off where it is interpolated, m.
    pub position_limit: f64,
    /// Leave contacts out that belong to no point or have no position, instead of refusing the recording.
    pub skip_strays: bool,
}

/// What a recording gives.
#[derive(Clone, Debug)]
pub struct Read {
    /// The touches.
    pub imported: Imported,
    /// Largest speed at a contact, m/s.
    pub fastest: f64,
    /// By how much the position of a touch may be off, where one is interpolated, m.
    pub position_bound: f64,
}

/// The touches of a recording. `signal` has the level of the contact at instants, s since 1970, in order: high where the probe touches.
///
/// # Errors
/// A contact at which no position is known well enough, or that belongs to no point of the plan; a signal that is high at rest.
pub fn read(
    motion: &Motion,
    signal: &[(f64, bool)],
    settings: &Settings,
) -> Result<Read, ImportError> {
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
    seen.check_one_publisher()?;
    let mut remarks = Vec::new();
    let mut strays = Vec::new();
    let mut rows = Vec::new();
    let (mut fastest, mut position_bound) = (0.0_f64, 0.0_f64);
    let mut interpolated = Vec::new();
    let contacts = rises(signal, &mut remarks);
    let lateness = lateness(signal, &contacts, &mut remarks);
    seen.check_sense(signal, &settings)?;
    for (number, at) in (1..).zip(contacts) {
        match seen.touch(at - settings.delay - lateness, lateness, &settings) {
            Ok(touch) => {
                fastest = fastest.max(touch.feed);
                position_bound = position_bound.max(touch.feed * lateness);
                if let Some(bound) = touch.interpolated {
                    interpolated.push(at);
                    position_bound = position_bound.max(bound);
                }
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
    if let Some(first) = interpolated.first() {
        remarks.push(format!(
            "{} contacts, the first at {first:.6} s, have too few positions of a steady approach: they lie on a line between the positions before and after, and may be off by {:.0} µm, which U contains",
            interpolated.len(),
            position_bound * 1e6
        ));
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
    Ok(Read {
        imported,
        fastest,
        position_bound,
    })
}

/// Where the ball was, and how the motion says it.
struct Seen<'a> {
    motion: &'a Motion,
    /// The machine of joints, with the place of each joint of the motion among its axes.
    chain: Option<Chain>,
    placed: Nominal,
    /// Median time between two samples, s.
    period: f64,
}

/// A touch: the point, the numbers of the motion there, and the speed of the ball.
struct Touch {
    at: f64,
    point: usize,
    numbers: Vec<f64>,
    feed: f64,
    /// How far the ball may be from there where the approach gives no position, m.
    interpolated: Option<f64>,
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
        let pairs = motion.samples.windows(2);
        let mut periods: Vec<f64> = pairs.map(|pair| pair[1].0 - pair[0].0).collect();
        periods.sort_by(f64::total_cmp);
        Ok(Self {
            motion,
            chain,
            placed,
            period: periods.get(periods.len() / 2).copied().unwrap_or(0.0),
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

    /// Columns of the motion that place the ball.
    fn columns(&self) -> Vec<usize> {
        match &self.chain {
            None => vec![0, 1, 2],
            Some(_) => self.axes().into_iter().map(|(_, column)| column).collect(),
        }
    }

    /// Numbers of the motion at an instant, between those of the samples before and after it.
    fn numbers(&self, at: f64) -> Result<[(f64, Vec<f64>); 3], String> {
        let samples = &self.motion.samples;
        let after = samples.partition_point(|(instant, _)| *instant <= at);
        if after == 0 || after == samples.len() {
            return Err("no position is recorded before and after it".to_owned());
        }
        let columns = self.columns();
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
        let share = (at - before.0) / (after.0 - before.0);
        let pairs = before.1.iter().zip(&after.1);
        let between = pairs.map(|(a, b)| a + share * (b - a)).collect();
        Ok([before, (at, between), after])
    }

    /// Numbers of the motion at an instant, by the line of the approach; `None` where the samples before it give none.
    fn by_approach(&self, at: f64, uncertainty: f64) -> Option<Vec<f64>> {
        let samples = &self.motion.samples;
        let before = samples.partition_point(|(instant, _)| *instant <= at);
        let near = &samples[before.saturating_sub(NEAR)..(before + 1).min(samples.len())];
        let columns = self.columns();
        let pick = |all: &Vec<f64>| columns.iter().map(|&column| all[column]).collect();
        let numbers: Vec<Vec<f64>> = near.iter().map(|(_, all)| pick(all)).collect();
        let pairs = near.iter().zip(&numbers);
        let timed: Vec<Sample<'_>> = pairs
            .map(|((instant, _), one)| (instant - at, one.as_slice()))
            .collect();
        let ball = |numbers: &[f64]| self.ball(numbers).unwrap_or_else(|_| Point3::origin());
        let (found, _) = locate(&timed, CERTAIN * uncertainty, ball).ok()?;
        Some(found)
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

    /// Positions that jump back to earlier ones and forth again are those of two publishers.
    fn check_one_publisher(&self) -> Result<(), ImportError> {
        let samples = &self.motion.samples;
        let mut balls = Vec::with_capacity(samples.len());
        for (_, all) in samples {
            let numbers: Vec<f64> = self.columns().iter().map(|&column| all[column]).collect();
            balls.push(self.ball(&numbers).map_err(ImportError::whole)?);
        }
        let (mut count, mut farthest, mut first) = (0, 0.0_f64, None);
        for index in 1..samples.len().saturating_sub(1) {
            let back = balls[index] - balls[index - 1];
            let forth = balls[index + 1] - balls[index];
            let (turns, back, forth) = (back.dot(&forth) < 0.0, back.norm(), forth.norm());
            // A retract passes the positions of its approach, in one direction.
            if !turns || back < JUMP || forth < JUMP {
                continue;
            }
            let (at, numbers) = &samples[index];
            let earlier = samples[..index - 1].iter().rev();
            let mut earlier = earlier.take_while(|(instant, _)| at - instant < REPEATED);
            if earlier.any(|(_, old)| old == numbers) {
                count += 1;
                farthest = farthest.max(back.min(forth));
                first = first.or(Some(*at));
            }
        }
        match first {
            Some(at) if count >= FEW_REPEATED => Err(ImportError::whole(format!(
                "the positions jump back to earlier ones and forth again, by up to {:.2} mm, {count} times from {at:.6} s on: two nodes publish them, and a recording of one is needed",
                farthest * 1e3
            ))),
            _ => Ok(()),
        }
    }

    /// How far the ball may be from the line between the samples on both sides of an instant, m: no farther than it moves at its
    /// largest speed from the nearer of them to that instant, and as far again for what the line moves.
    fn bound(&self, at: f64, around: [&(f64, Vec<f64>); 2]) -> Result<f64, String> {
        let [before, after] = around;
        let pause = after.0 - before.0;
        if pause > LONGEST_PAUSE * self.period {
            return Err(format!(
                "no position is recorded for {pause:.3} s around it, {:.0} periods of the others",
                pause / self.period
            ));
        }
        let samples = &self.motion.samples;
        let first = samples.partition_point(|(instant, _)| *instant <= before.0);
        let columns = self.columns();
        let pick =
            |all: &Vec<f64>| -> Vec<f64> { columns.iter().map(|&column| all[column]).collect() };
        let mut fastest = 0.0_f64;
        for pair in samples[first.saturating_sub(FEW)..(first + 1).min(samples.len())].windows(2) {
            let moved = self.ball(&pick(&pair[1].1))? - self.ball(&pick(&pair[0].1))?;
            fastest = fastest.max(moved.norm() / (pair[1].0 - pair[0].0));
        }
        Ok(2.0 * fastest * (at - before.0).min(after.0 - at))
    }

    /// A signal that is high at rest rises where the ball leaves the surface.
    fn check_sense(&self, signal: &[(f64, bool)], settings: &Settings) -> Result<(), ImportError> {
        let rises: Vec<f64> = signal
            .windows(2)
            .filter(|pair| !pair[0].1 && pair[1].1)
            .map(|pair| pair[1].0)
            .collect();
        let leaving = rises
            .iter()
            .filter(|at| self.leaves(**at - settings.delay, settings))
            .count();
        let whole = signal.last().zip(signal.first());
        let whole = whole.map_or(0.0, |(last, first)| last.0 - first.0);
        let high: f64 = signal
            .windows(2)
            .filter(|pair| pair[0].1)
            .map(|pair| pair[1].0 - pair[0].0)
            .sum();
        if 2 * leaving <= rises.len() {
            return Ok(());
        }
        Err(ImportError::whole(format!(
            "the ball leaves the surface at {leaving} of {} rises of the contact signal, which is high for {:.0} % of the time: the signal has the other sense: say --normally-closed, or leave it out",
            rises.len(),
            1e2 * high / whole
        )))
    }

    /// Whether the ball moves away from the nearest point of the plan, along its normal, both before and behind an instant.
    fn leaves(&self, at: f64, settings: &Settings) -> bool {
        let samples = &self.motion.samples;
        let after = samples.partition_point(|(instant, _)| *instant <= at);
        if after < 2 || after == samples.len() {
            return false;
        }
        let columns = self.columns();
        let ball = |index: usize| {
            let all = &samples[index].1;
            let numbers: Vec<f64> = columns.iter().map(|&column| all[column]).collect();
            self.ball(&numbers).ok()
        };
        let (Some(earlier), Some(before), Some(after)) =
            (ball(after - 2), ball(after - 1), ball(after))
        else {
            return false;
        };
        let points = settings.plan.points.iter().map(|point| {
            let normal = Vector3::from(<[f64; 3]>::from(point.normal));
            let nominal = Vector3::from(<[f64; 3]>::from(point.position));
            let place = nominal + settings.plan.stylus.ball_radius * normal;
            ((place - before.coords).norm(), normal)
        });
        let Some((_, normal)) = points.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return false;
        };
        (before - earlier).dot(&normal) >= 0.0 && (after - before).dot(&normal) > 0.0
    }

    /// The touch at an instant that is known to `lateness`, s.
    fn touch(&self, at: f64, lateness: f64, settings: &Settings) -> Result<Touch, String> {
        let [before, mut here, after] = self.numbers(at)?;
        let mut interpolated = None;
        let guard = settings.time_uncertainty.max(lateness / CERTAIN);
        if let Some(numbers) = self.by_approach(at, guard) {
            here.1 = numbers;
        } else {
            let bound = self.bound(at, [&before, &after])?;
            if bound > settings.position_limit {
                return Err(format!(
                    "too few positions are of a steady approach to it, and between those {:.0} ms before and {:.0} ms after it may be off by {:.0} µm, where {:.0} µm are allowed (--position-limit-um)",
                    (at - before.0) * 1e3,
                    (after.0 - at) * 1e3,
                    bound * 1e6,
                    settings.position_limit * 1e6
                ));
            }
            interpolated = Some(bound);
        }
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
            Some((point, distance)) if distance <= settings.within => {
                let feed = moved.norm() / (after.0 - before.0);
                if feed * lateness > settings.position_limit {
                    return Err(format!(
                        "the contact signal is polled, so that its instant is known to {:.1} ms and the position to {:.0} µm, where {:.0} µm are allowed (--position-limit-um)",
                        lateness * 1e3,
                        feed * lateness * 1e6,
                        settings.position_limit * 1e6
                    ));
                }
                Ok(Touch {
                    at,
                    point,
                    numbers: here.1,
                    interpolated,
                    feed,
                })
            }
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
