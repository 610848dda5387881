//! Several parts of one recording: what the last alone leaves open, all of them decide; what begins is told; what cannot be
//! used is named.

use diagnosis::recording::{Corrected, Recording};
use diagnosis::{Options, Report, Residuals, Session, diagnose, diagnose_with_residuals};

use probecell_msgs::{MachineState, MachiningOperation};

use crate::streams::{Begun, Numbers, Scatter, part};

const USUAL: Scatter = Scatter {
    touch: 1e-6,
    clamping: 3e-6,
};

const SCALE: Begun<'_> = &|normal, place| -40e-6 * place[0] * normal[0];
const ALIKE: [&str; 3] = ["axis.X.scale", "axis.X.backlash", "axis.X.lag"];

/// So many parts of a machine in which `acts`, from a part on.
fn parts(count: u64, from: u64, acts: Begun<'_>) -> Vec<Session> {
    let mut random = Numbers(7);
    let begun = |number| if number < from { &|_, _| 0.0 } else { acts };
    (0..count)
        .map(|number| part(number, &mut random, USUAL, begun(number)))
        .collect()
}

fn together(sessions: &[Session]) -> Report {
    let mut recording = Recording::default();
    for session in sessions {
        recording
            .add(session, &Corrected::default(), &Options::default())
            .unwrap();
    }
    recording.report("run", &Options::default()).unwrap().0
}

fn named(report: &Report) -> Vec<&[String]> {
    let effects = report.effects.iter();
    effects.map(|effect| effect.group.as_slice()).collect()
}

/// A scale error of X of 40 µm/m: 2 µm at each side of the block, beside touches of 1 µm. The sides are approached from outside, so
/// that lost motion and a lag of X act alike, and nothing else does.
#[test]
fn all_parts_decide_what_the_last_leaves_open() {
    let sessions = parts(60, 0, SCALE);
    let last = diagnose(sessions.last().unwrap(), &Options::default()).unwrap();
    let open = named(&last).iter().map(|group| group.len()).max();
    assert!(open.unwrap_or(usize::MAX) > ALIKE.len(), "{last}");
    let all = together(&sessions);
    assert_eq!(named(&all), [ALIKE], "{all}");
    let measured = all.measurements.as_ref().unwrap();
    assert_eq!(
        (measured.measurements, measured.parts, all.samples),
        (60, 60, 60 * 25)
    );
    assert!(
        all.to_string()
            .contains("1,500 touches of 60 measurements, 60 parts"),
        "{all}"
    );
    let found = all.effects[0].parameters[0].ci95;
    assert!(
        found[0] < 40e-6 && 40e-6 < found[1] || found[0] < -40e-6 && -40e-6 < found[1],
        "{all}"
    );
}

/// The ball loses 3 µm from part 30 on: the change is told with its part, and what acts since is named.
#[test]
fn what_begins_at_a_part_is_told_and_what_was_before_left_out_of_the_rest() {
    let smaller: Begun<'_> = &|_, _| 3e-6;
    let all = together(&parts(60, 30, smaller));
    let measured = all.measurements.as_ref().unwrap();
    let [change] = measured.changes.as_slice() else {
        panic!("{all}");
    };
    let first: u64 = change
        .plan_id
        .split([' ', '/'])
        .nth(1)
        .unwrap()
        .parse()
        .unwrap();
    assert!(first.abs_diff(30) <= 1, "{all}");
    assert_eq!(measured.measurements + measured.before_change, 60);
    let cause = change.cause.as_ref().unwrap();
    assert!(
        cause.group.iter().any(|name| name == "probe.ball_radius"),
        "{all}"
    );
    assert!(
        named(&all)[0]
            .iter()
            .any(|name| name == "probe.ball_radius"),
        "{all}"
    );
}

/// Ten chips of 50 µm among 1,500 touches, and a part of which three points were touched.
#[test]
fn chips_and_interrupted_parts_are_left_out_by_name() {
    let mut sessions = parts(60, 0, SCALE);
    for (number, session) in sessions.iter_mut().enumerate().step_by(6) {
        let event = &mut session.events[number % 25];
        let away = [event.approach.x, event.approach.y, event.approach.z];
        for (position, along) in event.axis_positions.iter_mut().zip(away) {
            *position -= 50e-6 * along;
        }
    }
    sessions[40].events.truncate(3);
    let all = together(&sessions);
    assert_eq!(named(&all), [ALIKE], "{all}");
    let left = &all.measurements.as_ref().unwrap().left_out;
    assert_eq!(left[0].plans, ["part 40/measure"]);
    assert_eq!(
        left[0].reason,
        "the session has 3 touches; at least 6 are needed"
    );
    assert_eq!(all.samples, 59 * 25 - 10, "{all}");
}

/// Tool 2 cuts the sides across X, tool 3 those across Y; each leaves `left(tool, part)` more than it should, m.
fn cut_parts(count: u64, seed: u64, left: impl Fn(u32, u64) -> f64) -> Vec<Session> {
    let mut random = Numbers(seed);
    let scatter = Scatter {
        clamping: 0.0,
        ..USUAL
    };
    let cut = |number| {
        let material: Begun<'_> = &|normal, _| {
            let of = |axis: usize, tool| normal[axis].abs() * left(tool, number);
            of(0, 2) + of(1, 3)
        };
        let mut session = part(number, &mut random, scatter, material);
        let plan = session.plan.as_mut().unwrap();
        plan.plan_id = format!("shaft#{number}/finish/1");
        plan.machined_on_this_machine = true;
        plan.operations = [2, 3]
            .map(|tool_number| MachiningOperation {
                id: format!("turn {tool_number}"),
                tool_number,
                tool_radius: 4e-3,
                feed: 0.01,
                finish: true,
                ..MachiningOperation::default()
            })
            .to_vec();
        for point in &mut plan.points {
            point.operation = match (point.normal.x != 0.0, point.normal.y != 0.0) {
                (true, _) => 0,
                (_, true) => 1,
                _ => -1,
            };
        }
        for event in &mut session.events {
            event.plan_id.clone_from(&plan.plan_id);
        }
        session
    };
    (0..count).map(cut).collect()
}

/// As [`together`]; the wear of both tools is corrected before each fifth part.
fn corrected(sessions: &[Session]) -> Report {
    let mut recording = Recording::default();
    for (number, session) in sessions.iter().enumerate() {
        let corrected = Corrected {
            wear: [2, 3].map(|tool| (tool, number / 5)).into(),
            others: 0,
        };
        recording
            .add(session, &corrected, &Options::default())
            .unwrap();
    }
    recording.report("run", &Options::default()).unwrap().0
}

/// Tool 2 wears by 0.4 µm a part and is corrected by all of it before each fifth, tool 3 breaks at part 33.
#[test]
fn a_tool_that_wears_and_one_that_breaks_are_told_beside_corrections() {
    let mut covered = 0;
    for seed in 0..20 {
        let sessions = cut_parts(40, seed, |tool, number| match tool {
            2 => 0.4e-6 * (number % 5) as f64,
            _ => f64::from(u8::from(number >= 33)) * 20e-6,
        });
        let all = corrected(&sessions);
        let [wears, breaks] = all.measurements.as_ref().unwrap().tools.as_slice() else {
            panic!("{seed}: {all}");
        };
        let [low, high] = wears.per_pass.unwrap();
        assert!((wears.tool, &wears.steps[..]) == (2, &[]), "{seed}: {all}");
        assert!(
            (f64::midpoint(low, high) - 0.4e-6).abs() < 0.2e-6,
            "{seed}: {all}"
        );
        covered += u32::from(low < 0.4e-6 && 0.4e-6 < high);
        let [step] = breaks.steps.as_slice() else {
            panic!("{seed}: {all}");
        };
        assert_eq!((breaks.tool, breaks.per_pass), (3, None), "{seed}: {all}");
        assert_eq!(step.plan_id, "shaft#33/finish/1", "{seed}: {all}");
        let [low, high] = step.change;
        assert!(
            (f64::midpoint(low, high) - 20e-6).abs() < 2e-6,
            "{seed}: {all}"
        );
        covered += u32::from(low < 20e-6 && 20e-6 < high);
        assert!(!wears.is_like_others, "{seed}: {all}");
    }
    assert!(covered >= 34, "the intervals cover {covered} of 40");
}

/// A machine whose X drifts by 10 µm/h between the parts that it cuts: named, with its rate.
#[test]
fn a_drift_over_the_parts_is_named() {
    let rate = 10e-6 / 3600.0;
    let mut sessions = cut_parts(40, 5, |_, _| 0.0);
    for session in &mut sessions {
        let plan = session.plan.clone().unwrap();
        for event in &mut session.events {
            let seconds = f64::from(event.header.stamp.sec - 1000);
            let normal = &plan.points[event.point_index as usize].normal;
            event.axis_positions[0] += rate * seconds * normal.x.abs();
        }
    }
    let mut recording = Recording::default();
    for session in &mut sessions {
        // As read from a recording: the first state of it stands beside every measurement.
        let mut first = MachineState::default();
        first.header.stamp.sec = 1000;
        session.machine_states.push(first);
        recording
            .add(session, &Corrected::default(), &Options::default())
            .unwrap();
    }
    let all = recording.report("run", &Options::default()).unwrap().0;
    let drift = all
        .effects
        .iter()
        .find(|one| one.group.contains(&"thermal.drift".to_owned()));
    let [low, high] = drift.unwrap_or_else(|| panic!("{all}")).parameters[0].ci95;
    assert!(low < rate && rate < high, "{all}");
}

/// Without wear nothing is said of a tool; where both leave more alike, a drift of the machine is named beside their wear.
#[test]
fn steady_tools_are_not_named_and_a_common_trend_is_no_tools() {
    for seed in 0..40 {
        let all = corrected(&cut_parts(30, 100 + seed, |_, _| 0.0));
        assert_eq!(
            all.measurements.as_ref().unwrap().tools,
            [],
            "{seed}: {all}"
        );
    }
    let all = corrected(&cut_parts(40, 1, |_, number| 0.5e-6 * number as f64));
    let tools = &all.measurements.as_ref().unwrap().tools;
    assert_eq!(tools.len(), 2, "{all}");
    assert!(tools.iter().all(|tool| tool.is_like_others), "{all}");
    assert!(
        all.to_string()
            .contains("or a drift of machine, probe or parts"),
        "{all}"
    );
}

/// 1,200 times round the same part: the work does not grow beyond 10,000 touches, every point of the pattern keeps its share, and
/// the report says so.
#[test]
fn very_many_touches_of_one_session_are_thinned_evenly() {
    let mut random = Numbers(9);
    let mut session = part(0, &mut random, USUAL, SCALE);
    let still = Scatter {
        clamping: 0.0,
        ..USUAL
    };
    for round in 1..1200 {
        let again = part(0, &mut random, still, SCALE).events;
        session.events.extend(again.into_iter().map(|mut event| {
            event.sequence += 25 * round;
            event.header.stamp.sec += 25 * round as i32;
            event
        }));
    }
    let (report, residuals) = diagnose_with_residuals(&session, &Options::default()).unwrap();
    let Residuals::Touches(touches) = residuals else {
        panic!("touches were made");
    };
    let mut of_feature = [0_u32; 6];
    for touch in &touches[0].touches {
        of_feature[touch.feature] += 1;
    }
    // Five of 25 points on each of five sides.
    let sides = of_feature.iter().filter(|count| **count > 0);
    assert!(
        sides.clone().all(|count| count.abs_diff(2000) < 50),
        "{of_feature:?}"
    );
    assert_eq!(sides.count(), 5);
    assert!(report.samples.abs_diff(10_000) < 50, "{report}");
    let told = format!(
        "{} of 30000 touches, evenly spread, are diagnosed",
        report.samples
    );
    assert_eq!(report.warnings[0], told);
}
