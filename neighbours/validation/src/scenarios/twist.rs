//! E-twist: one normal per cutter location, as the source has it, is exact on a cone and wrong on a twisted surface.
//!
//! The surface by (5) and (7) against the true envelope, at heights 0 to 45 mm on 401 locations. µm.

use machining::flank::runout::test_heights;
use machining::flank::{
    FlankPath, RuledPart, SPiece, contact_point, envelope_normal, material_left, path_normal,
};
use metrology::statistics::rms;

use crate::scenarios::flank::{Parts, case, map, map_plot};
use crate::scenarios::{Figure, Outcome, Rule, Run, Scenario, ScenarioError};

pub(crate) const SCENARIO: Scenario = Scenario {
    name: "E-twist",
    effect: "one normal per cutter location on a twisted ruled surface",
    source: "S piece: up to 72 µm, rms 15.5; axis offset at mid height overcuts 12.3 instead of 60.8 µm; a cone is exact",
    run,
    sessions: None,
};

/// Locations along a path, and share of it that is left out at each end.
const LOCATIONS: usize = 401;
const MARGIN: f64 = 0.03;

/// By how much (m) the source's form stands off the envelope at a path parameter and a height.
fn off(path: &impl FlankPath, radius: f64, u: f64, height: f64) -> Option<f64> {
    let location = path.location(u);
    let own = envelope_normal(path, u, height)?;
    let one = path_normal(path, u)?;
    let source = contact_point(&location, &one, height, radius);
    Some(-own.dot(&(source - contact_point(&location, &own, height, radius))))
}

fn inside(path: &impl FlankPath) -> impl Iterator<Item = f64> {
    let (first, last) = path.domain();
    (0..LOCATIONS).map(move |place| {
        let share = MARGIN + (1.0 - 2.0 * MARGIN) * place as f64 / (LOCATIONS - 1) as f64;
        first + (last - first) * share
    })
}

/// Largest and rms difference over a part, m.
fn over(path: &impl FlankPath, radius: f64) -> [f64; 2] {
    let mut heights = test_heights();
    heights.insert(0, 0.0);
    let mut all = Vec::new();
    for u in inside(path) {
        all.extend(
            heights
                .iter()
                .filter_map(|&height| off(path, radius, u, height)),
        );
    }
    [
        all.iter().fold(0.0_f64, |most, off| most.max(off.abs())),
        rms(&all),
    ]
}

/// Deepest overcut (m) of the S piece when the axis is offset along the normal at share `v` of the ruling.
fn overcut(radius: f64, v: f64) -> Result<f64, ScenarioError> {
    let piece = SPiece::offset_along(radius, v)?;
    let mut deepest = 0.0_f64;
    for u in inside(&piece).step_by(4) {
        for height in test_heights()
            .into_iter()
            .filter(|&height| height < piece.ruling(u))
        {
            let (point, outward) = piece.surface(u, height / piece.ruling(u));
            let left =
                material_left(&piece, &|_| radius, &point, &outward, u).ok_or_else(|| {
                    ScenarioError::Course(format!(
                        "no surface is left at parameter {u} of the S piece"
                    ))
                })?;
            deepest = deepest.max(-left);
        }
    }
    Ok(deepest)
}

fn run(_: &Run<'_>) -> Result<Outcome, ScenarioError> {
    let case = case()?;
    let parts = Parts::of(&case)?;
    let radius = case.tool.radius;
    let um = |values: [f64; 2]| values.map(|value| value * 1e6);
    let [cone, _] = over(&parts.cone, radius);
    let heat = map(&parts.s, "off the envelope", |u, v| {
        let height = v * parts.s.ruling(u);
        Ok(off(&parts.s, radius, u, height).unwrap_or(f64::NAN))
    })?;
    Ok(Outcome {
        figures: vec![
            Figure::new("cone_um", "cone: largest difference from the envelope", "µm", cone * 1e6)
                .rule(Rule::AtMost(0.05)),
            Figure::new("s_max_rms_um", "S piece: largest and rms difference from the envelope", "µm", um(over(&parts.s, radius)))
                .source([72.0, 15.5]),
            Figure::new("s_overcut_middle_bottom_um", "S piece: overcut with the axis offset at mid height, at the bottom", "µm", um([overcut(radius, 0.5)?, overcut(radius, 0.0)?]))
                .source([12.3, 60.8]),
        ],
        plots: vec![
            map_plot("S piece: one normal per location, off the envelope", heat).with_caption(
                "Cells by their middles, over the rulings of the piece; the figures take the heights of the planar test, \
                 0 to 45 mm, and the uppermost shows most.",
            ),
        ],
        tables: Vec::new(),
        remarks: vec![
            "The source's grid is not stated; extremes depend on it, so that the S piece is reported and not judged.".to_owned(),
        ],
    })
}
