//! The reducer and the views on the sample recordings, against the readable twins beside them and their reports: those were
//! written by other code than what is tested here.

use std::path::{Path, PathBuf};

use bags::Bag;
use dashboard::state::{Attention, Hall, Section};
use dashboard::view::{Choice, View, hall_page, section};
use graph::Stamp;
use serde_json::Value;

fn samples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/samples")
}

/// The hall after the messages of a sample up to `until` s from its beginning, and the instant of the last of them.
fn hall(sample: &str, until: f64) -> (Hall, Stamp) {
    let bag = Bag::open(samples().join(format!("{sample}.mcap"))).expect("a sample");
    let begin = Stamp(bag.bounds().expect("messages").0 as i64);
    let mut hall = Hall::default();
    let mut last = begin;
    for message in bag.messages() {
        let message = message.expect("a message");
        let at = Stamp(message.log_time as i64);
        if at.since_s(begin) <= until + 1e-6 {
            hall.apply(&message.channel.topic, &message.payload, at);
            last = at;
        }
    }
    (hall, last)
}

/// Messages of a topic in the twin, with the time at which they were received.
fn twin(sample: &str, topic: &str) -> Vec<(f64, Value)> {
    let text = std::fs::read_to_string(samples().join(format!("{sample}.jsonl"))).expect("a twin");
    let lines = text
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    let own = lines.filter(|line| line["topic"] == topic);
    own.map(|line| {
        (
            line["at_s"].as_f64().expect("a time"),
            line["message"].clone(),
        )
    })
    .collect()
}

fn html(sample: &str, until: f64, which: Section) -> String {
    let (hall, now) = hall(sample, until);
    let cell = hall.cells().next().expect("a cell");
    section(which, cell, &hall, now, View::default(), "/cell/x").into_string()
}

/// The text of some HTML, with one space between words.
fn text(html: &str) -> String {
    let mut text = String::new();
    let mut inside = false;
    for letter in html.chars() {
        match letter {
            '<' => inside = true,
            '>' => {
                inside = false;
                text.push(' ');
            }
            _ if !inside => text.push(letter),
            _ => {}
        }
    }
    text.replace("&lt;", "<")
        .replace("&gt;", ">")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

fn micro(metres: f64) -> String {
    let value = (metres * 1e7).round() / 10.0 + 0.0;
    let sign = if value < 0.0 {
        "−"
    } else if value > 0.0 {
        "+"
    } else {
        ""
    };
    format!("{sign}{:.1}", value.abs())
}

#[test]
fn sizes_are_those_of_the_twin_and_what_is_out_of_tolerance_stands_first() {
    // After the first measurement: everything still has to be corrected.
    let page = html("punch", 14.55, Section::Sizes);
    let shown = text(&page);
    let results = twin("punch", "feature_results");
    let first: Vec<_> = results
        .iter()
        .filter(|(_, one)| one["plan_id"] == "punch/rough/1")
        .collect();
    assert_eq!(first.len(), 11);
    for (_, one) in first {
        let name = one["feature_id"].as_str().unwrap();
        let u = one["coverage_factor"].as_f64().unwrap()
            * one["standard_uncertainty"].as_f64().unwrap();
        let row = format!(
            "{} ± {:.1}",
            micro(one["size_deviation"].as_f64().unwrap()),
            u * 1e6
        );
        assert!(shown.contains(&row), "{name}: {row} in {shown}");
    }
    // The flats, which the plan tolerances by ± 5 µm, do not conform by ISO 14253-1; the diameters are to be corrected.
    let place = |name: &str| {
        page.find(&format!("<th scope=\"row\">{name}</th>"))
            .unwrap_or_else(|| panic!("{name}"))
    };
    // No verdict judges the flats, and 11 µm is out of tolerance; diameters can be corrected.
    assert!(place("flat_1") < place("D1") || place("D1") < place("flat_1"));
    assert!(shown.contains("can be corrected"));
    assert!(shown.contains("simple acceptance (JCGM 106:2012, 8.2)"));
}

#[test]
fn the_state_between_two_instants_is_what_was_published_until_then() {
    for until in [0.5, 5.5, 14.55, 20.0, 33.0, 50.0] {
        let (hall, _) = hall("punch", until);
        let cell = hall.cells().next().expect("a cell");
        let touches = twin("punch", "touch_deviations");
        let plans = twin("punch", "inspection_plan");
        let plan = plans
            .iter()
            .rev()
            .find(|(at, _)| *at <= until)
            .map(|(_, one)| one["plan_id"].clone());
        let own = touches
            .iter()
            .filter(|(at, one)| *at <= until && Some(&one["plan_id"]) == plan.as_ref());
        assert_eq!(cell.touches.len(), own.count(), "{until}");
        let stages = twin("punch", "part_status");
        let stage = stages
            .iter()
            .rev()
            .find(|(at, _)| *at <= until)
            .map(|(_, one)| one["stage"].as_u64().unwrap());
        assert_eq!(Some(u64::from(cell.part.stage)), stage, "{until}");
    }
}

#[test]
fn the_ledger_sets_what_was_achieved_against_what_was_promised() {
    let shown = text(&html("punch", 100.0, Section::Ledger));
    // Of the wear of tool 2, whose source was an error of 24.6 µm, the next measurement found 4.9 and 2.4 µm.
    let verdicts = twin("punch", "verdicts");
    let of = |name: &str| {
        verdicts
            .iter()
            .find(|(_, one)| one["plan_id"] == "punch/rough/2" && one["feature_id"] == name)
            .unwrap()
            .1["error"]
            .as_f64()
            .unwrap()
    };
    let mean = f64::midpoint(of("D1"), of("D2"));
    assert!(shown.contains("Wear of tool 2 for D1, D2"), "{shown}");
    assert!(
        shown.contains("0.0 µm → −24.6 µm within −110.0 µm to +110.0 µm"),
        "{shown}"
    );
    assert!(
        shown.contains("approved by the policy of the cell file"),
        "{shown}"
    );
    assert!(
        shown.contains("applied , read back −24.6 µm")
            || shown.contains("applied, read back −24.6 µm"),
        "{shown}"
    );
    assert!(
        shown.contains(&format!("→ 0 µm, achieved → {} µm", micro(mean))),
        "{shown}"
    );
    // Before it was measured again nothing was achieved yet.
    let shown = text(&html("punch", 16.0, Section::Ledger));
    assert!(
        shown.contains("the next measurement will tell") && !shown.contains("achieved"),
        "{shown}"
    );
}

#[test]
fn the_gap_names_the_whole_group_and_no_remedy_where_it_is_ambiguous() {
    let both = |sample: &str, until: f64| {
        let [short, full] = [Section::Why, Section::Gap].map(|one| html(sample, until, one));
        text(&(short + &full))
    };
    let shown = both("ball_check", 1000.0);
    let report =
        std::fs::read_to_string(samples().join("ball_check.report.txt")).expect("a report");
    assert!(report.contains(
        "by one of probe.stylus_offset, fixture.shift, axis.C.error_motion, axis.S.error_motion"
    ));
    for effect in [
        "probe.stylus_offset",
        "fixture.shift",
        "axis.C.error_motion",
        "axis.S.error_motion",
    ] {
        assert!(shown.contains(effect), "{effect} in {shown}");
    }
    assert!(
        report.contains("ratio 19.8") && shown.contains("19.8 × noise"),
        "{shown}"
    );
    assert!(report.contains("gap 12.10 µm rms, noise floor 0.61 µm"));
    assert!(
        shown.contains("12.1 µm rms over a noise of 0.6 µm, 14 touches"),
        "{shown}"
    );
    assert!(
        report.contains("dx = 18.11 ± 0.65 µm") && shown.contains("dx = 18.11 ± 0.65 µm"),
        "{shown}"
    );
    assert!(
        report.contains("8 touches (probability 68 % that one")
            && shown.contains("8 touches: 68 % chance"),
        "{shown}"
    );
    assert!(!shown.contains("Remedy"), "{shown}");
    // One cause alone: the straightness of the guideway, with what to do about it.
    let shown = both("guideway", 31.9);
    assert!(
        shown.contains("axis.Z.straightness") && shown.contains("Remedy"),
        "{shown}"
    );
}

#[test]
fn a_recording_read_whole_gives_the_same_state_as_one_read_in_steps() {
    let (whole, now) = hall("punch_uncalibrated", 1000.0);
    let cell = whole.cells().next().expect("a cell");
    let reports = twin("punch_uncalibrated", "part_reports");
    assert_eq!(cell.ended.len(), reports.len());
    assert_eq!(
        cell.touch_count,
        twin("punch_uncalibrated", "touch_deviations").len() as u64
    );
    // The reference revokes the decision, and the part ends badly: somebody must act.
    assert_eq!(
        cell.attention(now).0,
        Attention::Act,
        "{:?}",
        cell.attention(now)
    );
}

#[test]
fn texts_from_the_bus_are_escaped_and_unknown_bytes_change_nothing() {
    let mut hall = Hall::default();
    let at = Stamp(1_000_000_000);
    let machine = probecell_msgs::MachineState {
        alarms: vec!["<script>alert(1)</script>".to_owned()],
        ..Default::default()
    };
    hall.apply(
        "/hall_2/lathe/machine_state",
        &probecell_msgs::to_cdr(&machine),
        at,
    );
    hall.apply("/hall_2/lathe/verdicts", b"\0\x01\0\0nonsense", at);
    let page = hall_page(&hall, at, &Choice::default(), "", "").into_string();
    assert!(page.contains("&lt;script&gt;alert(1)") && !page.contains("<script>alert"));
    assert!(page.contains("href=\"/cell/hall_2/lathe\""));
    assert_eq!(
        hall.cell("hall_2/lathe").map(|cell| cell.verdicts.len()),
        Some(0)
    );
}

#[test]
fn a_cell_is_stale_when_it_is_silent_and_forgotten_when_it_has_left() {
    let mut hall = Hall::default();
    let at = Stamp(1_000_000_000);
    let says = |hall: &mut Hall, at: Stamp| {
        hall.apply(
            "/lathe/machine_state",
            &probecell_msgs::to_cdr(&probecell_msgs::MachineState::default()),
            at,
        );
    };
    says(&mut hall, at);
    let none = std::collections::BTreeSet::new();
    let there = std::collections::BTreeSet::from(["lathe".to_owned()]);
    hall.set_present(&there, at.after_s(1.9));
    assert!(!hall.cell("lathe").unwrap().is_stale(at.after_s(1.9)));
    assert!(
        hall.cell("lathe").unwrap().is_stale(at.after_s(2.1)),
        "although it is announced"
    );
    hall.set_present(&none, at.after_s(2.5));
    hall.set_present(&none, at.after_s(60.0));
    assert!(hall.cell("lathe").is_some());
    says(&mut hall, at.after_s(61.0));
    assert!(
        !hall.cell("lathe").unwrap().is_stale(at.after_s(61.0)),
        "it came back"
    );
    hall.set_present(&none, at.after_s(64.0));
    hall.set_present(&none, at.after_s(124.1));
    assert!(hall.cell("lathe").is_none());
    let texts: Vec<String> = hall
        .events_since(0, None)
        .0
        .map(|one| one.text.clone())
        .collect();
    assert_eq!(
        texts,
        ["appeared", "left the bus", "came back", "left the bus"]
    );
}

#[test]
fn memory_is_bounded_whatever_the_bus_says() {
    let mut hall = Hall::default();
    let at = Stamp(1_000_000_000);
    let fault = |number: u32| {
        probecell_msgs::to_cdr(&probecell_msgs::Fault {
            text: number.to_string(),
            ..Default::default()
        })
    };
    for number in 0..10_000 {
        hall.apply("/lathe/compensation/faults", &fault(number), at);
    }
    let cell = hall.cell("lathe").expect("a cell");
    assert_eq!(cell.faults.len(), 48);
    assert_eq!(
        cell.faults.back().map(|(_, one)| one.text.as_str()),
        Some("9999")
    );
    // Of 10,001 events 4096 are held; a page that saw the first hundred is told so.
    let (held, lost) = hall.events_since(100, Some("lathe"));
    assert_eq!((held.count(), lost), (4096, 10_001 - 4096 - 100));
    for number in 0..1100 {
        hall.apply(
            &format!("/cell_{number}/machine_state"),
            &probecell_msgs::to_cdr(&probecell_msgs::MachineState::default()),
            at,
        );
    }
    assert_eq!((hall.cells().count(), hall.refused()), (1000, 101));
}
