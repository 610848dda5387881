//! The diagnosis of drives: motion and effort of axes over time, from messages to report.
//!
//! Samples of a drive are many and their errors correlated: evidence counts only the independent ones, and an effect is
//! named only when it also shrinks the difference on pieces of time that were not used to fit, keeps its size in both
//! halves of the record and is worth a tenth of what remains. Independent axes with a declared inertia are judged by
//! their effort; the coupled axes of an arm, whose nominal effort needs the whole dynamics, and axes without inertia by
//! their motion. A constant offset of a run's positions is an encoder's zero and ignored.

mod effects;
mod fit;
mod judge;
mod signals;

use effects::{Channel, DriveEffect, difference, library};
use fit::Fit;
use judge::{HeldOut, better, interval};
use machine::{Chain, JointKind, Side};
use signals::{Signals, signals};

use crate::report::{
    Effect, Gap, ParameterEstimate, Place, Rejected, Report, SCHEMA, Unexplained, Verdict,
};
use crate::residuals::{DriveResiduals, Residuals, axis_of};
use crate::session::{DiagnoseError, Session};

/// An effect must shrink the held-out rms at least by this share.
const WORTH: f64 = 0.1;
/// An effect on the effort must explain at least this share of the energy of the whole gap.
const SHARE: f64 = 0.005;
/// The same of a motion, where a gear's many small errors follow every load.
const SHARE_OF_MOTION: f64 = 0.03;
/// Rivals whose held-out rms is this close are not told apart.
const CLOSE: f64 = 0.02;
/// A rival this much (natural log) less probable is not excluded.
const NOT_EXCLUDED: f64 = 4.6;
/// An effect enters only when the model with it is this many times as probable (natural log).
const REFUTED: f64 = 2.303;
/// What remains counts as unknown when it is more than this share of the gap.
const UNEXPLAINED: f64 = 0.6;
/// And this many times the noise.
const FAR: f64 = 4.0;
/// Effects with more shapes than this are not part of the whole library that tells the independent samples.
const FEW_SHAPES: usize = 16;
/// A gap below this many times the noise is none.
const QUIET: f64 = 1.4;
/// Most effects named.
const MOST: usize = 5;
/// Fewest samples of an axis.
const FEWEST: usize = 50;

/// One axis of one session, ready to be fitted.
struct Axis {
    signals: Signals,
    /// Measured less nominal, without an encoder's zero.
    centred: Vec<f64>,
    effects: Vec<DriveEffect>,
    scale: f64,
    /// Standard deviation of the noise in `centred`.
    noise: f64,
}

/// Explains why drives behave otherwise than their model; fits on `fit`, judges on `withheld` where given and on
/// left-out pieces of time elsewhere.
///
/// # Errors
/// [`DiagnoseError`] names what makes a session unusable.
pub fn diagnose_drives(fit: &[Session], withheld: &[Session]) -> Result<Report, DiagnoseError> {
    diagnose_drives_with_residuals(fit, withheld).map(|(report, _)| report)
}

/// The same, with what every judging sample misses the model by.
pub(crate) fn diagnose_drives_with_residuals(
    fit: &[Session],
    withheld: &[Session],
) -> Result<(Report, Residuals), DiagnoseError> {
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
    let mut channel = channel(&chain, first);
    let of = |channel: Channel| -> Vec<Vec<Axis>> {
        fit.iter()
            .map(|session| axes(&chain, session, channel))
            .collect()
    };
    let mut fitted = of(channel);
    if channel == Channel::Motion && fitted.iter().all(Vec::is_empty) {
        // Commands that only repeat the motion say nothing: what is left to compare is the effort.
        channel = Channel::Effort;
        fitted = of(channel);
    }
    let judged: Vec<Vec<Axis>> = withheld
        .iter()
        .map(|session| axes(&chain, session, channel))
        .collect();
    if fitted.iter().all(Vec::is_empty) {
        return Err(DiagnoseError::TooFew(0, FEWEST));
    }
    let drives = Drives {
        fitted,
        judged,
        channel,
        names: (names(fit), names(withheld)),
        unit: unit(&chain, channel),
    };
    let (report, chosen) = drives.report(first);
    Ok((report, Residuals::Drives(drives.residuals(&chain, &chosen))))
}

fn names(sessions: &[Session]) -> Vec<String> {
    sessions
        .iter()
        .map(|session| session.name.clone())
        .collect()
}

/// Unit of the differences. Axes of both kinds, or inertias that all stand for one unit of something else, leave it open.
fn unit(chain: &Chain, channel: Channel) -> String {
    let kinds: Vec<JointKind> = (0..chain.axes().len())
        .map(|axis| chain.axis(axis).kind)
        .collect();
    let all = |kind: JointKind| kinds.iter().all(|own| *own == kind);
    let placeholder = (0..chain.axes().len()).all(|axis| chain.axis(axis).mass == 1.0);
    match channel {
        Channel::Motion if all(JointKind::Revolute) => "rad",
        Channel::Motion if all(JointKind::Prismatic) => "m",
        Channel::Motion => "m or rad",
        Channel::Effort if placeholder => "effort",
        Channel::Effort if all(JointKind::Revolute) => "N m",
        Channel::Effort if all(JointKind::Prismatic) => "N",
        Channel::Effort => "N or N m",
    }
    .to_owned()
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
    let heavy = chain
        .axis_names()
        .any(|axis| effects::nominal_inertia(chain, axis) > 0.0);
    if ((coupled || !heavy) && !session.joint_commands.is_empty()) || !effort {
        Channel::Motion
    } else {
        Channel::Effort
    }
}

fn axes(chain: &Chain, session: &Session, channel: Channel) -> Vec<Axis> {
    let inertia = |axis: &str| match channel {
        Channel::Effort => effects::nominal_inertia(chain, axis),
        Channel::Motion => 0.0,
    };
    signals(session, &inertia)
        .into_iter()
        .filter_map(|signals| {
            let centred = centred(difference(chain, &signals, channel)?, channel);
            let mut effects = library(chain, &signals, channel);
            for term in effects
                .iter_mut()
                .flat_map(|effect| effect.shapes.iter_mut().flatten())
            {
                term.column = self::centred(std::mem::take(&mut term.column), channel);
            }
            let scale = rms(&centred);
            let noise = noise(chain, &signals, channel);
            (centred.len() >= FEWEST && scale > 0.0).then_some(Axis {
                signals,
                centred,
                effects,
                scale,
                noise,
            })
        })
        .collect()
}

/// Without its mean where a constant is an encoder's zero.
fn centred(mut values: Vec<f64>, channel: Channel) -> Vec<f64> {
    if channel == Channel::Motion {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        for value in &mut values {
            *value -= mean;
        }
    }
    values
}

/// Noise of the difference: of the sensors, and of an acceleration sampled too coarsely.
fn noise(chain: &Chain, signals: &Signals, channel: Channel) -> f64 {
    if channel == Channel::Motion {
        return signals.position_noise * std::f64::consts::SQRT_2;
    }
    let inertia = effects::nominal_inertia(chain, &signals.axis);
    let coarse: Vec<f64> = (signals.acceleration.windows(3))
        .map(|a| 0.25 * (a[0] - 2.0 * a[1] + a[2]))
        .collect();
    let of_acceleration = signals.acceleration_noise.hypot(rms(&coarse));
    signals.effort_noise.hypot(inertia * of_acceleration)
}

/// Effects in the model: place in the library, and the shape.
type Chosen = Vec<(usize, usize)>;

struct Drives {
    fitted: Vec<Vec<Axis>>,
    judged: Vec<Vec<Axis>>,
    channel: Channel,
    /// Names of the fitted and of the judging sessions.
    names: (Vec<String>, Vec<String>),
    unit: String,
}

impl Drives {
    /// The report, and the effects in it.
    fn report(&self, session: &Session) -> (Report, Chosen) {
        let library = &self.fitted[0][0].effects;
        let mut chosen: Chosen = Vec::new();
        let mut effects: Vec<Effect> = Vec::new();
        let mut current = self.held_out(&chosen, false);
        let first = current.relative.powi(2);
        // At the noise nothing is left to name, and errors of the acceleration pass for all kinds of causes.
        let quiet = QUIET * self.floor();
        while chosen.len() < MOST && current.rms > quiet {
            let mut trials = self.trials(&chosen, &self.independent(&chosen));
            let with = |choice: (usize, usize)| {
                let mut more = chosen.clone();
                more.push(choice);
                more
            };
            trials.retain(|trial| trial.0 > REFUTED && self.steady(&with(trial.1)));
            let Some(&(most, choice)) = trials.first() else {
                break;
            };
            let more = with(choice);
            let after = self.held_out(&more, false);
            let share = (current.relative.powi(2) - after.relative.powi(2)) / first;
            let least = match self.channel {
                Channel::Effort => SHARE,
                Channel::Motion => SHARE_OF_MOTION,
            };
            if share < least
                || after.relative > (1.0 - WORTH) * current.relative
                || !better(&current.blocks, &after.blocks)
            {
                break;
            }
            // What blocks of time cannot part from the best is its equal.
            let equal = |trial: &&(f64, (usize, usize))| {
                let other = self.held_out(&with(trial.1), false);
                trial.0 > most - NOT_EXCLUDED || other.relative < (1.0 + CLOSE) * after.relative
            };
            let mut equals: Vec<String> = (trials[1..].iter().filter(equal))
                .map(|(_, (place, _))| library[*place].effect.to_owned())
                .collect();
            for axis in &self.fitted[0] {
                equals.extend(axis.effects[choice.0].same_as.iter().cloned());
            }
            let (before_judged, after_judged) =
                (self.held_out(&chosen, true), self.held_out(&more, true));
            chosen = more;
            effects.push(self.effect(choice, &before_judged, &after_judged, equals, most));
            current = after;
        }
        for (effect, &choice) in effects.iter_mut().zip(&chosen) {
            effect.parameters = self.parameters(&chosen, choice);
        }
        (self.finish(session, &chosen, effects), chosen)
    }

    /// What each further effect would add to the log evidence at its best shape, best first.
    fn trials(&self, chosen: &Chosen, independent: &[f64]) -> Vec<(f64, (usize, usize))> {
        let library = &self.fitted[0][0].effects;
        let before = self.log_sizes(chosen, independent);
        let mut trials: Vec<(f64, (usize, usize))> = Vec::new();
        for (place, effect) in library.iter().enumerate() {
            if chosen.iter().any(|&(known, _)| known == place) {
                continue;
            }
            let best = (0..effect.shapes.len())
                .map(|shape| {
                    let mut more = chosen.clone();
                    more.push((place, shape));
                    (before - self.log_sizes(&more, independent), shape)
                })
                .max_by(|one, other| one.0.total_cmp(&other.0));
            let Some((gain, shape)) = best else { continue };
            let terms = effect.shapes[shape].len() as f64;
            let learned: f64 = independent.iter().map(|n| 0.5 * terms * n.ln()).sum();
            let choices = (library.len() as f64 * effect.shapes.len() as f64).ln();
            trials.push((gain - learned - choices, (place, shape)));
        }
        trials.sort_by(|one, other| other.0.total_cmp(&one.0).then(one.1.cmp(&other.1)));
        trials
    }

    /// Half the log of the residual power, each axis counted by its independent samples.
    fn log_sizes(&self, chosen: &Chosen, independent: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (index, samples) in independent.iter().enumerate() {
            let power = self.fit(index, chosen, None, false).power;
            sum += samples * 0.5 * power.max(f64::MIN_POSITIVE).ln();
        }
        sum
    }

    /// Independent samples of each axis: what the whole library leaves, by its own correlation.
    fn independent(&self, chosen: &Chosen) -> Vec<f64> {
        let mut every = chosen.clone();
        for (place, effect) in self.fitted[0][0].effects.iter().enumerate() {
            if effect.shapes.len() <= FEW_SHAPES && chosen.iter().all(|known| known.0 != place) {
                every.push((place, effect.shapes.len() / 2));
            }
        }
        (0..self.fitted[0].len())
            .map(|index| {
                let fit = self.fit(index, &every, None, true);
                (fit.samples * fit.share).max(4.0)
            })
            .collect()
    }

    /// Parameters of one effect of a set, axis by axis.
    fn parameters(&self, chosen: &Chosen, choice: (usize, usize)) -> Vec<ParameterEstimate> {
        let mut parameters = Vec::new();
        for index in 0..self.fitted[0].len() {
            let Fit {
                coefficients,
                spread,
                ..
            } = self.fit(index, chosen, None, true);
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
        parameters
    }

    fn effect(
        &self,
        choice: (usize, usize),
        before: &HeldOut,
        after: &HeldOut,
        indistinguishable_from: Vec<String>,
        gain: f64,
    ) -> Effect {
        Effect {
            effect: self.fitted[0][0].effects[choice.0].effect.to_owned(),
            probability: 1.0 / (1.0 + (-gain).exp()),
            parameters: Vec::new(),
            rms_before: before.rms,
            rms_after: after.rms,
            ci95_after: interval(&after.squares),
            held_out: true,
            indistinguishable_from,
            alternatives: Vec::new(),
            placebo_rms_after: None,
            sessions: after.of_sessions(before),
        }
    }

    /// Held-out residuals of the judging samples without any effect and with the chosen ones.
    fn residuals(&self, chain: &Chain, chosen: &Chosen) -> Vec<DriveResiduals> {
        let mut all: Vec<DriveResiduals> = Vec::new();
        self.held_out_parts(&Vec::new(), true, |axis, bag, before| {
            let known = all
                .iter_mut()
                .find(|known| known.session == bag && known.axis.name == axis.signals.axis);
            if let Some(known) = known {
                known.before.extend(before);
                return;
            }
            let signals = &axis.signals;
            let kind = (chain.axis_index(&signals.axis))
                .map_or(JointKind::Prismatic, |index| chain.axis(index).kind);
            let pairs = signals.position.iter().zip(&signals.command);
            all.push(DriveResiduals {
                session: bag.to_owned(),
                axis: axis_of(&signals.axis, kind),
                unit: self.unit.clone(),
                time: signals.time.clone(),
                position: signals.position.clone(),
                speed: signals.speed.clone(),
                measured: match self.channel {
                    Channel::Effort => signals.effort.clone(),
                    Channel::Motion => pairs.map(|(read, told)| read - told).collect(),
                },
                before: before.to_vec(),
                after: Vec::new(),
            });
        });
        self.held_out_parts(chosen, true, |axis, bag, after| {
            let known = all
                .iter_mut()
                .find(|known| known.session == bag && known.axis.name == axis.signals.axis);
            if let Some(known) = known {
                known.after.extend(after);
            }
        });
        all
    }

    fn finish(&self, session: &Session, chosen: &Chosen, effects: Vec<Effect>) -> Report {
        let nothing = self.held_out(&Vec::new(), true);
        let last = self.held_out(chosen, true);
        let floor = self.floor();
        let unexplained = (last.rms * last.rms - floor * floor).max(0.0).sqrt();
        let large = effects.is_empty() || unexplained > UNEXPLAINED * nothing.rms;
        let smooth = large && last.rms > FAR * floor;
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
            fitted: self.names.0.clone(),
            withheld: self.names.1.clone(),
            measured: session.measured(),
            machine: None,
            samples: self
                .fitted
                .iter()
                .flatten()
                .map(|axis| axis.centred.len())
                .sum(),
            verdict,
            gap: Gap {
                unit: self.unit.clone(),
                rms: nothing.rms,
                noise_floor: floor,
                ratio: if floor > 0.0 {
                    nothing.rms / floor
                } else {
                    0.0
                },
            },
            noise: Vec::new(),
            place: place(&|axis| axis.scale.powi(2) / total),
            declared: Vec::new(),
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

    /// Noise of the samples, from what the low-pass leaves of it and how coarse the derivatives are; mean over the axes.
    fn floor(&self) -> f64 {
        let axes = &self.fitted[0];
        let sum: f64 = axes.iter().map(|axis| axis.noise * axis.noise).sum();
        (sum / axes.len().max(1) as f64).sqrt()
    }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
