//! Records of a punch made on virtual time, read back from their pages.

use ::report::{ShortDiagnosis, part_page};
use bags::{Bag, Channel, Overflow, Qos, Recorder, RecorderOptions};
use cell::{Cell, CellText};
use graph::{Executor, Published, Stamp, Topic, topics};
use probecell_msgs::{
    Correction, CorrectionAcknowledgement, Fault, FeatureResult, InspectionPlan, LossReport,
    Message, OperatorReply, OperatorRequest, PartReport, Verdict, from_cdr, to_cdr,
};
use roxmltree::{Document, Node, ParsingOptions};
use session_io::record::gather;

use super::*;

const BEGIN: Stamp = Stamp(1_767_225_600_000_000_000);

/// What the turn-mill publishes while it makes a punch.
fn made() -> Vec<Published> {
    let file = include_str!("../../../../../launch-scripts/turn_mill.toml");
    let short = "[path_planning]\nkicks = 50\n";
    let cell = Cell::from_text(CellText {
        name: "turn_mill".to_owned(),
        cell: file.replacen("[path_planning]\n", short, 1),
        robot_description: include_str!("../../../../../launch-scripts/turn_mill.urdf").to_owned(),
        ..CellText::default()
    })
    .expect("a cell")
    .simulated();
    let mut executor = Executor::new(cell.nodes(false).expect("nodes"), BEGIN).expect("wiring");
    let request = OperatorRequest {
        subject: "punch".to_owned(),
        operator_name: "Ada <Lovelace>".to_owned(),
        ..OperatorRequest::default()
    };
    let asked = topics::RUN_REQUESTS.name;
    let waived = probecell_msgs::RecordingStatus {
        state: probecell_msgs::RecordingStatus::WAIVED,
        ..Default::default()
    };
    executor.inject(BEGIN, topics::RECORDING_STATUS.name, to_cdr(&waived));
    executor.inject(BEGIN.after_s(1.0), asked, to_cdr(&request));
    let limit = BEGIN.after_s(600.0);
    assert!(executor.run_until_published(topics::PART_REPORTS.name, limit));
    executor.run_until(executor.now());
    executor.take_log()
}

fn write(log: &[Published], folder: &Path) {
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        ..RecorderOptions::new(folder)
    })
    .expect("a recorder");
    for one in log {
        let Some(topic) = topics::by_name(&one.topic) else {
            continue;
        };
        let name = format!("/turn_mill/{}", topic.name);
        let channel = Channel::of(name, topic.message, Qos::default());
        let channel = recorder.channel(&channel).expect("a channel");
        let at = one.at.0 as u64;
        let pushed = recorder.push(channel, one.sequence, at, at, one.payload.clone());
        pushed.expect("a message");
    }
    recorder.stop().expect("a recording");
}

fn messages<M: Message>(log: &[Published], topic: Topic) -> Vec<M> {
    let own = log.iter().filter(|one| one.topic == topic.name);
    own.map(|one| from_cdr(&one.payload).expect("a message"))
        .collect()
}

fn text(node: Node<'_, '_>) -> String {
    let texts = node.descendants().filter(Node::is_text);
    texts.filter_map(|text| text.text()).collect()
}

/// Rows of every table with this caption, headings left out.
fn rows(page: &Document<'_>, caption: &str) -> Vec<Vec<String>> {
    let tables = page.descendants().filter(|node| node.has_tag_name("table"));
    let wanted = tables.filter(|table| {
        let own = table.children().find(|node| node.has_tag_name("caption"));
        own.is_some_and(|own| text(own) == caption)
    });
    let rows = wanted.flat_map(|table| {
        let rows = table.descendants().filter(|node| node.has_tag_name("tr"));
        rows.skip(1).collect::<Vec<_>>()
    });
    let cells = |row: Node<'_, '_>| row.children().filter(Node::is_element).map(text).collect();
    rows.map(cells).collect()
}

/// The number in a cell, which has a true minus sign, in metres.
fn metres(cell: &str) -> f64 {
    let plain = cell.replace('−', "-");
    let mut words = plain.split(' ');
    let number: f64 = words.next().and_then(|word| word.parse().ok()).expect(cell);
    match words.next().map(|unit| unit.trim_end_matches(',')) {
        Some("mm") => number * 1e-3,
        Some("µm") => number * 1e-6,
        unit => panic!("{cell}: {unit:?}"),
    }
}

fn close(shown: &str, said: f64) {
    assert!(
        (metres(shown) - said).abs() < 0.051e-6,
        "{shown} for {said} m"
    );
}

/// The row of a result: that of its feature in the table of its plan.
fn find<'a>(shown: &'a [Vec<String>], results: &[FeatureResult], index: usize) -> &'a Vec<String> {
    let plan = &results[index].plan_id;
    let of_plan = |one: &&FeatureResult| one.plan_id == *plan;
    let first = results.iter().position(|one| one.plan_id == *plan);
    let count = results.iter().filter(of_plan).count();
    let table = &shown[first.expect("a plan")..][..count];
    let row = table.iter().find(|row| row[0] == results[index].feature_id);
    row.expect("a row of the feature")
}

#[test]
fn the_page_says_what_the_messages_say_and_stands_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let (bag, file) = (
        folder.path().join("session"),
        folder.path().join("page.html"),
    );
    let log = made();
    write(&log, &bag);
    let arguments = Arguments {
        bag,
        html: Some(file.clone()),
        json: false,
        selection: Selection::default(),
    };
    assert_eq!(run(&arguments).expect("a page"), crate::GOOD);
    let html = std::fs::read_to_string(&file).expect("the page");
    for reference in ["href=", "src=", "url(", "<script", "<link", "@import"] {
        assert!(!html.contains(reference), "{reference}");
    }
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let page = Document::parse_with_options(&html, options).expect("a well-formed page");
    assert!(text(page.root()).contains("Ada <Lovelace>"));

    let results: Vec<FeatureResult> = messages(&log, topics::FEATURE_RESULTS);
    let verdicts: Vec<Verdict> = messages(&log, topics::VERDICTS);
    let shown = rows(&page, "Sizes");
    assert_eq!(shown.len(), results.len());
    // One table after the other; in each those first that are not in order.
    let mut left = &shown[..];
    for of_plan in results.chunk_by(|one, other| one.plan_id == other.plan_id) {
        let (table, rest) = left.split_at(of_plan.len());
        left = rest;
        let good = |row: &Vec<String>| row[7].starts_with("qualified") || row[5] == "conforms";
        assert!(table.is_sorted_by_key(good), "{table:?}");
    }
    for (index, result) in results.iter().enumerate() {
        let row = find(&shown, &results, index);
        close(&row[1], result.nominal_size);
        close(&row[2], result.size);
        close(&row[3], result.size_deviation);
        close(&row[4], result.expanded_uncertainty());
        let verdict = verdicts
            .iter()
            .find(|one| one.plan_id == result.plan_id && one.feature_id == result.feature_id);
        let word = match verdict.map(|one| one.verdict) {
            None => "not judged",
            Some(Verdict::QUALIFIED) => "qualified",
            Some(Verdict::COMPENSABLE) => "can be corrected",
            other => panic!("{other:?}"),
        };
        // And the rule that it was made by, with its risk.
        assert!(row[7].starts_with(word), "{}", row[7]);
        assert_eq!(row[7] == word, verdict.is_none(), "{}", row[7]);
    }
    // Composed sizes have no form of their own.
    let shown = rows(&page, "Form, position and orientation");
    assert!(!shown.is_empty());
    for row in &shown {
        let form = row[3].split(" ± ").next().expect("a form");
        let mut own = results.iter().filter(|one| one.feature_id == row[0]);
        assert!(own.any(|one| form == "–" || (metres(form) - one.form).abs() < 0.051e-6));
    }
    let corrections: Vec<Correction> = messages(&log, topics::CORRECTIONS);
    let shown = rows(&page, "Corrections based on it");
    assert!(!corrections.is_empty());
    assert_eq!(shown.len(), corrections.len());
    for (row, correction) in shown.iter().zip(&corrections) {
        assert_eq!(row[0], correction.correction_id);
        close(&row[2], correction.previous_value);
        close(&row[3], correction.new_value);
        let bound = row[4].strip_prefix("± ").expect("bounds");
        close(bound, correction.upper_bound);
        assert_eq!(correction.lower_bound, -correction.upper_bound);
        close(&row[5], correction.measured_error);
        assert!(row[7].contains("policy of the cell file"), "{}", row[7]);
        let (applied, read_back) = row[8].split_once(", read back ").expect("an answer");
        assert_eq!(applied, "applied");
        close(read_back, correction.new_value);
    }
    let pictures = page.descendants().filter(|node| node.has_tag_name("svg"));
    assert!(pictures.count() >= 2, "one for each pass at least");
}

/// The record of a cell whose probe was never calibrated, with the readings of the reference instrument in the bag.
#[test]
fn a_record_shows_the_reference_and_qualifies_nothing_that_it_contradicts() {
    let folder = tempfile::tempdir().expect("a folder");
    let sample =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/samples/punch_uncalibrated.mcap");
    let file = folder.path().join("page.html");
    let arguments = Arguments {
        bag: sample.clone(),
        html: Some(file.clone()),
        json: false,
        selection: Selection::default(),
    };
    assert_eq!(run(&arguments).expect("a page"), crate::GOOD);
    let html = std::fs::read_to_string(&file).expect("the page");
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let page = Document::parse_with_options(&html, options).expect("a well-formed page");
    let all = text(page.root());
    assert!(all.contains("Part punch is not qualified"), "{all}");
    assert!(!all.contains("is qualified"), "{all}");
    // An earlier pass went on by its readings, as it is recorded; the last one is revoked.
    let (_, last) = all
        .rsplit_once("Measurement punch/finish/1")
        .expect("the last measurement");
    assert!(last.trim_start().starts_with("Revoked"), "{last}");
    assert!(!last.contains("all sizes qualified"), "{last}");
    let finish = rows(&page, "Sizes by reference");
    let mut gaps: Vec<f64> = Vec::new();
    for row in finish
        .iter()
        .filter(|row| row[7] == "contradict each other" && !row[0].starts_with("flat"))
    {
        assert_eq!(row[1], "by CMM");
        gaps.push(metres(&row[5]));
    }
    assert!(gaps.len() >= 5, "{finish:?}");
    // The mean error of a probe that was never calibrated (docs/source_systems.md, A.2).
    let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
    assert!((mean - 71e-6).abs() < 4e-6, "{mean}");
    let bag = Bag::open(&sample).expect("a bag");
    let json = sizes::json(&gather(&bag, &sample).expect("a session"));
    assert_eq!(json["parts"][0]["qualified"], false);
    assert_eq!(json["parts"][0]["contradicted"], true);
}

/// A message at its own instant.
fn published<M: Message>(topic: Topic, after_s: f64, sequence: u64, message: &M) -> Published {
    Published {
        topic: topic.name.to_owned(),
        sequence,
        at: BEGIN.after_s(after_s),
        payload: to_cdr(message),
    }
}

fn stamped(after_s: f64) -> probecell_msgs::std_msgs::Header {
    probecell_msgs::std_msgs::Header {
        stamp: BEGIN.after_s(after_s).time(),
        frame_id: String::new(),
    }
}

/// Every step of a correction, faults and losses stand in the order of their stamps, whatever the order on the bus.
#[test]
fn who_approved_what_and_when_is_told_with_faults_and_losses() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut log = made();
    log.retain(|one| {
        ![
            topics::CORRECTIONS.name,
            topics::CORRECTION_ACKNOWLEDGEMENTS.name,
        ]
        .contains(&one.topic.as_str())
    });
    let plan: Vec<InspectionPlan> = messages(&log, topics::INSPECTION_PLAN);
    let correction = |after_s: f64, approval: u8, by: &str| Correction {
        header: stamped(after_s),
        correction_id: "punch/T1/0".to_owned(),
        kind: Correction::TOOL_WEAR,
        tool_number: 1,
        new_value: -12e-6,
        lower_bound: -100e-6,
        upper_bound: 100e-6,
        plan_id: plan[0].plan_id.clone(),
        feature_ids: vec!["d1".to_owned()],
        sequences: vec![3, 4],
        measured_error: 12e-6,
        standard_uncertainty: 1e-6,
        approval,
        approved_by: by.to_owned(),
        expires: BEGIN.after_s(700.0).time(),
        ..Correction::default()
    };
    let asks = OperatorRequest {
        header: stamped(102.25),
        request_id: 7,
        subject: "punch/T1/0".to_owned(),
        operator_name: "Ada".to_owned(),
        approve: true,
        ..OperatorRequest::default()
    };
    let reply = OperatorReply {
        request_id: 7,
        accepted: true,
        ..OperatorReply::default()
    };
    let answer = CorrectionAcknowledgement {
        header: stamped(103.5),
        correction_id: "punch/T1/0".to_owned(),
        outcome: CorrectionAcknowledgement::APPLIED,
        value_before: 0.0,
        value_after: -12e-6,
        text: String::new(),
        ..CorrectionAcknowledgement::default()
    };
    let fault = |after_s: f64, node: &str| Fault {
        header: stamped(after_s),
        node: node.to_owned(),
        severity: Fault::ERROR,
        code: "estop".to_owned(),
        text: "the machine is in emergency stop".to_owned(),
    };
    let loss = LossReport {
        header: stamped(104.0),
        observer: "recorder".to_owned(),
        topic: "joint_states".to_owned(),
        first_sequence: 812,
        count: 3,
        recovered: false,
    };
    let proposed = correction(102.0, Correction::APPROVAL_NONE, "");
    let approved = correction(103.0, Correction::APPROVAL_OPERATOR, "Ada");
    let waits = Correction {
        correction_id: "punch/T2/9".to_owned(),
        ..proposed.clone()
    };
    log.extend([
        published(topics::CORRECTIONS, 102.0, 1, &proposed),
        published(topics::CORRECTIONS, 102.0, 2, &waits),
        published(topics::CORRECTIONS, 103.0, 3, &approved),
        published(topics::APPROVALS, 102.3, 1, &asks),
        published(topics::APPROVAL_REPLIES, 103.0, 1, &reply),
        published(topics::CORRECTION_ACKNOWLEDGEMENTS, 103.5, 1, &answer),
        published(topics::LAUNCHER_FAULTS, 105.0, 1, &fault(105.0, "launcher")),
        published(
            topics::MACHINE_STATE_FAULTS,
            104.5,
            1,
            &fault(104.5, "machine_state"),
        ),
        published(topics::LOSS_REPORTS, 104.0, 1, &loss),
    ]);
    let bag = folder.path().join("session");
    write(&log, &bag);
    let session = gather(&Bag::open(&bag).expect("a bag"), &bag).expect("a session");
    let page = part_page(&session, ShortDiagnosis::None("not asked for")).expect("a page");
    let html = page.html();
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let page_read = Document::parse_with_options(&html, options).expect("a well-formed page");
    let steps = rows(&page_read, "Approvals, commands and answers of the machine");
    let when: Vec<&str> = steps.iter().map(|row| row[0].as_str()).collect();
    let mut sorted = when.clone();
    sorted.sort_unstable();
    assert_eq!(when, sorted);
    let own: Vec<&Vec<String>> = steps.iter().filter(|row| row[1] == "punch/T1/0").collect();
    let happened: Vec<&str> = own.iter().map(|row| row[2].as_str()).collect();
    assert_eq!(
        happened,
        [
            "wear of tool 1: proposed, valid until 2026-01-01 00:11:40.000",
            "Ada asked to approve it: accepted",
            "approved by Ada",
            "at the machine: applied, read back −12.0 µm",
        ]
    );
    assert_eq!(own[1][0], "2026-01-01 00:01:42.250");
    assert_eq!(own[2][4], "± 100.0 µm");
    assert!(own[2][5].contains("d1, 2 touches, error +12.0 µm, u 1.0 µm"));
    let all = text(page_read.root());
    assert!(all.contains("Proposed and never approved, so never written: punch/T2/9."));
    let faults = rows(&page_read, "Faults");
    let nodes: Vec<&str> = faults.iter().map(|row| row[1].as_str()).collect();
    assert_eq!(nodes, ["machine_state", "launcher"]);
    let lost = rows(&page_read, "Messages that were lost, as reported");
    assert_eq!(
        lost,
        [[
            "2026-01-01 00:01:44.000",
            "recorder",
            "joint_states",
            "3",
            "812",
            "no"
        ]]
    );
    // The text says the same, with the minus sign of a keyboard.
    let plain = page.text();
    for row in steps.iter().chain(&faults).chain(&lost) {
        for cell in row {
            let cell = cell.replace('−', "-");
            assert!(plain.contains(&cell), "{cell} is not in the text");
        }
    }
}

/// Three parts of one name: a record that kept the last of them alone would say that all was well.
#[test]
fn parts_of_one_name_are_told_apart_by_their_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut log = made();
    let report = |after_s: f64, run_id: &str, verdict: u8, text: &str| PartReport {
        header: stamped(after_s),
        part_id: "punch".to_owned(),
        run_id: run_id.to_owned(),
        verdict,
        passes: 1,
        text: text.to_owned(),
        ..PartReport::default()
    };
    let scrap = report(700.0, "punch#2", PartReport::SCRAP, "D1 cut below size");
    let stopped = report(800.0, "punch#3", PartReport::STOPPED, "stopped by Ada");
    // It was stopped, and its measurement was resumed: one end of one run.
    let resumed = report(
        900.0,
        "punch#3",
        PartReport::QUALIFIED,
        "all sizes qualified",
    );
    let again = OperatorRequest {
        header: stamped(850.0),
        plan_id: "punch#3/finish/1".to_owned(),
        ..OperatorRequest::default()
    };
    log.extend([
        published(topics::PART_REPORTS, 700.0, 11, &scrap),
        published(topics::PART_REPORTS, 800.0, 12, &stopped),
        published(topics::RUN_REQUESTS, 850.0, 12, &again),
        published(topics::PART_REPORTS, 900.0, 13, &resumed),
    ]);
    let bag = folder.path().join("session");
    write(&log, &bag);
    let session = gather(&Bag::open(&bag).expect("a bag"), &bag).expect("a session");
    let page = part_page(&session, ShortDiagnosis::None("not asked for")).expect("a page");
    // Whatever the breaks of lines.
    let text = page.text().split_whitespace().collect::<Vec<_>>().join(" ");
    let first = "Part punch is qualified after 3 machining passes";
    assert!(text.contains(first), "{text}");
    let others = "Part punch (run punch#2) is scrap after 1 machining pass: D1 cut below size. Part punch (run punch#3) is \
                  qualified after 1 machining pass: all sizes qualified.";
    assert!(text.contains(others), "{text}");
    assert!(
        text.contains("; punch#3/finish/1, by an unnamed operator, 2026-01-01 00:14:10"),
        "{text}"
    );
}

#[test]
fn what_holds_no_part_is_refused_in_a_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let told = |bag: &Path, html: &Path| {
        let arguments = Arguments {
            bag: bag.to_owned(),
            html: Some(html.to_owned()),
            json: false,
            selection: Selection::default(),
        };
        format!("{:#}", run(&arguments).expect_err("refused"))
    };
    let page = folder.path().join("page.html");
    let absent = folder.path().join("absent");
    assert!(told(&absent, &page).contains("absent"));
    let log = made();
    let planless: Vec<Published> = (log.iter())
        .filter(|one| one.topic != topics::INSPECTION_PLAN.name)
        .cloned()
        .collect();
    let (whole, bare) = (folder.path().join("whole"), folder.path().join("bare"));
    write(&log, &whole);
    write(&planless, &bare);
    assert!(told(&bare, &page).contains("no inspection plan was recorded"));
    let nowhere = folder.path().join("no_folder").join("page.html");
    assert!(told(&whole, &nowhere).contains("cannot write"));
    assert!(!page.exists());
}

#[test]
fn what_a_cut_recording_lacks_is_named_by_number() {
    let folder = tempfile::tempdir().expect("a folder");
    let bag = folder.path().join("session");
    let mut log = made();
    let lost =
        |one: &Published| one.topic == topics::PROBE_EVENTS.name && (5..=7).contains(&one.sequence);
    log.retain(|one| !lost(one));
    write(&log, &bag);
    let (session, damage) = record::read(&bag).expect("a session");
    assert!(damage.is_empty());
    let expected = "/turn_mill/probe_events: messages 5 to 7 are missing: later numbers are there";
    assert_eq!(session.damage, [expected]);
}
