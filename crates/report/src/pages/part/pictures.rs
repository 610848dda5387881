//! Pictures of the page of a session: what each feature deviated by, from the first measurement of a pass to the last.

use std::collections::BTreeMap;

use probecell_msgs::{Correction, InspectionFeature, InspectionPlan, PlanId, RunId};

use crate::kit::{Axis, Page, Plot, PlotError, Series, Strip, Strips, Unit};

use super::PartSession;

/// A feature of so many touches is drawn along them.
const ALONG: usize = 12;
/// Rows of one picture by feature.
const ROWS: usize = 20;

/// Deviations (m) of a measurement by point of its plan; of a point touched several times the mean.
fn deviations(session: &PartSession, plan: &InspectionPlan) -> BTreeMap<usize, f64> {
    let mut touched: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for touch in session
        .touches
        .iter()
        .filter(|one| one.plan_id == plan.plan_id)
    {
        let point = touch.point_index as usize;
        touched.entry(point).or_default().push(touch.deviation);
    }
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
    touched
        .iter()
        .map(|(point, all)| (*point, mean(all)))
        .collect()
}

/// The run that a plan measures.
fn run(plan: &InspectionPlan) -> RunId {
    PlanId::from(&plan.plan_id).run()
}

/// Adds, for every pass, the deviations of its first and its last measurement, feature by feature.
pub(super) fn before_and_after(page: &mut Page, session: &PartSession) -> Result<(), PlotError> {
    let mut passes: Vec<(&InspectionPlan, &InspectionPlan)> = Vec::new();
    for plan in &session.plans {
        match passes.iter_mut().find(|(first, _)| run(first) == run(plan)) {
            Some((_, last)) => *last = plan,
            None => passes.push((plan, plan)),
        }
    }
    let (mut strips, mut plots) = (Vec::new(), Vec::new());
    for (first, last) in passes {
        let corrected = first.plan_id != last.plan_id;
        let mut measured = vec![(
            if corrected {
                "before correction"
            } else {
                "measured"
            },
            first,
        )];
        if corrected {
            measured.push(("after correction", last));
        }
        strips.extend(by_feature(session, first, &measured));
        plots.extend(along(session, first, &measured));
    }
    if !(strips.is_empty() && plots.is_empty()) {
        page.heading("Deviations").strips(&strips)?.plots(&plots)?;
    }
    Ok(())
}

type Measured<'a> = [(&'static str, &'a InspectionPlan)];

fn by_feature(
    session: &PartSession,
    plan: &InspectionPlan,
    measured: &Measured<'_>,
) -> Vec<Strips> {
    let count = plan.features.len();
    let pages = (0..count)
        .step_by(ROWS)
        .map(|from| from..(from + ROWS).min(count));
    let strips = pages.map(|range| {
        let kinds = measured.iter().map(|(label, own)| {
            let all = deviations(session, own);
            let values = all.iter().filter_map(|(point, deviation)| {
                let feature = own.points.get(*point)?.feature as usize;
                Some((
                    range.contains(&feature).then(|| feature - range.start)?,
                    *deviation,
                ))
            });
            Strip {
                label: (*label).to_owned(),
                values: values.collect(),
            }
        });
        Strips {
            title: format!("{} by feature", run(plan)),
            axis: Axis::new("deviation", Unit::UM).showing(0.0, 0.0),
            strips: kinds.collect(),
            rows: plan.features[range.clone()]
                .iter()
                .map(|one| one.id.clone())
                .collect(),
            caption: "Each dot is a touch, along the outward normal; bars are means.".to_owned(),
        }
    });
    strips.collect()
}

fn along(session: &PartSession, plan: &InspectionPlan, measured: &Measured<'_>) -> Vec<Plot> {
    let mut plots = Vec::new();
    for (number, feature) in plan.features.iter().enumerate() {
        let of = |own: &InspectionPlan| -> Vec<usize> {
            let points = own.points.iter().enumerate();
            let points = points.filter(|(_, point)| point.feature as usize == number);
            points.map(|(index, _)| index).collect()
        };
        if of(plan).len() < ALONG {
            continue;
        }
        let mut plot = Plot::new(
            format!("{} along {}", run(plan), feature.id),
            Axis::new("point of the plan", Unit::ONE),
            Axis::new("deviation", Unit::UM).showing(0.0, 0.0),
        );
        for (label, own) in measured {
            let all = deviations(session, own);
            let series = (1..).zip(of(own));
            let series =
                series.filter_map(|(place, point)| Some((f64::from(place), *all.get(&point)?)));
            plot = plot.with(Series::points(*label, series.collect()));
        }
        for limit in limits(feature) {
            plot = plot.with(Series::level("tolerance", limit));
        }
        plots.push(plot);
    }
    plots
}

fn limits(feature: &InspectionFeature) -> Vec<f64> {
    // Of another feature the limits are those of its size, not of a place on it.
    if !matches!(
        feature.kind,
        InspectionFeature::PROFILE | InspectionFeature::SURFACE
    ) {
        return Vec::new();
    }
    let both = [feature.lower_tolerance, feature.upper_tolerance];
    let stated =
        both.iter().any(|limit| *limit != 0.0) && both.iter().all(|limit| limit.is_finite());
    if stated { both.to_vec() } else { Vec::new() }
}

/// The tool paths that a measurement led to.
pub(super) fn paths(session: &PartSession, plan: &InspectionPlan) -> Vec<Plot> {
    let own = session.corrections.iter().filter(|one| {
        one.plan_id == plan.plan_id && one.kind == Correction::TOOL_PATH && !one.path.is_empty()
    });
    let plots = own.map(|one| {
        let points = (1..)
            .zip(&one.path)
            .map(|(place, offset)| (f64::from(place), *offset));
        Plot::new(
            format!("Tool path, correction {}", one.correction_id),
            Axis::new("point of the plan", Unit::ONE),
            Axis::new("offset along the outward normal", Unit::UM).showing(0.0, 0.0),
        )
        .with(Series::line("", points.collect()))
    });
    plots.collect()
}
