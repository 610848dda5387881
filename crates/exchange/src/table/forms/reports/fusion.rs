//! Autodesk Fusion: results of Inspect Surface.

use std::collections::BTreeMap;

use super::Number;
use crate::ImportError;
use crate::table::Cell;
use crate::table::forms::{Formed, Line, computed};

/// `G800` (nominal point, normal) and `G801` (centre of the ball, its radius) of the same number: points of the surface.
pub(in crate::table::forms) fn fusion_surface(lines: &[Line]) -> Result<Formed, ImportError> {
    let roles = [
        "nominal_x",
        "nominal_y",
        "nominal_z",
        "i",
        "j",
        "k",
        "x",
        "y",
        "z",
        "feature",
    ];
    let mut formed = Formed::with_roles(&roles);
    let mut path = "surface".to_owned();
    let mut nominal: Option<(Line, Words)> = None;
    let mut points = Vec::new();
    let mut unmeasured = 0;
    for line in lines {
        let (kind, rest) = line
            .text
            .trim()
            .split_once(' ')
            .unwrap_or((line.text.trim(), ""));
        match kind {
            "TOOLPATH" => rest.trim().clone_into(&mut path),
            "G800" => {
                unmeasured += usize::from(nominal.is_some());
                let words = Words::of(*line, rest)?;
                if words.number("O")?.value()? != 0.0 {
                    return Err(line.wrong("the point has an offset O, which is not read: the surface is not where its model is"));
                }
                nominal = Some((*line, words));
            }
            "G801" => {
                let words = Words::of(*line, rest)?;
                let number = words.number("N")?.text;
                let of_same = nominal
                    .take()
                    .filter(|(_, of)| of.number("N").is_ok_and(|one| one.text == number));
                let Some((_, of)) = of_same else {
                    return Err(line.wrong(format!("there is no G800 N{number} before it")));
                };
                points.push((*line, path.clone(), of, words));
            }
            _ => {}
        }
    }
    unmeasured += usize::from(nominal.is_some());
    let mut faces: BTreeMap<String, usize> = BTreeMap::new();
    let mut named = Vec::new();
    for (line, path, of, found) in &points {
        let read = |words: &Words, names: [&str; 3]| -> Result<[f64; 3], ImportError> {
            let [a, b, c] = names.map(|name| words.number(name)?.value());
            Ok([a?, b?, c?])
        };
        let place = read(of, ["X", "Y", "Z"])?;
        let normal = read(of, ["I", "J", "K"])?;
        let centre = read(found, ["X", "Y", "Z"])?;
        let radius = found.number("R")?.value()?;
        let along: f64 = place.iter().zip(&normal).map(|(p, n)| p * n).sum();
        let [i, j, k] = normal;
        let face = format!("{path} ({i} {j} {k} at {along:.3})");
        *faces.entry(face.clone()).or_default() += 1;
        let mut cells: Vec<Cell> = Vec::new();
        for name in ["X", "Y", "Z", "I", "J", "K"] {
            cells.push(of.number(name)?.cell());
        }
        for (centre, normal) in centre.iter().zip(&normal) {
            cells.push(computed((centre - radius * normal).to_string()));
        }
        named.push((*line, path, face, cells));
    }
    for (line, path, face, mut cells) in named {
        // Points of one plane are a face; those of a curved surface belong to its tool path.
        let is_face = faces.get(&face).is_some_and(|&count| count >= 3);
        cells.push(computed(if is_face { face } else { path.clone() }));
        formed.table.add(line.row(cells))?;
    }
    if unmeasured > 0 {
        formed
            .remarks
            .push(format!("{unmeasured} points have no G801 and are left out"));
    }
    Ok(formed)
}

/// Words of a letter and a number.
struct Words<'a> {
    line: Line<'a>,
    words: Vec<(&'a str, &'a str)>,
}

impl<'a> Words<'a> {
    fn of(line: Line<'a>, text: &'a str) -> Result<Self, ImportError> {
        let split = |word: &'a str| {
            let letter = word.chars().next().filter(char::is_ascii_uppercase);
            letter.map(|_| word.split_at(1)).ok_or_else(|| {
                line.wrong(format!("expected a letter and a number, found {word:?}"))
            })
        };
        let words = text
            .split_whitespace()
            .map(split)
            .collect::<Result<_, _>>()?;
        Ok(Self { line, words })
    }

    fn number(&self, letter: &str) -> Result<Number<'a>, ImportError> {
        let mut found = self.words.iter().filter(|(own, _)| *own == letter);
        match (found.next(), found.next()) {
            (Some((_, text)), None) => Ok(Number {
                line: self.line,
                text,
            }),
            (None, _) => Err(self.line.wrong(format!("the line has no {letter}"))),
            _ => Err(self.line.wrong(format!("the line has two {letter}"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{cells, refused};
    use crate::table::forms::{Form, read};

    #[test]
    fn points_of_fusion_surface_results() {
        let text = "START\nRESULTSFILE R\nTOOLPATH Inspect faces\nG330 N1 A0. B0. C0. X0 Y0 Z0 I0 R0\n\
            G800 N1 X-50.0 Y14.2 Z-13.5 I-1.0 J0.0 K0.0 O0. U0.05 L-0.05\nG801 N1 X-52.96 Y14.2 Z-13.5 R3.0\n\
            G800 N2 X1.0 Y2.0 Z0.0 I0.0 J0.0 K1.0 O0. U0.05 L-0.05\n\
            G800 N3 X3.0 Y2.0 Z0.0 I0.0 J0.0 K1.0 O0. U0.05 L-0.05\nG801 N3 X3.0 Y2.0 Z2.5 R2.5\nEND\n";
        let formed = read(text, Form::FusionSurface).expect("results");
        let rows = cells(&formed);
        assert!(
            rows[0].starts_with("6: -50.0 14.2 -13.5 -1.0 0.0 0.0 -49.96"),
            "{}",
            rows[0]
        );
        assert_eq!(rows[1], "9: 3.0 2.0 0.0 0.0 0.0 1.0 3 2 0 Inspect faces");
        assert_eq!(formed.remarks, ["1 points have no G801 and are left out"]);
        assert!(
            formed
                .units("")
                .is_ok_and(|units| units.of(crate::units::Quantity::Length).is_err())
        );
        let point = |number: u32| {
            format!(
                "G800 N{number} X{number} Y0 Z1 I0 J0 K1 O0 U1 L1\nG801 N{number} X{number} Y0 Z3 R2\n"
            )
        };
        let face = [0, 1, 2].map(point).concat();
        let face = read(&face, Form::FusionSurface).expect("results");
        assert!(
            cells(&face)[2].ends_with("surface (0 0 1 at 1.000)"),
            "{:?}",
            cells(&face)
        );
        refused(
            text,
            Form::FusionSurface,
            &[
                ("O0.", "O0.5", "line 5, column 1: the point has an offset O"),
                ("G801 N1", "G801 N7", "there is no G800 N7 before it"),
                ("R3.0", "", "the line has no R"),
                (
                    "X-52.96",
                    "X-52,96",
                    "line 6, column 10: expected a number, found \"-52,96\"",
                ),
            ],
        );
    }
}
