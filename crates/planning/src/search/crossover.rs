//! Takes into a ring what another ring over the same points does better, part by part.
//!
//! Where two rings differ, their edges form closed parts: at each point a part has as many edges of the one as of the other,
//! so that exchanging them leaves two edges at every point. A part that is shorter in the other ring is taken over when one
//! ring is left; each is judged for itself (partition crossover, Whitley, Hains and Howe 2009). So a walk that is longer as a
//! whole still improves the shortest ring wherever it is shorter.
//!
//! Stretches that both rings share are contracted to one edge, so a part is judged in the time of a walk past the points where
//! the rings differ.

use super::ring::Ring;

/// No number of a point or part.
const NONE: u32 = u32::MAX;

/// Buffers of a crossover; nothing is kept from one to the next.
#[derive(Default)]
pub(super) struct Crossover {
    /// Both neighbours of each point in the ring that is improved.
    links: Vec<[u32; 2]>,
    /// The points at which the rings differ, along the ring that is improved.
    differing: Vec<u32>,
    /// The place of each point among those.
    place: Vec<u32>,
    /// Neighbours of those places when shared stretches are one edge, with what is taken over.
    taken: Vec<[u32; 2]>,
    /// The same with the edges of the other ring where they differ, or what these have replaced.
    offered: Vec<[u32; 2]>,
}

/// Edges in which two rings differ and that hang together.
struct Part {
    /// By how much the other ring is shorter here.
    gain: i64,
    places: Vec<u32>,
}

impl Crossover {
    /// Takes over the parts in which `other` is shorter, the largest gain first. `ring` holds each number below its length
    /// once; from and in which direction it is written does not matter. Returns by how much the ring became shorter.
    pub(super) fn improve(
        &mut self,
        ring: &mut [u32],
        other: &Ring,
        cost: impl Fn(u32, u32) -> i64,
    ) -> i64 {
        self.compare(ring, other);
        if self.differing.is_empty() {
            return 0;
        }
        let mut parts = self.parts(other, cost);
        parts.retain(|part| part.gain > 0);
        parts.sort_by_key(|part| std::cmp::Reverse(part.gain));
        let mut gain = 0;
        // What was taken over may let in what closed a ring too early before.
        loop {
            let before = parts.len();
            parts.retain(|part| {
                let fits = self.take(part);
                if fits {
                    gain += part.gain;
                    for &place in &part.places {
                        let point = self.differing[place as usize];
                        self.links[point as usize] = [other.previous(point), other.next(point)];
                    }
                }
                !fits
            });
            if parts.len() == before {
                break;
            }
        }
        if gain > 0 {
            let mut slots = ring.iter_mut();
            walk(&self.links, |point| {
                if let Some(slot) = slots.next() {
                    *slot = point;
                }
            });
        }
        gain
    }

    /// Lists where the rings differ and contracts the rest.
    fn compare(&mut self, ring: &[u32], other: &Ring) {
        let size = ring.len();
        self.links.clear();
        self.links.resize(size, [0; 2]);
        self.place.clear();
        self.place.resize(size, NONE);
        self.differing.clear();
        for (at, &point) in ring.iter().enumerate() {
            let here = [ring[(at + size - 1) % size], ring[(at + 1) % size]];
            self.links[point as usize] = here;
            let there = neighbours(other, point);
            if !here.iter().all(|next| there.contains(next)) {
                self.place[point as usize] = self.differing.len() as u32;
                self.differing.push(point);
            }
        }
        let count = self.differing.len();
        self.taken.clear();
        self.offered.clear();
        for (at, &point) in self.differing.iter().enumerate() {
            let along = [(at + count - 1) % count, (at + 1) % count].map(|at| at as u32);
            let here = self.links[point as usize];
            let there = neighbours(other, point);
            let mut new = there.iter().filter(|next| !here.contains(next));
            let mut offered = along;
            for side in 0..2 {
                if !there.contains(&here[side])
                    && let Some(&next) = new.next()
                {
                    offered[side] = self.place[next as usize];
                }
            }
            self.taken.push(along);
            self.offered.push(offered);
        }
    }

    /// The parts in which the rings differ, by their least points.
    fn parts(&self, other: &Ring, cost: impl Fn(u32, u32) -> i64) -> Vec<Part> {
        let mut reached = vec![false; self.differing.len()];
        let mut least: Vec<u32> = (0..self.differing.len() as u32).collect();
        least.sort_unstable_by_key(|&place| self.differing[place as usize]);
        let mut parts = Vec::new();
        for first in least {
            if std::mem::replace(&mut reached[first as usize], true) {
                continue;
            }
            let (mut places, mut gain) = (vec![first], 0);
            let mut at = 0;
            while at < places.len() {
                let point = self.differing[places[at] as usize];
                let here = self.links[point as usize];
                let there = neighbours(other, point);
                let mut follow = |next: u32, change: i64| {
                    gain += change;
                    let place = self.place[next as usize];
                    if !std::mem::replace(&mut reached[place as usize], true) {
                        places.push(place);
                    }
                };
                for next in here.into_iter().filter(|next| !there.contains(next)) {
                    follow(next, cost(point, next));
                }
                for next in there.into_iter().filter(|next| !here.contains(next)) {
                    follow(next, -cost(point, next));
                }
                at += 1;
            }
            // Every edge was met from both of its points.
            gain /= 2;
            parts.push(Part { gain, places });
        }
        parts
    }

    /// Takes a part over where that leaves one ring.
    fn take(&mut self, part: &Part) -> bool {
        self.exchange(part);
        let mut seen = 0;
        walk(&self.taken, |_| seen += 1);
        let fits = seen == self.taken.len();
        if !fits {
            self.exchange(part);
        }
        fits
    }

    fn exchange(&mut self, part: &Part) {
        for &place in &part.places {
            let place = place as usize;
            std::mem::swap(&mut self.taken[place], &mut self.offered[place]);
        }
    }
}

fn neighbours(ring: &Ring, point: u32) -> [u32; 2] {
    [ring.previous(point), ring.next(point)]
}

/// Visits the numbers on the ring of zero.
fn walk(links: &[[u32; 2]], mut visit: impl FnMut(u32)) {
    let (mut before, mut here) = (links[0][1], 0);
    for _ in 0..links.len() {
        visit(here);
        let [one, other] = links[here as usize];
        (before, here) = (here, if one == before { other } else { one });
        if here == 0 {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg32;
    use rand_pcg::rand_core::{RngCore, SeedableRng};

    use super::*;

    fn cost(one: u32, other: u32) -> i64 {
        let at = |point: u32| [point * 7919 % 101, point * 104_729 % 97].map(f64::from);
        let (a, b) = (at(one), at(other));
        ((a[0] - b[0]).hypot(a[1] - b[1]) * 1000.0) as i64
    }

    fn length(order: &[u32]) -> i64 {
        let closing = [order[order.len() - 1], order[0]];
        let moves = order.windows(2).chain([&closing[..]]);
        moves.map(|pair| cost(pair[0], pair[1])).sum()
    }

    fn edges(order: &[u32]) -> Vec<[u32; 2]> {
        let next = order.iter().cycle().skip(1);
        let pairs = order.iter().zip(next);
        let mut edges: Vec<[u32; 2]> = pairs.map(|(&a, &b)| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        edges
    }

    /// Reverses a stretch at random.
    fn reverse(order: &mut [u32], longest: u32, rng: &mut Pcg32) {
        let begin = rng.next_u32() as usize % order.len();
        let end = (begin + 2 + (rng.next_u32() % longest) as usize).min(order.len());
        order[begin..end].reverse();
    }

    #[test]
    fn takes_the_better_half_of_each_of_two_rings() {
        let ring: Vec<u32> = (0..12).collect();
        // On a circle every exchange makes the ring longer: the one has spoilt its first half, the other its second.
        let angle = |point: u32| f64::from(point) / 12.0 * std::f64::consts::TAU;
        let cost =
            |a: u32, b: u32| ((angle(a) - angle(b)) / 2.0).sin().abs().mul_add(1e6, 0.0) as i64;
        let (mut one, mut other) = (ring.clone(), ring.clone());
        one.swap(2, 3);
        other.swap(8, 9);
        let mut crossover = Crossover::default();
        assert!(crossover.improve(&mut one, &Ring::new(&other), cost) > 0);
        assert_eq!(edges(&one), edges(&ring));
        assert_eq!(crossover.improve(&mut one, &Ring::new(&other), cost), 0);
    }

    #[test]
    fn leaves_one_ring_of_edges_of_both_shorter_by_what_it_says() {
        let mut rng = Pcg32::seed_from_u64(3);
        let mut crossover = Crossover::default();
        let (mut shorter, mut mixed) = (0, 0);
        for _ in 0..300 {
            let mut one: Vec<u32> = (0..60).collect();
            for _ in 0..5 {
                reverse(&mut one, 60, &mut rng);
            }
            let mut other = one.clone();
            for _ in 0..6 {
                reverse(&mut other, 12, &mut rng);
            }
            let before = one.clone();
            let gain = crossover.improve(&mut one, &Ring::new(&other), cost);
            assert_eq!(length(&before) - length(&one), gain);
            let mut sorted = one.clone();
            sorted.sort_unstable();
            assert!(sorted.iter().copied().eq(0..60), "{one:?}");
            let (from, to, after) = (edges(&before), edges(&other), edges(&one));
            assert!(
                after
                    .iter()
                    .all(|edge| from.contains(edge) || to.contains(edge))
            );
            shorter += u32::from(gain > 0);
            mixed += u32::from(after != from && after != to);

            // The same ring, written from elsewhere and backwards.
            let mut turned = before;
            turned.rotate_left(17);
            turned.reverse();
            assert_eq!(
                crossover.improve(&mut turned, &Ring::new(&other), cost),
                gain
            );
            assert_eq!(edges(&turned), after);
        }
        assert!(shorter > 200 && mixed > 100, "{shorter} {mixed}");
    }
}
