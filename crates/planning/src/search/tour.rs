//! Holds a symmetric path as a ring and improves it by sequential exchanges of up to five edges (Lin and Kernighan
//! 1973, in the form of Helsgaun's k-opt moves). Where points have alternatives, other poses are chosen about each
//! changed point, and a point may go elsewhere together with its pose.
//!
//! The ring closes over the edge from the last point to the first, which is so cheap that no exchange removes it. A
//! kick exchanges neighbouring stretches: short ones mend details, long ones change in which order clusters are visited.
//!
//! A ring of many points is improved by longer sequences of exchanges ([`lin_kernighan`](super::lin_kernighan)) and searched in
//! walks, as [`Cooling::Record`] says.

use std::collections::VecDeque;

use rand_pcg::Pcg32;
use rand_pcg::rand_core::RngCore;

use super::choice::Moves;
use super::exchange::{Exchange, closes};
use super::lin_kernighan::{DEPTH, Sequence};
use super::ring::{Layout, MOST, Ring};
use super::{Cooling, Kicked, Path};

/// Stretches of a double bridge.
const BRIDGED: usize = 4;

/// Room for the continuations after one removed edge.
const WIDEST: usize = 4;

/// Bounds of the longest stretch of a kick; it is drawn evenly in its logarithm.
const SPAN: (f64, f64) = (5.0, 100.0);

/// A ring without alternatives of at least so many points is searched in walks.
const WALKED: usize = 200;

/// The bounds of a kick of such a walk. Those of every sixteenth on average are a quarter of the ring.
const WALK_SPAN: (f64, f64) = (200.0, 200.0);
const WIDE_KICK_ONE_IN: u32 = 16;

/// By how much a kicked ring may be longer than the shortest of its walk.
const WALK_COOLING: Cooling = Cooling::Record { slack: 0.1 };

/// Kicks with which a walk begins.
const SHAKES: usize = 16;

/// Most points that a kick visits at a random pose.
const SHAKEN: usize = 2;

/// Positions among which successive kicks begin, and how many do before the next positions follow: what a search of many
/// points looks at then stays in the processor's cache.
const WINDOW: usize = 50;
const KICKS: usize = 20;

/// Fewer points than this always stay there.
const SPREAD: usize = 1500;

/// Where the next kick begins.
#[derive(Default)]
struct Window {
    begin: usize,
    kicks: usize,
}

impl Window {
    fn position(&mut self, size: usize, draw: &mut impl FnMut(usize) -> usize) -> usize {
        if size < SPREAD {
            return draw(size);
        }
        self.kicks += 1;
        if self.kicks > KICKS {
            self.kicks = 1;
            self.begin = (self.begin + WINDOW) % size;
        }
        (self.begin + draw(WINDOW)) % size
    }
}

pub(super) struct Tour<M> {
    moves: M,
    ring: Ring,
    length: i64,
    kept_length: i64,
    /// Points about which the ring may be improved: the last added comes first, in walks the first added. About the ends of one
    /// kick in turn its effects are mended where they are; about the last added, sequences lead away from them.
    queue: VecDeque<u32>,
    queued: Vec<bool>,
    /// Points whose pose has just changed.
    changed: Vec<u32>,
    window: Window,
    sequence: Sequence,
}

impl<M: Moves> Tour<M> {
    /// Begins with the points in the order of their numbers, each at the pose of the same number.
    pub(super) fn new(moves: M) -> Self {
        let order: Vec<u32> = (0..moves.grid().points() as u32).collect();
        Self::along(moves, &order)
    }

    /// Begins with this order of all points, each at the pose of the same number.
    pub(super) fn along(moves: M, order: &[u32]) -> Self {
        let length = moves.grid().length(order);
        Self {
            moves,
            ring: Ring::new(order),
            length,
            kept_length: length,
            queue: VecDeque::with_capacity(order.len()),
            queued: vec![false; order.len()],
            changed: Vec::new(),
            window: Window::default(),
            sequence: Sequence::default(),
        }
    }

    fn is_walked(&self) -> bool {
        !M::ALTERNATIVES && self.ring.len() >= WALKED
    }

    fn push(&mut self, point: u32) {
        if !std::mem::replace(&mut self.queued[point as usize], true) {
            self.queue.push_back(point);
        }
    }

    fn improve_queue(&mut self) {
        if self.is_walked() {
            while let Some(point) = self.queue.pop_front() {
                self.queued[point as usize] = false;
                self.improve_by_sequence(point);
            }
        } else {
            while let Some(point) = self.queue.pop_back() {
                self.queued[point as usize] = false;
                while self.improve(point) || M::ALTERNATIVES && self.improve_pose(point) {}
            }
        }
    }

    /// Carries out a sequence of exchanges that shortens the ring, or one exchange among more candidates.
    fn improve_by_sequence(&mut self, point: u32) {
        let mut sequence = std::mem::take(&mut self.sequence);
        let (moves, ring) = (&self.moves, &mut self.ring);
        let [near, wide] = [moves.grid().candidates(), moves.grid().more_candidates()];
        let gain = sequence
            .improve::<DEPTH>(moves, near, ring, point)
            .or_else(|| sequence.improve::<1>(moves, wide, ring, point));
        if let Some(gain) = gain {
            self.length -= gain;
            for &point in sequence.ends() {
                self.push(point);
            }
        }
        self.sequence = sequence;
    }

    /// Chooses other poses about this point, or visits it elsewhere.
    fn improve_pose(&mut self, point: u32) -> bool {
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

    /// Takes a point out and puts it back, at any of its poses, next to a near point.
    fn insert(&mut self, point: u32) -> bool {
        let grid = self.moves.grid();
        let (before, behind) = (self.ring.previous(point), self.ring.next(point));
        let freed = self.moves.cost(before, point) + self.moves.cost(point, behind)
            - self.moves.cost(before, behind);
        let mut best = (0, 0, 0);
        for &pose in &grid.rules.poses_of[point as usize] {
            for &(near, least) in grid.near(pose) {
                if i64::from(least) >= freed {
                    break;
                }
                let cost = grid.cost(pose, self.moves.pose(near));
                for (left, right) in [
                    (near, self.ring.next(near)),
                    (self.ring.previous(near), near),
                ] {
                    if left == point || right == point {
                        continue;
                    }
                    let other = if left == near { right } else { left };
                    let added = cost + grid.cost(pose, self.moves.pose(other))
                        - self.moves.cost(left, right);
                    if added - freed < best.0 {
                        best = (added - freed, left, pose);
                    }
                }
            }
        }
        let (change, left, pose) = best;
        if change >= 0 {
            return false;
        }
        self.length += change;
        self.moves.choose(point, pose);
        self.ring.transfer(point, left);
        self.push_about(point);
        self.push(before);
        self.push(behind);
        true
    }

    /// Carries out an exchange that begins by removing an edge of this point and shortens the ring.
    fn improve(&mut self, point: u32) -> bool {
        for other in [self.ring.next(point), self.ring.previous(point)] {
            let mut exchange = Exchange::new(&self.ring, point, other);
            let freed = self.moves.cost(point, other);
            if let Some(gain) = self.shorten::<1>(&mut exchange, freed) {
                let layout = exchange.layout(&self.ring);
                self.length -= gain;
                self.ring.rearrange(&layout);
                for &point in &exchange.ends[..2 * exchange.edges] {
                    self.push(point);
                }
                return true;
            }
        }
        false
    }

    /// Goes on from the open end of `EDGES` removed edges with near neighbours: returns the gain where closing the ring
    /// shortens it, otherwise follows the few continuations that leave the most to gain.
    fn shorten<const EDGES: usize>(&self, exchange: &mut Exchange, gain: i64) -> Option<i64> {
        let (moves, ring) = (&self.moves, &self.ring);
        let first = exchange.ends[0];
        let open = exchange.ends[2 * EDGES - 1];
        let breadth = M::BREADTH.get(EDGES - 1).copied().unwrap_or(0);
        let mut promising = [(i64::MIN, 0, 0, 0, false); WIDEST];
        let (after, before) = (ring.next(open), ring.previous(open));
        for &(near, least) in moves.near(open) {
            if gain <= i64::from(least) {
                break;
            }
            if near == after || near == before {
                continue;
            }
            let left = gain - moves.cost_to(open, near, least);
            if left <= 0 {
                continue;
            }
            for up in [true, false] {
                let Some((far, cut)) = exchange.beside(ring, near, up, EDGES) else {
                    continue;
                };
                let closes = closes(EDGES + 1, exchange.with(cut, up, EDGES));
                if breadth == 0 && !closes {
                    continue;
                }
                let total = left + moves.cost(near, far);
                if total <= moves.least(far) {
                    continue;
                }
                if closes {
                    let change = total - moves.cost(first, far);
                    if change > 0 {
                        exchange.remove(EDGES, [near, far], cut, up);
                        return Some(change);
                    }
                }
                let mut at = breadth;
                while at > 0 && promising[at - 1].0 < total {
                    if at < breadth {
                        promising[at] = promising[at - 1];
                    }
                    at -= 1;
                }
                if at < breadth {
                    promising[at] = (total, near, far, cut, up);
                }
            }
        }
        for &(total, near, far, cut, up) in &promising[..breadth] {
            if total == i64::MIN {
                break;
            }
            exchange.remove(EDGES, [near, far], cut, up);
            let found = match EDGES {
                1 => self.shorten::<2>(exchange, total),
                2 => self.shorten::<3>(exchange, total),
                3 => self.shorten::<4>(exchange, total),
                _ => None,
            };
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// Double bridge: three neighbouring stretches in the order 3, 2, 1, the longest within these bounds.
    fn double_bridge(&mut self, bounds: (f64, f64), rng: &mut Pcg32) {
        let size = self.ring.len();
        let mut draw = |below: usize| ((u64::from(rng.next_u32()) * below as u64) >> 32) as usize;
        let part = draw(1 << 16) as f64 / f64::from(1 << 16);
        let span = (bounds.0 * (bounds.1 / bounds.0).powf(part)) as usize;
        let mut at = self.window.position(size, &mut draw);
        let mut positions = [at; BRIDGED];
        let mut lengths = [0; BRIDGED];
        for stretch in 0..3 {
            lengths[stretch] = 1 + draw(span.min(size / BRIDGED));
            at += lengths[stretch];
            positions[stretch + 1] = at % size;
        }
        lengths[3] = positions[0] + size - (at - usize::from(at >= size) * size);
        lengths[3] %= size;
        let before = positions.map(|at| self.ring.at((at + size - 1) % size));
        let behind = positions.map(|at| self.ring.at(at));
        let mut change = 0;
        for cut in 0..BRIDGED {
            let cost = self.moves.cost(before[cut], behind[cut]);
            if cost < 0 {
                return;
            }
            change -= cost;
        }
        for (left, right) in [(0, 2), (3, 1), (2, 0), (1, 3)] {
            change += self.moves.cost(before[left], behind[right]);
        }
        let mut stretches = [(0, 0, false); MOST];
        for (stretch, i) in stretches.iter_mut().zip([3, 2, 1, 0]) {
            *stretch = (positions[i] as u32, lengths[i] as u32, false);
        }
        self.ring.rearrange(&Layout {
            edges: BRIDGED,
            stretches,
        });
        self.length += change;
        for point in before.into_iter().chain(behind) {
            self.push(point);
        }
        if M::ALTERNATIVES {
            let wanted = draw(SHAKEN + 1);
            for _ in 0..wanted {
                let point = behind[draw(BRIDGED)];
                let poses = &self.moves.grid().rules.poses_of[point as usize];
                self.visit(point, poses[draw(poses.len())]);
            }
        }
    }

    /// Visits a point at this pose.
    fn visit(&mut self, point: u32, pose: u32) {
        let (before, behind) = (self.ring.previous(point), self.ring.next(point));
        let about = |moves: &M| moves.cost(before, point) + moves.cost(point, behind);
        let old = about(&self.moves);
        self.moves.choose(point, pose);
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
                .map(|&point| self.moves.pose(point)),
        );
    }

    fn suspend(&self) -> Path {
        let order = self.ring.order().to_vec();
        let poses = if M::ALTERNATIVES {
            let points = 0..order.len() as u32;
            points.map(|point| self.moves.pose(point)).collect()
        } else {
            Vec::new()
        };
        Path {
            order,
            poses,
            window: (self.window.begin, self.window.kicks),
        }
    }

    fn resume(&mut self, path: &Path, length: i64) {
        self.ring = Ring::new(&path.order);
        for (point, &pose) in path.poses.iter().enumerate() {
            self.moves.choose(point as u32, pose);
        }
        self.moves.keep();
        (self.window.begin, self.window.kicks) = path.window;
        self.length = length;
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
        let span = if !self.is_walked() {
            SPAN
        } else if rng.next_u32().is_multiple_of(WIDE_KICK_ONE_IN) {
            let quarter = (self.ring.len() / BRIDGED) as f64;
            (quarter, quarter)
        } else {
            WALK_SPAN
        };
        self.double_bridge(span, rng);
        self.improve_queue();
    }

    fn revert(&mut self) {
        self.ring.undo();
        self.moves.undo();
        self.length = self.kept_length;
    }

    fn cooling(&self) -> Cooling {
        if self.is_walked() {
            WALK_COOLING
        } else {
            M::COOLING
        }
    }

    fn restart(&mut self, shortest: &[u32], length: i64, rng: &mut Pcg32) {
        self.ring = Ring::new(shortest);
        self.length = length;
        let size = shortest.len();
        for _ in 0..SHAKES {
            self.window.begin = rng.next_u32() as usize % size;
            self.double_bridge(WALK_SPAN, rng);
        }
        self.improve_queue();
    }
}
