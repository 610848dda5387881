//! The shear of three slides X, Y, Z, from the location errors of their axes, by the chain.
//!
//! With U upper triangular, true = Q·U·reading: Q turns the machine against the part, which alignment takes, and U is out of square.
//! Its factors are those of a correction of skew: x moves by `xy` for each unit of y, by `xz` for each of z, and y by `yz` for each of z.

use machine::{Chain, ChainErrors, LinkError};
use nalgebra::{Isometry3, Matrix3, Point3};

use crate::CureError;
use crate::job::Job;

/// Shear of three slides, per unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Skew {
    /// Of x with y.
    pub(crate) xy: f64,
    /// Of x with z.
    pub(crate) xz: f64,
    /// Of y with z.
    pub(crate) yz: f64,
}

/// Names of the slides.
const SLIDES: [&str; 3] = ["X", "Y", "Z"];

/// The shear that the causes of a job make of a machine.
///
/// # Errors
/// [`CureError::Report`] for a machine without slides X, Y and Z, and for an error that is no squareness of them.
pub(crate) fn skew(job: &Job<'_>) -> Result<Skew, CureError> {
    let chain = job.chain()?;
    let mut links = Vec::new();
    for cause in job
        .causes
        .iter()
        .filter(|one| one.kind() == "link.E<c>0<A>")
    {
        let own = SLIDES.contains(&cause.axis());
        let name = cause.name.strip_prefix("link.").unwrap_or(&cause.name);
        let link = LinkError::named(&chain, name, cause.value("e"));
        let link = link.map_err(|error| CureError::Report(error.to_string()))?;
        if !own || !link.turns() {
            return Err(CureError::Report(format!(
                "{} is no squareness of the slides X, Y and Z, which is all that {} holds: name the others by --only",
                cause.name, job.request.format.name
            )));
        }
        links.push(link);
    }
    let errors = ChainErrors::of_links(&chain, &links);
    let nominal = directions(&chain, &ChainErrors::none(chain.joints().len()))?;
    let real = directions(&chain, &errors)?;
    let inverse = nominal.try_inverse();
    let inverse = inverse
        .ok_or_else(|| CureError::Report("X, Y and Z are not three directions".to_owned()))?;
    let upper = (inverse * real).qr().r();
    // Which way a row of it points is a choice of the decomposition.
    let row = |index: usize| upper[(index, index)].signum();
    Ok(Skew {
        xy: row(0) * upper[(0, 1)],
        xz: row(0) * upper[(0, 2)],
        yz: row(1) * upper[(1, 2)],
    })
}

/// Where the ball goes in the part with each slide, as columns.
fn directions(chain: &Chain, errors: &ChainErrors) -> Result<Matrix3<f64>, CureError> {
    let zero = vec![0.0; chain.axes().len()];
    let ball = |positions: &[f64]| {
        chain.ball_in_part_with(positions, &Isometry3::identity(), &Point3::origin(), errors)
    };
    let start = ball(&zero);
    let mut columns = Vec::new();
    for name in SLIDES {
        let axis = chain.axis_index(name).ok_or_else(|| {
            CureError::Report(format!("the robot description has no axis {name}"))
        })?;
        let mut moved = zero.clone();
        moved[axis] = 1.0;
        columns.push(ball(&moved) - start);
    }
    Ok(Matrix3::from_columns(&columns))
}
