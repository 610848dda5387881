//! DMIS (ISO 22093), programs and output: features and tolerances, and points that were measured.
//!
//! Statements end with the line unless `$` continues it; `$$` begins a comment. Read are `UNITS`, `FEAT` of points, planes, circles,
//! cylinders, spheres and cones in Cartesian coordinates, `TOL/DIAM` and `TOL/PROFP`-like limits by `EVAL` and `OUTPUT`, and `PTMEAS`.

use std::collections::BTreeMap;

use exchange::ImportError;
use exchange::import::features::{feature, unit};
use exchange::import::reference::{Found, Value, Which};
use probecell_msgs::InspectionFeature;

use super::plan::{ForeignPlan, Planned};

/// A statement: its label, the words before and after the slash, and where it begins.
struct Statement {
    line: u64,
    label: Option<(String, String)>,
    major: String,
    words: Vec<String>,
}

impl Statement {
    fn wrong(&self, what: impl Into<String>) -> ImportError {
        ImportError::at(self.line, 1, what)
    }

    /// Numbers from a word on.
    fn numbers<const N: usize>(&self, from: usize) -> Result<[f64; N], ImportError> {
        let words = self.words.get(from..from + N).unwrap_or_default();
        let values: Option<Vec<f64>> = words
            .iter()
            .map(|word| word.parse().ok().filter(|value: &f64| value.is_finite()))
            .collect();
        values
            .and_then(|values| values.try_into().ok())
            .ok_or_else(|| {
                self.wrong(format!(
                    "expected {N} finite numbers from word {} of {}",
                    from + 1,
                    self.major
                ))
            })
    }
}

/// Statements of a file, continued lines joined.
fn statements(text: &str) -> impl Iterator<Item = Result<Statement, ImportError>> {
    let mut lines = (1..).zip(text.lines());
    std::iter::from_fn(move || {
        let mut waiting: Option<(u64, String)> = None;
        for (line, content) in lines.by_ref() {
            let content = content.split("$$").next().unwrap_or_default().trim();
            let (begun, mut joined) = waiting.take().unwrap_or((line, String::new()));
            if let Some(part) = content.strip_suffix('$') {
                joined.push_str(part.trim());
                waiting = Some((begun, joined));
                continue;
            }
            joined.push_str(content);
            if !joined.is_empty() {
                return Some(statement(begun, &joined));
            }
        }
        let what = "the statement is continued, and the file ends";
        waiting.map(|(line, _)| Err(ImportError::at(line, 1, what)))
    })
}

fn statement(line: u64, text: &str) -> Result<Statement, ImportError> {
    // F(NAME)=FEAT/..., FA(NAME)=FEAT/..., T(NAME)=TOL/...
    let (label, rest) = match text.split_once('=') {
        Some((label, rest)) if label.contains('(') && !label.contains('/') => (Some(label), rest),
        _ => (None, text),
    };
    let label = match label {
        None => None,
        Some(label) => {
            let (letters, name) = label
                .trim()
                .strip_suffix(')')
                .and_then(|label| label.split_once('('))
                .ok_or_else(|| {
                    ImportError::at(line, 1, format!("expected a label, found {label:?}"))
                })?;
            Some((letters.trim().to_uppercase(), name.trim().to_owned()))
        }
    };
    let (major, words) = rest.split_once('/').unwrap_or((rest, ""));
    Ok(Statement {
        line,
        label,
        major: major.trim().to_uppercase(),
        words: words
            .split(',')
            .map(|word| word.trim().to_owned())
            .collect(),
    })
}

/// m of the unit of length in force.
fn metre(statement: &Statement) -> Result<f64, ImportError> {
    match statement
        .words
        .first()
        .map(|word| word.to_uppercase())
        .as_deref()
    {
        Some("MM") => Ok(1e-3),
        Some("CM") => Ok(1e-2),
        Some("M") => Ok(1.0),
        Some("INCH") => Ok(0.0254),
        Some("FEET") => Ok(0.3048),
        other => Err(statement.wrong(format!("{other:?} is no unit of length of DMIS"))),
    }
}

fn no_units(statement: &Statement) -> ImportError {
    statement.wrong("the unit of length is not known: UNITS stands before the first feature")
}

/// Features, tolerances and points of a program.
///
/// # Errors
/// The first statement that is not what it must be, with its line.
pub fn plan(text: &str) -> Result<ForeignPlan, ImportError> {
    let mut plan = ForeignPlan::default();
    let mut scale = None;
    let mut tolerances: Vec<(String, [f64; 2])> = Vec::new();
    let mut measured: Option<usize> = None;
    for one in statements(text) {
        let one = one?;
        match (one.major.as_str(), &one.label) {
            ("UNITS", _) => scale = Some(metre(&one)?),
            ("FEAT", Some((letters, name))) if letters == "F" => {
                let scale = scale.ok_or_else(|| no_units(&one))?;
                match nominal(&one, name, scale)? {
                    Some(planned) => plan.features.push(planned),
                    None => plan.left_out.push(format!(
                        "line {}: feature {name} is a {}",
                        one.line, one.words[0]
                    )),
                }
            }
            ("TOL", Some((_, name))) => {
                let scale = scale.ok_or_else(|| no_units(&one))?;
                match one.words.first().map(String::as_str) {
                    Some("DIAM" | "PROFP") => tolerances.push((
                        name.clone(),
                        one.numbers::<2>(1)?.map(|limit| limit * scale),
                    )),
                    other => plan.left_out.push(format!(
                        "line {}: tolerance {name}, {}, cannot be represented in a plan",
                        one.line,
                        other.unwrap_or_default()
                    )),
                }
            }
            ("MEAS", _) => {
                measured = one
                    .words
                    .iter()
                    .find_map(|word| labelled(word, "F"))
                    .and_then(|name| index(&plan, &name));
            }
            ("ENDMES", _) => measured = None,
            ("PTMEAS", _) => {
                let (Some(feature), Some("CART")) =
                    (measured, one.words.first().map(String::as_str))
                else {
                    continue;
                };
                let scale = scale.ok_or_else(|| no_units(&one))?;
                let at = one.numbers::<3>(1)?.map(|value| value * scale);
                let normal = unit(one.numbers(4)?)
                    .ok_or_else(|| one.wrong("i, j, k are not of unit length"))?;
                let planned = &mut plan.features[feature];
                if planned.feature.kind == InspectionFeature::SURFACE {
                    planned.points.clear();
                }
                planned.points.push((at, normal));
            }
            ("EVAL" | "OUTPUT", _) => attach(&one, &tolerances, &mut plan),
            _ => {}
        }
    }
    if plan.features.is_empty() {
        return Err(ImportError::whole(
            "the program has no feature that can be planned",
        ));
    }
    Ok(plan)
}

/// Limits of the features that a statement names together with tolerances.
fn attach(statement: &Statement, tolerances: &[(String, [f64; 2])], plan: &mut ForeignPlan) {
    let named = |letters: &[&str]| -> Vec<String> {
        let words = statement.words.iter();
        words
            .filter_map(|word| letters.iter().find_map(|letters| labelled(word, letters)))
            .collect()
    };
    let limits = named(&["T", "TA"]);
    let limits = limits
        .iter()
        .find_map(|name| tolerances.iter().find(|(known, _)| known == name));
    if let Some((_, [lower, upper])) = limits {
        for name in named(&["F", "FA"]) {
            if let Some(feature) = index(plan, &name) {
                let feature = &mut plan.features[feature].feature;
                (feature.lower_tolerance, feature.upper_tolerance) = (*lower, *upper);
            }
        }
    }
}

fn index(plan: &ForeignPlan, name: &str) -> Option<usize> {
    plan.features
        .iter()
        .position(|planned| planned.feature.id == name)
}

/// The name in `F(NAME)`.
fn labelled(word: &str, letters: &str) -> Option<String> {
    let rest = word.trim().strip_prefix(letters)?.strip_prefix('(')?;
    rest.strip_suffix(')').map(str::to_owned)
}

/// A feature; none of a kind that a plan of ours lacks.
fn nominal(one: &Statement, name: &str, scale: f64) -> Result<Option<Planned>, ImportError> {
    let kind = one
        .words
        .first()
        .map(|word| word.to_uppercase())
        .unwrap_or_default();
    let side = one
        .words
        .get(1)
        .map(|word| word.to_uppercase())
        .unwrap_or_default();
    let sided = matches!(side.as_str(), "INNER" | "OUTER");
    let frame = one
        .words
        .get(if sided { 2 } else { 1 })
        .map(|word| word.to_uppercase());
    if frame.as_deref() != Some("CART") {
        return Ok(None);
    }
    let from = if sided { 3 } else { 2 };
    let at = one.numbers::<3>(from)?.map(|value| value * scale);
    let direction =
        || unit(one.numbers(from + 3)?).ok_or_else(|| one.wrong("i, j, k are not of unit length"));
    let round = if side == "INNER" {
        InspectionFeature::BORE
    } else {
        InspectionFeature::CYLINDER
    };
    let (code, axis, diameter) = match kind.as_str() {
        "POINT" => (InspectionFeature::SURFACE, direction()?, None),
        "PLANE" => (InspectionFeature::PLANE, direction()?, None),
        "CIRCLE" | "CYLNDR" => (round, direction()?, Some(one.numbers::<1>(from + 6)?[0])),
        "SPHERE" => (
            InspectionFeature::SPHERE,
            [0.0, 0.0, 1.0],
            Some(one.numbers::<1>(from + 3)?[0]),
        ),
        _ => return Ok(None),
    };
    let mut planned = Planned {
        feature: feature(name, code, at, axis),
        points: Vec::new(),
    };
    if kind == "POINT" {
        planned.points.push((at, axis));
    }
    planned.feature.radius = diameter.map_or(0.0, |diameter| diameter * scale / 2.0);
    Ok(Some(planned))
}

/// Points of an output file: each `FA` of a point against the `F` of the same name, which the file holds too, or by its own place.
///
/// # Errors
/// As [`plan`]; a file without any measured point.
pub fn results(text: &str) -> Result<Vec<Found>, ImportError> {
    let mut scale = None;
    let mut nominals: BTreeMap<String, [f64; 3]> = BTreeMap::new();
    let mut found = Vec::new();
    for one in statements(text) {
        let one = one?;
        match (one.major.as_str(), &one.label) {
            ("UNITS", _) => scale = Some(metre(&one)?),
            ("FEAT", Some((letters, name))) => {
                let scale = scale.ok_or_else(|| no_units(&one))?;
                if one.words.first().map(|word| word.to_uppercase()).as_deref() != Some("POINT") {
                    continue;
                }
                let at = one.numbers::<3>(2)?.map(|value| value * scale);
                if letters == "F" {
                    nominals.entry(name.clone()).or_insert(at);
                    continue;
                }
                let nominal = nominals.get(name);
                let nominal = nominal.ok_or_else(|| {
                    one.wrong(format!("FA({name}) has no nominal point F({name})"))
                })?;
                found.push(Found {
                    place: (one.line, 1),
                    of: Which::Nominal(*nominal),
                    value: Value::Point(at),
                });
            }
            _ => {}
        }
    }
    if found.is_empty() {
        return Err(ImportError::whole("the file has no measured point"));
    }
    Ok(found)
}
