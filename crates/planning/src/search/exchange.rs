//! Decides whether removing a few edges of a ring and joining the ends anew leaves one ring, and what it looks like.
//!
//! An exchange is sequential: each added edge begins where the removed one before it ended (Lin and Kernighan 1973),
//! and the last added edge leads back to the beginning. Judged by positions alone, so nothing is changed to find out.

use super::ring::{Layout, MOST, Ring};

/// Removed edges as pairs of ends, in the order of removal. Points are ranked from the second end, away from the first.
#[derive(Clone, Copy)]
pub(super) struct Exchange {
    pub(super) edges: usize,
    pub(super) ends: [u32; 2 * MOST],
    /// True where ranks rise with the positions of the ring.
    forwards: bool,
    /// Position of rank zero.
    begin: u32,
    /// Rank of the lower end of each removed edge.
    cuts: [u32; MOST],
    /// How the removed edges lie to each other, as [`Exchange::with`] writes it.
    signature: u32,
}

impl Exchange {
    pub(super) fn new(ring: &Ring, from: u32, to: u32) -> Self {
        let mut ends = [0; 2 * MOST];
        (ends[0], ends[1]) = (from, to);
        let mut cuts = [0; MOST];
        cuts[0] = ring.len() as u32 - 1;
        Self {
            edges: 1,
            ends,
            forwards: ring.next(from) == to,
            begin: ring.position(to),
            cuts,
            signature: 0,
        }
    }

    /// Rank of the point at this position, in a ring of `size` points.
    #[inline]
    fn rank(&self, position: u32, size: u32) -> u32 {
        let steps = if self.forwards {
            position.wrapping_sub(self.begin)
        } else {
            self.begin.wrapping_sub(position)
        };
        if steps < size {
            steps
        } else {
            steps.wrapping_add(size)
        }
    }

    /// The neighbour of next higher (`up`) or lower rank of a point, and the cut between them; none where that edge is among the
    /// first `edges` removed ones.
    #[inline]
    pub(super) fn beside(
        &self,
        ring: &Ring,
        point: u32,
        up: bool,
        edges: usize,
    ) -> Option<(u32, u32)> {
        let size = ring.len() as u32;
        let rank = self.rank(ring.position(point), size);
        let cut = if up { rank } else { rank.wrapping_sub(1) };
        let cut = if cut < size { cut } else { size - 1 };
        if self.cuts[..edges].contains(&cut) {
            return None;
        }
        let neighbour = if up == self.forwards {
            ring.next(point)
        } else {
            ring.previous(point)
        };
        Some((neighbour, cut))
    }

    /// The signature with one more edge removed, from a point to the next higher rank (`up`) or the next lower: bits for
    /// the directions, and for which edge lies below which.
    #[inline]
    pub(super) fn with(&self, cut: u32, up: bool, edges: usize) -> u32 {
        let first = bits(edges);
        let known = self.signature & ((1 << first) - 1);
        (1..edges).fold(known | u32::from(up) << first, |signature, edge| {
            signature | u32::from(cut < self.cuts[edge]) << (first + edge)
        })
    }

    #[inline]
    pub(super) fn remove(&mut self, edges: usize, ends: [u32; 2], cut: u32, up: bool) {
        self.signature = self.with(cut, up, edges);
        [self.ends[2 * edges], self.ends[2 * edges + 1]] = ends;
        self.cuts[edges] = cut;
        self.edges = edges + 1;
    }

    /// True when closing the exchange leaves one ring.
    #[inline]
    pub(super) fn closes(&self) -> bool {
        closes(self.edges, self.signature)
    }

    /// The ring after the exchange is closed, which leaves one ring.
    pub(super) fn layout(&self, ring: &Ring) -> Layout {
        let edges = self.edges;
        let size = ring.len() as u32;
        let mut cuts = [0; MOST];
        for (edge, cut) in cuts[..edges].iter_mut().enumerate() {
            let [at_a, at_b] = [0, 1].map(|end| ring.position(self.ends[2 * edge + end]));
            *cut = if ring.next_position(at_a) == at_b {
                at_a
            } else {
                at_b
            };
        }
        let left = cuts;
        cuts[..edges].sort_unstable();
        // Stretch i lies between cut i and cut i+1; ends are numbered 2i (its first point) and 2i+1 (its last).
        let mut joined = [0_u8; 2 * MOST];
        let mut numbers = [0_u8; 2 * MOST];
        for edge in 0..edges {
            let cut = cuts[..edges].partition_point(|&cut| cut < left[edge]);
            let a_is_left = ring.position(self.ends[2 * edge]) == left[edge];
            let last = (2 * ((cut + edges - 1) % edges) + 1) as u8;
            let head = (2 * cut) as u8;
            (numbers[2 * edge], numbers[2 * edge + 1]) = if a_is_left {
                (last, head)
            } else {
                (head, last)
            };
        }
        for edge in 0..edges {
            let (a, b) = (numbers[2 * edge + 1], numbers[(2 * edge + 2) % (2 * edges)]);
            joined[a as usize] = b;
            joined[b as usize] = a;
        }
        let mut layout = Layout {
            edges,
            stretches: [(0, 0, false); MOST],
        };
        let mut enter = 0_u8;
        for walked in 0..edges {
            let stretch = enter as usize / 2;
            let head = (cuts[stretch] + 1) % size;
            let tail = cuts[(stretch + 1) % edges];
            let length = (tail + size - head) % size + 1;
            layout.stretches[walked] = (head, length, enter % 2 == 1);
            enter = joined[(enter ^ 1) as usize];
        }
        layout
    }
}

/// Bits of the signature of so many removed edges: of each after the first its direction, and whether it lies below each
/// one between the first and itself.
const fn bits(edges: usize) -> usize {
    edges * (edges - 1) / 2
}

/// Words of a bit for each signature.
const WORDS: usize = (1 << bits(MOST)) / 64;

/// Which signatures of so many removed edges leave one ring.
static CLOSES: [[u64; WORDS]; MOST + 1] = {
    let mut closes = [[0; WORDS]; MOST + 1];
    let mut edges = 2;
    while edges <= MOST {
        let mut signature = 0;
        while signature < 1 << bits(edges) {
            if leaves_one_ring(edges, signature) {
                closes[edges][signature / 64] |= 1 << (signature % 64);
            }
            signature += 1;
        }
        edges += 1;
    }
    closes
};

/// True when an exchange of so many edges with this signature leaves one ring.
#[inline]
pub(super) fn closes(edges: usize, signature: u32) -> bool {
    CLOSES[edges][signature as usize / 64] >> (signature % 64) & 1 == 1
}

/// Walks the stretches between the removed edges. Their ends are numbered 2i (the lower) and 2i+1 (the higher).
const fn leaves_one_ring(edges: usize, signature: usize) -> bool {
    // How many removed edges lie below each one, the first left out.
    let mut below = [0; MOST];
    let mut edge = 1;
    while edge < edges {
        let mut other = 1;
        while other < edge {
            let is_below = signature >> (bits(edge) + other) & 1;
            below[edge] += 1 - is_below;
            below[other] += is_below;
            other += 1;
        }
        edge += 1;
    }
    let mut joined = [0; 2 * MOST];
    let mut open = 0;
    let mut edge = 1;
    while edge < edges {
        let (low, high) = (2 * below[edge] + 1, 2 * below[edge] + 2);
        let up = signature >> bits(edge) & 1 == 1;
        let (near, far) = if up { (low, high) } else { (high, low) };
        (joined[open], joined[near]) = (near, open);
        open = far;
        edge += 1;
    }
    let first = 2 * edges - 1;
    (joined[open], joined[first]) = (first, open);
    let mut end = joined[1];
    let mut walked = 1;
    while end != 0 && walked < edges {
        end = joined[end ^ 1];
        walked += 1;
    }
    end == 0 && walked == edges
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Removes edges of a ring of `size` points at every choice of positions and directions, and asks `closes` and
    /// `layout` against a walk along the edges that then are there.
    fn compare(ring: &Ring, exchange: Exchange, seen: &mut [usize; 2]) {
        let size = ring.len();
        if exchange.edges >= 2 {
            let joined = walk(ring, &exchange);
            let closes = closes(exchange.edges, exchange.signature);
            assert_eq!(closes, joined.len() == size, "{:?}", exchange.ends);
            seen[usize::from(closes)] += 1;
            if closes {
                let mut after = Ring::new(ring.order());
                after.rearrange(&exchange.layout(ring));
                assert!((0..size as u32).all(|point| {
                    let found = [after.previous(point), after.next(point)];
                    let expected = neighbours(ring, &exchange, point);
                    expected == found || expected == [found[1], found[0]]
                }));
            }
        }
        if exchange.edges == MOST {
            return;
        }
        for near in 0..size as u32 {
            for up in [true, false] {
                if let Some((far, cut)) = exchange.beside(ring, near, up, exchange.edges) {
                    let mut next = exchange;
                    next.remove(exchange.edges, [near, far], cut, up);
                    compare(ring, next, seen);
                }
            }
        }
    }

    /// Both neighbours of a point once the exchange is closed: those of the ring, each removed edge replaced.
    fn neighbours(ring: &Ring, exchange: &Exchange, point: u32) -> [u32; 2] {
        let ends = &exchange.ends[..2 * exchange.edges];
        [ring.previous(point), ring.next(point)].map(|adjacent| {
            let removed = |at: &usize| ends[*at] == point && ends[*at ^ 1] == adjacent;
            (0..ends.len()).find(removed).map_or(adjacent, |at| {
                let other = if at % 2 == 1 {
                    at + 1
                } else {
                    at + ends.len() - 1
                };
                ends[other % ends.len()]
            })
        })
    }

    /// The points on the ring of point 0, walked edge by edge.
    fn walk(ring: &Ring, exchange: &Exchange) -> Vec<u32> {
        let mut walked = vec![0];
        let mut before = u32::MAX;
        loop {
            let here = walked[walked.len() - 1];
            let [one, other] = neighbours(ring, exchange, here);
            let next = if one == before { other } else { one };
            if next == 0 || walked.contains(&next) {
                return walked;
            }
            before = here;
            walked.push(next);
        }
    }

    #[test]
    fn tells_what_a_walk_along_the_edges_tells() {
        let ring = Ring::new(&[3, 0, 5, 2, 6, 1, 4]);
        let mut seen = [0; 2];
        for (from, to) in [(0, 5), (5, 0), (4, 3)] {
            compare(&ring, Exchange::new(&ring, from, to), &mut seen);
        }
        assert!(seen.iter().all(|&seen| seen > 500), "{seen:?}");
    }
}
