//! The page of a diagnosis as another program reads it: well-formed, true to the report, and safe whatever a bag says.

use diagnosis::report::{Declared, NextMeasurement, NextPoint, Report, Sizes};
use diagnosis::residuals::TouchResiduals;
use diagnosis::{
    Options, Residuals, Session, diagnose_together_with_residuals, diagnose_with_residuals,
};
use report::diagnosis_page;
use roxmltree::{Document, Node, ParsingOptions};
use validation::blind::{Content, session};

const HOSTILE: &str = "<script>alert('1')</script> & \"quotes\" <img src=x onerror=y>";

fn diagnosed(session: &Session) -> (Report, Residuals) {
    diagnose_with_residuals(session, &Options::default()).expect("a diagnosis")
}

fn parsed(html: &str) -> Document<'_> {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(html, options).expect("a well-formed page")
}

fn texts(node: Node<'_, '_>) -> String {
    let inner = node.descendants().filter(Node::is_text);
    inner.filter_map(|text| text.text()).collect()
}

/// Cells of the rows of the table with this caption.
fn table(page: &Document<'_>, caption: &str) -> Vec<Vec<String>> {
    let table = page
        .descendants()
        .filter(|node| node.has_tag_name("table"))
        .find(|table| texts(*table).contains(caption))
        .expect("the table");
    let rows = table.descendants().filter(|node| node.has_tag_name("tr"));
    let cells = |row: Node<'_, '_>| -> Vec<String> {
        row.children().filter(Node::is_element).map(texts).collect()
    };
    rows.skip(1).map(cells).collect()
}

/// The number of a cell in µm.
fn um(cell: &str) -> f64 {
    let number = cell.strip_suffix(" µm").expect("micrometres");
    number.parse().expect("a number")
}

fn touches(residuals: &Residuals) -> &TouchResiduals {
    match residuals {
        Residuals::Touches(all) => &all[0],
        Residuals::Drives(_) | Residuals::Moves(_) => panic!("a session of touches"),
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|value| value * value).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Name and identifier of an effect.
fn named(effect: &str) -> String {
    format!("{} ({effect})", effects::vocabulary::describe(effect))
}

/// Three digits of a number.
fn same(shown: f64, given: f64) -> bool {
    (shown - given).abs() <= 0.006 * given.abs()
}

#[test]
fn the_table_says_what_the_report_says() {
    let (session, _) = session(6, Content::Known(2));
    let (report, residuals) = diagnosed(&session);
    assert!(!report.effects.is_empty(), "something to tell");
    let html = diagnosis_page(&report, &residuals).expect("a page").html();
    let page = parsed(&html);
    let rows = table(&page, "In the order in which they close the gap");
    assert_eq!(rows.len(), report.effects.len());
    for (row, effect) in rows.iter().zip(&report.effects) {
        let count = effect.group.len();
        if count > 1 {
            assert_eq!(row[0], format!("one of {count} causes"));
        } else {
            assert_eq!(row[0], named(&effect.effect));
        }
        assert!(same(um(&row[3]), 1e6 * effect.rms_before), "{row:?}");
        assert!(same(um(&row[4]), 1e6 * effect.rms_after), "{row:?}");
        let (low, high) = row[5].split_once(" to ").expect("an interval");
        assert!(same(um(low), 1e6 * effect.ci95_after[0]), "{row:?}");
        assert!(same(um(high), 1e6 * effect.ci95_after[1]), "{row:?}");
        let told = if count > 1 {
            let members = table(&page, &format!("One of these {count} acts"));
            let names = |row: &Vec<String>| row[0].to_lowercase();
            let names: Vec<String> = members.iter().map(names).collect();
            let wanted = effect.group.iter().map(|one| named(one).to_lowercase());
            assert_eq!(names, wanted.collect::<Vec<_>>());
            members[0][1].clone()
        } else {
            row[1].clone()
        };
        for parameter in &effect.parameters {
            assert!(told.contains(&format!("{} = ", parameter.name)));
        }
    }
}

/// Machine, noise and declared effects are those of the report; what is not there makes no table.
#[test]
fn the_page_says_what_the_diagnosis_stands_on() {
    let (session, _) = session(6, Content::Known(2));
    let (mut report, residuals) = diagnosed(&session);
    let html = diagnosis_page(&report, &residuals).expect("a page").html();
    assert!(!html.contains("Declared effects"), "nothing was declared");
    let page = parsed(&html);
    let machine = report.machine.clone().expect("a machine");
    let text = texts(page.root());
    assert!(text.contains(&machine.fingerprint[..12]) && text.contains(&machine.name));
    let rows = table(
        &page,
        "Standard deviation of the residuals of the best explanation",
    );
    assert!(report.noise.len() > 1, "something to compare");
    assert_eq!(rows.len(), report.noise.len());
    for (row, noise) in rows.iter().zip(&report.noise) {
        assert!(row[0].ends_with(&noise.key), "{row:?}");
        assert_eq!(row[1], noise.touches.to_string());
        assert!(same(um(&row[2]), 1e6 * noise.floor), "{row:?}");
        let (low, high) = row[3].split_once(" to ").expect("an interval");
        assert!(same(um(low), 1e6 * noise.ci95[0]), "{row:?}");
        assert!(same(um(high), 1e6 * noise.ci95[1]), "{row:?}");
    }

    let sizes = |before: f64, after: f64| Sizes {
        rms_before: before,
        rms_after: after,
        ci95_after: [0.9 * after, 1.1 * after],
    };
    let effect = |name: &str, kept: Option<bool>| Declared {
        effect: name.to_owned(),
        parameters: report.effects[0].parameters.clone(),
        chosen_from: vec!["axis.X.scale".to_owned()],
        source: Some(format!("session {HOSTILE}")),
        measured: Some("2026-01-01T00:00:00Z".to_owned()),
        promised: Some(sizes(30e-6, 2e-6)),
        achieved: Some(sizes(31e-6, 9e-6)),
        kept,
    };
    report.declared = vec![effect("link.EX0C", None), effect("link.EA0C", Some(false))];
    let html = diagnosis_page(&report, &residuals).expect("a page").html();
    let page = parsed(&html);
    let rows = table(&page, "Subtracted before the diagnosis");
    assert_eq!(rows.len(), 2);
    for (row, declared) in rows.iter().zip(&report.declared) {
        assert_eq!(row[0], named(&declared.effect));
        assert!(row[2].contains(HOSTILE) && row[2].contains("chosen from axis.X.scale"));
        assert!(row[3].starts_with("30.0 µm → 2.00 µm"), "{}", row[3]);
        assert!(row[4].starts_with("31.0 µm → 9.00 µm"), "{}", row[4]);
        // Both were found in one session and are judged together.
        assert!(row[5].starts_with("NOT kept"), "{}", row[5]);
    }
}

/// Touches for a machine without rotary axes have no column for them.
#[test]
fn proposed_touches_name_the_axes_that_the_machine_has() {
    let (session, _) = session(6, Content::Known(1));
    let (mut report, residuals) = diagnosed(&session);
    let mut columns = |rotary_positions: Vec<f64>| -> Vec<String> {
        report.next_measurement = vec![NextMeasurement {
            separates: vec!["link.EX0C".to_owned(), "axis.X.scale".to_owned()],
            points: vec![NextPoint {
                point_index: 0,
                rotary_positions,
                feed: 1e-3,
                difference: 5e-6,
                feature: "top".to_owned(),
                position: [0.01, 0.0, 0.0],
                why: "another place".to_owned(),
            }],
            plan: None,
            explanations: Vec::new(),
            chance: 0.9,
            inseparable: Vec::new(),
        }];
        let html = diagnosis_page(&report, &residuals).expect("a page").html();
        let rows = table(
            &parsed(&html),
            &format!(
                "To discriminate between: {}, or {}",
                named("link.EX0C"),
                named("axis.X.scale")
            ),
        );
        rows[0].clone()
    };
    assert_eq!(columns(Vec::new()).len(), 5);
    let turned = columns(vec![0.0, std::f64::consts::FRAC_PI_2]);
    assert_eq!((turned.len(), turned[2].as_str()), (6, "0.0, 90.0"));
}

/// What the pictures show is what the report judges by.
#[test]
fn the_residuals_have_the_size_that_the_report_gives() {
    for (seed, content) in [(6, Content::Known(2)), (4, Content::Stray)] {
        let (session, _) = session(seed, content);
        let (report, residuals) = diagnosed(&session);
        let judged = report.effects.iter().filter(|effect| effect.held_out);
        let judged: Vec<_> = judged.collect();
        let (first, last) = (judged.first().expect("one"), judged.last().expect("one"));
        let shown = touches(&residuals).touches.iter();
        let used = || shown.clone().filter(|touch| touch.after.is_some());
        let close = |one: f64, other: f64| (one - other).abs() < 1e-9 * other;
        assert!(close(
            // Touches that are set aside count for the gap alone, and no effect begins with more than that.
            rms(used().map(|touch| touch.before)).min(report.gap.rms),
            first.rms_before
        ));
        assert!(close(
            rms(used().filter_map(|touch| touch.after)),
            last.rms_after
        ));
    }
}

#[test]
fn what_a_bag_says_is_text_and_never_markup() {
    let (mut session, _) = session(6, Content::Known(1));
    session.name = HOSTILE.to_owned();
    let plan = session.plan.as_mut().expect("a plan");
    for feature in &mut plan.features {
        feature.id = format!("{HOSTILE}{}", feature.id);
    }
    let (report, residuals) = diagnosed(&session);
    let html = diagnosis_page(&report, &residuals).expect("a page").html();
    let page = parsed(&html);
    for forbidden in ["script", "img", "link", "iframe", "image", "object", "a"] {
        assert!(
            !page
                .descendants()
                .any(|node| node.has_tag_name(forbidden) || node.tag_name().name() == forbidden),
            "{forbidden}"
        );
    }
    let heading = page.descendants().find(|node| node.has_tag_name("h1"));
    assert!(texts(heading.expect("a heading")).contains(HOSTILE));
    let handlers = page
        .descendants()
        .flat_map(|node| node.attributes().collect::<Vec<_>>());
    assert!(
        !handlers
            .into_iter()
            .any(|attribute| attribute.name().starts_with("on"))
    );
}

/// Nothing is loaded, and the same session gives the same page.
#[test]
fn a_page_stands_alone_and_is_the_same_each_time() {
    let make = || {
        let (session, _) = session(6, Content::Known(1));
        let (report, residuals) = diagnosed(&session);
        diagnosis_page(&report, &residuals).expect("a page").html()
    };
    let html = make();
    assert_eq!(html, make());
    let addresses = html.match_indices("http").map(|(at, _)| &html[at..]);
    let mut strangers = addresses.filter(|text| !text.starts_with("http://www.w3.org/2000/svg"));
    assert!(strangers.next().is_none());
    assert!(!html.contains("url(") && !html.contains("@import"));
    let page = parsed(&html);
    let pictures = page
        .descendants()
        .filter(|node| node.tag_name().name() == "svg");
    assert!(
        pictures.count() >= 6,
        "part before and after, axes, time, names"
    );
}

/// Several sessions: one table for each that judges, with the report's sizes.
#[test]
fn every_withheld_session_has_its_table() {
    let (mut first, _) = session(6, Content::Known(1));
    let mut second = first.clone();
    first.name = "first".to_owned();
    second.name = "second".to_owned();
    let (report, residuals) =
        diagnose_together_with_residuals(&[first], &[second], &Options::default())
            .expect("a diagnosis");
    assert!(
        touches(&residuals)
            .touches
            .iter()
            .all(|touch| touch.session == 0)
    );
    assert_eq!(touches(&residuals).sessions, ["second"]);
    let html = diagnosis_page(&report, &residuals).expect("a page").html();
    let page = parsed(&html);
    let Some(last) = report.effects.last() else {
        panic!("the joint diagnosis names the effect");
    };
    let rows = table(&page, "second");
    let row = rows.last().expect("a row");
    assert!(same(um(&row[2]), 1e6 * last.sessions[0].rms_after));
    let shown = touches(&residuals)
        .touches
        .iter()
        .filter_map(|touch| touch.after);
    assert!((rms(shown) - last.rms_after).abs() < 1e-9 * last.rms_after);
}
