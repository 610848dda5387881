//! The diagnosis of time: why a measuring order takes another time than the plan promised.
//!
//! ```text
//!   touches, orders -- effects::motion::moves --> rows: from touch to touch, measured and promised
//!                            |
//!         selection   columns of each limit at the best model so far, inference::search over sets, repeated until the
//!            |        set stands; sizes by least squares on the motion model itself (fit)
//!         judge       blocks of time that were not fitted, what else fits as well, what remains
//!            |
//!         report      channel `time`, s
//! ```
//!
//! The motion model is not linear in its limits: what a lower acceleration costs depends on which axis is the slowest. So
//! candidates are linearised about the best model found so far, as in a Gauss–Newton iteration, while every size and every
//! comparison of two sets is of the model itself. Seconds, m, rad. Deterministic.

mod fit;
mod judge;
mod report;
mod selection;

use effects::motion::{FEED_DEVIATIONS, MotionParameter, Moves, MovesError, library, moves};
use effects::session::{Session, SessionError};
use effects::vocabulary;
use machine::{Chain, Motion};
use probecell_msgs::MeasurementOrder;

use crate::options::Options;
use crate::report::Report;
use crate::report::residuals::Residuals;

/// Rows of a session, and the limits that may be others than declared.
struct Rows<'a> {
    moves: &'a Moves,
    limits: Vec<MotionParameter>,
    measured: Vec<f64>,
}

/// A limit, by its place in [`Rows::limits`], and its value.
type Setting = (usize, f64);

impl Rows<'_> {
    /// The declared model with these limits in place of the declared ones.
    fn motion(&self, settings: &[Setting]) -> Motion {
        let mut motion = self.moves.declared.clone();
        for &(limit, value) in settings {
            self.limits[limit].set(&mut motion, value);
        }
        motion
    }

    /// What each row takes by that model, s.
    fn durations(&self, settings: &[Setting]) -> Vec<f64> {
        self.moves.durations(&self.motion(settings))
    }

    /// How far the override of feeds is off what the recorded axes show, over the standard deviation of that; 0 where they do not.
    fn feed_off(&self, settings: &[Setting]) -> f64 {
        let modelled = self.motion(settings).program.feed_override;
        self.moves.feed_seen.map_or(0.0, |[least, most]| {
            let seen = 0.5 * (least + most);
            (modelled - seen) / ((most - seen) / FEED_DEVIATIONS)
        })
    }

    /// Measured less modelled, s.
    fn residuals(&self, settings: &[Setting]) -> Vec<f64> {
        let durations = self.durations(settings);
        let pairs = self.measured.iter().zip(durations);
        pairs
            .map(|(measured, duration)| measured - duration)
            .collect()
    }
}

/// Explains why the moves of a session take another time than `motion`, the declared model, says; `orders` are the
/// measuring orders of its plan.
///
/// # Errors
/// [`MovesError`] names what makes the session unusable.
pub fn diagnose_time(
    session: &Session,
    orders: &[MeasurementOrder],
    motion: &Motion,
    options: &Options,
) -> Result<(Report, Residuals), MovesError> {
    let moves = moves(session, orders, motion)?;
    let chain = Chain::from_urdf(&session.robot_description).map_err(SessionError::from)?;
    let known = vocabulary::identifiers(&chain);
    if let Some(name) = options.without.iter().find(|name| !known.contains(name)) {
        return Err(SessionError::UnknownEffect {
            name: name.clone(),
            nearest: vocabulary::nearest(name, &known)
                .unwrap_or_default()
                .to_owned(),
        }
        .into());
    }
    let mut limits = library(&moves);
    limits.retain(|limit| !options.without.contains(&limit.effect));
    let rows = Rows {
        moves: &moves,
        limits,
        measured: moves.intervals.iter().map(|row| row.measured).collect(),
    };
    let selected = selection::select(&rows);
    let judged = judge::judge(&rows, selected);
    Ok(report::report(session, &rows, &judged))
}
