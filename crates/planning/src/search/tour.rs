//! Holds a symmetric path as a ring and improves it by sequential exchanges of up to four edges (Lin and Kernighan
//! 1973, in the form of Helsgaun's k-opt moves). Where points have alternatives, other places are chosen about each
//! changed point, and a point may go elsewhere together with its place.
//!
//! The ring closes over the edge from the last point to the first, which is so cheap that no exchange removes it. A
//! kick exchanges neighbouring stretches of very different lengths: short ones mend details, long ones change in
//! which order clusters are visited.

use rand_pcg::Pcg32;
use rand_pcg::rand_core::RngCore;

use super::choice::Moves;
use super::exchange::Exchange;
use super::ring::{Layout, MOST, Ring};
use super::{Cooling, Kicked};

/// Room for the continuations after one removed edge.
const WIDEST: usize = 4;

/// Bounds of the longest stretch of a kick; it is drawn evenly in its logarithm.
const SPAN: (f64, f64) = (5.0, 100.0);

/// Most points that a kick visits at a random place.
const SHAKEN: usize = 2;

pub(super) struct Tour<M> {
    moves: M,
    ring: Ring,
    length: i64,
    kept_length: i64,
    queue: Vec<u32>,
    queued: Vec<bool>,
    /// Points whose place has just changed.
    changed: Vec<u32>,
}

impl<M: Moves> Tour<M> {
    /// Begins with the points in the order of their numbers, each at the place of the same number.
    pub(super) fn new(moves: M) -> Self {
        let order: Vec<u32> = (0..moves.grid().points() as u32).collect();
        Self::along(moves, &order)
    }

    /// Begins with this order of all points, each at the place of the same number.
    pub(super) fn along(moves: M, order: &[u32]) -> Self {
        let length = moves.grid().length(order);
        Self {
            moves,
            ring: Ring::new(order),
            length,
            kept_length: length,
            queue: Vec::with_capacity(order.len()),
            queued: vec![false; order.len()],
            changed: Vec::new(),
        }
    }

    fn push(&mut self, point: u32) {
        if !std::mem::replace(&mut self.queued[point as usize], true) {
            self.queue.push(point);
        }
    }

    fn improve_queue(&mut self) {
        while let Some(point) = self.queue.pop() {
            self.queued[point as usize] = false;
            while self.improve(point) || M::ALTERNATIVES && self.improve_place(point) {}
        }
    }

    /// Chooses other places about this point, or visits it elsewhere.
    fn improve_place(&mut self, point: u32) -> bool {
        let mut changed = std::mem::take(&mut self.changed);
        changed.clear();
        let gain = self.moves.choose_about(&self.ring, point, &mut changed);
        self.length -= gain;
        for &point in &changed {
            self.push_about(point);
        }
        self.changed = changed;
        gain > 0 || self.insert(point)
    }

    fn push_about(&mut self, point: u32) {
        for near in [self.ring.previous(point), point, self.ring.next(point)] {
            self.push(near);
        }
    }

    /// Takes a point out and puts it back, at any of its places, beside a point near that.
    fn insert(&mut self, point: u32) -> bool {
        let grid = self.moves.grid();
        let (before, behind) = (self.ring.previous(point), self.ring.next(point));
        let freed = self.moves.cost(before, point) + self.moves.cost(point, behind)
            - self.moves.cost(before, behind);
        let mut best = (0, 0, 0);
        for &place in &grid.rules.places_of[point as usize] {
            for &(near, least) in grid.near(place) {
                if i64::from(least) >= freed {
                    break;
                }
                let cost = grid.cost(place, self.moves.place(near));
                for (left, right) in [
                    (near, self.ring.next(near)),
                    (self.ring.previous(near), near),
                ] {
                    if left == point || right == point {
                        continue;
                    }
                    let other = if left == near { right } else { left };
                    let added = cost + grid.cost(place, self.moves.place(other))
                        - self.moves.cost(left, right);
                    if added - freed < best.0 {
                        best = (added - freed, left, place);
                    }
                }
            }
        }
        let (change, left, place) = best;
        if change >= 0 {
            return false;
        }
        self.length += change;
        self.moves.choose(point, place);
        self.ring.transfer(point, left);
        self.push_about(point);
        self.push(before);
        self.push(behind);
        true
    }

    /// Tries all exchanges that begin by removing an edge of this point.
    fn improve(&mut self, point: u32) -> bool {
        [self.ring.next(point), self.ring.previous(point)]
            .into_iter()
            .any(|other| {
                let mut exchange = Exchange::new(point, other);
                self.extend(&mut exchange, self.moves.cost(point, other))
            })
    }

    /// Goes on from the open end with near neighbours: closes the ring when that shortens it, otherwise follows the
    /// few continuations that leave the most to gain.
    fn extend(&mut self, exchange: &mut Exchange, gain: i64) -> bool {
        let edges = exchange.edges;
        let first = exchange.ends[0];
        let open = exchange.ends[2 * edges - 1];
        let (after, before) = (self.ring.next(open), self.ring.previous(open));
        let breadth = M::BREADTH.get(edges - 1).copied().unwrap_or(0);
        let mut promising = [(i64::MIN, 0, 0); WIDEST];
        for at in 0..self.moves.near(open).len() {
            let (near, least) = self.moves.near(open)[at];
            if gain <= i64::from(least) {
                break;
            }
            if near == after || near == before {
                continue;
            }
            let left = gain - self.moves.cost_to(open, near, least);
            if left <= 0 {
                continue;
            }
            for far in [self.ring.next(near), self.ring.previous(near)] {
                let total = left + self.moves.cost(near, far);
                if total <= self.moves.least(far) || exchange.removes(near, far) {
                    continue;
                }
                let change = total - self.moves.cost(first, far);
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
        if !exchange.may_stay_one_ring(&self.ring) {
            return false;
        }
        let Some(layout) = exchange.layout(&self.ring) else {
            return false;
        };
        self.length -= gain;
        self.ring.rearrange(&layout);
        for &point in &exchange.ends[..2 * exchange.edges] {
            self.push(point);
        }
        true
    }

    /// Double bridge: three neighbouring stretches in the order 3, 2, 1.
    fn double_bridge(&mut self, rng: &mut Pcg32) {
        let size = self.ring.len();
        let mut draw = |below: usize| ((u64::from(rng.next_u32()) * below as u64) >> 32) as usize;
        let part = draw(1 << 16) as f64 / f64::from(1 << 16);
        let span = (SPAN.0 * (SPAN.1 / SPAN.0).powf(part)) as usize;
        let mut at = draw(size);
        let mut places = [at; MOST];
        let mut lengths = [0; MOST];
        for stretch in 0..3 {
            lengths[stretch] = 1 + draw(span.min(size / MOST));
            at += lengths[stretch];
            places[stretch + 1] = at % size;
        }
        lengths[3] = places[0] + size - (at - usize::from(at >= size) * size);
        lengths[3] %= size;
        let before = places.map(|at| self.ring.at((at + size - 1) % size));
        let behind = places.map(|at| self.ring.at(at));
        let mut change = 0;
        for cut in 0..MOST {
            let cost = self.moves.cost(before[cut], behind[cut]);
            if cost < 0 {
                return;
            }
            change -= cost;
        }
        for (left, right) in [(0, 2), (3, 1), (2, 0), (1, 3)] {
            change += self.moves.cost(before[left], behind[right]);
        }
        let stretches = [3, 2, 1, 0].map(|i| (places[i] as u32, lengths[i] as u32, false));
        self.ring.rearrange(&Layout {
            edges: MOST,
            stretches,
        });
        self.length += change;
        for point in before.into_iter().chain(behind) {
            self.push(point);
        }
        if M::ALTERNATIVES {
            let wanted = draw(SHAKEN + 1);
            for _ in 0..wanted {
                let point = behind[draw(MOST)];
                let places = &self.moves.grid().rules.places_of[point as usize];
                self.visit(point, places[draw(places.len())]);
            }
        }
    }

    /// Visits a point at this place.
    fn visit(&mut self, point: u32, place: u32) {
        let (before, behind) = (self.ring.previous(point), self.ring.next(point));
        let about = |moves: &M| moves.cost(before, point) + moves.cost(point, behind);
        let old = about(&self.moves);
        self.moves.choose(point, place);
        self.length += about(&self.moves) - old;
        self.push_about(point);
    }
}

impl<M: Moves> Kicked for Tour<M> {
    fn write(&self, order: &mut Vec<u32>) {
        order.clear();
        order.extend(
            self.ring
                .order()
                .iter()
                .map(|&point| self.moves.place(point)),
        );
    }

    fn length(&self) -> i64 {
        self.length
    }

    fn can_be_kicked(&self) -> bool {
        self.ring.len() >= 8
    }

    fn improve_all(&mut self) {
        for at in (0..self.ring.len()).rev() {
            self.push(self.ring.at(at));
        }
        self.improve_queue();
    }

    fn kick(&mut self, rng: &mut Pcg32) {
        self.ring.keep();
        self.moves.keep();
        self.kept_length = self.length;
        self.double_bridge(rng);
        self.improve_queue();
    }

    fn revert(&mut self) {
        self.ring.undo();
        self.moves.undo();
        self.length = self.kept_length;
    }

    fn cooling(&self) -> Cooling {
        M::COOLING
    }
}
