//! A hidden error of a simulated machine, found in one session, adopted, and absent from the gap of the next one; removed
//! again, it is back.

use bags::Measurement;
use cell::{Cell, CellText, adopt, remove};
use cell_tests::{bag, cell, make_part, messages};
use diagnosis::{Report, Verdict};
use graph::{Published, topics};
use probecell_msgs::{ControllerCommand, GapReport};

/// The cell with another text and another seed of its noise.
fn again(cell: &Cell, text: &str, seed: u64) -> Cell {
    let text = CellText {
        cell: text.replace("seed = 1\n", &format!("seed = {seed}\n")),
        ..cell.text().clone()
    };
    let cell = Cell::from_text(text).unwrap_or_else(|error| panic!("{error}"));
    cell.simulated()
}

/// The node's answer on the last plan of a session, which is that of its recording.
fn measured(cell: &Cell) -> (Report, Vec<Published>) {
    let (_, log) = make_part(cell, "part");
    let live: Vec<GapReport> = messages(&log, topics::GAP_REPORT.name);
    let last = live.last().expect("the node answers");
    let recorded = Report {
        bag: "live".to_owned(),
        ..bag::diagnosis(cell, &log, &Measurement::Last)
    };
    let recorded_text = serde_json::to_string(&recorded).expect("JSON");
    assert_eq!(last.json, recorded_text, "live and from the recording");
    (recorded, log)
}

fn commands(log: &[Published]) -> Vec<(u8, String, Vec<u32>)> {
    let all: Vec<ControllerCommand> = messages(log, topics::CONTROLLER_COMMANDS.name);
    all.into_iter()
        .map(|one| (one.kind, one.operation, one.order))
        .collect()
}

#[test]
fn what_is_adopted_closes_the_next_gap_as_promised_and_comes_back_when_removed() {
    let first = cell("flank_milling.toml", |text| {
        text.replace("at_end_of_plan = false", "at_end_of_plan = true")
    });
    let (found, log) = measured(&first);
    assert_eq!(found.verdict, Verdict::Explained);
    let names: Vec<&str> = found
        .effects
        .iter()
        .map(|one| one.effect.as_str())
        .collect();
    assert_eq!(names, ["process.tool_runout"]);
    assert!(found.declared.is_empty());
    let promised = &found.effects[0];

    let adopted = adopt(&first, &found, &[], false).unwrap_or_else(|error| panic!("{error}"));
    let second = again(&first, &adopted.text, 2);
    let (next, next_log) = measured(&second);
    // Another seed: the touches differ, their residual has the promised size.
    assert!(promised.ci95_after[0] < next.gap.rms && next.gap.rms < promised.ci95_after[1]);
    assert!(next.gap.rms < 0.2 * promised.rms_before);
    assert_eq!(next.verdict, Verdict::NoGap, "{next}");
    let declared = &next.declared[0];
    assert_eq!((next.declared.len(), declared.kept), (1, Some(true)));
    let achieved = declared.achieved.as_ref().expect("one session judges it");
    assert!((achieved.rms_before - promised.rms_before).abs() < 0.1 * promised.rms_before);
    let text = next.to_string();
    for word in ["promised: ", "achieved: ", "the promise is kept"] {
        assert!(text.contains(word), "{text}");
    }
    // The machine receives the same commands as before.
    assert_eq!(commands(&log), commands(&next_log));

    let (text, _) = remove(&second, "process.tool_runout").expect("it is declared");
    let third = again(&first, &text, 2);
    let (back, _) = measured(&third);
    assert_eq!(back.verdict, Verdict::Explained);
    assert_eq!(back.effects[0].effect, "process.tool_runout");
    // The same touches as with the effect declared: the gap is what that session called its size without it.
    assert!((back.gap.rms - achieved.rms_before).abs() < 1e-12);
    assert!(back.declared.is_empty());
}
