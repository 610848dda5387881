//! From which side an axis came to where it stood: the sign of its last move, touch by touch.
//!
//! A slide that stands while it is read (an interferometer, a dial, a tracker) has no speed; its lost motion shows in the
//! direction of its last move (ISO 230-2, approach from either side).

/// Moves below this are none, m or rad.
const STANDS: f64 = 1e-5;

/// A share of a unit vector below this is rounding.
const ACROSS_IT: f64 = 1e-6;

/// The side from which a movement comes along an axis; 0 across it.
pub(crate) fn side(along: f64) -> f64 {
    if along.abs() < ACROSS_IT {
        0.0
    } else {
        along.signum()
    }
}

/// The sign of the last move at each of some successive positions; 0 where nobody can say.
///
/// At a turning point that is read twice, the second reading belongs to the run that follows: an axis overruns its last
/// target before it returns (ISO 230-2, standard test cycle).
pub(crate) fn last_moves(positions: &[f64]) -> Vec<f64> {
    let mut signs = vec![0.0; positions.len()];
    let mut begin = 0;
    let mut before = 0.0;
    while begin < positions.len() {
        let stands = |at: &usize| (positions[*at] - positions[begin]).abs() <= STANDS;
        let end = begin + (begin..positions.len()).take_while(stands).count();
        let next = positions
            .get(end)
            .map_or(0.0, |next| (next - positions[begin]).signum());
        for (number, sign) in signs[begin..end].iter_mut().enumerate() {
            *sign = if before == 0.0 {
                next
            } else if number == 0 || before * next >= 0.0 {
                before
            } else if end - begin == 2 {
                next
            } else {
                0.0
            };
        }
        (begin, before) = (end, next);
    }
    signs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_up_and_down_is_approached_from_either_side() {
        let up_and_down = [0.0, 0.1, 0.2, 0.2, 0.1, 0.0, 0.0, 0.1];
        let signs = [1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0, 1.0];
        assert_eq!(last_moves(&up_and_down), signs);
    }

    #[test]
    fn readings_at_a_standstill_have_the_side_of_the_first() {
        assert_eq!(last_moves(&[0.0, 0.1, 0.1, 0.1, 0.2]), [1.0; 5]);
        let turning = last_moves(&[0.0, 0.1, 0.1, 0.1, 0.0]);
        assert_eq!(turning, [1.0, 1.0, 0.0, 0.0, -1.0]);
        assert!(last_moves(&[0.3; 4]).iter().all(|sign| *sign == 0.0));
    }
}
