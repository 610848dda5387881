//! Neighbour lists of the search, and how their points are chosen.

use crate::costs::CostMatrix;

/// Nearest points always kept.
pub(super) const NEAREST: usize = 5;

/// Most neighbours kept.
const MOST: usize = 10;

/// Nearest points among which relative neighbours are sought where others are added by promise.
const LOOK: usize = 100;

/// Every so many costs of a row one is looked at to guess how far the nearest points reach.
const SAMPLE: usize = 16;

/// Near points of each point with the cost of the move, nearest first, in one piece of memory.
pub(super) struct Near {
    begins: Vec<u32>,
    entries: Vec<(u32, i32)>,
}

impl Near {
    /// The list of one point.
    #[inline]
    pub(super) fn of(&self, point: u32) -> &[(u32, i32)] {
        let [begin, end] = [0, 1].map(|next| self.begins[point as usize + next] as usize);
        &self.entries[begin..end]
    }

    pub(super) fn len(&self) -> usize {
        self.begins.len() - 1
    }
}

impl FromIterator<Vec<(u32, i32)>> for Near {
    fn from_iter<T: IntoIterator<Item = Vec<(u32, i32)>>>(lists: T) -> Self {
        let (mut begins, mut entries) = (vec![0], Vec::new());
        for list in lists {
            entries.extend(list);
            begins.push(entries.len() as u32);
        }
        Self { begins, entries }
    }
}

/// Of `others`, unsorted, the nearest ones, nearest first and lowest index among equals. Besides the nearest, a
/// point further off is kept when no kept one is nearer to it (a relative neighbour, Toussaint 1980): so clusters stay
/// connected, whatever the unit of cost. Relative neighbours are sought among the `look` nearest.
pub(super) fn select(
    mut others: Vec<(u32, i32)>,
    look: usize,
    cost: impl Fn(u32, u32) -> i64,
) -> Vec<(u32, i32)> {
    let key = |&(there, cost): &(u32, i32)| (cost, there);
    if look < others.len() {
        others.select_nth_unstable_by_key(look, key);
        others.truncate(look);
    }
    others.sort_unstable_by_key(key);
    let mut kept: Vec<(u32, i32)> = Vec::with_capacity(MOST);
    for (rank, &(there, distance)) in others.iter().enumerate() {
        let shadowed = || {
            kept.iter()
                .any(|&(near, _)| cost(near, there) < i64::from(distance))
        };
        if rank < NEAREST || !shadowed() {
            kept.push((there, distance));
        }
        if kept.len() >= MOST {
            break;
        }
    }
    kept
}

/// [`select`] for every row of a symmetric table, with costs as `scale` makes them integers.
pub(super) fn select_all(costs: &CostMatrix, scale: f64) -> Near {
    let rounded = |cost: f64| (cost * scale + 0.5) as i32;
    let between = |a: u32, b: u32| i64::from(rounded(costs.cost(a as usize, b as usize)));
    (0..costs.len())
        .map(|here| {
            let row = costs.row(here);
            let within = |reach: f64| -> Vec<(u32, i32)> {
                let near = row.iter().enumerate();
                near.filter(|&(there, &cost)| cost <= reach && there != here)
                    .map(|(there, &cost)| (there as u32, rounded(cost)))
                    .collect()
            };
            let mut others = within(likely_reach(row));
            if others.len() < LOOK {
                others = within(f64::INFINITY);
            }
            select(others, LOOK, between)
        })
        .collect()
}

/// A cost within which, by a sample, some more than [`LOOK`] of a row lie, or all.
fn likely_reach(row: &[f64]) -> f64 {
    let mut sample: Vec<f64> = row.iter().copied().step_by(SAMPLE).collect();
    let wanted = 3 * LOOK / (2 * SAMPLE);
    if wanted >= sample.len() {
        return f64::INFINITY;
    }
    *sample.select_nth_unstable_by(wanted, f64::total_cmp).1
}
