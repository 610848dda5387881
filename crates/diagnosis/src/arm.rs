//! The diagnosis of an arm in motion, with the dynamics of its whole tree.
//!
//! Two channels. Where commands are recorded the joints are compared with them ([`motion`]), elsewhere the efforts with the inverse
//! dynamics of the robot description ([`effort`]). Fitted on some motions, judged on others, or on stretches of time that were left
//! out. rad, m, s, N m.

mod contact;
mod effort;
mod left;
mod motion;
mod servo;
mod track;

use effects::session::{Session, SessionError};
use machine::{Chain, Dynamics, JointKind, Side};

use crate::report::residuals::{DriveResiduals, Residuals, axis_of};
use crate::report::{Gap, Level, Place, Rejected, Report, SCHEMA, Unexplained, Verdict};
use contact::Contact;
use effort::Efforts;
use left::{Left, Named, pairs, size};
use motion::Motions;
use track::Track;

/// Stretches of time that are left out in turn.
const STRETCHES: usize = 10;
/// A gap below this many times the noise is none.
const QUIET: f64 = 1.4;
/// The gap is explained where no more than this many times the noise is left.
const EXPLAINED: f64 = 2.0;
/// Mass of every link of a description that has placeholders for masses, kg.
pub(crate) const UNIT_MASS: f64 = 1.0;

/// True for a machine whose axes carry one another's turning: its efforts need the dynamics of the whole tree.
pub(crate) fn is_arm(chain: &Chain) -> bool {
    [Side::Part, Side::Tool].into_iter().any(|side| {
        let turning = |&&index: &&usize| chain.joints()[index].kind == JointKind::Revolute;
        chain.branch(side).iter().filter(turning).count() > 1
    })
}

/// Explains why an arm moves, or takes efforts, other than described; `None` where it has nothing to compare.
///
/// # Errors
/// [`SessionError`] names what makes a session unusable.
pub(crate) fn diagnose(
    fit: &[Session],
    withheld: &[Session],
    chain: &Chain,
) -> Result<Option<(Report, Residuals)>, SessionError> {
    let Some(first) = fit.first() else {
        return Ok(None);
    };
    let moving = |name: &str| chain.axis_index(name).is_some();
    let (joints, held) = track::joints(first, moving);
    let dynamics = Dynamics::from_urdf(&first.robot_description, &joints, &held)?;
    if dynamics.bodies().is_empty() {
        return Ok(None);
    }
    let read = |smooth: bool| -> Option<(Vec<Track>, Vec<Track>)> {
        let one = |session: &Session| Track::read(session, &dynamics, smooth);
        let all = |sessions: &[Session]| sessions.iter().map(one).collect::<Option<_>>();
        Some((all(fit)?, all(withheld)?))
    };
    let Some((fitted, judging)) = read(false) else {
        // Sessions without motion are others' to judge; beside one in motion they are a mistake.
        let is_short = |session: &&Session| Track::read(session, &dynamics, false).is_none();
        let short: Vec<&Session> = fit.iter().chain(withheld).filter(is_short).collect();
        return match short.first() {
            Some(session) if short.len() < fit.len() + withheld.len() => {
                Err(SessionError::Short(session.name.clone(), track::FEWEST))
            }
            _ => Ok(None),
        };
    };
    let turns = (dynamics.bodies().iter()).all(|body| body.kind == JointKind::Revolute);
    let commanded = fitted.iter().chain(&judging).all(Track::is_commanded);
    if commanded && let Some(motions) = Motions::new(&dynamics, &fitted, &judging) {
        let outcome = motions.named().map(|named| Outcome {
            channel: "motion",
            unit: if turns { "rad" } else { "m or rad" },
            floor: motions.floor(),
            samples: motions.samples(),
            tracks: motions.tracks(),
            contacts: &[],
            named,
        });
        return Ok(outcome.map(|outcome| outcome.report((fit, withheld), &dynamics)));
    }
    let all_of = |mass: f64| (dynamics.bodies().iter()).all(|body| body.parameters[0] == mass);
    if all_of(UNIT_MASS) || all_of(0.0) {
        return Ok(None);
    }
    let Some((fitted, judging)) = read(true) else {
        return Ok(None);
    };
    let unit = if turns { "N m" } else { "N or N m" };
    let Some(efforts) = Efforts::new(&dynamics, &fitted, &judging, unit) else {
        return Ok(None);
    };
    if let Some(session) = efforts.still() {
        return Err(SessionError::Still(session.to_owned()));
    }
    if let Some(joint) = efforts.magnitude() {
        return Err(SessionError::Magnitude(joint.to_owned()));
    }
    let outcome = efforts.named().map(|named| Outcome {
        channel: "effort",
        unit,
        floor: efforts.floor(),
        samples: efforts.samples(),
        tracks: efforts.tracks(),
        contacts: efforts.contacts(),
        named,
    });
    Ok(outcome.map(|outcome| outcome.report((fit, withheld), &dynamics)))
}

/// What was found in one channel.
struct Outcome<'a> {
    channel: &'static str,
    unit: &'a str,
    floor: f64,
    samples: usize,
    tracks: Vec<&'a Track>,
    contacts: &'a [Contact],
    named: Named,
}

impl Outcome<'_> {
    fn report(
        self,
        (fit, withheld): (&[Session], &[Session]),
        dynamics: &Dynamics,
    ) -> (Report, Residuals) {
        let names = |sessions: &[Session]| sessions.iter().map(|one| one.name.clone()).collect();
        let residuals = self.residuals(dynamics);
        let (touched, touches) = self.touches(dynamics);
        let Named {
            effects,
            remarks,
            before,
            after,
        } = self.named;
        let (gap, left) = (size(&before), size(&after));
        let is_quiet = gap <= QUIET * self.floor;
        let effects = if is_quiet { Vec::new() } else { effects };
        let is_alone = touched.is_empty();
        let verdict = match (is_quiet && is_alone, effects.is_empty()) {
            (true, _) => Verdict::NoGap,
            (false, true) => Verdict::Unexplained,
            (false, false) if is_alone && left <= EXPLAINED * self.floor => Verdict::Explained,
            (false, false) => Verdict::PartlyExplained,
        };
        let place = |all: &[Left]| -> Vec<Place> {
            let energy = |joint: usize| -> f64 {
                let own = all.iter().filter(|one| one.joint == joint);
                own.map(Left::energy).sum()
            };
            let total: f64 = (0..dynamics.bodies().len()).map(energy).sum();
            let of = |(joint, body): (usize, &machine::Body)| Place {
                dimension: "axis".to_owned(),
                key: body.joint.clone(),
                from: None,
                to: None,
                share: energy(joint) / total.max(f64::MIN_POSITIVE),
            };
            dynamics.bodies().iter().enumerate().map(of).collect()
        };
        let is_open = matches!(verdict, Verdict::Unexplained | Verdict::PartlyExplained);
        let report = Report {
            schema: SCHEMA.to_owned(),
            bag: fit[0].name.clone(),
            fitted: names(fit),
            withheld: names(withheld),
            measured: fit[0].measured(),
            mount: dynamics.mount_link().map(str::to_owned),
            machine: None,
            samples: self.samples,
            verdict,
            level: Level::default(),
            channel: self.channel.to_owned(),
            gap: Gap {
                unit: self.unit.to_owned(),
                rms: gap,
                noise_floor: self.floor,
                ratio: gap / self.floor.max(f64::MIN_POSITIVE),
            },
            noise: Vec::new(),
            place: place(&before),
            declared: Vec::new(),
            effects,
            unexplained: Unexplained {
                rms: if is_open {
                    (left * left - self.floor * self.floor).max(0.0).sqrt()
                } else {
                    0.0
                },
                place: if is_open {
                    place(&after).into_iter().chain(touched).collect()
                } else {
                    Vec::new()
                },
                ladder: Vec::new(),
            },
            rejected: Vec::<Rejected>::new(),
            next_measurement: Vec::new(),
            durations: None,
            measurements: None,
            warnings: std::iter::once(format!("judged by {}", self.channel))
                .chain(touches)
                .chain(remarks)
                .collect(),
        };
        (report.finished(), Residuals::Drives(residuals))
    }

    /// Contacts as places in time, and a sentence for each.
    fn touches(&self, dynamics: &Dynamics) -> (Vec<Place>, Vec<String>) {
        let session = |one: &Contact| self.tracks[one.session].session.clone();
        let place = |one: &Contact| Place {
            dimension: "time".to_owned(),
            key: session(one),
            from: Some(one.from),
            to: Some(one.to),
            share: one.share,
        };
        let sentence = |one: &Contact| {
            let felt = one
                .joints
                .iter()
                .map(|&(joint, mean)| format!("{} {mean:.1}", dynamics.bodies()[joint].joint));
            format!(
                "something outside presses on the arm from {:.2} to {:.2} s of {} (mean effort in {}: {}); the causes are fitted without it",
                one.from,
                one.to,
                session(one),
                self.unit,
                felt.collect::<Vec<_>>().join(", ")
            )
        };
        let contacts = || self.contacts.iter();
        (
            contacts().map(place).collect(),
            contacts().map(sentence).collect(),
        )
    }

    /// What is left of every judging sample, joint by joint.
    fn residuals(&self, dynamics: &Dynamics) -> Vec<DriveResiduals> {
        let of = |(session, joint): (usize, usize)| {
            let track = self.tracks[session];
            let of = |all: &[Left]| -> (Vec<usize>, Vec<f64>) {
                let own = all.iter().filter(|one| one.of() == (session, joint));
                let mut values: Vec<(usize, f64)> = own
                    .flat_map(|one| {
                        one.samples
                            .iter()
                            .copied()
                            .zip(one.residuals.iter().copied())
                    })
                    .collect();
                values.sort_by_key(|one| one.0);
                values.into_iter().unzip()
            };
            let ((samples, before), (_, after)) = (of(&self.named.before), of(&self.named.after));
            let pick =
                |values: &[f64]| -> Vec<f64> { samples.iter().map(|&at| values[at]).collect() };
            let body = &dynamics.bodies()[joint];
            let position = pick(&track.position[joint]);
            DriveResiduals {
                session: track.session.clone(),
                axis: axis_of(&body.joint, body.kind),
                unit: self.unit.to_owned(),
                time: pick(&track.time),
                speed: pick(&track.speed[joint]),
                measured: if self.channel == "effort" {
                    pick(&track.effort[joint])
                } else {
                    let command = pick(&track.command[joint]);
                    let pairs = position.iter().zip(command);
                    pairs.map(|(read, commanded)| read - commanded).collect()
                },
                position,
                before,
                after,
            }
        };
        pairs(&self.named.before).into_iter().map(of).collect()
    }
}
