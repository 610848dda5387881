//! Features fitted to points, with their uncertainty.

use analysis::feature::{self, Criterion, Fitted, Rules, Sample};
use nalgebra::{Point3, Vector3};
use probecell_msgs::InspectionFeature;
use pyo3::prelude::*;

use crate::errors::{input, wrong};

/// A feature fitted to points; lengths in m, angles in rad. Uncertainties are standard uncertainties (GUM) by independent errors of the
/// points alone.
#[pyclass(frozen, module = "probecell")]
pub(crate) struct Fit {
    fitted: Fitted,
}

/// Nominal feature of a fit.
struct Nominal {
    kind: u8,
    origin: Vector3<f64>,
    axis: Vector3<f64>,
    radius: f64,
}

impl Nominal {
    /// Outward normal and deviation of a ball's centre from the nominal surface; `None` on its axis or in its centre.
    fn sample(&self, centre: Vector3<f64>, ball_radius: f64) -> Option<Sample> {
        let arm = centre - self.origin;
        let across = match self.kind {
            InspectionFeature::PLANE => self.axis * self.axis.dot(&arm),
            InspectionFeature::SPHERE => arm,
            _ => arm - self.axis * self.axis.dot(&arm),
        };
        let distance = across.norm();
        let outward = across.try_normalize(0.0);
        let (normal, deviation) = match self.kind {
            InspectionFeature::PLANE => (self.axis, self.axis.dot(&arm) - ball_radius),
            InspectionFeature::BORE => (-outward?, self.radius - ball_radius - distance),
            _ => (outward?, distance - ball_radius - self.radius),
        };
        Some(Sample {
            centre: Point3::from(centre),
            normal,
            deviation,
        })
    }
}

/// Fits a feature to measured points as the cell's analysis does.
///
/// `kind`: `plane`, `cylinder`, `bore` or `sphere`. `points`: rows of x, y, z in m, an array or lists: points on the surface, or centres of
/// a ball of `ball_radius` (m). `origin`, `axis`, `radius`: the nominal feature, m (`axis`: of a plane its outward normal).
/// `touch_uncertainty`: standard uncertainty of one point along the normal, m. `criterion` (ISO 14405-1, ISO 1101): `least_squares`,
/// `minimum_zone`, `minimum_circumscribed` or `maximum_inscribed`. `outlier_limit`: robust standard deviations beyond which a point is left
/// out; without it every point counts.
///
/// Raises `InputError` where the points do not determine the feature.
#[pyfunction]
#[pyo3(signature = (kind, points, *, touch_uncertainty, origin=[0.0; 3], axis=[0.0, 0.0, 1.0], radius=0.0, ball_radius=0.0,
    criterion="least_squares", outlier_limit=None))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn fit(
    py: Python<'_>,
    kind: &str,
    points: &Bound<'_, PyAny>,
    touch_uncertainty: f64,
    origin: [f64; 3],
    axis: [f64; 3],
    radius: f64,
    ball_radius: f64,
    criterion: &str,
    outlier_limit: Option<f64>,
) -> PyResult<Fit> {
    let kinds = [
        ("plane", InspectionFeature::PLANE),
        ("cylinder", InspectionFeature::CYLINDER),
        ("bore", InspectionFeature::BORE),
        ("sphere", InspectionFeature::SPHERE),
    ];
    let kind = one_of("kind", kind, &kinds)?;
    let criteria = [
        ("least_squares", Criterion::LeastSquares),
        ("minimum_zone", Criterion::MinimumZone),
        ("minimum_circumscribed", Criterion::MinimumCircumscribed),
        ("maximum_inscribed", Criterion::MaximumInscribed),
    ];
    let criterion = one_of("criterion", criterion, &criteria)?;
    let lengths = [
        ("touch_uncertainty", touch_uncertainty),
        ("radius", radius),
        ("ball_radius", ball_radius),
    ];
    for (name, value) in lengths {
        if !(value.is_finite() && value >= 0.0) {
            return Err(wrong(format!(
                "{name} must be a length in m that is not negative, not {value}"
            )));
        }
    }
    let direction = Vector3::from(axis).try_normalize(1e-12);
    let direction = direction.filter(|axis| axis.iter().all(|part| part.is_finite()));
    let nominal = Nominal {
        kind,
        origin: Vector3::from(origin),
        axis: direction.ok_or_else(|| wrong("axis must be a direction"))?,
        radius,
    };
    let mut samples = Vec::new();
    for (row, point) in points.try_iter()?.enumerate() {
        let place = point?.extract::<[f64; 3]>();
        let place = place.map_err(|_| wrong(format!("point {row} is no x, y, z")))?;
        if !place.iter().all(|part| part.is_finite()) {
            return Err(wrong(format!(
                "point {row} has a coordinate that is not finite"
            )));
        }
        let sample = nominal.sample(Vector3::from(place), ball_radius);
        samples.push(sample.ok_or_else(|| {
            wrong(format!(
                "point {row} stands in the middle of the nominal feature, so that it has no side"
            ))
        })?);
    }
    let feature = InspectionFeature {
        kind,
        origin: origin.into(),
        axis: <[f64; 3]>::from(nominal.axis).into(),
        radius,
        ..InspectionFeature::default()
    };
    let rules = Rules {
        criterion,
        outlier_limit,
    };
    let fitted =
        py.detach(|| feature::fit(&feature, ball_radius, &samples, &rules, touch_uncertainty));
    Ok(Fit {
        fitted: fitted.map_err(input)?,
    })
}

/// The value of a name.
fn one_of<T: Copy>(what: &str, given: &str, known: &[(&str, T)]) -> PyResult<T> {
    let found = known.iter().find(|(name, _)| *name == given);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
        wrong(format!(
            "{what} {given:?} is not one of {}",
            names.join(", ")
        ))
    })
}

#[pymethods]
impl Fit {
    /// Diameter; of a plane the distance of the measured middle from the origin of coordinates along the nominal normal, m.
    #[getter]
    fn size(&self) -> f64 {
        self.fitted.size
    }

    /// The same of the nominal feature, m.
    #[getter]
    fn nominal_size(&self) -> f64 {
        self.fitted.nominal_size
    }

    /// Standard uncertainty of the size, m.
    #[getter]
    fn size_uncertainty(&self) -> f64 {
        self.fitted.size_uncertainty
    }

    /// Peak to valley of the residuals, m.
    #[getter]
    fn form(&self) -> f64 {
        self.fitted.form
    }

    /// Standard uncertainty of the form, m.
    #[getter]
    fn form_uncertainty(&self) -> f64 {
        self.fitted.form_uncertainty
    }

    /// Fitted centre, or a point of the axis or plane, m.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.fitted.origin.coords.into()
    }

    /// Fitted direction, of unit length.
    #[getter]
    fn axis(&self) -> [f64; 3] {
        self.fitted.axis.into()
    }

    /// Offset from the nominal position (m), and its standard uncertainty along that offset; `None` where the points do not determine it.
    #[getter]
    fn position(&self) -> Option<([f64; 3], f64)> {
        self.fitted.position.map(|(offset, u)| (offset.into(), u))
    }

    /// Offset from the nominal direction (rad), and its standard uncertainty along that offset; `None` where the points do not
    /// determine it.
    #[getter]
    fn orientation(&self) -> Option<([f64; 3], f64)> {
        self.fitted
            .orientation
            .map(|(offset, u)| (offset.into(), u))
    }

    /// Rows of points that were left out as outliers.
    #[getter]
    fn left_out(&self) -> Vec<usize> {
        self.fitted.left_out.clone()
    }

    /// How it was fitted, where not as asked.
    #[getter]
    fn note(&self) -> &'static str {
        self.fitted.note
    }

    fn __repr__(&self) -> String {
        format!(
            "<probecell.Fit size {:.6} mm, u {:.3} um, form {:.3} um>",
            self.fitted.size * 1e3,
            self.fitted.size_uncertainty * 1e6,
            self.fitted.form * 1e6
        )
    }
}
