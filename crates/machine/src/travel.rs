//! Whether targets are within the travel of their axes.

/// An axis target beyond its soft limits.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "move {index} takes axis {axis} to {target}, outside its limits {least} to {most} (m or rad)"
)]
pub struct TravelError {
    /// Index of the target.
    pub index: usize,
    /// Index of the axis.
    pub axis: usize,
    /// Commanded position, m or rad.
    pub target: f64,
    /// Lower limit, m or rad.
    pub least: f64,
    /// Upper limit, m or rad.
    pub most: f64,
}

/// Checks the joint targets of all moves against (least, most) per axis, m or rad, before the first is made. Joints go
/// straight from target to target, so targets within limits keep every move within. A missing or undefined number
/// counts as outside.
///
/// # Errors
/// [`TravelError`] for the first target outside.
pub fn check_travel(targets: &[Vec<f64>], limits: &[(f64, f64)]) -> Result<(), TravelError> {
    for (index, target) in targets.iter().enumerate() {
        for (axis, &(least, most)) in limits.iter().enumerate() {
            let target = target.get(axis).copied().unwrap_or(f64::NAN);
            if !(least..=most).contains(&target) {
                return Err(TravelError {
                    index,
                    axis,
                    target,
                    least,
                    most,
                });
            }
        }
    }
    Ok(())
}
