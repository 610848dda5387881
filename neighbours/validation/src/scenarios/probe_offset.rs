//! A-probe-offset: an uncalibrated probe adds 2e to every size, so the machine sees good parts that are undersized.
//!
//! Three punches before and three after the calibration of the probe, made by the turn-mill cell on virtual time. The
//! source's tables are replayed as they are recorded, too. µm.

use metrology::decision::{Case, DecisionLimits, Policy, Side, Verdict, decide};
use metrology::size_gap::{GapLaw, SizeGap, size_gap};

use report::{Axis, Plot, Series, Table, Unit};

use crate::scenarios::turn_mill::{ProbeState, SIZES, make};
use crate::scenarios::{Expected, Figure, Outcome, Recorded, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "A-probe-offset",
    effect: "uncalibrated ball position and radius: +2e on every size",
    source: "tables 3 and 4: the reference's mean error falls from -68.2 to -4.4 µm (93.5 %), its largest from 73 to 6; \
             the gap between machine and reference from 71.0 to 6.2 µm (91.3 %)",
    run,
    sessions: Some(sessions),
};

/// Punches whose mean the tables give.
const PUNCHES: u64 = 3;
/// µm; |error| that the drawing allows.
const TOLERANCE: f64 = 10.0;

/// Tables 3 and 4 of the source: sizes in mm as the machine read them and as the reference found them.
struct Recording {
    machine: [f64; 5],
    reference: [f64; 5],
}

const BEFORE: Recording = Recording {
    machine: [19.805, 23.506, 17.803, 17.798, 17.802],
    reference: [19.730, 23.441, 17.730, 17.731, 17.727],
};
const AFTER: Recording = Recording {
    machine: [19.801, 23.502, 17.802, 17.803, 17.801],
    reference: [19.795, 23.496, 17.796, 17.797, 17.794],
};

/// Errors of the five sizes, µm: (machine, reference).
type Errors = Vec<(f64, f64)>;

impl Recording {
    fn errors(&self) -> Errors {
        let micro = |size: f64, nominal: f64| ((size - nominal) * 1e3 * 1e3).round() / 1e3;
        SIZES
            .iter()
            .zip(self.machine.iter().zip(&self.reference))
            .map(|((_, _, nominal), (read, found))| {
                (micro(*read, *nominal), micro(*found, *nominal))
            })
            .collect()
    }
}

fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.into_iter().collect();
    values.iter().sum::<f64>() / values.len() as f64
}

fn gaps(errors: &Errors) -> Vec<f64> {
    errors.iter().map(|(read, found)| read - found).collect()
}

fn by_reference(errors: &Errors) -> Vec<f64> {
    errors.iter().map(|(_, found)| *found).collect()
}

fn by_machine(errors: &Errors) -> Vec<f64> {
    errors.iter().map(|(read, _)| *read).collect()
}

/// Constant or proportion: the law of the gaps over the sizes.
fn law(errors: &Errors) -> Result<SizeGap, ScenarioError> {
    let pairs: Vec<(f64, f64)> = SIZES
        .iter()
        .zip(gaps(errors))
        .map(|((_, _, nominal), gap)| (nominal * 1e-3, gap * 1e-6))
        .collect();
    Ok(size_gap(&pairs)?)
}

fn law_name(law: GapLaw) -> &'static str {
    match law {
        GapLaw::Offset => "offset",
        GapLaw::Scale => "scale",
        GapLaw::Undecided => "undecided",
        GapLaw::Neither => "neither",
    }
}

/// The decision table's verdict on sizes with these errors (µm); the one word if all agree.
fn verdict(errors: &[f64]) -> Result<String, ScenarioError> {
    let mut found: Vec<Verdict> = Vec::new();
    for ((_, _, nominal), error) in SIZES.iter().zip(errors) {
        let drawing = nominal * 1e-3;
        let case = Case {
            size: Some(drawing + error * 1e-6),
            nominal: drawing,
            side: Side::Outer,
            wear: 0.0,
            corrections: 0,
        };
        let decision = decide(&case, &DecisionLimits::default(), Policy::Compensate)?;
        if !found.contains(&decision.verdict) {
            found.push(decision.verdict);
        }
    }
    let names = found.iter().map(|verdict| match verdict {
        Verdict::Qualified => "qualified",
        Verdict::OvercutNotCompensable => "overcut, not compensable",
        Verdict::Compensable => "compensable",
        _ => "other",
    });
    Ok(names.collect::<Vec<_>>().join("; "))
}

/// Means over the punches.
fn made(probe: ProbeState, run: &Run<'_>, begin: u64) -> Result<Errors, ScenarioError> {
    let mut sums = vec![(0.0, 0.0); SIZES.len()];
    for punch in 0..PUNCHES {
        let part = make(probe, run.seed.wrapping_add(punch), &str::to_owned)?;
        if !part.qualified() {
            return Err(ScenarioError::Course(format!(
                "the turn-mill did not finish punch {punch}: {}",
                part.report.text
            )));
        }
        for (sum, error) in sums.iter_mut().zip(part.errors_um()?) {
            sum.0 += error.0 / PUNCHES as f64;
            sum.1 += error.1 / PUNCHES as f64;
        }
        run.done((begin + punch + 1) as usize, 2 * PUNCHES as usize);
    }
    Ok(sums)
}

fn run(run: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let before = made(ProbeState::Uncalibrated, run, 0)?;
    let after = made(ProbeState::Calibrated, run, PUNCHES)?;
    let recorded = (BEFORE.errors(), AFTER.errors());
    let (law_before, law_recorded) = (law(&before)?, law(&recorded.0)?);
    let reduction = |first: f64, last: f64| 100.0 * (1.0 - last / first);
    let reference_means = (mean(by_reference(&before)), mean(by_reference(&after)));
    let gap_means = (mean(gaps(&before)), mean(gaps(&after)));
    let recorded_means = (
        mean(by_reference(&recorded.0)),
        mean(by_reference(&recorded.1)),
    );
    let recorded_gaps = (mean(gaps(&recorded.0)), mean(gaps(&recorded.1)));
    let figures = vec![
        Figure::new(
            "reference_mean_before_um",
            "mean error by the reference, before",
            "µm",
            reference_means.0,
        )
        .source(-68.2)
        .rule(Rule::Near(6.0)),
        Figure::new(
            "reference_mean_after_um",
            "mean error by the reference, after",
            "µm",
            reference_means.1,
        )
        .source(-4.4)
        .rule(Rule::Near(3.2)),
        Figure::new(
            "reference_reduction_percent",
            "reduction of that mean",
            "%",
            reduction(reference_means.0, reference_means.1),
        )
        .source(93.5),
        Figure::new(
            "gap_mean_before_um",
            "mean gap, machine less reference, before",
            "µm",
            gap_means.0,
        )
        .source(71.0)
        .rule(Rule::Near(2.0)),
        Figure::new("gap_mean_after_um", "mean gap after", "µm", gap_means.1)
            .source(6.2)
            .rule(Rule::Near(2.0)),
        Figure::new(
            "gap_reduction_percent",
            "reduction of the mean gap",
            "%",
            reduction(gap_means.0, gap_means.1),
        )
        .source(91.3),
        Figure::new(
            "gaps_before_um",
            "gap of D1, D2, L1, L2, L3, before",
            "µm",
            gaps(&before),
        )
        .source(gaps(&recorded.0))
        .rule(Rule::Near(2.0)),
        Figure::new(
            "gaps_after_um",
            "gap of D1, D2, L1, L2, L3, after",
            "µm",
            gaps(&after),
        )
        .source(gaps(&recorded.1))
        .rule(Rule::Near(2.0)),
        Figure::new(
            "machine_errors_before_um",
            "error that the machine reads, before",
            "µm",
            by_machine(&before),
        )
        .source(by_machine(&recorded.0))
        .rule(Rule::SizeAtMost(TOLERANCE)),
        Figure::new(
            "reference_errors_before_um",
            "error by the reference, before",
            "µm",
            by_reference(&before),
        )
        .source(by_reference(&recorded.0))
        .rule(Rule::Below(-50.0)),
        Figure::new(
            "machine_errors_after_um",
            "error that the machine reads, after",
            "µm",
            by_machine(&after),
        )
        .source(by_machine(&recorded.1))
        .rule(Rule::SizeAtMost(TOLERANCE)),
        Figure::new(
            "reference_errors_after_um",
            "error by the reference, after",
            "µm",
            by_reference(&after),
        )
        .source(by_reference(&recorded.1))
        .rule(Rule::SizeAtMost(TOLERANCE)),
        Figure::new(
            "law",
            "gap against size: constant and proportional part",
            "",
            law_name(law_before.law),
        )
        .source("offset")
        .rule(Rule::Equals("offset".into())),
        Figure::new(
            "offset_squares_um2",
            "residual squares of a constant, recorded gaps",
            "µm²",
            law_recorded.offset_squares * 1e12,
        )
        .source(88.0)
        .rule(Rule::Near(0.5)),
        Figure::new(
            "scale_squares_um2",
            "residual squares of a proportion, recorded gaps",
            "µm²",
            law_recorded.scale_squares * 1e12,
        )
        .source(605.0)
        .rule(Rule::Near(0.5)),
        Figure::new(
            "machine_verdict_before",
            "verdict on the machine's reading, before",
            "",
            verdict(&by_machine(&before))?,
        )
        .rule(Rule::Equals("qualified".into())),
        Figure::new(
            "reference_verdict_before",
            "verdict on the reference's size, before",
            "",
            verdict(&by_reference(&before))?,
        )
        .rule(Rule::Equals("overcut, not compensable".into())),
        Figure::new(
            "recorded_means_um",
            "recorded tables: reference mean before, after; gap before, after",
            "µm",
            [
                recorded_means.0,
                recorded_means.1,
                recorded_gaps.0,
                recorded_gaps.1,
            ],
        )
        .source([-68.2, -4.4, 71.0, 6.2])
        .rule(Rule::Near(1e-9)),
    ];
    Ok(Outcome {
        figures,
        plots: plots(&before, &after),
        tables: vec![table(&before, &after, &recorded)],
        remarks: vec![
            "The source prints +7 µm for D2 before; its sizes give +6, and so does its own maximum.".to_owned(),
        ],
    })
}

fn plots(before: &Errors, after: &Errors) -> Vec<Plot> {
    let drawn = |title: &str, errors: &Errors| {
        let series = |name: &str, values: Vec<f64>| {
            let points = values.iter().enumerate();
            Series::points(
                name,
                points.map(|(i, v)| ((i + 1) as f64, v * 1e-6)).collect(),
            )
        };
        Plot::new(
            title,
            Axis::named("size", SIZES.map(|(size, _, _)| size)),
            Axis::new("error", Unit::UM),
        )
        .with(series("machine", by_machine(errors)))
        .with(series("reference", by_reference(errors)))
        .with(Series::level("tolerance", TOLERANCE * 1e-6))
        .with(Series::level("tolerance", -TOLERANCE * 1e-6))
    };
    vec![
        drawn("Sizes before the calibration of the probe", before),
        drawn("Sizes after it", after),
    ]
}

fn table(before: &Errors, after: &Errors, recorded: &(Errors, Errors)) -> Table {
    let mut table = Table::new(
        "Errors against the drawing in µm, means of three punches; source: machine / reference",
        &[
            "size",
            "machine before",
            "reference before",
            "source",
            "machine after",
            "reference after",
            "source",
        ],
    );
    let pair = |(read, found): (f64, f64)| format!("{read:+.0} / {found:+.0}");
    for (i, (name, _, nominal)) in SIZES.iter().enumerate() {
        table.row(vec![
            format!("{name} = {nominal} mm"),
            format!("{:+.1}", before[i].0),
            format!("{:+.1}", before[i].1),
            pair(recorded.0[i]),
            format!("{:+.1}", after[i].0),
            format!("{:+.1}", after[i].1),
            pair(recorded.1[i]),
        ]);
    }
    table
}

/// The last measurement of a punch before and after the calibration, with the reference's.
fn sessions(seed: u64) -> Result<Vec<Recorded>, ScenarioError> {
    let one = |probe, name: &'static str, share| -> Result<Recorded, ScenarioError> {
        let part = make(probe, seed, &str::to_owned)?;
        Ok(Recorded {
            name,
            session: part.session_with_reference(&format!("A-probe-offset, {name}"))?,
            expected: Expected::Effects(&["probe.ball_radius"], share),
        })
    };
    Ok(vec![
        one(ProbeState::Uncalibrated, "before", 0.1)?,
        one(ProbeState::Calibrated, "after", 0.5)?,
    ])
}
