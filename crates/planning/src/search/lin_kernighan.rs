//! Improves a ring by sequences of exchanges of three edges, carried out one after the other as long as the sum of what
//! they remove exceeds what they add (Lin and Kernighan 1973, with the sequential 3-opt move of Helsgaun 2000 as its basis).
//!
//! An exchange that does not pay by itself is carried out nevertheless, and the search goes on from the edge that closes the
//! ring; where no exchange of a sequence pays, all of them are undone. Only the exchange that leaves most to gain is followed, so
//! that a sequence costs little and may be long.

use super::choice::Moves;
use super::exchange::{Exchange, closes};
use super::near::Near;
use super::ring::Ring;

/// Most exchanges of a sequence.
pub(super) const DEPTH: usize = 50;

/// Edges of the exchanges followed.
const BASIS: usize = 3;

/// The exchanges of a sequence so far.
#[derive(Default)]
pub(super) struct Sequence {
    added: Vec<(u32, u32)>,
    removed: Vec<(u32, u32)>,
    /// Ends of changed edges, after an improvement.
    ends: Vec<u32>,
}

/// An exchange, and what it removes less what it adds, the edge that closes the ring left out or included.
enum Found {
    Shorter { gain: i64, exchange: Exchange },
    Open { gain: i64, exchange: Exchange },
}

fn edge(one: u32, other: u32) -> (u32, u32) {
    (one.min(other), one.max(other))
}

impl Sequence {
    /// The ends of the edges changed by the last improvement.
    pub(super) fn ends(&self) -> &[u32] {
        &self.ends
    }

    /// Carries out a sequence of at most so many exchanges among these candidates that begins by removing an edge of this point and
    /// shortens the ring. Returns by how much, and [`Sequence::ends`] then are those of the edges changed; or leaves the ring as it
    /// was.
    pub(super) fn improve<const EXCHANGES: usize>(
        &mut self,
        moves: &impl Moves,
        near: &Near,
        ring: &mut Ring,
        point: u32,
    ) -> Option<i64> {
        for other in [ring.next(point), ring.previous(point)] {
            let begun = ring.changes();
            self.added.clear();
            self.removed.clear();
            self.removed.push(edge(point, other));
            self.ends.clear();
            self.ends.extend([point, other]);
            let (mut last, mut freed) = (other, moves.cost(point, other));
            for exchanged in 1..=EXCHANGES {
                let start = Exchange::new(ring, point, last);
                let follows = exchanged < EXCHANGES;
                match self.basis(moves, near, ring, &start, freed, follows) {
                    Some(Found::Shorter { gain, exchange }) => {
                        ring.rearrange(&exchange.layout(ring));
                        self.ends
                            .extend_from_slice(&exchange.ends[1..2 * exchange.edges]);
                        return Some(gain);
                    }
                    Some(Found::Open { gain, exchange }) => {
                        ring.rearrange(&exchange.layout(ring));
                        let [_, from, near, far, next, end, ..] = exchange.ends;
                        self.added.extend([edge(from, near), edge(far, next)]);
                        self.removed.extend([edge(near, far), edge(next, end)]);
                        self.ends.extend([near, far, next, end]);
                        (last, freed) = (end, gain);
                    }
                    None => break,
                }
            }
            ring.undo_to(begun);
        }
        None
    }

    /// The first exchange of up to three edges that shortens the ring; if `follows`, otherwise the one that leaves most to gain. No
    /// edge is added that the sequence removed, nor removed that it added.
    fn basis(
        &self,
        moves: &impl Moves,
        near: &Near,
        ring: &Ring,
        start: &Exchange,
        freed: i64,
        follows: bool,
    ) -> Option<Found> {
        let [first, open, ..] = start.ends;
        let mut most = i64::MIN;
        let mut followed = None;
        for one in Added::all(near, ring, open, freed) {
            for up in [false, true] {
                let Some(removed) = Removed::beside(ring, start, one.near, up) else {
                    continue;
                };
                let freed = one.left + moves.cost(one.near, removed.far);
                if freed <= 0 {
                    continue;
                }
                let mut two = *start;
                two.remove(1, [one.near, removed.far], removed.cut, up);
                if two.closes() {
                    let gain = freed - moves.cost(first, removed.far);
                    if gain > 0 {
                        let exchange = two;
                        return Some(Found::Shorter { gain, exchange });
                    }
                }
                for other in Added::all(near, ring, removed.far, freed) {
                    for up in [false, true] {
                        let Some(last) = Removed::beside(ring, &two, other.near, up) else {
                            continue;
                        };
                        if !closes(BASIS, two.with(last.cut, up, 2)) {
                            continue;
                        }
                        let freed = other.left + moves.cost(other.near, last.far);
                        let gain = freed - moves.cost(first, last.far);
                        if gain > 0 {
                            two.remove(2, [other.near, last.far], last.cut, up);
                            let exchange = two;
                            return Some(Found::Shorter { gain, exchange });
                        }
                        if follows
                            && freed > most
                            && freed > moves.least(last.far)
                            && self.allows([open, one.near, removed.far])
                            && self.allows([removed.far, other.near, last.far])
                        {
                            most = freed;
                            let mut exchange = two;
                            exchange.remove(2, [other.near, last.far], last.cut, up);
                            followed = Some(exchange);
                        }
                    }
                }
            }
        }
        followed.map(|exchange| Found::Open {
            gain: most,
            exchange,
        })
    }

    /// True where the first edge may be added and the second removed.
    fn allows(&self, [from, near, far]: [u32; 3]) -> bool {
        !self.removed.contains(&edge(from, near)) && !self.added.contains(&edge(near, far))
    }
}

/// An edge added from an open end to a near point.
struct Added {
    near: u32,
    /// What is removed so far less what is added, this edge included.
    left: i64,
}

impl Added {
    /// The edges that leave something of what was freed.
    #[inline]
    fn all(near: &Near, ring: &Ring, open: u32, freed: i64) -> impl Iterator<Item = Self> {
        let [before, after] = [ring.previous(open), ring.next(open)];
        near.of(open)
            .iter()
            .map(move |&(near, cost)| Self {
                near,
                left: freed - i64::from(cost),
            })
            .take_while(|edge| edge.left > 0)
            .filter(move |edge| edge.near != before && edge.near != after)
    }
}

/// The edge that is then removed, from the near point to its neighbour of next higher (`up`) or lower rank.
struct Removed {
    far: u32,
    cut: u32,
}

impl Removed {
    /// None where the exchange has removed it.
    #[inline]
    fn beside(ring: &Ring, exchange: &Exchange, near: u32, up: bool) -> Option<Self> {
        let size = ring.len() as u32;
        let rank = exchange.rank(ring.position(near), size);
        let cut = if up { rank } else { rank.wrapping_sub(1) };
        let cut = if cut < size { cut } else { size - 1 };
        if exchange.removes(cut, exchange.edges) {
            return None;
        }
        let far = if up == exchange.forwards {
            ring.next(near)
        } else {
            ring.previous(near)
        };
        Some(Self { far, cut })
    }
}
