//! Holds the path being improved, as an array with positions, and makes the moves.
//!
//! The first and the last place never change. A kick and the repairs after it touch a range of places only; the range
//! is copied when the kick begins, so a refused kick is undone by copying it back.

use rand_pcg::Pcg32;
use rand_pcg::rand_core::RngCore;

use super::Kicked;
use super::grid::Grid;

/// Longest stretch that a kick exchanges with its neighbour.
const KICK_SPAN: usize = 50;

/// Longest segment moved by Or-opt.
const SEGMENT: usize = 3;

pub(super) struct Directed<'a> {
    grid: &'a Grid,
    order: Vec<u32>,
    place: Vec<u32>,
    length: i64,
    /// For each place, cost of all moves up to it, walked backwards, minus walked forwards; empty when symmetric.
    turning: Vec<i64>,
    queue: Vec<u32>,
    queued: Vec<bool>,
    kept: Vec<u32>,
    kept_length: i64,
    /// Places changed since `mark`, first and last.
    touched: (usize, usize),
}

impl<'a> Directed<'a> {
    pub(super) fn new(grid: &'a Grid, order: Vec<u32>) -> Self {
        let mut place = vec![0; grid.points()];
        for (at, &point) in order.iter().enumerate() {
            place[point as usize] = at as u32;
        }
        let turning = if grid.is_symmetric() {
            Vec::new()
        } else {
            vec![0; order.len()]
        };
        let mut path = Self {
            grid,
            length: grid.length(&order),
            kept: order.clone(),
            kept_length: 0,
            queued: vec![false; grid.points()],
            queue: Vec::new(),
            touched: (usize::MAX, 0),
            order,
            place,
            turning,
        };
        path.retell(0);
        path
    }

    fn push(&mut self, at: usize) {
        let point = self.order[at];
        if !std::mem::replace(&mut self.queued[point as usize], true) {
            self.queue.push(point);
        }
    }

    fn cost(&self, from: usize, to: usize) -> i64 {
        self.grid.cost(self.order[from], self.order[to])
    }

    /// What walking the places `from..=to` backwards costs more than forwards.
    fn turn(&self, from: usize, to: usize) -> i64 {
        if self.turning.is_empty() {
            0
        } else {
            self.turning[to] - self.turning[from]
        }
    }

    fn improve(&mut self, point: u32) -> bool {
        self.try_turn(point) || self.try_insert(point) || self.try_exchange(point)
    }

    /// 2-opt: turns a stretch around so that `point` gets a near neighbour.
    fn try_turn(&mut self, point: u32) -> bool {
        let at = self.place[point as usize] as usize;
        let last = self.order.len() - 1;
        let grid = self.grid;
        // `point` keeps its place, its successor's stretch turns: at, (at+1 ..= there).
        for near in grid.after(point) {
            let there = self.place[near as usize] as usize;
            if at == last || grid.cost(point, near) >= self.cost(at, at + 1) && grid.is_symmetric()
            {
                break;
            }
            if there > at + 1 && there < last && self.turn_if_shorter(at + 1, there) {
                return true;
            }
        }
        // The mirror image: (there ..= at-1), at.
        for near in grid.before(point) {
            let there = self.place[near as usize] as usize;
            if at == 0 || grid.cost(near, point) >= self.cost(at - 1, at) && grid.is_symmetric() {
                break;
            }
            if there + 1 < at && there > 0 && self.turn_if_shorter(there, at - 1) {
                return true;
            }
        }
        false
    }

    fn turn_if_shorter(&mut self, from: usize, to: usize) -> bool {
        let change = self.cost(from - 1, to) + self.cost(from, to + 1)
            - self.cost(from - 1, from)
            - self.cost(to, to + 1)
            + self.turn(from, to);
        if change >= 0 {
            return false;
        }
        self.order[from..=to].reverse();
        self.length += change;
        self.settle(from, to);
        for at in [from - 1, from, to, to + 1] {
            self.push(at);
        }
        true
    }

    /// Or-opt: moves a segment that begins or ends with `point` beside a near neighbour, in either direction.
    fn try_insert(&mut self, point: u32) -> bool {
        let at = self.place[point as usize] as usize;
        let last = self.order.len() - 1;
        if at == 0 || at == last {
            return false;
        }
        let grid = self.grid;
        for size in 1..=SEGMENT {
            for (from, to) in [(at, at + size - 1), (at.wrapping_sub(size - 1), at)] {
                if from == 0 || from > at || to >= last {
                    continue;
                }
                for near in grid.before(point).chain(grid.after(point)) {
                    let there = self.place[near as usize] as usize;
                    if (there + 1 < from || there > to)
                        && there < last
                        && self.insert_if_shorter(from, to, there)
                    {
                        return true;
                    }
                    if (there < from || there > to + 1)
                        && there > 0
                        && self.insert_if_shorter(from, to, there - 1)
                    {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// Moves the places `from..=to` between `there` and `there + 1`, which lie outside.
    fn insert_if_shorter(&mut self, from: usize, to: usize, there: usize) -> bool {
        let closed = self.cost(from - 1, to + 1)
            - self.cost(from - 1, from)
            - self.cost(to, to + 1)
            - self.cost(there, there + 1);
        let straight = closed + self.cost(there, from) + self.cost(to, there + 1);
        let turned =
            closed + self.cost(there, to) + self.cost(from, there + 1) + self.turn(from, to);
        if straight.min(turned) >= 0 {
            return false;
        }
        let size = to - from + 1;
        if turned < straight {
            self.order[from..=to].reverse();
        }
        let (low, high, landed) = if there > to {
            self.order[from..=there].rotate_left(size);
            (from, there, there + 1 - size)
        } else {
            self.order[there + 1..=to].rotate_right(size);
            (there + 1, to, there + 1)
        };
        self.length += straight.min(turned);
        self.settle(low, high);
        for at in [
            low - 1,
            low,
            high,
            high + 1,
            landed - 1,
            landed,
            landed + size - 1,
            landed + size,
        ] {
            self.push(at);
        }
        true
    }

    /// Or-3opt: exchanges two neighbouring stretches without turning them, so that `point` gets a near successor.
    fn try_exchange(&mut self, point: u32) -> bool {
        let last = self.order.len() - 1;
        let grid = self.grid;
        let at = self.place[point as usize] as usize;
        if at == last {
            return false;
        }
        let gone = self.cost(at, at + 1);
        for near in grid.after(point) {
            let gain = gone - grid.cost(point, near);
            if gain <= 0 {
                break;
            }
            let second = self.place[near as usize] as usize;
            if second <= at + 1 {
                continue;
            }
            // at | at+1 .. second-1 | second .. third | third+1
            for before in grid.before(self.order[at + 1]) {
                let third = self.place[before as usize] as usize;
                if third < second || third >= last {
                    continue;
                }
                let change = self.cost(third, at + 1) + self.cost(second - 1, third + 1)
                    - self.cost(second - 1, second)
                    - self.cost(third, third + 1)
                    - gain;
                if change < 0 {
                    self.exchange(at + 1, second, third);
                    return true;
                }
            }
        }
        false
    }

    /// Exchanges the stretches `from..second` and `second..=to`.
    fn exchange(&mut self, from: usize, second: usize, to: usize) {
        let cut = second - from;
        let old = self.cost(from - 1, from) + self.cost(second - 1, second) + self.cost(to, to + 1);
        let new = self.cost(from - 1, second) + self.cost(to, from) + self.cost(second - 1, to + 1);
        self.order[from..=to].rotate_left(cut);
        self.length += new - old;
        self.settle(from, to);
        let landed = to + 1 - cut;
        for at in [from - 1, from, landed - 1, landed, to, to + 1] {
            self.push(at);
        }
    }

    /// Brings positions and sums up to date after the places `from..=to` changed.
    fn settle(&mut self, from: usize, to: usize) {
        for at in from..=to {
            self.place[self.order[at] as usize] = at as u32;
        }
        self.touched = (self.touched.0.min(from), self.touched.1.max(to));
        self.retell(from);
    }

    fn retell(&mut self, from: usize) {
        if self.turning.is_empty() {
            return;
        }
        for at in from.max(1)..self.order.len() {
            self.turning[at] = self.turning[at - 1] + self.cost(at, at - 1) - self.cost(at - 1, at);
        }
    }

    fn mark(&mut self) {
        if self.touched.0 <= self.touched.1 {
            let range = self.touched.0..=self.touched.1;
            self.kept[range.clone()].copy_from_slice(&self.order[range]);
        }
        self.kept_length = self.length;
        self.touched = (usize::MAX, 0);
    }

    fn improve_queue(&mut self) {
        while let Some(point) = self.queue.pop() {
            self.queued[point as usize] = false;
            while self.improve(point) {}
        }
    }
}

impl Kicked for Directed<'_> {
    fn order(&self) -> &[u32] {
        &self.order
    }

    fn length(&self) -> i64 {
        self.length
    }

    fn can_be_kicked(&self) -> bool {
        self.order.len() >= 5
    }

    fn improve_all(&mut self) {
        for &point in self.order.iter().rev() {
            self.queued[point as usize] = true;
            self.queue.push(point);
        }
        self.improve_queue();
    }

    /// Exchanges two neighbouring stretches of up to [`KICK_SPAN`] places.
    fn kick(&mut self, rng: &mut Pcg32) {
        self.mark();
        let inner = self.order.len() - 2;
        let total = inner.min(2 * KICK_SPAN);
        let mut draw = |below: usize| (rng.next_u64() % below as u64) as usize;
        let width = 2 + draw(total - 1);
        let from = 1 + draw(inner - width + 1);
        let cut = 1 + draw(width - 1);
        self.exchange(from, from + cut, from + width - 1);
        self.improve_queue();
    }

    fn revert(&mut self) {
        let (from, to) = self.touched;
        if from <= to {
            self.order[from..=to].copy_from_slice(&self.kept[from..=to]);
            self.length = self.kept_length;
            self.settle(from, to);
        }
    }

    fn warmth(&self) -> f64 {
        0.1
    }
}
