//! The report of the times of moves.

use effects::session::Session;
use inference::relevance::used;
use machine::Chain;
use metrology::statistics::{chi_squared_quantile, coverage_factor, rms};

use super::Rows;
use super::fit::{Fitted, STAMP};
use super::judge::{Judged, Named};
use crate::report::residuals::{MoveResidual, MoveResiduals, Residuals};
use crate::report::{
    Alternative, Durations, Effect, Gap, Level, Machine, ParameterEstimate, Place, Rejected,
    Report, SCHEMA, Unexplained, Verdict,
};

/// Windows of time whose shares of the gap are told.
const WINDOWS: usize = 4;
/// Why a selected limit is not named.
const IDLE: &str = "probable, not named because the held-out gap is as small without it, or the difference is below what \
                    the motion model itself may be wrong by (0.3 % of the time between two touches)";

/// The report and the rows behind it.
pub(super) fn report(session: &Session, rows: &Rows<'_>, judged: &Judged) -> (Report, Residuals) {
    let gap = rows.residuals(&[]);
    let active = &judged.active;
    let gap_used = used(&gap, active);
    let effects: Vec<Effect> = judged
        .named
        .iter()
        .map(|named| effect(rows, judged, named))
        .collect();
    let is_unknown = judged.unexplained > 0.0;
    let verdict = match (effects.is_empty(), is_unknown) {
        (true, false) => Verdict::NoGap,
        (true, true) => Verdict::Unexplained,
        (false, false) => Verdict::Explained,
        (false, true) => Verdict::PartlyExplained,
    };
    let left = rows.residuals(&judged.fitted.settings);
    let mut warnings = rows.moves.remarks.clone();
    let strays = active.iter().filter(|used| !**used).count();
    if strays > 0 {
        warnings.push(format!(
            "{strays} moves were excluded as outliers: no motion model that fits the others explains their durations"
        ));
    }
    let machine = Chain::from_urdf(&session.robot_description)
        .ok()
        .map(|chain| Machine::of(&session.robot_description, chain.name()));
    let report = Report {
        schema: SCHEMA.to_owned(),
        bag: session.name.clone(),
        fitted: Vec::new(),
        withheld: Vec::new(),
        measured: session.measured(),
        mount: None,
        machine,
        samples: gap_used.len(),
        verdict,
        level: Level::default(),
        channel: "time".to_owned(),
        gap: Gap {
            unit: "s".to_owned(),
            rms: rms(&gap_used),
            noise_floor: judged.floor,
            ratio: rms(&gap_used) / judged.floor,
        },
        noise: Vec::new(),
        place: places(rows, active, &gap),
        declared: Vec::new(),
        effects,
        unexplained: Unexplained {
            rms: judged.unexplained,
            place: if is_unknown {
                remaining(rows, judged, &left)
            } else {
                Vec::new()
            },
            ladder: Vec::new(),
        },
        rejected: rejected(rows, judged),
        next_measurement: Vec::new(),
        durations: Some(durations(rows, judged)),
        measurements: None,
        warnings,
    };
    (
        report.finished(),
        Residuals::Moves(residuals(session, rows, judged, &gap, &left)),
    )
}

fn durations(rows: &Rows<'_>, judged: &Judged) -> Durations {
    let sum = |values: Vec<f64>| used(&values, &judged.active).iter().sum::<f64>();
    Durations {
        promised: sum(rows.durations(&[])),
        measured: sum(rows.measured.clone()),
        explained: sum(rows.durations(&judged.fitted.settings)),
    }
}

fn effect(rows: &Rows<'_>, judged: &Judged, named: &Named) -> Effect {
    let identifier = rows.limits[named.limit].effect.clone();
    let mut alternatives: Vec<Alternative> = Vec::new();
    for (limit, fitted) in &named.equals {
        let effect = rows.limits[*limit].effect.clone();
        if alternatives.iter().all(|known| known.effect != effect) {
            let parameters = parameters(rows, judged, fitted, *limit);
            alternatives.push(Alternative { effect, parameters });
        }
    }
    let names = alternatives.iter().map(|one| one.effect.clone());
    let indistinguishable_from: Vec<String> = names.collect();
    Effect {
        probability: named.probability,
        parameters: parameters(rows, judged, &judged.fitted, named.limit),
        rms_before: rms(&named.before),
        rms_after: rms(&named.after).max(STAMP),
        ci95_after: interval(&named.after),
        held_out: true,
        indistinguishable_from,
        group: Vec::new(),
        alternatives,
        joint_zero: None,
        placebo_rms_after: None,
        sessions: Vec::new(),
        effect: identifier,
    }
}

/// The value of a limit with its interval, and the declared one.
fn parameters(
    rows: &Rows<'_>,
    judged: &Judged,
    fitted: &Fitted,
    limit: usize,
) -> Vec<ParameterEstimate> {
    let Some(member) = fitted.settings.iter().position(|one| one.0 == limit) else {
        return Vec::new();
    };
    let count = judged.active.iter().filter(|used| **used).count();
    let freedom = count.saturating_sub(fitted.settings.len()).max(1) as f64;
    let own = &rows.limits[limit];
    let estimate = |name: &str, value: f64, ci95: [f64; 2]| ParameterEstimate {
        name: name.to_owned(),
        value,
        unit: own.unit.to_owned(),
        ci95,
    };
    let ci95 = fitted.interval(rows, member, coverage_factor(0.95, freedom));
    let mut parameters = vec![estimate(own.name, fitted.settings[member].1, ci95)];
    parameters.extend(
        own.declared
            .map(|value| estimate("declared", value, [value; 2])),
    );
    parameters
}

/// 95 % interval of the root mean square of normal residuals.
fn interval(residuals: &[f64]) -> [f64; 2] {
    let count = residuals.len() as f64;
    let at = |probability: f64| {
        rms(residuals) * (count / chi_squared_quantile(probability, count)).sqrt()
    };
    [at(0.975), at(0.025)]
}

/// The axis that a row waits for by the declared model.
fn leading(rows: &Rows<'_>, row: usize) -> usize {
    let limits = rows.moves.declared.axes();
    let travel = rows.moves.travel(&rows.moves.intervals[row]);
    let time = |axis: &usize| travel[*axis] / limits[*axis].velocity;
    (0..travel.len())
        .max_by(|a, b| time(a).total_cmp(&time(b)))
        .unwrap_or(0)
}

/// Shares of the energy of the gap: of the moves that wait for each axis.
fn places(rows: &Rows<'_>, active: &[bool], gap: &[f64]) -> Vec<Place> {
    let of_used = || (0..gap.len()).filter(|row| active[*row]);
    let total: f64 = of_used().map(|row| gap[row] * gap[row]).sum();
    if total <= 0.0 {
        return Vec::new();
    }
    let mut sums = vec![0.0; rows.moves.axes.len()];
    for row in of_used() {
        sums[leading(rows, row)] += gap[row] * gap[row] / total;
    }
    let mut places: Vec<Place> = (rows.moves.axes.iter().zip(sums))
        .filter(|(_, share)| *share > 0.0)
        .map(|((name, _), share)| Place {
            dimension: "axis".to_owned(),
            key: name.clone(),
            from: None,
            to: None,
            share,
        })
        .collect();
    places.sort_by(|a, b| b.share.total_cmp(&a.share));
    places
}

/// Where what remains is: windows of time where it changes with time, else the axis that the moves wait for.
fn remaining(rows: &Rows<'_>, judged: &Judged, left: &[f64]) -> Vec<Place> {
    if !judged.changes {
        return places(rows, &judged.active, left);
    }
    let intervals = &rows.moves.intervals;
    let last = intervals.last().map_or(0.0, |row| row.time);
    let total: f64 = used(left, &judged.active).iter().map(|s| s * s).sum();
    let window = |number: usize| {
        let [from, to] = [number, number + 1].map(|end| last * end as f64 / WINDOWS as f64);
        let within = (0..left.len()).filter(|row| {
            judged.active[*row] && intervals[*row].time > from && intervals[*row].time <= to
        });
        Place {
            dimension: "time".to_owned(),
            key: "t".to_owned(),
            from: Some(from),
            to: Some(to),
            share: within.map(|row| left[row] * left[row]).sum::<f64>() / total,
        }
    };
    let mut places: Vec<Place> = (0..WINDOWS).map(window).collect();
    places.sort_by(|a, b| b.share.total_cmp(&a.share));
    places
}

fn rejected(rows: &Rows<'_>, judged: &Judged) -> Vec<Rejected> {
    let is_idle = |name: &String| {
        judged
            .idle
            .iter()
            .any(|limit| rows.limits[*limit].effect == *name)
    };
    let is_named = |name: &String| {
        judged
            .named
            .iter()
            .any(|one| rows.limits[one.limit].effect == *name)
    };
    let mut rejected: Vec<Rejected> = (judged.probabilities.iter())
        .filter(|(name, _)| !is_named(name))
        .map(|(name, probability)| Rejected {
            effect: name.clone(),
            probability: probability.min(1.0),
            reason: is_idle(name).then(|| IDLE.to_owned()),
        })
        .collect();
    rejected.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    rejected
}

fn residuals(
    session: &Session,
    rows: &Rows<'_>,
    judged: &Judged,
    gap: &[f64],
    left: &[f64],
) -> MoveResiduals {
    let held_out = judged.named.last().map(|named| &named.after);
    let promised = rows.durations(&[]);
    let mut judged_so_far = 0;
    let moves = (rows.moves.intervals.iter().enumerate())
        .map(|(row, interval)| {
            let is_used = judged.active[row];
            let after = match held_out {
                Some(after) if is_used => after[judged_so_far],
                _ => left[row],
            };
            judged_so_far += usize::from(is_used);
            MoveResidual {
                points: interval.points,
                time: interval.time,
                travel: rows.moves.travel(interval),
                promised: promised[row],
                measured: interval.measured,
                before: gap[row],
                after: is_used.then_some(after),
            }
        })
        .collect();
    MoveResiduals {
        session: session.name.clone(),
        axes: rows.moves.axes.clone(),
        moves,
    }
}
