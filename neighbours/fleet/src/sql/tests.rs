//! Views and functions on rows whose answers are known.

use std::collections::BTreeMap;

use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use datafusion::common::ScalarValue;
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::lake::rows::{Row, Value, batch};
use crate::lake::schema::{CORRECTIONS, EFFECTS, FEATURES, PROMISES, SESSIONS, Table, columns};
use crate::trend::onset::refined;
use crate::trend::{Point, Watch, spread};

/// A row of a table with these columns; the others are null.
fn row(table: &Table, values: &[(&str, Value)]) -> Row {
    let values: BTreeMap<&str, &Value> =
        values.iter().map(|(name, value)| (*name, value)).collect();
    let known: Vec<&str> = columns(table).map(|column| column.name).collect();
    assert!(values.keys().all(|name| known.contains(name)), "{values:?}");
    let value = |name: &&str| {
        values
            .get(name)
            .map_or(Value::Null, |value| (*value).clone())
    };
    known.iter().map(value).collect()
}

/// An engine whose tables hold these rows, all of March 2026.
fn engine(tables: &[(&Table, Vec<Row>)]) -> Engine {
    let engine = Engine::begin().expect("an engine");
    for table in TABLES {
        let rows = tables
            .iter()
            .find(|(own, _)| own.name == table.name)
            .map_or(&[][..], |(_, rows)| rows);
        let rows = batch(table, rows).expect("rows");
        let frame = engine.context.read_batch(rows).expect("a table");
        let month = datafusion::prelude::lit("2026-03");
        let frame = frame.with_column(MONTH, month).expect("a column");
        engine
            .context
            .register_table(table.name, frame.into_view())
            .expect("a table");
    }
    engine.with_views().expect("views")
}

/// The only batch of an answer.
fn one(engine: &Engine, statement: &str) -> RecordBatch {
    let answer = engine.ask(statement).expect("an answer");
    let schema = answer.schema();
    let batches: Vec<RecordBatch> = answer.map(|batch| batch.expect("rows")).collect();
    arrow_select::concat::concat_batches(&schema, &batches).expect("rows")
}

fn number(batch: &RecordBatch, name: &str, row: usize) -> f64 {
    let column = batch.column_by_name(name).expect("a column");
    match column.data_type() {
        DataType::Int64 => column.as_primitive::<Int64Type>().value(row) as f64,
        DataType::UInt64 => match ScalarValue::try_from_array(column, row).expect("a value") {
            ScalarValue::UInt64(Some(value)) => value as f64,
            other => panic!("{name} is {other}"),
        },
        _ => column.as_primitive::<Float64Type>().value(row),
    }
}

fn near(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-12 * expected.abs(),
        "{found} is not {expected}"
    );
}

/// Deviations 1, 2, 3, 4, 5 µm within ± 10 µm: mean 3 µm, s² = 2.5 µm², so Pp = 20 / (6 √2.5) and Ppk = 7 / (3 √2.5).
#[test]
fn capability_is_that_of_the_last_measurement_of_each_part() {
    let mut rows = Vec::new();
    for part in 1..=5_i64 {
        let mut measured = |time: i64, deviation: f64, decision: &str, reference: bool| {
            rows.push(row(
                &FEATURES,
                &[
                    ("bag", "bag".into()),
                    ("machine", "mill".into()),
                    ("machine_type", "kind".into()),
                    ("time", Value::Moment(part * 1_000_000 + time)),
                    ("part_id", format!("part_{part}").into()),
                    ("feature_id", "bore".into()),
                    ("decision", decision.into()),
                    ("by_reference", reference.into()),
                    ("size_deviation", deviation.into()),
                    ("lower_tolerance", (-10e-6).into()),
                    ("upper_tolerance", 10e-6.into()),
                ],
            ));
        };
        measured(1, 80e-6, "does_not_conform", false);
        measured(2, part as f64 * 1e-6, "conforms", false);
        measured(3, 50e-6, "invalid", false);
        measured(4, 40e-6, "conforms", true);
    }
    let engine = engine(&[(&FEATURES, rows)]);
    let found = one(&engine, "SELECT * FROM capability");
    assert_eq!(found.num_rows(), 1);
    near(number(&found, "parts", 0), 5.0);
    near(number(&found, "not_conforming", 0), 0.0);
    near(number(&found, "mean_deviation", 0), 3e-6);
    near(
        number(&found, "standard_deviation", 0),
        2.5_f64.sqrt() * 1e-6,
    );
    near(number(&found, "pp", 0), 20.0 / (6.0 * 2.5_f64.sqrt()));
    near(number(&found, "ppk", 0), 7.0 / (3.0 * 2.5_f64.sqrt()));
}

#[test]
fn causes_are_counted_by_session_and_ranked_by_machine_type() {
    let (mut sessions, mut effects) = (Vec::new(), Vec::new());
    for number in 0..4_i64 {
        let bag = format!("bag_{number}");
        let keys = |time: i64| {
            vec![
                ("bag", bag.as_str().into()),
                ("machine", format!("mill_{}", number % 2).into()),
                ("machine_type", "kind".into()),
                ("time", Value::Moment(time)),
            ]
        };
        let mut session = keys(number);
        // One could not be diagnosed.
        session.push(("verdict", (number < 3).then_some("explained").into()));
        sessions.push(row(&SESSIONS, &session));
        let named = if number < 3 {
            &["axis.X.scale", "probe.lobing"][..]
        } else {
            &[]
        };
        for (rank, effect) in named
            .iter()
            .enumerate()
            .filter(|(rank, _)| number > 0 || *rank == 0)
        {
            for parameter in 0..2_i64 {
                let mut values = keys(number);
                values.extend([
                    ("effect", (*effect).into()),
                    ("number", parameter.into()),
                    ("named", true.into()),
                    ("probability", 0.9.into()),
                    ("rms_before", (5e-6 + number as f64 * 1e-6).into()),
                    ("rms_after", (1e-6 + rank as f64 * 1e-6).into()),
                ]);
                effects.push(row(&EFFECTS, &values));
            }
        }
    }
    let engine = engine(&[(&SESSIONS, sessions), (&EFFECTS, effects)]);
    let found = one(&engine, "SELECT * FROM causes ORDER BY \"rank\"");
    assert_eq!(found.num_rows(), 2);
    let expected = [[1.0, 3.0, 3.0, 2.0, 5e-6], [2.0, 2.0, 3.0, 2.0, 4.5e-6]];
    for (place, expected) in expected.iter().enumerate() {
        let columns = [
            "rank",
            "sessions",
            "sessions_diagnosed",
            "machines",
            "median_reduction",
        ];
        for (name, value) in columns.iter().zip(expected) {
            let own = number(&found, name, place);
            assert!((own - value).abs() < 1e-15, "{name}: {own} is not {value}");
        }
    }
}

#[test]
fn promises_and_corrections_are_those_that_were_kept_and_did_not_help() {
    let promise = |kept: Option<bool>, after: f64| {
        row(
            &PROMISES,
            &[
                ("machine", "mill".into()),
                ("effect", "axis.X.scale".into()),
                ("promised_before", 9e-6.into()),
                ("promised_after", 2e-6.into()),
                ("achieved_before", 8e-6.into()),
                ("achieved_after", after.into()),
                ("kept", kept.into()),
            ],
        )
    };
    let correction = |outcome: &str, before: f64, after: Option<f64>| {
        row(
            &CORRECTIONS,
            &[
                ("outcome", outcome.into()),
                ("error_before", before.into()),
                ("error_after", after.into()),
                ("standard_uncertainty", 1e-6.into()),
            ],
        )
    };
    let engine = engine(&[
        (
            &PROMISES,
            vec![
                promise(Some(true), 2e-6),
                promise(Some(false), 6e-6),
                promise(None, 4e-6),
            ],
        ),
        (
            &CORRECTIONS,
            vec![
                correction("applied", 5e-6, Some(-9e-6)),
                correction("applied", -5e-6, Some(6e-6)),
                correction("applied", 5e-6, Some(1e-6)),
                correction("applied", 5e-6, None),
                correction("refused_stale", 5e-6, Some(9e-6)),
            ],
        ),
    ]);
    let found = one(&engine, "SELECT * FROM promised_and_achieved");
    assert_eq!(found.num_rows(), 1);
    near(number(&found, "promised_reduction", 0), 7e-6);
    near(number(&found, "achieved_reduction", 0), 4e-6);
    near(number(&found, "share_kept", 0), 0.5);
    let found = one(
        &engine,
        "SELECT * FROM corrections_that_did_not_help ORDER BY excess DESC",
    );
    assert_eq!(found.num_rows(), 2);
    let significant = found
        .column_by_name("significant")
        .expect("a column")
        .as_boolean();
    // 4 µm and 1 µm against 2 √2 µm.
    assert!(significant.value(0) && !significant.value(1));
    near(number(&found, "excess", 0), 4e-6);
}

/// The function answers what the watch does, in whatever order the rows come and however the engine splits them.
#[test]
fn a_trend_does_not_depend_on_the_order_of_the_rows() {
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let value = |day: usize| if day < 60 { 0.0 } else { 5e-6 };
    let points: Vec<Point> = (0..120)
        .map(|day| Point {
            time: day as f64,
            value: value(day) + 1e-6 * random.sample::<f64, _>(StandardNormal),
            uncertainty: 1e-6,
        })
        .collect();
    let quiet = spread(&[&points[..30]]);
    let mut watch = Watch::new(quiet, 500.0);
    let changes: Vec<_> = points
        .iter()
        .filter_map(|point| watch.push(point))
        .collect();
    let changes = refined(&points, &quiet, &changes);
    let level = changes.last().expect("a change").after;
    let mut rows: Vec<Row> = points
        .iter()
        .map(|point| {
            row(
                &EFFECTS,
                &[
                    ("machine", "mill".into()),
                    ("time", Value::Moment((point.time * 86_400e6) as i64)),
                    ("value", point.value.into()),
                    ("standard_uncertainty", point.uncertainty.into()),
                ],
            )
        })
        .collect();
    rows.shuffle(&mut random);
    // A session in which the effect was not estimated.
    rows.push(row(
        &EFFECTS,
        &[("machine", "mill".into()), ("time", Value::Moment(5))],
    ));
    let engine = engine(&[(&EFFECTS, rows)]);
    let asked = |source: &str| {
        let found = one(
            &engine,
            &format!(
                "WITH found AS (SELECT trend(\"time\", value, standard_uncertainty, 500.0) AS t FROM {source}) \
                 SELECT t['points'] AS points, t['level'] AS level, t['slope_per_day'] AS slope, unnest(t['changes']) AS c \
                 FROM found"
            ),
        );
        let change = found
            .column_by_name("c")
            .expect("a column")
            .as_struct()
            .clone();
        let text = |name: &str| {
            let column = change.column_by_name(name).expect("a column").clone();
            ScalarValue::try_from_array(&column, 0)
                .expect("a value")
                .to_string()
        };
        (
            [
                number(&found, "points", 0),
                number(&found, "level", 0),
                number(&found, "slope", 0),
            ],
            [text("kind"), text("onset"), text("size")],
            found.num_rows(),
        )
    };
    let (numbers, texts, count) = asked("effects");
    assert_eq!(count, changes.len());
    assert_eq!(numbers, [120.0, level.level, level.slope]);
    assert_eq!(texts[0], "step");
    let onset = points[changes[0].onset].time * 86_400e6;
    assert!(texts[1].contains(&format!("{}", onset as i64)), "{texts:?}");
    assert_eq!(texts[2], changes[0].size[0].to_string());
    let parts = "(SELECT * FROM effects WHERE value > 2e-6 UNION ALL SELECT * FROM effects WHERE value <= 2e-6)";
    assert_eq!(asked(parts), (numbers, texts, count));
}

#[test]
fn what_is_wrong_is_one_sentence() {
    let engine = engine(&[]);
    let refusal = |statement: &str| match engine.ask(statement) {
        Ok(mut answer) => answer.find_map(Result::err).map_or_else(
            || panic!("{statement} has an answer"),
            |error| crate::sentence(&error),
        ),
        Err(error) => crate::sentence(&error),
    };
    let table = refusal("SELECT * FROM nothing");
    assert!(
        table.starts_with("table 'nothing' not found; there are sessions, touches,")
            && table.ends_with("corrections_that_did_not_help"),
        "{table}"
    );
    let column = refusal("SELECT verdikt FROM sessions");
    assert!(
        column.contains("verdikt") && column.contains("verdict"),
        "{column}"
    );
    let syntax = refusal("SELEC 1");
    assert!(
        syntax.contains("Line: 1") && !syntax.contains("ParserError"),
        "{syntax}"
    );
    for writes in [
        "CREATE TABLE mine AS SELECT * FROM sessions",
        "COPY sessions TO 'sessions.csv'",
        "DROP VIEW causes",
        "SET datafusion.execution.batch_size = 1",
        "INSERT INTO sessions SELECT * FROM sessions",
    ] {
        let sentence = refusal(writes);
        assert!(sentence.contains("not supported"), "{writes}: {sentence}");
    }
    let sessions = refusal(
        "SELECT trend(\"time\", 1.0, 1.0, 0.0) FROM (VALUES (to_timestamp_micros(0))) AS t(\"time\")",
    );
    assert!(sessions.contains("must be at least 1"), "{sessions}");
    for refused in [&table, &column, &syntax, &sessions] {
        assert!(!refused.contains('\n'), "{refused}");
    }
}
