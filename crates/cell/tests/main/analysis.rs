//! What `[analysis]` asks for is checked against the part when the cell file is read: the sentence names what is wrong.

use std::path::Path;

use cell::{Cell, CellText};

/// The five-axis cell with more in its section `[analysis]`.
fn read(more: &str) -> Result<Cell, String> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch-scripts"));
    let cell = Cell::read(&folder.join("five_axis.toml")).expect("the shipped cell");
    let text = cell.text().clone();
    let edited = text
        .cell
        .replace("[analysis]\n", &format!("[analysis]\n{more}\n"));
    assert_ne!(edited, text.cell);
    let text = CellText {
        cell: edited,
        ..text
    };
    Cell::from_text(text).map_err(|error| error.to_string())
}

#[test]
fn fits_and_alignments_of_features_that_the_part_has_are_taken() {
    for more in [
        "fits = [{ feature = \"P2a_1\", criterion = \"minimum_zone\", outlier_limit = 6.0 }]",
        "fits = [{ feature = \"ball_1_b+0_c0\", criterion = \"minimum_circumscribed\" }]",
        "alignment = { datums = [\"P2a_2\", \"P4a_1\", \"P4b_1\"] }",
        "alignment = { best_fit = [\"P2a_2\"], free = [\"z\", \"a\", \"b\"] }",
    ] {
        if let Err(error) = read(more) {
            panic!("{more}: {error}");
        }
    }
}

#[test]
fn fits_and_alignments_that_the_part_cannot_have_are_refused_by_name() {
    for (more, says) in [
        (
            "fits = [{ feature = \"P9\" }]",
            "analysis.fits: \"P9\" is not a feature of the part",
        ),
        (
            "fits = [{ feature = \"P2a_1\", criterion = \"maximum_inscribed\" }]",
            "analysis.fits: \"P2a_1\" is a plane, for which that criterion is not defined",
        ),
        (
            "fits = [{ feature = \"P2a_1\", criterion = \"best\" }]",
            "unknown variant `best`",
        ),
        (
            "alignment = { datums = [\"P2a_2\", \"P9\"] }",
            "analysis.alignment.datums: \"P9\" is not a feature of the part",
        ),
        (
            "alignment = { datums = [\"P2a_2\"], free = [\"z\"] }",
            "free belongs to best_fit",
        ),
        ("alignment = {}", "needs either datums or best_fit"),
    ] {
        match read(more) {
            Ok(_) => panic!("{more} was taken"),
            Err(error) => assert!(error.contains(says), "{more}: {error}"),
        }
    }
}
