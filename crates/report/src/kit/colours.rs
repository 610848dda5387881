//! Colours that are distinguishable with any colour vision and in grey.

use plotters::style::RGBColor;

/// Okabe and Ito's qualitative palette (J*FLY 2008), without the yellow that paper loses.
const SERIES: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(90, 90, 90),
];

/// Colour of the series of that number.
pub(crate) fn series(number: usize) -> RGBColor {
    SERIES[number % SERIES.len()]
}

/// Ends and middle of the diverging scale: blue for less, white for nothing, vermilion for more.
const LESS: [f64; 3] = [0.0, 90.0, 160.0];
const MORE: [f64; 3] = [200.0, 70.0, 0.0];

/// Colour of a share of the largest size, −1 to 1.
pub(crate) fn diverging(share: f64) -> RGBColor {
    let end = if share < 0.0 { LESS } else { MORE };
    let share = share.abs().min(1.0);
    let channel = |index: usize| (255.0 + (end[index] - 255.0) * share).round() as u8;
    RGBColor(channel(0), channel(1), channel(2))
}
