//! The simulated machine of the template: three axes that carry the ball centre, a plate with a bore, a probe. Lengths are m.

use std::collections::VecDeque;

use probecell_msgs::{MeasurementOrder, ProbingMove};

/// s between two polls.
const PERIOD: f64 = 0.01;
/// Speed of a rapid, m/s.
const RAPID: f64 = 0.2;
/// Radius at which the probe triggers.
const BALL: f64 = 2.996e-3;
/// Centre of the bore, and height of the face.
const PLATE: [f64; 3] = [0.019_996, -0.010_004, -0.040_002];

/// Axes, in the order of a position.
pub(crate) const AXES: [&str; 3] = ["X", "Y", "Z"];
/// The only tool.
pub(crate) const TOOL: u32 = 1;

/// What the machine does in one poll.
pub(crate) enum Step {
    /// Stand at a position.
    Go([f64; 3]),
    /// A probing move has ended, by a trigger or without one.
    Touch(ProbingMove, bool),
    /// The cut is complete.
    Cut,
    /// Cut on.
    Wait,
}

/// Axes, part, and offset.
pub(crate) struct Machine {
    pub(crate) position: [f64; 3],
    pub(crate) diameter: f64,
    pub(crate) wear: f64,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            position: [0.0; 3],
            diameter: 29.9e-3,
            wear: 0.0,
        }
    }
}

impl Machine {
    /// Carries out a step that moves or cuts.
    pub(crate) fn take(&mut self, step: &Step) {
        match step {
            Step::Go(position) => self.position = *position,
            Step::Cut => self.diameter = self.diameter.max(30e-3 - 25e-6 + self.wear),
            Step::Touch(..) | Step::Wait => {}
        }
    }

    /// Two seconds of cutting.
    pub(crate) fn cut() -> VecDeque<Step> {
        let waits = (0..200).map(|_| Step::Wait);
        waits.chain([Step::Cut]).collect()
    }

    /// Distance that the ball at `at` still has to go until the probe triggers.
    fn clearance(&self, at: [f64; 3]) -> f64 {
        let beside = self.diameter / 2.0 - (at[0] - PLATE[0]).hypot(at[1] - PLATE[1]);
        let above = at[2] - PLATE[2];
        let is_outside = above.min(beside) > 0.0;
        let distance = if is_outside {
            above.hypot(beside)
        } else {
            above.max(beside)
        };
        distance - BALL
    }

    /// The moves of the order, in steps of one poll, from where the axes stand.
    pub(crate) fn measure(&self, order: &MeasurementOrder) -> VecDeque<Step> {
        let (mut steps, mut at) = (VecDeque::new(), self.position);
        for step in &order.moves {
            let index = |axis| order.axis_names.iter().position(|name| name == axis);
            let to = AXES.map(|axis| index(axis).map_or(0.0, |index| step.axis_positions[index]));
            let on_way = |share: f64| std::array::from_fn(|i| at[i] + (to[i] - at[i]) * share);
            let touches = step.kind == ProbingMove::TOUCH;
            let met = touches && self.clearance(at) > 0.0 && self.clearance(to) <= 0.0;
            let end = if met { self.contact(on_way) } else { 1.0 };
            let stop: [f64; 3] = on_way(end);
            let length = (0..3)
                .map(|i| (stop[i] - at[i]).powi(2))
                .sum::<f64>()
                .sqrt();
            let speed = if step.feed > 0.0 { step.feed } else { RAPID };
            let count = (length / speed / PERIOD).ceil().max(1.0);
            let polls = (1..=count as u32).map(|poll| f64::from(poll) / count);
            steps.extend(polls.map(|share| Step::Go(on_way(end * share))));
            if touches {
                steps.push_back(Step::Touch(step.clone(), met));
            }
            at = stop;
        }
        steps
    }

    /// Share of a way at which the probe triggers, by bisection.
    fn contact(&self, on_way: impl Fn(f64) -> [f64; 3]) -> f64 {
        let (mut free, mut touching) = (0.0, 1.0);
        for _ in 0..40 {
            let middle = f64::midpoint(free, touching);
            if self.clearance(on_way(middle)) > 0.0 {
                free = middle;
            } else {
                touching = middle;
            }
        }
        touching
    }
}
