//! `trend(time, value, standard_uncertainty [, sessions])`.

use std::sync::{Arc, LazyLock};

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, TimestampMicrosecondType};
use arrow_array::{Array, ArrayRef};
use arrow_schema::{DataType, Field, FieldRef, Fields};
use datafusion::common::cast::{as_float64_array, as_list_array};
use datafusion::common::{Result, ScalarValue, exec_err};
use datafusion::logical_expr::function::{AccumulatorArgs, StateFieldsArgs};
use datafusion::logical_expr::{
    Accumulator, AggregateUDFImpl, Signature, TypeSignature, Volatility,
};
use serde::Serialize;

use super::failed;
use crate::answer::{column, instant, list, structure};
use crate::trend::onset::refined;
use crate::trend::watch::Kind;
use crate::trend::{Change, Point, Watch, spread};

/// µs of a day.
const DAY: f64 = 86_400e6;
/// Sessions to a false alarm in the mean, unless given.
const SESSIONS: f64 = 1000.0;

/// What the function answers.
static FIELDS: LazyLock<Fields> = LazyLock::new(|| {
    let change = structure([
        ("kind", DataType::Utf8),
        ("onset", instant()),
        ("onset_lower", instant()),
        ("onset_upper", instant()),
        ("alarm", instant()),
        ("size", DataType::Float64),
        ("size_uncertainty", DataType::Float64),
        ("before", DataType::Float64),
        ("log_statistic", DataType::Float64),
    ]);
    structure([
        ("points", DataType::Int64),
        ("repeatability", DataType::Float64),
        ("level", DataType::Float64),
        ("level_uncertainty", DataType::Float64),
        ("slope_per_day", DataType::Float64),
        ("slope_uncertainty", DataType::Float64),
        ("changes", list(DataType::Struct(change))),
    ])
});

#[derive(Default, Serialize)]
struct Conclusion {
    points: usize,
    repeatability: f64,
    level: f64,
    level_uncertainty: f64,
    slope_per_day: f64,
    slope_uncertainty: f64,
    changes: Vec<Told>,
}

#[derive(Serialize)]
struct Told {
    kind: &'static str,
    onset: i64,
    onset_lower: i64,
    onset_upper: i64,
    alarm: i64,
    /// Step, or slope per day.
    size: f64,
    size_uncertainty: f64,
    before: f64,
    log_statistic: f64,
}

/// The watch of the series of a group.
#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct Trend {
    signature: Signature,
}

impl Trend {
    pub(super) fn new() -> Self {
        let number = DataType::Float64;
        let three = vec![instant(), number.clone(), number.clone()];
        let mut four = three.clone();
        four.push(number);
        let ways = vec![TypeSignature::Exact(three), TypeSignature::Exact(four)];
        Self {
            signature: Signature::one_of(ways, Volatility::Immutable),
        }
    }
}

impl AggregateUDFImpl for Trend {
    fn name(&self) -> &'static str {
        "trend"
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, _: &[DataType]) -> Result<DataType> {
        Ok(DataType::Struct(FIELDS.clone()))
    }

    fn accumulator(&self, _: AccumulatorArgs<'_>) -> Result<Box<dyn Accumulator>> {
        Ok(Box::new(Series::default()))
    }

    fn state_fields(&self, args: StateFieldsArgs<'_>) -> Result<Vec<FieldRef>> {
        let field =
            |name: &str, kind| Arc::new(Field::new(format!("{}[{name}]", args.name), kind, true));
        Ok(vec![
            field("points", list(DataType::Float64)),
            field("sessions", DataType::Float64),
        ])
    }
}

/// Points of a group.
#[derive(Debug, Default)]
struct Series {
    /// Instant (µs since 1970, which is exact), value, standard uncertainty.
    points: Vec<[f64; 3]>,
    sessions: Option<f64>,
}

impl Series {
    fn push(&mut self, time: f64, value: f64, uncertainty: f64) -> Result<()> {
        if uncertainty < 0.0 || !uncertainty.is_finite() {
            return exec_err!(
                "trend: a standard uncertainty is {uncertainty}, must be at least 0 and finite"
            );
        }
        if value.is_finite() {
            self.points.push([time, value, uncertainty]);
        }
        Ok(())
    }

    fn limit(&mut self, sessions: f64) -> Result<()> {
        if !(sessions >= 1.0 && sessions.is_finite()) {
            return exec_err!(
                "trend: the sessions to a false alarm are {sessions}, must be at least 1"
            );
        }
        if self.sessions.is_some_and(|known| known != sessions) {
            return exec_err!("trend: the sessions to a false alarm differ within a group");
        }
        self.sessions = Some(sessions);
        Ok(())
    }
}

impl Accumulator for Series {
    fn update_batch(&mut self, values: &[ArrayRef]) -> Result<()> {
        let times = values[0].as_primitive::<TimestampMicrosecondType>();
        let numbers = as_float64_array(&values[1])?;
        let uncertainties = as_float64_array(&values[2])?;
        for row in 0..times.len() {
            let missing = times.is_null(row) || numbers.is_null(row) || uncertainties.is_null(row);
            if !missing {
                self.push(
                    times.value(row) as f64,
                    numbers.value(row),
                    uncertainties.value(row),
                )?;
            }
        }
        if let Some(sessions) = values.get(3) {
            for sessions in as_float64_array(sessions)?.iter().flatten() {
                self.limit(sessions)?;
            }
        }
        Ok(())
    }

    fn merge_batch(&mut self, states: &[ArrayRef]) -> Result<()> {
        for points in as_list_array(&states[0])?.iter().flatten() {
            let numbers = points.as_primitive::<Float64Type>().values();
            for point in numbers.chunks_exact(3) {
                self.push(point[0], point[1], point[2])?;
            }
        }
        for sessions in as_float64_array(&states[1])?.iter().flatten() {
            self.limit(sessions)?;
        }
        Ok(())
    }

    fn state(&mut self) -> Result<Vec<ScalarValue>> {
        let numbers = self.points.as_flattened().iter();
        let numbers: Vec<ScalarValue> = numbers.map(|number| (*number).into()).collect();
        Ok(vec![
            ScalarValue::List(ScalarValue::new_list_nullable(&numbers, &DataType::Float64)),
            ScalarValue::Float64(self.sessions),
        ])
    }

    fn evaluate(&mut self) -> Result<ScalarValue> {
        // The order of the rows is no part of the question.
        self.points.sort_by(|a, b| {
            let by = |place: usize| a[place].total_cmp(&b[place]);
            by(0).then(by(1)).then(by(2))
        });
        let told = concluded(&self.points, self.sessions.unwrap_or(SESSIONS));
        let one = column(&FIELDS, vec![told]).map_err(|error| failed(&error))?;
        Ok(ScalarValue::Struct(Arc::new(one)))
    }

    fn size(&self) -> usize {
        size_of_val(self) + size_of_val(self.points.as_slice())
    }
}

/// What is to be said of points by time; nothing where there is none.
fn concluded(points: &[[f64; 3]], sessions: f64) -> Option<Conclusion> {
    let series: Vec<Point> = points
        .iter()
        .map(|[time, value, uncertainty]| Point {
            time: time / DAY,
            value: *value,
            uncertainty: *uncertainty,
        })
        .collect();
    let spread = spread(&[&series]);
    let mut watch = Watch::new(spread, sessions);
    let changes: Vec<Change> = series
        .iter()
        .filter_map(|point| watch.push(point))
        .collect();
    let now = *watch.level()?;
    let refined = refined(&series, &spread, &changes);
    let level = refined.last().map_or(now, |change| change.after);
    let time = |point: usize| points[point][0] as i64;
    let told = |change: Change| Told {
        kind: match change.kind {
            Kind::Step => "step",
            Kind::Drift => "drift",
        },
        onset: time(change.onset),
        onset_lower: time(change.between[0].saturating_sub(1)),
        onset_upper: time(change.between[1]),
        alarm: time(change.alarm),
        size: change.size[0],
        size_uncertainty: change.size[1],
        before: change.before,
        log_statistic: change.log_statistic,
    };
    Some(Conclusion {
        points: points.len(),
        repeatability: spread.repeatability.sqrt(),
        level: level.level,
        level_uncertainty: level.covariance[0].max(0.0).sqrt(),
        slope_per_day: level.slope,
        slope_uncertainty: level.covariance[2].max(0.0).sqrt(),
        changes: refined.into_iter().map(told).collect(),
    })
}
