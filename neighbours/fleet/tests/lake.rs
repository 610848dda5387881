//! The lake against the recordings that went into it.

mod common;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::time::{Duration, SystemTime};

use arrow_array::Array;
use arrow_array::cast::AsArray;
use common::samples;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::arrow::arrow_writer::ArrowWriter;
use probecell_fleet::diagnose::diagnose_bag;
use probecell_fleet::lake::schema::{
    CORRECTIONS, EFFECTS, FEATURES, INFORMATION, SESSIONS, SIGNALS, TABLES, TOUCHES, Table,
};
use probecell_fleet::lake::{Event, Follower, Lake, numbers, texts};
use probecell_fleet::trend::series::without_equations;

fn rows(lake: &Lake, table: &Table) -> usize {
    let mut rows = 0;
    lake.scan(table, &["bag"], &mut |batch| {
        rows += batch.num_rows();
        Ok(())
    })
    .expect("a table");
    rows
}

fn quiet(_: usize, _: usize) {}

/// Messages of each topic of a sample, by its readable twin, which another program wrote.
fn told(sample: &str) -> BTreeMap<String, u64> {
    let text = fs::read_to_string(samples().join(format!("{sample}.jsonl"))).expect("a twin");
    let head: serde_json::Value =
        serde_json::from_str(text.lines().next().expect("a line")).expect("JSON");
    serde_json::from_value(head["messages"].clone()).expect("counts")
}

#[test]
fn recordings_are_added_once_and_their_rows_are_those_of_the_messages() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = Lake::open_or_create(&folder.path().join("lake")).expect("a lake");
    let added = lake.add(&[samples()], &mut quiet).expect("added");
    assert_eq!(
        (added.new, added.known, added.refused.len()),
        (5, 0, 0),
        "{added:?}"
    );
    let count = |topic: &str| -> u64 {
        let names = [
            "ball_check",
            "guideway",
            "guideway_straight",
            "punch",
            "punch_uncalibrated",
        ];
        names
            .iter()
            .filter_map(|name| told(name).get(topic).copied())
            .sum()
    };
    assert_eq!(rows(&lake, &SESSIONS), 5);
    assert_eq!(rows(&lake, &TOUCHES) as u64, count("probe_events"));
    assert!(
        rows(&lake, &CORRECTIONS) > 0 && rows(&lake, &FEATURES) > 0 && rows(&lake, &EFFECTS) > 0
    );
    let mut samples_of_axes = 0.0;
    lake.scan(&SIGNALS, &["signal", "mean"], &mut |batch| {
        samples_of_axes += numbers(batch, 1)?.len() as f64;
        Ok(())
    })
    .expect("signals");
    assert!(samples_of_axes > 0.0);

    let files = TABLES
        .iter()
        .map(|table| lake.files(table).expect("files"))
        .collect::<Vec<_>>();
    let again = lake
        .add(&[samples(), samples().join("punch.mcap")], &mut quiet)
        .expect("added");
    assert_eq!((again.new, again.known), (0, 6));
    let after = TABLES
        .iter()
        .map(|table| lake.files(table).expect("files"))
        .collect::<Vec<_>>();
    assert_eq!(files, after, "nothing was written");

    // The text beside `ball_check` has dx = 18.11 ± 0.65 µm for 14 touches: 0.65 µm are 2.18 standard uncertainties.
    let mut found = Vec::new();
    lake.scan(
        &EFFECTS,
        &[
            "effect",
            "parameter",
            "value",
            "standard_uncertainty",
            "unit",
        ],
        &mut |batch| {
            for row in 0..batch.num_rows() {
                if texts(batch, 0)?.value(row) == "probe.stylus_offset"
                    && texts(batch, 1)?.value(row) == "dx"
                {
                    found.push([numbers(batch, 2)?.value(row), numbers(batch, 3)?.value(row)]);
                    assert_eq!(texts(batch, 4)?.value(row), "m");
                }
            }
            Ok(())
        },
    )
    .expect("effects");
    assert!(
        found
            .iter()
            .any(|[value, u]| (value.abs() - 18.11e-6).abs() < 0.02e-6
                && (2.18 * u - 0.65e-6).abs() < 0.02e-6),
        "{found:?}"
    );
}

#[test]
fn a_damaged_recording_is_named_and_the_others_are_added() {
    let folder = tempfile::tempdir().expect("a folder");
    let bags = folder.path().join("bags");
    fs::create_dir_all(bags.join("deeper")).expect("a folder");
    fs::copy(
        samples().join("ball_check.mcap"),
        bags.join("deeper/good.mcap"),
    )
    .expect("a copy");
    fs::write(bags.join("broken.mcap"), "no recording").expect("a file");
    let lake = Lake::open_or_create(&folder.path().join("lake")).expect("a lake");
    let added = lake
        .add(std::slice::from_ref(&bags), &mut quiet)
        .expect("added");
    assert_eq!(added.new, 1);
    assert_eq!(added.refused.len(), 1);
    assert!(
        added.refused[0].contains("broken.mcap") && added.refused[0].contains("not an MCAP file"),
        "{added:?}"
    );
    // Cut off in the middle: what is complete is added, with a remark.
    let whole = fs::read(samples().join("punch.mcap")).expect("a sample");
    fs::write(bags.join("cut.mcap"), &whole[..whole.len() / 2]).expect("a file");
    let added = lake
        .add(&[bags.join("cut.mcap")], &mut quiet)
        .expect("added");
    assert!(added.new == 1 && !added.remarks.is_empty(), "{added:?}");
    let error = lake
        .add(&[folder.path().join("nothing.mcap")], &mut quiet)
        .expect("no failure");
    assert_eq!(error.refused.len(), 1);
}

#[test]
fn a_recording_is_added_once_and_when_it_has_ended() {
    const MINUTE: Duration = Duration::from_secs(60);
    let folder = tempfile::tempdir().expect("a folder");
    let bags = folder.path().join("recordings");
    fs::create_dir_all(&bags).expect("a folder");
    let lake = Lake::open_or_create(&folder.path().join("lake")).expect("a lake");
    let mut follower = Follower::new(lake.clone(), vec![bags.clone()], None);
    let mut look = |at: SystemTime| {
        let look = follower.look(at).expect("a look");
        (look.recording, look.added.new, look.added.known)
    };
    let now = SystemTime::now();
    assert_eq!(look(now), (0, 0, 0));

    // What a recorder that runs has written so far, and is quiet for a minute.
    let running = bags.join("running.mcap");
    let all = fs::read(samples().join("ball_check.mcap")).expect("a sample");
    fs::write(&running, &all[..all.len() / 2]).expect("a file");
    assert_eq!(look(now), (1, 0, 0));
    assert_eq!(look(now + MINUTE), (1, 0, 0));
    fs::write(&running, &all).expect("a file");
    let end = SystemTime::now();
    assert_eq!(look(end), (1, 0, 0));
    assert_eq!(look(end + MINUTE), (0, 1, 0));
    assert_eq!(look(end + 2 * MINUTE), (0, 0, 0));

    // What a killed one has left, and a copy of a recording that is in the lake.
    let whole = fs::read(samples().join("punch.mcap")).expect("a sample");
    fs::write(bags.join("killed.mcap"), &whole[..whole.len() / 2]).expect("a file");
    fs::copy(&running, bags.join("copy.mcap")).expect("a copy");
    let then = SystemTime::now();
    assert_eq!(look(then + MINUTE), (1, 0, 1));
    assert_eq!(look(then + 11 * MINUTE), (0, 1, 0));
    assert_eq!(rows(&lake, &SESSIONS), 2);

    // Another follower, after a restart, adds nothing.
    let look = Follower::new(lake, vec![bags], None).look(then + 11 * MINUTE);
    assert_eq!(look.expect("a look").added.new, 0);
}

#[test]
fn compaction_keeps_every_row_and_an_older_lake_opens() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = Lake::open_or_create(&folder.path().join("lake")).expect("a lake");
    for sample in ["ball_check", "guideway", "punch"] {
        lake.add(&[samples().join(format!("{sample}.mcap"))], &mut quiet)
            .expect("added");
    }
    let before: Vec<usize> = TABLES.iter().map(|table| rows(&lake, table)).collect();
    // An older version had no column `program`.
    let (_, path) = lake.files(&SESSIONS).expect("files").remove(0);
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(&path).expect("a file"))
        .expect("Parquet");
    let names = builder
        .schema()
        .fields()
        .iter()
        .map(|field| field.name().clone());
    let kept: Vec<String> = names.filter(|name| name != "program").collect();
    let mask = ProjectionMask::columns(builder.parquet_schema(), kept.iter().map(String::as_str));
    let batches: Vec<_> = builder
        .with_projection(mask)
        .build()
        .expect("a reader")
        .map(|batch| batch.expect("rows"))
        .collect();
    let mut writer = ArrowWriter::try_new(
        File::create(&path).expect("a file"),
        batches[0].schema(),
        None,
    )
    .expect("a writer");
    for batch in &batches {
        writer.write(batch).expect("rows");
    }
    writer.close().expect("a file");

    let lake = Lake::open(&folder.path().join("lake")).expect("a lake");
    let (files, left) = lake.compact().expect("compacted");
    assert!(files > left, "{files} {left}");
    let after: Vec<usize> = TABLES.iter().map(|table| rows(&lake, table)).collect();
    assert_eq!(before, after);
    let mut programs = Vec::new();
    lake.scan(&SESSIONS, &["program"], &mut |batch| {
        programs.extend((0..batch.num_rows()).map(|row| batch.column(0).is_valid(row)));
        Ok(())
    })
    .expect("sessions");
    programs.sort_unstable();
    assert_eq!(programs.len(), 3);
    assert!(
        !programs[0] && programs[2],
        "null where the older version had none: {programs:?}"
    );
    assert_eq!(
        lake.compact().expect("compacted"),
        (left, left),
        "nothing is left to do"
    );
    // Nor had it normal equations.
    assert_eq!(without_equations(&lake).expect("sessions"), 0);
    for (_, path) in lake.files(&INFORMATION).expect("files") {
        fs::remove_file(path).expect("removed");
    }
    assert_eq!(without_equations(&lake).expect("sessions"), 3);
    // Of a later version it is refused.
    fs::write(
        lake.root().join("lake.json"),
        r#"{"schema":"probecell/lake","version":99}"#,
    )
    .expect("a file");
    let refusal = Lake::open(lake.root())
        .expect_err("a later version")
        .to_string();
    assert!(refusal.contains("version 99"), "{refusal}");
}

#[test]
fn columns_carry_unit_and_description() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = Lake::open_or_create(&folder.path().join("lake")).expect("a lake");
    lake.add(&[samples().join("punch.mcap")], &mut quiet)
        .expect("added");
    let event = Event {
        machine: "turn_mill".to_owned(),
        time: 1_767_225_600_000_000,
        kind: "service".to_owned(),
        text: "new probe".to_owned(),
    };
    assert_eq!(
        lake.add_events(std::slice::from_ref(&event))
            .expect("noted"),
        1
    );
    assert_eq!(lake.add_events(&[event]).expect("noted"), 0);
    for table in TABLES {
        for (month, path) in lake.files(table).expect("files") {
            assert!(month.starts_with("month=20"), "{month}");
            let builder =
                ParquetRecordBatchReaderBuilder::try_new(File::open(&path).expect("a file"))
                    .expect("Parquet");
            for field in builder.schema().fields() {
                let text = field.metadata().get("description");
                assert!(
                    text.is_some_and(|text| !text.is_empty()),
                    "{}.{}",
                    table.name,
                    field.name()
                );
            }
        }
    }
    let (_, path) = lake.files(&TOUCHES).expect("files").remove(0);
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(&path).expect("a file"))
        .expect("Parquet");
    let field = builder
        .schema()
        .field_with_name("deviation")
        .expect("a column")
        .clone();
    assert_eq!(field.metadata()["unit"], "m");
    let batch = builder
        .build()
        .expect("a reader")
        .next()
        .expect("a batch")
        .expect("rows");
    let features = batch
        .column_by_name("feature_id")
        .expect("a column")
        .as_string::<i32>()
        .clone();
    assert!((0..features.len()).all(|row| features.is_valid(row)));
}

/// The text beside each sample is what the command `diagnose` prints of it (`.ci/run first_command` compares them).
#[test]
fn the_diagnosis_is_that_of_the_command_byte_for_byte() {
    for sample in ["ball_check", "guideway", "punch"] {
        let report = diagnose_bag(
            &samples()
                .join(format!("{sample}.mcap"))
                .display()
                .to_string(),
        )
        .expect("a report");
        let expected =
            fs::read_to_string(samples().join(format!("{sample}.report.txt"))).expect("a text");
        assert_eq!(format!("{report}\n"), expected, "{sample}");
    }
    let refusal = diagnose_bag("nothing.mcap").expect_err("no file");
    assert!(probecell_fleet::sentence(&refusal).contains("nothing.mcap"));
}
