//! Resolution and equality of the offsets that corrections change.

/// Resolution in which offsets are proposed, written and compared, m or rad: 0.1 µm and 0.1 µrad.
///
/// Controllers keep lengths to 1e-7 m (increment system IS-C) or finer. A proposal is a whole multiple of it, so that what is
/// read back is what was approved; a controller that keeps less shows in the read-back, and the correction counts as failed
/// instead of as another one than the operator approved.
pub const RESOLUTION: f64 = 1e-7;

/// The nearest multiple of [`RESOLUTION`].
pub fn to_resolution(value: f64) -> f64 {
    // Multiplying and dividing by a power of ten gives the number that the decimal text has.
    (value * 1e7).round() / 1e7
}

/// True where two readings of an offset are the same value: they differ by at most half the resolution. Not where one of them
/// is NaN.
pub fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 0.5 * RESOLUTION
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_offset_is_the_number_of_its_decimal_text() {
        assert_eq!(to_resolution(-1.100_04e-5), -11e-6);
        assert_eq!(to_resolution(3.349_96e-5), 33.5e-6);
    }

    #[test]
    fn offsets_are_equal_within_half_the_resolution() {
        assert!(is_same(-11e-6, -11.049e-6) && is_same(0.0, 0.0));
        assert!(!is_same(-11e-6, -11.06e-6));
        assert!(!is_same(f64::NAN, 0.0) && !is_same(0.0, f64::NAN));
    }
}
