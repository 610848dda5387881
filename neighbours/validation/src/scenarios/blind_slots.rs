//! D-blind: slots cannot see a turn of the part about the tool axis; one corner step can.
//!
//! A slot's halves have the same tool axis in the part, and EC0B turns the part about it: both halves move alike. The
//! same holds for touches at the slots' indices, so that a session of slots shows no gap although EC0B is there.

use machine::{ChainErrors, LinkError};
use machining::mismatch::{LINKS, MismatchTest, PatternKind, condition, rank, standard_patterns};
use report::{Axis, Plot, Series, Unit};

use crate::scenarios::five_axis::{links, session, test};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "D-blind",
    effect: "EC0B, seen by slots only",
    source: "any set of slots has rank 7 of 8; a corner step makes it 8",
    run,
    sessions: Some(sessions),
};

/// The hidden error: 50 µrad.
const HIDDEN: (&str, f64) = ("EC0B", 50e-6);

/// The slots alone, or with the first `steps` corner steps.
fn patterns(steps: usize) -> Result<MismatchTest, ScenarioError> {
    let (slots, corners): (Vec<_>, Vec<_>) = standard_patterns()
        .into_iter()
        .partition(|pattern| pattern.kind == PatternKind::Slot);
    test(
        slots
            .into_iter()
            .chain(corners.into_iter().take(steps))
            .collect(),
    )
}

fn run(_: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let mut ranks = Vec::new();
    let mut conditions = Vec::new();
    let mut shown = Vec::new();
    for steps in 0..=2 {
        let test = patterns(steps)?;
        let matrix = test.sensitivity(&links(test.chain(), |_| 1.0)?);
        ranks.push(rank(&matrix) as f64);
        conditions.push(condition(&matrix));
        let blind = LINKS
            .iter()
            .position(|(name, _)| *name == HIDDEN.0)
            .unwrap_or_default();
        shown.push(matrix.column(blind).norm());
    }
    let figures = vec![
        Figure::new(
            "rank_slots_one_step_two",
            "rank of slots, with one corner step, with two",
            "",
            ranks,
        )
        .source([7.0, 8.0, 8.0])
        .rule(Rule::Near(0.0)),
        Figure::new(
            "condition_one_step_two",
            "condition with one corner step, with two",
            "",
            conditions[1..].to_vec(),
        ),
        Figure::new(
            "slots_show_um",
            "mismatch of all slots for 50 µrad EC0B",
            "µm",
            shown[0] * 1e6,
        )
        .source(0.0)
        .rule(Rule::AtMost(1e-9)),
    ];
    let signature: Vec<(f64, f64)> = (0..3)
        .map(|steps| (f64::from(steps) + 1.0, shown[steps as usize]))
        .collect();
    Ok(Outcome {
        figures,
        plots: vec![
            Plot::new(
                "What shows of 50 µrad EC0B",
                Axis::named("corner steps beside five slots", ["0", "1", "2"]),
                Axis::new("mismatch, root of the sum of squares", Unit::UM),
            )
            .with(Series::points("", signature)),
        ],
        tables: Vec::new(),
        remarks: vec![
            "A session of slots with EC0B inside has no gap: the honest answer, since nothing that was measured depends on it.".to_owned(),
        ],
    })
}

fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let record = |name, steps, expected| -> Result<Recorded, ScenarioError> {
        let test = patterns(steps)?;
        let hidden = LinkError::named(test.chain(), HIDDEN.0, HIDDEN.1)?;
        let errors = ChainErrors::of_links(test.chain(), &[hidden]);
        Ok(Recorded {
            name,
            session: session(name, &test, &errors, &[], seed)?,
            expected,
        })
    };
    Ok(vec![
        record("slots", 0, Expected::NoGap)?,
        record("slots_and_steps", 2, Expected::Effects(&["link.EC0B"], 0.8))?,
    ])
}
