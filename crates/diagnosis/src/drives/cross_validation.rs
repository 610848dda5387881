//! How far a set of drive effects shrinks the gap on pieces of time, or whole sessions, that were not used to fit.

use effects::session::SessionError;

use super::regression::{FOLDS, Leave, residuals};
use super::{Axis, Chosen, Drives};
use crate::blocks::interval;
use crate::report::SessionGap;
use inference::linear::dot;

/// Held-out sizes over blocks of time.
#[derive(Debug, Clone, Default)]
pub(super) struct HeldOut {
    pub(super) rms: f64,
    pub(super) relative: f64,
    pub(super) blocks: Vec<f64>,
    pub(super) squares: Vec<f64>,
    /// Number of samples of each block.
    pub(super) counts: Vec<f64>,
    /// Session and axis of each block.
    pub(super) of: Vec<(String, String)>,
}

impl HeldOut {
    fn add(&mut self, part: &[f64], scale: f64, bag: &str, axis: &str) {
        if part.is_empty() {
            return;
        }
        let mean = part.iter().map(|value| value * value).sum::<f64>() / part.len() as f64;
        self.blocks.push(mean / (scale * scale));
        self.squares.push(mean);
        self.counts.push(part.len() as f64);
        self.of.push((bag.to_owned(), axis.to_owned()));
        let mean = |values: &[f64]| dot(values, &self.counts) / self.counts.iter().sum::<f64>();
        self.rms = mean(&self.squares).sqrt();
        self.relative = mean(&self.blocks).sqrt();
    }

    /// The same session by session and axis by axis.
    pub(super) fn of_sessions(&self, before: &Self) -> Vec<SessionGap> {
        let mut pairs = self.of.clone();
        pairs.dedup();
        let pick = |all: &Self, pair: &(String, String)| -> Vec<f64> {
            (all.squares.iter().zip(&all.of))
                .filter(|(_, of)| *of == pair)
                .map(|(square, _)| *square)
                .collect()
        };
        pairs
            .iter()
            .map(|pair| {
                let (old, new) = (pick(before, pair), pick(self, pair));
                SessionGap {
                    bag: pair.0.clone(),
                    axis: Some(pair.1.clone()),
                    rms_before: (old.iter().sum::<f64>() / old.len().max(1) as f64).sqrt(),
                    rms_after: (new.iter().sum::<f64>() / new.len().max(1) as f64).sqrt(),
                    ci95_after: interval(&new),
                }
            })
            .collect()
    }
}

impl Drives {
    /// Held-out sizes: on the withheld sessions where `judged` and there are any, else on left-out pieces of the fitted.
    pub(super) fn held_out(&self, chosen: &Chosen, judged: bool) -> Result<HeldOut, SessionError> {
        let mut result = HeldOut::default();
        self.held_out_parts(chosen, judged, |axis, bag, part| {
            result.add(part, axis.scale, bag, &axis.signals.axis);
        })?;
        Ok(result)
    }

    /// Shows what is left of every judging piece of time of an axis of a session, in the order of time.
    pub(super) fn held_out_parts(
        &self,
        chosen: &Chosen,
        judged: bool,
        mut show: impl FnMut(&Axis, &str, &[f64]),
    ) -> Result<(), SessionError> {
        for index in 0..self.fitted[0].len() {
            let name = &self.fitted[0][index].signals.axis;
            let of = |axis: &&Axis| axis.signals.axis == *name;
            if judged && !self.judged.is_empty() {
                let fit = self.fit(index, chosen, None)?;
                for (session, bag) in self.judged.iter().zip(&self.names.1) {
                    let Some(axis) = session.iter().find(of) else {
                        continue;
                    };
                    let residuals = residuals(axis, chosen, &fit.coefficients);
                    for part in residuals.chunks(residuals.len().div_ceil(FOLDS)) {
                        show(axis, bag, part);
                    }
                }
                continue;
            }
            for (number, session) in self.fitted.iter().enumerate() {
                let Some(axis) = session.iter().find(of) else {
                    continue;
                };
                let count = axis.centred.len();
                let bag = self.names.0.get(number).map_or("", String::as_str);
                // Several sessions: each is judged by the others. One: by its other folds in time.
                let several = self.fitted.len() > 1;
                let mut beside = None;
                for fold in 0..FOLDS {
                    if beside.is_none() || !several {
                        let leave = if several {
                            Leave::Session(number)
                        } else {
                            Leave::Fold(number, fold)
                        };
                        let fit = self.fit(index, chosen, Some(leave))?;
                        beside = Some(residuals(axis, chosen, &fit.coefficients));
                    }
                    let residuals = beside.as_deref().unwrap_or_default();
                    let part: Vec<f64> = (0..count)
                        .filter(|sample| sample * FOLDS / count == fold)
                        .map(|sample| residuals[sample])
                        .collect();
                    show(axis, bag, &part);
                }
            }
        }
        Ok(())
    }
}
