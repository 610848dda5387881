//! Horizontal bars with names, intervals and levels across all of them.

use plotters::{prelude::*, style::text_anchor};

use super::{
    colours,
    draw::{self, text_style},
    error::{PlotError, failed},
    plot::finite,
    unit::Unit,
};

/// One bar. SI.
#[derive(Clone, Debug)]
pub struct Bar {
    /// Name.
    pub label: String,
    /// Length.
    pub value: f64,
    /// 95 % interval of the length.
    pub ci95: Option<[f64; 2]>,
    /// Bars of one group have one colour.
    pub group: usize,
}

/// A bar chart.
#[derive(Clone, Debug)]
pub struct Bars {
    /// Heading.
    pub title: String,
    /// What the length of a bar is.
    pub label: String,
    /// In what people read it.
    pub unit: Unit,
    /// From top to bottom.
    pub bars: Vec<Bar>,
    /// Names of the groups; none: no legend.
    pub groups: Vec<String>,
    /// Levels across all bars: name and value.
    pub levels: Vec<(String, f64)>,
    /// A sentence below.
    pub caption: String,
}

/// Height of a bar with its gap, of what stands above and below the bars, and width, CSS pixels.
const ROW: u32 = 22;
const AROUND: u32 = 96;
const WIDTH: u32 = 720;
const NAMES: u32 = 270;
/// Room of a letter, at the most.
const LETTER: u32 = 8;
/// Letters of a name that fit into that room.
const LETTERS: usize = 38;

impl Bars {
    /// The drawing alone, an `<svg>` element. Bars that are not finite are left out.
    ///
    /// # Errors
    /// [`PlotError`] when nothing can be drawn.
    pub fn svg(&self) -> Result<String, PlotError> {
        let factor = self.unit.factor;
        let bars: Vec<&Bar> = self
            .bars
            .iter()
            .filter(|bar| bar.value.is_finite())
            .collect();
        if bars.is_empty() {
            return Err(PlotError::Empty(self.title.clone()));
        }
        let ends = bars.iter().flat_map(|bar| {
            let interval = bar.ci95.filter(|ends| finite(ends)).unwrap_or([0.0, 0.0]);
            [bar.value, interval[0], interval[1], 0.0]
        });
        let levels = self.levels.iter().map(|level| level.1);
        let (low, high) = draw::range(ends.chain(levels).map(|value| value * factor));
        let low = if low < 0.0 && bars.iter().all(|bar| bar.value >= 0.0) {
            0.0
        } else {
            low
        };
        let longest = bars.iter().map(|bar| bar.label.chars().count()).max();
        let names = NAMES.min(LETTER * longest.unwrap_or(0) as u32 + 2 * LETTER);
        let mut svg = String::new();
        {
            let entries = (self.groups.len() + self.levels.len()) as u32;
            let legend = if entries > 0 {
                entries * draw::ENTRY + draw::FRAME
            } else {
                0
            };
            let rows = bars.len() as f64 + f64::from(legend) / f64::from(ROW);
            let size = (WIDTH, AROUND + ROW * bars.len() as u32 + legend);
            let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            area.fill(&WHITE).map_err(failed)?;
            let mut chart = ChartBuilder::on(&area)
                .caption(&self.title, text_style(15))
                .margin(8)
                .margin_right(16)
                .x_label_area_size(40)
                .y_label_area_size(names)
                .build_cartesian_2d(low..high, rows..0.0)
                .map_err(failed)?;
            draw::axis_of_rows(
                &mut chart,
                format!("{} / {}", self.label, self.unit.symbol),
                &|value| super::unit::number(*value),
            )?;
            let name_style = text_style(13)
                .into_text_style(&area)
                .pos(text_anchor::Pos::new(
                    text_anchor::HPos::Right,
                    text_anchor::VPos::Center,
                ));
            for (index, bar) in bars.iter().enumerate() {
                let middle = index as f64 + 0.5;
                let (x, y) = chart.backend_coord(&(low, middle));
                area.draw(&Text::new(
                    draw::shortened(&bar.label, LETTERS),
                    (x - 8, y),
                    name_style.clone(),
                ))
                .map_err(failed)?;
                let colour = colours::series(bar.group);
                let rectangle = [
                    (low.max(0.0), middle - 0.32),
                    (bar.value * factor, middle + 0.32),
                ];
                chart
                    .draw_series([Rectangle::new(rectangle, colour.mix(0.75).filled())])
                    .map_err(failed)?;
                if let Some(ends) = bar.ci95.filter(|ends| finite(ends)) {
                    let whisker = vec![(ends[0] * factor, middle), (ends[1] * factor, middle)];
                    chart
                        .draw_series([PathElement::new(whisker, BLACK.stroke_width(1))])
                        .map_err(failed)?;
                }
            }
            for (number, group) in self.groups.iter().enumerate() {
                let colour = colours::series(number);
                chart
                    .draw_series(std::iter::empty::<Rectangle<(f64, f64)>>())
                    .map_err(failed)?
                    .label(group.clone())
                    .legend(move |(x, y)| {
                        Rectangle::new([(x, y - 4), (x + 14, y + 4)], colour.mix(0.75).filled())
                    });
            }
            for (number, (name, level)) in self.levels.iter().enumerate() {
                let colour = colours::series(self.groups.len().max(1) + number);
                let line = vec![(level * factor, 0.0), (level * factor, bars.len() as f64)];
                chart
                    .draw_series([PathElement::new(line, colour.stroke_width(2))])
                    .map_err(failed)?
                    .label(format!("{name}: {}", self.unit.size(*level)))
                    .legend(move |(x, y)| {
                        PathElement::new(vec![(x, y), (x + 14, y)], colour.stroke_width(2))
                    });
            }
            if !self.groups.is_empty() || !self.levels.is_empty() {
                draw::legend(&mut chart, SeriesLabelPosition::LowerRight)?;
            }
            area.present().map_err(failed)?;
        }
        Ok(draw::element(&svg, &self.title))
    }
}
