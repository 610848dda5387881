//! What would part two effects: completions of a plan, each tried on the signatures.
//!
//! Touches at another feed, at other positions of the rotary axes, with the spindle turned by half a turn, on an
//! unmilled artefact, again at the end, between the places, and the same points on a measuring machine. Radians,
//! metres, seconds.

use std::cell::OnceCell;
use std::f64::consts::PI;

use machine::{Chain, Nominal, Target};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{InspectionPlan, InspectionPoint, ProbeEvent, geometry_msgs, std_msgs};
use serde::Serialize;

use super::{Span, correlation};
use crate::candidate::Candidate;
use crate::design::candidates::{between, feed_range, met, other_feed, places, prescribed};
use crate::design::imagined::{Imagined, Wanted};
use crate::effects::Variant;
use crate::observation::{Observations, Row};
use crate::session::{DiagnoseError, Session, seconds};

/// Touches that a remedy adds at most.
const TOUCHES: usize = 24;
/// Time between two touches of a plan that was not measured yet, s.
const PACE: f64 = 8.0;
/// Name of the spindle angle, by the interface contract.
const SPINDLE: &str = "S";

/// A completion of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Remedy {
    /// Places again at another feed.
    AnotherFeed,
    /// Places again at other positions of the rotary axes.
    AnotherIndex,
    /// Places again with the spindle turned by half a turn.
    SpindleReversal,
    /// Places of an artefact that this machine did not cut.
    Artefact,
    /// The first places again, as long after the plan as the plan took.
    Revisit,
    /// Places between those of the plan.
    FinerSpacing,
    /// The same points on a measuring machine.
    Reference,
}

const ALL: [Remedy; 7] = [
    Remedy::AnotherFeed,
    Remedy::AnotherIndex,
    Remedy::SpindleReversal,
    Remedy::Artefact,
    Remedy::Revisit,
    Remedy::FinerSpacing,
    Remedy::Reference,
];

impl Remedy {
    /// In words.
    pub fn advice(self) -> &'static str {
        match self {
            Self::AnotherFeed => "touch some points at a second feed",
            Self::AnotherIndex => "touch some points at other positions of the rotary axes",
            Self::SpindleReversal => "touch some points with the spindle turned by 180°",
            Self::Artefact => "touch an artefact that this machine did not cut",
            Self::Revisit => "touch the first points again long after the end",
            Self::FinerSpacing => "touch points between those of the plan",
            Self::Reference => "measure the same points on a measuring machine",
        }
    }

    /// The touches it adds; nothing for a reference.
    fn wanted(self, observations: &Observations, plan: &InspectionPlan) -> Vec<Wanted> {
        let rows = &observations.rows;
        let met = met(observations);
        let spindle = plan.rotary_names.iter().position(|name| name == SPINDLE);
        let feeds = feed_range(observations);
        let mut all = Vec::new();
        for (order, near) in places(observations, TOUCHES).into_iter().enumerate() {
            let Some(own) = plan.points.get(rows[near].point) else {
                continue;
            };
            let taken = prescribed(observations, &rows[near]);
            let mut point = InspectionPoint {
                rotary_positions: taken.clone(),
                feed: rows[near].feed,
                ..own.clone()
            };
            let mut time = observations.span() + PACE * (order + 8) as f64;
            match self {
                Self::AnotherFeed => point.feed = other_feed(point.feed, feeds),
                Self::AnotherIndex => {
                    let rotary: Vec<usize> =
                        (0..taken.len()).filter(|&p| Some(p) != spindle).collect();
                    let Some(&turned) = rotary.get(order % rotary.len().max(1)) else {
                        continue;
                    };
                    point.rotary_positions[turned] =
                        other_angle(taken[turned], order, turned, &met);
                }
                Self::SpindleReversal => match spindle {
                    Some(place) => {
                        point.rotary_positions[place] += if taken[place] > 0.0 { -PI } else { PI };
                    }
                    None => continue,
                },
                Self::Artefact if own.operation < 0 => continue,
                Self::Artefact => point.operation = -1,
                Self::Revisit => time += observations.span(),
                Self::FinerSpacing => match between(observations, plan, near) {
                    Some(place) => {
                        point.position = place.position;
                        point.normal = place.normal;
                    }
                    None => continue,
                },
                Self::Reference => continue,
            }
            all.push(Wanted {
                point,
                near,
                time,
                why: self.advice(),
            });
        }
        all
    }
}

/// Another angle of a rotary axis: a third of a turn on, or one met elsewhere.
fn other_angle(own: f64, order: usize, place: usize, met: &[Vec<f64>]) -> f64 {
    let others: Vec<f64> = met
        .iter()
        .map(|positions| positions[place])
        .filter(|angle| (angle - own).abs() > 1e-3)
        .collect();
    if others.is_empty() {
        let step = [
            PI / 3.0,
            -PI / 3.0,
            2.0 * PI / 3.0,
            -2.0 * PI / 3.0,
            PI / 6.0,
            -PI / 6.0,
        ];
        own + step[order / 2 % step.len()]
    } else {
        others[order % others.len()]
    }
}

/// The plan with the touches of a remedy appended; as it is for a reference, which adds none.
///
/// # Errors
/// [`DiagnoseError`] names what makes the plan unusable on its machine.
pub fn complete(session: &Session, remedy: Remedy) -> Result<InspectionPlan, DiagnoseError> {
    let session = as_if_measured(session)?;
    let plan = session.plan.as_ref().ok_or(DiagnoseError::NoPlan)?;
    let observations = Observations::from_session(&session)?;
    let wanted = remedy.wanted(&observations, plan);
    let imagined = Imagined::new(&observations, plan, wanted);
    let mut complete = plan.clone();
    let further = imagined.wanted.into_iter().map(|wanted| wanted.point);
    complete.points.extend(further);
    Ok(complete)
}

/// The rows of each remedy, laid out once.
pub(super) struct Remedies<'a> {
    observations: &'a Observations,
    plan: &'a InspectionPlan,
    variants: &'a [Variant],
    laid: [OnceCell<Option<Imagined>>; ALL.len()],
}

impl<'a> Remedies<'a> {
    pub(super) fn new(
        observations: &'a Observations,
        plan: &'a InspectionPlan,
        variants: &'a [Variant],
    ) -> Self {
        Self {
            observations,
            plan,
            variants,
            laid: std::array::from_fn(|_| OnceCell::new()),
        }
    }

    /// Remedies that add something here, with the number of their touches.
    pub(super) fn all(&self) -> impl Iterator<Item = (Remedy, usize)> {
        ALL.into_iter().filter_map(|remedy| {
            let rows = self.laid(remedy)?.observations.rows.len();
            Some((remedy, rows - self.observations.rows.len()))
        })
    }

    fn laid(&self, remedy: Remedy) -> Option<&Imagined> {
        let place = ALL.iter().position(|known| *known == remedy)?;
        let lay = || {
            let wanted = remedy.wanted(self.observations, self.plan);
            let mut imagined = Imagined::new(self.observations, self.plan, wanted);
            if remedy == Remedy::Reference {
                let rows = &mut imagined.observations.rows;
                let further = rows[..imagined.first].to_vec();
                rows.extend(further.into_iter().map(|row| Row { pose: None, ..row }));
            }
            (imagined.observations.rows.len() > self.observations.rows.len()).then_some(imagined)
        };
        self.laid[place].get_or_init(lay).as_ref()
    }

    /// Correlation of two spans over the completed plan.
    pub(super) fn correlation(&self, remedy: Remedy, one: &Span, other: &Span) -> Option<f64> {
        let rows = &self.laid(remedy)?.observations;
        let block = |span: &Span| {
            Candidate::new(rows, self.variants, span.variant, span.shape).map(|own| own.block)
        };
        Some(correlation(&block(one)?, &block(other)?).0)
    }
}

/// A session whose plan was not measured gets the touches of a perfect cell, at an even pace in the plan's order.
pub(crate) fn as_if_measured(session: &Session) -> Result<Session, DiagnoseError> {
    let plan = session.plan.as_ref().ok_or(DiagnoseError::NoPlan)?;
    if session.robot_description.is_empty() {
        return Err(DiagnoseError::NoMachine);
    }
    if !session.events.is_empty() {
        return Ok(session.clone());
    }
    let chain = Chain::from_urdf(&session.robot_description)?;
    let nominal = Nominal::from_plan(plan)?;
    let mut start: Vec<f64> = (0..chain.axes().len())
        .map(|axis| {
            let limits = chain.axis(axis).limits;
            limits.map_or(0.0, |(low, high)| f64::midpoint(low, high))
        })
        .collect();
    let first = session
        .machine_states
        .first()
        .map_or(0.0, |state| seconds(&state.header.stamp));
    let mut events = Vec::new();
    for (index, point) in plan.points.iter().enumerate() {
        let (position, normal) = nominal.points[index];
        let mut fixed = vec![None; start.len()];
        for (name, &angle) in plan.rotary_names.iter().zip(&point.rotary_positions) {
            if let Some(axis) = chain.axis_index(name) {
                fixed[axis] = Some(angle);
            }
        }
        let target = Target {
            ball: position + normal.into_inner() * nominal.ball_radius,
            orientation: None,
        };
        let reached = chain.reach(&target, &fixed, &start, &nominal.part_pose, &nominal.ball);
        // A point out of reach cannot be measured and so tells nothing.
        let Ok(positions) = reached else { continue };
        start.clone_from(&positions);
        let time = first + PACE * index as f64;
        events.push(ProbeEvent {
            header: std_msgs::Header {
                stamp: Time {
                    sec: time.floor() as i32,
                    nanosec: ((time - time.floor()) * 1e9) as u32,
                },
                frame_id: String::new(),
            },
            sequence: index as u64,
            plan_id: plan.plan_id.clone(),
            point_index: index as u32,
            outcome: ProbeEvent::OUTCOME_TOUCHED,
            axis_names: chain.axis_names().map(str::to_owned).collect(),
            axis_positions: positions,
            tip: geometry_msgs::Point {
                x: target.ball.x,
                y: target.ball.y,
                z: target.ball.z,
            },
            approach: geometry_msgs::Vector3 {
                x: -normal.x,
                y: -normal.y,
                z: -normal.z,
            },
            feed: point.feed,
        });
    }
    Ok(Session {
        events,
        ..session.clone()
    })
}
