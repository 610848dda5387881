//! Section `[motion]`: what a report of the channel `time` has shown of it goes into the cell file.
//!
//! Values are written in the units of their keys, with the digits that their intervals carry; comments and layout stay.

use diagnosis::report::ParameterEstimate;
use diagnosis::{Report, Verdict};
use machine::RawMotion;
use serde::Deserialize;
use toml_edit::{DocumentMut, Item, Table, value};

use crate::Cell;
use crate::model::{AdoptError, parse, same_machine};

/// The section of a cell file, read without the rest of it: recordings of other versions carry it too.
///
/// # Errors
/// A sentence that says what is wrong with it.
pub fn motion_of_text(text: &str) -> Result<RawMotion, String> {
    #[derive(Deserialize)]
    struct Only {
        #[serde(default)]
        motion: RawMotion,
    }
    let only: Only = toml::from_str(text).map_err(|error| error.message().to_owned())?;
    Ok(only.motion)
}

/// A cell file whose `[motion]` is what a report has shown.
#[derive(Clone, Debug)]
pub struct AdoptedMotion {
    /// The whole file.
    pub text: String,
    /// Keys below `motion` that were written, with their values in the units of the keys.
    pub written: Vec<(String, f64)>,
}

/// The cell file with the limits, times and overrides of a report of the channel `time` in `[motion]`.
///
/// `picks` name one effect each of those that the session could not distinguish.
///
/// # Errors
/// [`AdoptError`] says why the file stays as it is.
pub fn adopt_motion(
    cell: &Cell,
    report: &Report,
    picks: &[String],
) -> Result<AdoptedMotion, AdoptError> {
    let bag = report.bag.clone();
    match report.verdict {
        Verdict::Unexplained => return Err(AdoptError::Unexplained(bag)),
        Verdict::NoGap => return Err(AdoptError::NoGap(bag)),
        Verdict::Explained | Verdict::PartlyExplained => {}
    }
    let text = |error: &dyn std::fmt::Display| AdoptError::Text(error.to_string());
    let chain = cell.chain().map_err(|error| text(&error))?;
    same_machine(cell, &chain, report)?;
    let mut document = parse(&cell.text().cell)?;
    let mut written = Vec::new();
    for (effect, parameters) in chosen(report, picks)? {
        let found = parameters
            .first()
            .ok_or_else(|| text(&format!("{effect} has no size")))?;
        for (key, number) in keys(cell, &effect, found, parameters)? {
            write(&mut document, &key, number)?;
            written.push((key, number));
        }
    }
    Ok(AdoptedMotion {
        text: document.to_string(),
        written,
    })
}

/// The effects of a report with their parameters, each as it was picked.
fn chosen<'r>(
    report: &'r Report,
    picks: &[String],
) -> Result<Vec<(String, &'r [ParameterEstimate])>, AdoptError> {
    let offered: Vec<String> = report
        .effects
        .iter()
        .filter(|one| one.group.len() > 1)
        .flat_map(|one| one.group.clone())
        .collect();
    if let Some(pick) = picks.iter().find(|pick| !offered.contains(pick)) {
        return Err(AdoptError::NoSuchPick {
            pick: pick.clone(),
            offered: offered.join(", "),
        });
    }
    (report.effects.iter())
        .map(|effect| {
            let pick = picks.iter().find(|pick| effect.group.contains(pick));
            let name = match (pick, effect.indistinguishable_from.as_slice()) {
                (Some(pick), _) => pick,
                (None, []) => &effect.effect,
                (None, others) => {
                    return Err(AdoptError::Indistinguishable {
                        effect: effect.effect.clone(),
                        others: others.join(", "),
                    });
                }
            };
            let alternative = effect.alternatives.iter().find(|one| one.effect == *name);
            let parameters = alternative.map_or(&effect.parameters, |one| &one.parameters);
            Ok((name.clone(), parameters.as_slice()))
        })
        .collect()
}

/// The keys that an effect changes, below `motion`, and what they become.
fn keys(
    cell: &Cell,
    effect: &str,
    found: &ParameterEstimate,
    parameters: &[ParameterEstimate],
) -> Result<Vec<(String, f64)>, AdoptError> {
    let half = 0.5 * (found.ci95[1] - found.ci95[0]).abs();
    let one = |key: &str, factor: f64| {
        vec![(key.to_owned(), rounded(found.value * factor, half * factor))]
    };
    let declared = parameters.get(1).map_or(1.0, |declared| declared.value);
    Ok(match effect {
        "motion.dwell" => one("touch_dwell_s", 1.0),
        "motion.latency" => one("latency_s", 1.0),
        "motion.blending" => one("blending", 1.0),
        "motion.override" => match found.name.as_str() {
            "rapid" => one("rapid_override", 1.0),
            "feed" => one("feed_override", 1.0),
            _ => {
                let factor = found.value / declared;
                let own = [
                    ("rapid_override", cell.motion.rapid_override),
                    ("feed_override", cell.motion.feed_override),
                ];
                own.map(|(key, now)| (key.to_owned(), rounded(now * factor, half)))
                    .to_vec()
            }
        },
        other => {
            let of_axis = other
                .strip_prefix("motion.")
                .and_then(|rest| rest.rsplit_once('.'));
            let (axis, quantity) = of_axis
                .ok_or_else(|| AdoptError::Text(format!("{other} is no limit of [motion]")))?;
            let power = match quantity {
                "velocity" => "s",
                "acceleration" => "s2",
                _ => "s3",
            };
            let (factor, unit) = if found.unit.starts_with("rad") {
                (180.0 / std::f64::consts::PI, "deg")
            } else {
                (1e3, "mm")
            };
            one(
                &format!("axes.{axis}.{quantity}_{unit}_per_{power}"),
                factor,
            )
        }
    })
}

/// A value to the second digit of its uncertainty (GUM 7.2.6).
fn rounded(number: f64, half: f64) -> f64 {
    if !(half > 0.0 && half.is_finite()) {
        return number;
    }
    let digits = 1 - half.log10().floor() as i32;
    // A power of ten with a positive exponent is exact, so that no digits of rounding are written.
    if digits >= 0 {
        let scale = 10_f64.powi(digits);
        (number * scale).round() / scale
    } else {
        let step = 10_f64.powi(-digits);
        (number / step).round() * step
    }
}

/// Writes a key below `motion`; tables that are missing are made.
fn write(document: &mut DocumentMut, key: &str, number: f64) -> Result<(), AdoptError> {
    let mut path: Vec<&str> = std::iter::once("motion").chain(key.split('.')).collect();
    let last = path.pop().unwrap_or_default();
    let mut item = document.as_item_mut();
    let depth = path.len();
    for (level, name) in path.into_iter().enumerate() {
        let table = item.as_table_like_mut().ok_or(AdoptError::Layout)?;
        item = table.entry(name).or_insert_with(|| {
            let mut table = Table::new();
            // Only the innermost table needs a header of its own.
            table.set_implicit(level + 1 < depth);
            Item::Table(table)
        });
    }
    let table = item.as_table_like_mut().ok_or(AdoptError::Layout)?;
    table.insert(last, value(number));
    Ok(())
}
