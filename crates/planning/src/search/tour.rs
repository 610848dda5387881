//! Holds a symmetric path as a ring and improves it by sequential exchanges of up to [`DEPTH`] edges (Lin and
//! Kernighan 1973, in the form of Helsgaun's k-opt moves).
//!
//! The ring closes over the edge from the last point to the first, which is so cheap that no exchange removes it. An
//! exchange is judged by positions alone and carried out only when it shortens the ring: the longest stretch stays
//! where it is, the others are written anew. Every write is logged, so a refused kick is undone at the price of what
//! it changed.

use rand_pcg::Pcg32;
use rand_pcg::rand_core::RngCore;

use super::Kicked;
use super::grid::Grid;

/// Most edges one exchange removes.
const DEPTH: usize = 4;

/// Continuations followed after the first and after the second removed edge.
const BREADTH: [usize; DEPTH - 2] = [5, 3];

/// Near neighbours tried for the last edge of an exchange; before, all of them.
const FEW: usize = 7;

/// Random walks over near neighbours that look for the edges of a kick, and the steps of each.
const WALKS: usize = 12;
const STEPS: usize = 10;

/// A sequential exchange being built: removed edges as pairs of ends, in the order of removal.
#[derive(Clone, Copy)]
struct Exchange {
    edges: usize,
    ends: [u32; 2 * DEPTH],
}

/// Stretches of the ring in a new order; each is (first position, length, walked backwards).
struct Layout {
    edges: usize,
    stretches: [(u32, u32, bool); DEPTH],
}

pub(super) struct Tour<'a> {
    grid: &'a Grid,
    order: Vec<u32>,
    place: Vec<u32>,
    length: i64,
    queue: Vec<u32>,
    queued: Vec<bool>,
    log: Vec<(u32, u32)>,
    kept_length: i64,
    scratch: Vec<u32>,
}

impl<'a> Tour<'a> {
    pub(super) fn new(grid: &'a Grid, order: Vec<u32>) -> Self {
        let mut place = vec![0; grid.points()];
        for (at, &point) in order.iter().enumerate() {
            place[point as usize] = at as u32;
        }
        let length = grid.length(&order);
        Self {
            grid,
            queue: Vec::with_capacity(order.len()),
            queued: vec![false; order.len()],
            scratch: Vec::with_capacity(order.len()),
            order,
            place,
            length,
            log: Vec::new(),
            kept_length: length,
        }
    }

    fn next(&self, point: u32) -> u32 {
        let at = self.place[point as usize] as usize + 1;
        self.order[if at == self.order.len() { 0 } else { at }]
    }

    fn previous(&self, point: u32) -> u32 {
        let at = self.place[point as usize] as usize;
        self.order[if at == 0 {
            self.order.len() - 1
        } else {
            at - 1
        }]
    }

    fn push(&mut self, point: u32) {
        if !std::mem::replace(&mut self.queued[point as usize], true) {
            self.queue.push(point);
        }
    }

    /// Tries all exchanges that begin by removing an edge of this point.
    fn improve(&mut self, point: u32) -> bool {
        for other in [self.next(point), self.previous(point)] {
            let mut exchange = Exchange {
                edges: 0,
                ends: [0; 2 * DEPTH],
            };
            exchange.remove(point, other);
            if self.extend(&mut exchange, self.grid.cost(point, other)) {
                return true;
            }
        }
        false
    }

    /// Goes on from the open end with near neighbours: closes the ring when that shortens it, otherwise follows the
    /// few continuations that leave the most to gain.
    fn extend(&mut self, exchange: &mut Exchange, gain: i64) -> bool {
        let edges = exchange.edges;
        let first = exchange.ends[0];
        let open = exchange.ends[2 * edges - 1];
        let grid = self.grid;
        let (after, before) = (self.next(open), self.previous(open));
        let breadth = BREADTH.get(edges - 1).copied().unwrap_or(0);
        let mut promising = [(i64::MIN, 0, 0); BREADTH[0]];
        for &(near, cost) in grid
            .near(open)
            .iter()
            .take(if edges > 2 { FEW } else { usize::MAX })
        {
            let left = gain - i64::from(cost);
            if left <= 0 {
                break;
            }
            if near == after || near == before {
                continue;
            }
            for far in [self.next(near), self.previous(near)] {
                if exchange.removes(near, far) {
                    continue;
                }
                let total = left + grid.cost(near, far);
                let change = total - grid.cost(first, far);
                if change > 0 && far != first {
                    exchange.remove(near, far);
                    if self.close(exchange, change) {
                        return true;
                    }
                    exchange.edges = edges;
                }
                let mut at = breadth;
                while at > 0 && promising[at - 1].0 < total {
                    if at < breadth {
                        promising[at] = promising[at - 1];
                    }
                    at -= 1;
                }
                if at < breadth {
                    promising[at] = (total, near, far);
                }
            }
        }
        for &(total, near, far) in &promising[..breadth] {
            if total == i64::MIN {
                break;
            }
            exchange.remove(near, far);
            if self.extend(exchange, total) {
                return true;
            }
            exchange.edges = edges;
        }
        false
    }

    /// Carries out an exchange that shortens the ring by `gain`, unless the ring would fall into several.
    fn close(&mut self, exchange: &Exchange, gain: i64) -> bool {
        if !self.stays_one_ring(exchange) {
            return false;
        }
        let Some(layout) = self.layout(exchange) else {
            return false;
        };
        self.length -= gain;
        self.rewrite(&layout);
        for &point in &exchange.ends[..2 * exchange.edges] {
            self.push(point);
        }
        true
    }

    /// Judges exchanges of two and three edges by the order of their ends; larger ones are left to the layout.
    fn stays_one_ring(&self, exchange: &Exchange) -> bool {
        let [t1, t2, t3, t4, t5, t6, ..] = exchange.ends;
        let size = self.order.len() as u32;
        let forwards = self.next(t1) == t2;
        let begin = self.place[t2 as usize];
        // Places counted from t2 away from t1.
        let rank = |point: u32| {
            let at = self.place[point as usize];
            let steps = if forwards {
                at + size - begin
            } else {
                begin + size - at
            };
            if steps >= size { steps - size } else { steps }
        };
        let (r3, r4) = (rank(t3), rank(t4));
        match exchange.edges {
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
    fn layout(&self, exchange: &Exchange) -> Option<Layout> {
        let edges = exchange.edges;
        let size = self.order.len() as u32;
        let mut cuts = [0; DEPTH];
        for (edge, cut) in cuts[..edges].iter_mut().enumerate() {
            let [at_a, at_b] = [0, 1].map(|end| self.place[exchange.ends[2 * edge + end] as usize]);
            *cut = if self.next_place(at_a) == at_b {
                at_a
            } else {
                at_b
            };
        }
        let left = cuts;
        cuts[..edges].sort_unstable();
        // Stretch i lies between cut i and cut i+1; ends are numbered 2i (its first point) and 2i+1 (its last).
        let mut joined = [0_u8; 2 * DEPTH];
        let mut numbers = [0_u8; 2 * DEPTH];
        for edge in 0..edges {
            let cut = cuts[..edges].iter().position(|&cut| cut == left[edge])?;
            let a_is_left = self.place[exchange.ends[2 * edge] as usize] == left[edge];
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
            stretches: [(0, 0, false); DEPTH],
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

    fn next_place(&self, at: u32) -> u32 {
        if at as usize + 1 == self.order.len() {
            0
        } else {
            at + 1
        }
    }

    /// Writes the stretches in their new order behind the longest one, which stays.
    fn rewrite(&mut self, layout: &Layout) {
        let edges = layout.edges;
        let size = self.order.len();
        let stays = (0..edges)
            .max_by_key(|&i| layout.stretches[i].1)
            .unwrap_or(0);
        let (head, length, backwards) = layout.stretches[stays];
        self.scratch.clear();
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
                    self.scratch.extend_from_slice(&self.order[part]);
                }
            } else {
                for part in parts.into_iter().rev() {
                    self.scratch.extend(self.order[part].iter().rev());
                }
            }
        }
        let mut at = (head + length) as usize % size;
        for i in 0..self.scratch.len() {
            let point = self.scratch[i];
            if self.order[at] != point {
                self.log.push((at as u32, self.order[at]));
                self.order[at] = point;
                self.place[point as usize] = at as u32;
            }
            at = if at + 1 == size { 0 } else { at + 1 };
        }
    }

    fn improve_queue(&mut self) {
        while let Some(point) = self.queue.pop() {
            self.queued[point as usize] = false;
            while self.improve(point) {}
        }
    }

    /// Double bridge over a stretch of up to `span` places: three neighbouring stretches in the order 3, 2, 1.
    fn double_bridge(&mut self, rng: &mut Pcg32) {
        let size = self.order.len();
        let mut draw = |below: usize| ((u64::from(rng.next_u32()) * below as u64) >> 32) as usize;
        let centre = self.order[draw(size)];
        let mut places = [0; 4];
        let mut found = 0;
        for _ in 0..WALKS {
            let mut point = centre;
            for _ in 0..STEPS {
                let near = self.grid.near(point);
                if near.is_empty() {
                    break;
                }
                point = near[draw(near.len())].0;
            }
            let at = self.place[point as usize] as usize;
            if !places[..found].contains(&at) {
                places[found] = at;
                found += 1;
                if found == 4 {
                    break;
                }
            }
        }
        if found < 4 {
            return;
        }
        places.sort_unstable();
        let lengths = [0, 1, 2, 3].map(|i| (places[(i + 1) % 4] + size - places[i]) % size);
        let mut change = 0;
        let before = places.map(|at| self.order[(at + size - 1) % size]);
        let behind = places.map(|at| self.order[at]);
        for cut in 0..4 {
            if self.grid.cost(before[cut], behind[cut]) < 0 {
                return;
            }
            change -= self.grid.cost(before[cut], behind[cut]);
        }
        for (left, right) in [(0, 2), (3, 1), (2, 0), (1, 3)] {
            change += self.grid.cost(before[left], behind[right]);
        }
        let stretch = |i: usize| (places[i] as u32, lengths[i] as u32, false);
        let mut stretches = [(0, 0, false); DEPTH];
        for (at, which) in [3, 2, 1, 0].into_iter().enumerate() {
            stretches[at] = stretch(which);
        }
        self.rewrite(&Layout {
            edges: 4,
            stretches,
        });
        self.length += change;
        for point in before.into_iter().chain(behind) {
            self.push(point);
        }
    }
}

impl Kicked for Tour<'_> {
    fn order(&self) -> &[u32] {
        &self.order
    }

    fn length(&self) -> i64 {
        self.length
    }

    fn can_be_kicked(&self) -> bool {
        self.order.len() >= 8
    }

    fn improve_all(&mut self) {
        for at in (0..self.order.len()).rev() {
            self.push(self.order[at]);
        }
        self.improve_queue();
    }

    fn kick(&mut self, rng: &mut Pcg32) {
        self.log.clear();
        self.kept_length = self.length;
        self.double_bridge(rng);
        self.improve_queue();
    }

    fn revert(&mut self) {
        while let Some((at, point)) = self.log.pop() {
            self.order[at as usize] = point;
            self.place[point as usize] = at;
        }
        self.length = self.kept_length;
    }

    fn warmth(&self) -> (f64, f64) {
        (2.0, 0.05)
    }
}

impl Exchange {
    fn remove(&mut self, from: u32, to: u32) {
        self.ends[2 * self.edges] = from;
        self.ends[2 * self.edges + 1] = to;
        self.edges += 1;
    }

    fn removes(&self, a: u32, b: u32) -> bool {
        self.ends[..2 * self.edges]
            .chunks_exact(2)
            .any(|edge| edge == [a, b] || edge == [b, a])
    }
}
