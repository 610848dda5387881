//! A year of a hall, made from a seed: machines that check themselves on an artefact of balls, with histories that are known.
//!
//! The plant shares no code with the effects: it moves the ball by the errors of its axes and solves each contact on the true
//! sphere ([`plant`]). Recordings are written by the recorder of the cells and read like any other. [`judge`] compares what
//! the trends tell with what was planted, and with Shewhart and EWMA charts on the same series.

pub mod charts;
pub mod judge;
mod plant;
mod record;

use std::path::Path;

use anyhow::Context;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use crate::lake::Event;
use plant::Errors;

/// First day: 2025-01-01.
pub const FIRST_DAY: f64 = 20_089.0;
/// Days of the year.
const DAYS: f64 = 365.0;
/// Types of machines.
const TYPES: usize = 4;
/// The type that gets a fault, and its day.
const FAULTY_TYPE: (usize, f64) = (2, 180.0);
/// The type that drifts as a whole, by little, and the day from which.
const DRIFTING_TYPE: (usize, f64) = (0, 120.0);
/// Machines of a large hall.
const LARGE: usize = 24;

/// Size of the year.
#[derive(Debug, Clone, Copy)]
pub struct Size {
    /// Machines.
    pub machines: usize,
    /// Sessions of each.
    pub sessions: usize,
    /// Seed of everything.
    pub seed: u64,
}

/// What was planted.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Planted {
    /// Machine.
    pub machine: String,
    /// `effect.parameter`; of a sensor the name of its series.
    pub quantity: String,
    /// `step` or `drift`.
    pub kind: String,
    /// Days since 1970.
    pub onset: f64,
    /// Step in the unit of the quantity, or slope per day.
    pub size: f64,
    /// What of it is the machine's own: all of it, unless the type has the rest in common.
    pub own_size: f64,
    /// True: all machines of its type have it.
    pub common: bool,
    /// True: at a service that is on record.
    pub at_service: bool,
}

/// One machine: its own errors, and what happens to it.
struct Machine {
    name: String,
    kind: usize,
    errors: Errors,
    warmth: f64,
    planted: Vec<Planted>,
    services: Vec<f64>,
}

impl Machine {
    fn new(number: usize, machines: usize, random: &mut Pcg64Mcg) -> Self {
        let kind = number % TYPES;
        let name = format!("mill_{number:03}");
        let mut normal = |size: f64| size * random.sample::<f64, _>(StandardNormal);
        let errors = Errors {
            scale: [normal(4e-6), normal(4e-6), normal(4e-6)],
            radius: normal(1e-6),
            shift: [0.0; 3],
        };
        let (warmth, own) = (normal(0.5), normal(2e-6));
        let mut services: Vec<f64> = (0..3)
            .map(|_| FIRST_DAY + random.random_range(20.0..DAYS - 10.0))
            .collect();
        let day = FIRST_DAY + random.random_range(100.0..220.0_f64);
        let mut planted = Vec::new();
        let mut plant = |quantity: &str,
                         kind: &str,
                         onset: f64,
                         [common_size, own_size]: [f64; 2],
                         at_service: bool| {
            planted.push(Planted {
                machine: name.clone(),
                quantity: quantity.to_owned(),
                kind: kind.to_owned(),
                onset,
                size: common_size + own_size,
                own_size,
                common: common_size != 0.0,
                at_service,
            });
        };
        match number % 10 {
            3 => plant("axis.X.scale.k", "drift", day, [0.0, 1.5e-7], false),
            5 => plant(
                "sensor.temperature part.mean",
                "step",
                day,
                [0.0, 3.0],
                false,
            ),
            7 => {
                plant("probe.ball_radius.dr", "step", day, [0.0, 2e-6], true);
                services.push(day);
            }
            _ => {}
        }
        if kind == FAULTY_TYPE.0 {
            let day = FIRST_DAY + FAULTY_TYPE.1;
            plant("axis.Z.scale.k", "step", day, [1.5e-5, own], false);
        }
        // Of a large hall only: no machine of a small one shows it within a year.
        if kind == DRIFTING_TYPE.0 && machines >= LARGE {
            let day = FIRST_DAY + DRIFTING_TYPE.1;
            plant("axis.Y.scale.k", "drift", day, [1e-8, 0.0], false);
        }
        Self {
            name,
            kind,
            errors,
            warmth,
            planted,
            services,
        }
    }

    /// Its errors at a time, without what varies from session to session.
    fn at(&self, time: f64) -> (Errors, f64) {
        let (mut errors, mut sensor) = (self.errors.clone(), 0.0);
        for planted in self.planted.iter().filter(|planted| planted.onset <= time) {
            let size = if planted.kind == "drift" {
                planted.size * (time - planted.onset)
            } else {
                planted.size
            };
            match planted.quantity.as_str() {
                "axis.X.scale.k" => errors.scale[0] += size,
                "axis.Y.scale.k" => errors.scale[1] += size,
                "axis.Z.scale.k" => errors.scale[2] += size,
                "probe.ball_radius.dr" => errors.radius += size,
                _ => sensor += size,
            }
        }
        (errors, sensor)
    }
}

/// Writes the recordings of a year below `folder`, which must not exist, and gives what was planted and what is on record.
///
/// # Errors
/// A recording cannot be written.
pub fn make(folder: &Path, size: Size) -> anyhow::Result<(Vec<Planted>, Vec<Event>)> {
    std::fs::create_dir(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let mut random = Pcg64Mcg::seed_from_u64(size.seed);
    let machines: Vec<Machine> = (0..size.machines)
        .map(|number| Machine::new(number, size.machines, &mut random))
        .collect();
    let numbers: Vec<usize> = (0..size.machines).collect();
    let written = crate::parallel::map(&numbers, |number| {
        sessions(folder, size, *number, &machines[*number])
    });
    written.into_iter().collect::<anyhow::Result<Vec<()>>>()?;
    let events = machines.iter().flat_map(|machine| {
        machine.services.iter().map(|day| Event {
            machine: machine.name.clone(),
            time: (day * 86_400e6) as i64,
            kind: "service".to_owned(),
            text: "probe and axes checked".to_owned(),
        })
    });
    let events = events.collect();
    Ok((
        machines
            .into_iter()
            .flat_map(|machine| machine.planted)
            .collect(),
        events,
    ))
}

/// Writes the sessions of a machine.
fn sessions(folder: &Path, size: Size, number: usize, machine: &Machine) -> anyhow::Result<()> {
    let mut random = Pcg64Mcg::seed_from_u64(
        size.seed ^ (number as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15),
    );
    for session in 0..size.sessions {
        let part = (session as f64 + random.random_range(0.0..1.0_f64)) / size.sessions as f64;
        let time = FIRST_DAY + DAYS * part;
        let path = folder.join(format!("{}_{session:04}", machine.name));
        one(machine, time, &path, &mut random)?;
    }
    Ok(())
}

fn one(machine: &Machine, time: f64, path: &Path, random: &mut Pcg64Mcg) -> anyhow::Result<()> {
    let (mut errors, sensor) = machine.at(time);
    let mut normal = |size: f64| size * random.sample::<f64, _>(StandardNormal);
    errors.shift = [normal(3e-7), normal(3e-7), normal(3e-7)];
    let season = 3.0 * (std::f64::consts::TAU * (time - FIRST_DAY) / DAYS).sin();
    let temperature = 21.0 + season + machine.warmth + sensor + normal(0.3);
    let noise: Vec<f64> = (0..plant::TOUCHES).map(|_| normal(5e-7)).collect();
    record::write(
        path,
        &machine.name,
        machine.kind,
        time,
        &plant::touches(&errors, &noise),
        temperature,
    )
}
