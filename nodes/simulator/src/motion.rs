//! The moves of a measuring program in time, and where each probing move ends.
//!
//! Positioning moves are straight in the axes and follow the motion model of the machine ([`machine::motion`]): the
//! slowest axis sets the pace, and the others keep in step. Probing moves take the distance of the ball over the feed. A probing move ends where the true ball touches the true surface: the
//! distance d(s) of ball and surface along the move is solved for d(s) = r by bisection, s the share of the move.

use graph::Stamp;
use machine::{Motion, Nominal, Surface};
use nalgebra::Vector3;
use probecell_msgs::{
    ControllerCommand, ControllerReply, InspectionPlan, MeasurementOrder, ProbeTrigger, ProbingMove,
};

use crate::{
    config::Config,
    plant,
    raw::Injected,
    state::{Program, Segment, State, Then},
    truth::Truth,
};

/// The machine stands still at least for this long after a trigger, s.
const DWELL: f64 = 0.02;
/// Halvings of the move in the search for the contact: 20 mm / 2^40 is far below any resolution.
const HALVINGS: u32 = 40;

/// Builds a program, one segment after the other.
pub(crate) struct Builder {
    segments: std::collections::VecDeque<Segment>,
    at: Stamp,
    position: Vec<f64>,
    /// Where the positioning move before this one began, if there is one.
    before: Option<Vec<f64>>,
}

impl Builder {
    pub(crate) fn new(now: Stamp, position: &[f64]) -> Self {
        Self {
            segments: std::collections::VecDeque::new(),
            at: now,
            position: position.to_vec(),
            before: None,
        }
    }

    /// A positioning move, with the standstill at its target. One that is blended with the move before it is covered at
    /// constant speed in the time that remains of it.
    fn position(&mut self, motion: &Motion, to: &[f64]) {
        let from = self.position.clone();
        let overlap =
            (self.before.as_ref()).map_or(0.0, |before| motion.overlap(before, &from, to));
        let profile = motion.leading(&from, to).filter(|_| overlap == 0.0);
        let seconds = motion.time(&from, to) - overlap;
        self.push(to.to_vec(), seconds, Then::Go);
        self.before = Some(from);
        if let Some(segment) = self.segments.back_mut() {
            segment.profile = profile;
        }
    }

    pub(crate) fn push(&mut self, to: Vec<f64>, seconds: f64, then: Then) -> Stamp {
        let end = self.at.after_s(seconds);
        let from = std::mem::replace(&mut self.position, to.clone());
        self.before = None;
        self.segments.push_back(Segment {
            start: self.at,
            end,
            from,
            to,
            profile: None,
            then,
        });
        self.at = end;
        end
    }

    pub(crate) fn program(
        self,
        name: &str,
        command: ControllerCommand,
        spindle_speed: f64,
    ) -> Program {
        Program {
            name: name.to_owned(),
            command,
            spindle_speed,
            segments: self.segments,
        }
    }
}

/// The measuring program of a command whose plan and order are there.
pub(crate) fn measuring_program(
    config: &Config,
    state: &mut State,
    now: Stamp,
    command: ControllerCommand,
    plan: &InspectionPlan,
    order: &MeasurementOrder,
) -> Result<Program, String> {
    let part = Nominal::from_plan(plan).map_err(|error| error.to_string())?;
    let mut builder = Builder::new(now, &state.position);
    let names: Vec<&str> = config.chain.axis_names().collect();
    if order
        .axis_names
        .iter()
        .map(String::as_str)
        .ne(names.iter().copied())
    {
        return Err("the axes of the measuring order are not those of the machine".to_owned());
    }
    for step in &order.moves {
        if step.axis_positions.len() != names.len()
            || !step.axis_positions.iter().all(|q| q.is_finite())
        {
            return Err(format!(
                "a move to point {} has unusable axis positions",
                step.point_index
            ));
        }
        if step.kind == ProbingMove::TOUCH {
            touch(config, state, plan, &part, step, &mut builder);
        } else {
            builder.position(config.chain.motion(), &step.axis_positions);
        }
    }
    let end = builder.at;
    let reply = ControllerReply {
        header: end.header(""),
        session: state.session.clone(),
        command_id: command.command_id,
        outcome: ControllerReply::DONE,
        ..ControllerReply::default()
    };
    let position = builder.position.clone();
    builder.push(position, DWELL, Then::Finish(reply));
    Ok(builder.program(&format!("measure {}", plan.plan_id), command, 0.0))
}

fn touch(
    config: &Config,
    state: &mut State,
    plan: &InspectionPlan,
    part: &Nominal,
    step: &ProbingMove,
    builder: &mut Builder,
) {
    let fault = config
        .raw
        .fault
        .as_ref()
        .filter(|fault| {
            let since = state.touches.checked_sub(fault.after_touches);
            since.is_some_and(|since| fault.touches.is_none_or(|failing| since < failing))
        })
        .map(|fault| fault.kind);
    state.touches += 1;
    let start = builder.position.clone();
    let motion = config.chain.motion();
    let distance = ball_distance(config, part, &start, &step.axis_positions);
    let ends = (start.as_slice(), step.axis_positions.as_slice());
    let seconds = distance / (step.feed * motion.program.feed_override).max(1e-6);
    // The feed is reached later by what the controller waits and by half of the ramp.
    let begins = motion.touching(ends, distance, step.feed) - seconds;
    let stops = motion.stopping(ends, distance, step.feed);
    if begins > 0.0 {
        builder.push(start.clone(), begins, Then::Go);
    }
    let surface = plant::surface(config, state, plan, step.point_index as usize);
    let noise = plant::normal(&mut state.random, config.raw.probe.touch_sd_um * 1e-6);
    let stuck = fault == Some(Injected::StuckProbe);
    let met = match fault {
        Some(Injected::DeadProbe) => None,
        Some(Injected::StuckProbe) => Some(0.0),
        _ => surface.and_then(|surface| {
            let machine = &config.raw.machine;
            let slipped = machine.slip.map(|slip| slip.shift(state.touches));
            let seconds = builder.at.since_s(state.begun);
            let warmed = machine.warming.map(|warming| warming.shift(seconds));
            let shift = slipped.into_iter().chain(warmed).sum();
            let meeting = Meeting {
                config,
                part,
                surface: &surface,
                noise,
                shift,
                work_offsets: &state.work_offsets,
            };
            let table = state.volumetric.then(|| config.table_of(&state.table));
            let led = |positions: &[f64]| meeting.true_positions(table.as_ref(), positions);
            meeting.contact(&led(&start), &led(&step.axis_positions))
        }),
    };
    let share = met.unwrap_or(1.0);
    let end: Vec<f64> = start
        .iter()
        .zip(&step.axis_positions)
        .map(|(from, to)| from + (to - from) * share)
        .collect();
    let stamp = builder.at.after_s(seconds * share);
    let trigger = ProbeTrigger {
        header: stamp.header("foundation"),
        session: state.session.clone(),
        plan_id: plan.plan_id.clone(),
        point_index: step.point_index,
        tripped: met.is_some() && !stuck,
        tripped_before: stuck,
        axis_names: config.chain.axis_names().map(str::to_owned).collect(),
        axis_positions: end.clone(),
        feed: step.feed,
        ..ProbeTrigger::default()
    };
    builder.push(end.clone(), seconds * share, Then::Touch(trigger));
    builder.push(end, stops.max(DWELL), Then::Go);
}

/// Path of the ball in the part frame between two positions of the axes, m.
fn ball_distance(config: &Config, part: &Nominal, from: &[f64], to: &[f64]) -> f64 {
    let place = |positions: &[f64]| {
        config
            .chain
            .ball_in_part(positions, &part.part_pose, &part.ball)
    };
    (place(to) - place(from)).norm()
}

/// A ball on its way to a surface.
struct Meeting<'a> {
    config: &'a Config,
    part: &'a Nominal,
    surface: &'a Surface,
    /// m; the probe triggers that much early.
    noise: f64,
    /// m, part frame; displacement of the part.
    shift: Vector3<f64>,
    /// m; work offsets in force.
    work_offsets: &'a [f64],
}

impl Meeting<'_> {
    /// True axis positions (m, rad) for programme positions, with the work offsets and, where it is enabled, the volumetric
    /// table.
    fn true_positions(&self, table: Option<&Truth>, positions: &[f64]) -> Vec<f64> {
        let (config, part) = (self.config, self.part);
        let positions = config.offset(positions, self.work_offsets, part);
        let by_table = |table: &Truth| {
            let corrected = table.corrected(&config.chain, &positions, &part.part_pose, &part.ball);
            corrected.ok()
        };
        let corrected = table.and_then(by_table);
        corrected.unwrap_or(positions)
    }

    /// Share of the move at which the true ball touches the surface; `None` when it does not.
    fn contact(&self, from: &[f64], to: &[f64]) -> Option<f64> {
        let direction: Vec<f64> = from.iter().zip(to).map(|(from, to)| to - from).collect();
        let clearance = |share: f64| {
            let positions: Vec<f64> = from
                .iter()
                .zip(&direction)
                .map(|(from, way)| from + way * share)
                .collect();
            self.clearance(&positions, &direction)
        };
        let (mut free, mut touching) = (0.0, 1.0);
        if clearance(free) <= 0.0 || clearance(touching) > 0.0 {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(free, touching);
            if clearance(middle) > 0.0 {
                free = middle;
            } else {
                touching = middle;
            }
        }
        Some(touching)
    }

    /// Distance of the true ball from the true surface when the axes read `positions` and move along `direction`, m.
    fn clearance(&self, positions: &[f64], direction: &[f64]) -> f64 {
        let (config, part) = (self.config, self.part);
        let ball = part.ball + Vector3::from(config.center_error);
        let mut errors = config.errors(positions, direction);
        for (error, slip) in errors.part.iter_mut().zip(self.shift.as_slice()) {
            *error += slip;
        }
        let centre = config
            .chain
            .ball_in_part_with(positions, &part.part_pose, &ball, &errors);
        self.surface.distance(&centre) - (part.ball_radius + config.radius_error + self.noise)
    }
}
