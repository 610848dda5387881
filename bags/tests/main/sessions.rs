//! Bad sessions are refused by name.

use std::path::Path;

use bags::{
    Bag, Channel, Measurement, Missing, Overflow, Qos, Recorder, RecorderOptions, Session,
    SessionError,
};
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachineState, Message, ProbeEvent,
    ProbeTrigger, std_msgs, to_cdr,
};

fn plan(id: &str) -> InspectionPlan {
    InspectionPlan {
        plan_id: id.to_owned(),
        features: vec![InspectionFeature::default()],
        points: vec![InspectionPoint::default(); 3],
        ..InspectionPlan::default()
    }
}

fn event(sequence: u64) -> ProbeEvent {
    ProbeEvent {
        sequence,
        plan_id: "p".to_owned(),
        point_index: 1,
        axis_names: vec!["X".to_owned()],
        axis_positions: vec![0.1],
        ..ProbeEvent::default()
    }
}

struct Bench<'a> {
    recorder: &'a Recorder,
    time: u64,
}

impl Bench<'_> {
    fn say<T: Message>(&mut self, topic: &str, message: &T) {
        let channel = self
            .recorder
            .channel(&Channel::of(topic, T::TYPE, Qos::default()))
            .unwrap();
        self.time += 1;
        self.recorder
            .push(channel, self.time, self.time, self.time, to_cdr(message))
            .unwrap();
    }

    fn model(&mut self) {
        self.say(
            "/cell/robot_description",
            &std_msgs::String {
                data: "<robot/>".to_owned(),
            },
        );
    }
}

fn session(folder: &Path, tell: impl FnOnce(&mut Bench<'_>)) -> Result<Session, SessionError> {
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        ..RecorderOptions::new(folder.join("run"))
    })
    .unwrap();
    tell(&mut Bench {
        recorder: &recorder,
        time: 0,
    });
    recorder.stop().unwrap();
    Session::read(&Bag::open(folder.join("run")).unwrap())
}

/// What the session of a plan and these events says.
fn of_events(events: &[ProbeEvent]) -> Result<Session, SessionError> {
    let folder = tempfile::tempdir().unwrap();
    session(folder.path(), |bench| {
        bench.model();
        bench.say("/cell/inspection_plan", &plan("p"));
        for event in events {
            bench.say("/cell/probe_events", event);
        }
    })
}

fn of(tell: impl FnOnce(&mut Bench<'_>)) -> Result<Session, SessionError> {
    let folder = tempfile::tempdir().unwrap();
    session(folder.path(), tell)
}

#[test]
fn a_good_session_is_read_whole() {
    let session = of_events(&[event(0), event(1), event(2)]).unwrap();
    assert_eq!(session.namespace, "/cell");
    assert_eq!(session.events.len(), 3);
    assert!(session.plan.is_some() && session.damage.is_empty());
}

/// Of 120,000 touches of one measurement and 6 of the next, the first is read in runs of 32, the second whole.
#[test]
fn of_very_many_touches_some_are_read_evenly_spread() {
    let folder = tempfile::tempdir().unwrap();
    let only = session(folder.path(), |bench| {
        bench.model();
        bench.say("/cell/inspection_plan", &plan("p"));
        bench.say("/cell/inspection_plan", &plan("q"));
        for number in 0..120_006 {
            let plan = if number < 120_000 { "p" } else { "q" };
            bench.say("/cell/probe_events", &touch(plan, number, number as i32));
        }
    });
    assert!(matches!(only, Err(SessionError::SeveralPlans { .. })));
    let bag = Bag::open(folder.path().join("run")).unwrap();
    let read =
        |plan: &str| Session::read_measurement(&bag, &Measurement::Named(plan.to_owned())).unwrap();
    let (many, few) = (read("p"), read("q"));
    assert_eq!((few.events.len(), few.left_out), (6, 0));
    assert!(many.events.len().abs_diff(25_000) < 100);
    assert_eq!(many.events.len() + many.left_out, 120_000);
    let mut numbers = many.events.iter().map(|event| event.message.sequence);
    assert!(numbers.clone().is_sorted());
    let mut tenths = [0; 10];
    numbers
        .by_ref()
        .for_each(|number| tenths[number as usize / 12_000] += 1);
    assert!(
        tenths
            .iter()
            .all(|count: &usize| count.abs_diff(2_500) < 200),
        "{tenths:?}"
    );
    let mut all = Vec::new();
    Session::each_measurement(&bag, |_, session, _| all.push(session.unwrap())).unwrap();
    assert_eq!(all[0].events, many.events);
    assert_eq!(all[1].events, few.events);
}

#[test]
fn missing_numbers_are_told_and_doubled_or_reordered_ones_refused() {
    let of_numbers = |numbers: &[u64]| {
        let folder = tempfile::tempdir().unwrap();
        let tell = |bench: &mut Bench<'_>| {
            bench.model();
            bench.say("/cell/inspection_plan", &plan("p"));
            for number in numbers {
                bench.say("/cell/probe_events", &event(*number));
            }
        };
        // Written whole; read as one measurement, which may lack touches, and as the only one, which may not.
        let only = session(folder.path(), tell);
        let bag = Bag::open(folder.path().join("run")).unwrap();
        let last = Session::read_measurement(&bag, &Measurement::Last)?;
        assert_eq!(only.is_ok(), last.missing.is_empty());
        Ok::<_, SessionError>(last)
    };
    let gap = |expected, before, count| Missing {
        expected,
        before,
        count,
    };
    assert_eq!(of_numbers(&[0, 1, 4]).unwrap().missing, [gap(2, 4, 2)]);
    assert_eq!(
        of_numbers(&[1, 2, 4]).unwrap().missing,
        [gap(0, 1, 1), gap(3, 4, 1)]
    );
    assert_eq!(of_numbers(&[0, 1]).unwrap().missing, []);
    let refused = |numbers: &[u64]| of_numbers(numbers).unwrap_err();
    assert!(matches!(
        refused(&[0, 1, 1, 2]),
        SessionError::DuplicateEvent(1)
    ));
    assert!(matches!(
        refused(&[0, 2, 1]),
        SessionError::ReorderedEvent {
            sequence: 1,
            after: 2
        }
    ));
    for lost in [&[0, 1, 9][..], &[u64::MAX]] {
        assert!(matches!(refused(lost), SessionError::MissingEvents(_)));
    }
}

/// A touch of a plan in a session of the driver, latched at `sec`.
fn touch(plan: &str, sequence: u64, sec: i32) -> ProbeEvent {
    let mut event = event(sequence);
    plan.clone_into(&mut event.plan_id);
    event.header.stamp.sec = sec;
    event
}

fn trigger(event: &ProbeEvent, session: &str) -> ProbeTrigger {
    ProbeTrigger {
        header: event.header.clone(),
        session: session.to_owned(),
        plan_id: event.plan_id.clone(),
        point_index: event.point_index,
        sequence: event.sequence,
        ..ProbeTrigger::default()
    }
}

/// Reads a measurement of a bag with the plans p and q, and these touches with the sessions of their triggers.
fn of_sessions(
    touches: &[(&str, ProbeEvent)],
    measurement: &Measurement,
) -> Result<Session, SessionError> {
    let folder = tempfile::tempdir().unwrap();
    let written = session(folder.path(), |bench| {
        bench.model();
        bench.say("/cell/inspection_plan", &plan("p"));
        bench.say("/cell/inspection_plan", &plan("q"));
        for (session, event) in touches {
            if !session.is_empty() {
                bench.say("/cell/probe_triggers", &trigger(event, session));
            }
            bench.say("/cell/probe_events", event);
        }
    });
    assert!(written.is_err(), "two plans are not the only one");
    Session::read_measurement(&Bag::open(folder.path().join("run")).unwrap(), measurement)
}

#[test]
fn numbers_begin_again_with_each_session_of_the_driver() {
    let numbers = |session: &Session| -> Vec<u64> {
        let events = session.events.iter();
        events.map(|event| event.message.sequence).collect()
    };
    // With the sessions of the triggers, and by the numbers and instants of the touches alone.
    for sessions in [["a", "b"], ["", ""]] {
        let [a, b] = sessions;
        let touches = [
            (a, touch("p", 0, 1)),
            (a, touch("p", 1, 2)),
            (b, touch("q", 0, 3)),
            (b, touch("q", 1, 4)),
            (b, touch("q", 2, 5)),
        ];
        let last = of_sessions(&touches, &Measurement::Last).unwrap();
        assert_eq!((numbers(&last), last.void), (vec![0, 1, 2], 0));
        assert_eq!(last.missing, []);
        let first = of_sessions(&touches, &Measurement::Named("p".to_owned())).unwrap();
        assert_eq!((numbers(&first), first.void), (vec![0, 1], 0));

        // The same plan once more: what was measured before the restart is void.
        let again = [
            (a, touch("p", 0, 1)),
            (a, touch("p", 1, 2)),
            (b, touch("p", 0, 3)),
        ];
        let last = of_sessions(&again, &Measurement::Last).unwrap();
        assert_eq!((numbers(&last), last.void), (vec![0], 2));
        assert_eq!(last.events[0].message.header.stamp.sec, 3);
    }
    // The first touch of the new session is lost.
    let lost = [("a", touch("p", 0, 1)), ("b", touch("q", 1, 3))];
    let last = of_sessions(&lost, &Measurement::Last).unwrap();
    let gap = Missing {
        expected: 0,
        before: 1,
        count: 1,
    };
    assert_eq!(last.missing, [gap]);
}

#[test]
fn a_touch_that_is_recorded_twice_is_named_in_every_session_of_the_driver() {
    for session in ["b", ""] {
        let first = if session.is_empty() { "" } else { "a" };
        let doubled = [
            (first, touch("p", 0, 1)),
            (session, touch("q", 0, 3)),
            (session, touch("q", 1, 4)),
            (session, touch("q", 1, 4)),
        ];
        assert!(matches!(
            of_sessions(&doubled, &Measurement::Last),
            Err(SessionError::DuplicateEvent(1))
        ));
    }
    // Delivered twice, the first of all.
    let first = [("", touch("p", 0, 1)), ("", touch("p", 0, 1))];
    assert!(matches!(
        of_sessions(&first, &Measurement::Last),
        Err(SessionError::DuplicateEvent(0))
    ));
}

#[test]
fn events_that_do_not_fit_the_plan_are_refused() {
    let other = ProbeEvent {
        plan_id: "q".to_owned(),
        ..event(0)
    };
    assert!(matches!(
        of_events(&[other]),
        Err(SessionError::EventOfOtherPlan { .. })
    ));
    let beyond = ProbeEvent {
        point_index: 3,
        ..event(0)
    };
    assert!(matches!(
        of_events(&[beyond]),
        Err(SessionError::NoSuchPoint { points: 3, .. })
    ));
    for value in [f64::NAN, f64::INFINITY] {
        let wild = ProbeEvent {
            axis_positions: vec![value],
            ..event(0)
        };
        assert!(matches!(
            of_events(&[wild]),
            Err(SessionError::NotFinite { field, .. }) if field == "axis_positions"
        ));
    }
    let short = ProbeEvent {
        axis_positions: vec![],
        ..event(0)
    };
    assert!(matches!(
        of_events(&[short]),
        Err(SessionError::AxisCount {
            names: 1,
            values: 0,
            ..
        })
    ));
}

#[test]
fn a_plan_is_needed_once() {
    let none = of(|bench| {
        bench.model();
        bench.say("/cell/probe_events", &event(0));
    });
    assert!(matches!(none, Err(SessionError::NoPlan(topic)) if topic == "/cell/inspection_plan"));
    let two = of(|bench| {
        bench.model();
        bench.say("/cell/inspection_plan", &plan("p"));
        bench.say("/cell/inspection_plan", &plan("q"));
    });
    assert!(matches!(two, Err(SessionError::SeveralPlans { plans, .. }) if plans == ["p", "q"]));
    let same = of(|bench| {
        bench.model();
        bench.say("/cell/inspection_plan", &plan("p"));
        bench.say("/cell/inspection_plan", &plan("p"));
    });
    assert_eq!(same.unwrap().plan, Some(plan("p")));
}

#[test]
fn a_drive_bag_has_no_plan() {
    let state = JointState {
        name: vec!["X".to_owned()],
        position: vec![0.0],
        ..JointState::default()
    };
    let drive = of(|bench| {
        bench.model();
        bench.say("/cell/joint_states", &state);
    });
    assert!(drive.unwrap().plan.is_none());
    let wild = JointState {
        position: vec![f64::NAN],
        ..state
    };
    let bad = of(|bench| {
        bench.model();
        bench.say("/cell/joint_states", &wild);
    });
    assert!(matches!(
        bad,
        Err(SessionError::NotFinite { field, .. }) if field == "position"
    ));
}

#[test]
fn another_type_no_model_no_cell_and_two_cells_are_refused() {
    let text = std_msgs::String {
        data: "x".to_owned(),
    };
    let other = of(|bench| {
        bench.model();
        bench.say("/cell/probe_events", &text);
    });
    let told = other.unwrap_err().to_string();
    assert!(
        told.starts_with("topic /cell/probe_events carries std_msgs/msg/String"),
        "{told}"
    );
    let no_model = of(|bench| bench.say("/cell/joint_states", &JointState::default()));
    assert!(matches!(no_model, Err(SessionError::NoRobotDescription(_))));
    assert!(matches!(
        of(|bench| bench.say("/chatter", &text)),
        Err(SessionError::NoCell)
    ));
    let two = of(|bench| {
        bench.model();
        bench.say("/other/robot_description", &text);
    });
    assert!(matches!(two, Err(SessionError::SeveralCells(cells)) if cells == "/cell, /other"));
}

/// A shift of ten hours with three touches in each: of a measurement only what stands beside its touches is held, and what
/// warms the machine up; of all measurements together nothing that grows with the time between them.
#[test]
fn what_a_session_holds_does_not_grow_with_its_recording() {
    const HOUR: u64 = 3600;
    let folder = tempfile::tempdir().unwrap();
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        ..RecorderOptions::new(folder.path().join("run"))
    });
    let recorder = recorder.unwrap();
    let mut bench = Bench {
        recorder: &recorder,
        time: 0,
    };
    bench.model();
    for hour in 0..10 {
        bench.say("/cell/inspection_plan", &plan(&format!("part {hour}")));
        for second in 0..HOUR {
            bench.time = (hour * HOUR + second) * 1_000_000_000;
            bench.say("/cell/joint_states", &JointState::default());
            let warmer = f64::from(u8::from(second >= HOUR / 4));
            let state = MachineState {
                temperature_names: vec!["part".to_owned()],
                temperatures: vec![20.0 + 2.0 * hour as f64 + warmer],
                ..MachineState::default()
            };
            bench.say("/cell/machine_state", &state);
            if (HOUR / 2..HOUR / 2 + 3).contains(&second) {
                let number = 3 * hour + second - HOUR / 2;
                let touch = touch(
                    &format!("part {hour}"),
                    number,
                    (bench.time / 1_000_000_000) as i32,
                );
                bench.say("/cell/probe_events", &touch);
            }
        }
    }
    recorder.stop().unwrap();
    let bag = Bag::open(folder.path().join("run")).unwrap();
    let last = Session::read_measurement(&bag, &Measurement::Last).unwrap();
    // A minute before and after the touches, and the first of all.
    assert_eq!(
        (last.events.len(), last.joint_states.len()),
        (3, 1 + 59 + 3 + 60)
    );
    assert_eq!(last.joint_states[0].log_time, 1);
    // Those of the same minutes, and both sides of each of the twenty changes but for those at the ends.
    let outside = last.machine_states.len() - 122;
    assert_eq!(outside, 2 + 2 * 19);
    let mut seen = Vec::new();
    Session::each_measurement(&bag, |plan_id, session, states| {
        let session = session.unwrap();
        assert_eq!((session.joint_states.len(), states.len()), (1, 2 + 2 * 19));
        seen.push((plan_id.to_owned(), session.events.len()));
    })
    .unwrap();
    let expected: Vec<_> = (0..10).map(|hour| (format!("part {hour}"), 3)).collect();
    assert_eq!(seen, expected);
}
