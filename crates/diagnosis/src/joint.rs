//! The joint diagnosis of several sessions of touches on one machine: common causes, a pose for each session.
//!
//! The part's pose is fitted anew in every session and is never a cause here; on an arm so is where the probe sits on the
//! flange, since tool and workpiece are registered together. Families of the library that act alike in every session are
//! judged together ([`crate::families`]), on left-out stretches, or on whole withheld sessions where there are any. Slips, which
//! belong to one session, drifts where the sessions have no common clock, and the second order on curved surfaces are left to the
//! diagnosis of one session.

mod rows;

use effects::DeclaredEffect;
use effects::effect::{Coordinate, Subject};
use effects::library;
use effects::registry::acts_on;
use effects::session::{Session, SessionError};
use inference::linear::projected_out;

use crate::drives::diagnose_drives_with_residuals;
use crate::families::{self, Judged, Table};
use crate::nonnegativity::ExcludedParameters;
use crate::options::Options;
use crate::report::residuals::{self, Residuals, TouchResiduals};
use crate::report::{Gap, Level, Machine, Report, SCHEMA, SessionGap, declared, localisation};
pub use rows::Joined;

/// Explains several sessions together, touches or drives; fits on `fit`, judges on `withheld` where given; gives the report, and the residual of every
/// judging touch or sample.
///
/// # Errors
/// [`SessionError`] names what makes a session unusable.
pub fn diagnose_together_with_residuals(
    fit: &[Session],
    withheld: &[Session],
    options: &Options,
) -> Result<(Report, Residuals), SessionError> {
    let drives = |session: &Session| session.plan.is_none() && session.events.is_empty();
    if fit.iter().chain(withheld).all(drives) {
        return diagnose_drives_with_residuals(fit, withheld);
    }
    let sessions: Vec<&Session> = fit.iter().chain(withheld).collect();
    let joined = Joined::new(&sessions)?;
    let heading = Heading {
        fitted: names(fit),
        withheld: names(withheld),
        measured: fit.first().and_then(Session::measured),
        robot_description: fit
            .first()
            .map(|session| session.robot_description.as_str()),
        declared: (fit.first()).map_or(&[][..], |session| session.declared.as_slice()),
        has_one_clock: false,
    };
    diagnose_joined(&heading, &joined, options)
        .map(|(report, touches)| (report, Residuals::Touches(vec![touches])))
}

/// What a report says of its sessions before any number.
pub(crate) struct Heading<'a> {
    pub(crate) fitted: Vec<String>,
    pub(crate) withheld: Vec<String>,
    pub(crate) measured: Option<String>,
    pub(crate) robot_description: Option<&'a str>,
    pub(crate) declared: &'a [DeclaredEffect],
    /// The times of all sessions count from the same instant.
    pub(crate) has_one_clock: bool,
}

/// Explains joined rows of touches, those of the fitted sessions first.
pub(crate) fn diagnose_joined(
    heading: &Heading<'_>,
    joined: &Joined,
    options: &Options,
) -> Result<(Report, TouchResiduals), SessionError> {
    let mut impossible = ExcludedParameters::default();
    let variants = library(&joined.observations);
    loop {
        let (report, touches) = judge(heading, joined, &impossible, options)?;
        if !impossible.found_in(&report, &variants) {
            return Ok((report, touches));
        }
    }
}

fn judge(
    heading: &Heading<'_>,
    joined: &Joined,
    impossible: &ExcludedParameters,
    options: &Options,
) -> Result<(Report, TouchResiduals), SessionError> {
    let observations = &joined.observations;
    let y: Vec<f64> = (observations.deviations.iter().zip(&observations.rows))
        .zip(&joined.second_order)
        .map(|((deviation, row), second)| (deviation - second) * row.weight)
        .collect();
    let poses = joined.poses.concat();
    let mut variants = impossible.left_out(library(observations));
    // Where each clamping has a pose, a drift between parts is that of the poses.
    let drifts = heading.has_one_clock && observations.cut_here;
    variants.retain(|variant| {
        let own = acts_on(&variant.effect).is_some_and(|acts| {
            let is_drift = acts.smooth_in.contains(&Coordinate::Time);
            acts.subject == Subject::Session && !(drifts && is_drift)
        });
        let registered = joined
            .registered
            .iter()
            .any(|other| *other == variant.effect);
        !(own || registered || options.without.contains(&variant.effect))
    });
    let fitted = heading.fitted.len();
    let active: Vec<bool> = joined.session.iter().map(|&of| of < fitted).collect();
    let table = Table {
        observations,
        nuisances: &poses,
        y: &y,
    };
    let judged = table.judge(&variants, &active);
    let judged = judged.ok_or(SessionError::TooFew(0, 1))?;
    let together = Together {
        heading,
        joined,
        y: &y,
        judged: &judged,
    };
    Ok(together.report())
}

/// A judgement of several sessions, and what its report needs.
struct Together<'a> {
    heading: &'a Heading<'a>,
    joined: &'a Joined,
    y: &'a [f64],
    judged: &'a Judged,
}

impl Together<'_> {
    fn report(&self) -> (Report, TouchResiduals) {
        let observations = &self.joined.observations;
        let named = self.judged.named.len();
        let left: Vec<Vec<Option<f64>>> = (0..=named).map(|count| self.left(count)).collect();
        let sizes: Vec<_> = left.iter().map(|left| families::size(left)).collect();
        let gap = sizes[0].rms;
        let mut effects = self.judged.effects(gap, &sizes[1..]);
        for (effect, pair) in effects.iter_mut().zip(left.windows(2)) {
            effect.sessions = self.sessions([&pair[0], &pair[1]]);
        }
        let (noise, after) = (self.judged.noise, sizes[named].rms);
        let (verdict, unexplained) =
            families::verdict(observations, &left[named], (gap, after, noise), named);
        let used: Vec<bool> = left[0].iter().map(Option::is_some).collect();
        let before: Vec<f64> = left[0].iter().map(|value| value.unwrap_or(0.0)).collect();
        let floor = noise.min(after);
        let report = Report {
            schema: SCHEMA.to_owned(),
            bag: self.heading.fitted.join(" + "),
            fitted: self.heading.fitted.clone(),
            withheld: self.heading.withheld.clone(),
            measured: self.heading.measured.clone(),
            mount: None,
            machine: (self.heading.robot_description)
                .map(|text| Machine::of(text, observations.chain.name())),
            samples: used.iter().filter(|&&used| used).count(),
            verdict,
            level: Level::default(),
            channel: "touch".to_owned(),
            gap: Gap {
                unit: "m".to_owned(),
                rms: gap,
                noise_floor: floor,
                ratio: if floor > 0.0 { gap / floor } else { 0.0 },
            },
            noise: Vec::new(),
            place: localisation::shares(observations, &before, &used),
            rejected: self.judged.rejected(),
            declared: (self.heading.declared.iter())
                .map(|effect| declared::report_entry(effect, None))
                .collect(),
            effects,
            unexplained,
            next_measurement: Vec::new(),
            durations: None,
            measurements: None,
            warnings: self.warnings(),
        };
        let weight = |row: usize| observations.rows[row].weight;
        let first = self.first_judged();
        let mut touches = residuals::touches(
            observations,
            "touches against the model, the pose of each session fitted",
            self.names_judged(),
            |row| used[row].then(|| self.joined.session[row] - first),
            |row| before[row] / weight(row),
            |row| left[named][row].map(|value| value / weight(row)),
        );
        let shown = (observations.rows.iter().enumerate())
            .filter(|&(row, of)| used[row] && of.pose.is_some() && of.sequence.is_some());
        for (touch, (row, _)) in touches.touches.iter_mut().zip(shown) {
            let freedoms = self.joined.poses[self.joined.session[row]].iter();
            touch.pose = freedoms.map(|column| column[row] / weight(row)).collect();
        }
        (
            report.with_joint_zeros(&observations.chain).finished(),
            touches,
        )
    }

    /// Residuals of the judging rows with the first so many families: of withheld sessions, whose poses are fitted anew, or of
    /// left-out stretches.
    fn left(&self, families: usize) -> Vec<Option<f64>> {
        if self.heading.withheld.is_empty() {
            return self.judged.left_out(families);
        }
        let mut residuals = self.judged.predicted(families, self.y);
        for pose in &self.joined.poses[self.first_judged()..] {
            residuals = projected_out(residuals, pose);
        }
        let judges = |row: usize| self.joined.session[row] >= self.first_judged();
        let rows = residuals.into_iter().enumerate();
        rows.map(|(row, value)| judges(row).then_some(value))
            .collect()
    }

    /// Sizes of residuals session by session, before and after.
    fn sessions(&self, [before, after]: [&Vec<Option<f64>>; 2]) -> Vec<SessionGap> {
        let first = self.first_judged();
        let of = |residuals: &[Option<f64>], session: usize| {
            let rows = residuals.iter().zip(&self.joined.session);
            let own: Vec<Option<f64>> = rows
                .map(|(value, &of)| value.filter(|_| of == session))
                .collect();
            families::size(&own)
        };
        let judged = self.names_judged().into_iter().enumerate();
        judged
            .map(|(index, bag)| {
                let sized = of(after, first + index);
                SessionGap {
                    bag,
                    axis: None,
                    rms_before: of(before, first + index).rms,
                    rms_after: sized.rms,
                    ci95_after: sized.ci95,
                }
            })
            .collect()
    }

    /// The first session that judges.
    fn first_judged(&self) -> usize {
        if self.heading.withheld.is_empty() {
            0
        } else {
            self.heading.fitted.len()
        }
    }

    fn names_judged(&self) -> Vec<String> {
        let Heading {
            fitted, withheld, ..
        } = self.heading;
        if withheld.is_empty() {
            fitted
        } else {
            withheld
        }
        .clone()
    }

    fn warnings(&self) -> Vec<String> {
        let observations = &self.joined.observations;
        let mut warnings: Vec<String> = (observations.skipped.iter())
            .map(|(sequence, why)| format!("event {sequence} not used: {why}"))
            .collect();
        if !self.joined.registered.is_empty() {
            warnings.push(format!(
                "fitted separately in each session, before the gap: {}",
                self.joined.registered.join(", ")
            ));
        }
        let strays = (self.joined.session.iter().zip(&self.judged.active))
            .filter(|&(&of, &used)| of < self.heading.fitted.len() && !used)
            .count();
        if strays > 0 {
            warnings.push(format!("{strays} touches rejected as outliers"));
        }
        warnings
    }
}

fn names(sessions: &[Session]) -> Vec<String> {
    sessions
        .iter()
        .map(|session| session.name.clone())
        .collect()
}
