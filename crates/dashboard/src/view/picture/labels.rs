//! Names of features in the picture, none over another.

use super::WIDTH;

/// Pixels of a letter, and of a line, of the names.
const LETTER: f64 = 7.8;
const LINE: f64 = 15.0;
/// Pixels from a point to its name.
const GAP: f64 = 9.0;
/// Lines above or below that are tried, the nearest first.
const STEPS: [f64; 9] = [-0.5, 0.9, -1.5, 1.9, -2.5, 2.9, -3.5, 3.9, -4.5];

/// Position of a name.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Label {
    pub(super) text: String,
    /// Pixels; end of the text where `right`, else its start.
    pub(super) x: f64,
    /// Pixels, base line.
    pub(super) y: f64,
    /// It stands to the left of its point.
    pub(super) right: bool,
}

impl Label {
    /// Left, right and base line, pixels.
    fn bounds(&self) -> (f64, f64, f64) {
        let width = LETTER * self.text.chars().count() as f64;
        if self.right {
            (self.x - width, self.x, self.y)
        } else {
            (self.x, self.x + width, self.y)
        }
    }

    fn overlaps(&self, other: &Self) -> bool {
        let ((a, b, y), (c, d, z)) = (self.bounds(), other.bounds());
        a < d && c < b && (y - z).abs() < LINE
    }
}

/// A name beside each point: at the first place where none stands yet.
pub(super) fn labels(names: &[(&str, (f64, f64))]) -> Vec<Label> {
    let mut placed: Vec<Label> = Vec::new();
    for (text, at) in names {
        let places = STEPS.iter().flat_map(|step| {
            [false, true].map(|right| Label {
                text: (*text).to_owned(),
                x: at.0 + if right { -GAP } else { GAP },
                y: at.1 + step * LINE,
                right,
            })
        });
        let inside = |one: &Label| {
            let (left, right, _) = one.bounds();
            left >= 0.0 && right <= WIDTH
        };
        let mut free = places.clone().filter(inside);
        let mut any = places;
        let chosen = free.find(|one| !placed.iter().any(|other| one.overlaps(other)));
        placed.extend(chosen.or_else(|| any.next()));
    }
    placed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_points_in_one_place_do_not_overlap_and_stay_in_the_picture() {
        let names: Vec<(&str, (f64, f64))> = ["flat_a", "flat_b", "flat_c", "D1", "flat_d"]
            .into_iter()
            .zip([
                (600.0, 200.0),
                (602.0, 203.0),
                (600.0, 196.0),
                (20.0, 20.0),
                (598.0, 200.0),
            ])
            .collect();
        let placed = labels(&names);
        assert_eq!(placed.len(), names.len());
        for (index, one) in placed.iter().enumerate() {
            let (left, right, _) = one.bounds();
            assert!(left >= 0.0 && right <= WIDTH, "{one:?}");
            for other in &placed[..index] {
                assert!(!one.overlaps(other), "{one:?} over {other:?}");
            }
        }
    }
}
