//! Draws a plot as SVG: ranges, ticks, legend. The numbers inside are those people read, not SI.

use plotters::coord::{Shift, types::RangedCoordf64};
use plotters::{
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::{
    colours,
    error::{PlotError, failed},
    plot::{Arrow, Axis, Heat, Name, Plot, Series, Side, finite},
    unit::{Unit, number},
};

/// Points of one series beyond which a plot shows fewer: paper shows no more.
const MAX_POINTS: usize = 2500;
/// A series of so many points has them drawn larger.
const FEW_POINTS: usize = 40;
/// Share of the shorter side of the plot that the longest arrow takes.
const LONGEST_ARROW: f64 = 0.15;
/// Sides of an arrow's head against its shaft.
const HEAD: f64 = 0.28;
/// Height of an entry of a legend, and of its frame, CSS pixels. Room is made for it: it covers no data.
pub(crate) const ENTRY: u32 = 17;
pub(crate) const FRAME: u32 = 16;
/// Lines of the grid behind.
pub(crate) const LINE: RGBColor = RGBColor(225, 225, 225);
/// Lines of a frame, and its names.
const GREY: RGBColor = RGBColor(150, 150, 150);
const DARK: RGBColor = RGBColor(70, 70, 70);

pub(crate) type Chart<'a, 'b> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

pub(crate) fn text_style(size: u32) -> FontDesc<'static> {
    (FontFamily::SansSerif, size).into_font()
}

/// A name that fits; the middle of one that has more letters is elided, since names differ at their ends.
pub(crate) fn shortened(name: &str, most: usize) -> String {
    let letters: Vec<char> = name.chars().collect();
    if letters.len() <= most {
        return name.to_owned();
    }
    let half = (most - 1) / 2;
    let (first, last) = (&letters[..half], &letters[letters.len() - half..]);
    first.iter().chain(&['…']).chain(last).collect()
}

/// A range around the values with some air; a single value gets a range around it.
pub(crate) fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
    if low > high {
        return (0.0, 1.0);
    }
    let air = 0.05 * (high - low);
    let air = if air > 1e-12 * low.abs().max(high.abs()).max(1e-300) {
        air
    } else {
        0.5 * low.abs().max(1.0)
    };
    (low - air, high + air)
}

/// An inline element that a screen reader can name.
pub(crate) fn element(svg: &str, title: &str) -> String {
    let title = super::text::escaped(title);
    svg.replacen(
        "<svg ",
        &format!("<svg role=\"img\" aria-label=\"{title}\" "),
        1,
    )
}

pub(crate) fn legend<'a>(
    chart: &mut Chart<'a, 'a>,
    position: SeriesLabelPosition,
) -> Result<(), PlotError> {
    chart
        .configure_series_labels()
        .position(position)
        .background_style(WHITE.mix(0.85))
        .border_style(LINE)
        .label_font(text_style(12))
        .draw()
        .map_err(failed)
}

/// The horizontal axis of a chart of named rows, which has no grid across them.
pub(crate) fn axis_of_rows<'a>(
    chart: &mut Chart<'a, 'a>,
    label: String,
    tick: &dyn Fn(&f64) -> String,
) -> Result<(), PlotError> {
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .x_labels(8)
        .x_desc(label)
        .x_label_formatter(tick)
        .label_style(text_style(13))
        .axis_desc_style(text_style(13))
        .light_line_style(WHITE)
        .bold_line_style(LINE)
        .draw()
        .map_err(failed)
}

impl Plot {
    /// The drawing alone, an `<svg>` element. Values that are not finite are omitted.
    ///
    /// # Errors
    /// [`PlotError`] if nothing can be drawn or a grid is inconsistent.
    pub fn svg(&self) -> Result<String, PlotError> {
        plot(self)
    }
}

fn plot(plot: &Plot) -> Result<String, PlotError> {
    if plot.is_empty() {
        return Err(PlotError::Empty(plot.title.clone()));
    }
    for series in &plot.series {
        if let Series::Heat(heat) = series {
            check(heat)?;
        }
    }
    let (fx, fy) = (plot.x.unit.factor, plot.y.unit.factor);
    let coordinates = || {
        plot.series
            .iter()
            .flat_map(|series| coordinates(series, &plot.x))
    };
    let mut x = range(coordinates().map(|(x, _)| x * fx).chain(least(&plot.x)));
    let mut y = range(coordinates().map(|(_, y)| y * fy).chain(least(&plot.y)));
    let heat = plot.series.iter().find_map(|series| match series {
        Series::Heat(heat) => Some(heat),
        _ => None,
    });
    let right = if heat.is_some() { 86 } else { 14 };
    let (width, height) = plot.size;
    let mut inner = (
        f64::from(width.saturating_sub(64 + right)),
        f64::from(height.saturating_sub(80)),
    );
    if plot.same_scale {
        same_scale(&mut x, &mut y, inner);
    }
    let kinds: Vec<usize> = (0..plot.series.len())
        .map(|index| first_of_its_kind(&plot.series, index))
        .collect();
    let entries = (plot.series.iter().zip(&kinds).enumerate())
        .filter(|(index, (series, kind))| in_legend(series) && index == *kind)
        .count() as u32;
    let legend_height = if entries > 0 {
        entries * ENTRY + FRAME
    } else {
        0
    };
    y.1 += (y.1 - y.0) * f64::from(legend_height) / inner.1;
    inner.1 += f64::from(legend_height);
    let size = (width, height + legend_height);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(&plot.title, text_style(15))
            .margin(8)
            .margin_right(right)
            .x_label_area_size(40)
            .y_label_area_size(56)
            .build_cartesian_2d(x.0..x.1, y.0..y.1)
            .map_err(failed)?;
        chart
            .configure_mesh()
            .x_desc(plot.x.text())
            .y_desc(plot.y.text())
            .x_labels(labels(&plot.x, 8))
            .y_labels(labels(&plot.y, 7))
            .x_label_formatter(&|value| axis_tick(&plot.x, *value, x))
            .y_label_formatter(&|value| axis_tick(&plot.y, *value, y))
            .label_style(text_style(13))
            .axis_desc_style(text_style(13))
            .light_line_style(WHITE)
            .bold_line_style(LINE)
            .draw()
            .map_err(failed)?;
        for (index, series) in plot.series.iter().enumerate() {
            let look = Look {
                colour: colours::series(kinds[index]),
                shape: kinds[index],
                in_legend: kinds[index] == index,
            };
            draw(&mut chart, series, look, (fx, fy), (x, y), inner)?;
        }
        let scale = plot.series.iter().find_map(|series| match series {
            Series::Arrows { unit, scale, .. } => Some((unit, *scale)),
            _ => None,
        });
        if let Some(scale) = scale.filter(|(_, size)| size.is_finite() && *size > 0.0) {
            key(&mut chart, scale, (x, y), inner)?;
        }
        if let Some(heat) = heat {
            colour_bar(&area, heat, size)?;
        }
        if entries > 0 {
            legend(&mut chart, SeriesLabelPosition::UpperRight)?;
        }
        area.present().map_err(failed)?;
    }
    Ok(element(&svg, &plot.title))
}

fn least(axis: &Axis) -> impl Iterator<Item = f64> {
    let factor = axis.unit.factor;
    axis.at_least
        .into_iter()
        .flat_map(move |(from, to)| [from * factor, to * factor])
}

/// Points that a series must show, SI.
fn coordinates(series: &Series, x: &Axis) -> Vec<(f64, f64)> {
    let mut coordinates: Vec<(f64, f64)> = match series {
        Series::Line { points, .. } | Series::Points { points, .. } => points.clone(),
        Series::Arrows { arrows, .. } => arrows.iter().map(|arrow| arrow.at).collect(),
        Series::Heat(heat) => heat
            .x
            .iter()
            .flat_map(|&x| heat.y.iter().map(move |&y| (x, y)))
            .collect(),
        Series::Frame { lines, names } => (lines.iter().flatten().copied())
            .chain(names.iter().map(|name| name.at))
            .collect(),
        // Anywhere in x.
        Series::Level { y, .. } => vec![(x.at_least.map_or(f64::NAN, |range| range.0), *y)],
    };
    if !matches!(series, Series::Level { .. }) {
        coordinates.retain(|(x, y)| finite(&[*x, *y]));
    }
    coordinates
}

/// Widens the range of one axis until a length is as long on both.
fn same_scale(x: &mut (f64, f64), y: &mut (f64, f64), pixels: (f64, f64)) {
    let (per_x, per_y) = ((x.1 - x.0) / pixels.0, (y.1 - y.0) / pixels.1);
    let widen = |range: &mut (f64, f64), length: f64| {
        let middle = 0.5 * (range.0 + range.1);
        *range = (middle - 0.5 * length, middle + 0.5 * length);
    };
    if per_x < per_y {
        widen(x, per_y * pixels.0);
    } else {
        widen(y, per_x * pixels.1);
    }
}

/// A tick's number, with the digits that its range needs.
pub(crate) fn tick(value: f64, range: (f64, f64)) -> String {
    let step = (range.1 - range.0) / 10.0;
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    super::unit::trimmed(format!("{value:.decimals$}"))
}

/// How many labels an axis has room for; every name of a named one.
fn labels(axis: &Axis, most: usize) -> usize {
    if axis.names.is_empty() {
        most
    } else {
        axis.names.len() + 1
    }
}

/// A tick's number or name.
fn axis_tick(axis: &Axis, value: f64, range: (f64, f64)) -> String {
    if axis.names.is_empty() {
        return tick(value, range);
    }
    let rounded = value.round();
    let name = (1..)
        .zip(&axis.names)
        .find(|(number, _)| f64::from(*number) == rounded);
    match name {
        Some((_, name)) if (value - rounded).abs() < 1e-6 => name.clone(),
        _ => String::new(),
    }
}

/// How a series looks: levels of one name look the same, and the legend names it once.
#[derive(Clone, Copy)]
struct Look {
    colour: RGBColor,
    shape: usize,
    in_legend: bool,
}

/// The first level with the name of this one; any other series itself.
fn first_of_its_kind(all: &[Series], index: usize) -> usize {
    let Some(Series::Level { label, .. }) = all.get(index) else {
        return index;
    };
    let same = |other: &Series| matches!(other, Series::Level { label: own, .. } if own == label);
    all.iter().position(same).unwrap_or(index)
}

/// True for a series that the legend names.
fn in_legend(series: &Series) -> bool {
    match series {
        Series::Line { label, .. } | Series::Points { label, .. } | Series::Level { label, .. } => {
            !label.is_empty()
        }
        Series::Arrows { .. } => true,
        Series::Heat(_) | Series::Frame { .. } => false,
    }
}

/// Draws one series.
fn draw(
    chart: &mut Chart<'_, '_>,
    series: &Series,
    look: Look,
    (fx, fy): (f64, f64),
    ranges: ((f64, f64), (f64, f64)),
    pixels: (f64, f64),
) -> Result<(), PlotError> {
    let colour = look.colour;
    let scaled = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        points
            .iter()
            .filter(|(x, y)| finite(&[*x, *y]))
            .map(|(x, y)| (x * fx, y * fy))
            .collect()
    };
    let stroke = move |x: i32, y: i32, width| {
        PathElement::new(vec![(x, y), (x + 14, y)], colour.stroke_width(width))
    };
    match series {
        Series::Line { label, points } => {
            let lines = points
                .split(|(x, y)| !finite(&[*x, *y]))
                .filter(|piece| !piece.is_empty())
                .map(|piece| PathElement::new(thinned(scaled(piece)), colour.stroke_width(2)));
            let drawn = chart.draw_series(lines).map_err(failed)?;
            if !label.is_empty() {
                drawn
                    .label(label.clone())
                    .legend(move |(x, y)| stroke(x, y, 2));
            }
        }
        Series::Points { label, points } => {
            let all = scaled(points);
            let stride = all.len().div_ceil(MAX_POINTS).max(1);
            let dots = all.into_iter().step_by(stride);
            let style = colour.mix(0.8).filled();
            let size = if points.len() > FEW_POINTS { 2 } else { 3 };
            // Shape as well as colour.
            let drawn = match look.shape % 3 {
                0 => chart.draw_series(dots.map(|at| Circle::new(at, size, style))),
                1 => chart.draw_series(dots.map(|at| TriangleMarker::new(at, size + 1, style))),
                _ => chart.draw_series(dots.map(|at| Cross::new(at, size, style))),
            };
            let drawn = drawn.map_err(failed)?;
            if !label.is_empty() {
                let drawn = drawn.label(label.clone());
                match look.shape % 3 {
                    0 => drawn.legend(move |(x, y)| Circle::new((x + 7, y), 3, style)),
                    1 => drawn.legend(move |(x, y)| TriangleMarker::new((x + 7, y), 4, style)),
                    _ => drawn.legend(move |(x, y)| Cross::new((x + 7, y), 3, style)),
                };
            }
        }
        Series::Level { label, y } => {
            if !y.is_finite() {
                return Ok(());
            }
            let across = [(ranges.0.0, y * fy), (ranges.0.1, y * fy)];
            let line = DashedLineSeries::new(across, 6, 4, colour.stroke_width(1));
            let drawn = chart.draw_series(line).map_err(failed)?;
            if look.in_legend && !label.is_empty() {
                drawn
                    .label(label.clone())
                    .legend(move |(x, y)| stroke(x, y, 1));
            }
        }
        Series::Arrows {
            label,
            arrows,
            scale,
            ..
        } => {
            let paths = arrow_paths(arrows, *scale, (fx, fy), ranges, pixels);
            let paths = paths
                .into_iter()
                .map(|path| PathElement::new(path, colour.stroke_width(1)));
            let drawn = chart.draw_series(paths).map_err(failed)?;
            drawn
                .label(label.clone())
                .legend(move |(x, y)| stroke(x, y, 2));
        }
        Series::Frame { lines, names } => frame(chart, lines, names, (fx, fy))?,
        Series::Heat(heat) => {
            let largest = largest(heat);
            let columns = heat.x.len() - 1;
            let cells = heat.values.iter().enumerate();
            let cells = cells.filter(|(_, value)| value.is_finite());
            let cells = cells.map(|(cell, value)| {
                let (row, column) = (cell / columns, cell % columns);
                let corners = [
                    (heat.x[column] * fx, heat.y[row] * fy),
                    (heat.x[column + 1] * fx, heat.y[row + 1] * fy),
                ];
                Rectangle::new(corners, colours::diverging(value / largest).filled())
            });
            chart.draw_series(cells).map_err(failed)?;
        }
    }
    Ok(())
}

/// The lowest and highest point of each of many short pieces: what an eye sees of a long line.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if points.len() <= MAX_POINTS {
        return points;
    }
    let piece = points.len().div_ceil(MAX_POINTS / 2);
    points
        .chunks(piece)
        .flat_map(|piece| {
            let extreme = |sign: f64| {
                (0..piece.len())
                    .max_by(|&a, &b| (sign * piece[a].1).total_cmp(&(sign * piece[b].1)))
            };
            let (low, high) = (extreme(-1.0).unwrap_or(0), extreme(1.0).unwrap_or(0));
            [piece[low.min(high)], piece[low.max(high)]]
        })
        .collect()
}

/// Lines and names in grey.
fn frame(
    chart: &mut Chart<'_, '_>,
    lines: &[[(f64, f64); 2]],
    names: &[Name],
    (fx, fy): (f64, f64),
) -> Result<(), PlotError> {
    let scaled = |(x, y): (f64, f64)| (x * fx, y * fy);
    let lines = lines
        .iter()
        .filter(|[from, to]| finite(&[from.0, from.1, to.0, to.1]))
        .map(|line| PathElement::new(line.map(scaled).to_vec(), GREY.stroke_width(1)));
    chart.draw_series(lines).map_err(failed)?;
    let names = names.iter().filter(|name| finite(&[name.at.0, name.at.1]));
    for name in names {
        let (anchor, shift) = match name.side {
            Side::Above => (Pos::new(HPos::Center, VPos::Bottom), (0, -4)),
            Side::BelowLeft => (Pos::new(HPos::Right, VPos::Top), (-2, 3)),
            Side::BelowRight => (Pos::new(HPos::Left, VPos::Top), (2, 3)),
        };
        let style = TextStyle::from(text_style(12)).color(&DARK).pos(anchor);
        let text = EmptyElement::at(scaled(name.at)) + Text::new(name.text.clone(), shift, style);
        chart.draw_series([text]).map_err(failed)?;
    }
    Ok(())
}

/// An arrow of a round size in the free strip above the data, and what it stands for.
fn key(
    chart: &mut Chart<'_, '_>,
    (unit, scale): (&Unit, f64),
    ranges: ((f64, f64), (f64, f64)),
    pixels: (f64, f64),
) -> Result<(), PlotError> {
    let size = round_below(scale * unit.factor) / unit.factor;
    let (x, y) = ranges;
    let (per_x, per_y) = ((x.1 - x.0) / pixels.0, (y.1 - y.0) / pixels.1);
    let at = (x.0 + 10.0 * per_x, y.1 - 14.0 * per_y);
    let arrow = Arrow {
        at,
        vector: (size, 0.0),
    };
    let paths = arrow_paths(&[arrow], scale, (1.0, 1.0), ranges, pixels);
    let paths = paths
        .into_iter()
        .map(|path| PathElement::new(path, BLACK.stroke_width(2)));
    chart.draw_series(paths).map_err(failed)?;
    let length = LONGEST_ARROW * pixels.0.min(pixels.1) * size / scale;
    let style = TextStyle::from(text_style(12)).pos(Pos::new(HPos::Left, VPos::Center));
    let text = EmptyElement::at(at) + Text::new(unit.text(size), (length as i32 + 8, 0), style);
    chart.draw_series([text]).map_err(failed)?;
    Ok(())
}

/// The largest of 1, 2, 5, 10, … that is not above a positive value.
fn round_below(value: f64) -> f64 {
    let decade = 10.0_f64.powf(value.log10().floor());
    [5.0, 2.0, 1.0]
        .into_iter()
        .map(|step| step * decade)
        .find(|round| *round <= value)
        .unwrap_or(decade)
}

/// Shaft and head of each arrow; a vector of the size `longest` gets the longest length.
fn arrow_paths(
    arrows: &[Arrow],
    longest: f64,
    (fx, fy): (f64, f64),
    (x, y): ((f64, f64), (f64, f64)),
    pixels: (f64, f64),
) -> Vec<Vec<(f64, f64)>> {
    let kept: Vec<&Arrow> = arrows
        .iter()
        .filter(|arrow| finite(&[arrow.at.0, arrow.at.1, arrow.vector.0, arrow.vector.1]))
        .collect();
    if longest <= 0.0 {
        return Vec::new();
    }
    // Pixels of a vector of one; heads are made in pixels, so that they stay arrows on any scale.
    let per_vector = LONGEST_ARROW * pixels.0.min(pixels.1) / longest;
    let (per_x, per_y) = ((x.1 - x.0) / pixels.0, (y.1 - y.0) / pixels.1);
    let paths = kept.iter().map(|arrow| {
        let start = (arrow.at.0 * fx, arrow.at.1 * fy);
        let shaft = (arrow.vector.0 * per_vector, arrow.vector.1 * per_vector);
        let to = |dx: f64, dy: f64| (start.0 + dx * per_x, start.1 + dy * per_y);
        let side = |sign: f64| {
            let (back_x, back_y) = (shaft.0 * (1.0 - HEAD), shaft.1 * (1.0 - HEAD));
            to(
                back_x - sign * 0.5 * HEAD * shaft.1,
                back_y + sign * 0.5 * HEAD * shaft.0,
            )
        };
        let tip = to(shaft.0, shaft.1);
        vec![start, tip, side(1.0), tip, side(-1.0)]
    });
    paths.collect()
}

fn check(heat: &Heat) -> Result<(), PlotError> {
    let (columns, rows) = (heat.x.len().max(1) - 1, heat.y.len().max(1) - 1);
    if columns == 0 || rows == 0 || heat.values.len() != columns * rows {
        return Err(PlotError::Grid {
            label: heat.label.clone(),
            values: heat.values.len(),
            columns,
            rows,
        });
    }
    Ok(())
}

fn largest(heat: &Heat) -> f64 {
    if let Some(scale) = heat.scale.filter(|scale| *scale > 0.0 && scale.is_finite()) {
        return scale;
    }
    let sizes = heat.values.iter().filter(|value| value.is_finite());
    sizes.fold(f64::MIN_POSITIVE, |most, value| most.max(value.abs()))
}

/// The colour bar of a grid: from the least to the most, nothing in the middle.
fn colour_bar(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    heat: &Heat,
    (width, height): (u32, u32),
) -> Result<(), PlotError> {
    const STEPS: i32 = 20;
    let (left, top, bottom) = (width as i32 - 74, 50, height as i32 - 60);
    let largest = largest(heat);
    let step = f64::from(bottom - top) / f64::from(STEPS);
    for number in 0..STEPS {
        let share = 1.0 - (2.0 * f64::from(number) + 1.0) / f64::from(STEPS);
        let from = top + (f64::from(number) * step) as i32;
        let to = top + (f64::from(number + 1) * step) as i32;
        let cell = Rectangle::new(
            [(left, from), (left + 12, to)],
            colours::diverging(share).filled(),
        );
        area.draw(&cell).map_err(failed)?;
    }
    let marks = [
        (top, largest),
        (i32::midpoint(top, bottom), 0.0),
        (bottom, -largest),
    ];
    for (y, value) in marks {
        let text = number(value * heat.unit.factor);
        area.draw(&Text::new(text, (left + 16, y - 5), text_style(11)))
            .map_err(failed)?;
    }
    let name = format!("{} / {}", heat.label, heat.unit.symbol);
    let style = TextStyle::from(text_style(11)).pos(Pos::new(HPos::Right, VPos::Top));
    area.draw(&Text::new(name, (width as i32 - 4, top - 18), style))
        .map_err(failed)
}
