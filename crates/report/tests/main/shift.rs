//! The report of a shift: what a foreman reads, whatever the number of parts, features and letters.

use probecell_msgs::{
    Correction, CorrectionAcknowledgement, Fault, FeatureResult, InspectionPlan, OperationRequest,
    PartReport, Verdict, builtin_interfaces::Time, std_msgs::Header,
};
use report::{PartSession, ShortDiagnosis, part_session, shift_page, shift_parts};
use roxmltree::Document;

fn header(seconds: i64) -> Header {
    Header {
        stamp: Time::from_nanos(1_795_876_000_000_000_000 + seconds * 1_000_000_000),
        frame_id: String::new(),
    }
}

/// A part of 60 s every 100 s; its size is `deviation`.
fn add(session: &mut PartSession, number: i64, name: &str, verdict: u8, features: &[(&str, f64)]) {
    let (begin, end) = (number * 100, number * 100 + 60);
    let plan_id = format!("{name}/finish/1");
    session.operations.push(OperationRequest {
        header: header(begin),
        run_id: name.to_owned(),
        ..OperationRequest::default()
    });
    session.plans.push(InspectionPlan {
        plan_id: plan_id.clone(),
        ..InspectionPlan::default()
    });
    for (feature, deviation) in features {
        session.results.push(FeatureResult {
            plan_id: plan_id.clone(),
            feature_id: (*feature).to_owned(),
            size_deviation: *deviation,
            decision: FeatureResult::CONFORMS,
            ..FeatureResult::default()
        });
        session.verdicts.push(Verdict {
            header: header(end - 1),
            plan_id: plan_id.clone(),
            feature_id: (*feature).to_owned(),
            error: *deviation,
            tolerance: 10e-6,
            verdict: Verdict::QUALIFIED,
            ..Verdict::default()
        });
    }
    session.parts.push(PartReport {
        header: header(end),
        part_id: name.to_owned(),
        run_id: name.to_owned(),
        verdict,
        passes: 1,
        text: format!("end of {name}"),
        ..PartReport::default()
    });
}

/// Thirty good parts and a stopped one between them; a correction from the first part, and a fault.
fn shift() -> PartSession {
    let mut session = PartSession {
        cell: "mill".to_owned(),
        ..PartSession::default()
    };
    for number in 0..31_i64 {
        let name = format!("shaft {number}");
        if number == 15 {
            add(
                &mut session,
                number,
                &name,
                PartReport::STOPPED,
                &[("D1", 90e-6)],
            );
        } else {
            let number_of_good = number - i64::from(number > 15);
            let deviation = (2 + number_of_good % 3) as f64 * 1e-6;
            add(
                &mut session,
                number,
                &name,
                PartReport::QUALIFIED,
                &[("D1", deviation)],
            );
        }
    }
    session.corrections.push(Correction {
        header: header(61),
        correction_id: "c".to_owned(),
        plan_id: "shaft 0/finish/1".to_owned(),
        feature_ids: vec!["D1".to_owned()],
        tool_number: 2,
        measured_error: 25e-6,
        ..Correction::default()
    });
    session.acknowledgements.push(CorrectionAcknowledgement {
        correction_id: "c".to_owned(),
        outcome: CorrectionAcknowledgement::APPLIED,
        ..CorrectionAcknowledgement::default()
    });
    session.faults.push(Fault {
        header: header(1_700),
        node: "probe_events".to_owned(),
        severity: Fault::ERROR,
        code: "probe_stuck".to_owned(),
        text: "the probe is stuck".to_owned(),
    });
    session
}

const NONE: ShortDiagnosis<'_> = ShortDiagnosis::None("the session was made by hand");

fn fits(text: &str) {
    let long = text.lines().find(|line| line.chars().count() > 100);
    assert_eq!(long, None);
}

#[test]
fn a_shift_tells_verdicts_capability_corrections_and_stops_and_leads_to_each_part() {
    let session = shift();
    assert_eq!(shift_parts(&session).len(), 31);
    let link = |index: usize| Some(format!("s_parts/{index}.html"));
    let page = shift_page(&session, NONE, &link).expect("a page");
    let text = page.text();
    fits(&text);
    let told = text.split_whitespace().collect::<Vec<_>>().join(" ");
    // Ten times 2, 3 and 4 µm: s = sqrt(20/29) µm, Cpk = 7 µm / 3 s, Cp = 20 µm / 6 s.
    let s = (20.0_f64 / 29.0).sqrt();
    let row = format!(
        "D1 30 0 ± 10.0 µm +3.0 µm {s:.1} µm {:.2} (",
        20.0 / (6.0 * s)
    );
    assert!(told.contains(&row), "{row}: {told}");
    for words in [
        format!(
            "30 qualified, 1 stopped (shaft 15). Least capable is D1: Cpk {:.2} (",
            7.0 / (3.0 * s)
        ),
        "Of one correction 1 helped.".to_owned(),
        // Of the end of the part and of the fault, until the next part began.
        "shaft 15 stopped 14:52:40 40 s end of shaft 15".to_owned(),
        "error of probe_events 14:55:00 100 s the probe is stuck".to_owned(),
        "wear of tool 2 1 25.0 µm 0.0 µm 3.0 µm 1 of 1".to_owned(),
        "shaft 1 14:29:20 (60 s) qualified, 1 pass D1, 30 % of its tolerance".to_owned(),
    ] {
        assert!(told.contains(&words), "{words}: {told}");
    }
    let html = page.html();
    let document = Document::parse_with_options(
        &html,
        roxmltree::ParsingOptions {
            allow_dtd: true,
            ..Default::default()
        },
    );
    let document = document.expect("XML");
    let links = document.descendants().filter(|node| node.has_tag_name("a"));
    let to: Vec<&str> = links.filter_map(|node| node.attribute("href")).collect();
    assert_eq!(to[0], "s_parts/15.html", "the stop leads to its part");
    assert_eq!(to.len(), 32);
    assert_eq!(to[31], "s_parts/30.html");
}

#[test]
fn a_part_of_a_shift_has_what_is_its_own() {
    let session = shift();
    let parts = shift_parts(&session);
    let own = part_session(&session, &[parts[0]]);
    assert_eq!(
        (own.plans.len(), own.results.len(), own.verdicts.len()),
        (1, 1, 1)
    );
    assert_eq!(
        (
            own.corrections.len(),
            own.acknowledgements.len(),
            own.faults.len()
        ),
        (1, 1, 0)
    );
    let later = part_session(&session, &parts[16..18]);
    assert_eq!((later.parts.len(), later.corrections.len()), (2, 0));
    assert_eq!(
        later.faults.len(),
        1,
        "it was reported while the second of them was made"
    );
}

#[test]
fn any_number_of_parts_and_features_with_any_names_has_a_page() {
    let mut session = PartSession::default();
    let features: Vec<String> = (0..150)
        .map(|one| format!("Ø<{one}> & \u{7}\u{202e}{}", "long ".repeat(60)))
        .collect();
    for number in 0..120 {
        let odd = [f64::NAN, f64::INFINITY, 0.0, 1e3, -3e-6][number as usize % 5];
        let features: Vec<(&str, f64)> = features.iter().map(|one| (one.as_str(), odd)).collect();
        let name = format!(
            "{}\"{number}\u{1b}[31m",
            "Welle ".repeat(number as usize % 40)
        );
        add(&mut session, number, &name, (number % 4) as u8, &features);
    }
    let page = shift_page(&session, NONE, &|_| None).expect("a page");
    fits(&page.text());
    assert!(!page.html().contains('\u{1b}'));
    for count in 0..3 {
        let few = PartSession {
            parts: session.parts[..count].to_vec(),
            ..PartSession::default()
        };
        shift_page(&few, NONE, &|_| None).expect("a page");
    }
}
