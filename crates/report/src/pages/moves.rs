//! Pictures of the time of moves: measured against promised, and what is left against time and the travel of each axis.

use crate::kit::{Axis, Page, Plot, PlotError, Series, Unit};
use ::diagnosis::residuals::{MoveResidual, MoveResiduals};

/// Adds the pictures of a session.
pub(crate) fn pictures(page: &mut Page, session: &MoveResiduals) -> Result<(), PlotError> {
    if session.moves.is_empty() {
        return Ok(());
    }
    page.heading("Measured against promised");
    page.paragraph(
        "One dot is the way from one touch to the next. Before: measured minus promised duration. After: measured minus the \
         model with all named effects, fitted without that part of the session.",
    );
    let pairs = |x: &dyn Fn(&MoveResidual) -> f64, y: &dyn Fn(&MoveResidual) -> Option<f64>| {
        let moves = session.moves.iter();
        moves
            .filter_map(|one| Some((x(one), y(one)?)))
            .collect::<Vec<(f64, f64)>>()
    };
    let against = |label: String, unit: Unit, x: &dyn Fn(&MoveResidual) -> f64| {
        Plot::new(
            format!("{}: against {label}", session.session),
            Axis::new(label, unit),
            Axis::new("measured minus model", Unit::MS).showing(0.0, 0.0),
        )
        .with(Series::points("before", pairs(x, &|one| Some(one.before))))
        .with(Series::points("after", pairs(x, &|one| one.after)))
    };
    let mut plots = vec![
        Plot::new(
            format!("{}: measured against promised", session.session),
            Axis::new("promised", Unit::S),
            Axis::new("measured", Unit::S),
        )
        .with(Series::points(
            "measured",
            pairs(&|one| one.promised, &|one| Some(one.measured)),
        ))
        .with(Series::points(
            "model with the effects",
            pairs(&|one| one.promised, &|one| Some(one.measured - one.after?)),
        )),
        against("time".to_owned(), Unit::S, &|one| one.time),
    ];
    for (index, (name, turns)) in session.axes.iter().enumerate() {
        let unit = if *turns { Unit::DEG } else { Unit::MM };
        plots.push(against(format!("travel of {name}"), unit, &|one| {
            one.travel[index]
        }));
    }
    page.plots(&plots)?;
    Ok(())
}
