//! Whether a cure helped: the report it was written from beside one of the machine that has loaded it.

use diagnosis::Report;
use diagnosis::report::{Effect, ParameterEstimate};

use crate::CureError;
use crate::cause::{Cause, causes};
use crate::list::{number, remains, unit, wrapped};

/// A share whose interval is wider to each side says nothing.
const VAGUE: f64 = 0.5;

/// What became of a cause that was to be mended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// Not named any more.
    Gone,
    /// Of the size that it had this share is there, give or take so much (95 %).
    Left([f64; 2]),
    /// Causes that look the same are named, this one among them.
    InGroup,
}

impl Outcome {
    /// What it says of what was loaded: the most frequent faults of compensations that are written by hand.
    fn means(self) -> String {
        match self {
            Self::Gone => "gone".to_owned(),
            Self::InGroup => "is in a group of causes that these data do not tell apart".to_owned(),
            Self::Left([share, half]) => {
                let among = |low: f64, high: f64| share + half >= low && share - half <= high;
                let size = format!(
                    "{:.0} ± {:.0} % of it is there",
                    share * 100.0,
                    half * 100.0
                );
                let why = if half > VAGUE {
                    "that is too uncertain to say what became of it: measure more that shows it"
                } else if among(1.8, 2.2) && !among(0.8, 1.2) {
                    "it has doubled: the compensation was applied with the opposite sign"
                } else if among(0.9, 1.1) {
                    "nothing has changed: the file was not loaded, not switched on, or on another axis"
                } else if among(-1.1, -0.9) {
                    "it has changed its sign: the compensation was applied twice"
                } else if share.abs() < 0.5 {
                    "most of it is gone"
                } else {
                    "it has changed by another amount than was written: look for a second compensation in force"
                };
                format!("{size}: {why}")
            }
        }
    }
}

/// A cause of the first report, and what became of it.
#[derive(Debug, Clone, PartialEq)]
pub struct After {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// What the second report says of it.
    pub outcome: Outcome,
}

/// What became of the causes of `before` that may be written, `members` of groups among them, by the report `after`.
///
/// # Errors
/// [`CureError::Report`] for a report that is neither of touches nor of efforts, one without such a cause, and a member of no group.
pub fn after(before: &Report, members: &[String], after: &Report) -> Result<Vec<After>, CureError> {
    let mended: Vec<Cause> = causes(before, members)?
        .into_iter()
        .filter_map(Result::ok)
        .collect();
    if mended.is_empty() {
        return Err(CureError::Report(format!(
            "the report of {} has no cause that is written into a machine",
            before.bag
        )));
    }
    // It is one of the same channel.
    causes(after, &[])?;
    if before.channel != after.channel {
        return Err(CureError::Report(format!(
            "the report of {} is on the channel {}, that of {} on {}",
            before.bag, before.channel, after.bag, after.channel
        )));
    }
    let of = |cause: Cause| After {
        outcome: outcome(&cause, &after.effects),
        effect: cause.name,
    };
    Ok(mended.into_iter().map(of).collect())
}

fn outcome(cause: &Cause, effects: &[Effect]) -> Outcome {
    let named = effects.iter().find(|one| one.effect == cause.name);
    if let Some(share) = named.and_then(|one| share(&cause.parameters, &one.parameters)) {
        return Outcome::Left(share);
    }
    let like = |one: &Effect| {
        one.group.contains(&cause.name) || one.indistinguishable_from.contains(&cause.name)
    };
    if effects.iter().any(like) {
        Outcome::InGroup
    } else {
        Outcome::Gone
    }
}

/// The multiple of `before` that is nearest to `after` (least squares over the fitted numbers of one unit), and half its 95 % interval.
fn share(before: &[ParameterEstimate], after: &[ParameterEstimate]) -> Option<[f64; 2]> {
    let unit = &before.first()?.unit;
    let pairs: Vec<(&ParameterEstimate, &ParameterEstimate)> = (before.iter())
        .filter(|one| one.unit == *unit && one.ci95[0] < one.ci95[1])
        .filter_map(|one| Some((one, after.iter().find(|other| other.name == one.name)?)))
        .collect();
    let square: f64 = pairs.iter().map(|(one, _)| one.value.powi(2)).sum();
    let product: f64 = pairs
        .iter()
        .map(|(one, other)| one.value * other.value)
        .sum();
    let half = |one: &ParameterEstimate| (one.ci95[1] - one.ci95[0]) / 2.0;
    let share = product / square;
    let variance: f64 = (pairs.iter())
        .map(|(one, other)| one.value.powi(2) * (half(other).powi(2) + (share * half(one)).powi(2)))
        .sum();
    (square > 0.0).then(|| [share, variance.sqrt() / square])
}

/// As text of at most 100 columns: the gap as promised and as it became, then a cause in two lines.
pub fn after_table(
    before: &Report,
    members: &[String],
    after: &Report,
) -> Result<(String, bool), CureError> {
    let became = self::after(before, members, after)?;
    let promised = remains(before, &crate::lines(before, members)?);
    let (unit, of) = (unit(before), |size| number(size, before));
    let mut text = vec![format!(
        "gap {} {unit} before, promised {}, became {} {unit}; the noise is {} {unit}",
        of(before.gap.rms),
        of(promised),
        of(after.gap.rms),
        of(after.gap.noise_floor)
    )];
    for one in &became {
        text.push(one.effect.clone());
        text.push(wrapped(&one.outcome.means()));
    }
    let all = became.iter().all(|one| one.outcome == Outcome::Gone);
    Ok((text.join("\n"), all))
}
