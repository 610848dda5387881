//! Questions to a lake of the sample recordings.

mod common;

use std::collections::{BTreeMap, BTreeSet};

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use common::samples;
use datafusion::arrow::ipc::reader::StreamReader;
use datafusion::arrow::ipc::writer::StreamWriter;
use probecell_fleet::diagnose::{diagnose_bag, diagnose_together};
use probecell_fleet::lake::Lake;
use probecell_fleet::lake::schema::TABLES;
use probecell_fleet::sql::{Engine, Form, write};

/// A lake of the samples.
fn lake(folder: &std::path::Path) -> Lake {
    let lake = Lake::open_or_create(&folder.join("lake of [samples]")).expect("a lake");
    let added = lake.add(&[samples()], &mut |_, _| {}).expect("added");
    assert_eq!(added.new, 5);
    lake
}

/// The answer as JSON.
fn json(engine: &Engine, statement: &str) -> Vec<serde_json::Value> {
    let mut text = Vec::new();
    let answer = engine.ask(statement).expect("a question");
    write(answer, Form::Json, &mut text).expect("an answer");
    serde_json::from_slice(&text).expect("JSON")
}

#[test]
fn every_table_has_the_rows_of_its_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = lake(folder.path());
    let engine = Engine::open(&lake).expect("an engine");
    for table in TABLES {
        let mut rows = 0;
        lake.scan(table, &["bag"], &mut |batch| {
            rows += batch.num_rows();
            Ok(())
        })
        .expect("rows");
        let counted = json(
            &engine,
            &format!("SELECT count(*) AS n FROM {}", table.name),
        );
        assert_eq!(counted[0]["n"], rows, "{}", table.name);
    }
    let months = json(&engine, "SELECT DISTINCT \"month\" AS m FROM sessions");
    assert!(
        months
            .iter()
            .all(|row| row["m"].as_str().is_some_and(|month| month.len() == 7))
    );
}

/// Each session is answered once, and by the diagnosis of the command, which the text beside each sample holds.
#[test]
fn the_function_answers_each_session_once_as_the_diagnosis_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let engine = Engine::open(&lake(folder.path())).expect("an engine");
    let rows = json(
        &engine,
        "SELECT uri, verdict, rms, diagnose(uri) AS d FROM sessions UNION ALL \
         SELECT 'nothing.mcap', NULL, NULL, diagnose('nothing.mcap')",
    );
    let names: BTreeSet<&str> = rows.iter().filter_map(|row| row["uri"].as_str()).collect();
    assert_eq!((rows.len(), names.len()), (6, 6));
    for row in &rows {
        let (name, told) = (row["uri"].as_str().expect("a name"), &row["d"]);
        assert_eq!(told["verdict"], row["verdict"], "{name}");
        assert_eq!(told["rms"], row["rms"], "{name}");
        let Ok(report) = diagnose_bag(name) else {
            let refusal = told["refusal"].as_str().expect("a refusal");
            assert!(refusal.contains(name), "{refusal}");
            continue;
        };
        assert!(told["refusal"].is_null());
        assert_eq!(told["unexplained_rms"], report.unexplained.rms);
        let effects = told["effects"].as_array().expect("a list");
        assert_eq!(effects.len(), report.effects.len());
        for (effect, own) in effects.iter().zip(&report.effects) {
            assert_eq!(effect["effect"], own.effect.as_str());
            assert_eq!(effect["probability"], own.probability);
            let values = effect["parameters"].as_array().expect("a list").iter();
            let values: Vec<f64> = values.filter_map(|one| one["value"].as_f64()).collect();
            let own: Vec<f64> = own.parameters.iter().map(|one| one.value).collect();
            assert_eq!(values, own);
        }
    }
}

#[test]
fn a_joint_fit_is_that_of_the_recordings_of_its_group() {
    let folder = tempfile::tempdir().expect("a folder");
    let engine = Engine::open(&lake(folder.path())).expect("an engine");
    let rows = json(
        &engine,
        "SELECT machine, array_agg(uri ORDER BY uri) AS uris, joint_fit(uri) AS j FROM sessions GROUP BY machine",
    );
    let mut sizes = Vec::new();
    for row in &rows {
        let uris: Vec<String> = serde_json::from_value(row["uris"].clone()).expect("names");
        sizes.push(uris.len());
        assert_eq!(row["j"]["sessions"], uris.len());
        match diagnose_together(&uris) {
            Ok(report) => {
                assert_eq!(row["j"]["rms"], report.gap.rms);
                assert_eq!(row["j"]["samples"], report.samples);
            }
            Err(_) => assert!(row["j"]["refusal"].is_string(), "{row}"),
        }
    }
    assert!(sizes.iter().any(|size| *size > 1), "{sizes:?}");
    let none = json(
        &engine,
        "SELECT joint_fit(uri) AS j FROM sessions WHERE machine = 'none'",
    );
    assert!(none[0]["j"].is_null());
}

#[test]
fn csv_has_lists_and_structures_as_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let engine = Engine::open(&lake(folder.path())).expect("an engine");
    let statement = "SELECT bag, declared, ended FROM sessions ORDER BY bag";
    let mut text = Vec::new();
    write(engine.ask(statement).expect("asked"), Form::Csv, &mut text).expect("written");
    let text = String::from_utf8(text).expect("text");
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!((lines[0], lines.len()), ("bag,declared,ended", 6));
    for (line, row) in lines[1..].iter().zip(json(&engine, statement)) {
        let bag = row["bag"].as_str().expect("a key");
        let declared = row["declared"].to_string().replace('"', "\"\"");
        assert!(line.starts_with(bag), "{line}");
        let quoted = if declared.contains(',') || declared.contains('"') {
            format!("\"{declared}\"")
        } else {
            declared
        };
        assert!(
            line.contains(&format!(",{quoted},")),
            "{line} lacks {quoted}"
        );
    }
    let mut text = Vec::new();
    write(
        engine
            .ask("SELECT bag FROM sessions WHERE false")
            .expect("asked"),
        Form::Csv,
        &mut text,
    )
    .expect("written");
    assert_eq!(text, b"bag\n");
}

/// The worker answers every row in its place, with other columns untouched, as the function of SQL does.
#[test]
fn the_worker_answers_as_the_function_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let engine = Engine::open(&lake(folder.path())).expect("an engine");
    let asked: Vec<RecordBatch> = engine
        .ask("SELECT bag, uri FROM sessions ORDER BY bag")
        .expect("asked")
        .map(|batch| batch.expect("rows"))
        .collect();
    let mut input = Vec::new();
    let mut writer = StreamWriter::try_new(&mut input, &asked[0].schema()).expect("a stream");
    for batch in &asked {
        for row in 0..batch.num_rows() {
            writer.write(&batch.slice(row, 1)).expect("a batch");
        }
    }
    writer.finish().expect("a stream");
    let mut output = Vec::new();
    assert_eq!(
        probecell_fleet::worker::run(&input[..], &mut output).expect("answered"),
        5
    );
    let expected: BTreeMap<String, serde_json::Value> =
        json(&engine, "SELECT bag, diagnose(uri) AS d FROM sessions")
            .into_iter()
            .map(|row| {
                (
                    row["bag"].as_str().unwrap_or_default().to_owned(),
                    row["d"].clone(),
                )
            })
            .collect();
    let mut bags = Vec::new();
    for batch in StreamReader::try_new(&output[..], None).expect("a stream") {
        let batch = batch.expect("a batch");
        let answers = batch
            .column_by_name("diagnosis")
            .expect("a column")
            .as_struct();
        let text = |name: &str| {
            answers
                .column_by_name(name)
                .expect("a field")
                .as_string::<i32>()
                .clone()
        };
        let rms = answers
            .column_by_name("rms")
            .expect("a field")
            .as_primitive::<Float64Type>();
        let samples = answers
            .column_by_name("samples")
            .expect("a field")
            .as_primitive::<Int64Type>();
        for row in 0..batch.num_rows() {
            let keys = arrow_cast::cast(
                batch.column(0),
                &datafusion::arrow::datatypes::DataType::Utf8,
            )
            .expect("text");
            let bag = keys.as_string::<i32>().value(row).to_owned();
            assert_eq!(expected[&bag]["verdict"], text("verdict").value(row));
            assert_eq!(expected[&bag]["rms"], rms.value(row));
            assert_eq!(expected[&bag]["samples"], samples.value(row));
            bags.push(bag);
        }
    }
    let sorted: Vec<String> = expected.keys().cloned().collect();
    assert_eq!(bags, sorted, "each once, in the order of the input");
    let refusal = probecell_fleet::worker::run(&b"no stream"[..], Vec::new()).expect_err("refused");
    assert!(
        probecell_fleet::sentence(&refusal).contains("no stream of Arrow IPC"),
        "{refusal}"
    );
}
