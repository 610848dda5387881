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
/// and in neither way let it grow by more than this share.
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

    /// Parameters of each joint for some causes from all samples, and how far they shrink stretches that were left out.
    fn model(&self, causes: &[Cause], start: Option<&Model>) -> Option<Model> {
        let (mut parameters, mut replicates) = (Vec::new(), Vec::new());
        let (mut relative, mut squares, mut samples) = (0.0, 0.0, 0);
        for (number, axis) in self.axes.iter().enumerate() {
            let joints: Vec<&Joint> = axis.fitted.iter().collect();
            let known = start.map(|model| model.parameters[number].values.as_slice());
            let own = servo::fit(&joints, causes, known, &|_, _| true)?;
            let (parts, values) = Self::left_out(axis, causes, &own)?;
            let left: Vec<f64> = parts.into_iter().flat_map(|(_, _, left)| left).collect();
            replicates.push(values);
            relative += (rms(&left) / axis.gap).powi(2) / self.axes.len() as f64;
            squares += rms(&left).powi(2) * left.len() as f64;
            samples += left.len();
            parameters.push(own);
        }
        Some(Model {
            causes: causes.to_vec(),
            parameters,
            replicates,
            relative: relative.sqrt(),
            absolute: (squares / samples.max(1) as f64).sqrt(),
        })
    }

    /// Session, stretch and residuals of each stretch that a fit has left out; with several sessions a whole session at a time.
    fn left_out(axis: &Axis, causes: &[Cause], own: &Parameters) -> Option<(Parts, Vec<Vec<f64>>)> {
        let joints: Vec<&Joint> = axis.fitted.iter().collect();
        let fold =
            |session: usize, sample: usize| sample * FOLDS / axis.fitted[session].time.len().max(1);
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
                    let fold =
                        |place: usize| place * FOLDS / axis.fitted[session].time.len().max(1);
                    let firsts = &self.samples[session];
                    let places = (0..firsts.len()).filter(|&place| fold(place) == stretch);
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

    /// The model with one more cause, which closes most; a delay may be a dead time, a lag, or both.
    fn best_with(&self, current: &Model, offered: &[Vec<Cause>]) -> Option<Model> {
        let with = |more: &Vec<Cause>| {
            let causes: Vec<Cause> = current.causes.iter().chain(more).copied().collect();
            self.model(&causes, Some(current))
        };
        let mut models: Vec<Model> = offered.iter().filter_map(with).collect();
        let over = |model: &Model| model.over(current);
        models.retain(|model| model.is_better_than(current));
        models.sort_by(|a, b| over(a).total_cmp(&over(b)));
        // Of those with one name that are not told apart the simplest comes first.
        let added = |model: &Model| model.causes[current.causes.len()..].to_vec();
        let rank = |model: &Model| over(model) * (1.0 + CLOSE).powi(added(model).len() as i32);
        let best = self.identifier(&added(models.first()?));
        let alike = models
            .into_iter()
            .filter(|model| self.identifier(&added(model)) == best);
        alike.min_by(|a, b| rank(a).total_cmp(&rank(b)))
    }

    /// Names the causes.
    pub(super) fn named(&self) -> Option<Named> {
        let mut current = self.model(&[], None)?;
        let before = self.judged(&current)?;
        let (mut former, mut effects) = (before.clone(), Vec::new());
        let quiet = QUIET * self.floor();
        while size(&former) > quiet {
            // Accelerations, the masses of the links and a contact act only beside a droop.
            let beside =
                |cause: &Cause| matches!(cause, Cause::Inertia | Cause::Links | Cause::Contact);
            let single = CAUSES.iter().filter(|&cause| !beside(cause));
            let sets = single.map(|&cause| vec![cause]).chain([
                vec![Cause::Delay, Cause::Lag],
                vec![Cause::Droop, Cause::Inertia],
                vec![Cause::Droop, Cause::Links],
                vec![Cause::Droop, Cause::Contact],
                vec![Cause::Droop, Cause::Links, Cause::Contact],
            ]);
            let known: Vec<String> = (current.causes.iter())
                .map(|&cause| self.identifier(&[cause]))
                .collect();
            let offered: Vec<Vec<Cause>> = sets
                .filter(|set| !known.contains(&self.identifier(set)))
                .collect();
            let Some(more) = self.best_with(&current, &offered) else {
                break;
            };
            let added = more.causes[current.causes.len()..].to_vec();
            let after = self.judged(&more)?;
            // What makes another motion worse is no cause.
            if size(&after) > size(&former) {
                break;
            }
            let group = self.not_told(&current, &more, &added, &offered);
            let id = self.identifier(&added);
            effects.push(named_effect(
                &id,
                1.0,
                Vec::new(),
                group,
                (&former, &after),
                &self.tracks(),
                self.dynamics,
            ));
            (former, current) = (after, more);
        }
        // Parameters are those of the whole.
        let mut begun = 0;
        for effect in &mut effects {
            let causes = current.causes[begun..].iter();
            let own = causes.take_while(|&&cause| self.identifier(&[cause]) == effect.effect);
            let count = own.count();
            let own = current.causes[begun..begun + count].to_vec();
            effect.parameters = self.estimates(&current, &own);
            begun += count;
        }
        // What is named beside it is no rival of a cause.
        let named: Vec<String> = effects.iter().map(|effect| effect.effect.clone()).collect();
        for effect in &mut effects {
            effect
                .indistinguishable_from
                .retain(|other| !named.contains(other));
        }
        Some(Named {
            effects,
            remarks: self.contact(&current).into_iter().collect(),
            before,
            after: former,
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
            Cause::Friction => "drive.coulomb_friction".to_owned(),
            Cause::Scale => {
                let body = self.axes.first().map_or(0, |axis| axis.body);
                format!("axis.{}.scale", self.dynamics.bodies()[body].joint)
            }
        }
    }

    /// What left-out stretches do not tell from the cause that was added, and what is the same behind a proportional controller.
    fn not_told(
        &self,
        before: &Model,
        after: &Model,
        added: &[Cause],
        offered: &[Vec<Cause>],
    ) -> Vec<String> {
        let mut group = Vec::new();
        for other in offered {
            if self.identifier(other) == self.identifier(added) {
                continue;
            }
            let causes: Vec<Cause> = before.causes.iter().chain(other).copied().collect();
            let close = self
                .model(&causes, Some(before))
                .is_some_and(|model| model.over(after) < 1.0 + CLOSE);
            let other = self.identifier(other);
            if close && !group.contains(&other) {
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
                    "below_height" => "m",
                    "half_width" | "at_mean_weight" | "at_usual_acceleration" => length,
                    _ => "1",
                };
                if own.deviations[place] == 0.0 {
                    continue;
                }
                let scatter: Vec<f64> = replicates.iter().map(|values| values[place]).collect();
                let value = own.values[place]
                    + if name == "below_height" {
                        self.lowest
                    } else {
                        0.0
                    };
                let half = half_width(own.deviations[place], &scatter);
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
