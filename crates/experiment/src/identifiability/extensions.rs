//! Remedies for confounded effects: completions of a plan, each evaluated on the signatures.
//!
//! Touches at another feed, at other positions of the rotary axes, with the spindle turned by half a turn, on an
//! unmilled artefact, again at the end, between the places, and the same points on a measuring machine. Radians,
//! metres, seconds.

use std::cell::OnceCell;
use std::f64::consts::PI;

use probecell_msgs::{InspectionPlan, InspectionPoint};
use serde::Serialize;

use super::{Span, correlation};
use crate::design::candidates::{between, feed_range, met, other_feed, places, prescribed};
use crate::design::extended_rows::{CandidateTouch, ExtendedRows};
use effects::observation::{Observations, Row};
use effects::session::perfect::{PACE, with_nominal_touches};
use effects::session::{Session, SessionError};
use effects::{Variant, candidate, observe};

/// Touches that a remedy adds at most.
const TOUCHES: usize = 24;
/// Name of the spindle angle, by the interface contract.
const SPINDLE: &str = "S";

/// A completion of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanExtension {
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

const ALL: [PlanExtension; 7] = [
    PlanExtension::AnotherFeed,
    PlanExtension::AnotherIndex,
    PlanExtension::SpindleReversal,
    PlanExtension::Artefact,
    PlanExtension::Revisit,
    PlanExtension::FinerSpacing,
    PlanExtension::Reference,
];

impl PlanExtension {
    /// In words.
    pub fn advice(self) -> &'static str {
        match self {
            Self::AnotherFeed => "touch some points at a second feed",
            Self::AnotherIndex => "touch some points at other positions of the rotary axes",
            Self::SpindleReversal => "touch some points with the spindle turned by 180°",
            Self::Artefact => "touch an artefact that this machine did not cut",
            Self::Revisit => "touch the first points again long after the end",
            Self::FinerSpacing => "touch points between those of the plan",
            Self::Reference => "measure the same points on a coordinate measuring machine",
        }
    }

    /// The touches it adds; nothing for a reference.
    fn wanted(self, observations: &Observations, plan: &InspectionPlan) -> Vec<CandidateTouch> {
        let rows = &observations.rows;
        let met = met(observations);
        let spindle = plan.rotary_names.iter().position(|name| name == SPINDLE);
        let feeds = feed_range(observations);
        let mut all = Vec::new();
        for (order, near) in places(observations, TOUCHES).into_iter().enumerate() {
            let Some(planned) = plan.points.get(rows[near].point) else {
                continue;
            };
            let taken = prescribed(observations, &rows[near]);
            let mut point = InspectionPoint {
                rotary_positions: taken.clone(),
                feed: rows[near].feed,
                ..planned.clone()
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
                    Some(index) => {
                        point.rotary_positions[index] += if taken[index] > 0.0 { -PI } else { PI };
                    }
                    None => continue,
                },
                Self::Artefact if planned.operation < 0 => continue,
                Self::Artefact => point.operation = -1,
                Self::Revisit => time += observations.span(),
                Self::FinerSpacing => match between(observations, plan, near) {
                    Some(midpoint) => {
                        point.position = midpoint.position;
                        point.normal = midpoint.normal;
                    }
                    None => continue,
                },
                Self::Reference => continue,
            }
            all.push(CandidateTouch {
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
fn other_angle(angle: f64, order: usize, axis: usize, met: &[Vec<f64>]) -> f64 {
    let others: Vec<f64> = met
        .iter()
        .map(|positions| positions[axis])
        .filter(|other| (other - angle).abs() > 1e-3)
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
        angle + step[order / 2 % step.len()]
    } else {
        others[order % others.len()]
    }
}

/// The plan with the touches of a remedy appended; as it is for a reference, which adds none.
///
/// # Errors
/// [`SessionError`] names what makes the plan unusable on its machine.
pub fn complete(session: &Session, remedy: PlanExtension) -> Result<InspectionPlan, SessionError> {
    let session = with_nominal_touches(session)?;
    let plan = session.plan.as_ref().ok_or(SessionError::NoPlan)?;
    let observations = observe(&session)?;
    let wanted = remedy.wanted(&observations, plan);
    let extended = ExtendedRows::new(&observations, plan, wanted);
    let mut complete = plan.clone();
    let further = extended.wanted.into_iter().map(|wanted| wanted.point);
    complete.points.extend(further);
    Ok(complete)
}

/// The rows of each remedy, laid out once.
pub(super) struct Remedies<'a> {
    observations: &'a Observations,
    plan: &'a InspectionPlan,
    variants: &'a [Variant],
    laid: [OnceCell<Option<ExtendedRows>>; ALL.len()],
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
    pub(super) fn all(&self) -> impl Iterator<Item = (PlanExtension, usize)> {
        ALL.into_iter().filter_map(|remedy| {
            let rows = self.laid(remedy)?.observations.rows.len();
            Some((remedy, rows - self.observations.rows.len()))
        })
    }

    fn laid(&self, remedy: PlanExtension) -> Option<&ExtendedRows> {
        let index = ALL.iter().position(|known| *known == remedy)?;
        let lay = || {
            let wanted = remedy.wanted(self.observations, self.plan);
            let mut extended = ExtendedRows::new(self.observations, self.plan, wanted);
            if remedy == PlanExtension::Reference {
                let rows = &mut extended.observations.rows;
                let further = rows[..extended.first].to_vec();
                rows.extend(further.into_iter().map(|row| Row { pose: None, ..row }));
            }
            (extended.observations.rows.len() > self.observations.rows.len()).then_some(extended)
        };
        self.laid[index].get_or_init(lay).as_ref()
    }

    /// Correlation of two spans over the completed plan.
    pub(super) fn correlation(&self, remedy: PlanExtension, a: &Span, b: &Span) -> Option<f64> {
        let rows = &self.laid(remedy)?.observations;
        let block = |span: &Span| {
            candidate(rows, self.variants, span.variant, span.shape)
                .map(|candidate| candidate.block)
        };
        Some(correlation(&block(a)?, &block(b)?).0)
    }
}
