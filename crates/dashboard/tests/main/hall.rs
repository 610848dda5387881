//! The hall: what a tile draws, which cells are chosen, and how much is kept.

use dashboard::state::{Hall, LAST_PARTS, Section};
use dashboard::view::{Choice, View, hall_csv, hall_page, section, tile};
use graph::Stamp;
use probecell_msgs::{
    FeatureResult, InspectionFeature, InspectionPlan, MachineState, Order, Orders, PartStatus,
    Verdict,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
    to_cdr,
};

const TOLERANCE: f64 = 10e-6;

fn begin() -> Stamp {
    Stamp(1_790_000_000_000_000_000)
}

fn machine(hall: &mut Hall, cell: &str, execution: u8, at: Stamp) {
    let state = MachineState {
        execution,
        ..MachineState::default()
    };
    hall.apply(&format!("/{cell}/machine_state"), &to_cdr(&state), at);
}

/// A part with two characteristics, of which the first has this deviation and the second none.
fn part(hall: &mut Hall, cell: &str, number: usize, deviation: f64, at: Stamp) {
    let plan_id = format!("p_{number}/finish/1");
    let features = ["D1", "D2"].map(|id| InspectionFeature {
        id: id.to_owned(),
        lower_tolerance: -TOLERANCE,
        upper_tolerance: TOLERANCE,
        ..InspectionFeature::default()
    });
    let plan = InspectionPlan {
        plan_id: plan_id.clone(),
        features: features.into(),
        ..InspectionPlan::default()
    };
    hall.apply(&format!("/{cell}/inspection_plan"), &to_cdr(&plan), at);
    for (feature, deviation) in [("D1", deviation), ("D2", 0.0)] {
        let result = FeatureResult {
            plan_id: plan_id.clone(),
            feature_id: feature.to_owned(),
            decision: FeatureResult::CONFORMS,
            size_deviation: deviation,
            standard_uncertainty: 1e-6,
            coverage_factor: 2.0,
            ..FeatureResult::default()
        };
        hall.apply(&format!("/{cell}/feature_results"), &to_cdr(&result), at);
        let verdict = Verdict {
            plan_id: plan_id.clone(),
            feature_id: feature.to_owned(),
            verdict: Verdict::QUALIFIED,
            error: deviation,
            tolerance: TOLERANCE,
            ..Verdict::default()
        };
        hall.apply(&format!("/{cell}/verdicts"), &to_cdr(&verdict), at);
    }
}

#[test]
fn the_page_of_a_cell_lists_its_orders_and_why_they_are_held() {
    let mut hall = Hall::default();
    machine(&mut hall, "mill", MachineState::EXECUTION_IDLE, begin());
    let order = |order_id: u64| Order {
        order_id,
        part_id: format!("<Welle> {order_id}"),
        count: 20,
        begun: 7,
        state: Order::INTERRUPTED,
        ..Order::default()
    };
    let mut orders = Orders {
        orders: (1..=15).map(order).collect(),
        held: "stopped by Ada".to_owned(),
        ..Orders::default()
    };
    let page = |hall: &Hall| {
        let cell = hall.cell("mill").expect("a cell");
        section(
            Section::State,
            cell,
            hall,
            begin(),
            View::default(),
            "/cell/mill",
        )
        .into_string()
    };
    assert!(!page(&hall).contains("Orders"));
    hall.apply("/mill/orders", &to_cdr(&orders), begin());
    let shown = page(&hall);
    for words in [
        "Orders, held: stopped by Ada",
        "&lt;Welle&gt; 12",
        "7 of 20",
        "interrupted",
        "and 3 more",
    ] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    assert!(!shown.contains("Welle&gt; 13"));
    orders.orders.clear();
    hall.apply("/mill/orders", &to_cdr(&orders), begin());
    assert!(!page(&hall).contains("Orders"));
}

#[test]
fn signals_of_a_plc_are_drawn_over_time_and_one_that_fails_has_no_value() {
    let mut hall = Hall::default();
    let reading = |name: &str, value: Option<f64>| {
        let pair = |key: &str, value: String| KeyValue {
            key: key.to_owned(),
            value,
        };
        let mut values = vec![pair("unit", "Pa".to_owned())];
        values.extend(value.map(|value| pair("value", value.to_string())));
        let level = if value.is_some() {
            DiagnosticStatus::OK
        } else {
            DiagnosticStatus::ERROR
        };
        to_cdr(&DiagnosticArray {
            status: vec![DiagnosticStatus {
                level,
                name: name.to_owned(),
                values,
                ..DiagnosticStatus::default()
            }],
            ..DiagnosticArray::default()
        })
    };
    let state = MachineState {
        temperature_names: vec!["coolant".to_owned()],
        temperatures: vec![21.5],
        ..MachineState::default()
    };
    for second in 0..600 {
        let at = begin().after_s(f64::from(second));
        hall.apply("/mill/machine_state", &to_cdr(&state), at);
        let pressure = (second < 300).then_some(6e6 - 1e3 * f64::from(second));
        hall.apply("/mill/signals", &reading("hydraulics", pressure), at);
        hall.apply("/mill/signals", &reading("coolant", Some(21.5)), at);
        if second < 100 {
            hall.apply("/mill/signals", &reading("lubricant", Some(2e5)), at);
        }
    }
    let cell = hall.cell("mill").expect("a cell");
    let means: Vec<_> = cell.signals["hydraulics"].trend.means().collect();
    assert!(means.len() > 20, "{means:?}");
    for (at, mean) in means {
        // It falls by 1 kPa each second, and holds its last value for one more.
        let expected = 6e6 - 1e3 * (at.since_s(begin()) - 0.5);
        assert!((mean - expected).abs() < 2e3, "{mean} {expected}");
        assert!(at.since_s(begin()) < 300.0);
    }
    let page = section(
        Section::Axes,
        cell,
        &hall,
        begin(),
        View::default(),
        "/cell/mill",
    )
    .into_string();
    assert!(
        page.contains("hydraulics, Pa</th><td class=\"number\">–"),
        "{page}"
    );
    assert!(page.contains("hydraulics, Pa from 57"), "{page}");
    assert_eq!(page.matches("coolant</th>").count(), 1, "{page}");
    // One that is not told of any more is not drawn on.
    let lubricant = &cell.signals["lubricant"].trend;
    assert_eq!(lubricant.value(), None);
    let (last, _) = lubricant.means().last().expect("a mean");
    assert!(last.since_s(begin()) < 120.0, "{}", last.since_s(begin()));
}

#[test]
fn the_worst_size_of_each_of_the_last_parts_is_kept_and_drawn() {
    let mut hall = Hall::default();
    machine(&mut hall, "mill", MachineState::EXECUTION_IDLE, begin());
    for number in 0..40 {
        part(&mut hall, "mill", number, number as f64 * 0.3e-6, begin());
    }
    let cell = hall.cell("mill").expect("a cell");
    assert_eq!(cell.last_parts.len(), LAST_PARTS);
    let used: Vec<f64> = cell.last_parts.iter().filter_map(|one| one.used).collect();
    let expected: Vec<f64> = (15..40).map(|number| f64::from(number) * 0.03).collect();
    let same = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
    assert!(
        used.iter().zip(&expected).all(same) && used.len() == 25,
        "{used:?}"
    );
    assert!(cell.last_parts.iter().all(|one| one.feature == "D1"));
    let page = tile(cell, begin(), 600.0).into_string();
    for said in [
        "last 25 parts: now 117 %, 6 out of tolerance",
        "+11.7 ± 2.0 µm, limits −10.0 to +10.0 µm",
        "+11.7 µm",
    ] {
        assert!(page.contains(said), "{said}: {page}");
    }
}

#[test]
fn a_size_that_is_measured_again_replaces_the_worst_of_its_part() {
    let mut hall = Hall::default();
    for deviation in [9e-6, 4e-6] {
        part(&mut hall, "mill", 1, deviation, begin());
    }
    let last = &hall.cell("mill").expect("a cell").last_parts;
    assert_eq!(last.len(), 1);
    assert!(
        (last[0].used.expect("a size") - 0.4).abs() < 1e-9,
        "{last:?}"
    );
}

#[test]
fn a_strip_tells_how_long_a_machine_did_what() {
    let mut hall = Hall::default();
    let status = |stage| {
        to_cdr(&PartStatus {
            stage,
            ..PartStatus::default()
        })
    };
    let mut at = begin();
    let stages = [
        (PartStatus::CUTTING, 100),
        (PartStatus::MEASURING, 60),
        (PartStatus::NONE, 40),
    ];
    for (stage, seconds) in stages {
        hall.apply("/mill/part_status", &status(stage), at);
        for _ in 0..seconds {
            machine(&mut hall, "mill", u8::from(stage != PartStatus::NONE), at);
            at = at.after_s(1.0);
        }
    }
    for _ in 0..30 {
        machine(&mut hall, "mill", MachineState::EXECUTION_HOLD, at);
        at = at.after_s(1.0);
    }
    let cell = hall.cell("mill").expect("a cell");
    let spent = cell.course.spent_since(begin()).map(f64::round);
    assert_eq!(spent, [100.0, 60.0, 40.0, 29.0]);
    let page = tile(cell, at, 600.0).into_string();
    let said = "Last 10 min: running 100 s, measuring 60 s, waiting 40 s, stopped 29 s";
    assert!(page.contains(said), "{page}");
}

fn choice(q: &str, state: &str, sort: &str) -> Choice {
    let mut choice = Choice::default();
    [choice.q, choice.state, choice.sort] = [q, state, sort].map(str::to_owned);
    choice
}

#[test]
fn cells_are_chosen_by_words_and_state_and_put_in_an_order() {
    let mut hall = Hall::default();
    for (cell, deviation) in [("mill_a", 2e-6), ("lathe", 8e-6), ("mill_b", -5e-6)] {
        machine(&mut hall, cell, MachineState::EXECUTION_IDLE, begin());
        part(&mut hall, cell, 1, deviation, begin());
    }
    machine(&mut hall, "mill_b", MachineState::EXECUTION_ALARM, begin());
    let shown = |q: &str, state: &str, sort: &str| {
        let choice = choice(q, state, sort);
        let page = hall_page(&hall, begin(), &choice, "", "").into_string();
        let csv = hall_csv(&hall, begin(), &choice);
        let tiles = page.split("id=\"tile-").skip(1);
        let tiles: Vec<String> = tiles
            .filter_map(|one| Some(one.split_once('"')?.0.to_owned()))
            .collect();
        let rows = csv.lines().skip(1).filter_map(|one| one.split(',').next());
        assert_eq!(rows.collect::<Vec<_>>(), tiles);
        tiles
    };
    assert_eq!(shown("", "", ""), ["mill_b", "lathe", "mill_a"]);
    assert_eq!(shown("", "", "name"), ["lathe", "mill_a", "mill_b"]);
    assert_eq!(shown("", "", "size"), ["lathe", "mill_b", "mill_a"]);
    assert_eq!(shown("MILL", "", ""), ["mill_b", "mill_a"]);
    assert_eq!(shown("mill alarm", "", ""), ["mill_b"]);
    assert_eq!(shown("", "idle", ""), ["lathe", "mill_a"]);
    assert_eq!(shown("<script>", "", ""), [""; 0]);
    let page = hall_page(&hall, begin(), &choice("\"><b>", "", ""), "", "");
    assert!(!page.into_string().contains("\"><b>"));
}
