//! Whether a stylus passes bodies on a move: the move is halved until what it is clear by is more than any of its points
//! moves.

use nalgebra::Point3;

use super::{
    SAME,
    body::Body,
    stylus::{Stylus, StylusPose},
};

/// Two positions of the stylus nearer than this to each other stand for the move between them, m.
const RESOLUTION: f64 = 1e-4;
/// A move that turns the stylus by more is halved whatever it is clear by, rad: what turns is off its chord by 1/80 of
/// the chord at most.
const TURN: f64 = 0.1;
/// The same where it is known how far the move leaves its chord.
const FAR_TURN: f64 = 1.5;
/// Most positions looked at on one move; a move that needs more is too near to a body all along.
const MAX_POSITIONS: u32 = 20_000;

/// A move of the stylus that can be halved.
pub(super) trait Move {
    /// A position on the move.
    type At;
    /// The position half-way between two.
    fn middle(&self, from: &Self::At, to: &Self::At) -> Self::At;
    /// Where the stylus is there.
    fn stylus(&self, at: &Self::At) -> StylusPose;
    /// How far the stylus may turn between two positions, rad.
    fn turn(&self, from: &Self::At, to: &Self::At) -> f64;
    /// How far it may leave its chord there, m, where turns about distant axes make that more than what its own turn does:
    /// such a move may turn it farther before it is halved.
    fn sagitta(&self, _from: &Self::At, _to: &Self::At) -> Option<f64> {
        None
    }
}

/// A move of the stylus along a straight line, without turning.
struct Translation;

impl Move for Translation {
    type At = StylusPose;

    fn middle(&self, from: &StylusPose, to: &StylusPose) -> StylusPose {
        [0, 1].map(|point| nalgebra::center(&from[point], &to[point]))
    }

    fn stylus(&self, at: &StylusPose) -> StylusPose {
        *at
    }

    fn turn(&self, _from: &StylusPose, _to: &StylusPose) -> f64 {
        0.0
    }
}

/// True when a stylus that moves along a straight line without turning keeps everywhere the least clearance (m) from each
/// body; what it is at its ends is seen to within a micrometre.
pub fn passes(
    stylus: &Stylus,
    bodies: &[Body],
    least: &[f64],
    [from, to]: [&StylusPose; 2],
) -> bool {
    let passage = Passage {
        stylus,
        bodies,
        least,
    };
    passage.is_clear(&Translation, from, to)
}

/// Bodies to be passed, and the least clearance from each, m.
pub(super) struct Passage<'a> {
    pub(super) stylus: &'a Stylus,
    pub(super) bodies: &'a [Body],
    pub(super) least: &'a [f64],
}

/// The stylus at a position, and what it is clear by more than it must be, m.
type Seen = (StylusPose, f64);

impl Passage<'_> {
    /// True when the stylus passes all bodies between two positions.
    pub(super) fn is_clear<M: Move>(&self, move_: &M, from: &M::At, to: &M::At) -> bool {
        let ends = [from, to].map(|at| self.look(move_, at));
        let mut budget = MAX_POSITIONS;
        self.halve(move_, [from, to], [&ends[0], &ends[1]], &mut budget)
    }

    fn look<M: Move>(&self, move_: &M, at: &M::At) -> Seen {
        let pose = move_.stylus(at);
        let mut spare = f64::INFINITY;
        for (body, least) in self.bodies.iter().zip(self.least) {
            let clear = (self.stylus).clearance_up_to(spare + least, body, &pose);
            spare = spare.min(clear - least);
            if spare < -SAME {
                break;
            }
        }
        (pose, spare)
    }

    fn halve<M: Move>(
        &self,
        move_: &M,
        [from, to]: [&M::At; 2],
        seen: [&Seen; 2],
        budget: &mut u32,
    ) -> bool {
        let spare = seen.map(|seen| seen.1);
        if spare[0] < -SAME || spare[1] < -SAME {
            return false;
        }
        let distance = |a: &Point3<f64>, b: &Point3<f64>| (a - b).norm();
        let moved = distance(&seen[0].0[0], &seen[1].0[0]);
        let moved = moved.max(distance(&seen[0].0[1], &seen[1].0[1]));
        let turn = move_.turn(from, to);
        // What leaves its chord by no more than the resolution is on it.
        let sagitta = move_.sagitta(from, to);
        let off = sagitta.map_or(0.0, |off| 2.0 * (off - RESOLUTION).max(0.0));
        let most = if sagitta.is_some() { FAR_TURN } else { TURN };
        let near = moved + off <= RESOLUTION || spare[0] + spare[1] >= moved + off;
        if near && turn <= most {
            return true;
        }
        if *budget == 0 {
            return false;
        }
        *budget -= 1;
        let middle = move_.middle(from, to);
        let half = self.look(move_, &middle);
        self.halve(move_, [from, &middle], [seen[0], &half], budget)
            && self.halve(move_, [&middle, to], [&half, seen[1]], budget)
    }
}
