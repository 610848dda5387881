//! Improves a ring by sequences of exchanges of three edges, carried out one after the other as long as the sum of what
//! they remove exceeds what they add (Lin and Kernighan 1973, with the sequential 3-opt move of Helsgaun 2000 as its basis).
//!
//! Where an exchange does not pay by itself, the search goes on from the edge that closes the ring. The first two exchanges are
//! judged by positions alone, as one of five edges; only where they do not pay either are they carried out, then the next two, and
//! where none of a sequence pays, all of them are undone. Only the exchange that leaves most to gain is followed, so
//! that a sequence costs little and may be long.

use super::choice::Moves;
use super::exchange::{Exchange, closes};
use super::neighbours::Near;
use super::ring::{MOST, Ring};

/// Most exchanges of a sequence.
pub(super) const DEPTH: usize = 50;

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
            let mut freed = moves.cost(point, other);
            let mut start = Exchange::new(ring, point, other);
            for exchanged in 1..=EXCHANGES {
                let follows = exchanged < EXCHANGES;
                let found = if start.edges == 1 {
                    self.basis::<1>(moves, near, ring, &start, freed, follows)
                } else {
                    self.basis::<3>(moves, near, ring, &start, freed, follows)
                };
                let known = 2 * start.edges;
                match found {
                    Some(Found::Shorter { gain, exchange }) => {
                        ring.rearrange(&exchange.layout(ring));
                        self.ends
                            .extend_from_slice(&exchange.ends[known..2 * exchange.edges]);
                        return Some(gain);
                    }
                    Some(Found::Open { gain, exchange }) => {
                        let [from, near, far, next, end] =
                            std::array::from_fn(|at| exchange.ends[known - 1 + at]);
                        self.added.extend([edge(from, near), edge(far, next)]);
                        self.removed.extend([edge(near, far), edge(next, end)]);
                        self.ends.extend([near, far, next, end]);
                        (start, freed) = (exchange, gain);
                        if start.edges == MOST {
                            ring.rearrange(&start.layout(ring));
                            start = Exchange::new(ring, point, end);
                        }
                    }
                    None => break,
                }
            }
            ring.undo_to(begun);
        }
        None
    }

    /// The first exchange of up to two edges more than the `EDGES` removed that shortens the ring; if `follows`, otherwise the one
    /// that leaves most to gain. No edge is added that the sequence removed, nor removed that it added.
    fn basis<const EDGES: usize>(
        &self,
        moves: &impl Moves,
        near: &Near,
        ring: &Ring,
        start: &Exchange,
        freed: i64,
        follows: bool,
    ) -> Option<Found> {
        let [first, open] = [start.ends[0], start.ends[2 * EDGES - 1]];
        let mut most = i64::MIN;
        let mut followed = None;
        for one in Added::all(near, ring, open, freed) {
            for up in [false, true] {
                let Some((far, cut)) = start.beside(ring, one.near, up, EDGES) else {
                    continue;
                };
                let freed = one.left + moves.cost(one.near, far);
                if freed <= 0 {
                    continue;
                }
                let mut longer = *start;
                longer.remove(EDGES, [one.near, far], cut, up);
                if longer.closes() {
                    let gain = freed - moves.cost(first, far);
                    if gain > 0 {
                        let exchange = longer;
                        return Some(Found::Shorter { gain, exchange });
                    }
                }
                for other in Added::all(near, ring, far, freed) {
                    for up in [false, true] {
                        let Some((end, cut)) = longer.beside(ring, other.near, up, EDGES + 1)
                        else {
                            continue;
                        };
                        if !closes(EDGES + 2, longer.with(cut, up, EDGES + 1)) {
                            continue;
                        }
                        let freed = other.left + moves.cost(other.near, end);
                        let gain = freed - moves.cost(first, end);
                        if gain > 0 {
                            let mut exchange = longer;
                            exchange.remove(EDGES + 1, [other.near, end], cut, up);
                            return Some(Found::Shorter { gain, exchange });
                        }
                        if follows
                            && freed > most
                            && freed > moves.least(end)
                            && self.allows([open, one.near, far])
                            && self.allows([far, other.near, end])
                        {
                            most = freed;
                            let mut exchange = longer;
                            exchange.remove(EDGES + 1, [other.near, end], cut, up);
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
