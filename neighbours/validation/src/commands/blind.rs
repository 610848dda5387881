//! `probecell blind`: sealed sessions from a plant that shares no code with the signatures, diagnosed, then opened.
//!
//! What counts as right stands in `validation::blind::card`.

use std::path::Path;

use anyhow::Context;
use bags::Measurement;
use cell::Cell;
use indicatif::ProgressBar;
use serde_json::{Map, Value, json};
use session_io::write;
use validation::blind::card::{Card, Judged, TRIALS, Trial, judge};
use validation::blind::{Stage, session_on};

use terminal::GOOD;

/// Makes, diagnoses and opens `trials` sessions, shared out evenly over the kinds of trials; they are made on the machine
/// and plan of `on`, a cell file or a bag, and `keep` is where they stay.
pub(super) fn run(
    trials: u64,
    seed: u64,
    on: Option<&Path>,
    keep: Option<&Path>,
    json: bool,
) -> anyhow::Result<u8> {
    let stage = match on {
        None => Stage::made_up(),
        Some(file) if file.extension().is_some_and(|end| end == "toml") => {
            let name = file.display().to_string();
            Stage::of(&session_io::unmeasured(
                &Cell::read(file)?,
                &name,
                &mut |_| {},
            )?)?
        }
        Some(bag) => {
            let read = session_io::measured(bag, &Measurement::Last, None)?;
            read.remarks.iter().for_each(|text| terminal::remark(text));
            Stage::of(&read.session).with_context(|| bag.display().to_string())?
        }
    };
    let each = (trials / TRIALS.len() as u64).max(1);
    let progress = ProgressBar::new(each * TRIALS.len() as u64);
    let mut judged = Vec::new();
    for trial in TRIALS {
        for number in 0..each {
            let own = trial.seed(seed, number);
            let one = judge(&stage, own, trial)?;
            if let Some(folder) = keep {
                leave(folder, &stage, own, trial, &one)?;
            }
            judged.push((trial, one));
            progress.inc(1);
        }
    }
    progress.finish_and_clear();
    let card = Card::of(seed, &judged);
    if json {
        terminal::json(&card)?;
    } else {
        terminal::line(card.to_string().trim_end());
    }
    Ok(GOOD)
}

/// Writes a session as a recording, with a file that holds its hidden content and the judgement.
fn leave(
    folder: &Path,
    stage: &Stage,
    seed: u64,
    trial: Trial,
    judged: &Judged,
) -> anyhow::Result<()> {
    let (sealed, truth) = session_on(stage, seed, trial.content());
    let hidden: Vec<Value> = (truth.effects.iter().enumerate())
        .map(|(index, effect)| {
            let parameters: Map<String, Value> =
                (truth.parameters.get(index).into_iter().flatten())
                    .map(|(name, value)| (name.clone(), json!(value)))
                    .collect();
            json!({ "effect": effect, "rms": truth.sizes.get(index), "parameters": parameters })
        })
        .collect();
    let seal = json!({
        "bag": sealed.name,
        "trial": trial.name(),
        "seed": seed,
        "machine": truth.machine,
        "noise": truth.noise,
        "effects": hidden,
        "judged": { "cause": judged.cause, "verdict": judged.verdict },
    });
    write::write(&folder.join(&sealed.name), "blind", &sealed)?;
    let file = folder.join(format!("{}.seal.json", sealed.name));
    std::fs::write(&file, format!("{}\n", serde_json::to_string_pretty(&seal)?))
        .with_context(|| format!("cannot write {}", file.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The recording that was kept is diagnosed as the sealed session was, and its seal names what was hidden.
    #[test]
    fn a_kept_session_can_be_looked_at_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let trial = TRIALS[1];
        let seed = trial.seed(3, 0);
        let stage = Stage::made_up();
        let judged = judge(&stage, seed, trial).expect("a diagnosis");
        leave(folder.path(), &stage, seed, trial, &judged).expect("a recording and a seal");
        let bag = folder.path().join(&judged.name);
        let kept = session_io::measured(&bag, &Measurement::Last, None).expect("a session");
        let options = diagnosis::Options::default();
        let again = diagnosis::diagnose(&kept.session, &options);
        let again = again.expect("a diagnosis");
        assert_eq!(again, judged.report);
        let seal = folder.path().join(format!("{}.seal.json", judged.name));
        let seal: Value =
            serde_json::from_slice(&std::fs::read(seal).expect("a seal")).expect("JSON");
        assert_eq!(seal["effects"][0]["effect"], judged.truth.effects[0]);
        assert_eq!(seal["effects"].as_array().map(Vec::len), Some(1));
    }
}
