//! Pictures of drives: effort or motion against the model, and the residuals against time, position and speed.

use crate::kit::{Axis, Page, Plot, PlotError, Series, Unit};
use ::diagnosis::residuals::DriveResiduals;

/// A step longer than this many usual steps is a gap.
const GAP: f64 = 2.5;

/// Adds the pictures of every axis of every session that judges.
pub(crate) fn pictures(page: &mut Page, drives: &[DriveResiduals]) -> Result<(), PlotError> {
    if drives.is_empty() {
        return Ok(());
    }
    page.heading("Measured against the model");
    page.paragraph(
        "Before: measured minus nominal model. After: measured minus the model with all named effects, fitted without \
         that part of the record.",
    );
    for drive in drives {
        page.plots(&of_axis(drive))?;
    }
    Ok(())
}

fn of_axis(drive: &DriveResiduals) -> Vec<Plot> {
    let name = format!("{}, axis {}", drive.session, drive.axis.name);
    let (place, speed) = if drive.axis.turns {
        (Unit::DEG, Unit::plain("rad/s"))
    } else {
        (Unit::MM, Unit::MM_PER_MIN)
    };
    // An effort of no declared unit.
    let unit = match drive.unit.as_str() {
        "effort" => Unit::ONE,
        unit => Unit::of_si(unit),
    };
    let motion = matches!(drive.unit.as_str(), "m" | "rad" | "m or rad");
    let quantity = if motion { "position error" } else { "effort" };
    let pairs = |x: &[f64], y: &[f64]| -> Vec<(f64, f64)> {
        x.iter().copied().zip(y.iter().copied()).collect()
    };
    let over_time = |values: &[f64]| interrupted(&drive.time, values);
    let model = |residuals: &[f64]| -> Vec<f64> {
        let pairs = drive.measured.iter().zip(residuals);
        pairs
            .map(|(measured, residual)| measured - residual)
            .collect()
    };
    let residual = || Axis::new("residual", unit.clone()).showing(0.0, 0.0);
    let against = |label: &str, unit: Unit, x: &[f64]| {
        Plot::new(
            format!("{name}: against {label}"),
            Axis::new(label, unit),
            residual(),
        )
        .with(Series::points("before", pairs(x, &drive.before)))
        .with(Series::points("after", pairs(x, &drive.after)))
    };
    vec![
        Plot::new(
            format!("{name}: {quantity}"),
            Axis::new("time", Unit::S),
            Axis::new(quantity, unit.clone()),
        )
        .with(Series::line("measured", over_time(&drive.measured)))
        .with(Series::line(
            "model with the effects",
            over_time(&model(&drive.after)),
        ))
        .with(Series::line(
            "nominal model",
            over_time(&model(&drive.before)),
        )),
        against("time", Unit::S, &drive.time),
        against("position", place, &drive.position),
        against("speed", speed, &drive.speed),
    ]
}

/// Values over time with a break where the record has a gap.
fn interrupted(time: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let longest = GAP * steps.get(steps.len() / 2).copied().unwrap_or(f64::INFINITY);
    let mut points = Vec::with_capacity(values.len());
    let mut last = f64::INFINITY;
    for (&time, &value) in time.iter().zip(values) {
        if time - last > longest {
            points.push((f64::NAN, f64::NAN));
        }
        points.push((time, value));
        last = time;
    }
    points
}
