//! Holds a path whose direction matters, as an array with positions: asymmetric costs, stages, precedence, and points
//! with alternative poses.
//!
//! Moves: 2-opt, Or-opt (segments up to three points, both directions), exchange of two neighbouring stretches
//! (Or-3opt), and another pose for a point. The first and the last position never change. What walking a stretch
//! backwards costs comes from running sums. Stages never fall along the path, so a stretch may be rearranged only
//! within one stage. Where points have alternatives, the best poses for the stretch that a kick changed are found by
//! dynamic programming through its layers. A refused kick is undone by copying back the positions it touched.

use rand_pcg::Pcg32;
use rand_pcg::rand_core::RngCore;

use super::integer_costs::IntegerCosts;
use super::{Cooling, Kicked, Path};

/// Longest stretch that a kick rearranges.
const KICK_SPAN: usize = 50;

/// Most exchanges of a kick.
const KICK_EXCHANGES: usize = 2;

/// Random exchanges drawn until enough keep the rules.
const KICK_DRAWS: usize = 20;

/// Longest segment moved by Or-opt.
const SEGMENT: usize = 3;

pub(super) struct Directed<'a> {
    grid: &'a IntegerCosts,
    order: Vec<u32>,
    /// Position of each point.
    position: Vec<u32>,
    length: i64,
    /// For each position, cost of all moves up to it, walked backwards, minus walked forwards; empty when symmetric.
    turning: Vec<i64>,
    /// Points to be looked at.
    queue: Vec<u32>,
    queued: Vec<bool>,
    kept: Vec<u32>,
    kept_length: i64,
    /// Positions changed since the kick, first and last.
    touched: (usize, usize),
}

impl<'a> Directed<'a> {
    pub(super) fn new(grid: &'a IntegerCosts, order: Vec<u32>) -> Self {
        let mut path = Self {
            grid,
            length: grid.length(&order),
            kept: order.clone(),
            kept_length: 0,
            position: vec![0; order.len()],
            queued: vec![false; order.len()],
            queue: Vec::new(),
            touched: (usize::MAX, 0),
            turning: if grid.is_symmetric() {
                Vec::new()
            } else {
                vec![0; order.len()]
            },
            order,
        };
        path.settle(0, path.order.len() - 1);
        path.touched = (usize::MAX, 0);
        path
    }

    fn point_at(&self, at: usize) -> u32 {
        self.grid.rules.point_of[self.order[at] as usize]
    }

    fn position_of(&self, pose: u32) -> usize {
        self.position[self.grid.rules.point_of[pose as usize] as usize] as usize
    }

    fn push(&mut self, at: usize) {
        let point = self.point_at(at);
        if !std::mem::replace(&mut self.queued[point as usize], true) {
            self.queue.push(point);
        }
    }

    fn cost(&self, from: usize, to: usize) -> i64 {
        self.grid.cost(self.order[from], self.order[to])
    }

    /// What walking the positions `from..=to` backwards costs more than forwards.
    fn turn(&self, from: usize, to: usize) -> i64 {
        if self.turning.is_empty() {
            0
        } else {
            self.turning[to] - self.turning[from]
        }
    }

    /// True when the rules let the positions `from..=to` be walked backwards.
    fn may_turn(&self, from: usize, to: usize) -> bool {
        let rules = &self.grid.rules;
        let inside = |point: &u32| (from..=to).contains(&(self.position[*point as usize] as usize));
        rules.free
            || self.one_stage(from, to)
                && (from..=to).all(|at| !rules.later[self.point_at(at) as usize].iter().any(inside))
    }

    /// True when the rules let the stretches `from..second` and `second..=to` swap.
    fn may_exchange(&self, from: usize, second: usize, to: usize) -> bool {
        let rules = &self.grid.rules;
        if rules.free {
            return true;
        }
        let none =
            |inner: std::ops::Range<usize>, lists: &[Vec<u32>], other: std::ops::Range<usize>| {
                inner.into_iter().all(|at| {
                    let points = &lists[self.point_at(at) as usize];
                    !points
                        .iter()
                        .any(|&point| other.contains(&(self.position[point as usize] as usize)))
                })
            };
        self.one_stage(from, to)
            && if second - from < to + 1 - second {
                none(from..second, &rules.later, second..to + 1)
            } else {
                none(second..to + 1, &rules.earlier, from..second)
            }
    }

    fn one_stage(&self, from: usize, to: usize) -> bool {
        let stage = &self.grid.rules.stage;
        stage[self.point_at(from) as usize] == stage[self.point_at(to) as usize]
    }

    fn improve(&mut self, point: u32) -> bool {
        let at = self.position[point as usize] as usize;
        self.try_turn(at) || self.try_insert(at) || self.try_exchange(at) || self.try_poses(point)
    }

    /// 2-opt: turns a stretch around so that this position gets a near neighbour.
    fn try_turn(&mut self, at: usize) -> bool {
        let last = self.order.len() - 1;
        let grid = self.grid;
        let pose = self.order[at];
        if at < last {
            for near in grid.after(pose) {
                let there = self.position_of(near);
                if there > at + 1 && there < last && self.turn_if_shorter(at + 1, there) {
                    return true;
                }
            }
        }
        if at > 0 {
            for near in grid.before(pose) {
                let there = self.position_of(near);
                if there > 0 && there + 1 < at && self.turn_if_shorter(there, at - 1) {
                    return true;
                }
            }
        }
        false
    }

    fn turn_if_shorter(&mut self, from: usize, to: usize) -> bool {
        let change = self.cost(from - 1, to) + self.cost(from, to + 1)
            - self.cost(from - 1, from)
            - self.cost(to, to + 1)
            + self.turn(from, to);
        if change >= 0 || !self.may_turn(from, to) {
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

    /// Or-opt: moves a segment that begins or ends here next to a near neighbour, in either direction.
    fn try_insert(&mut self, at: usize) -> bool {
        let last = self.order.len() - 1;
        if at == 0 || at == last {
            return false;
        }
        let grid = self.grid;
        let pose = self.order[at];
        for size in 1..=SEGMENT.min(last - 1) {
            for (from, to) in [(at, at + size - 1), ((at + 1).saturating_sub(size), at)] {
                if from == 0 || to >= last {
                    continue;
                }
                for near in grid.before(pose).chain(grid.after(pose)) {
                    let there = self.position_of(near);
                    for gap in [there, there.wrapping_sub(1)] {
                        if gap < last
                            && (gap + 1 < from || gap > to)
                            && self.insert_if_shorter(from, to, gap)
                        {
                            return true;
                        }
                    }
                }
            }
        }
        false
    }

    /// Moves the positions `from..=to` between `gap` and `gap + 1`, which lie outside.
    fn insert_if_shorter(&mut self, from: usize, to: usize, gap: usize) -> bool {
        let closed = self.cost(from - 1, to + 1)
            - self.cost(from - 1, from)
            - self.cost(to, to + 1)
            - self.cost(gap, gap + 1);
        let straight = closed + self.cost(gap, from) + self.cost(to, gap + 1);
        let turned = closed + self.cost(gap, to) + self.cost(from, gap + 1) + self.turn(from, to);
        if straight.min(turned) >= 0 {
            return false;
        }
        let (low, second, high) = if gap > to {
            (from, to + 1, gap)
        } else {
            (gap + 1, from, to)
        };
        if !self.may_exchange(low, second, high) {
            return false;
        }
        let turn = turned < straight && self.may_turn(from, to);
        let change = if turn { turned } else { straight };
        if change >= 0 {
            return false;
        }
        if turn {
            self.order[from..=to].reverse();
        }
        self.order[low..=high].rotate_left(second - low);
        self.length += change;
        self.settle(low, high);
        let middle = low + high + 1 - second;
        for at in [low - 1, low, middle - 1, middle, high, high + 1] {
            self.push(at);
        }
        true
    }

    /// Or-3opt: exchanges two neighbouring stretches without turning them, so that this position gets a near
    /// successor; its move may become the one into the second stretch, out of the first, or out of the second.
    fn try_exchange(&mut self, at: usize) -> bool {
        let last = self.order.len() - 1;
        if at == last {
            return false;
        }
        let grid = self.grid;
        let gone = self.cost(at, at + 1);
        for &(near, cost) in grid.near(self.order[at]) {
            let there = self.position_of(near);
            if i64::from(cost) >= gone && !grid.rules.alternatives {
                break;
            }
            let found = self.exchanges(at, there).find(|&cuts| self.shortens(cuts));
            if let Some((from, second, to)) = found {
                self.exchange(from, second, to);
                return true;
            }
        }
        false
    }

    /// Exchanges that make `there` the successor of `at`, the third cut proposed by near neighbours.
    fn exchanges(&self, at: usize, there: usize) -> impl Iterator<Item = (usize, usize, usize)> {
        let forwards = there > at + 1;
        let wanted = forwards || there > 0 && there < at;
        // Ends that lose their move: what followed `at`, and what came before `there`.
        let [orphan, widow] = if wanted { [at + 1, there - 1] } else { [0, 0] };
        let before = self.grid.before(self.order[orphan]).filter(move |_| wanted);
        let after = self.grid.after(self.order[widow]).filter(move |_| wanted);
        let by_orphan = before.flat_map(move |near| {
            let near = self.position_of(near);
            if forwards {
                // at | at+1 .. there-1 | there .. near, or near | near+1 .. at | at+1 .. there-1
                [(at + 1, there, near), (near + 1, at + 1, there - 1)]
            } else {
                [(there, near + 1, at), (0, 0, 0)]
            }
        });
        let by_widow = after.flat_map(move |near| {
            let near = self.position_of(near);
            if forwards {
                [
                    (at + 1, there, near.wrapping_sub(1)),
                    (near, at + 1, there - 1),
                ]
            } else {
                [(there, near, at), (0, 0, 0)]
            }
        });
        by_orphan.chain(by_widow)
    }

    /// True when exchanging the stretches `from..second` and `second..=to`, none empty, is allowed and shortens.
    fn shortens(&self, (from, second, to): (usize, usize, usize)) -> bool {
        let last = self.order.len() - 1;
        0 < from
            && from < second
            && second <= to
            && to < last
            && self.exchange_change(from, second, to) < 0
            && self.may_exchange(from, second, to)
    }

    fn exchange_change(&self, from: usize, second: usize, to: usize) -> i64 {
        self.cost(from - 1, second) + self.cost(to, from) + self.cost(second - 1, to + 1)
            - self.cost(from - 1, from)
            - self.cost(second - 1, second)
            - self.cost(to, to + 1)
    }

    fn exchange(&mut self, from: usize, second: usize, to: usize) {
        self.length += self.exchange_change(from, second, to);
        self.order[from..=to].rotate_left(second - from);
        self.settle(from, to);
        let landed = from + to + 1 - second;
        for at in [from - 1, from, landed - 1, landed, to, to + 1] {
            self.push(at);
        }
    }

    /// Takes a point out and puts it back at any of its poses, where it is or next to a pose near that.
    fn try_poses(&mut self, point: u32) -> bool {
        let grid = self.grid;
        let poses = &grid.rules.poses_of[point as usize];
        let at = self.position[point as usize] as usize;
        let last = self.order.len() - 1;
        if poses.len() < 2 || at == 0 || at == last {
            return false;
        }
        let freed = self.cost(at - 1, at) + self.cost(at, at + 1) - self.cost(at - 1, at + 1);
        let mut best = (0, 0, self.order[at]);
        for &pose in poses {
            let here = grid.cost(self.order[at - 1], pose) + grid.cost(pose, self.order[at + 1])
                - self.cost(at - 1, at + 1);
            if here - freed < best.0 {
                best = (here - freed, at, pose);
            }
            for near in grid.before(pose).chain(grid.after(pose)) {
                let there = self.position_of(near);
                for gap in [there, there.wrapping_sub(1)] {
                    if gap >= last || gap == at || gap + 1 == at {
                        continue;
                    }
                    let added = grid.cost(self.order[gap], pose)
                        + grid.cost(pose, self.order[gap + 1])
                        - self.cost(gap, gap + 1);
                    let (low, second, high) = if gap > at {
                        (at, at + 1, gap)
                    } else {
                        (gap + 1, at, at)
                    };
                    if added - freed < best.0 && self.may_exchange(low, second, high) {
                        best = (added - freed, gap, pose);
                    }
                }
            }
        }
        let (change, gap, pose) = best;
        if change >= 0 {
            return false;
        }
        self.order[at] = pose;
        self.length += change;
        let (low, second, high) = match gap.cmp(&at) {
            std::cmp::Ordering::Greater => (at, at + 1, gap),
            std::cmp::Ordering::Equal => (at, at, at),
            std::cmp::Ordering::Less => (gap + 1, at, at),
        };
        self.order[low..=high].rotate_left(second - low);
        self.settle(low, high);
        for at in [
            low - 1,
            low,
            low + 1,
            high.saturating_sub(1),
            high,
            high + 1,
        ] {
            self.push(at.min(last));
        }
        true
    }

    fn replace(&mut self, at: usize, pose: u32) {
        self.length -= self.cost(at - 1, at) + self.cost(at, at + 1);
        self.order[at] = pose;
        self.length += self.cost(at - 1, at) + self.cost(at, at + 1);
        self.settle(at, at);
        for near in [at - 1, at, at + 1] {
            self.push(near);
        }
    }

    /// Finds the best poses of the positions `from..=to`, whose outer neighbours stay, layer by layer.
    fn choose_poses(&mut self, from: usize, to: usize) -> bool {
        let rules = &self.grid.rules;
        // For each layer: each pose with the cost of the cheapest chain to it and the pose before it.
        let mut reached: Vec<Vec<(i64, usize)>> = vec![vec![(0, 0)]];
        let mut layers: Vec<&[u32]> = vec![std::slice::from_ref(&self.order[from - 1])];
        for at in from..=to + 1 {
            let layer = if at <= to {
                &rules.poses_of[self.point_at(at) as usize][..]
            } else {
                std::slice::from_ref(&self.order[at])
            };
            let (ahead, reached_ahead) = (layers[at - from], &reached[at - from]);
            let reach = |&pose: &u32| {
                let reached = ahead.iter().zip(reached_ahead).enumerate();
                let costs = reached.map(|(which, (&before, chain))| {
                    (chain.0 + self.grid.cost(before, pose), which)
                });
                costs.min().unwrap_or((0, 0))
            };
            let next = layer.iter().map(reach).collect();
            reached.push(next);
            layers.push(layer);
        }
        let old = self.grid.length(&self.order[from - 1..=to + 1]);
        let new = reached[to + 2 - from][0].0;
        if new >= old {
            return false;
        }
        let mut which = 0;
        let mut chosen = Vec::with_capacity(to + 1 - from);
        for layer in (1..=to + 1 - from).rev() {
            which = reached[layer + 1][which].1;
            chosen.push(layers[layer][which]);
        }
        for (at, pose) in (from..=to).rev().zip(chosen) {
            if self.order[at] != pose {
                self.order[at] = pose;
                self.push(at - 1);
                self.push(at);
                self.push(at + 1);
            }
        }
        self.length += new - old;
        self.settle(from, to);
        true
    }

    /// Brings positions and sums up to date after `from..=to` changed.
    fn settle(&mut self, from: usize, to: usize) {
        for at in from..=to {
            let point = self.point_at(at);
            self.position[point as usize] = at as u32;
        }
        self.touched = (self.touched.0.min(from), self.touched.1.max(to));
        if !self.turning.is_empty() {
            for at in from.max(1)..self.order.len() {
                self.turning[at] =
                    self.turning[at - 1] + self.cost(at, at - 1) - self.cost(at - 1, at);
            }
        }
    }

    fn improve_queue(&mut self) {
        loop {
            while let Some(point) = self.queue.pop() {
                self.queued[point as usize] = false;
                while self.improve(point) {}
            }
            let (from, to) = (
                self.touched.0.max(1),
                self.touched.1.min(self.order.len() - 2),
            );
            if !self.grid.rules.alternatives || from > to || !self.choose_poses(from, to) {
                break;
            }
        }
    }
}

impl Kicked for Directed<'_> {
    fn write(&self, order: &mut Vec<u32>) {
        order.clone_from(&self.order);
    }

    fn suspend(&self) -> Path {
        Path {
            order: self.order.clone(),
            poses: Vec::new(),
            window: (0, 0),
        }
    }

    fn resume(&mut self, path: &Path, length: i64) {
        self.order.clone_from(&path.order);
        self.kept.clone_from(&path.order);
        self.settle(0, self.order.len() - 1);
        self.touched = (usize::MAX, 0);
        self.length = length;
    }

    fn length(&self) -> i64 {
        self.length
    }

    fn can_be_kicked(&self) -> bool {
        self.order.len() >= 5
    }

    fn improve_all(&mut self) {
        for at in (0..self.order.len()).rev() {
            self.push(at);
        }
        self.touched = (1, self.order.len() - 2);
        self.improve_queue();
    }

    /// Exchanges neighbouring stretches among up to [`KICK_SPAN`] positions, at times twice: of a short path, the
    /// improvement would undo a single exchange at once. As many points change their pose.
    fn kick(&mut self, rng: &mut Pcg32) {
        if self.touched.0 <= self.touched.1 {
            let range = self.touched.0..=self.touched.1;
            self.kept[range.clone()].copy_from_slice(&self.order[range]);
        }
        self.kept_length = self.length;
        self.touched = (usize::MAX, 0);
        let inner = self.order.len() - 2;
        let mut draw = |below: usize| ((u64::from(rng.next_u32()) * below as u64) >> 32) as usize;
        let width = 2 + draw(inner.min(KICK_SPAN) - 1);
        let begin = 1 + draw(inner - width + 1);
        let wanted = 1 + draw(KICK_EXCHANGES);
        let mut exchanges = 0;
        for _ in 0..KICK_DRAWS {
            let size = 2 + draw(width - 1);
            let from = begin + draw(width - size + 1);
            let second = from + 1 + draw(size - 1);
            if self.may_exchange(from, second, from + size - 1) {
                self.exchange(from, second, from + size - 1);
                exchanges += 1;
            }
            if exchanges == wanted {
                break;
            }
        }
        if self.grid.rules.alternatives {
            for _ in 0..wanted {
                let at = begin + draw(width);
                let poses = &self.grid.rules.poses_of[self.point_at(at) as usize];
                self.replace(at, poses[draw(poses.len())]);
            }
        }
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

    fn cooling(&self) -> Cooling {
        Cooling::Cycles {
            hot: 1.0,
            cold: 0.03,
        }
    }
}
