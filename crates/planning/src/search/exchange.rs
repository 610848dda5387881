//! Decides whether removing a few edges of a ring and joining the ends anew leaves one ring, and what it looks like.
//!
//! An exchange is sequential: each added edge begins where the removed one before it ended (Lin and Kernighan 1973),
//! and the last added edge leads back to the beginning. Judged by positions alone, so nothing is changed to find out.

use super::ring::{Layout, MOST, Ring};

/// Removed edges as pairs of ends, in the order of removal.
#[derive(Clone, Copy)]
pub(super) struct Exchange {
    pub(super) edges: usize,
    pub(super) ends: [u32; 2 * MOST],
}

impl Exchange {
    pub(super) fn new(from: u32, to: u32) -> Self {
        let mut ends = [0; 2 * MOST];
        (ends[0], ends[1]) = (from, to);
        Self { edges: 1, ends }
    }

    pub(super) fn remove(&mut self, from: u32, to: u32) {
        self.ends[2 * self.edges] = from;
        self.ends[2 * self.edges + 1] = to;
        self.edges += 1;
    }

    pub(super) fn removes(&self, a: u32, b: u32) -> bool {
        self.ends[..2 * self.edges]
            .chunks_exact(2)
            .any(|edge| edge == [a, b] || edge == [b, a])
    }

    /// Judges exchanges of two and three edges by the order of their ends; larger ones are left to the layout.
    pub(super) fn may_stay_one_ring(&self, ring: &Ring) -> bool {
        let [t1, t2, t3, t4, t5, t6, ..] = self.ends;
        let size = ring.len() as u32;
        let forwards = ring.next(t1) == t2;
        let begin = ring.place(t2);
        // Places counted from t2 away from t1.
        let rank = |point: u32| {
            let at = ring.place(point);
            let steps = if forwards {
                at + size - begin
            } else {
                begin + size - at
            };
            if steps >= size { steps - size } else { steps }
        };
        let (r3, r4) = (rank(t3), rank(t4));
        match self.edges {
            2 => r4 < r3,
            3 => {
                let (r5, r6) = (rank(t5), rank(t6));
                if r4 > r3 {
                    r5 <= r3 && r6 <= r3
                } else if r5 >= r3 {
                    r6 < r5
                } else {
                    r6 > r5
                }
            }
            _ => true,
        }
    }

    /// The ring after the exchange is closed, or nothing when it would fall into several rings.
    pub(super) fn layout(&self, ring: &Ring) -> Option<Layout> {
        let edges = self.edges;
        let size = ring.len() as u32;
        let mut cuts = [0; MOST];
        for (edge, cut) in cuts[..edges].iter_mut().enumerate() {
            let [at_a, at_b] = [0, 1].map(|end| ring.place(self.ends[2 * edge + end]));
            *cut = if ring.next_place(at_a) == at_b {
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
            let cut = cuts[..edges].iter().position(|&cut| cut == left[edge])?;
            let a_is_left = ring.place(self.ends[2 * edge]) == left[edge];
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
            if enter == 0 && walked + 1 < edges {
                return None;
            }
        }
        (enter == 0).then_some(layout)
    }
}
