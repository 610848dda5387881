//! Every row of the register (`docs/source_systems.md, F`) is run and keeps its rule, diagnoses of its sessions
//! included; the page of each says what the run gave, stands alone, and draws nothing outside its pictures.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use roxmltree::{Document, Node, ParsingOptions};
use validation::scenarios::{Judged, Run, Scenario, Value, find, page, register};

/// Every scenario, run once for all tests.
fn judged() -> &'static [(&'static Scenario, Judged)] {
    static ALL: OnceLock<Vec<(&Scenario, Judged)>> = OnceLock::new();
    ALL.get_or_init(|| {
        let one = |scenario: &'static Scenario| {
            let judged = scenario.judge(&Run::silent(1));
            let judged = judged.unwrap_or_else(|error| panic!("{}: {error}", scenario.name));
            (scenario, judged)
        };
        register().iter().map(one).collect()
    })
}

#[test]
fn every_scenario_keeps_its_rule() {
    for (scenario, judged) in judged() {
        let broken: Vec<String> = judged
            .broken()
            .map(|figure| {
                let (ours, rule) = (figure.ours.text(), figure.rule_text());
                format!("{}: {ours} {} is not {rule}", figure.key, figure.unit)
            })
            .collect();
        assert!(judged.passes(), "{}: {broken:?}", scenario.name);
    }
}

#[test]
fn names_are_unique_and_a_wrong_one_gets_the_nearest() {
    let names: BTreeSet<&str> = register().iter().map(|scenario| scenario.name).collect();
    // Table `docs/source_systems.md, F` has sixteen rows.
    assert_eq!((names.len(), register().len()), (16, 16));
    for name in names {
        assert_eq!(find(name).map(|found| found.name), Ok(name));
        let slip = name.to_lowercase().replace('-', "_");
        assert_eq!(find(&slip).err().map(|unknown| unknown.nearest), Some(name));
    }
}

fn texts(node: Node<'_, '_>) -> String {
    let inner = node.descendants().filter(Node::is_text);
    inner.filter_map(|text| text.text()).collect()
}

/// Checks a page as a reader's program would, and gives what `check` finds in it.
fn each_page(mut check: impl FnMut(&Scenario, &Judged, &str, &Document<'_>)) {
    for (scenario, judged) in judged() {
        let html = page(scenario, judged, 1, "this test").expect("a page");
        let html = html.html();
        let options = ParsingOptions {
            allow_dtd: true,
            ..ParsingOptions::default()
        };
        let document = Document::parse_with_options(&html, options)
            .unwrap_or_else(|error| panic!("{}: {error}", scenario.name));
        check(scenario, judged, &html, &document);
    }
}

#[test]
fn every_page_says_what_the_run_gave() {
    each_page(|scenario, judged, _, document| {
        let table = document
            .descendants()
            .find(|node| node.has_tag_name("table"))
            .expect("the table of figures");
        let rows = table.descendants().filter(|node| node.has_tag_name("tr"));
        let rows: Vec<Vec<String>> = rows
            .skip(1)
            .map(|row| row.children().map(texts).collect())
            .collect();
        assert_eq!(
            rows.len(),
            judged.outcome.figures.len(),
            "{}",
            scenario.name
        );
        for (row, figure) in rows.iter().zip(&judged.outcome.figures) {
            let told = |cell: &str, value: &Value| match value {
                Value::Text(text) => assert_eq!(cell, text, "{}", figure.key),
                Value::Number(number) => close(cell, &[*number], &figure.key),
                Value::Numbers(numbers) => close(cell, numbers, &figure.key),
            };
            assert_eq!((&row[0], row[3].as_str()), (&figure.title, figure.unit));
            match &figure.source {
                Some(source) => told(&row[1], source),
                None => assert_eq!(row[1], ""),
            }
            told(&row[2], &figure.ours);
            assert!(
                ["yes", ""].contains(&row[5].as_str()),
                "{}: a passing run",
                figure.key
            );
        }
        let whole = texts(document.root());
        let words = || whole.split(|letter: char| !letter.is_alphanumeric());
        for word in ["NaN", "inf", "None"] {
            assert!(!words().any(|one| one == word), "{}: {word}", scenario.name);
        }
    });
}

/// Four digits of each number of a cell, which a report prints with a true minus sign.
fn close(cell: &str, numbers: &[f64], key: &str) {
    let shown: Vec<f64> = cell
        .split(", ")
        .map(|text| {
            let number = text.replace('−', "-").parse();
            number.unwrap_or_else(|_| panic!("{key}: {cell}"))
        })
        .collect();
    assert_eq!(shown.len(), numbers.len(), "{key}: {cell}");
    for (shown, number) in shown.iter().zip(numbers) {
        assert!(
            (shown - number).abs() <= 5.1e-3 * number.abs(),
            "{key}: {shown} for {number}"
        );
    }
}

#[test]
fn every_page_stands_alone_and_can_be_printed() {
    each_page(|scenario, _, html, document| {
        for reference in ["href=", "src=", "url(", "<script", "<link", "@import"] {
            assert!(!html.contains(reference), "{}: {reference}", scenario.name);
        }
        assert!(html.contains("@page { size: A4"), "{}", scenario.name);
        let pictures = document
            .descendants()
            .filter(|node| node.has_tag_name("svg"));
        assert!(pictures.count() > 0, "{} has no picture", scenario.name);
    });
}

/// A length of a drawing: left, right, top, bottom.
type Extent = [f64; 4];

fn number(node: Node<'_, '_>, name: &str) -> f64 {
    let text = node.attribute(name).expect(name);
    text.parse().unwrap_or_else(|_| panic!("{name} = {text}"))
}

/// What an element of a drawing covers at least; letters are half as wide as high.
fn extent(node: Node<'_, '_>) -> Option<Extent> {
    let around = |places: &[(f64, f64)]| {
        let fold = |pick: &dyn Fn(&(f64, f64)) -> f64| {
            let values = places.iter().map(pick);
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                assert!(value.is_finite(), "a coordinate is {value}");
                (low.min(value), high.max(value))
            })
        };
        let (x, y) = (fold(&|at| at.0), fold(&|at| at.1));
        [x.0, x.1, y.0, y.1]
    };
    match node.tag_name().name() {
        "polyline" | "polygon" => {
            let places: Vec<(f64, f64)> = node
                .attribute("points")?
                .split_whitespace()
                .map(|place| {
                    let (x, y) = place.split_once(',').expect(place);
                    (x.parse().expect(x), y.parse().expect(y))
                })
                .collect();
            Some(around(&places))
        }
        "line" => Some(around(&[
            (number(node, "x1"), number(node, "y1")),
            (number(node, "x2"), number(node, "y2")),
        ])),
        "circle" => Some(around(&[(number(node, "cx"), number(node, "cy"))])),
        "rect" => {
            let (x, y) = (number(node, "x"), number(node, "y"));
            let (width, height) = (number(node, "width"), number(node, "height"));
            Some(around(&[(x, y), (x + width, y + height)]))
        }
        "text" => {
            let (x, y) = (number(node, "x"), number(node, "y"));
            let size = number(node, "font-size");
            let width = 0.5 * size * texts(node).trim().chars().count() as f64;
            let begin = match node.attribute("text-anchor") {
                Some("middle") => -0.5 * width,
                Some("end") => -width,
                _ => 0.0,
            };
            if node.attribute("transform").is_some() {
                // Axes' names, upwards.
                return Some(around(&[(x, y - width / 2.0), (x, y + width / 2.0)]));
            }
            Some(around(&[(x + begin, y), (x + begin + width, y)]))
        }
        _ => None,
    }
}

#[test]
fn every_picture_keeps_inside_its_frame_and_no_label_lies_on_another() {
    each_page(|scenario, _, _, document| {
        for picture in document
            .descendants()
            .filter(|node| node.has_tag_name("svg"))
        {
            let name = format!(
                "{}, {}",
                scenario.name,
                picture.attribute("aria-label").unwrap_or_default()
            );
            let view: Vec<f64> = picture
                .attribute("viewBox")
                .expect("a view")
                .split_whitespace()
                .map(|word| word.parse().expect("a number"))
                .collect();
            let mut labels: Vec<(Extent, String)> = Vec::new();
            for node in picture.descendants() {
                let Some(own) = extent(node) else { continue };
                let [left, right, top, bottom] = own;
                // A stroke is a pixel or two wide.
                assert!(
                    left >= -2.0
                        && right <= view[2] + 2.0
                        && top >= -2.0
                        && bottom <= view[3] + 2.0,
                    "{name}: {} {own:?} {} outside {view:?}",
                    node.tag_name().name(),
                    texts(node).trim()
                );
                if node.has_tag_name("text") && node.attribute("transform").is_none() {
                    labels.push((own, texts(node).trim().to_owned()));
                }
            }
            assert!(labels.len() > 6, "{name}: no ticks");
            for (place, (one, text)) in labels.iter().enumerate() {
                for (other, below) in &labels[place + 1..] {
                    let apart = (one[2] - other[2]).abs() >= 9.0
                        || one[1] <= other[0]
                        || other[1] <= one[0];
                    assert!(apart, "{name}: {text} lies on {below}");
                }
            }
        }
    });
}
