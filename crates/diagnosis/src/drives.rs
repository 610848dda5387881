//! The diagnosis of drives: motion and effort of axes over time, from messages to report.
//!
//! Samples of a drive are many and their errors correlated, so that every small term is significant; an effect is named
//! only when it shrinks the difference on pieces of time that were not used to fit, by more than chance and by more
//! than a tenth. Independent axes are judged by their effort (nominal: a rigid mass or inertia); the coupled axes of an
//! arm, whose nominal effort needs the whole dynamics, by their motion. A constant offset of a run's positions is an
//! encoder's zero and ignored.

mod effects;
mod signals;

use machine::{Chain, JointKind, Side};
use nalgebra::{DMatrix, DVector};

use effects::{Channel, DriveEffect, difference, library};
use signals::{Signals, signals};

use crate::evidence::add_scaled;
use crate::report::{
    Effect, Gap, ParameterEstimate, Place, Rejected, Report, SCHEMA, Unexplained, Verdict,
};
use crate::session::{DiagnoseError, Session};

/// Pieces of time that are left out in turn.
const FOLDS: usize = 10;
/// An effect must shrink the held-out rms at least by this share.
const WORTH: f64 = 0.1;
/// An effect must explain at least this share of the energy of the whole gap.
const SHARE: f64 = 0.05;
/// Rivals whose held-out rms is this close are not told apart.
const CLOSE: f64 = 0.02;
/// Most effects named.
const MOST: usize = 5;
/// Fewest samples of an axis.
const FEWEST: usize = 50;

/// One axis of one session, ready to be fitted.
struct Axis {
    signals: Signals,
    difference: Vec<f64>,
    effects: Vec<DriveEffect>,
    scale: f64,
}

/// Explains why drives behave otherwise than their model; fits on `fit`, judges on `withheld` where given and on
/// left-out pieces of time elsewhere.
///
/// # Errors
/// [`DiagnoseError`] names what makes a session unusable.
pub fn diagnose_drives(fit: &[Session], withheld: &[Session]) -> Result<Report, DiagnoseError> {
    let first = fit.first().ok_or(DiagnoseError::NoPlan)?;
    let chain = Chain::from_urdf(&first.robot_description)?;
    for other in fit.iter().chain(withheld) {
        if other.robot_description != first.robot_description {
            return Err(DiagnoseError::OtherMachine(
                first.name.clone(),
                other.name.clone(),
            ));
        }
    }
    let channel = channel(&chain, first);
    let fitted: Vec<Vec<Axis>> = fit
        .iter()
        .map(|session| axes(&chain, session, channel))
        .collect();
    let judged: Vec<Vec<Axis>> = withheld
        .iter()
        .map(|session| axes(&chain, session, channel))
        .collect();
    if fitted.iter().all(Vec::is_empty) {
        return Err(DiagnoseError::TooFew(0, FEWEST));
    }
    Ok(Drives {
        fitted,
        judged,
        channel,
    }
    .report(first))
}

/// Effort for independent axes that have one, motion for arms and where nothing else is recorded.
fn channel(chain: &Chain, session: &Session) -> Channel {
    let coupled = [Side::Part, Side::Tool].into_iter().any(|side| {
        let turning = |&&index: &&usize| chain.joints()[index].kind == JointKind::Revolute;
        chain.branch(side).iter().filter(turning).count() > 1
    });
    let effort = session
        .joint_states
        .iter()
        .any(|state| !state.effort.is_empty());
    if (coupled && !session.joint_commands.is_empty()) || !effort {
        Channel::Motion
    } else {
        Channel::Effort
    }
}

fn axes(chain: &Chain, session: &Session, channel: Channel) -> Vec<Axis> {
    signals(session)
        .into_iter()
        .filter_map(|signals| {
            let difference = difference(chain, &signals, channel)?;
            let effects = library(chain, &signals, channel);
            let scale = rms(&centred(&difference, channel));
            (difference.len() >= FEWEST && scale > 0.0).then_some(Axis {
                signals,
                difference,
                effects,
                scale,
            })
        })
        .collect()
}

/// Without its mean where a constant is an encoder's zero.
fn centred(values: &[f64], channel: Channel) -> Vec<f64> {
    if channel == Channel::Effort {
        return values.to_vec();
    }
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|value| value - mean).collect()
}

/// Effects in the model: place in the library, and the shape.
type Chosen = Vec<(usize, usize)>;

/// What a fit leaves out.
#[derive(Debug, Clone, Copy)]
enum Leave {
    /// One piece of time of a session.
    Fold(usize, usize),
    /// A whole session.
    Session(usize),
    /// The first or second half of every session.
    Half(usize),
}

impl Leave {
    fn leaves(self, session: usize, sample: usize, count: usize) -> bool {
        let fold = sample * FOLDS / count;
        match self {
            Self::Fold(number, left) => session == number && fold == left,
            Self::Session(number) => session == number,
            Self::Half(parity) => (fold * 2 / FOLDS) == parity,
        }
    }
}

struct Drives {
    fitted: Vec<Vec<Axis>>,
    judged: Vec<Vec<Axis>>,
    channel: Channel,
}

impl Drives {
    fn report(&self, session: &Session) -> Report {
        let library = &self.fitted[0][0].effects;
        let mut chosen: Chosen = Vec::new();
        let mut effects: Vec<Effect> = Vec::new();
        let mut current = self.held_out(&chosen);
        let first = current.relative.powi(2);
        while chosen.len() < MOST {
            let mut trials: Vec<(f64, (usize, usize))> = Vec::new();
            for (place, effect) in library.iter().enumerate() {
                if chosen.iter().any(|&(known, _)| known == place) {
                    continue;
                }
                let shapes = (0..effect.shapes.len()).map(|shape| {
                    let mut more = chosen.clone();
                    more.push((place, shape));
                    (
                        if effect.shapes.len() > 8 {
                            self.quick(&more)
                        } else {
                            self.held_out(&more).relative
                        },
                        shape,
                    )
                });
                if let Some((_, shape)) = shapes.min_by(|one, other| one.0.total_cmp(&other.0)) {
                    let mut more = chosen.clone();
                    more.push((place, shape));
                    trials.push((self.held_out(&more).relative, (place, shape)));
                }
            }
            trials.sort_by(|one, other| one.0.total_cmp(&other.0));
            let with = |choice: (usize, usize)| {
                let mut more = chosen.clone();
                more.push(choice);
                more
            };
            trials.retain(|trial| self.steady(&with(trial.1)));
            let Some(&(least, leader)) = trials.first() else {
                break;
            };
            let best = self.held_out(&with(leader));
            // Those that blocks of time cannot part from the best are equals; the first of the library is named.
            let mut tied: Vec<(usize, usize)> = trials
                .iter()
                .filter(|trial| {
                    trial.0 < least + CLOSE * current.relative || trial.1 == leader || {
                        let other = self.held_out(&with(trial.1));
                        better(&current.blocks, &other.blocks)
                            && trial.0 < (1.0 - WORTH) * current.relative
                            && !better(&other.blocks, &best.blocks)
                    }
                })
                .map(|trial| trial.1)
                .collect();
            tied.sort_unstable();
            let choice = tied[0];
            let more = with(choice);
            let after = self.held_out(&more);
            let share = (current.relative.powi(2) - after.relative.powi(2)) / first;
            if share < SHARE
                || after.relative > (1.0 - WORTH) * current.relative
                || !better(&current.blocks, &after.blocks)
            {
                break;
            }
            chosen = more;
            let mut equals: Vec<String> = tied[1..]
                .iter()
                .map(|(place, _)| library[*place].effect.to_owned())
                .collect();
            for axis in &self.fitted[0] {
                equals.extend(axis.effects[choice.0].same_as.iter().cloned());
            }
            effects.push(self.effect(
                &chosen,
                choice,
                &current,
                &after,
                equals,
                trials.get(trials.len() / 2).map(|t| t.0),
            ));
            current = after;
        }
        self.finish(session, &chosen, effects, &current)
    }

    /// True when the last effect of a set is the same in both halves of the record: a constant of the machine, with
    /// the sign that physics asks for.
    fn steady(&self, chosen: &Chosen) -> bool {
        let Some(&(place, shape)) = chosen.last() else {
            return true;
        };
        (0..self.fitted[0].len()).all(|index| {
            let effect = &self.fitted[0][index].effects[place];
            let terms = effect.shapes[shape].len();
            let half = |parity: usize| {
                let (coefficients, spread) = self.fit(index, chosen, Some(Leave::Half(parity)));
                let first = coefficients.len().saturating_sub(terms);
                (coefficients[first..].to_vec(), spread[first..].to_vec())
            };
            let ((one, s1), (other, s2)) = (half(0), half(1));
            (0..one.len()).all(|term| {
                let (a, b) = (one[term], other[term]);
                let doubt = 3.0 * s1[term].hypot(s2[term]);
                let same = (a - b).abs() <= doubt.max(0.5 * a.abs().max(b.abs()));
                let physical = effect.sign == 0.0 || (effect.sign * (a + b) >= -doubt);
                same && physical
            })
        })
    }

    fn effect(
        &self,
        chosen: &Chosen,
        choice: (usize, usize),
        before: &HeldOut,
        after: &HeldOut,
        indistinguishable_from: Vec<String>,
        placebo: Option<f64>,
    ) -> Effect {
        let mut parameters = Vec::new();
        for index in 0..self.fitted[0].len() {
            let (coefficients, spread) = self.fit(index, chosen, None);
            let mut start = 0;
            for &(place, shape) in chosen {
                let terms = &self.fitted[0][index].effects[place].shapes[shape];
                if (place, shape) == choice {
                    for (offset, term) in terms.iter().enumerate() {
                        let value = coefficients[start + offset];
                        let half = 1.96 * spread[start + offset];
                        parameters.push(ParameterEstimate {
                            name: format!("{}.{}", self.fitted[0][index].signals.axis, term.name),
                            value,
                            unit: term.unit.clone(),
                            ci95: [value - half, value + half],
                        });
                    }
                }
                start += terms.len();
            }
        }
        Effect {
            effect: self.fitted[0][0].effects[choice.0].effect.to_owned(),
            probability: 1.0 - chance(&before.blocks, &after.blocks),
            parameters,
            rms_before: before.rms,
            rms_after: after.rms,
            ci95_after: after.interval(),
            held_out: true,
            indistinguishable_from,
            placebo_rms_after: placebo.map(|relative| relative / after.relative * after.rms),
            sessions: Vec::new(),
        }
    }

    fn finish(
        &self,
        session: &Session,
        chosen: &Chosen,
        effects: Vec<Effect>,
        last: &HeldOut,
    ) -> Report {
        let nothing = self.held_out(&Vec::new());
        let floor = self.floor(chosen);
        let unexplained = (last.rms * last.rms - floor * floor).max(0.0).sqrt();
        let smooth = unexplained > 0.5 * nothing.rms && last.rms > 3.0 * floor;
        let verdict = match (effects.is_empty(), smooth) {
            (true, true) => Verdict::Unexplained,
            (true, false) => Verdict::NoGap,
            (false, true) => Verdict::PartlyExplained,
            (false, false) => Verdict::Explained,
        };
        let total: f64 = self.fitted[0].iter().map(|axis| axis.scale.powi(2)).sum();
        let place = |share: &dyn Fn(&Axis) -> f64| -> Vec<Place> {
            let of = |axis: &Axis| Place {
                dimension: "axis".to_owned(),
                key: axis.signals.axis.clone(),
                from: None,
                to: None,
                share: share(axis),
            };
            self.fitted[0].iter().map(of).collect()
        };
        let named: Vec<&str> = effects
            .iter()
            .map(|effect| effect.effect.as_str())
            .collect();
        let rejected = self.fitted[0][0]
            .effects
            .iter()
            .filter(|effect| !named.contains(&effect.effect))
            .map(|effect| Rejected {
                effect: effect.effect.to_owned(),
                probability: 0.0,
            })
            .collect();
        Report {
            schema: SCHEMA.to_owned(),
            bag: session.name.clone(),
            fitted: Vec::new(),
            withheld: Vec::new(),
            samples: self
                .fitted
                .iter()
                .flatten()
                .map(|axis| axis.difference.len())
                .sum(),
            verdict,
            gap: Gap {
                unit: if self.channel == Channel::Effort {
                    "effort"
                } else {
                    "m"
                }
                .to_owned(),
                rms: nothing.rms,
                noise_floor: floor,
                ratio: if floor > 0.0 {
                    nothing.rms / floor
                } else {
                    0.0
                },
            },
            place: place(&|axis| axis.scale.powi(2) / total),
            effects,
            unexplained: Unexplained {
                rms: if smooth { unexplained } else { 0.0 },
                place: if smooth {
                    place(&|axis| axis.scale.powi(2) / total)
                } else {
                    Vec::new()
                },
            },
            rejected,
            next_measurement: Vec::new(),
            warnings: vec![match self.channel {
                Channel::Motion => "judged by motion".to_owned(),
                Channel::Effort => "judged by effort".to_owned(),
            }],
        }
    }

    /// Noise of the samples: what second differences of the residual, which no slow cause survives, leave.
    fn floor(&self, chosen: &Chosen) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for index in 0..self.fitted[0].len() {
            let (coefficients, _) = self.fit(index, chosen, None);
            let axis = &self.fitted[0][index];
            let left = self.residuals(axis, chosen, &coefficients);
            let mut sizes: Vec<f64> = left
                .windows(3)
                .map(|w| (w[0] - 2.0 * w[1] + w[2]).abs() / 6.0_f64.sqrt())
                .collect();
            sizes.sort_by(f64::total_cmp);
            sum += (1.4826 * sizes[sizes.len() / 2]).powi(2);
            count += 1.0;
        }
        f64::sqrt(sum / f64::max(count, 1.0))
    }

    /// Coefficients of an axis over all fitted sessions, and their standard uncertainties (correlation allowed for).
    fn fit(&self, index: usize, chosen: &Chosen, without: Option<Leave>) -> (Vec<f64>, Vec<f64>) {
        let name = &self.fitted[0][index].signals.axis;
        let mut rows: Vec<Vec<f64>> = Vec::new();
        let mut right: Vec<f64> = Vec::new();
        for (number, session) in self.fitted.iter().enumerate() {
            let Some(axis) = session.iter().find(|axis| axis.signals.axis == *name) else {
                continue;
            };
            let count = axis.difference.len();
            let columns = self.columns(axis, chosen);
            let y = centred(&axis.difference, self.channel);
            for sample in 0..count {
                if without.is_some_and(|leave| leave.leaves(number, sample, count)) {
                    continue;
                }
                rows.push(columns.iter().map(|column| column[sample]).collect());
                right.push(y[sample]);
            }
        }
        let n = rows.first().map_or(0, Vec::len);
        if n == 0 {
            return (Vec::new(), Vec::new());
        }
        let sizes: Vec<f64> = (0..n)
            .map(|column| {
                (rows.iter().map(|row| row[column].powi(2)).sum::<f64>() / rows.len() as f64)
                    .sqrt()
                    .max(1e-300)
            })
            .collect();
        let matrix = DMatrix::from_fn(rows.len(), n, |row, column| {
            rows[row][column] / sizes[column]
        });
        let target = DVector::from_vec(right);
        let mut normal = matrix.tr_mul(&matrix);
        for diagonal in 0..n {
            normal[(diagonal, diagonal)] += 1e-9 * rows.len() as f64;
        }
        let Some(inverse) = normal.try_inverse() else {
            return (vec![0.0; n], vec![0.0; n]);
        };
        let scaled = &inverse * matrix.tr_mul(&target);
        let left = &target - &matrix * &scaled;
        let effective = effective_share(left.as_slice());
        // Correlated samples count less: the covariance grows by the inverse of their independent share.
        let variance = left.norm_squared() / (rows.len() as f64 * effective).max(1.0);
        let spread = (0..n).map(|i| (inverse[(i, i)] * variance).sqrt() / sizes[i]);
        (
            scaled
                .iter()
                .zip(&sizes)
                .map(|(value, size)| value / size)
                .collect(),
            spread.collect(),
        )
    }

    fn columns(&self, axis: &Axis, chosen: &Chosen) -> Vec<Vec<f64>> {
        chosen
            .iter()
            .flat_map(|&(place, shape)| {
                axis.effects[place].shapes[shape]
                    .iter()
                    .map(|term| centred(&term.column, self.channel))
            })
            .collect()
    }

    fn residuals(&self, axis: &Axis, chosen: &Chosen, coefficients: &[f64]) -> Vec<f64> {
        let mut left = centred(&axis.difference, self.channel);
        for (column, coefficient) in self.columns(axis, chosen).iter().zip(coefficients) {
            add_scaled(&mut left, -coefficient, column);
        }
        left
    }

    /// Fit quality without leaving anything out, to choose among many shapes.
    fn quick(&self, chosen: &Chosen) -> f64 {
        let mut sum = 0.0;
        for index in 0..self.fitted[0].len() {
            let (coefficients, _) = self.fit(index, chosen, None);
            let axis = &self.fitted[0][index];
            sum += (rms(&self.residuals(axis, chosen, &coefficients)) / axis.scale).powi(2);
        }
        sum
    }

    fn held_out(&self, chosen: &Chosen) -> HeldOut {
        let mut result = HeldOut::default();
        for index in 0..self.fitted[0].len() {
            let name = &self.fitted[0][index].signals.axis;
            if self.judged.is_empty() {
                for (number, session) in self.fitted.iter().enumerate() {
                    let Some(axis) = session.iter().find(|axis| axis.signals.axis == *name) else {
                        continue;
                    };
                    let count = axis.difference.len();
                    // Several sessions: each is judged by the others. One: by its other pieces of time.
                    let several = self.fitted.len() > 1;
                    let whole =
                        several.then(|| self.fit(index, chosen, Some(Leave::Session(number))).0);
                    for fold in 0..FOLDS {
                        let leave = Leave::Fold(number, fold);
                        let coefficients = whole
                            .clone()
                            .unwrap_or_else(|| self.fit(index, chosen, Some(leave)).0);
                        let left = self.residuals(axis, chosen, &coefficients);
                        let part: Vec<f64> = (0..count)
                            .filter(|sample| sample * FOLDS / count == fold)
                            .map(|sample| left[sample])
                            .collect();
                        result.add(&part, axis.scale);
                    }
                }
            } else {
                let (coefficients, _) = self.fit(index, chosen, None);
                for axis in self
                    .judged
                    .iter()
                    .flatten()
                    .filter(|axis| axis.signals.axis == *name)
                {
                    let left = self.residuals(axis, chosen, &coefficients);
                    for part in left.chunks(left.len().div_ceil(FOLDS)) {
                        result.add(part, axis.scale);
                    }
                }
            }
        }
        result.close();
        result
    }
}

/// Held-out sizes over blocks of time.
#[derive(Debug, Clone, Default)]
struct HeldOut {
    rms: f64,
    relative: f64,
    blocks: Vec<f64>,
    squares: Vec<f64>,
}

impl HeldOut {
    fn add(&mut self, part: &[f64], scale: f64) {
        if !part.is_empty() {
            let mean = part.iter().map(|value| value * value).sum::<f64>() / part.len() as f64;
            self.blocks.push(mean / (scale * scale));
            self.squares.push(mean);
        }
    }

    fn close(&mut self) {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        self.rms = mean(&self.squares).sqrt();
        self.relative = mean(&self.blocks).sqrt();
    }

    fn interval(&self) -> [f64; 2] {
        let count = self.squares.len() as f64;
        let mean = self.squares.iter().sum::<f64>() / count.max(1.0);
        let scatter = self
            .squares
            .iter()
            .map(|square| (square - mean).powi(2))
            .sum::<f64>()
            / (count - 1.0).max(1.0);
        let half = 1.96 * (scatter / count.max(1.0)).sqrt();
        [(mean - half).max(0.0).sqrt(), (mean + half).sqrt()]
    }
}

/// True when most blocks agree that it is better: paired differences by more than two standard errors.
fn better(before: &[f64], after: &[f64]) -> bool {
    chance(before, after) < 0.025
}

/// Probability that the mean improvement over blocks is chance.
fn chance(before: &[f64], after: &[f64]) -> f64 {
    let gains: Vec<f64> = before
        .iter()
        .zip(after)
        .map(|(one, other)| one - other)
        .collect();
    let count = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / count.max(1.0);
    let scatter =
        gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let ratio = mean / (scatter / count.max(1.0)).sqrt().max(f64::MIN_POSITIVE);
    // Normal tail, Abramowitz and Stegun 26.2.17 for positive arguments.
    if ratio <= 0.0 {
        return 1.0;
    }
    let t = 1.0 / (1.0 + 0.231_641_9 * ratio);
    let series = t
        * (0.319_381_530
            + t * (-0.356_563_782
                + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    (-0.5 * ratio * ratio).exp() / std::f64::consts::TAU.sqrt() * series
}

/// Share of samples that are independent, from the correlation of neighbours.
fn effective_share(left: &[f64]) -> f64 {
    let power: f64 = left.iter().map(|value| value * value).sum();
    let lag: f64 = left.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = (lag / power.max(f64::MIN_POSITIVE)).clamp(0.0, 0.999);
    (1.0 - correlation) / (1.0 + correlation)
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
