//! The blind score card: sealed sessions, diagnosed, then opened and judged.
//!
//! A cause is right when every hidden effect is named, or stands under `indistinguishable_from` of one that is, and
//! nothing more is named than is hidden. A false positive is a reported effect that matches no hidden one. Where an effect
//! was deleted from the library (with its equals), nothing may be named without a flag that something stays unexplained;
//! what is named all the same is compared with the truth on held-out touches (`deleted.rs`).
//! Intervals are Wilson's at 95 %. Metres.

mod deleted;

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

use super::{Content, Outsider, Stage, Truth, session_on};
pub use deleted::Deleted;
use diagnosis::report::{Effect, Report, Verdict};
use diagnosis::{Options, diagnose_with_residuals};
use effects::session::SessionError;

/// Effects that are set aside rather than blamed when they stand beside others.
const STRAY: &str = "data.outliers";
/// Standard normal quantile of a 95 % interval.
const QUANTILE: f64 = 1.959_964;
/// A name this probable counts as sure.
const SURE: f64 = 0.9;
/// Bins of the calibration.
const BINS: usize = 10;

/// What is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Trial {
    /// A session as it is.
    Hidden(Content),
    /// One effect, diagnosed without it and without those that the full library cannot tell from it.
    Deleted,
}

/// The kinds of trials of a full card.
pub const TRIALS: [Trial; 18] = [
    Trial::Hidden(Content::Clean),
    Trial::Hidden(Content::Known(1)),
    Trial::Hidden(Content::Known(2)),
    Trial::Hidden(Content::Known(3)),
    Trial::Hidden(Content::Strange),
    Trial::Hidden(Content::Mixed),
    Trial::Hidden(Content::Correlated(0)),
    Trial::Hidden(Content::Correlated(1)),
    Trial::Hidden(Content::Stray),
    Trial::Deleted,
    Trial::Hidden(Content::StrangeCorrelated),
    Trial::Hidden(Content::Beside(0, Outsider::LooseStylus)),
    Trial::Hidden(Content::Beside(0, Outsider::QuadraticField)),
    Trial::Hidden(Content::Beside(0, Outsider::Bump)),
    Trial::Hidden(Content::Beside(1, Outsider::LooseStylus)),
    Trial::Hidden(Content::Beside(1, Outsider::QuadraticField)),
    Trial::Hidden(Content::Beside(1, Outsider::Bump)),
    Trial::Hidden(Content::Beside(2, Outsider::LooseStylus)),
];

impl Trial {
    /// Seed of one session of this kind on the card of a seed: no two kinds share sessions.
    pub fn seed(self, seed: u64, number: u64) -> u64 {
        let place = TRIALS.iter().position(|trial| *trial == self);
        let place = place.unwrap_or(TRIALS.len()) as u64;
        seed.wrapping_mul(100_000)
            .wrapping_add(place * 5_000)
            .wrapping_add(number)
    }

    /// What a session of this kind holds.
    pub fn content(self) -> Content {
        match self {
            Self::Hidden(content) => content,
            Self::Deleted => Content::Known(1),
        }
    }

    /// What it is called on the card.
    pub fn name(self) -> String {
        match self {
            Self::Hidden(Content::Clean) => "nothing".to_owned(),
            Self::Hidden(Content::Known(1)) => "one effect".to_owned(),
            Self::Hidden(Content::Known(count)) => format!("{count} effects"),
            Self::Hidden(Content::Strange) => "an unknown cause".to_owned(),
            Self::Hidden(Content::Mixed) => "one effect and an unknown cause".to_owned(),
            Self::Hidden(Content::Correlated(0)) => "nothing, AR(1) noise 0.7".to_owned(),
            Self::Hidden(Content::Correlated(_)) => "one effect, AR(1) noise 0.7".to_owned(),
            Self::Hidden(Content::Stray) => "one effect, 3 % outliers".to_owned(),
            Self::Hidden(Content::StrangeCorrelated) => {
                "an unknown cause, AR(1) noise 0.7".to_owned()
            }
            Self::Hidden(Content::Beside(0, outsider)) => outsider.name().to_owned(),
            Self::Hidden(Content::Beside(1, outsider)) => {
                format!("one effect and {}", outsider.name())
            }
            Self::Hidden(Content::Beside(count, outsider)) => {
                format!("{count} effects and {}", outsider.name())
            }
            Self::Deleted => "one effect, deleted from the library".to_owned(),
        }
    }
}

/// A judged session.
#[derive(Debug, Clone)]
pub struct Judged {
    /// Name of the session.
    pub name: String,
    /// What was hidden.
    pub truth: Truth,
    /// The answer.
    pub report: Report,
    /// The cause is right.
    pub cause: bool,
    /// The verdict is right.
    pub verdict: bool,
    /// Something is named that stands for nothing hidden (deleted effects: without a flag).
    pub innocent_blamed: bool,
    /// Probability of each name, and whether it is right.
    pub names: Vec<(f64, bool)>,
    /// Effect and parameter, truth, and whether its 95 % interval holds the truth.
    pub parameters: Vec<(String, f64, bool)>,
    /// Held-out rms over the noise, where all was named right.
    pub held_out: Option<f64>,
    /// Of a deleted effect: by how much (natural log of the likelihood ratio) it predicts held-out touches better than what is
    /// answered without it.
    pub truth_ahead: Option<f64>,
    /// Time of the diagnosis, ms.
    pub took_ms: f64,
}

impl Judged {
    /// Whether something is said to stay unexplained.
    #[must_use]
    pub fn flagged(&self) -> bool {
        is_flagged(&self.report)
    }
}

fn is_flagged(report: &Report) -> bool {
    matches!(
        report.verdict,
        Verdict::PartlyExplained | Verdict::Unexplained
    )
}

/// Makes a session, diagnoses it and opens its seal.
///
/// # Errors
/// [`SessionError`] when the diagnosis refuses the session.
pub fn judge(stage: &Stage, seed: u64, trial: Trial) -> Result<Judged, SessionError> {
    let (sealed, truth) = session_on(stage, seed, trial.content());
    let begun = Instant::now();
    let (mut report, by_truth) = diagnose_with_residuals(&sealed, &Options::default())?;
    let took_ms = begun.elapsed().as_secs_f64() * 1e3;
    let mut truth_ahead = None;
    if trial == Trial::Deleted {
        let mut without = truth.effects.clone();
        for effect in &report.effects {
            if stands_for(effect, &truth.effects[0]) {
                without.push(effect.effect.clone());
                without.extend(effect.indistinguishable_from.iter().cloned());
            }
        }
        let options = Options {
            without,
            ..Options::default()
        };
        let without_it;
        (report, without_it) = diagnose_with_residuals(&sealed, &options)?;
        truth_ahead = deleted::log_likelihood_ratio(&by_truth, &without_it, truth.noise);
    }
    Ok(Judged {
        truth_ahead,
        ..open(trial, sealed.name, truth, report, took_ms)
    })
}

fn stands_for(effect: &Effect, id: &String) -> bool {
    effect.effect == *id || effect.indistinguishable_from.contains(id)
}

fn open(trial: Trial, name: String, truth: Truth, report: Report, took_ms: f64) -> Judged {
    let inside = |id: &&String| trial != Trial::Deleted && !id.starts_with("x.");
    let known: Vec<&String> = truth.effects.iter().filter(inside).collect();
    let strange = known.len() < truth.effects.len();
    let named: Vec<&Effect> = report
        .effects
        .iter()
        .filter(|effect| effect.effect != STRAY)
        .collect();
    let right = |effect: &Effect| known.iter().any(|id| stands_for(effect, id));
    let every = |id: &&String| named.iter().any(|effect| stands_for(effect, id));
    let cause = named.len() <= known.len() && known.iter().all(every);
    let flagged = is_flagged(&report);
    let verdict = match (strange, known.is_empty()) {
        (false, true) => report.verdict == Verdict::NoGap,
        (false, false) => report.verdict == Verdict::Explained,
        (true, true) => report.verdict == Verdict::Unexplained,
        (true, false) => flagged,
    };
    let innocent_blamed =
        named.iter().any(|effect| !right(effect)) && !(trial == Trial::Deleted && flagged);
    let names = named
        .iter()
        .map(|effect| (effect.probability, right(effect)))
        .collect();
    let mut parameters = Vec::new();
    for (id, values) in truth.effects.iter().zip(&truth.parameters) {
        let Some(effect) = named.iter().find(|effect| effect.effect == *id) else {
            continue;
        };
        for (name, value) in values {
            if let Some(found) = effect.parameters.iter().find(|known| known.name == *name) {
                let [low, high] = found.ci95;
                let inside = (low..=high).contains(value)
                    || name == "phase" && around(low, high, *value, effect);
                let kind = id.rsplit('.').next().unwrap_or(id);
                let kind = if id.starts_with("link.") {
                    "link"
                } else {
                    kind
                };
                parameters.push((format!("{kind} {name}"), *value, inside));
            }
        }
    }
    let last = report.effects.iter().rfind(|effect| effect.held_out);
    let held_out = last
        .filter(|_| cause && !strange)
        .map(|effect| effect.rms_after / truth.noise);
    Judged {
        name,
        truth,
        report,
        cause,
        verdict,
        innocent_blamed,
        names,
        parameters,
        held_out,
        truth_ahead: None,
        took_ms,
    }
}

/// A phase near the seam of its turn lies inside an interval of the next turn too.
fn around(low: f64, high: f64, value: f64, effect: &Effect) -> bool {
    let lobes = effect.parameters.iter().find(|known| known.name == "lobes");
    let turn = std::f64::consts::TAU / lobes.map_or(1.0, |known| known.value);
    [-turn, turn]
        .iter()
        .any(|shift| (low..=high).contains(&(value + shift)))
}

/// A share with its interval.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Share {
    /// How many.
    pub count: usize,
    /// Of how many.
    pub of: usize,
    /// Wilson's interval at 95 %.
    pub ci95: [f64; 2],
}

impl Share {
    /// Of those that hold.
    pub fn of(holds: impl Iterator<Item = bool>) -> Self {
        let (count, of) = holds.fold((0, 0), |(count, of), holds| {
            (count + usize::from(holds), of + 1)
        });
        let (n, z2) = (f64::max(of as f64, 1.0), QUANTILE * QUANTILE);
        let share = count as f64 / n;
        let middle = (share + z2 / (2.0 * n)) / (1.0 + z2 / n);
        let root = (share * (1.0 - share) / n + z2 / (4.0 * n * n)).sqrt();
        let half = QUANTILE / (1.0 + z2 / n) * root;
        Self {
            count,
            of,
            ci95: [(middle - half).max(0.0), (middle + half).min(1.0)],
        }
    }
}

impl std::fmt::Display for Share {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [low, high] = self.ci95;
        write!(f, "{}/{} ({low:.3} to {high:.3})", self.count, self.of)
    }
}

/// One kind of trial on the card.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// What was hidden.
    pub hidden: String,
    /// Causes that are right.
    pub cause: Share,
    /// Verdicts that are right.
    pub verdict: Share,
    /// Sessions in which an innocent is blamed.
    pub innocent_blamed: Share,
}

/// The score card.
#[derive(Debug, Clone, Serialize)]
pub struct Card {
    /// Seed of its sessions.
    pub seed: u64,
    /// By what was hidden.
    pub rows: Vec<Row>,
    /// Effects that were deleted from the library; `None` without such trials.
    pub deleted: Option<Deleted>,
    /// Hidden effects of the vocabulary that were named or stand among a name's equals, by effect.
    pub found: BTreeMap<String, Share>,
    /// The same by the size of the effect's own signature over the noise.
    pub found_by_size: Vec<(String, Share)>,
    /// Names with a probability over 0.9 that are wrong, where nothing unknown acts.
    pub sure_but_wrong: Share,
    /// Expected calibration error of the names' probabilities.
    pub calibration_error: f64,
    /// Parameters whose 95 % interval holds the truth, where nothing unknown acts.
    pub parameters: Share,
    /// The same of named effects beside something unknown.
    pub parameters_beside_unknown: Share,
    /// The same by effect and parameter.
    pub parameters_by_name: BTreeMap<String, Share>,
    /// Median and largest held-out rms over the noise, where the cause is right.
    pub held_out: [f64; 2],
    /// Median and longest time of a diagnosis, ms.
    pub took_ms: [f64; 2],
}

impl Card {
    /// Sums up judged trials.
    pub fn of(seed: u64, judged: &[(Trial, Judged)]) -> Self {
        let mut kinds: Vec<Trial> = judged.iter().map(|(trial, _)| *trial).collect();
        kinds.dedup();
        let row = |kind: &Trial| {
            let own = || {
                let same = move |(trial, judged): &'_ (Trial, Judged)| {
                    (trial == kind).then(|| judged.clone())
                };
                judged.iter().filter_map(same)
            };
            Row {
                hidden: kind.name(),
                cause: Share::of(own().map(|judged| judged.cause)),
                verdict: Share::of(own().map(|judged| judged.verdict)),
                innocent_blamed: Share::of(own().map(|judged| judged.innocent_blamed)),
            }
        };
        let plain: Vec<&Judged> = judged
            .iter()
            .filter(|(trial, _)| matches!(trial, Trial::Hidden(Content::Known(_))))
            .map(|(_, judged)| judged)
            .collect();
        let mut by_effect: BTreeMap<String, Vec<bool>> = BTreeMap::new();
        let mut by_size: BTreeMap<usize, Vec<bool>> = BTreeMap::new();
        let mut parameters: BTreeMap<String, Vec<bool>> = BTreeMap::new();
        for judged in &plain {
            for (id, size) in judged.truth.effects.iter().zip(&judged.truth.sizes) {
                let found = (judged.report.effects.iter()).any(|effect| stands_for(effect, id));
                by_effect.entry(kind_of(id)).or_default().push(found);
                let bin = (size / judged.truth.noise).log2().floor().clamp(1.0, 4.0);
                by_size.entry(bin as usize).or_default().push(found);
            }
            for (name, _, inside) in &judged.parameters {
                parameters.entry(name.clone()).or_default().push(*inside);
            }
        }
        let beside_unknown = judged.iter().filter(|(_, judged)| {
            let mut effects = judged.truth.effects.iter();
            effects.any(|id| id.starts_with("x."))
        });
        let beside_unknown = beside_unknown.flat_map(|(_, judged)| &judged.parameters);
        let share = |values: &Vec<bool>| Share::of(values.iter().copied());
        let names: Vec<(f64, bool)> = plain
            .iter()
            .flat_map(|judged| judged.names.iter().copied())
            .collect();
        let sure = names.iter().filter(|(probability, _)| *probability > SURE);
        let median = |mut values: Vec<f64>| {
            values.sort_by(f64::total_cmp);
            [
                values.get(values.len() / 2).copied().unwrap_or(f64::NAN),
                values.last().copied().unwrap_or(f64::NAN),
            ]
        };
        Self {
            seed,
            rows: kinds.iter().map(row).collect(),
            deleted: Deleted::of(judged),
            found: by_effect
                .iter()
                .map(|(id, all)| (id.clone(), share(all)))
                .collect(),
            found_by_size: by_size
                .iter()
                .map(|(bin, all)| (format!("{} to {}", 1 << bin, 2 << bin), share(all)))
                .collect(),
            sure_but_wrong: Share::of(sure.map(|(_, right)| !right)),
            calibration_error: calibration_error(&names),
            parameters: Share::of(parameters.values().flatten().copied()),
            parameters_beside_unknown: Share::of(beside_unknown.map(|(.., inside)| *inside)),
            parameters_by_name: parameters
                .iter()
                .map(|(name, all)| (name.clone(), share(all)))
                .collect(),
            held_out: median(plain.iter().filter_map(|judged| judged.held_out).collect()),
            took_ms: median(judged.iter().map(|(_, judged)| judged.took_ms).collect()),
        }
    }
}

/// The effect without its axis.
fn kind_of(id: &str) -> String {
    match id.split('.').collect::<Vec<_>>()[..] {
        ["axis", _, kind] => format!("axis.*.{kind}"),
        ["link", _] => "link.*".to_owned(),
        _ => id.to_owned(),
    }
}

fn calibration_error(names: &[(f64, bool)]) -> f64 {
    let mut bins = [(0.0, 0.0, 0.0); BINS];
    for (probability, right) in names {
        let bin = &mut bins[((probability * BINS as f64) as usize).min(BINS - 1)];
        bin.0 += probability;
        bin.1 += f64::from(u8::from(*right));
        bin.2 += 1.0;
    }
    let off: f64 = bins.iter().map(|(sum, right, _)| (sum - right).abs()).sum();
    off / (names.len().max(1) as f64)
}

impl std::fmt::Display for Card {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(
            f,
            "| hidden | correct cause | correct verdict | false effect named |"
        )?;
        writeln!(f, "|---|---|---|---|")?;
        for row in &self.rows {
            writeln!(
                f,
                "| {} | {} | {} | {} |",
                row.hidden, row.cause, row.verdict, row.innocent_blamed
            )?;
        }
        if let Some(deleted) = &self.deleted {
            writeln!(f, "\n{deleted}")?;
        }
        writeln!(
            f,
            "\n| effect (where nothing unknown acts) | named, or in the equivalence class of a named one |"
        )?;
        writeln!(f, "|---|---|")?;
        for (name, share) in &self.found {
            writeln!(f, "| {name} | {share} |")?;
        }
        for (size, share) in &self.found_by_size {
            writeln!(f, "| any of {size} times the noise | {share} |")?;
        }
        writeln!(f, "\n| parameter | inside its 95 % interval |")?;
        writeln!(f, "|---|---|")?;
        for (name, share) in &self.parameters_by_name {
            writeln!(f, "| {name} | {share} |")?;
        }
        writeln!(f, "| all | {} |", self.parameters)?;
        let beside_unknown = self.parameters_beside_unknown;
        writeln!(f, "| all, beside something unknown | {beside_unknown} |")?;
        writeln!(
            f,
            "\nwrong at P > 0.9: {}; expected calibration error {:.3}; held-out rms over noise: median {:.3}, at most \
             {:.2}; median {:.0} ms and at most {:.0} ms for a session; seed {}",
            self.sure_but_wrong,
            self.calibration_error,
            self.held_out[0],
            self.held_out[1],
            self.took_ms[0],
            self.took_ms[1],
            self.seed
        )
    }
}
