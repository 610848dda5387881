//! Lengths and angles as types, for settings and bounds where a bare number could be read in the wrong unit.
//!
//! ```text
//!  wear_limit_mm = 0.5  ──from_mm──>  Length  ──um──>  "500.0 µm"
//!  EA0B = 29e-6 rad     ──from_rad─>  Angle   ──urad─> "29.0 µrad"
//! ```
//!
//! A number becomes a quantity where it enters, with its unit in the name of the constructor, and a number again where
//! it leaves. Two kinds of quantity cannot be compared or added. Kernels work on bare numbers in m and rad.
//!
//! ```
//! use machine_state::quantity::{Angle, Length};
//!
//! let limit = Length::from_mm(0.5);
//! assert!(!Length::from_um(620.0).within(limit));
//! assert_eq!(limit.to_string(), "500.0 µm");
//! assert_eq!(Angle::from_urad(29.0).to_string(), "29.0 µrad");
//! ```
//!
//! ```compile_fail
//! # use machine_state::quantity::{Angle, Length};
//! let mixed = Length::from_mm(1.0) < Angle::from_urad(1.0);
//! ```

use std::fmt;

macro_rules! quantity {
    (
        $(#[$meta:meta])*
        $name:ident, $unit:literal: $from:ident, $get:ident;
        micro $micro:literal: $from_micro:ident, $get_micro:ident;
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        pub struct $name(f64);

        impl $name {
            #[doc = concat!("From ", $unit, ".")]
            pub const fn $from(value: f64) -> Self {
                Self(value)
            }

            #[doc = concat!("From ", $micro, ".")]
            pub fn $from_micro(value: f64) -> Self {
                Self(value * 1e-6)
            }

            #[doc = concat!("In ", $unit, ".")]
            pub const fn $get(self) -> f64 {
                self.0
            }

            #[doc = concat!("In ", $micro, ".")]
            pub fn $get_micro(self) -> f64 {
                self.0 * 1e6
            }

            /// Its magnitude.
            #[must_use]
            pub fn abs(self) -> Self {
                Self(self.0.abs())
            }

            /// The smaller one; the other where one is not a number.
            #[must_use]
            pub fn min(self, other: Self) -> Self {
                Self(self.0.min(other.0))
            }

            /// The larger one; the other where one is not a number.
            #[must_use]
            pub fn max(self, other: Self) -> Self {
                Self(self.0.max(other.0))
            }

            /// True where its magnitude is at most `limit`; never where one of both is not a number.
            pub fn within(self, limit: Self) -> bool {
                self.0.abs() <= limit.0
            }
        }

        /// To a tenth of the millionth of its unit.
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!("{:.1} ", $micro), self.$get_micro())
            }
        }
    };
}

quantity! {
    /// A length.
    Length, "m": from_m, m;
    micro "µm": from_um, um;
}

quantity! {
    /// An angle.
    Angle, "rad": from_rad, rad;
    micro "µrad": from_urad, urad;
}

impl Length {
    /// From mm.
    pub fn from_mm(value: f64) -> Self {
        Self(value * 1e-3)
    }
}

impl std::ops::Neg for Length {
    type Output = Self;

    fn neg(self) -> Self {
        Self(-self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantity_in_another_unit_is_the_same_quantity() {
        assert_eq!(Length::from_mm(0.25), Length::from_m(0.25e-3));
        assert_eq!(Length::from_um(250.0).m(), 250e-6);
        assert_eq!(Angle::from_urad(500.0).rad(), 500e-6);
    }

    #[test]
    fn what_is_not_a_number_is_within_no_limit_and_no_limit() {
        let (one, nan) = (Length::from_mm(1.0), Length::from_m(f64::NAN));
        assert!(one.within(one) && (-one).within(one));
        assert!(!nan.within(one) && !one.within(nan));
        assert_eq!((nan.min(one), nan.max(one)), (one, one));
    }
}
