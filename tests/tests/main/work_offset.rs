//! A part that lies off its place: the work offsets follow it, through the gate, and what is cut then lies where the drawing
//! has it against the datums. The hidden place of the part is the cell file's; nothing but the simulator reads it.

use cell::{Cell, CellText};
use cell_tests::{cell, session::Session};
use graph::topics;
use probecell_msgs::{
    ControllerCommand, Correction, CorrectionAcknowledgement as Ack, FeatureResult, PartAlignment,
    PartReport, ToolOffsets, Verdict,
};

const HIDDEN: &str =
    "clamping = { shift_um = [310.0, -180.0, 95.0], turn_urad = [30.0, -45.0, 60.0] }";

/// The shipped cell with another place of the part, or other settings.
fn made(edit: impl Fn(&str) -> String) -> Session {
    let mut session = Session::new(&cell("clamped_casting.toml", edit));
    session.make("casting_1");
    session
}

fn clamped(shift_um: [f64; 3], turn_urad: [f64; 3]) -> Session {
    made(|text| {
        let hidden = format!("clamping = {{ shift_um = {shift_um:?}, turn_urad = {turn_urad:?} }}");
        assert!(text.contains(HIDDEN));
        text.replace(HIDDEN, &hidden)
    })
}

fn written(session: &Session) -> Vec<(String, f64)> {
    let commands: Vec<ControllerCommand> = session.all(topics::CONTROLLER_COMMANDS);
    let written = commands
        .into_iter()
        .filter(|one| one.kind == ControllerCommand::SET_WORK_OFFSET);
    written.map(|one| (one.axis, one.value)).collect()
}

/// m; how far the bore lies from its place, by the last measurement.
fn bore(session: &Session) -> FeatureResult {
    let results: Vec<FeatureResult> = session.all(topics::FEATURE_RESULTS);
    let mut bores = results.into_iter().filter(|one| one.feature_id == "bore");
    bores.next_back().expect("the bore was measured")
}

#[test]
fn the_work_offsets_follow_the_part_and_the_bore_lies_where_the_datums_want_it() {
    for (shift, turn) in [
        ([310.0, -180.0, 95.0], [30.0, -45.0, 60.0]),
        ([-640.0, 20.0, -230.0], [-70.0, 15.0, -80.0]),
    ] {
        let session = clamped(shift, turn);
        let report: PartReport = session.last(topics::PART_REPORTS);
        assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
        let offsets = written(&session);
        assert_eq!(offsets.len(), 3, "{offsets:?}");
        // The middle of the touches lies within 40 mm of the origin: the turn adds at most 4 µm there.
        for (number, (axis, value)) in offsets.iter().enumerate() {
            assert_eq!(axis, ["X", "Y", "Z"][number]);
            let off = value * 1e6 - shift[number];
            assert!(off.abs() < 5.0, "{axis} {off:.1} µm off the truth");
        }
        let held: ToolOffsets = session.last(topics::TOOL_OFFSETS);
        assert_eq!(
            held.work_offsets,
            offsets.iter().map(|one| one.1).collect::<Vec<_>>()
        );
        let answers: Vec<Ack> = session.all(topics::CORRECTION_ACKNOWLEDGEMENTS);
        assert!(answers.iter().all(|one| one.outcome == Ack::APPLIED));
        for correction in session.all::<Correction>(topics::CORRECTIONS) {
            assert_eq!(correction.kind, Correction::WORK_OFFSET);
            assert_eq!(correction.feature_ids, ["A", "B", "C"]);
            assert_eq!(correction.sequences.len(), 10);
        }
        // Told before and after: first where it was clamped, then within the tolerance.
        let places: Vec<PartAlignment> = session.all(topics::PART_ALIGNMENT);
        let first = &places[0];
        for (found, truth) in [first.shift.x, first.shift.y, first.shift.z]
            .into_iter()
            .zip(shift)
        {
            assert!((found * 1e6 - truth).abs() < 5.0, "{found:e}");
        }
        let last: Verdict = session
            .all(topics::VERDICTS)
            .into_iter()
            .rfind(|one: &Verdict| one.feature_id == "place of the part")
            .expect("judged");
        assert!(
            last.verdict == Verdict::QUALIFIED && last.error < 10e-6,
            "{}",
            last.text
        );
        // Bored after that, and evaluated against the datums: 1 µm of the cut, 0.5 of each touch, and the remaining rotation.
        let bore = bore(&session);
        assert_eq!(bore.aligned_to, ["A", "B", "C"]);
        assert!(bore.position < 4e-6, "{:.1} µm", bore.position * 1e6);
    }
}

/// The same bore without the offsets lies off by what the part does: nothing else puts it right.
#[test]
fn without_work_offsets_the_bore_lies_off_by_as_much_as_the_part() {
    let session =
        made(|text| text.replace("tolerance_mm = 0.010, limit", "tolerance_mm = 0.900, limit"));
    assert!(written(&session).is_empty());
    let off = bore(&session).position * 1e6;
    let part = f64::hypot(310.0, 180.0);
    assert!((off - part).abs() < 6.0, "{off:.1} against {part:.1} µm");
}

#[test]
fn a_part_that_offsets_cannot_put_right_stops_and_nothing_is_written() {
    let turned = clamped([50.0, 0.0, 0.0], [0.0, 0.0, 2000.0]);
    let far = clamped([1400.0, 0.0, 0.0], [0.0; 3]);
    let far_back = made(|text| {
        let text = text.replace("limit_mm = 1.0", "limit_mm = 0.5");
        text.replace("[310.0, -180.0, 95.0]", "[-640.0, 0.0, 0.0]")
    });
    for (session, why) in [
        (turned, "µrad: clamp it again"),
        (far, "µm, beyond ±1000.0 µm"),
        (far_back, "µm, beyond ±500.0 µm"),
    ] {
        let report: PartReport = session.last(topics::PART_REPORTS);
        assert_eq!(report.verdict, PartReport::STOPPED);
        assert!(report.text.contains(why), "{}", report.text);
        assert!(written(&session).is_empty());
        assert_eq!(report.passes, 0, "nothing was cut");
    }
}

#[test]
fn work_offsets_wait_for_an_operator_where_the_cell_file_says_so() {
    let asking = cell("clamped_casting.toml", |text| {
        text.replace("automatic_approval = true", "automatic_approval = false")
    });
    let mut session = Session::new(&asking);
    session.ask_for("casting_1");
    session.run_to(topics::PASS_DECISIONS);
    session.run_s(5.0);
    let proposed: Vec<Correction> = session.all(topics::CORRECTIONS);
    assert_eq!(proposed.len(), 3);
    assert!(written(&session).is_empty());
    for one in &proposed {
        session.answer(one, true);
    }
    session.wait_for_report();
    let report: PartReport = session.last(topics::PART_REPORTS);
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    assert_eq!(written(&session).len(), 3);
}

#[test]
fn work_offsets_of_axes_that_cannot_have_them_are_refused_when_the_cell_file_is_read() {
    let shipped = cell("clamped_casting.toml", str::to_owned);
    for (old, new, says) in [
        (
            "work_offset_axes = [\"X\", \"Y\", \"Z\"]",
            "work_offset_axes = [\"X\", \"Y\"]",
            "compensation.work_offset.axes: \"Z\" is not one of simulator.machine.work_offset_axes",
        ),
        (
            "work_offset = { axes = [\"X\", \"Y\", \"Z\"]",
            "work_offset = { axes = [\"X\", \"X\"]",
            "\"X\" is not a linear axis of the machine, or is listed twice",
        ),
        (
            "alignment = { datums = [\"A\", \"B\", \"C\"] }",
            "",
            "compensation.work_offset needs analysis.alignment",
        ),
        (
            "limit_mm = 1.0",
            "limit_mm = -1.0",
            "work_offset.limit_mm = -1",
        ),
    ] {
        let text = shipped.text().clone();
        let edited = text.cell.replace(old, new);
        assert_ne!(edited, text.cell, "{old}");
        match Cell::from_text(CellText {
            cell: edited,
            ..text
        }) {
            Ok(_) => panic!("{new} was taken"),
            Err(error) => assert!(error.to_string().contains(says), "{error}"),
        }
    }
}
