//! What goes wrong at the machine ends in a named fault and a stopped part, never in a size.

use std::collections::BTreeSet;

use cell_tests::{
    cell, messages,
    session::{Session, with_fault},
};
use graph::{Published, topics};
use probecell_msgs::{
    ControllerCommand, ControllerStatus, Fault, FeatureResult, InspectionPlan, MachineState,
    PartReport, ProbeEvent, Verdict,
};

/// What is injected, and the fault that must name it.
const FAULTS: [(&str, &str, &str); 5] = [
    ("dead_probe", "probe_events", "probe_dead"),
    ("stuck_probe", "probe_events", "probe_stuck"),
    ("unplanned_touch", "machine_state", "unplanned_touch"),
    ("estop", "machine_state", "estop"),
    ("silence", "machine_state", "controller_lost"),
];
/// Touches of one measurement of the punch.
const TOUCHES: u32 = 32;

/// A part during which that goes wrong, and what came ten seconds after its end.
fn gone_wrong(kind: &str, after_touches: u32) -> (PartReport, Vec<Published>) {
    let mut session = Session::new(&cell("turn_mill.toml", |text| {
        with_fault(text, kind, after_touches)
    }));
    let report = session.make("punch");
    session.run_s(10.0);
    (report, session.finish())
}

/// Every result with a size rests on a contact at each point of its features.
fn assert_sizes_rest_on_touches(log: &[Published], context: &str) {
    let plans: Vec<InspectionPlan> = messages(log, topics::INSPECTION_PLAN.name);
    let events: Vec<ProbeEvent> = messages(log, topics::PROBE_EVENTS.name);
    for result in messages::<FeatureResult>(log, topics::FEATURE_RESULTS.name) {
        if result.decision == FeatureResult::INVALID {
            assert_eq!(
                (result.size, result.size_deviation),
                (0.0, 0.0),
                "{context}: {}",
                result.feature_id
            );
            assert!(!result.text.is_empty());
            continue;
        }
        let plan = plans
            .iter()
            .find(|plan| plan.plan_id == result.plan_id)
            .expect("the plan of a result");
        let touched: BTreeSet<u32> = events
            .iter()
            .filter(|event| {
                event.plan_id == result.plan_id && event.outcome == ProbeEvent::OUTCOME_TOUCHED
            })
            .filter(|event| result.sequences.contains(&event.sequence))
            .map(|event| event.point_index)
            .collect();
        // A width names itself; its touches are those of two planes.
        for (index, point) in plan.points.iter().enumerate() {
            if plan.features[point.feature as usize].id == result.feature_id {
                assert!(
                    touched.contains(&(index as u32)),
                    "{context}: {} without point {index}",
                    result.feature_id
                );
            }
        }
        assert_eq!(
            touched.len(),
            result.touches as usize,
            "{context}: {}",
            result.feature_id
        );
    }
}

#[test]
fn each_fault_is_named_stops_the_part_and_leaves_no_size_of_what_was_not_touched() {
    // In the first measurement at once, within it, and in a later one.
    for after in [0, 7, TOUCHES + 13] {
        for (kind, node, code) in FAULTS {
            let context = format!("{kind} after {after} touches");
            let (report, log) = gone_wrong(kind, after);
            assert_eq!(
                report.verdict,
                PartReport::STOPPED,
                "{context}: {}",
                report.text
            );
            assert!(!report.text.is_empty(), "{context}");
            let faults: Vec<Fault> = messages(&log, &format!("{node}/faults"));
            assert!(
                faults
                    .iter()
                    .any(|fault| fault.code == code && fault.severity == Fault::ERROR),
                "{context}"
            );
            let reports: Vec<PartReport> = messages(&log, topics::PART_REPORTS.name);
            assert_eq!(reports.len(), 1, "{context}");
            assert_sizes_rest_on_touches(&log, &context);
        }
    }
}

#[test]
fn no_size_is_qualified_by_a_measurement_that_something_went_wrong_in() {
    for (kind, _, _) in FAULTS {
        let (_, log) = gone_wrong(kind, 7);
        let verdicts: Vec<Verdict> = messages(&log, topics::VERDICTS.name);
        assert!(
            verdicts.is_empty(),
            "{kind} in the first measurement: {verdicts:?}"
        );
        let (_, log) = gone_wrong(kind, TOUCHES + 13);
        let plans: Vec<InspectionPlan> = messages(&log, topics::INSPECTION_PLAN.name);
        let disturbed = &plans[1].plan_id;
        let verdicts: Vec<Verdict> = messages(&log, topics::VERDICTS.name);
        assert_eq!(verdicts.len(), 5, "{kind}: the first measurement is judged");
        assert!(
            verdicts.iter().all(|verdict| verdict.plan_id != *disturbed),
            "{kind}"
        );
    }
}

#[test]
fn a_stopped_machine_stands_still_and_is_told_nothing_more() {
    for (kind, _, _) in FAULTS {
        let (_, log) = gone_wrong(kind, 7);
        let end = log
            .iter()
            .find(|one| one.topic == topics::PART_REPORTS.name)
            .expect("a report")
            .at;
        let after = |topic: graph::Topic| -> Vec<Published> {
            log.iter()
                .filter(|one| one.topic == topic.name && one.at > end.after_s(0.05))
                .cloned()
                .collect()
        };
        let commands: Vec<ControllerCommand> =
            messages(&after(topics::CONTROLLER_COMMANDS), "controller_commands");
        assert!(commands.is_empty(), "{kind}: {commands:?}");
        let samples: Vec<ControllerStatus> =
            messages(&after(topics::CONTROLLER_STATUS), "controller_status");
        assert_eq!(samples.is_empty(), kind == "silence", "{kind}");
        for sample in &samples {
            assert_ne!(sample.execution, MachineState::EXECUTION_RUNNING, "{kind}");
            assert_eq!(sample.axis_positions, samples[0].axis_positions, "{kind}");
        }
    }
}

#[test]
fn one_missed_touch_is_a_warning_and_makes_its_feature_invalid_and_the_part_stopped() {
    // The bar ends before the last touches of D1: the probe is sound, there is nothing to touch. One miss at a time.
    let text = |text: &str| {
        text.replace(
            "touch_heights_mm = [58.0, 70.0]",
            "touch_heights_mm = [58.0, 70.0]\n",
        )
    };
    let cell = cell("turn_mill.toml", |original| {
        with_fault(&text(original), "dead_probe", TOUCHES - 1)
    });
    let mut session = Session::new(&cell);
    let report = session.make("punch");
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(session.fault_codes().contains(&"no_contact".to_owned()));
    assert!(
        report.text.contains("could not be measured"),
        "{}",
        report.text
    );
    let verdicts: Vec<Verdict> = session.all(topics::VERDICTS);
    let invalid: Vec<&str> = verdicts
        .iter()
        .filter(|verdict| verdict.verdict == Verdict::MEASUREMENT_INVALID)
        .map(|verdict| verdict.feature_id.as_str())
        .collect();
    assert_eq!(invalid.len(), 1, "{verdicts:?}");
    assert!(report.text.starts_with(invalid[0]), "{}", report.text);
    assert_sizes_rest_on_touches(&session.finish(), "one missed touch");
}

#[test]
fn an_alarm_that_goes_does_not_bring_the_part_back() {
    let mut session = Session::new(&cell("turn_mill.toml", |text| with_fault(text, "estop", 7)));
    assert_eq!(session.make("punch").verdict, PartReport::STOPPED);
    // The machine stays in emergency stop: another part is refused by it, and says so.
    let report = session.make("second");
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(report.text.contains("emergency stop"), "{}", report.text);
    let estops = session
        .fault_codes()
        .iter()
        .filter(|code| *code == "estop")
        .count();
    assert_eq!(estops, 1, "a persistent fault is reported once");
}

#[test]
fn a_driver_that_is_started_again_ends_the_part() {
    let mut session = Session::new(&cell("turn_mill.toml", str::to_owned));
    session.ask_for("punch");
    session.run_s(1.0);
    let mut sample: ControllerStatus = session.last(topics::CONTROLLER_STATUS);
    assert_eq!(sample.execution, MachineState::EXECUTION_RUNNING);
    sample.session = "another run".to_owned();
    sample.execution = MachineState::EXECUTION_IDLE;
    session.send(topics::CONTROLLER_STATUS, &sample);
    let report = session.wait_for_report();
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(report.text.contains("restarted"), "{}", report.text);
    assert!(
        session
            .fault_codes()
            .contains(&"controller_restarted".to_owned())
    );
}
