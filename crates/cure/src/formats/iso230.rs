//! A table of positioning errors for people, and for controls in which a person enters them.
//!
//! ISO 230-2: of each position the deviation, actual less target, of an approach from either side, their mean, and the reversal value.
//! U is the expanded uncertainty (95 %) of the mean as the report states its parameters, which are taken as independent.

use super::table::places;
use crate::CureError;
use crate::axis_error::{errors, turns};
use crate::cause::Cause;
use crate::head::commented;
use crate::job::{Format, Job};

/// The table as CSV.
pub(crate) const ISO_230: Format = Format {
    name: "iso230-csv",
    about: "deviations of one axis over its travel after ISO 230-2, as CSV; --from, --to",
    holds: &[
        "axis.<A>.scale",
        "axis.<A>.positioning",
        "axis.<A>.cyclic",
        "axis.<A>.backlash",
        "axis.<A>.indexing",
    ],
    write,
};

/// µm in a metre, µrad in a radian.
const MICRO: f64 = 1e6;
/// Most rows.
const MOST: usize = 10_000;

fn write(job: &Job<'_>) -> Result<String, CureError> {
    let (axis, own, unit) = job.of_one_axis()?;
    let names = if own.iter().any(turns) {
        ["deg", "urad"]
    } else {
        ["mm", "um"]
    };
    let places = places(&own, job.travel(unit)?, job.request.points, MOST)?;
    let errors = errors(&own, &axis, &places)?;
    let uncertainties = uncertainties(&own, &axis, &places, &errors)?;
    let rows =
        places
            .iter()
            .zip(&errors)
            .zip(&uncertainties)
            .map(|((at, [up, down]), uncertainty)| {
                let [up, down, mean, lost, uncertainty] =
                    [*up, *down, 0.5 * (up + down), up - down, *uncertainty]
                        .map(|value| value * MICRO);
                format!(
                    "{axis},{:.6},{up:.3},{down:.3},{mean:.3},{lost:.3},{uncertainty:.3}\n",
                    at * unit
                )
            });
    let [at, error] = names;
    let columns = format!(
        "axis,position_{at},forward_{error},reverse_{error},mean_{error},reversal_{error},U_{error}\n"
    );
    let head = job.head(&own, &[], "take the values out of the control");
    let head = head.into_iter().chain([
        "deviation = actual less target; a control that wants corrections takes the negative"
            .to_owned(),
    ]);
    let head: Vec<String> = head.collect();
    Ok(commented("#", &head) + &columns + &rows.collect::<Vec<_>>().concat())
}

/// Of the mean deviation at each place: each parameter moved by the half width of its interval, the changes added in squares.
fn uncertainties(
    causes: &[Cause],
    axis: &str,
    places: &[f64],
    errors_now: &[[f64; 2]],
) -> Result<Vec<f64>, CureError> {
    let mut squares = vec![0.0; places.len()];
    for (index, cause) in causes.iter().enumerate() {
        for (number, parameter) in cause.parameters.iter().enumerate() {
            let half = 0.5 * (parameter.ci95[1] - parameter.ci95[0]);
            if half == 0.0 {
                continue;
            }
            let mut moved = causes.to_vec();
            moved[index].parameters[number].value += half;
            let changed = errors(&moved, axis, places)?;
            for ((square, new), old) in squares.iter_mut().zip(&changed).zip(errors_now) {
                *square += (0.5 * (new[0] + new[1] - old[0] - old[1])).powi(2);
            }
        }
    }
    Ok(squares.into_iter().map(f64::sqrt).collect())
}
