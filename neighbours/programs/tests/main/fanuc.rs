//! The generated programs of FANUC against the plan and the decision table.

use controller_oracle::{
    control::{End, Event},
    fanuc::Interpreter,
};
use programs::fanuc::{
    decision::main_program,
    program::{UNPLANNED_TOUCH, measuring_program},
    results::printed_touches,
};

use crate::parts::{
    self, Air, Bore, NOMINAL, ORDER, axes, bore, decides_as_the_cell, feature,
    gives_the_published_rows, prints,
};

fn measure(part: &mut Bore, offset: f64) -> (End, Vec<Event>) {
    let (plan, order) = bore();
    let text = measuring_program(&plan, &order, &axes(), 0.03).expect("a good plan");
    let mut controller = Interpreter::new(&['X', 'Y', 'Z']);
    controller.position().insert('Z', 50.0);
    // The interpreter has no work offsets: one of X is what the program would have found as #5021 less #5041.
    let shifted = text.replace("#111=#5021-#5041", &format!("#111=#5021-#5041+{offset}"));
    assert_ne!(text, shifted);
    controller.load(&shifted).expect("readable");
    controller.run(390, part).expect("runs")
}

#[test]
fn a_measuring_program_touches_each_point_of_the_plan_in_order() {
    let (plan, _) = bore();
    let (end, events) = measure(&mut Bore::of(22.05), 0.0);
    assert_eq!(end, End::Finished);
    parts::stays_clear(&events, 22.05);
    let printed = printed_touches(&prints(&events)).expect("its own lines");
    let points: Vec<_> = printed.touches.iter().map(|one| one.point_index).collect();
    assert_eq!(points, ORDER);
    for touch in printed.touches {
        assert!(touch.touched);
        parts::at_contact(&plan, touch.point_index, &touch.position, 22.05);
    }
}

#[test]
fn a_shifted_work_offset_changes_no_machine_position() {
    let (plan, _) = bore();
    let mut part = Bore::of(22.05);
    // Work coordinates are 7 mm less than those of the machine in X.
    part.shift = 7.0;
    let (end, events) = measure(&mut part, 7.0);
    assert_eq!(end, End::Finished);
    for touch in printed_touches(&prints(&events))
        .expect("its own lines")
        .touches
    {
        parts::at_contact(&plan, touch.point_index, &touch.position, 22.05);
    }
}

#[test]
fn a_dead_probe_prints_misses_and_a_small_bore_ends_in_the_alarm_of_an_unplanned_touch() {
    let mut dead = Bore::of(22.0);
    dead.works = false;
    let (end, events) = measure(&mut dead, 0.0);
    assert_eq!(end, End::Finished);
    let touches = printed_touches(&prints(&events))
        .expect("its own lines")
        .touches;
    assert!(touches.len() == 6 && touches.iter().all(|touch| !touch.touched));
    let (end, events) = measure(&mut Bore::of(15.0), 0.0);
    assert_eq!(
        end,
        End::Alarm {
            number: UNPLANNED_TOUCH,
            text: "UNPLANNED TOUCH".to_owned()
        }
    );
    assert_eq!(
        prints(&events),
        "AXES X Y Z\n",
        "nothing is called a measurement"
    );
}

#[test]
fn a_plan_that_cannot_be_programmed_is_refused() {
    let (plan, order) = bore();
    let refused = |order: &probecell_msgs::MeasurementOrder| {
        measuring_program(&plan, order, &axes(), 0.03)
            .expect_err("a bad order")
            .to_string()
    };
    let mut changed = order.clone();
    changed.order[0] = 9;
    assert!(refused(&changed).starts_with("the moves touch points"));
    let mut changed = order.clone();
    changed.moves[4].axis_positions[1] = f64::NAN;
    assert_eq!(
        refused(&changed),
        "move 4 to point 3: axis Y at NaN mm is outside its limits"
    );
    let mut changed = order.clone();
    changed.axis_names[2] = "W".to_owned();
    assert!(refused(&changed).contains("axis \"W\", which the controller does not have"));
    let error = measuring_program(&plan, &order, &axes(), 0.0).expect_err("no feed");
    assert_eq!(
        error.to_string(),
        "travel_feed = 0 is not a positive finite number"
    );
}

/// Runs O0405 alone: the row, and the wear afterwards in mm.
fn decided(size: Option<f64>, wear: f64, count: u32, bore: bool) -> (f64, f64) {
    let mut controller = Interpreter::new(&['X', 'Z']);
    controller
        .load(&main_program(&feature(bore)).expect("sound limits"))
        .expect("readable");
    let preset = [
        (601, 0.01),
        (602, -0.11),
        (603, 5.0),
        (604, f64::from(count)),
        (605, if bore { -1.0 } else { 1.0 }),
    ];
    controller.variables.extend(preset);
    controller
        .variables
        .extend([(700, NOMINAL * 1e3), (10002, wear)]);
    controller.variables.extend(size.map(|size| (600, size)));
    controller.run(405, &mut Air).expect("runs");
    (controller.variables[&606], controller.variables[&10002])
}

#[test]
fn the_macro_gives_the_published_rows() {
    gives_the_published_rows(decided);
}

#[test]
fn the_macro_and_the_cell_decide_alike() {
    decides_as_the_cell(decided);
}

/// A part that each cut makes as large as the tool's wear register says, and 25 µm more.
#[test]
fn the_main_program_corrects_recuts_and_finishes() {
    let cycle = "O0400(ROUGH)\n#510=#700+0.025+#10002\n#511=#511+1\nM99\n\
                 O0403(FINISH)\n#510=#700+0.025+#10002\n#512=#512+1\nM99\n\
                 O0404(MEASURE)\nIF[#513EQ1]GOTO9\n#600=#510\nN9M99\n";
    let run = |preset: &[(u32, f64)]| {
        let mut controller = Interpreter::new(&['X', 'Z']);
        controller
            .load(&main_program(&feature(false)).expect("sound limits"))
            .expect("readable");
        controller.load(cycle).expect("readable");
        controller.variables.extend(preset.iter().copied());
        let end = controller.run(399, &mut Air).expect("runs").0;
        (end, controller.variables)
    };
    let (end, variables) = run(&[(10002, 0.0)]);
    assert_eq!(end, End::Finished);
    assert!((variables[&10002] + 0.025).abs() < 1e-9 && (variables[&510] - 19.8).abs() < 1e-9);
    assert_eq!(
        (variables[&511], variables[&512]),
        (2.0, 1.0),
        "rough twice, finish once"
    );
    let alarm = |number: u32, text: &str| End::Alarm {
        number,
        text: text.to_owned(),
    };
    assert_eq!(
        run(&[(10002, 0.0), (513, 1.0)]).0,
        alarm(100, "MEASUREMENT INVALID")
    );
    assert_eq!(run(&[(10002, -0.040)]).0, alarm(102, "OVERCUT"));
}
