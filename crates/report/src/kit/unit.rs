//! Units for display: a factor on the SI value, a symbol, and the digits worth showing.

/// A unit for display: the shown number is the SI value times `factor`.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// Shown number over SI value.
    pub factor: f64,
    /// Its sign; empty for a plain number.
    pub symbol: std::borrow::Cow<'static, str>,
}

/// Shown numbers that are smaller are what rounding has left.
const NOTHING: f64 = 1e-9;

impl Unit {
    /// Millimetres, of metres.
    pub const MM: Self = Self::fixed(1e3, "mm");
    /// Micrometres, of metres.
    pub const UM: Self = Self::fixed(1e6, "µm");
    /// Degrees, of radians.
    pub const DEG: Self = Self::fixed(180.0 / std::f64::consts::PI, "°");
    /// Microradians, of radians.
    pub const URAD: Self = Self::fixed(1e6, "µrad");
    /// Seconds.
    pub const S: Self = Self::fixed(1.0, "s");
    /// Milliseconds, of seconds.
    pub const MS: Self = Self::fixed(1e3, "ms");
    /// Minutes, of seconds.
    pub const MIN: Self = Self::fixed(1.0 / 60.0, "min");
    /// Millimetres per minute, of metres per second.
    pub const MM_PER_MIN: Self = Self::fixed(6e4, "mm/min");
    /// Per cent, of a ratio.
    pub const PERCENT: Self = Self::fixed(100.0, "%");
    /// A number without unit.
    pub const ONE: Self = Self::fixed(1.0, "");

    const fn fixed(factor: f64, symbol: &'static str) -> Self {
        Self {
            factor,
            symbol: std::borrow::Cow::Borrowed(symbol),
        }
    }

    /// A unit that is shown as it comes (an effort: N, N·m, A).
    pub fn plain(symbol: impl Into<String>) -> Self {
        Self {
            factor: 1.0,
            symbol: std::borrow::Cow::Owned(symbol.into()),
        }
    }

    /// The unit in which people read an SI unit as reports spell it (`m`, `rad`, `s`, `m/m`, …); others stay.
    pub fn of_si(si: &str) -> Self {
        match si {
            "m" => Self::UM,
            "rad" => Self::URAD,
            "m/m" => Self::fixed(1e6, "µm/m"),
            "rad/m" => Self::fixed(1e6, "µrad/m"),
            "1/K" => Self::fixed(1e6, "µm/(m K)"),
            "m/K" => Self::fixed(1e6, "µm/K"),
            "m s/rad" => Self::fixed(1e6, "µm s/rad"),
            "m/s" => Self::fixed(3.6e9, "µm/h"),
            "rad/rad" => Self::fixed(1e6, "µrad/rad"),
            "rad/(N m)" => Self::fixed(1e6, "µrad/(N m)"),
            "m/N" => Self::fixed(1e6, "µm/N"),
            "1" => Self::ONE,
            other => Self::plain(other),
        }
    }

    /// An SI value in this unit with its sign: `12.3 µm`.
    pub fn text(&self, si: f64) -> String {
        self.signed(number(si * self.factor))
    }

    /// An SI value with three digits and its sign, for sizes that are compared: `3.73 µm`.
    pub fn size(&self, si: f64) -> String {
        let value = si * self.factor;
        if value == 0.0 || !value.is_finite() {
            return self.text(si);
        }
        let magnitude = value.abs().log10().floor() as i32;
        if !(-5..=7).contains(&magnitude) {
            return self.text(si);
        }
        let decimals = (2 - magnitude).clamp(0, 9) as usize;
        self.signed(format!("{value:.decimals$}"))
    }

    /// An SI value and the half of its 95 % interval, with digits after the interval's: `12.3 ± 0.4 µm`.
    pub fn text_with_interval(&self, si: f64, ci95: [f64; 2]) -> String {
        let (value, half) = (
            si * self.factor,
            0.5 * (ci95[1] - ci95[0]).abs() * self.factor,
        );
        // What rounding leaves of nothing is no interval.
        if !(half > NOTHING && half.is_finite()) {
            return self.signed(number(if value.abs() < NOTHING { 0.0 } else { value }));
        }
        // Two digits of the interval are worth reading, and the value to the same place (GUM 7.2.6).
        let place = |of: f64| of.log10().floor() as i32 - 1;
        let to = |number: f64, place: i32| {
            let step = 10_f64.powi(place);
            let rounded = (number / step).round() * step;
            // Zero has no sign.
            if rounded == 0.0 { 0.0 } else { rounded }
        };
        let place = place(to(half, place(half)));
        let decimals = (-place).clamp(0, 9) as usize;
        let (value, half) = (to(value, place), to(half, place));
        self.signed(format!("{value:.decimals$} ± {half:.decimals$}"))
    }

    fn signed(&self, number: String) -> String {
        match self.symbol.as_ref() {
            "" => number,
            "°" => format!("{number}°"),
            symbol => format!("{number} {symbol}"),
        }
    }
}

/// A number with four digits, without trailing zeros.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return "–".to_owned();
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-5..=7).contains(&magnitude) {
        return format!("{value:.2e}");
    }
    let decimals = (3 - magnitude).clamp(0, 9) as usize;
    trimmed(format!("{value:.decimals$}"))
}

/// Without trailing zeros behind the point, and without a sign before zero.
pub(crate) fn trimmed(text: String) -> String {
    if !text.contains('.') {
        return text;
    }
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0" } else { short }.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn si_values_are_read_in_the_units_of_the_shop() {
        assert_eq!(Unit::UM.text(35.5e-6), "35.5 µm");
        assert_eq!(Unit::DEG.text(std::f64::consts::FRAC_PI_2), "90°");
        assert_eq!(Unit::of_si("rad").text(-12.34e-6), "-12.34 µrad");
        assert_eq!(Unit::of_si("N m").text(0.25), "0.25 N m");
        assert_eq!(Unit::MM_PER_MIN.text(5e-4), "30 mm/min");
    }

    #[test]
    fn sizes_have_three_digits() {
        assert_eq!(Unit::UM.size(0.64879e-6), "0.649 µm");
        assert_eq!(Unit::UM.size(3.7e-6), "3.70 µm");
        assert_eq!(Unit::UM.size(1234.5e-6), "1234 µm");
        assert_eq!(Unit::UM.size(0.0), "0 µm");
    }

    #[test]
    fn an_interval_decides_the_digits_of_its_value() {
        assert_eq!(
            Unit::UM.text_with_interval(35.4567e-6, [34.9e-6, 36.1e-6]),
            "35.46 ± 0.60 µm"
        );
        assert_eq!(
            Unit::UM.text_with_interval(35.4567e-6, [5e-6, 65e-6]),
            "35 ± 30 µm"
        );
        assert_eq!(
            Unit::UM.text_with_interval(1234.5e-6, [987.5e-6, 1481.5e-6]),
            "1230 ± 250 µm"
        );
        assert_eq!(
            Unit::UM.text_with_interval(-0.004e-6, [-0.314e-6, 0.306e-6]),
            "0.00 ± 0.31 µm"
        );
        assert_eq!(Unit::S.text_with_interval(2.0, [f64::NAN, f64::NAN]), "2 s");
    }
}
