//! A first cell for an arm: the description that its maker ships, and a check of its joints on three reference balls.
//!
//! A robot description says neither where a probe hangs nor where a part can be measured. Both are found here: the stem
//! points along the last axis, away from the arm, and the balls stand where every joint turns most, of the places that are far
//! from singularities and that the planner can measure. What was found is told; what only the owner knows stands in the cell
//! file, marked so. Lengths in m, frames as in the interface contract.

use std::f64::consts::{FRAC_PI_2, PI};

use machine::{Chain, JointKind, Side, Target, as_cell, turn_onto, van_der_corput};
use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};
use probecell_msgs::PlanProgress;

use crate::{Cell, CellText};

/// Axes that place and turn a probe.
const FREE: usize = 6;
/// Attitudes in which each ball is touched: upright, and tilted by the first of these that can be planned, rad.
const TILTS: [f64; 3] = [0.54, 0.36, 0.18];
/// Centres of the balls about the origin of the part, for a reach of [`REACH`], m.
const BALLS: [[f64; 3]; 3] = [
    [-0.13, -0.18, 0.08],
    [0.12, 0.19, 0.12],
    [0.14, -0.15, 0.20],
];
/// m
const REACH: f64 = 1.3;
const BALL_RADIUS: f64 = 0.0125;
/// From the stem to the touches around it, rad.
const LATITUDE: f64 = 1.05;
/// Samples of the joints from which the reach is taken.
const SAMPLES: u32 = 2000;
/// Starts of the search for a posture where the one before does not lead there.
const STARTS: u32 = 6;
/// The ball stands this far from the surface where a place is judged, m.
const CLEAR: f64 = 0.02;
/// Places that are planned before an arm is given up.
const PLACES: usize = 6;
/// The balls stand at least so far above the plane z = 0 of the root, on which an arm usually stands, m.
const ABOVE: f64 = 0.03;
/// Heights of the part over the shoulder, and over the lowest that this leaves, as shares of the reach.
const HEIGHTS: [f64; 4] = [-0.25, 0.0, -0.45, 0.2];
const LOWEST: [f64; 3] = [0.0, 0.15, 0.3];
/// A joint is held so far within its travel, rad.
const WITHIN: f64 = 1e-3;
/// An axis reaches its top speed in this time, s, where nothing else is declared.
const RAMP: f64 = 0.25;
/// A tip nearer than this to the joint before it does not say which way the stem points, m.
const SHORT: f64 = 2e-3;

/// What the user says of the arm.
#[derive(Debug, Clone, Default)]
pub struct Wanted {
    /// Name of the cell.
    pub name: String,
    /// Name of the file of the description that the cell will name.
    pub description: String,
    /// Link that carries the probe; default: the one behind the most joints.
    pub mount: Option<String>,
    /// Direction of the stem from the mount to the ball, in the frame of the mount; default: along the last axis.
    pub stem: Option<[f64; 3]>,
    /// From the mount to the centre of the ball, m.
    pub stylus: f64,
    /// Radius of the ball, m.
    pub ball_radius: f64,
    /// Joints that stand still while the arm measures, with their positions, rad. An arm of seven without any holds its third.
    pub held: Vec<(String, f64)>,
}

/// A cell that can be planned.
#[derive(Debug, Clone)]
pub struct NewRobot {
    /// Cell file and robot description.
    pub text: CellText,
    /// What was assumed, a sentence each.
    pub assumed: Vec<String>,
}

/// Why there is no cell.
#[derive(Debug, thiserror::Error)]
pub enum NewRobotError {
    /// The description is none, or lacks something.
    #[error(transparent)]
    Description(#[from] machine::ChainError),
    /// Not as many joints as place and turn a probe.
    #[error(
        "between its root and {mount} the arm has {} joints that move ({}): a probe needs six, or more of which all but six are held (--hold JOINT=DEGREES); --mount names another link",
        axes.len(), axes.join(", ")
    )]
    Axes {
        /// Link that carries the probe.
        mount: String,
        /// Its joints.
        axes: Vec<String>,
    },
    /// The name of the folder.
    #[error("--out: {0:?} names the cell, and has to consist of letters, digits and underscores")]
    Name(String),
    /// Two links that could carry the probe.
    #[error("--mount {0}: the description has a link probe_mount, which carries the probe")]
    Mount(String),
    /// An arm on a rail or a lift.
    #[error("joint {0} slides: make it `fixed` in the description where the arm measures")]
    Slides(String),
    /// A joint that cannot stand there.
    #[error("--hold {joint}={}: its travel is {:.3}° to {:.3}°", at.to_degrees(), travel.0.to_degrees(), travel.1.to_degrees())]
    Outside {
        /// Name of the joint.
        joint: String,
        /// rad
        at: f64,
        /// rad
        travel: (f64, f64),
    },
    /// A name that is no joint of the arm.
    #[error("--hold {0}: not a joint of the arm; it has {1}")]
    Held(String, String),
    /// A joint without a speed.
    #[error("joint {0} has no velocity in its <limit>: how fast may it turn?")]
    Speed(String),
    /// Nothing tells the sense of the last axis.
    #[error(
        "which way the probe points cannot be told: along the last axis {mount} is within 2 mm of the joints before; say it in the frame of {mount}, for example --stem 0,0,1"
    )]
    Stem {
        /// Link that carries the probe.
        mount: String,
    },
    /// Nowhere can the balls be measured.
    #[error(
        "no place was found where the arm can touch three balls from above and tilted ({tried} places tried, {reached} within reach){}",
        because.as_ref().map_or_else(String::new, |one| format!("; at the best of them: {one}"))
    )]
    Place {
        /// Places tried.
        tried: usize,
        /// Places where every attitude has a posture.
        reached: usize,
        /// What the planner said of the best.
        because: Option<String>,
    },
    /// What was written is no cell.
    #[error(transparent)]
    Cell(#[from] crate::CellError),
}

/// Finds a cell for an arm.
///
/// # Errors
/// [`NewRobotError`] names what the description lacks, or that no place was found.
pub fn new_robot(
    description: &str,
    wanted: &Wanted,
    progress: &mut dyn FnMut(&PlanProgress),
) -> Result<NewRobot, NewRobotError> {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    if wanted.name.is_empty() || !wanted.name.chars().all(is_plain) {
        return Err(NewRobotError::Name(wanted.name.clone()));
    }
    // Joints that slide are fingers, lifts and rails.
    let turning: Vec<String> = (machine::tree::joints(description)?.into_iter())
        .filter(|one| one.joint.kind == JointKind::Revolute)
        .map(|one| one.joint.name)
        .collect();
    let made = as_cell(description, wanted.mount.as_deref(), &turning)?;
    if let Some(named) = &wanted.mount
        && *named != made.mount
    {
        return Err(NewRobotError::Mount(named.clone()));
    }
    let chain = Chain::from_urdf(&made.text)?;
    let mut assumed = made.added;
    let arm = Arm::new(&chain, wanted, &made.mount, &mut assumed)?;
    let (mut tried, mut reached, mut because) = (0, 0, None);
    for tilt in TILTS {
        let mut places = arm.places(tilt);
        tried += places.len();
        places.retain(|place| place.dexterity > 0.0);
        reached += places.len();
        // Of those away from singularities first where every joint turns most: a zero acts at all angles of its joint alike.
        let all = places.iter().map(|place| place.dexterity);
        let best = all.fold(0.0, f64::max);
        places.sort_by(|a, b| {
            let rank = |place: &Place| (place.dexterity > 0.5 * best, place.turned);
            let ((a_far, a_turned), (b_far, b_turned)) = (rank(a), rank(b));
            b_far.cmp(&a_far).then(b_turned.total_cmp(&a_turned))
        });
        for place in places.iter().take(PLACES) {
            let text = CellText {
                name: format!("{}.toml", wanted.name),
                cell: arm.cell_file(place, tilt),
                robot_description: made.text.clone(),
                key: String::new(),
            };
            let cell = Cell::from_text(text.clone())?;
            match cell.measuring_order(0.0, &|_| true, progress) {
                Ok(_) => {
                    assumed.push(format!(
                        "three balls about [{}] mm, touched upright and tilted by {:.0}°",
                        millimetres(&place.part),
                        tilt.to_degrees()
                    ));
                    return Ok(NewRobot { text, assumed });
                }
                Err(error) => because = because.or(Some(error.to_string())),
            }
        }
    }
    Err(NewRobotError::Place {
        tried,
        reached,
        because,
    })
}

/// A place of the part.
struct Place {
    /// Its origin in the frame of `workpiece`, m.
    part: Vector3<f64>,
    /// The least distance of the postures from a singularity; 0: not all are reached.
    dexterity: f64,
    /// Of the joint that turns least over all attitudes and balls how far it does, rad.
    turned: f64,
    /// Positions of all axes above the first ball, rad.
    home: Vec<f64>,
}

struct Arm<'a> {
    chain: &'a Chain,
    wanted: &'a Wanted,
    /// Of each axis the position at which it stands while the arm measures.
    held: Vec<Option<f64>>,
    /// Centre of the ball in the frame of the mount, m.
    ball: Point3<f64>,
    /// Foundation frame, m.
    shoulder: Point3<f64>,
    /// m
    reach: f64,
}

impl<'a> Arm<'a> {
    fn new(
        chain: &'a Chain,
        wanted: &'a Wanted,
        mount: &str,
        assumed: &mut Vec<String>,
    ) -> Result<Self, NewRobotError> {
        let names: Vec<&str> = chain.axis_names().collect();
        if let Some(slides) =
            (0..names.len()).find(|&axis| chain.axis(axis).kind != JointKind::Revolute)
        {
            return Err(NewRobotError::Slides(names[slides].to_owned()));
        }
        let mut held = vec![None; names.len()];
        for (name, position) in &wanted.held {
            let known = (chain.axis_index(name))
                .ok_or_else(|| NewRobotError::Held(name.clone(), names.join(", ")))?;
            let travel = travel(chain, known);
            if !(travel.0..=travel.1).contains(position) {
                return Err(NewRobotError::Outside {
                    joint: name.clone(),
                    at: *position,
                    travel,
                });
            }
            held[known] = Some(*position);
        }
        if wanted.held.is_empty() && names.len() == FREE + 1 {
            let (lower, upper) = travel(chain, 2);
            let position = 0.0_f64.max(lower + WITHIN).min(upper - WITHIN);
            held[2] = Some(position);
            assumed.push(format!(
                "of seven joints {} is held at {:.0}° (--hold)",
                names[2],
                position.to_degrees()
            ));
        }
        let free: Vec<usize> = (0..names.len())
            .filter(|&axis| held[axis].is_none())
            .collect();
        if free.len() != FREE {
            return Err(NewRobotError::Axes {
                mount: mount.to_owned(),
                axes: names.iter().map(|&name| name.to_owned()).collect(),
            });
        }
        if let Some(axis) = (0..names.len()).find(|&axis| chain.axis(axis).speed.is_none()) {
            return Err(NewRobotError::Speed(names[axis].to_owned()));
        }
        let zero: Vec<f64> = (0..names.len())
            .map(|axis| {
                let (lower, upper) = travel(chain, axis);
                held[axis].unwrap_or(0.0).clamp(lower, upper)
            })
            .collect();
        let stem = match wanted.stem {
            Some(stem) => Unit::new_normalize(Vector3::from(stem)),
            None => along_last_axis(chain, &free, &zero).ok_or_else(|| NewRobotError::Stem {
                mount: mount.to_owned(),
            })?,
        };
        assumed.push(format!(
            "the stylus reaches {:.0} mm from probe_mount along [{}] (--stylus-mm, --stem)",
            wanted.stylus * 1e3,
            numbers(&stem, 1.0)
        ));
        let ball = Point3::from(stem.into_inner() * wanted.stylus);
        let shoulder = frame_of(chain, free[1], &zero) * Point3::origin();
        let mut arm = Self {
            chain,
            wanted,
            held,
            ball,
            shoulder,
            reach: 0.0,
        };
        arm.reach = (1..=SAMPLES)
            .map(|sample| {
                let at = arm.sample(sample);
                let mount = chain.end_pose(Side::Tool, &at);
                (mount * arm.ball - arm.shoulder).norm()
            })
            .fold(0.0, f64::max);
        Ok(arm)
    }

    /// Positions of the joints spread over their travels.
    fn sample(&self, index: u32) -> Vec<f64> {
        const PRIMES: [u32; 16] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53];
        (self.held.iter().enumerate())
            .map(|(axis, held)| {
                let (lower, upper) = travel(self.chain, axis);
                let base = PRIMES[axis % PRIMES.len()];
                held.unwrap_or(lower + (upper - lower) * van_der_corput(index, base))
            })
            .collect()
    }

    fn scale(&self) -> f64 {
        (self.reach / REACH).clamp(0.25, 1.5)
    }

    /// Centres of the balls in the frame of the part, m.
    fn balls(&self) -> [Vector3<f64>; 3] {
        BALLS.map(|ball| Vector3::from(ball) * self.scale())
    }

    /// Places about the shoulder, judged by the attitudes with a tilt, rad.
    fn places(&self, tilt: f64) -> Vec<Place> {
        let workpiece = self.chain.end_pose(Side::Part, &vec![0.0; self.held.len()]);
        let lowest = self
            .balls()
            .iter()
            .map(|ball| ball.z)
            .fold(f64::INFINITY, f64::min);
        let floor = ABOVE - lowest;
        let over_shoulder = HEIGHTS.map(|share| self.shoulder.z + share * self.reach);
        let over_floor = LOWEST.map(|share| floor + share * self.reach);
        let heights = over_shoulder.into_iter().filter(|&height| height > floor);
        let mut places = Vec::new();
        for height in heights.chain(over_floor) {
            for distance in [0.55, 0.45, 0.65, 0.35] {
                for turn in [0.0, 0.5, -0.5, 1.0, 0.25, -0.25, 0.75, -0.75] {
                    let angle: f64 = turn * PI;
                    let outwards =
                        Vector3::new(angle.cos(), angle.sin(), 0.0) * distance * self.reach;
                    let at = Vector3::new(self.shoulder.x, self.shoulder.y, height) + outwards;
                    places.push(self.judged(tilt, (workpiece.inverse() * Point3::from(at)).coords));
                }
            }
        }
        places
    }

    fn judged(&self, tilt: f64, part: Vector3<f64>) -> Place {
        let pose = Isometry3::translation(part.x, part.y, part.z);
        let mut place = Place {
            part,
            dexterity: f64::INFINITY,
            turned: 0.0,
            home: Vec::new(),
        };
        let mut stood: Vec<Vec<f64>> = Vec::new();
        let mut starts: Vec<Vec<f64>> = (1..=STARTS).map(|start| self.sample(start)).collect();
        for ball in self.balls() {
            for stem in stems(tilt) {
                let above = ball + stem.into_inner() * (BALL_RADIUS + CLEAR);
                // The arm goes on in the posture of the attitude before, where that leads there.
                let mut nearest: Option<(f64, Vec<f64>)> = None;
                for attitude in self.attitudes(&stem) {
                    let target = Target {
                        ball: above.into(),
                        orientation: Some(attitude),
                    };
                    let reach = |start: &Vec<f64>| {
                        let at = (self.chain).reach(&target, &self.held, start, &pose, &self.ball);
                        at.ok()
                    };
                    let Some(at) = starts.iter().rev().find_map(reach) else {
                        continue;
                    };
                    let away = stood.last().map_or(0.0, |before| {
                        let each = before.iter().zip(&at).map(|(a, b)| (a - b).abs());
                        each.fold(0.0, f64::max)
                    });
                    if nearest.as_ref().is_none_or(|nearest| away < nearest.0) {
                        nearest = Some((away, at));
                    }
                }
                let Some((_, at)) = nearest else {
                    place.dexterity = 0.0;
                    return place;
                };
                let dexterity = self.chain.dexterity(&at, &self.held, &pose, &self.ball);
                place.dexterity = place.dexterity.min(dexterity);
                if place.home.is_empty() {
                    place.home.clone_from(&at);
                }
                starts.truncate(STARTS as usize);
                starts.push(at.clone());
                stood.push(at);
            }
        }
        let turned = (0..self.held.len())
            .filter(|&axis| self.held[axis].is_none())
            .map(|axis| {
                let all = stood.iter().map(|at| at[axis]);
                let ends = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
                    (low.min(at), high.max(at))
                });
                ends.1 - ends.0
            });
        place.turned = turned.fold(f64::INFINITY, f64::min);
        place
    }

    /// Attitudes of the probe (part from mount) with its stem along a direction, four turns about it.
    fn attitudes(&self, stem: &Unit<Vector3<f64>>) -> [UnitQuaternion<f64>; 4] {
        let own = Unit::new_normalize(-self.ball.coords);
        let upright = turn_onto(&own, stem);
        [0.0, 1.0, 2.0, 3.0]
            .map(|turn| UnitQuaternion::from_axis_angle(stem, turn * FRAC_PI_2) * upright)
    }

    fn cell_file(&self, place: &Place, tilt: f64) -> String {
        let mut parts = vec![self.head(place)];
        let mut names = Vec::new();
        let sides = ["up", "left", "right", "near", "far"];
        let held: Vec<f64> = self.held.iter().filter_map(|held| *held).collect();
        let rotary = if held.iter().any(|&at| at != 0.0) {
            let at: Vec<String> = held
                .iter()
                .map(|at| format!("{:.6}", at.to_degrees()))
                .collect();
            format!("rotary_deg = [{}]\n", at.join(", "))
        } else {
            String::new()
        };
        for (number, ball) in self.balls().iter().enumerate() {
            for (turn, (side, stem)) in sides.iter().zip(stems(tilt)).enumerate() {
                let name = format!("ball_{}_{side}", number + 1);
                let touches: Vec<String> = touches(&stem, 0.37 * (number * 5 + turn) as f64)
                    .map(|normal| format!("[{}]", millimetres(&(ball + normal * BALL_RADIUS))))
                    .into();
                parts.push(format!(
                    "\n[[part.features]]\nid = \"{name}\"\nkind = \"sphere\"\norigin_mm = [{}]\nradius_mm = {:.1}\n\
                     tolerance_um = [-500.0, 500.0]\nstem_directions = [[{}]]\n{rotary}touch_points_mm = [\n    {},\n]\n",
                    millimetres(ball),
                    BALL_RADIUS * 1e3,
                    numbers(&stem, 1.0),
                    touches.join(", "),
                ));
                names.push(name);
            }
        }
        let characteristics: Vec<String> = (names.iter())
            .map(|name| format!("    {{ id = \"{name}\", tolerance_mm = 0.500 }},\n"))
            .collect();
        parts.push(self.tail(place, &characteristics.concat()));
        parts.concat()
    }

    fn head(&self, place: &Place) -> String {
        let Wanted {
            name, description, ..
        } = self.wanted;
        let names: Vec<String> = (self.chain.axis_names().zip(&self.held))
            .filter(|(_, held)| held.is_some())
            .map(|(name, _)| format!("{name:?}"))
            .collect();
        let rotary = if names.is_empty() {
            String::new()
        } else {
            format!(
                "rotary_axes = [{}]   # held while the arm measures, at rotary_deg of the feature, else at 0\n",
                names.join(", ")
            )
        };
        format!(
            "# Three reference balls, each touched upright and tilted to four sides, so that the joints stand differently for the same\n\
             # place: `probecell diagnose` of the recording says which joint errs, and how. The arm is simulated until\n\
             # driver.source is \"ros2\". Table, fence and the arm itself are not in the model: before the real arm moves, set its travels\n\
             # to what is free, and make the first part slowly.\n\n\
             [cell]\nname = \"{name}\"\nrobot_description = \"{description}\"\npart = \"balls\"\n\n\
             [driver]\nsource = \"simulator\"   # \"ros2\": the arm on the topics of [ros2]\n\n\
             [ros2]\njoint_states = \"/joint_states\"\naction = \"/joint_trajectory_controller/follow_joint_trajectory\"\n\
             # Enter yours: what the contact is late by, and how well that is known. Both enter each touch and its uncertainty.\n\
             contact = {{ topic = \"/contact\", positions = \"interpolated\", delay_ms = 0.5, time_standard_uncertainty_ms = 0.2 }}\n\n\
             [part]\nid = \"three_balls\"\nmachined_on_this_machine = false\nposition_mm = [{}]   # in the frame of workpiece\n\
             approach_mm = 3.0\nretract_mm = 3.0\nfeed_mm_per_min = 300.0\nstem_turns = 8\n{rotary}\
             stylus = {{ id = \"stylus\", ball_center_mm = [{}], ball_radius_mm = {:.3} }}   # in the frame of probe_mount\n",
            millimetres(&place.part),
            millimetres(&self.ball.coords),
            self.wanted.ball_radius * 1e3,
        )
    }

    fn tail(&self, place: &Place, characteristics: &str) -> String {
        let mut axes = Vec::new();
        let mut home = Vec::new();
        for (axis, name) in self.chain.axis_names().enumerate() {
            let speed = self.chain.axis(axis).speed.unwrap_or(1.0).to_degrees();
            axes.push(format!(
                "{name:?} = {{ acceleration_deg_per_s2 = {:.1} }}\n",
                speed / RAMP
            ));
            home.push(format!(
                "{name:?} = {{ position_deg = {:.6} }}",
                place.home[axis].to_degrees()
            ));
        }
        let axes = axes.concat();
        format!(
            "\n[path_planning]\novertravel_mm = 2.0\npostures = 2\n\n\
             # No robot description has accelerations: top speed after {RAMP} s is assumed.\n[motion.axes]\n{axes}\n\
             # Enter yours: what a touch scatters by, and what all have in common.\n[analysis]\ntouch_standard_uncertainty_um = 5.0\ncommon_standard_uncertainty_um = 3.0\n\n\
             [compensation]\nwear_limit_mm = 0.110\nmax_corrections = 0\ncharacteristics = [\n{characteristics}]\n\n\
             [cycle]\npasses = [{{ name = \"check\" }}]\n\n\
             [simulator]\nseed = 1\nhome = {{ {} }}\n\
             probe = {{ center_error_um = [0.0, 0.0, 0.0], radius_error_um = 0.0, touch_sd_um = 4.0 }}\n\
             plant = {{ spring_back = 0.0, cut_sd_um = 0.0 }}\n\n\
             # What the simulated arm hides; location errors as ISO 230-1 names them, in the frame of the joint.\n\
             [simulator.machine]\nerrors = [{}]\njoints = []\n",
            home.join(", "),
            self.zero_of_second(),
        )
    }

    /// The zero of the second joint that moves, where its axis is one of its frame.
    fn zero_of_second(&self) -> String {
        let free = (0..self.held.len()).filter(|&axis| self.held[axis].is_none());
        let joint = self.chain.axis(free.clone().nth(1).unwrap_or(0));
        let along = joint.axis.iamax();
        if joint.axis[along].abs() < 1.0 - 1e-6 {
            return String::new();
        }
        let name = format!("E{}0{}", ['A', 'B', 'C'][along], joint.name);
        format!("{{ name = {name:?}, value_urad = 300.0 }}")
    }
}

/// Lowest and highest position of an axis, a full turn where it has no limits, rad.
fn travel(chain: &Chain, axis: usize) -> (f64, f64) {
    chain.axis(axis).limits.unwrap_or((-PI, PI))
}

/// Foundation from the frame of the joint of an axis.
fn frame_of(chain: &Chain, axis: usize, at: &[f64]) -> Isometry3<f64> {
    let branch = chain.branch(Side::Tool);
    let place = branch.iter().position(|&joint| joint == chain.axes()[axis]);
    place.map_or_else(Isometry3::identity, |place| {
        chain.pose_after(Side::Tool, place, at)
    })
}

/// The direction of the last axis in the frame of the mount, with the sense in which the mount lies beyond the joints before.
fn along_last_axis(chain: &Chain, free: &[usize], at: &[f64]) -> Option<Unit<Vector3<f64>>> {
    let mount = chain.end_pose(Side::Tool, at);
    let last = *free.last()?;
    let axis = frame_of(chain, last, at) * chain.axis(last).axis;
    let beyond = free.iter().rev().skip(1).take(2).map(|&before| {
        let origin = frame_of(chain, before, at).translation.vector;
        axis.dot(&(mount.translation.vector - origin))
    });
    let sense = beyond.into_iter().find(|along| along.abs() > SHORT)?;
    let axis = mount.rotation.inverse() * axis;
    Some(Unit::new_normalize(axis.into_inner() * sense.signum()))
}

/// Directions of the stem: upright, and tilted to four sides.
fn stems(tilt: f64) -> [Unit<Vector3<f64>>; 5] {
    let (sin, cos) = tilt.sin_cos();
    [
        [0.0, 0.0, 1.0],
        [0.0, sin, cos],
        [0.0, -sin, cos],
        [sin, 0.0, cos],
        [-sin, 0.0, cos],
    ]
    .map(|stem| Unit::new_normalize(Vector3::from(stem)))
}

/// Outward normals of five touches about a stem, turned about it, rad.
fn touches(stem: &Unit<Vector3<f64>>, turn: f64) -> [Vector3<f64>; 5] {
    let across = Unit::new_normalize(stem.cross(&Vector3::ith(stem.iamin(), 1.0)));
    let around = |quarter: f64| {
        let lean = UnitQuaternion::from_axis_angle(&across, LATITUDE) * stem.into_inner();
        UnitQuaternion::from_axis_angle(stem, turn + quarter * FRAC_PI_2) * lean
    };
    [
        stem.into_inner(),
        around(0.0),
        around(1.0),
        around(2.0),
        around(3.0),
    ]
}

fn millimetres(vector: &Vector3<f64>) -> String {
    numbers(vector, 1e3)
}

fn numbers(vector: &Vector3<f64>, scale: f64) -> String {
    let each = vector
        .iter()
        .map(|value| format!("{:.3}", value * scale + 0.0));
    each.collect::<Vec<_>>().join(", ")
}
