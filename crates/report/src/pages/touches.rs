//! Figures of touches: deviations on the part, and against every coordinate on which a cause could depend.

use crate::kit::{Axis, Page, Plot, PlotError, Series, Strip, Strips, Unit};
use ::diagnosis::residuals::{TouchResidual, TouchResiduals};

use crate::pages::part_view::{Deviation, view};

/// A coordinate that varies less than this over the touches is constant (m, rad, s, m/s).
const STANDS: f64 = 1e-6;
/// Arrows are scaled so that this share of them is not longer than the longest.
const MOST: f64 = 0.98;
/// After the effects the arrows get a scale of their own when they shrink by more than this.
const SHRUNK: f64 = 3.0;
/// Rows of a picture by feature.
const MAX_FEATURES: usize = 40;

/// Adds the pictures of one comparison.
pub(crate) fn pictures(page: &mut Page, touches: &TouchResiduals) -> Result<(), PlotError> {
    page.heading(&format!("On the part: {}", touches.compared));
    let outliers = touches.touches.iter().filter(|touch| touch.after.is_none());
    let outliers: Vec<String> = outliers.map(|touch| touch.sequence.to_string()).collect();
    if !outliers.is_empty() {
        page.paragraph(&format!(
            "Outliers, omitted from the figures “after”: touches with sequence number {}.",
            outliers.join(", ")
        ));
    }
    page.plots(&on_the_part(touches))?;
    page.heading(&format!(
        "Dependence on the coordinates: {}",
        touches.compared
    ));
    page.paragraph(
        "Each dot is a touch. Before: residual of the declared model. After: residual of the model with all named effects, \
         fitted without the touch; what is explained then scatters around zero.",
    );
    let (plots, constant) = against_coordinates(touches);
    page.plots(&plots)?;
    page.strips(&by_name(touches))?;
    if !constant.is_empty() {
        page.paragraph(&format!(
            "Not drawn, since constant over the touches: {}.",
            constant.join(", ")
        ));
    }
    Ok(())
}

fn on_the_part(touches: &TouchResiduals) -> Vec<Plot> {
    let pick = |size: &dyn Fn(&TouchResidual) -> Option<f64>| -> Vec<Deviation> {
        let judged = touches.touches.iter().filter(|touch| touch.after.is_some());
        judged
            .filter_map(|touch| {
                Some(Deviation {
                    position: touch.position,
                    normal: touch.normal,
                    size: size(touch)?,
                })
            })
            .collect()
    };
    let (before, after) = (
        pick(&|touch| Some(touch.before)),
        pick(&|touch| touch.after),
    );
    let (scale, own) = (usual(&before), usual(&after));
    let mut plots = vec![
        view(
            "Deviations before",
            "Measured minus nominal along the surface normal; parallel projection, seen from +x, −y, +z of the part. \
             The horizontal arrow is the scale of the arrows.",
            &before,
            scale,
        ),
        view(
            "Deviations after, same scale",
            "Residuals of the model with all named effects.",
            &after,
            scale,
        ),
    ];
    if scale > SHRUNK * own {
        plots.push(view(
            "Deviations after, enlarged",
            "The same residuals with arrows on a larger scale.",
            &after,
            own,
        ));
    }
    plots
}

/// A size that [`MOST`] of the deviations do not exceed, m.
fn usual(deviations: &[Deviation]) -> f64 {
    let mut sizes: Vec<f64> = deviations.iter().map(|one| one.size.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let index = (MOST * sizes.len() as f64) as usize;
    sizes
        .get(index.min(sizes.len().saturating_sub(1)))
        .copied()
        .unwrap_or(0.0)
}

/// A coordinate of a touch.
struct Coordinate<'a> {
    name: String,
    unit: Unit,
    at: Box<dyn Fn(&TouchResidual) -> f64 + 'a>,
}

fn coordinates(touches: &TouchResiduals) -> Vec<Coordinate<'_>> {
    let mut all: Vec<Coordinate<'_>> = Vec::new();
    for (index, axis) in touches.axes.iter().enumerate() {
        all.push(Coordinate {
            name: if axis.turns {
                format!("angle of axis {}", axis.name)
            } else {
                format!("position of axis {}", axis.name)
            },
            unit: if axis.turns { Unit::DEG } else { Unit::MM },
            at: Box::new(move |touch| touch.positions.get(index).copied().unwrap_or(f64::NAN)),
        });
    }
    all.push(Coordinate {
        name: "time from the start".to_owned(),
        unit: Unit::S,
        at: Box::new(|touch| touch.time),
    });
    all.push(Coordinate {
        name: "feed of approach".to_owned(),
        unit: Unit::MM_PER_MIN,
        at: Box::new(|touch| touch.feed),
    });
    all
}

/// Plots against every coordinate that varies, and the values of those that do not.
fn against_coordinates(touches: &TouchResiduals) -> (Vec<Plot>, Vec<String>) {
    let (mut plots, mut constant) = (Vec::new(), Vec::new());
    for Coordinate { name, unit, at } in coordinates(touches) {
        let values = touches.touches.iter().map(&at);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        if !(high - low > STANDS) {
            if low.is_finite() {
                constant.push(format!("{name} ({})", unit.text(low)));
            }
            continue;
        }
        let before = (touches.touches.iter()).map(|touch| (at(touch), touch.before));
        let after = (touches.touches.iter()).filter_map(|touch| Some((at(touch), touch.after?)));
        plots.push(
            Plot::new(
                format!("Against the {name}"),
                Axis::new(name.clone(), unit),
                Axis::new("deviation", Unit::UM).showing(0.0, 0.0),
            )
            .with(Series::points("before", before.collect()))
            .with(Series::points("after", after.collect())),
        );
    }
    (plots, constant)
}

/// By feature and by direction of approach.
fn by_name(touches: &TouchResiduals) -> Vec<Strips> {
    let features = &touches.features;
    let used: Vec<usize> = (0..features.len())
        .filter(|feature| {
            touches
                .touches
                .iter()
                .any(|touch| touch.feature == *feature)
        })
        .collect();
    let shown: Vec<String> = (used.iter().take(MAX_FEATURES))
        .map(|&feature| features[feature].clone())
        .collect();
    let caption = if used.len() > MAX_FEATURES {
        format!("The first {MAX_FEATURES} of {} features.", used.len())
    } else {
        String::new()
    };
    let row = |touch: &TouchResidual| used.iter().position(|feature| *feature == touch.feature);
    let mut directions: Vec<&'static str> = touches
        .touches
        .iter()
        .map(TouchResidual::direction)
        .collect();
    directions.sort_unstable();
    directions.dedup();
    let side = |touch: &TouchResidual| {
        let own = touch.direction();
        directions.iter().position(|direction| *direction == own)
    };
    vec![
        strips(touches, "By feature", shown, &row, caption),
        strips(
            touches,
            "By direction of the surface touched",
            directions.iter().map(|&name| name.to_owned()).collect(),
            &side,
            "The largest component of the outward normal, part frame; the probe approaches against it. Bars are \
             means."
                .to_owned(),
        ),
    ]
}

fn strips(
    touches: &TouchResiduals,
    title: &str,
    rows: Vec<String>,
    row: &dyn Fn(&TouchResidual) -> Option<usize>,
    caption: String,
) -> Strips {
    let strip = |label: &str, value: &dyn Fn(&TouchResidual) -> Option<f64>| Strip {
        label: label.to_owned(),
        values: (touches.touches.iter())
            .filter_map(|touch| Some((row(touch)?, value(touch)?)))
            .collect(),
    };
    Strips {
        title: title.to_owned(),
        axis: Axis::new("deviation", Unit::UM).showing(0.0, 0.0),
        strips: vec![
            strip("before", &|touch| Some(touch.before)),
            strip("after", &|touch| touch.after),
        ],
        rows,
        caption,
    }
}
