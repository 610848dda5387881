//! SINUMERIK 840D: leadscrew error compensation (`ENC_COMP`) as a program.
//!
//! Function manual K3, "Interpolatory compensation": the control adds the value to the actual position of the axis, so that a positive
//! value moves it in the negative direction; between the points, which are evenly spaced, it is linear. The value is therefore the
//! error itself: true position less reading.

use super::table::even_places;
use crate::CureError;
use crate::axis_error::errors;
use crate::head::{commented, number};
use crate::job::{Format, Job};

/// A program that loads the table of one axis.
pub(crate) const ENC_COMP: Format = Format {
    name: "sinumerik-enc-comp",
    about: "SINUMERIK's leadscrew error compensation of one axis ($AA_ENC_COMP); --from, --to",
    holds: &[
        "axis.<A>.scale",
        "axis.<A>.positioning",
        "axis.<A>.cyclic",
        "axis.<A>.indexing",
    ],
    write,
};

/// Most points of a table (MD38000).
const MOST: usize = 5000;

fn write(job: &Job<'_>) -> Result<String, CureError> {
    let (axis, own, unit) = job.of_one_axis()?;
    let places = even_places(&own, job.travel(unit)?, job.request.points, MOST)?;
    let errors = errors(&own, &axis, &places)?;
    let machine_axis = format!("{axis}1");
    let values = errors.iter().enumerate().map(|(point, [up, down])| {
        format!(
            "$AA_ENC_COMP[0,{point},{machine_axis}]={:.6}\n",
            0.5 * (up + down) * unit
        )
    });
    let (Some(first), Some(last)) = (places.first(), places.last()) else {
        return Err(CureError::Report("the table has no places".to_owned()));
    };
    let step = (last - first) / (places.len() as f64 - 1.0);
    let limits = [
        ("STEP", step * unit),
        ("MIN", first * unit),
        ("MAX", last * unit),
    ];
    let limits =
        limits.map(|(name, value)| format!("$AA_ENC_COMP_{name}[0,{machine_axis}]={value:.6}\n"));
    let undo = format!("MD32700 $MA_ENC_COMP_ENABLE[0,{machine_axis}]=0");
    let mut head = job.head(&own, &[], &undo);
    head.extend([
        format!("before: MD32700 of {machine_axis} is 0, and was while the machine was measured"),
        format!("load: MD38000 of {machine_axis} at least {}, run this, then MD32700 = 1, and approach the reference point", places.len()),
        format!("largest value {}", number(largest(&errors) * unit)),
    ]);
    let parts = [
        "%_N_AX_EEC_INI\n".to_owned(),
        commented(";", &head),
        "CHANDATA(1)\n".to_owned(),
        values.collect::<Vec<_>>().concat(),
        limits.concat(),
        format!("$AA_ENC_COMP_IS_MODULO[0,{machine_axis}]=0\nM17\n"),
    ];
    Ok(parts.concat())
}

fn largest(errors: &[[f64; 2]]) -> f64 {
    let sizes = errors.iter().map(|[up, down]| (0.5 * (up + down)).abs());
    sizes.fold(0.0, f64::max)
}
