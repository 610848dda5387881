//! Trends of machines, as `probecell fleet trends --keep` leaves them in a lake of all sessions: read again when they change.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use graph::Stamp;
use serde::Deserialize;

use crate::history::{Found, Summary};

/// Name of the file in the lake.
const FILE: &str = "trends.json";
/// What it is.
const SCHEMA: &str = "probecell/trends";
/// Half width of a 95 % interval over the standard uncertainty.
const NORMAL: f64 = 1.96;

/// A change of a parameter of an effect.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(crate) struct Finding {
    machine: String,
    quantity: String,
    pub(crate) unit: String,
    /// `step` or `drift`.
    pub(crate) kind: String,
    onset: f64,
    onset_between: [f64; 2],
    alarm: f64,
    /// Step (unit) or slope (unit per day), and its standard uncertainty.
    size: [f64; 2],
    /// Days until it leaves its limit: earliest, expected, latest; none where that is not within ten years.
    #[serde(default)]
    pub(crate) leaves_limit_in: Option<[Option<f64>; 3]>,
    /// The machines of its type have changed alike.
    pub(crate) common: bool,
    /// What was done to the machine then.
    pub(crate) coincides_with: Vec<String>,
}

impl Finding {
    /// Effect and parameter.
    pub(crate) fn of(&self) -> (String, String) {
        let (effect, parameter) = self.quantity.rsplit_once('.').unwrap_or(("", ""));
        (effect.to_owned(), parameter.to_owned())
    }

    /// As it is most probable, with its 95 % interval.
    pub(crate) fn onset(&self) -> [Stamp; 3] {
        [self.onset, self.onset_between[0], self.onset_between[1]].map(stamp)
    }

    /// From when on it was certain.
    pub(crate) fn alarm(&self) -> Stamp {
        stamp(self.alarm)
    }

    /// Size with its 95 % interval.
    pub(crate) fn size(&self) -> (f64, [f64; 2]) {
        let [size, uncertainty] = self.size;
        (size, interval(size, uncertainty))
    }
}

#[derive(Deserialize)]
struct Series {
    machine: String,
    effect: String,
    parameter: String,
    unit: String,
    /// Days since 1970, value, standard uncertainty.
    days: Vec<[f64; 3]>,
}

#[derive(Deserialize)]
struct Conclusions {
    findings: Vec<Finding>,
}

#[derive(Deserialize)]
struct Kept {
    schema: String,
    version: u32,
    conclusions: Conclusions,
    series: Vec<Series>,
}

/// What the lake tells of one machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Months {
    /// What has changed, by time.
    pub(crate) findings: Vec<Finding>,
    /// The parameters of each day, by time.
    pub(crate) days: Vec<Summary>,
}

/// Machines by name.
type Machines = BTreeMap<String, Months>;

/// The trends of a lake.
#[derive(Default)]
pub(crate) struct Trends {
    lake: Option<PathBuf>,
    read: Mutex<Option<(SystemTime, Arc<Machines>)>>,
}

impl Trends {
    pub(crate) fn new(lake: Option<PathBuf>) -> Self {
        Self {
            lake,
            read: Mutex::default(),
        }
    }

    /// Each machine; none where the lake holds no trends yet.
    ///
    /// # Errors
    /// A sentence: the trends cannot be read, or are of a later version.
    pub(crate) fn machines(&self) -> Result<Arc<Machines>, String> {
        let Some(path) = self.lake.as_ref().map(|lake| lake.join(FILE)) else {
            return Ok(Arc::default());
        };
        let Ok(written) = fs::metadata(&path).and_then(|file| file.modified()) else {
            return Ok(Arc::default());
        };
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, machines)) = read.as_ref().filter(|(at, _)| *at == written) {
            return Ok(Arc::clone(machines));
        }
        let name = path.display();
        let text = fs::read(&path).map_err(|error| format!("cannot read {name}: {error}"))?;
        let kept: Kept = serde_json::from_slice(&text)
            .map_err(|error| format!("{name} is not what `trends --keep` writes: {error}"))?;
        if (kept.schema.as_str(), kept.version) != (SCHEMA, 1) {
            return Err(format!(
                "{name} is of version {}; this program reads version 1",
                kept.version
            ));
        }
        let machines = Arc::new(by_machine(kept));
        *read = Some((written, Arc::clone(&machines)));
        Ok(machines)
    }
}

fn by_machine(kept: Kept) -> Machines {
    let mut days: BTreeMap<String, BTreeMap<Stamp, Summary>> = BTreeMap::new();
    for series in kept.series {
        let of_machine = days.entry(series.machine).or_default();
        for [time, value, uncertainty] in series.days {
            let begin = stamp(time.floor());
            let day = of_machine.entry(begin).or_default();
            day.begin = begin;
            let found = Found {
                value,
                ci95: interval(value, uncertainty),
                unit: series.unit.clone(),
                group: Vec::new(),
            };
            let of = (series.effect.clone(), series.parameter.clone());
            day.effects.insert(of, found);
        }
    }
    let mut machines = Machines::new();
    for (name, days) in days {
        machines.entry(name).or_default().days = days.into_values().collect();
    }
    for finding in kept.conclusions.findings {
        let months = machines.entry(finding.machine.clone()).or_default();
        months.findings.push(finding);
    }
    for months in machines.values_mut() {
        (months.findings).sort_by(|a, b| a.onset.total_cmp(&b.onset));
    }
    machines
}

fn interval(value: f64, uncertainty: f64) -> [f64; 2] {
    [value - NORMAL * uncertainty, value + NORMAL * uncertainty]
}

/// The instant of days since 1970.
fn stamp(days: f64) -> Stamp {
    Stamp((days * 86_400.0e9) as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_and_findings_are_those_of_the_file_and_follow_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let trends = Trends::new(Some(folder.path().to_owned()));
        assert!(trends.machines().expect("none yet").is_empty());
        let write = |text: &str| fs::write(folder.path().join(FILE), text).expect("a file");
        write(
            r#"{"schema": "probecell/trends", "version": 1, "conclusions": {"findings": [{
                "machine": "lathe", "quantity": "axis.X.scale.k", "unit": "m/m", "kind": "step", "onset": 20000.5,
                "onset_between": [19999.25, 20001.0], "alarm": 20005.0, "size": [15e-6, 1e-6], "leaves_limit_in": [3.0, 9.5, null],
                "common": false, "coincides_with": ["service: new probe"]}]},
              "series": [{"machine": "lathe", "effect": "axis.X.scale", "parameter": "k", "unit": "m/m",
                "days": [[20000.5, 1e-6, 1e-7], [20001.25, 16e-6, 2e-7]]}]}"#,
        );
        let machines = trends.machines().expect("trends");
        let lathe = &machines["lathe"];
        let of = ("axis.X.scale".to_owned(), "k".to_owned());
        let values: Vec<(i64, f64)> = (lathe.days.iter())
            .map(|day| (day.begin.0, day.effects[&of].value))
            .collect();
        let day = |number: i64| number * 86_400_000_000_000;
        assert_eq!(values, [(day(20_000), 1e-6), (day(20_001), 16e-6)]);
        let found = &lathe.findings[0];
        assert_eq!(found.of(), of);
        assert_eq!(found.onset()[0].0, day(20_000) + day(1) / 2);
        assert_eq!(found.leaves_limit_in, Some([Some(3.0), Some(9.5), None]));

        write("{}");
        let later = SystemTime::now() + std::time::Duration::from_secs(5);
        let file = fs::File::options()
            .append(true)
            .open(folder.path().join(FILE));
        (file.expect("a file").set_modified(later)).expect("a time");
        let error = trends.machines().expect_err("no trends");
        assert!(
            error.contains("trends.json is not what `trends --keep` writes"),
            "{error}"
        );
    }
}
