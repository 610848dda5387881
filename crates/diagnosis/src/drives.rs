//! The diagnosis of drives: motion and effort of axes over time.
//!
//! Samples of a drive are many and their errors correlated: evidence counts only the independent ones, and an effect is
//! named only when it also reduces the held-out residuals of other pieces of time, has the same size in both halves of the
//! record and removes a tenth of the remaining rms. Independent axes with a declared inertia are judged by
//! their effort; the coupled axes of an arm, whose nominal effort needs the whole dynamics, and axes without inertia by
//! their motion. A constant offset of a run's positions is an encoder's zero and ignored.

mod cross_validation;
mod regression;

use cross_validation::HeldOut;
use effects::drive::{
    Channel, DriveEffect, Signals, difference, library, nominal_inertia, signals,
};
use effects::session::{Session, SessionError};
use machine::{Chain, JointKind};
use metrology::statistics::{coverage_factor, rms};
use regression::UncertainFit;

use crate::arm::UNIT_MASS;
use crate::blocks::{better, interval};
use crate::report::residuals::{DriveResiduals, Residuals, axis_of};
use crate::report::{
    Effect, Gap, Level, ParameterEstimate, Place, Rejected, Report, SCHEMA, Unexplained, Verdict,
};

/// An effect must shrink the held-out rms at least by this share.
const WORTH: f64 = 0.1;
/// An effect on the effort must explain at least this share of the energy of the whole gap.
const SHARE: f64 = 0.005;
/// The same of a motion, where a gear's many small errors follow every load.
const SHARE_OF_MOTION: f64 = 0.03;
/// Effects whose held-out rms differs by less than this share are indistinguishable.
const CLOSE: f64 = 0.02;
/// An effect whose log evidence is lower by less than this is not excluded.
const NOT_EXCLUDED: f64 = 4.6;
/// An effect enters only when the model with it is this many times as probable (natural log).
const REFUTED: f64 = 2.303;
/// What remains counts as unknown when it is more than this share of the gap.
const UNEXPLAINED: f64 = 0.6;
/// And this many times the noise.
const FAR: f64 = 4.0;
/// Effects with more shapes than this are not part of the library whose residuals give the independent samples.
const FEW_SHAPES: usize = 16;
/// A gap below this many times the noise is none.
const QUIET: f64 = 1.4;
/// Most effects named.
const MOST: usize = 5;
/// Least number of independent samples of an axis.
const MIN_INDEPENDENT: f64 = 4.0;
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
/// [`SessionError`] names what makes a session unusable.
pub(crate) fn diagnose_drives_with_residuals(
    fit: &[Session],
    withheld: &[Session],
) -> Result<(Report, Residuals), SessionError> {
    let first = fit.first().ok_or(SessionError::NoPlan)?;
    let chain = Chain::from_urdf(&first.robot_description)?;
    for other in fit.iter().chain(withheld) {
        if other.robot_description != first.robot_description {
            return Err(SessionError::OtherMachine(
                first.name.clone(),
                other.name.clone(),
            ));
        }
    }
    if crate::arm::is_arm(&chain)
        && let Some(found) = crate::arm::diagnose(fit, withheld, &chain)?
    {
        return Ok(found);
    }
    let mut channel = channel(&chain, first);
    let of = |channel: Channel| -> Vec<Vec<Axis>> {
        fit.iter()
            .map(|session| axes(&chain, session, channel))
            .collect()
    };
    let mut fitted = of(channel);
    if channel == Channel::Motion && fitted.iter().all(Vec::is_empty) {
        // Commands that only repeat the motion carry no information: the effort is compared instead.
        channel = Channel::Effort;
        fitted = of(channel);
    }
    let judged: Vec<Vec<Axis>> = withheld
        .iter()
        .map(|session| axes(&chain, session, channel))
        .collect();
    if fitted.iter().all(Vec::is_empty) {
        return Err(SessionError::TooFew(0, FEWEST));
    }
    let drives = Drives {
        fitted,
        judged,
        channel,
        names: (names(fit), names(withheld)),
        unit: unit(&chain, channel),
    };
    let (report, chosen) = drives.report(first)?;
    let residuals = drives.residuals(&chain, &chosen)?;
    Ok((report, Residuals::Drives(residuals)))
}

fn names(sessions: &[Session]) -> Vec<String> {
    sessions
        .iter()
        .map(|session| session.name.clone())
        .collect()
}

/// Unit of the differences. It stays open for axes of both kinds and, for efforts, where every link has [`UNIT_MASS`].
fn unit(chain: &Chain, channel: Channel) -> String {
    let kinds: Vec<JointKind> = (0..chain.axes().len())
        .map(|axis| chain.axis(axis).kind)
        .collect();
    let all = |kind: JointKind| kinds.iter().all(|own| *own == kind);
    let normalised = (0..chain.axes().len()).all(|axis| chain.axis(axis).mass == UNIT_MASS);
    match channel {
        Channel::Motion if all(JointKind::Revolute) => "rad",
        Channel::Motion if all(JointKind::Prismatic) => "m",
        Channel::Motion => "m or rad",
        Channel::Effort if normalised => "effort",
        Channel::Effort if all(JointKind::Revolute) => "N m",
        Channel::Effort if all(JointKind::Prismatic) => "N",
        Channel::Effort => "N or N m",
    }
    .to_owned()
}

/// Effort for independent axes that have one, motion for arms and where nothing else is recorded.
fn channel(chain: &Chain, session: &Session) -> Channel {
    let coupled = crate::arm::is_arm(chain);
    let effort = session
        .joint_states
        .iter()
        .any(|state| !state.effort.is_empty());
    let heavy = chain
        .axis_names()
        .any(|axis| nominal_inertia(chain, axis) > 0.0);
    if ((coupled || !heavy) && !session.joint_commands.is_empty()) || !effort {
        Channel::Motion
    } else {
        Channel::Effort
    }
}

fn axes(chain: &Chain, session: &Session, channel: Channel) -> Vec<Axis> {
    let inertia = |axis: &str| match channel {
        Channel::Effort => nominal_inertia(chain, axis),
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
    let inertia = nominal_inertia(chain, &signals.axis);
    let coarse: Vec<f64> = (signals.acceleration.windows(3))
        .map(|a| 0.25 * (a[0] - 2.0 * a[1] + a[2]))
        .collect();
    let of_acceleration = signals.acceleration_noise.hypot(rms(&coarse));
    signals.effort_noise.hypot(inertia * of_acceleration)
}

/// Effects in the model: index in the library, and index of the shape.
type Chosen = Vec<(usize, usize)>;

/// A set with one effect more.
fn with(chosen: &Chosen, choice: (usize, usize)) -> Chosen {
    let mut more = chosen.clone();
    more.push(choice);
    more
}

/// An effect at its best shape, and the log evidence that it would add.
struct Trial {
    gain: f64,
    choice: (usize, usize),
}

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
    fn report(&self, session: &Session) -> Result<(Report, Chosen), SessionError> {
        let mut chosen: Chosen = Vec::new();
        let mut effects: Vec<Effect> = Vec::new();
        let mut current = self.held_out(&chosen, false)?;
        let first = current.relative.powi(2);
        // At the noise nothing remains to be named, and errors of the acceleration imitate all kinds of causes.
        let quiet = QUIET * self.floor();
        while chosen.len() < MOST && current.rms > quiet {
            let trials = self.steady_trials(&chosen)?;
            let Some(best) = trials.first() else {
                break;
            };
            let more = with(&chosen, best.choice);
            let after = self.held_out(&more, false)?;
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
            let equivalent = self.equivalent(&chosen, &trials, &after)?;
            let (before_judged, after_judged) =
                (self.held_out(&chosen, true)?, self.held_out(&more, true)?);
            effects.push(self.effect(best, &before_judged, &after_judged, equivalent));
            chosen = more;
            current = after;
        }
        for (effect, &choice) in effects.iter_mut().zip(&chosen) {
            effect.parameters = self.parameters(&chosen, choice)?;
        }
        Ok((self.finish(session, &chosen, effects)?, chosen))
    }

    /// Effects that could enter: probable enough and constants of the machine, best first.
    fn steady_trials(&self, chosen: &Chosen) -> Result<Vec<Trial>, SessionError> {
        let mut steady = Vec::new();
        for trial in self.trials(chosen, &self.independent(chosen)?)? {
            if trial.gain > REFUTED && self.steady(&with(chosen, trial.choice))? {
                steady.push(trial);
            }
        }
        Ok(steady)
    }

    /// Effects that neither evidence nor held-out blocks of time distinguish from the first of the trials.
    fn equivalent(
        &self,
        chosen: &Chosen,
        trials: &[Trial],
        after: &HeldOut,
    ) -> Result<Vec<String>, SessionError> {
        let mut equivalent = Vec::new();
        for trial in &trials[1..] {
            let close = || -> Result<bool, SessionError> {
                let other = self.held_out(&with(chosen, trial.choice), false)?;
                Ok(other.relative < (1.0 + CLOSE) * after.relative)
            };
            if trial.gain > trials[0].gain - NOT_EXCLUDED || close()? {
                let effect = &self.fitted[0][0].effects[trial.choice.0];
                equivalent.push(effect.effect.to_owned());
            }
        }
        for axis in &self.fitted[0] {
            let effect = &axis.effects[trials[0].choice.0];
            equivalent.extend(effect.same_as.iter().cloned());
        }
        Ok(equivalent)
    }

    /// Log evidence that each further effect would add at its best shape (Schwarz 1978), best first.
    fn trials(&self, chosen: &Chosen, independent: &[f64]) -> Result<Vec<Trial>, SessionError> {
        let library = &self.fitted[0][0].effects;
        let before = self.log_likelihood_loss(chosen, independent)?;
        let mut trials: Vec<Trial> = Vec::new();
        for (index, effect) in library.iter().enumerate() {
            if chosen.iter().any(|&(known, _)| known == index) {
                continue;
            }
            let mut best: Option<(f64, usize)> = None;
            for shape in 0..effect.shapes.len() {
                let loss = self.log_likelihood_loss(&with(chosen, (index, shape)), independent)?;
                if best.is_none_or(|(gain, _)| before - loss >= gain) {
                    best = Some((before - loss, shape));
                }
            }
            let Some((gain, shape)) = best else { continue };
            let terms = effect.shapes[shape].len() as f64;
            let penalty: f64 = independent.iter().map(|n| 0.5 * terms * n.ln()).sum();
            let choices = (library.len() as f64 * effect.shapes.len() as f64).ln();
            trials.push(Trial {
                gain: gain - penalty - choices,
                choice: (index, shape),
            });
        }
        trials.sort_by(|a, b| b.gain.total_cmp(&a.gain).then(a.choice.cmp(&b.choice)));
        Ok(trials)
    }

    /// Negative log likelihood of a set, up to a constant, each axis counted by its independent samples.
    fn log_likelihood_loss(
        &self,
        chosen: &Chosen,
        independent: &[f64],
    ) -> Result<f64, SessionError> {
        let mut sum = 0.0;
        for (index, samples) in independent.iter().enumerate() {
            let mean_square = self.fit(index, chosen, None)?.mean_square;
            sum += samples * 0.5 * mean_square.max(f64::MIN_POSITIVE).ln();
        }
        Ok(sum)
    }

    /// Independent samples of each axis, by the autocorrelation of the residuals of the whole library.
    fn independent(&self, chosen: &Chosen) -> Result<Vec<f64>, SessionError> {
        let mut every = chosen.clone();
        for (index, effect) in self.fitted[0][0].effects.iter().enumerate() {
            if effect.shapes.len() <= FEW_SHAPES && chosen.iter().all(|known| known.0 != index) {
                every.push((index, effect.shapes.len() / 2));
            }
        }
        (0..self.fitted[0].len())
            .map(|axis| {
                let fit = self.fit_with_uncertainties(axis, &every, None)?;
                Ok(fit.independent.max(MIN_INDEPENDENT))
            })
            .collect()
    }

    /// Parameters of one effect of a set, axis by axis.
    fn parameters(
        &self,
        chosen: &Chosen,
        choice: (usize, usize),
    ) -> Result<Vec<ParameterEstimate>, SessionError> {
        let mut parameters = Vec::new();
        for index in 0..self.fitted[0].len() {
            let axis = &self.fitted[0][index];
            let UncertainFit {
                coefficients,
                uncertainties,
                independent,
            } = self.fit_with_uncertainties(index, chosen, None)?;
            let freedom = (independent - coefficients.len() as f64).max(1.0);
            let coverage = coverage_factor(0.95, freedom);
            let terms = |&(effect, shape): &(usize, usize)| &axis.effects[effect].shapes[shape];
            let first: usize = (chosen.iter())
                .take_while(|&&other| other != choice)
                .map(|other| terms(other).len())
                .sum();
            for (term, column) in terms(&choice).iter().zip(first..) {
                let value = coefficients[column];
                let half = coverage * uncertainties[column];
                parameters.push(ParameterEstimate {
                    name: format!("{}.{}", axis.signals.axis, term.name),
                    value,
                    unit: term.unit.clone(),
                    ci95: [value - half, value + half],
                });
            }
        }
        Ok(parameters)
    }

    fn effect(
        &self,
        trial: &Trial,
        before: &HeldOut,
        after: &HeldOut,
        indistinguishable_from: Vec<String>,
    ) -> Effect {
        Effect {
            effect: self.fitted[0][0].effects[trial.choice.0].effect.to_owned(),
            probability: 1.0 / (1.0 + (-trial.gain).exp()),
            parameters: Vec::new(),
            rms_before: before.rms,
            rms_after: after.rms,
            ci95_after: interval(&after.squares),
            held_out: true,
            indistinguishable_from,
            group: Vec::new(),
            alternatives: Vec::new(),
            joint_zero: None,
            placebo_rms_after: None,
            sessions: after.of_sessions(before),
        }
    }

    /// Held-out residuals of the judging samples without any effect and with the chosen ones.
    fn residuals(
        &self,
        chain: &Chain,
        chosen: &Chosen,
    ) -> Result<Vec<DriveResiduals>, SessionError> {
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
                    Channel::Motion => pairs.map(|(read, commanded)| read - commanded).collect(),
                },
                before: before.to_vec(),
                after: Vec::new(),
            });
        })?;
        self.held_out_parts(chosen, true, |axis, bag, after| {
            let known = all
                .iter_mut()
                .find(|known| known.session == bag && known.axis.name == axis.signals.axis);
            if let Some(known) = known {
                known.after.extend(after);
            }
        })?;
        Ok(all)
    }

    fn finish(
        &self,
        session: &Session,
        chosen: &Chosen,
        effects: Vec<Effect>,
    ) -> Result<Report, SessionError> {
        let nothing = self.held_out(&Vec::new(), true)?;
        let last = self.held_out(chosen, true)?;
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
                reason: None,
            })
            .collect();
        let report = Report {
            schema: SCHEMA.to_owned(),
            bag: session.name.clone(),
            fitted: self.names.0.clone(),
            withheld: self.names.1.clone(),
            measured: session.measured(),
            mount: None,
            machine: None,
            samples: self
                .fitted
                .iter()
                .flatten()
                .map(|axis| axis.centred.len())
                .sum(),
            verdict,
            level: Level::default(),
            channel: match self.channel {
                Channel::Motion => "motion".to_owned(),
                Channel::Effort => "effort".to_owned(),
            },
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
                ladder: Vec::new(),
            },
            rejected,
            next_measurement: Vec::new(),
            durations: None,
            measurements: None,
            warnings: vec![match self.channel {
                Channel::Motion => "judged by motion".to_owned(),
                Channel::Effort => "judged by effort".to_owned(),
            }],
        };
        Ok(report.finished())
    }

    /// Noise of the samples, from what the low-pass leaves of it and how coarse the derivatives are; mean over the axes.
    fn floor(&self) -> f64 {
        let axes = &self.fitted[0];
        let sum: f64 = axes.iter().map(|axis| axis.noise * axis.noise).sum();
        (sum / axes.len().max(1) as f64).sqrt()
    }
}
