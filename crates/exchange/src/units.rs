//! Units that a caller names: nothing is converted that nobody has named a unit for.

use crate::ImportError;

/// What a column of numbers is a measure of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Coordinates, and positions of linear axes.
    Length,
    /// Deviations from nominal, tolerances and uncertainties: of `Length` unless they have a unit of their own.
    Deviation,
    /// Positions of rotary axes.
    Angle,
    /// Instants and durations.
    Time,
    /// Speed along the approach.
    Feed,
    /// Temperatures.
    Temperature,
}

impl Quantity {
    const ALL: [Self; 6] = [
        Self::Length,
        Self::Deviation,
        Self::Angle,
        Self::Time,
        Self::Feed,
        Self::Temperature,
    ];

    /// As it is named on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Length => "length",
            Self::Deviation => "deviation",
            Self::Angle => "angle",
            Self::Time => "time",
            Self::Feed => "feed",
            Self::Temperature => "temperature",
        }
    }

    /// Its units: name, and value in m, rad, s, m/s.
    fn units(self) -> &'static [(&'static str, f64)] {
        const INCH: f64 = 0.0254;
        match self {
            Self::Length | Self::Deviation => &[
                ("m", 1.0),
                ("mm", 1e-3),
                ("um", 1e-6),
                ("in", INCH),
                ("thou", 25.4e-6),
            ],
            Self::Angle => &[("rad", 1.0), ("deg", std::f64::consts::PI / 180.0)],
            Self::Time => &[
                ("s", 1.0),
                ("ms", 1e-3),
                ("min", 60.0),
                ("h", 3600.0),
                ("clock", 1.0),
                ("rfc3339", 1.0),
            ],
            Self::Feed => &[
                ("m/s", 1.0),
                ("mm/s", 1e-3),
                ("mm/min", 1e-3 / 60.0),
                ("in/min", INCH / 60.0),
            ],
            Self::Temperature => &[("degC", 1.0), ("K", 1.0)],
        }
    }
}

/// Units of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Units {
    named: Vec<(Quantity, &'static str, f64)>,
}

impl Units {
    /// Reads `length=mm,angle=deg,…`; µm is `um`.
    ///
    /// # Errors
    /// A quantity or unit that there is not, or a quantity named twice.
    pub fn parse(text: &str) -> Result<Self, ImportError> {
        let mut units = Self::default();
        for one in text.split(',').map(str::trim).filter(|one| !one.is_empty()) {
            let known = || {
                let names = Quantity::ALL.map(|quantity| {
                    let units: Vec<_> = quantity.units().iter().map(|unit| unit.0).collect();
                    format!("{}={}", quantity.name(), units.join("|"))
                });
                ImportError::whole(format!(
                    "{one:?} is no unit; units are {}",
                    names.join(", ")
                ))
            };
            let (name, unit) = one.split_once('=').ok_or_else(known)?;
            let quantity = Quantity::ALL.into_iter().find(|all| all.name() == name);
            let quantity = quantity.ok_or_else(known)?;
            let unit = if unit == "µm" { "um" } else { unit };
            let found = quantity.units().iter().find(|known| known.0 == unit);
            let &(unit, factor) = found.ok_or_else(known)?;
            if units.named.iter().any(|(known, ..)| *known == quantity) {
                let what = format!("the unit of {name} is named twice");
                return Err(ImportError::whole(what));
            }
            units.named.push((quantity, unit, factor));
        }
        Ok(units)
    }

    /// Name of the unit of a quantity, and its value in SI.
    ///
    /// # Errors
    /// Nobody has named it.
    pub fn of(&self, quantity: Quantity) -> Result<(&'static str, f64), ImportError> {
        let named = |quantity| self.named.iter().find(|(known, ..)| *known == quantity);
        let found = named(quantity).or_else(|| match quantity {
            Quantity::Deviation => named(Quantity::Length),
            _ => None,
        });
        found
            .map(|&(_, unit, factor)| (unit, factor))
            .ok_or_else(|| {
                let units: Vec<_> = quantity.units().iter().map(|unit| unit.0).collect();
                ImportError::whole(format!(
                    "the unit of {} is not known: say --units {}=UNIT, one of {}",
                    quantity.name(),
                    quantity.name(),
                    units.join(", ")
                ))
            })
    }

    /// Name of the unit in which deviations are read only because nobody has named one for them: that of lengths.
    pub fn of_deviations_by_length(&self) -> Option<&'static str> {
        let named = |quantity| self.named.iter().find(|(known, ..)| *known == quantity);
        let &(_, unit, _) = named(Quantity::Length)?;
        named(Quantity::Deviation).is_none().then_some(unit)
    }

    /// A temperature in °C.
    ///
    /// # Errors
    /// Nobody has named its unit.
    pub fn celsius(&self, value: f64) -> Result<f64, ImportError> {
        let (unit, _) = self.of(Quantity::Temperature)?;
        Ok(if unit == "K" { value - 273.15 } else { value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_what_was_named_and_nothing_else() {
        let units = Units::parse("length=mm, angle=deg,deviation=µm,temperature=K").expect("units");
        assert_eq!(units.of(Quantity::Length), Ok(("mm", 1e-3)));
        assert_eq!(units.of(Quantity::Deviation), Ok(("um", 1e-6)));
        assert_eq!(units.of_deviations_by_length(), None);
        let lengths = Units::parse("length=mm,angle=deg").expect("units");
        assert_eq!(lengths.of_deviations_by_length(), Some("mm"));
        assert_eq!(units.celsius(293.15), Ok(20.0));
        let asked = units.of(Quantity::Feed).expect_err("not named").to_string();
        assert!(asked.contains("--units feed=UNIT"), "{asked}");
        assert!(Units::parse("length=furlong").is_err());
        assert!(Units::parse("length=mm,length=m").is_err());
        // An inch is 25.4 mm exactly (ISO 80000-3).
        let inch = Units::parse("length=in").expect("units");
        assert_eq!(inch.of(Quantity::Deviation), Ok(("in", 0.0254)));
        let sheet = Units::parse("length=in,deviation=thou,time=min").expect("units");
        assert_eq!(sheet.of(Quantity::Deviation), Ok(("thou", 25.4e-6)));
        assert_eq!(sheet.of(Quantity::Time), Ok(("min", 60.0)));
    }
}
