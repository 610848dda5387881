//! The generated programs of SINUMERIK against the plan and the decision table.

use controller_oracle::{
    control::{End, Event},
    sinumerik::Interpreter,
};
use programs::{
    results::Frame,
    sinumerik::{
        decision::{STOPPED, main_program},
        program::{DEFLECTED, NOT_WRITTEN, PROGRAM, UNPLANNED_TOUCH, measuring_program},
        results::sinumerik_log,
    },
};

use crate::parts::{
    self, Air, Bore, NOMINAL, ORDER, axes, bore, decides_as_the_cell, feature,
    gives_the_published_rows, prints,
};

fn measure(part: &mut Bore, prepare: impl Fn(&mut Interpreter)) -> (End, Vec<Event>) {
    let (plan, order) = bore();
    let text = measuring_program(&plan, &order, &axes(), 0.03).expect("a good plan");
    let mut controller = Interpreter::new(&['X', 'Y', 'Z']);
    controller.position().insert('Z', 50.0);
    prepare(&mut controller);
    controller.load(&text).expect("readable");
    controller.run(PROGRAM, part).expect("runs")
}

fn alarm(number: u32, text: &str) -> End {
    End::Alarm {
        number,
        text: text.to_owned(),
    }
}

#[test]
fn a_measuring_program_touches_each_point_of_the_plan_in_order() {
    let (plan, order) = bore();
    let (end, events) = measure(&mut Bore::of(22.05), |_| {});
    assert_eq!(end, End::Finished);
    parts::stays_clear(&events, 22.05);
    // Every move of the order is made, in its order, and nothing else.
    let targets = events.iter().filter_map(|event| match event {
        Event::Move(target) | Event::Skip { target, .. } => Some(target),
        _ => None,
    });
    assert_eq!(targets.clone().count(), order.moves.len());
    for (target, planned) in targets.zip(&order.moves) {
        for (axis, position) in ['X', 'Y', 'Z'].iter().zip(&planned.axis_positions) {
            assert!((target[axis] - position * 1e3).abs() < 1e-4, "{planned:?}");
        }
    }
    let log = sinumerik_log(&prints(&events)).expect("its own lines");
    let points: Vec<_> = log.touches.iter().map(|one| one.point_index).collect();
    assert_eq!(points, ORDER);
    for (number, touch) in (1..).zip(log.touches) {
        assert!(touch.touched && touch.frame == Frame::Machine && touch.number == number);
        let position: Vec<_> = touch.position.iter().map(|(_, value)| *value).collect();
        parts::at_contact(&plan, touch.point_index, &position, 22.05);
    }
}

#[test]
fn what_goes_wrong_is_a_miss_or_an_alarm_and_never_a_measurement() {
    let mut dead = Bore::of(22.0);
    dead.works = false;
    let (end, events) = measure(&mut dead, |_| {});
    assert_eq!(end, End::Finished);
    let log = sinumerik_log(&prints(&events)).expect("its own lines");
    assert!(log.touches.len() == 6 && log.touches.iter().all(|touch| !touch.touched));
    // Where the move ended, not the touch before.
    let ended = log.touches[1].position[0].1;
    assert!((ended - 24.0).abs() < 1e-9, "{ended}");

    let (end, events) = measure(&mut Bore::of(15.0), |_| {});
    assert_eq!(end, alarm(UNPLANNED_TOUCH, "UNPLANNED TOUCH"));
    assert!(prints(&events).is_empty());
    let (end, events) = measure(&mut Bore::of(22.0), |controller| {
        controller.variables.insert("$A_PROBE[1]".to_owned(), 1.0);
    });
    assert_eq!(end, alarm(DEFLECTED, "PROBE DEFLECTED BEFORE THE TOUCH"));
    assert!(prints(&events).is_empty());
    let (end, _) = measure(&mut Bore::of(22.0), |controller| {
        controller.write_error = 10.0;
    });
    assert_eq!(end, alarm(NOT_WRITTEN, "LOG NOT WRITTEN"));
}

/// Runs the deciding program alone: the row, and the wear afterwards in mm, as the table counts it.
fn decided(size: Option<f64>, wear: f64, count: u32, bore: bool) -> (f64, f64) {
    let mut controller = Interpreter::new(&['X', 'Z']);
    controller
        .load(&main_program(&feature(bore)).expect("sound limits"))
        .expect("readable");
    for (name, value) in [
        ("R10", NOMINAL * 1e3),
        ("R11", 0.01),
        ("R12", -0.11),
        ("R13", 5.0),
        ("R14", f64::from(count)),
        ("R15", if bore { -1.0 } else { 1.0 }),
        ("R17", size.unwrap_or(19.8)),
        ("R18", f64::from(u8::from(size.is_some()))),
        ("R20", 2.0),
        ("$TC_DP12[2,1]", 0.5 * wear),
    ] {
        controller.variables.insert(name.to_owned(), value);
    }
    controller.run("OMM_DECIDE", &mut Air).expect("runs");
    let counted = controller.variables["R14"] - f64::from(count);
    let row = controller.variables["R16"];
    assert_eq!(counted, f64::from(u8::from(row == 5.0)));
    (row, 2.0 * controller.variables["$TC_DP12[2,1]"])
}

#[test]
fn the_program_gives_the_published_rows() {
    gives_the_published_rows(decided);
}

#[test]
fn the_program_and_the_cell_decide_alike() {
    decides_as_the_cell(decided);
}

/// A part that each cut makes as large as the tool's wear says, and 25 µm more.
#[test]
fn the_main_program_corrects_recuts_and_finishes() {
    let cycle = "%_N_OMM_ROUGH_SPF\nR50=R10+0.025+2*$TC_DP12[2,1] R51=R51+1\nM17\n\
                 %_N_OMM_FINISH_SPF\nR50=R10+0.025+2*$TC_DP12[2,1] R52=R52+1\nM17\n\
                 %_N_OMM_SIZE_SPF\nR17=R50\nIF R53<>1\nR18=1\nENDIF\nM17\n";
    let run = |preset: &[(&str, f64)]| {
        let mut controller = Interpreter::new(&['X', 'Z']);
        controller
            .load(&main_program(&feature(false)).expect("sound limits"))
            .expect("readable");
        controller.load(cycle).expect("readable");
        for (name, value) in preset {
            controller.variables.insert((*name).to_owned(), *value);
        }
        let end = controller.run("OMM_PART", &mut Air).expect("runs").0;
        (end, controller.variables)
    };
    let (end, variables) = run(&[]);
    assert_eq!(end, End::Finished);
    assert!((variables["$TC_DP12[2,1]"] + 0.0125).abs() < 1e-9);
    assert!((variables["R50"] - 19.8).abs() < 1e-9);
    assert_eq!(
        (variables["R51"], variables["R52"]),
        (2.0, 1.0),
        "rough twice, finish once"
    );
    assert!((variables["_OVR[4]"] - 19.8).abs() < 1e-9 && variables["_OVR[16]"].abs() < 1e-9);
    assert_eq!(
        run(&[("R53", 1.0)]).0,
        alarm(STOPPED, "MEASUREMENT INVALID")
    );
    assert_eq!(
        run(&[("$TC_DP12[2,1]", -0.020)]).0,
        alarm(STOPPED + 2, "OVERCUT")
    );
}
