//! Values by name: a row for each name, a dot for each value, a bar at each mean.

use plotters::{
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::{
    colours,
    draw::{self, LINE, text_style},
    error::{PlotError, failed},
    plot::Axis,
};

/// Values of one kind: number of the row and value, SI.
#[derive(Clone, Debug)]
pub struct Strip {
    /// Name of the kind, for the legend.
    pub label: String,
    /// Row and value.
    pub values: Vec<(usize, f64)>,
}

/// Values of several kinds over named rows.
#[derive(Clone, Debug)]
pub struct Strips {
    /// Heading.
    pub title: String,
    /// What the values are.
    pub axis: Axis,
    /// Names of the rows, from top to bottom.
    pub rows: Vec<String>,
    /// Kinds; one above the other within a row.
    pub strips: Vec<Strip>,
    /// A sentence below.
    pub caption: String,
}

/// Height of a row, of what stands around the rows, width, and room for names, CSS pixels.
const ROW: u32 = 30;
const AROUND: u32 = 88;
const WIDTH: u32 = 480;
const NAMES: u32 = 110;
/// Letters of a name that fit into that room.
const LETTERS: usize = 16;
/// Values of one kind beyond which fewer are shown.
const MAX_VALUES: usize = 2500;

impl Strips {
    /// True when there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty() || !self.finite().any(|_| true)
    }

    fn finite(&self) -> impl Iterator<Item = f64> {
        let all = self.strips.iter().flat_map(|strip| &strip.values);
        let known = all.filter(|(row, value)| *row < self.rows.len() && value.is_finite());
        known.map(|(_, value)| *value)
    }

    /// The drawing alone, an `<svg>` element. Values that are not finite, and rows that have no name, are left out.
    ///
    /// # Errors
    /// [`PlotError`] when nothing can be drawn.
    pub fn svg(&self) -> Result<String, PlotError> {
        if self.is_empty() {
            return Err(PlotError::Empty(self.title.clone()));
        }
        let factor = self.axis.unit.factor;
        let least = self.axis.at_least.into_iter().flat_map(<[f64; 2]>::from);
        let (low, high) = draw::range(self.finite().chain(least).map(|value| value * factor));
        let legend = self.strips.len() as u32 * draw::ENTRY + draw::FRAME;
        let room = f64::from(legend) / f64::from(ROW);
        let size = (WIDTH, AROUND + ROW * self.rows.len() as u32 + legend);
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            area.fill(&WHITE).map_err(failed)?;
            let mut chart = ChartBuilder::on(&area)
                .caption(&self.title, text_style(15))
                .margin(8)
                .margin_right(16)
                .x_label_area_size(40)
                .y_label_area_size(NAMES)
                .build_cartesian_2d(low..high, self.rows.len() as f64..-room)
                .map_err(failed)?;
            draw::axis_of_rows(&mut chart, self.axis.text(), &|value| {
                draw::tick(*value, (low, high))
            })?;
            let style = TextStyle::from(text_style(12)).pos(Pos::new(HPos::Right, VPos::Center));
            for (row, name) in self.rows.iter().enumerate() {
                let (x, y) = chart.backend_coord(&(low, row as f64 + 0.5));
                area.draw(&Text::new(
                    draw::shortened(name, LETTERS),
                    (x - 8, y),
                    style.clone(),
                ))
                .map_err(failed)?;
                let border = vec![(low, row as f64), (high, row as f64)];
                chart
                    .draw_series([PathElement::new(border, LINE.stroke_width(1))])
                    .map_err(failed)?;
            }
            for (index, strip) in self.strips.iter().enumerate() {
                self.draw(&mut chart, strip, index)?;
            }
            draw::legend(&mut chart, SeriesLabelPosition::UpperRight)?;
            area.present().map_err(failed)?;
        }
        Ok(draw::element(&svg, &self.title))
    }

    fn draw(
        &self,
        chart: &mut draw::Chart<'_, '_>,
        strip: &Strip,
        index: usize,
    ) -> Result<(), PlotError> {
        let factor = self.axis.unit.factor;
        let colour = colours::series(index);
        let height = (index as f64 + 0.5) / self.strips.len() as f64;
        let known: Vec<(usize, f64)> = (strip.values.iter())
            .filter(|(row, value)| *row < self.rows.len() && value.is_finite())
            .map(|(row, value)| (*row, value * factor))
            .collect();
        let stride = known.len().div_ceil(MAX_VALUES).max(1);
        let style = colour.mix(0.6).filled();
        let at = |&(row, value): &(usize, f64)| (value, row as f64 + height);
        let dots = known.iter().step_by(stride).map(at);
        if index.is_multiple_of(2) {
            chart
                .draw_series(dots.map(|at| Circle::new(at, 2, style)))
                .map_err(failed)?
                .label(strip.label.clone())
                .legend(move |(x, y)| Circle::new((x + 7, y), 3, style));
        } else {
            chart
                .draw_series(dots.map(|at| TriangleMarker::new(at, 3, style)))
                .map_err(failed)?
                .label(strip.label.clone())
                .legend(move |(x, y)| TriangleMarker::new((x + 7, y), 4, style));
        }
        let half = 0.35 / self.strips.len() as f64;
        let means = (0..self.rows.len()).filter_map(|row| {
            let in_row = known.iter().filter(|value| value.0 == row);
            let (sum, count) = in_row.fold((0.0, 0.0), |(sum, count), value| {
                (sum + value.1, count + 1.0)
            });
            let middle = row as f64 + height;
            let mean = sum / count;
            (count > 0.0).then(|| {
                let bar = vec![(mean, middle - half), (mean, middle + half)];
                PathElement::new(bar, BLACK.stroke_width(2))
            })
        });
        chart.draw_series(means).map_err(failed)?;
        Ok(())
    }
}
