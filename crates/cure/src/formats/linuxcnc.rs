//! LinuxCNC: backlash and scale in the INI, and screw compensation tables (`COMP_FILE`).
//!
//! LinuxCNC's integrator's manual, "INI configuration", section JOINT: `SCALE` and its kin are counts or steps per machine unit;
//! `BACKLASH` is the lost motion, which is added half in each direction; a compensation file of type 0 holds in each line the nominal
//! position and where the joint really is when it has come there forwards and backwards, at most 256 lines, linear between them.
//! With a compensation file the joint's `BACKLASH` is ignored.

use super::table::places;
use crate::CureError;
use crate::axis_error::{errors, turns};
use crate::cause::Cause;
use crate::head::{Change, commented, number};
use crate::job::{Format, Job};
use crate::settings::Settings;

/// The INI with new scales and backlashes.
pub(crate) const INI: Format = Format {
    name: "linuxcnc-ini",
    about: "LinuxCNC's INI with new SCALE and BACKLASH; --current INI",
    holds: &["axis.<A>.scale", "axis.<A>.backlash"],
    write: ini,
};

/// A screw compensation table of one joint.
pub(crate) const COMP: Format = Format {
    name: "linuxcnc-comp",
    about: "LinuxCNC's screw compensation table of one joint (COMP_FILE, type 0); --current INI",
    holds: &[
        "axis.<A>.scale",
        "axis.<A>.positioning",
        "axis.<A>.cyclic",
        "axis.<A>.backlash",
    ],
    write: comp,
};

/// Keys of counts or steps per machine unit.
const SCALES: [&str; 4] = ["SCALE", "INPUT_SCALE", "ENCODER_SCALE", "STEP_SCALE"];
/// Most lines of a table.
const MOST: usize = 256;
const WHAT: &str = "the INI with which the machine was measured";

fn ini(job: &Job<'_>) -> Result<String, CureError> {
    let file = job.current(WHAT)?;
    let mut settings = Settings::of(file);
    let mut changes = Vec::new();
    for cause in &job.causes {
        let section = joint(&settings, cause.axis())?;
        if cause.kind() == "axis.<A>.scale" {
            changes.extend(scales(&mut settings, &section, cause)?);
        } else {
            changes.push(backlash(&mut settings, &section, cause)?);
        }
    }
    let undo = format!("load {} again, and home", file.name);
    let head = job.head(&job.causes, &changes, &undo);
    Ok(commented("#", &head) + &settings.changed())
}

/// The true travel is the reading times 1 + k: a unit of travel has fewer counts by that.
fn scales(
    settings: &mut Settings<'_>,
    section: &str,
    cause: &Cause,
) -> Result<Vec<Change>, CureError> {
    let mut changes = Vec::new();
    for key in SCALES {
        let Some(before) = settings.number(section, key)? else {
            continue;
        };
        let by = |k: f64| before / (1.0 + k);
        let after = by(cause.value("k"));
        settings.set(section, key, &number(after))?;
        changes.push(Change {
            what: format!("[{section}] {key}"),
            before: Some(before),
            after,
            interval: Some(cause.interval("k").map(by)),
        });
    }
    if changes.is_empty() {
        return Err(settings.wrong(&format!(
            "[{section}] has none of {}: write the scale as linuxcnc-comp",
            SCALES.join(", ")
        )));
    }
    Ok(changes)
}

fn backlash(
    settings: &mut Settings<'_>,
    section: &str,
    cause: &Cause,
) -> Result<Change, CureError> {
    if settings.text(section, "COMP_FILE").is_some() {
        return Err(settings.wrong(&format!(
            "[{section}] has a COMP_FILE, with which LinuxCNC ignores BACKLASH: take it out, measure again and write linuxcnc-comp"
        )));
    }
    if cause.parameter("places").is_some() {
        return Err(CureError::Refused {
            effect: cause.name.clone(),
            why: "it varies over the travel, and BACKLASH is one number: write it as linuxcnc-comp"
                .to_owned(),
        });
    }
    let unit = units_per(settings, cause)?;
    let before = settings.number(section, "BACKLASH")?;
    let by = |b: f64| before.unwrap_or(0.0) + b * unit;
    let after = by(cause.value("b"));
    if after < 0.0 {
        return Err(settings.wrong(&format!(
            "[{section}] BACKLASH would become {}, less than nothing: check which joint was measured",
            number(after)
        )));
    }
    settings.set(section, "BACKLASH", &format!("{after:.6}"))?;
    Ok(Change {
        what: format!("[{section}] BACKLASH"),
        before,
        after,
        interval: Some(cause.interval("b").map(by)),
    })
}

fn comp(job: &Job<'_>) -> Result<String, CureError> {
    let file = job.current(WHAT)?;
    let settings = Settings::of(file);
    let (axis, own, _) = job.of_one_axis()?;
    let section = joint(&settings, &axis)?;
    if settings.text(&section, "COMP_FILE").is_some() {
        return Err(settings.wrong(&format!(
            "[{section}] has a COMP_FILE already: measure without it, since two tables do not add up"
        )));
    }
    let Some(first) = own.first() else {
        return Err(CureError::Report(format!(
            "the report has no cause of axis {axis}"
        )));
    };
    let unit = units_per(&settings, first)?;
    let limit = |key: &str| {
        let limit = settings.number(&section, key)?;
        limit.ok_or_else(|| {
            settings.wrong(&format!(
                "[{section}] has no {key}, where a table begins or ends"
            ))
        })
    };
    let travel = [limit("MIN_LIMIT")? / unit, limit("MAX_LIMIT")? / unit];
    let places = places(&own, travel, job.request.points, MOST)?;
    let errors = errors(&own, &axis, &places)?;
    // What BACKLASH gives today falls away with it.
    let before = settings.number(&section, "BACKLASH")?.unwrap_or(0.0);
    let lines = places.iter().zip(&errors).map(|(&at, &[up, down])| {
        let nominal = at * unit;
        let forward = nominal + up * unit - 0.5 * before;
        let reverse = nominal + down * unit + 0.5 * before;
        format!("{nominal:.6} {forward:.6} {reverse:.6}\n")
    });
    let table = lines.collect::<Vec<_>>().concat();
    let undo = format!(
        "take COMP_FILE and COMP_FILE_TYPE out of [{section}] of {}, and home",
        file.name
    );
    let mut head = job.head(&own, &[], &undo);
    head.push(format!(
        "load: [{section}] COMP_FILE = this file, COMP_FILE_TYPE = 0 (nominal, forward, reverse)"
    ));
    if before != 0.0 {
        head.push(format!(
            "[{section}] BACKLASH = {} is in the table, and no longer used",
            number(before)
        ));
    }
    // LinuxCNC reads up to the first line that is none of a table.
    Ok(table + &commented("#", &head))
}

/// Machine units per metre or radian of an axis.
fn units_per(settings: &Settings<'_>, cause: &Cause) -> Result<f64, CureError> {
    if turns(cause) {
        return Ok(1.0_f64.to_degrees());
    }
    match settings.text("TRAJ", "LINEAR_UNITS") {
        Some("mm" | "metric") => Ok(1e3),
        Some("inch" | "in" | "imperial") => Ok(1.0 / 0.0254),
        other => Err(settings.wrong(&format!(
            "[TRAJ] LINEAR_UNITS is {}, not mm or inch",
            other.unwrap_or("missing")
        ))),
    }
}

/// Section of the joint that an axis moves (trivial kinematics): its place among `coordinates=` of the kinematics, else among the
/// coordinates of the trajectory.
fn joint(settings: &Settings<'_>, axis: &str) -> Result<String, CureError> {
    let kinematics = settings.words("KINS", "KINEMATICS").unwrap_or_default();
    let coordinates = kinematics
        .split_once("coordinates=")
        .and_then(|(_, rest)| rest.split_whitespace().next())
        .or_else(|| settings.words("TRAJ", "COORDINATES"));
    let letters = coordinates
        .unwrap_or_default()
        .chars()
        .filter(char::is_ascii_alphabetic);
    let letters: Vec<String> = letters
        .map(|letter| letter.to_ascii_uppercase().to_string())
        .collect();
    let number = letters
        .iter()
        .position(|letter| letter == axis)
        .ok_or_else(|| {
            settings.wrong(&format!(
                "no joint moves axis {axis}: its coordinates are {}",
                letters.concat()
            ))
        })?;
    if letters.iter().filter(|letter| *letter == axis).count() > 1 {
        return Err(settings.wrong(&format!(
            "several joints move axis {axis}: measure and compensate each alone"
        )));
    }
    Ok(format!("JOINT_{number}"))
}
