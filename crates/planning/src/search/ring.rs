//! Holds a ring of points as an array with positions, and writes rearranged stretches of it so that they can be undone.
//!
//! The longest stretch of a rearrangement stays where it is, the others are written anew; every write is logged, so
//! going back costs what was changed.

/// Most stretches a rearrangement has.
pub(super) const MOST: usize = 5;

/// Stretches of the ring in a new order; each is (first position, length, walked backwards).
#[derive(Clone, Copy)]
pub(super) struct Layout {
    pub(super) edges: usize,
    pub(super) stretches: [(u32, u32, bool); MOST],
}

pub(super) struct Ring {
    /// The points, with the last one again in front and the first one again behind: a neighbour is found without
    /// asking for the end.
    padded: Vec<u32>,
    position: Vec<u32>,
    log: Vec<(u32, u32)>,
    scratch: Vec<u32>,
}

impl Ring {
    /// `order` holds every number below its length once.
    pub(super) fn new(order: &[u32]) -> Self {
        let mut position = vec![0; order.len()];
        for (at, &point) in order.iter().enumerate() {
            position[point as usize] = at as u32;
        }
        let ends = [order.last(), order.first()].map(|end| end.copied().unwrap_or(0));
        let mut padded = vec![ends[0]];
        padded.extend_from_slice(order);
        padded.push(ends[1]);
        Self {
            padded,
            position,
            log: Vec::new(),
            scratch: Vec::with_capacity(order.len()),
        }
    }

    pub(super) fn order(&self) -> &[u32] {
        &self.padded[1..=self.position.len()]
    }

    pub(super) fn len(&self) -> usize {
        self.position.len()
    }

    pub(super) fn position(&self, point: u32) -> u32 {
        self.position[point as usize]
    }

    pub(super) fn at(&self, position: usize) -> u32 {
        self.padded[position + 1]
    }

    #[inline]
    pub(super) fn next(&self, point: u32) -> u32 {
        self.padded[self.position[point as usize] as usize + 2]
    }

    #[inline]
    pub(super) fn previous(&self, point: u32) -> u32 {
        self.padded[self.position[point as usize] as usize]
    }

    pub(super) fn next_position(&self, at: u32) -> u32 {
        if at as usize + 1 == self.len() {
            0
        } else {
            at + 1
        }
    }

    /// Forgets how to go back.
    pub(super) fn keep(&mut self) {
        self.log.clear();
    }

    /// Goes back to the order at the last [`Ring::keep`].
    pub(super) fn undo(&mut self) {
        self.undo_to(0);
    }

    /// Writes since the last [`Ring::keep`].
    pub(super) fn changes(&self) -> usize {
        self.log.len()
    }

    /// Goes back to the order after so many writes.
    pub(super) fn undo_to(&mut self, changes: usize) {
        for at in (changes..self.log.len()).rev() {
            let (position, point) = self.log[at];
            self.write(position as usize, point);
        }
        self.log.truncate(changes);
    }

    fn write(&mut self, at: usize, point: u32) {
        self.padded[at + 1] = point;
        self.position[point as usize] = at as u32;
        if at == 0 {
            let end = self.padded.len() - 1;
            self.padded[end] = point;
        }
        if at + 1 == self.position.len() {
            self.padded[0] = point;
        }
    }

    /// Moves a point behind another one, which is neither itself nor already before it.
    pub(super) fn transfer(&mut self, point: u32, left: u32) {
        let size = self.len() as u32;
        let [from, to] = [point, left].map(|point| self.position(point));
        let between = (to + size - from) % size;
        let stretches = [
            (self.next_position(from), between, false),
            (from, 1, false),
            (self.next_position(to), size - 1 - between, false),
            (0, 0, false),
            (0, 0, false),
        ];
        self.rearrange(&Layout {
            edges: 3,
            stretches,
        });
    }

    /// Writes the stretches in their new order behind the longest one, which stays.
    pub(super) fn rearrange(&mut self, layout: &Layout) {
        let edges = layout.edges;
        let size = self.len();
        let stays = (0..edges)
            .max_by_key(|&i| layout.stretches[i].1)
            .unwrap_or(0);
        let (head, length, backwards) = layout.stretches[stays];
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.clear();
        let order = self.order();
        for step in 1..edges {
            let which = if backwards {
                stays + edges - step
            } else {
                stays + step
            } % edges;
            let (from, count, reversed) = layout.stretches[which];
            let (from, count) = (from as usize, count as usize);
            let first_part = count.min(size - from);
            let parts = [from..from + first_part, 0..count - first_part];
            if reversed == backwards {
                for part in parts {
                    scratch.extend_from_slice(&order[part]);
                }
            } else {
                for part in parts.into_iter().rev() {
                    scratch.extend(order[part].iter().rev());
                }
            }
        }
        let mut at = (head + length) as usize % size;
        for &point in &scratch {
            let old = self.padded[at + 1];
            if old != point {
                self.log.push((at as u32, old));
                self.write(at, point);
            }
            at = if at + 1 == size { 0 } else { at + 1 };
        }
        self.scratch = scratch;
    }
}
