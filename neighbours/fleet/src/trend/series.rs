//! Series of a lake: estimates of the effects that are followed, and readings of sensors against those of the hall.

use std::collections::{BTreeMap, BTreeSet};

use arrow_array::Array;

use super::quantity::{Estimate, Quantity, days};
use super::{Point, joint};
use crate::lake::schema::{EVENTS, INFORMATION, SESSIONS, SIGNALS};
use crate::lake::{Lake, moments, numbers, texts};

/// Days over which the readings of the hall are compared.
const WEEK: f64 = 7.0;
/// Fewest machines with which a reading is compared.
const FEWEST_MACHINES: usize = 3;
/// Rounds of the median polish: what is left changes by less than it is uncertain.
const POLISHED: usize = 4;
/// Name before that of a sensor.
pub const SENSOR: &str = "sensor.";

/// One series.
#[derive(Debug, Clone)]
pub struct Series {
    /// Machine.
    pub machine: String,
    /// Its type.
    pub machine_type: String,
    /// What is followed.
    pub quantity: Quantity,
    /// Points by time.
    pub points: Vec<Point>,
}

/// Something that was done to a machine.
#[derive(Debug, Clone, PartialEq)]
pub struct Done {
    /// Days.
    pub time: f64,
    /// What kind.
    pub kind: String,
    /// What was done.
    pub text: String,
}

/// All series of a lake. Of a type of machine those effects are followed that the diagnosis has named in at least `sessions`
/// sessions of one machine of that type.
///
/// # Errors
/// The lake cannot be read.
pub fn series(lake: &Lake, sessions: usize) -> anyhow::Result<Vec<Series>> {
    let mut all: Vec<Series> = joint::estimates(lake, sessions)?
        .into_iter()
        .map(|((machine, machine_type, quantity), estimates)| Series {
            machine,
            machine_type,
            quantity,
            points: pooled(estimates),
        })
        .collect();
    all.extend(sensors(lake)?);
    Ok(all)
}

/// Sessions with a diagnosis and without normal equations, which an earlier version has added: series of effects have no points of them.
///
/// # Errors
/// The lake cannot be read.
pub fn without_equations(lake: &Lake) -> anyhow::Result<usize> {
    let mut known: BTreeSet<String> = BTreeSet::new();
    lake.scan(&INFORMATION, &["bag"], &mut |batch| {
        let keys = texts(batch, 0)?;
        for row in 0..batch.num_rows() {
            if !known.contains(keys.value(row)) {
                known.insert(keys.value(row).to_owned());
            }
        }
        Ok(())
    })?;
    let mut without = 0;
    lake.scan(&SESSIONS, &["bag", "verdict", "plan_id"], &mut |batch| {
        let (keys, verdicts, plans) = (texts(batch, 0)?, texts(batch, 1)?, texts(batch, 2)?);
        // A recording without touches has no equations in any version.
        without += (0..batch.num_rows())
            .filter(|row| !verdicts.is_null(*row) && !plans.is_null(*row))
            .filter(|row| !known.contains(keys.value(*row)))
            .count();
        Ok(())
    })?;
    Ok(without)
}

/// Points whose noise is that of all sessions of the series, weighted by their degrees of freedom: the residuals of one small
/// session tell it badly.
fn pooled(mut estimates: Vec<Estimate>) -> Vec<Point> {
    estimates.sort_by(|a, b| a.time.total_cmp(&b.time));
    let freedom: f64 = estimates.iter().map(|one| one.freedom).sum();
    let squares: f64 = estimates
        .iter()
        .map(|one| one.freedom * one.noise.powi(2))
        .sum();
    let noise = (squares / freedom.max(1.0)).sqrt();
    let point = |one: Estimate| {
        let factor = if one.noise > 0.0 {
            noise / one.noise
        } else {
            1.0
        };
        Point {
            time: one.time,
            value: one.value,
            uncertainty: one.uncertainty * factor,
        }
    };
    estimates.into_iter().map(point).collect()
}

/// Mean readings of a signal by week and machine.
type Weeks = BTreeMap<i64, BTreeMap<String, f64>>;

/// What the hall reads in each week in which enough machines read: the median over the machines, each less what it reads beyond the hall in
/// the median of its weeks (median polish, Tukey 1977). Without that a sensor that begins to read too much shifts the median by as much as
/// machines differ, for which it would make up in all others and in itself.
fn hall(weeks: &Weeks) -> BTreeMap<i64, f64> {
    let median = metrology::statistics::median;
    let mut offsets: BTreeMap<&str, f64> = BTreeMap::new();
    let mut hall = BTreeMap::new();
    for _ in 0..POLISHED {
        let own = |(machine, mean): (&String, &f64)| {
            mean - offsets.get(machine.as_str()).copied().unwrap_or(0.0)
        };
        hall = (weeks.iter())
            .filter(|(_, machines)| machines.len() >= FEWEST_MACHINES)
            .map(|(week, machines)| (*week, median(&machines.iter().map(own).collect::<Vec<_>>())))
            .collect();
        let mut beyond: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for (week, machines) in weeks {
            let Some(of_hall) = hall.get(week) else {
                continue;
            };
            for (machine, mean) in machines {
                beyond.entry(machine).or_default().push(mean - of_hall);
            }
        }
        offsets = beyond
            .into_iter()
            .map(|(machine, beyond)| (machine, median(&beyond)))
            .collect();
    }
    hall
}

/// Mean readings of each temperature sensor in each session, less what the hall reads in that week ([`hall`]).
fn sensors(lake: &Lake) -> anyhow::Result<Vec<Series>> {
    /// Of one session: sum of means, sections, time.
    type Session = (f64, f64, f64);
    let mut sessions: BTreeMap<(String, String, String), BTreeMap<String, Session>> =
        BTreeMap::new();
    let mut types: BTreeMap<String, String> = BTreeMap::new();
    let columns = [
        "bag",
        "machine",
        "machine_type",
        "time",
        "signal",
        "unit",
        "mean",
    ];
    lake.scan(&SIGNALS, &columns, &mut |batch| {
        let (keys, machines, kinds) = (texts(batch, 0)?, texts(batch, 1)?, texts(batch, 2)?);
        let (times, signals, units, means) = (
            moments(batch, 3)?,
            texts(batch, 4)?,
            texts(batch, 5)?,
            numbers(batch, 6)?,
        );
        for row in
            (0..batch.num_rows()).filter(|row| signals.value(*row).starts_with("temperature "))
        {
            let key = [signals, machines, units].map(|column| column.value(row).to_owned());
            types.insert(machines.value(row).to_owned(), kinds.value(row).to_owned());
            let of_bag = sessions.entry(key.into()).or_default();
            let session = of_bag.entry(keys.value(row).to_owned()).or_insert((
                0.0,
                0.0,
                days(times.value(row)),
            ));
            session.0 += means.value(row);
            session.1 += 1.0;
        }
        Ok(())
    })?;
    let mut weeks: BTreeMap<(String, i64), BTreeMap<String, Vec<f64>>> = BTreeMap::new();
    let week = |time: f64| (time / WEEK).floor() as i64;
    for ((signal, machine, _), of_bag) in &sessions {
        for (sum, count, time) in of_bag.values() {
            let of_week = weeks.entry((signal.clone(), week(*time))).or_default();
            of_week
                .entry(machine.clone())
                .or_default()
                .push(sum / count);
        }
    }
    let mut of_signals: BTreeMap<String, Weeks> = BTreeMap::new();
    for ((signal, week), machines) in weeks {
        let means = machines
            .into_iter()
            .map(|(machine, values)| (machine, metrology::statistics::mean(&values)));
        of_signals
            .entry(signal)
            .or_default()
            .insert(week, means.collect());
    }
    let halls: BTreeMap<String, BTreeMap<i64, f64>> = of_signals
        .into_iter()
        .map(|(signal, weeks)| (signal, hall(&weeks)))
        .collect();
    let mut found = Vec::new();
    for ((signal, machine, unit), of_bag) in sessions {
        let mut points: Vec<Point> = of_bag
            .values()
            .filter_map(|(sum, count, time)| {
                let hall = halls.get(&signal)?.get(&week(*time))?;
                Some(Point {
                    time: *time,
                    value: sum / count - hall,
                    uncertainty: 0.0,
                })
            })
            .collect();
        points.sort_by(|a, b| a.time.total_cmp(&b.time));
        // What the spread is measured against, where the readings tell no uncertainty: their own differences.
        let differences: Vec<f64> = points
            .windows(2)
            .map(|pair| pair[1].value - pair[0].value)
            .collect();
        let noise =
            metrology::statistics::robust_deviation(&differences, 0.0) / std::f64::consts::SQRT_2;
        for point in &mut points {
            point.uncertainty = noise;
        }
        found.push(Series {
            machine_type: types.get(&machine).cloned().unwrap_or_default(),
            machine,
            quantity: Quantity {
                effect: format!("{SENSOR}{signal}"),
                parameter: "mean".to_owned(),
                unit,
            },
            points,
        });
    }
    Ok(found)
}

/// What was done to each machine, by time.
///
/// # Errors
/// The lake cannot be read.
pub fn events(lake: &Lake) -> anyhow::Result<BTreeMap<String, Vec<Done>>> {
    let mut found: BTreeMap<String, Vec<Done>> = BTreeMap::new();
    lake.scan(
        &EVENTS,
        &["machine", "time", "kind", "text"],
        &mut |batch| {
            let (machines, times) = (texts(batch, 0)?, moments(batch, 1)?);
            let (kinds, words) = (texts(batch, 2)?, texts(batch, 3)?);
            for row in 0..batch.num_rows() {
                found
                    .entry(machines.value(row).to_owned())
                    .or_default()
                    .push(Done {
                        time: days(times.value(row)),
                        kind: kinds.value(row).to_owned(),
                        text: words.value(row).to_owned(),
                    });
            }
            Ok(())
        },
    )?;
    for events in found.values_mut() {
        events.sort_by(|a, b| a.time.total_cmp(&b.time));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nine machines that read up to 0.4 degrees apart, without noise; from the tenth week on two sensors of the lower end read 3 degrees
    /// too much. The median of readings would rise by 0.2 then; what the hall reads differs from the season by the same in all weeks.
    #[test]
    fn sensors_that_begin_to_lie_do_not_move_the_hall() {
        let season = |week: i64| 21.0 + 3.0 * (week as f64 / 8.0).sin();
        let reads = |week: i64| {
            let machine = |number: i32| {
                let lies = number < 2 && week >= 10;
                let beyond = 0.1 * f64::from(number - 4) + if lies { 3.0 } else { 0.0 };
                (number.to_string(), season(week) + beyond)
            };
            (week, (0..9).map(machine).collect())
        };
        let hall = hall(&(0..25).map(reads).collect());
        let beyond: Vec<f64> = hall.iter().map(|(week, own)| own - season(*week)).collect();
        assert_eq!(beyond.len(), 25);
        assert!(
            beyond.iter().all(|one| (one - beyond[0]).abs() < 1e-9),
            "{beyond:?}"
        );
    }
}
