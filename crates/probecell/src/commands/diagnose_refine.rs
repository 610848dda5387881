//! `probecell diagnose --refine`: has the running cell that recorded a session take the touches that discriminate between the
//! remaining explanations.
//!
//! The cell plans and checks the touches (`plan`) and measures them (`run` with that plan: no cut, no correction); its topics
//! bring the results. Only services and topics are used, so the machine behind them does not matter. The new measurement is
//! joined with the session, and both are diagnosed together. Distances are printed in mm.

use std::fmt::{Display, Formatter};
use std::time::Duration;

use cell::Cell;
use diagnosis::report::{Effect, NextMeasurement};
use diagnosis::{Options, Report, Residuals, Session, diagnose_with_residuals};
use effects::session::joined::join;
use experiment::next::{Effort, ProposalOptions};
use probecell_msgs::{InspectionPlan, ProbeEvent};
use serde::Serialize;

use super::running_cell::RunningCell;

/// Probability above which an explanation is accepted; the chance of a proposal is that of reaching it.
const SURE: f64 = 0.95;

/// The diagnosis before and after.
#[derive(Serialize)]
pub(crate) struct Refined {
    /// The answer from the bag alone.
    before: Report,
    /// The additional touches; none where nothing was ambiguous.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) asked: Option<Additional>,
    /// The answer from both.
    pub(crate) after: Report,
    /// One explanation is left.
    pub(crate) resolved: bool,
    #[serde(skip)]
    pub(crate) residuals: Residuals,
}

/// Touches that the cell has taken.
#[derive(Serialize)]
pub(crate) struct Additional {
    /// Plan of the further touches.
    plan_id: String,
    /// Effects that they are to discriminate.
    separates: Vec<String>,
    /// Touches asked for.
    points: usize,
    /// Touches that found a surface.
    touched: usize,
    /// Predicted probability that one explanation remains.
    promised: f64,
}

/// What a refinement has come to; its text is for people.
pub(crate) enum Step<'a> {
    /// The answer from the session alone.
    Before(&'a Report),
    /// No touch is asked for.
    Nothing,
    /// The cell is asked for touches.
    Asked {
        proposal: &'a NextMeasurement,
        cell: &'a str,
        plan_id: &'a str,
    },
    /// The answer from both.
    After {
        proposal: &'a NextMeasurement,
        touched: usize,
        before: &'a Report,
        after: &'a Report,
    },
}

impl Display for Step<'_> {
    fn fmt(&self, to: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Before(report) => report.fmt(to),
            Self::Nothing => to.write_str(
                "No remaining ambiguity can be resolved by additional touches of this plan: nothing was measured.",
            ),
            Self::Asked {
                proposal,
                cell,
                plan_id,
            } => to.write_str(&question(proposal, cell, plan_id)),
            Self::After {
                proposal,
                touched,
                before,
                after,
            } => write!(to, "{after}\n{}", answer(proposal, *touched, before, after)),
        }
    }
}

/// Diagnoses a session, has the cell take the proposed touches, and diagnoses both; tells each step.
pub(crate) fn refine(
    cell: &Cell,
    first: &Session,
    options: &Options,
    timeout: Duration,
    tell: &mut dyn FnMut(Step<'_>),
) -> anyhow::Result<Refined> {
    let (before, residuals) = diagnose_with_residuals(first, options)?;
    tell(Step::Before(&before));
    let Some((proposal, plan)) = proposal(first, options, &before)? else {
        tell(Step::Nothing);
        return Ok(Refined {
            after: before.clone(),
            resolved: resolved(&before),
            before,
            asked: None,
            residuals,
        });
    };
    let running = RunningCell::join(cell, first)?;
    let plan_id = running.next_name(first);
    tell(Step::Asked {
        proposal: &proposal,
        cell: &cell.cell.name,
        plan_id: &plan_id,
    });
    running.request(&plan_id, &plan)?;
    let later = running.measured(&plan_id, first, timeout)?;
    running.leave()?;
    let touched = (later.events.iter())
        .filter(|event| event.outcome == ProbeEvent::OUTCOME_TOUCHED)
        .count();
    let (after, residuals) = diagnose_with_residuals(&join(first, &later)?, options)?;
    tell(Step::After {
        proposal: &proposal,
        touched,
        before: &before,
        after: &after,
    });
    let resolved = resolved(&after);
    Ok(Refined {
        before,
        asked: Some(Additional {
            plan_id,
            separates: proposal.separates,
            points: plan.points.len(),
            touched,
            promised: proposal.chance,
        }),
        after,
        resolved,
        residuals,
    })
}

/// The touches that a thorough search proposes; `None` where nothing is ambiguous, or no touch resolves it.
fn proposal(
    session: &Session,
    options: &Options,
    before: &Report,
) -> anyhow::Result<Option<(NextMeasurement, InspectionPlan)>> {
    if resolved(before) {
        return Ok(None);
    }
    let options = Options {
        next: ProposalOptions {
            effort: Effort::Thorough,
            ..options.next
        },
        ..options.clone()
    };
    let (mut thorough, _) = diagnose_with_residuals(session, &options)?;
    let proposal =
        (!thorough.next_measurement.is_empty()).then(|| thorough.next_measurement.remove(0));
    Ok(proposal.and_then(|proposal| {
        let plan = proposal
            .plan
            .clone()
            .filter(|plan| !plan.points.is_empty())?;
        Some((proposal, plan))
    }))
}

/// One explanation remains; effects that no reachable touch distinguishes count as one.
fn resolved(result: &Report) -> bool {
    let alone = |effect: &Effect| effect.indistinguishable_from.is_empty();
    match result.next_measurement.first() {
        None => result.effects.iter().all(alone),
        Some(next) => {
            let first = next.explanations.first();
            first.is_some_and(|one| one.probability > SURE)
        }
    }
}

fn question(proposal: &NextMeasurement, cell: &str, plan_id: &str) -> String {
    let mut lines = vec![format!(
        "\nRequesting {} additional touches from cell {cell:?}, plan {plan_id:?}, to discriminate between {} \
         (predicted probability of one remaining explanation {:.2}):",
        proposal.points.len(),
        proposal.separates.join(", "),
        proposal.chance
    )];
    for point in &proposal.points {
        let [x, y, z] = point.position.map(|value| value * 1e3);
        let turned: Vec<String> = (point.rotary_positions.iter())
            .map(|angle| format!("{:.1}°", angle.to_degrees()))
            .collect();
        let turned = if turned.is_empty() {
            String::new()
        } else {
            format!(" at {}", turned.join(" "))
        };
        lines.push(format!(
            "  {} ({x:.3}, {y:.3}, {z:.3}) mm{turned}, {:.0} mm/min: {}",
            point.feature,
            point.feed * 60e3,
            point.why
        ));
    }
    lines.join("\n")
}

fn answer(proposal: &NextMeasurement, touched: usize, before: &Report, after: &Report) -> String {
    let names = |result: &Report| {
        let one = |effect: &Effect| {
            let mut names = vec![effect.effect.as_str()];
            names.extend(effect.indistinguishable_from.iter().map(String::as_str));
            names.join(" or ")
        };
        let all: Vec<String> = result.effects.iter().map(one).collect();
        if all.is_empty() {
            "no effect identified".to_owned()
        } else {
            all.join(" and ")
        }
    };
    let kept = if resolved(after) {
        "achieved"
    } else {
        "not achieved, several remain"
    };
    format!(
        "\nBefore: {}\nAfter {touched} additional touches: {}\nPredicted probability of one remaining explanation {:.2}: {kept}.",
        names(before),
        names(after),
        proposal.chance
    )
}
