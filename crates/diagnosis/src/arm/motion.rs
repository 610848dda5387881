//! Why the joints of an arm are elsewhere than commanded: causes of a position-controlled joint, each simulated from the command.
//!
//! A cause enters for all joints at once, in the order in which it shrinks stretches of time that were not fitted; the other motion,
//! where there is one, judges. A constant difference of a session is an encoder's zero and left out. rad or m.

use effects::drive::signals::derivative;
use machine::{Dynamics, JointKind, PARAMETERS};
use metrology::statistics::rms;
use nalgebra::DMatrix;

use super::QUIET;
use super::left::{Left, Named, half_width, named_effect, size};
use super::servo::{self, CAUSES, Cause, Joint, Parameters, centred};
use super::track::{Track, range};
use crate::report::ParameterEstimate;

/// A cause must shrink what is left of the left-out stretches by this share: as a length or angle over all joints, or joint by
/// joint over its gap,
const WORTH: f64 = 0.1;
/// in neither way let it grow by more than this share, and shrink what is left of the judging sessions by as much.
const GROWS: f64 = 0.05;
/// Causes whose left-out rms differs by less than this share are not told apart.
const CLOSE: f64 = 0.02;
/// Stretches of time that are left out in turn.
const FOLDS: usize = 5;
/// Most samples of a session; others are averaged.
const MOST_SAMPLES: usize = 3_000;
/// A joint that goes over less than this share of the longest way of its kind does not move.
const STANDING: f64 = 0.02;
/// Usual droop that all parameters of the links make together, over the usual droop.
const USUAL_COLUMN: f64 = 0.3;

/// Shortest lever at which a joint feels what the tip presses on, m/rad or 1.
const SHORTEST: f64 = 1e-3;

/// One joint over all sessions.
struct Axis {
    body: usize,
    fitted: Vec<Joint>,
    withheld: Vec<Joint>,
    /// Root mean square of its gap.
    gap: f64,
}

/// Positions and commands of all sessions.
pub(super) struct Motions<'a> {
    dynamics: &'a Dynamics,
    fitted: &'a [Track],
    withheld: &'a [Track],
    axes: Vec<Axis>,
    samples: Vec<Vec<usize>>,
    /// Lowest commanded height of the tip in the fitted sessions, m.
    lowest: f64,
}

/// Session, stretch and what is left of it.
type Parts = Vec<(usize, usize, Vec<f64>)>;

/// Causes with the parameters of each joint.
#[derive(Clone)]
struct Model {
    causes: Vec<Cause>,
    parameters: Vec<Parameters>,
    /// Of each joint the values of fits that leave out a stretch each.
    replicates: Vec<Vec<Vec<f64>>>,
    /// Left-out rms over the gap, mean square over the joints.
    relative: f64,
    /// Left-out rms over all samples.
    absolute: f64,
}

/// A model, what it leaves of the judging sessions, and what is not told from its last cause.
struct Step {
    model: Model,
    left: Vec<Left>,
    group: Vec<String>,
}

impl Step {
    fn new(model: Model, left: Vec<Left>, group: Vec<String>) -> Self {
        Self { model, left, group }
    }
}

/// Causes that are offered together: accelerations, the masses of the links and a contact act only beside a droop.
fn sets() -> Vec<Vec<Cause>> {
    let beside = |cause: &Cause| matches!(cause, Cause::Inertia | Cause::Links | Cause::Contact);
    let single = CAUSES.into_iter().filter(|cause| !beside(cause));
    let together = [
        vec![Cause::Delay, Cause::Lag],
        vec![Cause::Droop, Cause::Inertia],
        vec![Cause::Droop, Cause::Links],
        vec![Cause::Droop, Cause::Contact],
        vec![Cause::Droop, Cause::Links, Cause::Contact],
    ];
    single.map(|cause| vec![cause]).chain(together).collect()
}

impl Model {
    /// What is left over what another leaves, in the way in which it is less.
    fn over(&self, other: &Self) -> f64 {
        (self.relative / other.relative).min(self.absolute / other.absolute)
    }

    /// True where it is worth having more causes than another.
    fn is_better_than(&self, other: &Self) -> bool {
        let most = (self.relative / other.relative).max(self.absolute / other.absolute);
        self.over(other) < 1.0 - WORTH && most < 1.0 + GROWS
    }
}

impl<'a> Motions<'a> {
    /// The joints that move; `None` where none has commands.
    pub(super) fn new(
        dynamics: &'a Dynamics,
        fitted: &'a [Track],
        withheld: &'a [Track],
    ) -> Option<Self> {
        let all: Vec<&Track> = fitted.iter().chain(withheld).collect();
        let kind = |body: usize| dynamics.bodies()[body].kind;
        let way = |body: usize| {
            let ways = all.iter().map(|track| range(&track.command[body]));
            ways.fold(0.0, f64::max)
        };
        let longest = |of: JointKind| {
            let ways = (0..dynamics.bodies().len())
                .filter(|&body| kind(body) == of)
                .map(way);
            ways.fold(0.0, f64::max)
        };
        let moves = |body: &usize| {
            let commanded = all.iter().all(|track| !track.command[*body].is_empty());
            let noise = all
                .iter()
                .map(|track| track.position_noise[*body])
                .fold(0.0, f64::max);
            commanded && way(*body) > (STANDING * longest(kind(*body))).max(4.0 * noise)
        };
        let bodies: Vec<usize> = (0..dynamics.bodies().len()).filter(moves).collect();
        let samples: Vec<Vec<usize>> = all.iter().map(|track| firsts(track)).collect();
        let loads: Vec<Loads> = (all.iter().zip(&samples))
            .map(|(track, firsts)| Loads::of(dynamics, track, firsts))
            .collect();
        let lowest = (loads[..fitted.len()].iter().flat_map(|loads| &loads.height))
            .fold(f64::MAX, |low, &z| low.min(z));
        let mut axes = Vec::new();
        for body in bodies {
            let scale = Columns::of(dynamics, body, lowest, &loads[..fitted.len()].iter());
            let mut joints: Vec<Joint> = (all.iter().zip(&samples))
                .zip(&loads)
                .map(|((track, firsts), loads)| {
                    joint(dynamics, track, body, (firsts, loads), &scale)
                })
                .collect();
            let withheld = joints.split_off(fitted.len());
            let gap: Vec<f64> = joints
                .iter()
                .flat_map(|joint| centred(joint.difference()))
                .collect();
            axes.push(Axis {
                body,
                fitted: joints,
                withheld,
                gap: rms(&gap).max(1e-12),
            });
        }
        (!axes.is_empty()).then_some(Self {
            dynamics,
            fitted,
            withheld,
            axes,
            samples,
            lowest,
        })
    }

    /// Parameters of each joint for some causes beside those of a model, and how far they shrink stretches that were left out;
    /// `None` where not even the samples that are fitted shrink enough.
    fn model(&self, causes: &[Cause], start: Option<&Model>) -> Option<Model> {
        let measured = |left: &[Vec<f64>]| {
            let squares = |(axis, left): (&Axis, &Vec<f64>)| (rms(left) / axis.gap).powi(2);
            let relative: f64 = self.axes.iter().zip(left).map(squares).sum();
            let all: Vec<f64> = left.iter().flatten().copied().collect();
            [(relative / left.len() as f64).sqrt(), rms(&all)]
        };
        let fitted = in_parallel(self.axes.len(), &|number| {
            let joints: Vec<&Joint> = self.axes[number].fitted.iter().collect();
            let known = start.map(|model| model.parameters[number].values.as_slice());
            let own = servo::fit(&joints, causes, known, &|_, _| true)?;
            let left = joints.iter().flat_map(|joint| joint.left(&own.values));
            let left: Vec<f64> = left.collect();
            Some((own, left))
        });
        let (parameters, left): (Vec<Parameters>, Vec<Vec<f64>>) = fitted
            .into_iter()
            .collect::<Option<Vec<_>>>()?
            .into_iter()
            .unzip();
        let [relative, absolute] = measured(&left);
        if start.is_some_and(|than| {
            (relative / than.relative).min(absolute / than.absolute) > 1.0 - WORTH
        }) {
            return None;
        }
        let left_out = in_parallel(self.axes.len(), &|number| {
            Self::left_out(&self.axes[number], causes, &parameters[number])
        });
        let (parts, replicates): (Vec<Parts>, Vec<Vec<Vec<f64>>>) = left_out
            .into_iter()
            .collect::<Option<Vec<_>>>()?
            .into_iter()
            .unzip();
        let join = |parts: Parts| parts.into_iter().flat_map(|(_, _, left)| left).collect();
        let left: Vec<Vec<f64>> = parts.into_iter().map(join).collect();
        let [relative, absolute] = measured(&left);
        Some(Model {
            causes: causes.to_vec(),
            parameters,
            replicates,
            relative,
            absolute,
        })
    }

    /// Session, stretch and residuals of each stretch that a fit has left out; with several sessions a whole session at a time.
    fn left_out(axis: &Axis, causes: &[Cause], own: &Parameters) -> Option<(Parts, Vec<Vec<f64>>)> {
        let joints: Vec<&Joint> = axis.fitted.iter().collect();
        let fold = |session: usize, sample: usize| fold(sample, axis.fitted[session].time.len());
        let (mut parts, mut replicates) = (Vec::new(), Vec::new());
        let several = axis.fitted.len() > 1;
        for (session, joint) in axis.fitted.iter().enumerate() {
            let mut left = Vec::new();
            for stretch in 0..FOLDS {
                if stretch == 0 || !several {
                    let used = |of: usize, sample: usize| {
                        of != session || (!several && fold(of, sample) != stretch)
                    };
                    let values = servo::fit_without(&joints, causes, own, &used)?;
                    left = joint.left(&values);
                    replicates.push(values);
                }
                let own = (0..left.len()).filter(|&sample| fold(session, sample) == stretch);
                parts.push((session, stretch, own.map(|sample| left[sample]).collect()));
            }
        }
        Some((parts, replicates))
    }

    /// What a model leaves of the judging sessions.
    fn judged(&self, model: &Model) -> Option<Vec<Left>> {
        let mut all = Vec::new();
        for (axis, own) in self.axes.iter().zip(&model.parameters) {
            if self.withheld.is_empty() {
                for (session, stretch, residuals) in Self::left_out(axis, &model.causes, own)?.0 {
                    let firsts = &self.samples[session];
                    let own = |&place: &usize| fold(place, firsts.len()) == stretch;
                    let places = (0..firsts.len()).filter(own);
                    all.push(Left {
                        session,
                        stretch,
                        joint: axis.body,
                        residuals,
                        samples: places.map(|place| firsts[place]).collect(),
                    });
                }
                continue;
            }
            for (number, joint) in axis.withheld.iter().enumerate() {
                let session = self.fitted.len() + number;
                let left = joint.left(&own.values);
                let firsts = &self.samples[session];
                let part = left.len().div_ceil(FOLDS).max(1);
                for (stretch, (residuals, samples)) in
                    left.chunks(part).zip(firsts.chunks(part)).enumerate()
                {
                    all.push(Left {
                        session,
                        stretch,
                        joint: axis.body,
                        residuals: residuals.to_vec(),
                        samples: samples.to_vec(),
                    });
                }
            }
        }
        Some(all)
    }

    /// Of models with one more cause the one that closes most; a delay may be a dead time, a lag, or both.
    fn best<'m>(
        &self,
        current: &Model,
        tried: &'m [Model],
        refused: &[String],
    ) -> Option<&'m Model> {
        let over = |model: &Model| model.over(current);
        let added = |model: &Model| model.causes[current.causes.len()..].to_vec();
        let name = |model: &Model| self.identifier(&added(model));
        let better = || {
            let better = tried.iter().filter(|model| model.is_better_than(current));
            better.filter(|model| !refused.contains(&name(model)))
        };
        let first = name(better().min_by(|a, b| over(a).total_cmp(&over(b)))?);
        // Of those with one name that are not told apart the simplest comes first.
        let rank = |model: &Model| over(model) * (1.0 + CLOSE).powi(added(model).len() as i32);
        let alike = better().filter(|model| name(model) == first);
        alike.min_by(|a, b| rank(a).total_cmp(&rank(b)))
    }

    /// Models with more causes than the one before each, all of which judge better.
    fn chain(&self, first: Model) -> Option<Vec<Step>> {
        let left = self.judged(&first)?;
        let mut chain = vec![Step::new(first, left, Vec::new())];
        let (mut refused, quiet) = (Vec::new(), QUIET * self.floor());
        while let Some(last) = chain.last()
            && size(&last.left) > quiet
        {
            let tried = self.tried(&last.model);
            let mut found = None;
            let most = (1.0 - GROWS) * size(&last.left);
            while let Some(one) = self.next(last, &tried, &refused) {
                if size(&one.left) <= most {
                    found = Some(vec![one]);
                    break;
                }
                // What does not help another motion is no cause, unless with the next one it does.
                let two = self.next(&one, &self.tried(&one.model), &refused);
                if let Some(two) = two.filter(|two| size(&two.left) <= most) {
                    found = Some(vec![one, two]);
                    break;
                }
                refused.push(self.identifier(&one.model.causes[last.model.causes.len()..]));
            }
            let Some(found) = found else { break };
            for step in found {
                // A delay that is named may be of both kinds.
                match chain.pop_if(|last| self.names_again(&last.model, &step.model)) {
                    Some(last) => chain.push(Step {
                        group: last.group,
                        ..step
                    }),
                    None => chain.push(step),
                }
            }
        }
        self.sorted(chain)
    }

    /// The next step after one.
    fn next(&self, last: &Step, tried: &[Model], refused: &[String]) -> Option<Step> {
        let model = self.best(&last.model, tried, refused)?;
        let group = self.not_told(model, last.model.causes.len(), tried);
        Some(Step::new(model.clone(), self.judged(model)?, group))
    }

    /// True where what a model has more than another is named there.
    fn names_again(&self, before: &Model, after: &Model) -> bool {
        let name = self.identifier(&after.causes[before.causes.len()..]);
        before
            .causes
            .iter()
            .any(|&cause| self.identifier(&[cause]) == name)
    }

    /// Models with one more cause than another.
    fn tried(&self, current: &Model) -> Vec<Model> {
        let has = |cause: &Cause| current.causes.contains(cause);
        let is_late = has(&Cause::Delay) || has(&Cause::Lag);
        let is_new = |set: &Vec<Cause>| {
            let name = self.identifier(set);
            let known = current
                .causes
                .iter()
                .any(|&cause| self.identifier(&[cause]) == name);
            !known
                || (is_late
                    && set.len() == 1
                    && !has(&set[0])
                    && name == self.identifier(&[Cause::Delay]))
        };
        let with = |more: Vec<Cause>| {
            let causes: Vec<Cause> = current.causes.iter().copied().chain(more).collect();
            self.model(&causes, Some(current))
        };
        sets().into_iter().filter(is_new).filter_map(with).collect()
    }

    /// The same, what makes the other motion worse by itself behind the one with which it makes it better.
    fn sorted(&self, mut chain: Vec<Step>) -> Option<Vec<Step>> {
        for last in (2..chain.len()).rev() {
            for place in 1..last {
                if size(&chain[place].left) <= size(&chain[place - 1].left) {
                    continue;
                }
                let [before, own, whole] =
                    [place - 1, place, place + 1].map(|one| chain[one].model.causes.clone());
                let other = &whole[own.len()..];
                let causes = [&before, other].concat();
                let Some(model) = self.model(&causes, None) else {
                    continue;
                };
                let turned = [&causes, &own[before.len()..]].concat();
                for later in &mut chain[place + 1..] {
                    later.model.causes[..turned.len()].copy_from_slice(&turned);
                }
                let group = std::mem::take(&mut chain[place + 1].group);
                let left = self.judged(&model)?;
                chain[place + 1].group =
                    std::mem::replace(&mut chain[place], Step::new(model, left, group)).group;
            }
        }
        Some(chain)
    }

    /// Names the causes.
    pub(super) fn named(&self) -> Option<Named> {
        let chain = self.chain(self.model(&[], None)?)?;
        let (first, last) = (chain.first()?, chain.last()?);
        let name =
            |pair: &[Step]| self.identifier(&last.model.causes[pair[0].model.causes.len()..]);
        let of = |name: &str| -> Vec<Cause> {
            let all = last.model.causes.iter().copied();
            all.filter(|&cause| self.identifier(&[cause]) == name)
                .collect()
        };
        // What is named beside it is no rival of a cause.
        let names: Vec<String> = chain.windows(2).map(name).collect();
        let effect = |(pair, name): (&[Step], &String)| {
            let rivals = pair[1].group.iter().filter(|other| !names.contains(other));
            // Parameters are those of the whole.
            named_effect(
                name,
                1.0,
                self.estimates(&last.model, &of(name)),
                rivals.cloned().collect(),
                (&pair[0].left, &pair[1].left),
                &self.tracks(),
                self.dynamics,
            )
        };
        Some(Named {
            effects: chain.windows(2).zip(&names).map(effect).collect(),
            remarks: self.contact(&last.model).into_iter().collect(),
            before: first.left.clone(),
            after: last.left.clone(),
        })
    }

    /// What is said of a contact: which joints yield, below which height, and when first.
    fn contact(&self, model: &Model) -> Option<String> {
        if !model.causes.contains(&Cause::Contact) {
            return None;
        }
        let felt = self
            .axes
            .iter()
            .zip(&model.parameters)
            .filter_map(|(axis, own)| {
                let height = own.contact()?;
                let pressed = |joint: &Joint| {
                    let at = joint.height.iter().position(|&z| z < height)?;
                    Some(joint.time[at])
                };
                let (session, first) = (axis.fitted.iter().enumerate())
                    .find_map(|(session, joint)| Some((session, pressed(joint)?)))?;
                let (joint, bag) = (
                    &self.dynamics.bodies()[axis.body].joint,
                    &self.fitted[session].session,
                );
                let height = height + self.lowest;
                Some(format!(
                    "{joint} below z = {height:.3} m (at {first:.1} s of {bag})"
                ))
            });
        let felt: Vec<String> = felt.collect();
        (!felt.is_empty()).then(|| {
            format!(
                "probe_mount presses on something and joints yield: {}",
                felt.join(", ")
            )
        })
    }

    /// Identifier of a cause; a scale has the name of its joint, the first that moves.
    fn identifier(&self, causes: &[Cause]) -> String {
        match causes[0] {
            Cause::Delay | Cause::Lag => "drive.delay".to_owned(),
            Cause::Droop | Cause::Inertia | Cause::Links | Cause::Contact => {
                "drive.droop".to_owned()
            }
            Cause::Limit => "drive.saturation".to_owned(),
            Cause::Friction => "drive.coulomb_friction".to_owned(),
            Cause::Scale => {
                let body = self.axes.first().map_or(0, |axis| axis.body);
                format!("axis.{}.scale", self.dynamics.bodies()[body].joint)
            }
        }
    }

    /// What left-out stretches do not tell from what a model has after so many causes, and what is the same behind a proportional
    /// controller.
    fn not_told(&self, after: &Model, known: usize, tried: &[Model]) -> Vec<String> {
        let added = &after.causes[known..];
        let mut group = Vec::new();
        for model in tried {
            let other = self.identifier(&model.causes[known..]);
            let close = model.over(after) < 1.0 + CLOSE;
            if close && other != self.identifier(added) && !group.contains(&other) {
                group.push(other);
            }
        }
        let joints = self
            .axes
            .iter()
            .map(|axis| &self.dynamics.bodies()[axis.body].joint);
        match added[0] {
            Cause::Delay | Cause::Lag => {
                group.extend(joints.map(|joint| format!("axis.{joint}.lag")));
            }
            Cause::Friction => group.push("drive.backlash".to_owned()),
            Cause::Limit => {}
            Cause::Droop | Cause::Inertia | Cause::Links | Cause::Contact => {
                group.push("drive.compliance".to_owned());
            }
            Cause::Scale => group.extend(joints.skip(1).map(|joint| format!("axis.{joint}.scale"))),
        }
        group
    }

    /// Parameters of causes, joint by joint.
    fn estimates(&self, model: &Model, causes: &[Cause]) -> Vec<ParameterEstimate> {
        let mut estimates = Vec::new();
        for ((axis, own), replicates) in self
            .axes
            .iter()
            .zip(&model.parameters)
            .zip(&model.replicates)
        {
            let body = &self.dynamics.bodies()[axis.body];
            let length = match body.kind {
                JointKind::Prismatic => "m",
                _ => "rad",
            };
            let names = causes.iter().flat_map(|&cause| Parameters::of(cause));
            for &(name, place) in names {
                let unit = match name {
                    "dead_time" | "time_constant" => "s",
                    "inertia_over_stiffness" => "s²",
                    "acceleration" if length == "m" => "m/s²",
                    "acceleration" => "rad/s²",
                    "below_height" => "m",
                    "half_width" | "at_mean_weight" | "at_usual_acceleration" => length,
                    _ => "1",
                };
                if own.deviations[place] == 0.0 {
                    continue;
                }
                let scatter: Vec<f64> = replicates.iter().map(|values| values[place]).collect();
                let mut value = own.values[place];
                let mut half = half_width(own.deviations[place], &scatter);
                match name {
                    "below_height" => value += self.lowest,
                    // The parameter is its inverse.
                    "acceleration" if value > 0.0 => {
                        (value, half) = (1.0 / value, half / (value * value));
                    }
                    "acceleration" => continue,
                    _ => {}
                }
                estimates.push(ParameterEstimate {
                    name: format!("{}.{name}", body.joint),
                    value,
                    unit: unit.to_owned(),
                    ci95: [value - half, value + half],
                });
            }
        }
        estimates
    }

    /// Noise of the compared positions; mean over the joints.
    pub(super) fn floor(&self) -> f64 {
        let noise = |axis: &Axis| self.fitted[0].position_noise[axis.body];
        let squares: f64 = self.axes.iter().map(|axis| noise(axis).powi(2)).sum();
        (2.0 * squares / self.axes.len() as f64).sqrt()
    }

    /// Number of fitted values.
    pub(super) fn samples(&self) -> usize {
        let of = |axis: &Axis| {
            axis.fitted
                .iter()
                .map(|joint| joint.time.len())
                .sum::<usize>()
        };
        self.axes.iter().map(of).sum()
    }

    /// All sessions, fitted ones first.
    pub(super) fn tracks(&self) -> Vec<&Track> {
        self.fitted.iter().chain(self.withheld).collect()
    }
}

/// Part of a session that a sample is left out with, of so many.
fn fold(sample: usize, count: usize) -> usize {
    sample * FOLDS / count.max(1)
}

/// What a function makes of each number, over the processor's cores.
fn in_parallel<T: Send>(count: usize, make: &(impl Fn(usize) -> T + Sync)) -> Vec<T> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let of = |core: usize| (core..count).step_by(cores).map(make).collect::<Vec<T>>();
    std::thread::scope(|scope| {
        let of = &of;
        let own: Vec<_> = (1..cores.min(count))
            .map(|core| scope.spawn(move || of(core)))
            .collect();
        let mut all = vec![of(0).into_iter()];
        for core in own {
            match core.join() {
                Ok(made) => all.push(made.into_iter()),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        (0..count)
            .filter_map(|number| all[number % cores].next())
            .collect()
    })
}

/// First samples of the runs that are averaged.
fn firsts(track: &Track) -> Vec<usize> {
    let run = track.len().div_ceil(MOST_SAMPLES).max(1);
    (0..track.len()).step_by(run).collect()
}

/// What acts on the joints where they are commanded, by kept sample.
struct Loads {
    /// Of each joint the effort of weight per unit of each inertial parameter of each body.
    rows: Vec<Vec<Vec<f64>>>,
    /// Of each joint the effort of speeds and accelerations by the description.
    inertial: Vec<Vec<f64>>,
    /// Of each joint the way of the tip upwards, m/rad or 1; zeros without a tip.
    lever: Vec<Vec<f64>>,
    /// Height of the tip, m.
    height: Vec<f64>,
}

impl Loads {
    fn of(dynamics: &Dynamics, track: &Track, firsts: &[usize]) -> Self {
        let count = dynamics.bodies().len();
        let zero = vec![0.0; count];
        let time: Vec<f64> = firsts.iter().map(|&sample| track.time[sample]).collect();
        let piece = vec![0; time.len()];
        let path = |joint: usize| -> [Vec<f64>; 3] {
            let values = if track.command[joint].is_empty() {
                &track.position[joint]
            } else {
                &track.command[joint]
            };
            let pose: Vec<f64> = firsts.iter().map(|&sample| values[sample]).collect();
            let speed = derivative(&time, &piece, &pose);
            let acceleration = derivative(&time, &piece, &speed);
            [pose, speed, acceleration]
        };
        let paths: Vec<[Vec<f64>; 3]> = (0..count).map(path).collect();
        let mut loads = Self {
            rows: Vec::new(),
            inertial: Vec::new(),
            lever: Vec::new(),
            height: Vec::new(),
        };
        for sample in 0..time.len() {
            let [pose, speed, acceleration] = [0, 1, 2].map(|order| {
                paths
                    .iter()
                    .map(|path| path[order][sample])
                    .collect::<Vec<_>>()
            });
            let rows = dynamics.regressor(&pose, &zero, &zero);
            let moved = dynamics.efforts(&pose, &speed, &acceleration);
            let pairs = moved.iter().zip(&rows);
            let inertial = pairs.map(|(moved, row)| moved - dynamics.nominal(row));
            loads.inertial.push(inertial.collect());
            loads.rows.push(rows);
            let (height, lever) = (dynamics.mount_height(&pose)).unwrap_or((0.0, zero.clone()));
            loads.lever.push(lever);
            loads.height.push(height);
        }
        loads
    }
}

/// How the columns of a joint's droop are scaled.
struct Columns {
    /// Mean of the weight by the description.
    mean: f64,
    /// Root mean square of the effort of the motion.
    inertial: f64,
    /// Columns that act on the joint, and their root mean square.
    used: Vec<(usize, f64)>,
    /// Longest lever of the tip, m/rad or 1; zero where it is too short to tell.
    lever: f64,
    /// Lowest commanded height of the tip, m.
    lowest: f64,
}

impl Columns {
    fn of<'a>(
        dynamics: &Dynamics,
        body: usize,
        lowest: f64,
        sessions: &(impl Iterator<Item = &'a Loads> + Clone),
    ) -> Self {
        let rows = || {
            sessions
                .clone()
                .flat_map(|loads| &loads.rows)
                .map(|row| &row[body])
        };
        let count = rows().count().max(1) as f64;
        let mean = rows().map(|row| dynamics.nominal(row).abs()).sum::<f64>() / count;
        let width = PARAMETERS * dynamics.bodies().len();
        let used = (0..width).filter(|column| column % PARAMETERS < 4);
        let sized = used.map(|column| {
            let square = rows().map(|row| row[column] * row[column]).sum::<f64>() / count;
            (column, square.sqrt())
        });
        let moved: Vec<f64> = (sessions.clone())
            .flat_map(|loads| loads.inertial.iter().map(|row| row[body]))
            .collect();
        let levers = sessions
            .clone()
            .flat_map(|loads| loads.lever.iter().map(|row| row[body].abs()));
        let lever = levers.fold(0.0, f64::max);
        Self {
            lever: if lever > SHORTEST { lever } else { 0.0 },
            lowest,
            mean,
            inertial: rms(&moved),
            used: sized.filter(|(_, size)| *size > 1e-9).collect(),
        }
    }
}

/// A joint of a session as its model needs it.
fn joint(
    dynamics: &Dynamics,
    track: &Track,
    body: usize,
    (firsts, loads): (&[usize], &Loads),
    scale: &Columns,
) -> Joint {
    let run = |values: &[f64]| -> Vec<f64> {
        let ends = firsts.iter().skip(1).copied().chain([values.len()]);
        let mean = |(&first, end): (&usize, usize)| {
            values[first..end].iter().sum::<f64>() / (end - first) as f64
        };
        firsts.iter().zip(ends).map(mean).collect()
    };
    let (position, command) = (run(&track.position[body]), run(&track.command[body]));
    let pairs = position.iter().zip(&command);
    let offset =
        pairs.map(|(read, commanded)| read - commanded).sum::<f64>() / position.len().max(1) as f64;
    let rows = &loads.rows;
    let mut droop = DMatrix::zeros(rows.len(), 3 + scale.used.len());
    let usual = USUAL_COLUMN / (scale.used.len().max(1) as f64).sqrt();
    let mut weight = vec![0.0; rows.len()];
    for (sample, row) in rows.iter().enumerate() {
        let row = &row[body];
        // Over its mean; a joint without weight, or without masses in the description, has a constant one.
        let nominal = dynamics.nominal(row);
        let is_heavy = scale.mean > 1e-9;
        let nominal = if is_heavy { nominal / scale.mean } else { 0.0 };
        weight[sample] = if is_heavy { nominal.abs() } else { 1.0 };
        droop[(sample, 0)] = 1.0;
        droop[(sample, 1)] = nominal;
        if scale.inertial > 1e-9 {
            droop[(sample, 2)] = loads.inertial[sample][body] / scale.inertial;
        }
        for (place, &(column, size)) in scale.used.iter().enumerate() {
            droop[(sample, 3 + place)] = usual * row[column] / size;
        }
    }
    Joint {
        time: run(&track.time),
        command,
        position: position.iter().map(|read| read - offset).collect(),
        droop,
        weight,
        lever: loads
            .lever
            .iter()
            .map(|row| {
                if scale.lever > 0.0 {
                    row[body] / scale.lever.powi(2)
                } else {
                    0.0
                }
            })
            .collect(),
        height: loads.height.iter().map(|z| z - scale.lowest).collect(),
    }
}
