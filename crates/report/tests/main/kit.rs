//! Pages as a reader's program sees them: well-formed, alone, and the same every time.

use expect_test::expect;
use report::{Arrow, Axis, Bar, Bars, Heat, Page, Plot, Series, Table, Unit};

fn page() -> Page {
    let wave = |n: usize| (0..n).map(move |i| (i as f64 * 1e-3, 4e-6 * (i as f64 * 0.05).sin()));
    let mut page = Page::new("Gap of <part> & \"cell\"");
    page.lead("One sentence.")
        .heading("Plots")
        .list(&["a < b".to_owned()]);
    let plots = [
        Plot::new(
            "Residual",
            Axis::new("X", Unit::MM),
            Axis::new("deviation", Unit::UM),
        )
        .with(Series::line("after", wave(9000).collect()))
        .with(Series::points("before", wave(120).collect()))
        .with(Series::level("floor", 1e-6))
        .with_caption("A caption."),
        Plot::new("XY", Axis::new("X", Unit::MM), Axis::new("Y", Unit::MM))
            .with(Series::arrows(
                "deviation",
                (0..24)
                    .map(|i| {
                        let angle = f64::from(i) * std::f64::consts::TAU / 24.0;
                        let (y, x) = angle.sin_cos();
                        Arrow {
                            at: (x * 0.05, y * 0.02),
                            vector: (x * 3e-6, y * 7e-6),
                        }
                    })
                    .collect(),
                Unit::UM,
                7e-6,
            ))
            .with_same_scale(),
        Plot::new("Map", Axis::new("x", Unit::MM), Axis::new("y", Unit::MM)).with(Series::Heat(
            Heat {
                x: (0..=4).map(|i| f64::from(i) * 0.01).collect(),
                y: (0..=3).map(|i| f64::from(i) * 0.01).collect(),
                values: (0..12).map(|i| f64::from(i - 5) * 1e-6).collect(),
                label: "deviation".to_owned(),
                unit: Unit::UM,
                scale: None,
            },
        )),
        Plot::new("Empty", Axis::new("x", Unit::MM), Axis::new("y", Unit::MM)),
    ];
    page.plots(&plots).expect("plots");
    let bar = |label: &str, value: f64, group| Bar {
        label: label.to_owned(),
        value,
        ci95: Some([0.8 * value, 1.2 * value]),
        group,
    };
    page.bars(&Bars {
        title: "Held out".to_owned(),
        label: "rms".to_owned(),
        unit: Unit::UM,
        bars: vec![
            bar("without any", 35e-6, 0),
            bar("probe.ball_radius", 4e-6, 0),
            bar("a wrong one instead", 34e-6, 1),
        ],
        groups: vec!["model".to_owned(), "placebo".to_owned()],
        levels: vec![("noise floor".to_owned(), 3e-6)],
        caption: String::new(),
    })
    .expect("bars");
    let mut table = Table::new("Effects", &["effect", "value"]);
    table.row(vec!["link.EX0C".to_owned(), Unit::UM.text(12.5e-6)]);
    page.table(&table);
    page
}

/// Names of the elements of a page; panics where they do not nest.
fn elements(html: &str) -> Vec<String> {
    const VOID: [&str; 2] = ["meta", "!DOCTYPE"];
    let (mut open, mut all): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
    for piece in html.split('<').skip(1) {
        let (tag, text) = piece.split_once('>').expect("a tag ends");
        assert!(!text.contains('>'), "`{text}` holds a bare angle");
        let name: String = tag
            .trim_start_matches('/')
            .chars()
            .take_while(|letter| letter.is_ascii_alphanumeric() || *letter == '!')
            .collect();
        if tag.starts_with('/') {
            assert_eq!(open.pop().as_ref(), Some(&name));
        } else if !tag.ends_with('/') && !VOID.contains(&name.as_str()) {
            open.push(name.clone());
        }
        all.push(name);
    }
    assert!(open.is_empty(), "left open: {open:?}");
    all
}

#[test]
fn a_page_nests_and_needs_nothing_from_elsewhere() {
    let html = page().html();
    let elements = elements(&html);
    assert_eq!(elements.iter().filter(|name| *name == "svg").count(), 8);
    for stranger in ["script", "img", "link", "iframe", "image"] {
        assert!(!elements.iter().any(|name| name == stranger), "{stranger}");
    }
    let addresses: Vec<&str> = html
        .match_indices("http")
        .map(|(at, _)| &html[at..])
        .collect();
    assert!(
        addresses
            .iter()
            .all(|address| address.starts_with("http://www.w3.org/2000/svg")),
        "the page points elsewhere"
    );
    assert!(html.contains("Gap of &lt;part&gt; &amp; &quot;cell&quot;"));
}

#[test]
fn the_same_data_give_the_same_bytes_and_other_data_others() {
    assert_eq!(page().html(), page().html());
    let mut longer = page();
    longer.paragraph("More.");
    assert_ne!(page().html(), longer.html());
}

/// Ticks of the axes are millimetres and micrometres, though the data are metres.
#[test]
fn ticks_are_in_the_units_of_the_axes() {
    let svg = Plot::new("t", Axis::new("X", Unit::MM), Axis::new("d", Unit::UM))
        .with(Series::points(
            "",
            vec![(0.0, 0.0), (0.1, 20e-6), (f64::NAN, 5.0)],
        ))
        .svg()
        .expect("a plot");
    let texts: Vec<&str> = svg
        .lines()
        .filter(|line| !line.starts_with('<') && !line.is_empty())
        .collect();
    for expected in ["X / mm", "d / µm", "100", "20"] {
        assert!(texts.contains(&expected), "{expected} is not in {texts:?}");
    }
}

#[test]
fn nothing_finite_and_grids_that_do_not_fit_are_refused() {
    let plot = || Plot::new("none", Axis::new("x", Unit::ONE), Axis::new("y", Unit::ONE));
    let empty = plot().with(Series::line("", vec![(f64::NAN, 1.0)])).svg();
    assert_eq!(
        empty.expect_err("nothing").to_string(),
        "plot `none` has nothing to show"
    );
    let heat = Heat {
        x: vec![0.0, 1.0],
        y: vec![0.0, 1.0, 2.0],
        values: vec![1.0],
        label: "g".to_owned(),
        unit: Unit::ONE,
        scale: None,
    };
    assert_eq!(
        plot()
            .with(Series::Heat(heat))
            .svg()
            .expect_err("grid")
            .to_string(),
        "grid `g` has 1 values for 1 columns and 2 rows"
    );
}

/// Paper: columns stand again on every sheet, a short table is kept whole, a section begins a sheet.
#[test]
fn tables_have_heads_and_only_long_ones_go_on_overleaf() {
    let with = |rows: usize| {
        let mut table = Table::new("Touches", &["point", "deviation"]);
        for row in 0..rows {
            table.row(vec![row.to_string(), "0".to_owned()]);
        }
        let mut page = Page::new("t");
        page.heading("Touches").table(&table);
        page.html()
    };
    for (rows, opening) in [(20, "<table>"), (21, "<table class=\"long\">")] {
        let html = with(rows);
        elements(&html);
        assert!(html.contains(opening), "{rows} rows");
        let (head, body) = html.split_once("</thead>").expect("a head");
        assert!(head.contains("<th>point</th>") && !head.contains("<td>"));
        assert_eq!(
            body.matches("<td class=\"quantity brief\">").count(),
            2 * rows
        );
    }
    assert!(with(1).contains("<h2>Touches</h2>"));
    let mut bare = Page::new("t");
    let mut table = Table::new("", &["", ""]);
    table.row(vec!["cell".to_owned(), "mill".to_owned()]);
    bare.table(&table);
    assert!(!bare.html().contains("<thead>"), "there is nothing to head");
}

/// The text holds every word and number of the page, in columns where they fit, and nothing that steers a terminal.
#[test]
fn plain_text_says_what_the_page_says() {
    let mut whole = page();
    let plot = Plot::new("p", Axis::new("x", Unit::MM), Axis::new("y", Unit::MM));
    let plot = plot.with(Series::points("", vec![(0.0, 0.0)]));
    whole.heading("Only pictures").plot(&plot).expect("a plot");
    whole.heading("Last").paragraph("Words.");
    let text = whole.text();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "Gap of <part> & \"cell\"");
    for line in [
        "One sentence.",
        "Plots",
        "-----",
        "- a < b",
        "Effects",
        "Last",
    ] {
        assert!(lines.contains(&line), "{line} is not in {text}");
    }
    let column = |line: &str, word: &str| line.find(word).map(|at| line[..at].chars().count());
    let row = |word: &str| lines.iter().find(|line| line.contains(word)).expect(word);
    assert_eq!(
        column(row("effect"), "value"),
        column(row("link.EX0C"), &Unit::UM.text(12.5e-6))
    );
    assert!(!text.contains("svg") && !text.contains("Only pictures"));

    let mut wide = Table::new("Faults", &["node", "what"]);
    wide.row(vec!["cycle\u{1b}[31m".to_owned(), "long ".repeat(60)]);
    let mut page = Page::new("t");
    page.table(&wide);
    let text = page.text();
    assert!(text.contains("  cycle [31m  long long"), "{text:?}");
    assert!(
        text.contains("\n              long long"),
        "it goes on below: {text:?}"
    );
    assert!(!text.contains('\u{1b}'));
    let mut wide = Table::new("Faults", &["node", "what"]);
    wide.row(vec!["long ".repeat(20), "late".to_owned()]);
    let mut page = Page::new("t");
    page.table(&wide);
    let text = page.text();
    assert!(text.contains("  - node: long long"), "{text:?}");
    assert!(text.contains("    what: late"), "{text:?}");
}

/// The plain text of a page, whole.
#[test]
fn plain_text_of_a_page() {
    expect![[r#"
        Gap of <part> & "cell"

        One sentence.

        Plots
        -----

        - a < b

        Effects
          effect     value
          link.EX0C  12.5 µm
    "#]]
    .assert_eq(&page().text());
}
