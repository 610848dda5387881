//! Numbers for people: in display units (µm, mm, µrad, °, ms and the like), with the digits that the uncertainty carries.
//!
//! An expanded uncertainty has two significant digits and its value is rounded to the same place (GUM 7.2.6). A value that
//! rounds to nothing has no sign.

/// What rounding leaves of nothing, in the display units: it is no uncertainty, and no value.
const NOTHING: f64 = 1e-9;

/// A parameter as text: name, value, half width of its 95 % interval, in the display units.
pub fn in_display_units(name: &str, value: f64, unit: &str, ci95: Option<[f64; 2]>) -> String {
    let half = ci95.map(|[low, high]| 0.5 * (high - low));
    let half = half.filter(|half| half.is_finite()).unwrap_or(0.0);
    let (factor, unit) = display_unit(name, value.abs().max(half), unit);
    let text = if half * factor > NOTHING {
        let (value, half) = rounded(value * factor, half * factor);
        format!("{name} = {value} ± {half} {unit}")
    } else {
        // A constant that was not fitted (the number of a tool, a chosen length) or whose uncertainty nobody knows.
        format!("{name} = {} {unit}", significant(value * factor))
    };
    text.trim_end().replace(" °", "°")
}

/// A count with its thousands parted by commas.
pub(crate) fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let groups = digits.as_bytes().rchunks(3).rev();
    let groups: Vec<_> = groups.map(String::from_utf8_lossy).collect();
    groups.join(",")
}

/// Shown number over SI value, and the unit as people write it, for a value or an uncertainty of that size.
fn display_unit<'u>(name: &str, size: f64, unit: &'u str) -> (f64, &'u str) {
    match unit {
        "m" if size >= 2e-3 => (1e3, "mm"),
        "m" => (1e6, "µm"),
        // A phase is an angle of a wave, not an error.
        "rad" if name.contains("phase") || size >= 2e-2 => (180.0 / std::f64::consts::PI, "°"),
        "rad" if size >= 2e-3 => (1e3, "mrad"),
        "rad" => (1e6, "µrad"),
        "m/s" if size < 1e-5 => (3.6e9, "µm/h"),
        "m/s" => (6e4, "mm/min"),
        "m/m" => (1e6, "µm/m"),
        "rad/rad" => (1e6, "µrad/rad"),
        "rad/m" => (1e6, "µrad/m"),
        "1/K" => (1e6, "µm/(m K)"),
        "m/K" => (1e6, "µm/K"),
        "m s/rad" => (1e6, "µm s/rad"),
        "rad/(N m)" => (1e6, "µrad/(N m)"),
        "m/N" => (1e6, "µm/N"),
        "s" if size < 1.0 => (1e3, "ms"),
        "s" if size >= 600.0 => (1.0 / 60.0, "min"),
        "1" => (1.0, ""),
        other => (1.0, other),
    }
}

/// An uncertainty with two significant digits, and the value rounded to its last one (GUM 7.2.6).
fn rounded(value: f64, uncertainty: f64) -> (String, String) {
    let place = |of: f64| of.log10().floor() as i32 - 1;
    let to = |number: f64, place: i32| {
        let step = 10_f64.powi(place);
        (number / step).round() * step
    };
    // 9.96 becomes 10: the second digit is then one place higher.
    let place = place(to(uncertainty, place(uncertainty)));
    let decimals = usize::try_from(-place).unwrap_or(0);
    let text = |number: f64| format!("{:.decimals$}", without_sign(to(number, place)));
    (text(value), text(uncertainty))
}

/// At most five significant digits, without rounding whole numbers and without trailing zeros.
fn significant(value: f64) -> f64 {
    if value.abs() < NOTHING {
        return 0.0;
    }
    if !value.is_finite() || value.fract() == 0.0 {
        return value;
    }
    let place = 10_f64.powi(4 - value.abs().log10().floor() as i32);
    let rounded = (value * place).round() / place;
    if rounded.abs() >= 1e5 {
        value.round()
    } else {
        without_sign(rounded)
    }
}

/// Zero without a sign.
fn without_sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_read_in_display_units() {
        let text = |name: &str, value: f64, unit: &str, half: f64| {
            in_display_units(name, value, unit, Some([value - half, value + half]))
        };
        assert_eq!(text("dx", 3.5e-6, "m", 1e-7), "dx = 3.50 ± 0.10 µm");
        assert_eq!(text("z", -1e-3, "m", 0.092), "z = -1 ± 92 mm");
        assert_eq!(text("k", 1.4e-6, "m/m", 2e-7), "k = 1.40 ± 0.20 µm/m");
        assert_eq!(
            text("A2", 1.2e-6, "rad/(N m)", 3e-7),
            "A2 = 1.20 ± 0.30 µrad/(N m)"
        );
        assert_eq!(text("phase", 1.2217, "rad", 0.0349), "phase = 70.0 ± 2.0°");
        assert_eq!(text("a", 5.001e-3, "rad", 4e-6), "a = 5.0010 ± 0.0040 mrad");
        assert_eq!(
            text("rate_x", 1.5e-9, "m/s", 1e-10),
            "rate_x = 5.40 ± 0.36 µm/h"
        );
        assert_eq!(text("tau", 1200.0, "s", 90.0), "tau = 20.0 ± 1.5 min");
        assert_eq!(
            text("g_bed", -2.2e-6, "m/K", 4e-8),
            "g_bed = -2.200 ± 0.040 µm/K"
        );
        assert_eq!(text("length", 0.075, "m", 0.0), "length = 75 mm");
        assert_eq!(text("tool", 2.0, "1", 0.0), "tool = 2");
        assert_eq!(text("tau", 502.204_613, "s", 0.0), "tau = 502.2 s");
        assert_eq!(text("exponent", 2.5, "1", 0.25), "exponent = 2.50 ± 0.25");
    }

    #[test]
    fn the_uncertainty_carries_two_digits_and_the_value_no_more() {
        let text = |value: f64, uncertainty: f64| rounded(value, uncertainty);
        assert_eq!(text(1234.5, 247.0), ("1230".to_owned(), "250".to_owned()));
        assert_eq!(
            text(12.3456, 0.0996),
            ("12.35".to_owned(), "0.10".to_owned())
        );
        assert_eq!(text(-0.004, 0.31), ("0.00".to_owned(), "0.31".to_owned()));
    }
}
