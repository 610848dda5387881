//! The plan here, and what is refused of an answer. Recordings are not there: their answers say so.

use super::*;

fn asked(number: usize) -> Vec<Asked> {
    let one = |number: usize| Asked {
        bag: format!("{number:04}"),
        machine: format!("mill_{}", number % 3),
        month: format!("2026-0{}", 1 + number % 2),
        uri: format!("nowhere/{number}.mcap"),
        verdict: (number % 2 == 0).then(|| "explained".to_owned()),
    };
    (0..number).map(one).collect()
}

fn refused(result: anyhow::Result<impl std::fmt::Debug>) -> String {
    result.expect_err("refused").to_string()
}

#[test]
fn parts_of_any_size_give_the_same_rows() {
    let engine = Engine::begin().unwrap();
    let asked = asked(17);
    let whole = engine.diagnosed(&asked).unwrap();
    assert_eq!(whole.num_rows(), 17);
    for part in [1, 2, 5, 16, 1000] {
        let answered = engine
            .runtime
            .block_on(collect(&engine.context, &asked, part))
            .unwrap();
        assert_eq!(
            lines(&rows(&asked, &answered).unwrap()).unwrap(),
            lines(&whole).unwrap(),
            "{part}"
        );
    }
    let text = lines(&whole).unwrap();
    let first: serde_json::Value = serde_json::from_str(text.lines().next().unwrap()).unwrap();
    assert_eq!(
        [&first["machine"], &first["month"], &first["bag"]],
        ["mill_0", "2026-01", "0000"]
    );
    assert_eq!(first["verdict"], "explained");
    assert!(
        first["diagnosis"]["refusal"]
            .as_str()
            .unwrap()
            .contains("nowhere/0.mcap"),
        "{first}"
    );
    engine.know(whole).unwrap();
    let answer = engine
        .ask(SUMMARY)
        .unwrap()
        .map(Result::unwrap)
        .collect::<Vec<_>>();
    assert_eq!(answer.iter().map(RecordBatch::num_rows).sum::<usize>(), 6);
}

#[test]
fn a_session_without_an_answer_or_with_two_is_refused() {
    let engine = Engine::begin().unwrap();
    let all = asked(6);
    let answered = |asked: &[Asked]| {
        engine
            .runtime
            .block_on(collect(&engine.context, asked, 2))
            .unwrap()
    };
    let told = refused(rows(&all, &answered(&all[..4])));
    assert!(
        told.contains("of 6 sessions 2 have no answer and 0 have several, the first of them 0004"),
        "{told}"
    );
    let twice = [answered(&all), answered(&all[2..3])].concat();
    let told = refused(rows(&all, &twice));
    assert!(
        told.contains("0 have no answer and 1 have several, the first of them 0002"),
        "{told}"
    );
    let told = refused(rows(&all[..5], &answered(&all)));
    assert!(told.contains("0005, which was not asked"), "{told}");
    assert_eq!(rows(&[], &[]).unwrap().num_rows(), 0);
}

#[test]
fn an_answer_that_is_otherwise_here_is_refused() {
    let engine = Engine::begin().unwrap();
    let all = asked(5);
    let rows = engine.diagnosed(&all).unwrap();
    assert_eq!(engine.checked(&all, &rows, 1).unwrap(), 5);
    assert_eq!(engine.checked(&all, &rows, 100).unwrap(), 3);
    // The answers of two sessions exchanged.
    let exchanged = take(
        rows.column(5),
        &UInt32Array::from(vec![1, 0, 2, 3, 4]),
        None,
    )
    .unwrap();
    let mut columns = rows.columns().to_vec();
    columns[5] = exchanged;
    let other = RecordBatch::try_new(rows.schema(), columns).unwrap();
    let told = refused(engine.checked(&all, &other, 1));
    assert!(told.contains("was answered otherwise"), "{told}");
}

#[test]
fn recordings_are_found_below_a_url() {
    let place = Recordings::below("s3://hall/north/").unwrap();
    assert_eq!(
        place.of("bags/ball check.mcap"),
        "s3://hall/north/bags/ball%20check.mcap"
    );
    assert_eq!(place.of("/data/./a.mcap"), "s3://hall/north/data/a.mcap");
    assert_eq!(place.of("s3://other/a.mcap"), "s3://other/a.mcap");
    assert!(refused(Recordings::below("hall")).contains("no URL"));
    assert!(refused(Recordings::below("file:///hall")).contains("s3://BUCKET/FOLDER"));
}
