//! Judging a report of a development session by the rules of its README.

use diagnosis::report::Effect;
use diagnosis::{Report, Verdict};
use serde_json::Value;

/// One judged session.
pub(crate) struct Score {
    /// Hidden effects.
    pub(crate) truth: Vec<String>,
    /// The cause is right.
    pub(crate) cause: bool,
    /// The verdict is right.
    pub(crate) verdict: bool,
    /// Held-out rms after the last effect over the noise, where nothing unknown acts.
    pub(crate) ratio: Option<f64>,
    /// Parameters inside their 95 % interval.
    pub(crate) inside: usize,
    /// Parameters that could be compared.
    pub(crate) judged: usize,
    /// The others, in words.
    pub(crate) missed: Vec<String>,
}

impl Score {
    /// Judges a report against one entry of `truth.json`.
    pub(crate) fn of(truth: &Value, report: &Report) -> Self {
        let effects = truth["effects"].as_array().unwrap();
        let names: Vec<String> = effects
            .iter()
            .map(|e| e["effect"].as_str().unwrap().to_owned())
            .collect();
        let known: Vec<&String> = names
            .iter()
            .filter(|name| !name.starts_with("x."))
            .collect();
        let strange = known.len() < names.len();
        let named: Vec<&Effect> = report
            .effects
            .iter()
            .filter(|effect| {
                effect.effect != "data.outliers"
                    || known.iter().any(|name| *name == "data.outliers")
            })
            .collect();
        let covered = |name: &String| {
            named.iter().any(|effect| {
                effect.effect == *name || effect.indistinguishable_from.contains(name)
            })
        };
        let cause = named.len() <= known.len() && known.iter().all(|name| covered(name));
        let verdict = match (strange, known.is_empty()) {
            (false, true) => report.verdict == Verdict::NoGap,
            (false, false) => report.verdict == Verdict::Explained,
            (true, true) => report.verdict == Verdict::Unexplained,
            (true, false) => matches!(
                report.verdict,
                Verdict::PartlyExplained | Verdict::Unexplained
            ),
        };
        let noise = truth["noise"].as_f64().unwrap();
        let last = report.effects.iter().rfind(|effect| effect.held_out);
        let ratio = last
            .filter(|_| !strange)
            .map(|effect| effect.rms_after / noise);
        let (mut inside, mut judged) = (0, 0);
        let mut missed = Vec::new();
        for effect in effects {
            let Some(found) = report
                .effects
                .iter()
                .find(|found| found.effect == effect["effect"].as_str().unwrap())
            else {
                continue;
            };
            for (name, value) in effect["parameters"].as_object().unwrap() {
                let values: Vec<(String, f64)> = match (name.as_str(), value) {
                    (
                        "index" | "along" | "about" | "tool" | "mid" | "half" | "length" | "height",
                        _,
                    ) => continue,
                    (_, Value::Array(values)) => {
                        let letters: [&str; 3] = match name.as_str() {
                            "xyz" => ["x", "y", "z"],
                            "abc" => ["a", "b", "c"],
                            "rate" => ["rate_x", "rate_y", "rate_z"],
                            _ => continue,
                        };
                        letters
                            .iter()
                            .zip(values)
                            .map(|(letter, value)| ((*letter).to_owned(), value.as_f64().unwrap()))
                            .collect()
                    }
                    _ => value
                        .as_f64()
                        .map(|value| (name.clone(), value))
                        .into_iter()
                        .collect(),
                };
                for (name, value) in values {
                    let Some(estimate) = found
                        .parameters
                        .iter()
                        .find(|estimate| estimate.name == name)
                    else {
                        continue;
                    };
                    judged += 1;
                    let [low, high] = estimate.ci95.map(|end| end * stretch(effect, found, &name));
                    let turn = std::f64::consts::TAU / number(found, "lobes").unwrap_or(1.0);
                    // A wave of negative size is the same half a turn on.
                    let size = effect["parameters"]["a"].as_f64();
                    let turned =
                        size.is_some_and(|a| a < 0.0) && effect["parameters"]["phase"].is_number();
                    let value = match name.as_str() {
                        "a" if turned => -value,
                        "phase" if turned => value + 0.5 * turn,
                        _ => value,
                    };
                    let holds = |value: f64| (low..=high).contains(&value);
                    let around = |turns: f64| name == "phase" && holds(value + turns * turn);
                    if holds(value) || (-3..=3).any(|turns| around(f64::from(turns))) {
                        inside += 1;
                    } else {
                        missed.push(format!(
                            "{} {name} true {value:.4e} found {:.4e} [{low:.4e}, {high:.4e}]",
                            found.effect, estimate.value
                        ));
                    }
                }
            }
        }
        Self {
            truth: names,
            cause,
            verdict,
            ratio,
            inside,
            judged,
            missed,
        }
    }
}

fn number(found: &Effect, name: &str) -> Option<f64> {
    let parameters = &mut found.parameters.iter();
    parameters
        .find(|known| known.name == name)
        .map(|known| known.value)
}

/// A bend is told at the end of the length that goes with it; cubic in the overhang.
fn stretch(truth: &Value, found: &Effect, name: &str) -> f64 {
    match (
        truth["parameters"]["length"].as_f64(),
        number(found, "length"),
    ) {
        (Some(true_length), Some(length)) if name == "tip" => (true_length / length).powi(3),
        _ => 1.0,
    }
}
