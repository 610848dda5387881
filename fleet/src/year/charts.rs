//! Control charts for comparison: Shewhart (ISO 7870-2) and EWMA (ISO 7870-6), with mean and standard deviation from the first
//! points.

/// Points from which the chart is made.
const FIRST: usize = 30;
/// Weight of the newest point, and limit: λ = 0.2 and L = 2.962 have a mean run length of 500 (Lucas and Saccucci 1990).
const EWMA: (f64, f64) = (0.2, 2.962);

/// Mean and standard deviation of the first points, and the points after them; none where there are too few.
fn begun(values: &[f64]) -> Option<(f64, f64, &[f64])> {
    let (first, rest) = values.split_at_checked(FIRST)?;
    let deviation = metrology::statistics::standard_deviation(first);
    (deviation > 0.0).then(|| (metrology::statistics::mean(first), deviation, rest))
}

/// Indices of points beyond three standard deviations.
pub fn shewhart(values: &[f64]) -> Vec<usize> {
    let Some((mean, deviation, rest)) = begun(values) else {
        return Vec::new();
    };
    let beyond = rest
        .iter()
        .enumerate()
        .filter(|(_, value)| (*value - mean).abs() > 3.0 * deviation);
    beyond.map(|(place, _)| place + FIRST).collect()
}

/// Indices at which the exponentially weighted mean is beyond its limit; it begins anew after each.
pub fn ewma(values: &[f64]) -> Vec<usize> {
    let Some((mean, deviation, rest)) = begun(values) else {
        return Vec::new();
    };
    let (weight, limit) = EWMA;
    let (mut smooth, mut count, mut alarms) = (0.0, 0, Vec::new());
    for (place, value) in rest.iter().enumerate() {
        count += 1;
        smooth = (1.0 - weight) * smooth + weight * (value - mean) / deviation;
        let variance = weight / (2.0 - weight) * (1.0 - (1.0 - weight).powi(2 * count));
        if smooth.abs() > limit * variance.sqrt() {
            alarms.push(place + FIRST);
            (smooth, count) = (0.0, 0);
        }
    }
    alarms
}
