//! Numbers of a gap report in µm, µrad and ms, with the digits that their interval justifies.

use crate::kit::Unit;
use ::diagnosis::report::{ParameterEstimate, Place};

/// The unit of a report's root mean squares on paper.
pub(crate) fn unit_of(report: &::diagnosis::Report) -> Unit {
    Unit::of_si(&report.gap.unit)
}

/// A parameter with its 95 % interval: `dx = -1.49 ± 0.17 µm`; a constant that was not fitted has no interval.
pub(crate) fn parameter(parameter: &ParameterEstimate) -> String {
    let value = parameter.value;
    let fitted = parameter.ci95[1] > parameter.ci95[0];
    let unit = match parameter.unit.as_str() {
        "m" if !fitted && value.abs() >= 2e-3 => Unit::MM,
        "m/s" if value.abs() >= 1e-5 => Unit::MM_PER_MIN,
        "s" if value.abs() < 1.0 => Unit::MS,
        "s" if value.abs() >= 600.0 => Unit::MIN,
        // A phase, not an error of an axis.
        "rad" if value.abs() >= 0.02 || parameter.name.contains("phase") => Unit::DEG,
        other => Unit::of_si(other),
    };
    let text = unit.text_with_interval(value, parameter.ci95);
    format!("{} = {text}", parameter.name)
}

/// Parameters of an effect; of many, the first ones.
pub(crate) fn parameters(all: &[ParameterEstimate]) -> String {
    const MOST: usize = 6;
    let mut texts: Vec<String> = all.iter().map(parameter).collect();
    let more = texts.len().saturating_sub(MOST);
    texts.truncate(MOST);
    if more > 0 {
        texts.push(format!("and {more} more"));
    }
    texts.join(", ")
}

/// An interval of a root mean square: `0.6 to 0.7 µm`.
pub(crate) fn interval(unit: &Unit, ci95: [f64; 2]) -> String {
    format!("{} to {}", unit.size(ci95[0]), unit.size(ci95[1]))
}

/// A probability: never 1 or 0 by rounding.
pub(crate) fn probability(value: f64) -> String {
    if value > 0.9995 {
        "> 0.999".to_owned()
    } else if value < 0.0005 {
        "< 0.001".to_owned()
    } else {
        format!("{value:.3}")
    }
}

/// A share of an energy.
pub(crate) fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

/// Whether an axis of the machine turns, by its name; parts and features have no axis.
pub(crate) type Turns<'a> = &'a dyn Fn(&str) -> bool;

/// A location of the report: `axis X, -12 to 33 mm`.
pub(crate) fn location_text(place: &Place, turns: Turns<'_>) -> String {
    let (name, unit) = match place.dimension.as_str() {
        "time" => ("time".to_owned(), Unit::S),
        "region" if place.key.starts_with("part ") => (place.key.clone(), Unit::MM),
        dimension if turns(&place.key) => (format!("{dimension} {}", place.key), Unit::DEG),
        dimension => (format!("{dimension} {}", place.key), Unit::MM),
    };
    match (place.from, place.to) {
        (Some(from), Some(to)) => {
            let round = |value: f64| format!("{:.1}", value * unit.factor);
            format!("{name}, {} to {} {}", round(from), round(to), unit.symbol)
        }
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_have_the_digits_of_their_interval_and_constants_none() {
        let text = |value: f64, unit: &str, half: f64| {
            parameter(&ParameterEstimate {
                name: "p".to_owned(),
                value,
                unit: unit.to_owned(),
                ci95: [value - half, value + half],
            })
        };
        assert_eq!(text(-1.4936e-6, "m", 1.723e-7), "p = -1.49 ± 0.17 µm");
        assert_eq!(text(0.045, "m", 0.0), "p = 45 mm");
        assert_eq!(text(2e-3, "s", 1.2e-4), "p = 2.00 ± 0.12 ms");
        assert_eq!(text(1.15e-5, "1/K", 2.1e-7), "p = 11.50 ± 0.21 µm/(m K)");
        assert_eq!(text(std::f64::consts::FRAC_PI_2, "rad", 0.0), "p = 90°");
        assert_eq!(text(3.0, "1", 0.0), "p = 3");
    }

    #[test]
    fn places_are_read_in_the_units_of_their_coordinate() {
        let at = |dimension: &str, key: &str| Place {
            dimension: dimension.to_owned(),
            key: key.to_owned(),
            from: Some(0.0),
            to: Some(0.5),
            share: 0.8,
        };
        let text =
            |dimension: &str, key: &str| location_text(&at(dimension, key), &|axis| axis == "C");
        assert_eq!(text("axis", "X"), "axis X, 0.0 to 500.0 mm");
        assert_eq!(text("axis", "C"), "axis C, 0.0 to 28.6 °");
        assert_eq!(text("region", "part z"), "part z, 0.0 to 500.0 mm");
        assert_eq!(text("time", "s"), "time, 0.0 to 0.5 s");
    }

    #[test]
    fn certainty_is_never_made_by_rounding() {
        assert_eq!(probability(0.99999), "> 0.999");
        assert_eq!(probability(0.0), "< 0.001");
        assert_eq!(probability(0.8764), "0.876");
    }
}
