//! Measurements: the touches in the order given, each where and when the samples say, and what is reported of them.

use std::time::Duration;

use cell::Cell;
use graph::Stamp;
use machine::Chain;
use path_planning::OrderRequest;
use probecell_msgs::{
    ControllerCommand, ControllerReply, InspectionPlan, MeasurementOrder, ProbeTrigger, ProbingMove,
};

use super::{
    commands::{of_kind, outcome, runs_and_ends},
    gate::Gate,
    judge::Judge,
};

/// m or rad by which a latched position may lie off the path of its probing move.
const BESIDE: f64 = 100e-6;
/// Share of a probing move by which a latched position may lie before its start or beyond its end.
const BEYOND: f64 = 0.02;
/// In which the first touch has to come, in addition to the time that the moves take.
const BEGIN_LIMIT: Duration = Duration::from_secs(60);
/// In which a busy driver has to refuse.
const BUSY_LIMIT: Duration = Duration::from_secs(5);

/// A measurement that was commanded.
pub(super) struct Measurement {
    pub(super) command: ControllerCommand,
    pub(super) order: MeasurementOrder,
    /// Index of its start in what was received.
    pub(super) mark: usize,
    /// In which it has to end.
    pub(super) limit: Duration,
}

/// Plans the part of the cell from where the axes stand, and commands to measure it; plan and order come after the
/// command where `late`.
pub(super) fn begin(gate: &mut Gate, cell: &Cell, late: bool) -> anyhow::Result<Measurement> {
    let chain = cell.chain()?;
    let here = gate.last().and_then(|sample| {
        chain
            .positions(&sample.axis_names, &sample.axis_positions)
            .ok()
    });
    let config = cell.path_planning.check(chain, &cell.part, Vec::new())?;
    let mut plan: InspectionPlan = config.part.plan(0.0);
    plan.plan_id = gate.next_plan();
    plan.header = host::now().header("part");
    let points: Vec<u32> = (0..plan.points.len() as u32).collect();
    let request = OrderRequest {
        plan: &plan,
        points: &points,
        stages: config.part.stages(),
        poses: config.part.poses(),
        seeds: &[],
        here: here.as_deref(),
    };
    let mut planned = config.rules().plan(&request, &mut |_| {})?;
    planned.order.header = host::now().header("");
    let probing: f64 = (planned.order.moves.iter())
        .filter(|one| one.kind == ProbingMove::TOUCH)
        .map(|one| {
            let point = &planned.plan.points[one.point_index as usize];
            2.0 * point.approach_distance / one.feed.max(1e-6)
        })
        .sum();
    let limit = BEGIN_LIMIT + Duration::from_secs_f64(10.0 * (planned.order.air_time + probing));
    if !late {
        gate.publish_plan(&planned.plan, &planned.order);
    }
    let mark = gate.mark();
    let command = gate.command(ControllerCommand {
        plan_id: planned.plan.plan_id.clone(),
        order: planned.order.order.clone(),
        run_id: format!("{}-conformance", cell.cell.part),
        ..of_kind(ControllerCommand::RUN_MEASUREMENT)
    });
    if late {
        gate.hear_for(Duration::from_millis(300));
        gate.publish_plan(&planned.plan, &planned.order);
    }
    Ok(Measurement {
        command,
        order: planned.order,
        mark,
        limit,
    })
}

/// Waits for so many touches; false when the measurement ended before, or none came in time.
pub(super) fn await_touches(
    gate: &mut Gate,
    judge: &mut Judge,
    run: &Measurement,
    count: usize,
) -> bool {
    let ended = |gate: &Gate| !gate.replies(run.mark, run.command.command_id).is_empty();
    gate.receive_until(run.limit, |gate| {
        gate.triggers(run.mark).len() >= count || ended(gate)
    });
    let touched = gate.triggers(run.mark).len();
    if touched >= count {
        return true;
    }
    let replies = gate.replies(run.mark, run.command.command_id);
    let why = replies.first().map_or_else(
        || format!("{touched} within {} s", run.limit.as_secs()),
        |reply| format!("{touched} and a reply: {:?}", reply.text),
    );
    judge.wrong("probe_triggers", format!("{count} touches"), why);
    false
}

/// A whole measurement, during which another one is refused; false when it did not end well.
pub(super) fn whole(gate: &mut Gate, judge: &mut Judge, cell: &Cell) -> anyhow::Result<bool> {
    judge.begin("measurement");
    let chain = cell.chain()?;
    let next = next_sequence(gate);
    let run = begin(gate, cell, false)?;
    let begun = await_touches(gate, judge, &run, 1);
    let busy = begun.then(|| {
        let mark = gate.mark();
        let second = gate.command(ControllerCommand {
            ..run.command.clone()
        });
        let reply = gate.reply(mark, second.command_id, BUSY_LIMIT);
        (mark, second, reply)
    });
    outcome(
        gate,
        judge,
        run.mark,
        &run.command,
        (ControllerReply::DONE, run.limit),
    );
    // The last triggers may be on their way, on a topic of their own.
    gate.receive_until(Duration::from_secs(1), |gate| {
        gate.triggers(run.mark).len() >= run.order.order.len()
    });
    runs_and_ends(gate, judge, run.mark);
    let good = touches(gate, judge, &run, &chain, next);
    let text = format!(
        "{} touches in the order given, then DONE",
        run.order.order.len()
    );
    let good = judge.end(&text) && good;
    if let Some((mark, second, reply)) = busy {
        judge.begin("busy");
        match reply {
            None => judge.wrong(
                "controller_replies",
                "REFUSED while a program runs",
                "no reply",
            ),
            Some(_) => {
                outcome(
                    gate,
                    judge,
                    mark,
                    &second,
                    (ControllerReply::REFUSED, BUSY_LIMIT),
                );
            }
        }
        judge.end("a second measurement is refused, and the first goes on");
    }
    Ok(good)
}

/// Number of the next touch in this session.
pub(super) fn next_sequence(gate: &Gate) -> Option<u64> {
    gate.triggers(0).last().map(|trigger| trigger.sequence + 1)
}

/// Judges the touches of a measurement that has ended. `next`: number of the first; `None` where it is the first of which
/// this process knows.
pub(super) fn touches(
    gate: &Gate,
    judge: &mut Judge,
    run: &Measurement,
    chain: &Chain,
    next: Option<u64>,
) -> bool {
    let found = gate.triggers(run.mark);
    let order = &run.order.order;
    let indices: Vec<u32> = found.iter().map(|trigger| trigger.point_index).collect();
    judge.demand(
        indices == *order,
        "probe_triggers.point_index",
        format!("{order:?}, the order of the command"),
        format!("{indices:?}"),
    );
    let mut next = next.or_else(|| found.first().map(|trigger| trigger.sequence));
    let mut before = Stamp::from(&run.command.header.stamp);
    for trigger in &found {
        judge.demand(
            Some(trigger.sequence) == next,
            "probe_triggers.sequence",
            format!(
                "{}: from 0 in a session, without gaps",
                next.unwrap_or_default()
            ),
            trigger.sequence,
        );
        next = Some(trigger.sequence + 1);
        let stamp = Stamp::from(&trigger.header.stamp);
        judge.demand(
            stamp > before,
            "probe_triggers.header.stamp",
            "the instant of the latch, after the touch before and the command",
            format!("{:.4} s before that", -stamp.since_s(before)),
        );
        before = stamp;
        one(gate, judge, run, chain, trigger);
    }
    let replies = gate.replies(run.mark, run.command.command_id);
    if let (Some(reply), Some(last)) = (replies.first(), found.last()) {
        let after = Stamp::from(&reply.header.stamp).since_s(Stamp::from(&last.header.stamp));
        judge.demand(
            after >= 0.0,
            "controller_replies.header.stamp",
            "the end of the measurement, after its last touch",
            format!("{:.4} s before it", -after),
        );
    }
    judge.holds()
}

/// Judges one touch by its move, and by the samples around it.
fn one(gate: &Gate, judge: &mut Judge, run: &Measurement, chain: &Chain, trigger: &ProbeTrigger) {
    judge.demand(
        trigger.session == gate.session(),
        "probe_triggers.session",
        format!("{:?}, that of the samples", gate.session()),
        format!("{:?}", trigger.session),
    );
    judge.demand(
        trigger.plan_id == run.command.plan_id,
        "probe_triggers.plan_id",
        format!("{:?}", run.command.plan_id),
        format!("{:?}", trigger.plan_id),
    );
    judge.demand(
        trigger.tripped && !trigger.tripped_before,
        "probe_triggers.tripped",
        "true, and tripped_before false, on a part that is clamped as planned",
        format!(
            "{}, tripped_before {}",
            trigger.tripped, trigger.tripped_before
        ),
    );
    let positions = match chain.positions(&trigger.axis_names, &trigger.axis_positions) {
        Ok(positions) => positions,
        Err(error) => return judge.wrong("probe_triggers.axis_positions", "each axis once", error),
    };
    let Some((from, to)) = probing_move(&run.order, trigger.point_index) else {
        return;
    };
    judge.demand(
        (trigger.feed - to.feed).abs() <= 1e-3 * to.feed,
        "probe_triggers.feed",
        format!("{} m/s, as in the move", to.feed),
        trigger.feed,
    );
    let (share, beside) = along(&from.axis_positions, &to.axis_positions, &positions);
    judge.demand(
        beside <= BESIDE && (-BEYOND..=1.0 + BEYOND).contains(&share),
        "probe_triggers.axis_positions",
        format!(
            "a position on the probing move from {:?} to {:?} (m or rad)",
            from.axis_positions, to.axis_positions
        ),
        format!("{positions:?}"),
    );
    latch(gate, judge, run, chain, (trigger, &positions));
}

/// The probing move to a point, and the one before it.
fn probing_move(order: &MeasurementOrder, point: u32) -> Option<(&ProbingMove, &ProbingMove)> {
    let pairs = order.moves.windows(2);
    let mut pairs = pairs.map(|pair| (&pair[0], &pair[1]));
    pairs.find(|(_, to)| to.kind == ProbingMove::TOUCH && to.point_index == point)
}

/// Share of the way from one position to another at which a third one lies, and how far it lies beside it.
fn along(from: &[f64], to: &[f64], at: &[f64]) -> (f64, f64) {
    let travel: Vec<f64> = to.iter().zip(from).map(|(to, from)| to - from).collect();
    let covered: Vec<f64> = at.iter().zip(from).map(|(at, from)| at - from).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let share = dot(&covered, &travel) / dot(&travel, &travel).max(f64::MIN_POSITIVE);
    let beside = covered
        .iter()
        .zip(&travel)
        .map(|(covered, travel)| (covered - share * travel).abs());
    (share, beside.fold(0.0, f64::max))
}

/// What was latched lies between the samples before and after it.
fn latch(
    gate: &Gate,
    judge: &mut Judge,
    run: &Measurement,
    chain: &Chain,
    (trigger, positions): (&ProbeTrigger, &[f64]),
) {
    let stamp = Stamp::from(&trigger.header.stamp);
    let (mut before, mut after) = (None, None);
    for sample in gate.samples(run.mark) {
        let at = Stamp::from(&sample.header.stamp);
        if at <= stamp {
            before = Some((at, sample));
        } else if after.is_none() {
            after = Some((at, sample));
        }
    }
    let (Some((early, before)), Some((late, after))) = (before, after) else {
        return judge.wrong(
            "probe_triggers.header.stamp",
            "an instant between two samples of this measurement",
            format!(
                "{:.4} s after the command",
                stamp.since_s(Stamp::from(&run.command.header.stamp))
            ),
        );
    };
    let read = |sample: &probecell_msgs::ControllerStatus| {
        chain.positions(&sample.axis_names, &sample.axis_positions)
    };
    let (Ok(before), Ok(after)) = (read(before), read(after)) else {
        return;
    };
    // Behind the latch the axis overtravels, and may have turned round within the interval.
    let slack = BESIDE + 2.0 * trigger.feed * late.since_s(early);
    for (index, name) in chain.axis_names().enumerate() {
        let (low, high) = (
            before[index].min(after[index]),
            before[index].max(after[index]),
        );
        judge.demand(
            (low - slack..=high + slack).contains(&positions[index]),
            "probe_triggers.axis_positions",
            format!(
                "what was latched: by the samples around its stamp {name} was between {low:.6} and {high:.6} m or rad"
            ),
            format!("{:.6}", positions[index]),
        );
    }
}
