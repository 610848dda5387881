//! One-dimensional maximisation of a unimodal function.

/// Rounds of the golden-section search.
const REFINED: usize = 16;

/// Argument of the maximum of a unimodal function (golden-section search, Kiefer 1953).
pub fn golden_section(mut low: f64, mut high: f64, quality: impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut qa, mut qb) = (quality(a), quality(b));
    for _ in 0..REFINED {
        if qa > qb {
            (high, b, qb) = (b, a, qa);
            a = high - ratio * (high - low);
            qa = quality(a);
        } else {
            (low, a, qa) = (a, b, qb);
            b = low + ratio * (high - low);
            qb = quality(b);
        }
    }
    0.5 * (low + high)
}
