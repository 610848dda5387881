//! Klipper: `rotation_distance` of the steppers, and a profile of `[skew_correction]`.
//!
//! Klipper's configuration reference: a stepper turns once for each `rotation_distance` that is commanded, so that an axis which goes
//! farther than commanded has a longer one. A profile of `[skew_correction]` holds the factors by which x follows y and z, and y
//! follows z (`klippy/extras/skew_correction.py`: the commanded x becomes x − y·xy − z·(xz − xy·yz), y becomes y − z·yz).

use crate::CureError;
use crate::cause::Cause;
use crate::head::{Change, commented, number};
use crate::job::{Format, Job};
use crate::settings::Settings;
use crate::skew::{Skew, skew};

/// The printer.cfg with new rotation distances and a profile of skew.
pub(crate) const KLIPPER: Format = Format {
    name: "klipper",
    about: "Klipper's printer.cfg with new rotation_distance and a skew profile; --current printer.cfg, for skew --urdf",
    holds: &["axis.<A>.scale", "link.E<c>0<A>"],
    write,
};

/// The profile that is written.
const PROFILE: &str = "probecell";

fn write(job: &Job<'_>) -> Result<String, CureError> {
    let file = job.current("the printer.cfg with which the machine was measured")?;
    let mut settings = Settings::of(file);
    let mut changes = Vec::new();
    let scales: Vec<&Cause> = job
        .causes
        .iter()
        .filter(|one| one.kind() == "axis.<A>.scale")
        .collect();
    for cause in &scales {
        changes.extend(rotation(&mut settings, cause)?);
    }
    let mut note = None;
    if scales.len() < job.causes.len() {
        let skew = skew(job)?;
        changes.extend(profile(&mut settings, &skew)?);
        note = Some(format!(
            "load the profile at every start: SKEW_PROFILE LOAD={PROFILE}"
        ));
    }
    let undo = format!("load {} again, and home", file.name);
    let mut head = job.head(&job.causes, &changes, &undo);
    head.extend(note);
    Ok(commented("#", &head) + &settings.changed())
}

/// All steppers of an axis.
fn rotation(settings: &mut Settings<'_>, cause: &Cause) -> Result<Vec<Change>, CureError> {
    // Each motor of these moves one axis.
    let kinematics = settings.text("printer", "kinematics").unwrap_or("none");
    if kinematics != "cartesian" {
        return Err(settings.wrong(&format!(
            "[printer] kinematics is {kinematics}: a stepper of it is no axis, and rotation_distance is not written"
        )));
    }
    let letter = cause.axis().to_ascii_lowercase();
    let numbers = std::iter::once(String::new()).chain((1..10).map(|number| number.to_string()));
    let mut changes = Vec::new();
    for number_of in numbers {
        let section = format!("stepper_{letter}{number_of}");
        let Some(before) = settings.number(&section, "rotation_distance")? else {
            continue;
        };
        let by = |k: f64| before * (1.0 + k);
        let after = by(cause.value("k"));
        settings.set(&section, "rotation_distance", &number(after))?;
        changes.push(Change {
            what: format!("[{section}] rotation_distance"),
            before: Some(before),
            after,
            interval: Some(cause.interval("k").map(by)),
        });
    }
    if changes.is_empty() {
        return Err(settings.wrong(&format!(
            "it has no [stepper_{letter}] with a rotation_distance"
        )));
    }
    Ok(changes)
}

fn profile(settings: &mut Settings<'_>, skew: &Skew) -> Result<Vec<Change>, CureError> {
    if let Some(other) = settings.begins("skew_correction ") {
        return Err(settings.wrong(&format!(
            "[{other}] is a profile already: measure after SKEW_PROFILE CLEAR, and take it out first"
        )));
    }
    let own = match settings.begins("skew_correction") {
        Some(_) => "",
        None => "[skew_correction]\n",
    };
    let factors = [
        ("xy_skew", skew.xy),
        ("xz_skew", skew.xz),
        ("yz_skew", skew.yz),
    ];
    let lines = factors.map(|(name, factor)| format!("{name} = {factor:.9}\n"));
    // What Klipper saves itself stands at the end.
    settings.append(
        &format!("\n{own}[skew_correction {PROFILE}]\n{}", lines.concat()),
        "#*# <",
    );
    let change = |(name, factor): (&str, f64)| Change {
        what: format!("[skew_correction {PROFILE}] {name}"),
        before: None,
        after: factor,
        interval: None,
    };
    Ok(factors.map(change).into())
}
