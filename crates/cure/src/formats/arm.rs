//! What an arm in motion showed, in its robot description: a load at the flange, masses of the links, friction of the joints.
//!
//! A load is added to the link on which it hangs, what was found of a link to that link, friction to what a joint declares already.
//! A body stays one that can exist ([`Inertial::nearest`]); where that takes something off, the file says so.

use std::collections::BTreeMap;

use machine::chain::PROBE_MOUNT;
use machine::inertial::declared_friction;
use machine::{Inertial, PARAMETERS};
use nalgebra::{Matrix3, Vector3};

use super::description::Description;
use crate::CureError;
use crate::cause::Cause;
use crate::head::Change;
use crate::job::{File, Job};

/// Effects of an arm in motion that a robot description holds.
pub(super) const PAYLOAD: &str = "drive.payload";
pub(super) const LINKS: &str = "drive.link_inertia";
pub(super) const COULOMB: &str = "drive.coulomb_friction";
pub(super) const VISCOUS: &str = "drive.viscous_friction";

/// Least mass of a link over what it has.
const LEAST: f64 = 0.05;

/// A body is another than the one found where a parameter differs by more than this share of what its mass makes at its centre, or at
/// this distance (m).
const ROUNDED: f64 = 0.01;
const SMALL: f64 = 0.01;

/// Least change that the file names, kg or m.
const SHOWN: f64 = 1e-6;

/// Names of the inertial parameters of a link in a report, in the order of [`Inertial::parameters`].
const NAMES: [&str; PARAMETERS] = [
    "mass", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz",
];

/// Writes what the causes of a job say of masses and friction; what it changes, and what has no place there.
pub(super) fn write(
    job: &Job<'_>,
    description: &mut Description<'_>,
) -> Result<(Vec<Change>, Vec<String>), CureError> {
    let file = job.urdf()?;
    let (mut changes, mut remarks) = (Vec::new(), Vec::new());
    for (link, added) in masses(job)? {
        let before = Inertial::of_link(&file.text, &link)?;
        let before = before.ok_or_else(|| missing(file, "link", &link))?;
        let mass = before.mass.max(added[0]);
        if mass <= 0.0 {
            return Err(file.wrong(format!(
                "its link {link} has no mass: the arm was measured against another description"
            )));
        }
        let mut parameters = before.parameters();
        for (sum, more) in parameters.iter_mut().zip(added) {
            *sum += more;
        }
        let after = Inertial::nearest(&parameters, LEAST * mass);
        let size = mass * after.centre.norm_squared().max(SMALL * SMALL);
        let mut pairs = after.parameters().into_iter().zip(parameters);
        if pairs.any(|(made, asked)| (made - asked).abs() > ROUNDED * size) {
            remarks.push(format!(
                "{link}: no body has the inertia that was found; it has the nearest"
            ));
        }
        description.inertial(&link, &after)?;
        let numbers = |body: &Inertial| [body.mass, body.centre.x, body.centre.y, body.centre.z];
        let pairs = numbers(&before).into_iter().zip(numbers(&after));
        let named = pairs.zip(["mass, kg", "x, m", "y, m", "z, m"]);
        let changed = named.filter(|((before, after), _)| (before - after).abs() > SHOWN);
        changes.extend(changed.map(|((before, after), what)| Change {
            what: format!("{link} {what}"),
            before: Some(before),
            after,
            interval: None,
        }));
    }
    if causes(job, LINKS).next().is_some() {
        remarks.push("inertias of the links changed as well".to_owned());
    }
    if causes(job, PAYLOAD).next().is_some() {
        remarks.push("the load is a point: its inertia is not known".to_owned());
    }
    friction(job, description, (&mut changes, &mut remarks))?;
    Ok((changes, remarks))
}

fn missing(file: &File, kind: &str, name: &str) -> CureError {
    file.wrong(format!(
        "it has no {kind} {name}, of which the report speaks"
    ))
}

fn causes<'j>(job: &'j Job<'_>, name: &'static str) -> impl Iterator<Item = &'j Cause> {
    job.causes.iter().filter(move |cause| cause.name == name)
}

/// What is added to the inertial parameters of each link.
fn masses(job: &Job<'_>) -> Result<BTreeMap<String, [f64; PARAMETERS]>, CureError> {
    let mut all: BTreeMap<String, [f64; PARAMETERS]> = BTreeMap::new();
    for cause in causes(job, LINKS) {
        for one in &cause.parameters {
            let (link, what) = one.name.rsplit_once('.').unwrap_or_default();
            if let Some(column) = NAMES.iter().position(|name| *name == what) {
                all.entry(link.to_owned()).or_insert([0.0; PARAMETERS])[column] += one.value;
            }
        }
    }
    for cause in causes(job, PAYLOAD) {
        let load = Inertial {
            mass: cause.value("mass"),
            centre: Vector3::new(cause.value("x"), cause.value("y"), cause.value("z")),
            inertia: Matrix3::zeros(),
        };
        let sum = all.entry(load_link(job)?).or_insert([0.0; PARAMETERS]);
        for (sum, more) in sum.iter_mut().zip(load.parameters()) {
            *sum += more;
        }
    }
    Ok(all)
}

/// The link in whose frame a load was found: `probe_mount`, or the link on which that hangs.
fn load_link(job: &Job<'_>) -> Result<String, CureError> {
    if Inertial::of_link(&job.urdf()?.text, PROBE_MOUNT)?.is_some() {
        return Ok(PROBE_MOUNT.to_owned());
    }
    let link = job.request.report.mount.clone();
    link.ok_or_else(|| {
        let what =
            "the report does not say which link carries the load: diagnose the recordings again";
        CureError::Report(what.to_owned())
    })
}

/// Friction of each joint.
fn friction(
    job: &Job<'_>,
    description: &mut Description<'_>,
    (changes, remarks): (&mut Vec<Change>, &mut Vec<String>),
) -> Result<(), CureError> {
    let mut found: BTreeMap<&str, [Option<f64>; 2]> = BTreeMap::new();
    for (number, name) in [VISCOUS, COULOMB].into_iter().enumerate() {
        for one in causes(job, name).flat_map(|cause| &cause.parameters) {
            match one.name.rsplit_once('.') {
                Some((joint, "coefficient")) => {
                    found.entry(joint).or_default()[number] = Some(one.value);
                }
                // What may be nothing is not missed.
                _ if one.ci95[0] * one.ci95[1] <= 0.0 => {}
                _ => remarks.push(format!(
                    "{} of {name} has no place in a robot description",
                    one.name
                )),
            }
        }
    }
    let file = job.urdf()?;
    for (joint, found) in found {
        let declared = declared_friction(&file.text, joint)?;
        let declared = declared.ok_or_else(|| missing(file, "joint", joint))?;
        let mut written = [None; 2];
        for (number, what) in ["damping", "friction"].into_iter().enumerate() {
            let Some(more) = found[number] else { continue };
            let after = (declared[number] + more).max(0.0);
            written[number] = Some(after);
            changes.push(Change {
                what: format!("{joint} {what}"),
                before: Some(declared[number]),
                after,
                interval: None,
            });
        }
        description.friction(joint, written)?;
    }
    Ok(())
}
