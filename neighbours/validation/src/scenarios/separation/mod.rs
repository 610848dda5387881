//! A shaft measured along a guideway that is not straight (`docs/source_systems.md, C.3, C.4`): 12 samples at 20 mm.
//!
//! Form of the part and straightness of the guideway are assumptions; the guideway is scaled so that its straightness
//! is the 6.72 µm that C.4 states for readings that are not separated. m.

pub(crate) mod guideway;
pub(crate) mod setup_tilt;

use metrology::separation::{Pass, without_line};
use nalgebra::Vector3;
use probecell_msgs::{InspectionFeature, InspectionPlan};

use crate::scenarios::touches::{plan, planned, round};

/// Samples of a pass.
const N: usize = 12;
/// Distance of the samples, m.
const SPACING: f64 = 20e-3;
/// Straightness of the guideway after its line is taken off, root mean square, m.
const STRAIGHTNESS: f64 = 6.72e-6;
/// Radius of the shaft, m.
const RADIUS: f64 = 140e-3;
/// A lathe: the part turns about C, the carriage moves along Z, the slide along X.
pub(crate) const LATHE: &str = r#"<robot name="lathe_zxc">
<link name="foundation"/><link name="workpiece"/>
<joint name="C" type="revolute"><parent link="foundation"/><child link="workpiece"/><axis xyz="0 0 1"/><limit lower="-6.3" upper="6.3" effort="0" velocity="10"/></joint>
<link name="carriage"/>
<joint name="Z" type="prismatic"><parent link="foundation"/><child link="carriage"/><axis xyz="0 0 1"/><limit lower="-1.5" upper="1.5" effort="0" velocity="0.2"/></joint>
<link name="probe_mount"/>
<joint name="X" type="prismatic"><parent link="carriage"/><child link="probe_mount"/><axis xyz="1 0 0"/><limit lower="-1.5" upper="1.5" effort="0" velocity="0.2"/></joint>
</robot>"#;

/// R: a wavy part of some µm.
fn part(z: f64) -> f64 {
    8e-6 * (z / 37e-3).sin() + 3e-6 * (z / 11e-3).cos() + 40e-6 * z
}

/// Shape of the guideway: worn in the middle, more towards one end.
fn bow(z: f64) -> f64 {
    let u = 2.0 * z / (SPACING * (N - 1) as f64) - 1.0;
    u * u + 0.3 * u * u * u
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

fn places() -> impl Iterator<Item = f64> {
    (0..N).map(|i| i as f64 * SPACING)
}

/// Height of the guideway's shape, m.
fn height() -> f64 {
    let bowed: Vec<f64> = places().map(bow).collect();
    STRAIGHTNESS / rms(&without_line(&bowed))
}

/// S at the samples.
fn guideway() -> Vec<f64> {
    let height = height();
    places().map(|z| height * bow(z)).collect()
}

/// Constant and line of the whole guideway, not only of its samples: a matter of how the part is set up.
fn set_up() -> Vec<f64> {
    let (height, last) = (height(), (N - 1) as f64);
    (0..N)
        .map(|i| height * (1.0 / 3.0 + 0.18 * (2.0 * i as f64 / last - 1.0)))
        .collect()
}

/// K of a pass for which the part is moved by `shift` samples.
fn pass(shift: usize, mut noise: impl FnMut() -> f64) -> Pass {
    let samples = guideway().into_iter().enumerate();
    Pass {
        shift,
        readings: samples
            .map(|(i, s)| part((i + shift) as f64 * SPACING) + s + noise())
            .collect(),
    }
}

/// Root mean square in m of what differs from the true guideway beyond a line.
fn error(found: &[f64]) -> f64 {
    let miss = found.iter().zip(guideway()).map(|(a, b)| a - b);
    rms(&without_line(&miss.collect::<Vec<_>>()))
}

/// The plan of one generatrix of the shaft with its form as separation has found it, so that what is left is not the
/// part's.
fn generatrix(id: &str) -> InspectionPlan {
    let points = places()
        .map(|z| planned([RADIUS + part(z), 0.0, z], Vector3::x()))
        .collect();
    let feature = round("shaft", InspectionFeature::CYLINDER, RADIUS);
    plan(id, [0.0; 3], 3e-3, vec![feature], points)
}
