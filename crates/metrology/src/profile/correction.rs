//! Decides how the next part of a free-form profile is to be cut, from the parts measured so far.
//!
//! Lengths in m, plane coordinates, deviations along the outward normals. `docs/source_systems.md, B.1 and B.4`: each
//! part's deterministic deviations are taken off what was commanded for it; the loop ends when the form is in
//! tolerance, or says why more cutting cannot bring it there. What is random in a measurement is not commanded by
//! default, since it would be cut into the next part. It knows no machine, and no reason for the deviations.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{
    ProfileDeviation, ProfileError, Spline, SplineError, Split, corrected_points, split, tool_path,
};
use crate::statistics::rms;

/// What of the measured deviations is taken off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Corrected {
    /// The part that repeats (B.4).
    #[default]
    Deterministic,
    /// All, noise included, as the source does it.
    Raw,
}

/// Rules of the loop, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CorrectionRules {
    /// Largest form deviation 2·max|T| that is good.
    pub tolerance: f64,
    /// Largest offset from the nominal curve that may be commanded.
    pub largest: f64,
    /// Corrections after which the loop gives up.
    pub corrections: usize,
    /// What is taken off.
    pub of: Corrected,
}

/// The curve to cut next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProfileCorrection {
    /// Offset of the commanded curve at each point, against the outward normal, m: the sum of all corrections.
    pub offsets: Vec<f64>,
    /// The commanded curve.
    pub curve: Spline,
}

/// Why cutting again cannot bring the profile into tolerance.
#[derive(Clone, Copy, Debug, Error, PartialEq, Serialize, Deserialize)]
pub enum Hindrance {
    /// The rest that does not repeat is too large by itself.
    #[error(
        "what does not repeat has a form of {:.1} µm by itself, more than the tolerance of {:.1} µm",
        form * 1e6, tolerance * 1e6
    )]
    Random {
        /// Form of the random part, m.
        form: f64,
        /// The tolerance, m.
        tolerance: f64,
    },
    /// The last correction has not made the deterministic deviations smaller.
    #[error(
        "the last correction left deviations of {:.1} µm (root mean square) where {:.1} µm were before: the error does not repeat from part to part",
        after * 1e6, before * 1e6
    )]
    NotRepeating {
        /// Root mean square of the deterministic part before the correction, m.
        before: f64,
        /// And after, m.
        after: f64,
    },
    /// The commanded curve would leave the nominal one too far.
    #[error("an offset of {:.1} µm is needed, {:.1} µm are permitted", needed * 1e6, permitted * 1e6)]
    TooLarge {
        /// Largest offset, m.
        needed: f64,
        /// The bound, m.
        permitted: f64,
    },
    /// The permitted corrections are spent.
    #[error("still out of tolerance after {0} corrections")]
    Spent(usize),
}

/// What follows for the next part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Next {
    /// Cut it as the last one.
    InTolerance,
    /// Cut this curve.
    Cut(ProfileCorrection),
    /// Nothing: more cutting does not help.
    Stop(Hindrance),
}

/// The judgement on the last part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProfileJudgement {
    /// Summary of its deviations.
    pub deviation: ProfileDeviation,
    /// Deterministic and random part of them.
    pub parts: Split,
    /// What follows.
    pub next: Next,
}

/// Parts that cannot be judged.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CorrectionError {
    /// Points or deviations are not usable.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// The corrected curve does not exist.
    #[error(transparent)]
    Spline(#[from] SplineError),
    /// No part was measured.
    #[error("no part was measured")]
    NoPart,
    /// A rule is not a positive number.
    #[error("the {0} of the correction is {1} m: it must be a finite number above 0")]
    Rule(&'static str, f64),
    /// No path keeps to the curve.
    #[error("no path of {0} segments keeps within {1} m of the curve")]
    Path(usize, f64),
}

/// Judges the last of `parts` and says how the next is to be cut.
///
/// `parts` are deviations (m) at `points` along `normals`, in the order in which the parts were made: the first on the
/// nominal curve, each later one on the curve that followed from those before it.
///
/// # Errors
/// See [`CorrectionError`].
pub fn next_cut(
    points: &[Vector2<f64>],
    normals: &[Vector2<f64>],
    parts: &[Vec<f64>],
    rules: &CorrectionRules,
) -> Result<ProfileJudgement, CorrectionError> {
    for (name, value) in [("tolerance", rules.tolerance), ("bound", rules.largest)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(CorrectionError::Rule(name, value));
        }
    }
    let splits = parts
        .iter()
        .map(|deviations| split(deviations))
        .collect::<Result<Vec<_>, _>>()?;
    let (Some(last), Some(deviations)) = (splits.last(), parts.last()) else {
        return Err(CorrectionError::NoPart);
    };
    let deviation = ProfileDeviation::of(deviations)?;
    let mut offsets = vec![0.0; points.len()];
    for (part, deviations) in splits.iter().zip(parts) {
        let taken = match rules.of {
            Corrected::Deterministic => &part.deterministic,
            Corrected::Raw => deviations,
        };
        if taken.len() != offsets.len() {
            return Err(ProfileError::Unequal {
                points: points.len(),
                normals: normals.len(),
                deviations: taken.len(),
            }
            .into());
        }
        for (sum, t) in offsets.iter_mut().zip(taken) {
            *sum += t;
        }
    }
    let next = if deviation.form() <= rules.tolerance {
        Next::InTolerance
    } else if let Some(hindrance) = hindrance(&splits, &offsets, rules)? {
        Next::Stop(hindrance)
    } else {
        let curve = Spline::interpolate(&corrected_points(points, normals, &offsets)?)?;
        Next::Cut(ProfileCorrection { offsets, curve })
    };
    Ok(ProfileJudgement {
        deviation,
        parts: last.clone(),
        next,
    })
}

fn hindrance(
    splits: &[Split],
    offsets: &[f64],
    rules: &CorrectionRules,
) -> Result<Option<Hindrance>, ProfileError> {
    let [.., last] = splits else {
        return Ok(None);
    };
    let form = ProfileDeviation::of(&last.random)?.form();
    let needed = offsets.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let after = rms(&last.deterministic);
    let before = splits
        .len()
        .checked_sub(2)
        .map(|index| rms(&splits[index].deterministic));
    Ok(if form > rules.tolerance {
        Some(Hindrance::Random {
            form,
            tolerance: rules.tolerance,
        })
    } else if let Some(before) = before.filter(|before| after >= *before) {
        Some(Hindrance::NotRepeating { before, after })
    } else if splits.len() > rules.corrections {
        Some(Hindrance::Spent(rules.corrections))
    } else if needed > rules.largest {
        Some(Hindrance::TooLarge {
            needed,
            permitted: rules.largest,
        })
    } else {
        None
    })
}

/// Most segments of a path.
const SEGMENTS: usize = 1 << 16;

/// Path of the centre of a cutter of `radius` (m), on the left of travel, in straight segments of equal arc length along
/// the curve that leave the true path by at most `chord` (m).
///
/// # Errors
/// The curve is tighter than the cutter, or needs more than 65536 segments.
pub fn segmented_path(
    curve: &Spline,
    radius: f64,
    chord: f64,
) -> Result<Vec<Vector2<f64>>, CorrectionError> {
    if !(chord > 0.0 && chord.is_finite()) {
        return Err(CorrectionError::Rule("chord error", chord));
    }
    let mut count = 64;
    while count <= SEGMENTS {
        let path = tool_path(curve, radius, count + 1)?;
        // A segment is farthest from its arc at its middle.
        let within = path.windows(2).all(|ends| {
            let middle = (ends[0] + ends[1]) / 2.0;
            (curve.closest(&middle).distance - radius).abs() <= chord
        });
        if within {
            return Ok(path);
        }
        count *= 2;
    }
    Err(CorrectionError::Path(SEGMENTS, chord))
}
