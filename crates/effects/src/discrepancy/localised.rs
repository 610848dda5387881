//! Displacements of one direction that an axis makes on a part of its travel only: dirt or damage on a scale or a guideway, which
//! acts in a short range, and what grows from a place on, such as behind the joint of two lengths of a guideway.
//!
//! Where is not known. Places and lengths all along the travel are compared by how much of some residuals a displacement of
//! one shape there would explain; within the best of them the displacement is a smooth process, and the prior counts all
//! that were compared. A process over the whole travel pays for every place where nothing shows.

use inference::discrepancy::{Discrepancy, Kind};

use crate::observation::Observations;

use super::factor;
use super::kernels::{
    Displacements, Kernel, STILL, in_direction_of_joint, pairwise, shared_displacement,
    squared_exponential,
};

/// Lengths of the ranges that are compared, and of the steps from one to the next, as shares of the travel.
const LENGTHS: [f64; 4] = [0.02, 0.04, 0.08, 0.16];
/// Number of places from which something grows that are compared, along the travel.
const PLACES: usize = 20;
/// Rounds in which the best part of the travel is moved.
const REFINEMENTS: usize = 12;
/// Correlation length of the displacement, in lengths of its part of the travel.
const CORRELATED: f64 = 2.0;

/// A part of the travel of an axis, m or rad.
#[derive(Clone, Copy)]
enum Part {
    /// A bell-shaped window: its middle and its standard deviation.
    Range { middle: f64, length: f64 },
    /// What grows linearly with the distance from a place on, up to one at a signed distance.
    From { place: f64, distance: f64 },
}

impl Part {
    /// Size of a displacement at a position, where it is one at its largest.
    fn share(self, at: f64) -> f64 {
        match self {
            Self::Range { middle, length } => squared_exponential(at - middle, length),
            Self::From { place, distance } => ((at - place) / distance).max(0.0),
        }
    }

    fn length(self) -> f64 {
        match self {
            Self::Range { length, .. } => length,
            Self::From { distance, .. } => distance.abs(),
        }
    }

    /// Neighbours of the part, this share of its length away.
    fn moved(self, step: f64) -> Vec<Self> {
        match self {
            Self::Range { middle, length } => {
                let range = |middle, length| Self::Range { middle, length };
                vec![
                    range(middle + step * length, length),
                    range(middle - step * length, length),
                    range(middle, length * (1.0 + step)),
                    range(middle, length / (1.0 + step)),
                ]
            }
            Self::From { place, distance } => {
                let from = |moved: f64| Self::From {
                    place: place + moved * distance,
                    distance: distance * (1.0 - moved),
                };
                vec![from(0.5 * step), from(-0.5 * step)]
            }
        }
    }
}

/// A displacement in one direction on a part of the travel of an axis.
#[derive(Clone, Copy)]
pub struct Displacement {
    axis: usize,
    component: usize,
    part: Part,
}

/// Displacements on parts of the travel of each axis, as they show in the rows of a session.
pub struct Localised {
    /// Weights of the rows.
    weights: Vec<f64>,
    /// Of each axis, in each direction; empty for one that does not move.
    displaced: Vec<[Displacements<f64>; 3]>,
    all: Vec<Displacement>,
}

impl Localised {
    /// All that are compared.
    pub fn new(observations: &Observations) -> Self {
        let (mut displaced, mut all) = (Vec::new(), Vec::new());
        for axis in 0..observations.chain.axes().len() {
            let (low, high) = observations.travel(axis);
            if high - low < STILL {
                displaced.push([const { Vec::new() }; 3]);
                continue;
            }
            displaced.push(std::array::from_fn(|component| {
                in_direction_of_joint(observations, axis, component)
            }));
            all.extend(ranges(low, high).chain(places(low, high)).flat_map(|part| {
                (0..3).map(move |component| Displacement {
                    axis,
                    component,
                    part,
                })
            }));
        }
        Self {
            weights: observations.rows.iter().map(|row| row.weight).collect(),
            displaced,
            all,
        }
    }

    /// Number of displacements that are compared.
    pub fn count(&self) -> usize {
        self.all.len()
    }

    /// How each of them shows in the weighted rows, where it is one at its largest: one column after the other.
    pub fn columns(&self) -> Vec<f64> {
        let mut columns = Vec::with_capacity(self.all.len() * self.weights.len());
        // The three directions on a part of the travel follow one another and share how much of it acts where.
        for of_part in self
            .all
            .chunk_by(|one, other| one.component < other.component)
        {
            let shares = self.shares(of_part[0]);
            for displacement in of_part {
                columns.extend(self.shown(*displacement, &shares));
            }
        }
        columns
    }

    fn column_of(&self, displacement: Displacement) -> Vec<f64> {
        let shares = self.shares(displacement);
        self.shown(displacement, &shares).collect()
    }

    /// Size of a displacement at each row, while probing and while cutting.
    fn shares(&self, Displacement { axis, part, .. }: Displacement) -> Vec<[f64; 2]> {
        let rows = (0..self.weights.len()).map(|row| {
            std::array::from_fn(|atom| {
                let of = &self.displaced[axis];
                let at = of[0][row][atom].1;
                let seen = of.iter().any(|along| along[row][atom].0 != 0.0);
                if seen { part.share(at) } else { 0.0 }
            })
        });
        rows.collect()
    }

    /// How a displacement of these sizes shows in the weighted rows.
    fn shown<'a>(
        &'a self,
        Displacement {
            axis, component, ..
        }: Displacement,
        shares: &'a [[f64; 2]],
    ) -> impl Iterator<Item = f64> + 'a {
        let rows = (self.displaced[axis][component].iter().zip(shares)).zip(&self.weights);
        rows.map(|((atoms, shares), weight)| {
            (atoms[0].0 * shares[0] + atoms[1].0 * shares[1]) * weight
        })
    }

    /// The displacement near one of them at which `worth` of its column is largest, by moves that become smaller.
    pub fn refined(&self, number: usize, worth: impl Fn(Vec<f64>) -> f64) -> (f64, Displacement) {
        let with_worth = |displacement| (worth(self.column_of(displacement)), displacement);
        let mut best = with_worth(self.all[number]);
        let mut step = 0.5;
        for _ in 0..REFINEMENTS {
            let moved = best.1.part.moved(step).into_iter();
            let better = moved
                .map(|part| with_worth(Displacement { part, ..best.1 }))
                .filter(|other| other.0 > best.0)
                .max_by(|one, other| one.0.total_cmp(&other.0));
            match better {
                Some(other) => best = other,
                None => step *= 0.5,
            }
        }
        best
    }
}

impl Displacement {
    /// The process of displacements in its direction on its part of the travel; `None` where too few rows show it.
    pub fn process(
        &self,
        observations: &Observations,
        active: &[bool],
        log_prior: f64,
    ) -> Option<Discrepancy> {
        let mut displaced = in_direction_of_joint(observations, self.axis, self.component);
        for (seen, at) in displaced.iter_mut().flatten() {
            *seen *= self.part.share(*at);
        }
        let kernel: Kernel<'_> = pairwise(|i, j| {
            let length = CORRELATED * self.part.length();
            shared_displacement(&displaced[i], &displaced[j], length, |one, other| {
                one * other
            })
        });
        let kind = Kind::AxisRange(self.axis);
        factor(observations, active, &kernel, kind, log_prior)
    }
}

/// Ranges of all lengths along a travel.
fn ranges(low: f64, high: f64) -> impl Iterator<Item = Part> {
    let of_length = move |share: f64| {
        let length = share * (high - low);
        let steps = (1.0 / share).ceil() as usize;
        (0..=steps).map(move |step| Part::Range {
            middle: low + length * step as f64,
            length,
        })
    };
    LENGTHS.into_iter().flat_map(of_length)
}

/// Places within a travel, and both ways from them.
fn places(low: f64, high: f64) -> impl Iterator<Item = Part> {
    let from = move |step: usize| {
        let place = low + (high - low) * step as f64 / PLACES as f64;
        [high, low].map(|end| Part::From {
            place,
            distance: end - place,
        })
    };
    (1..PLACES).flat_map(from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe;
    use crate::test_session::session;

    /// What is found of a displacement of X along x whose size is this function of its position: the share of its power that is
    /// explained, and the displacement.
    fn found(observations: &Observations, size: impl Fn(f64) -> f64) -> (f64, Displacement) {
        let (x, c) = (axis(observations, "X"), axis(observations, "C"));
        // The table turns the part and its normals about z.
        let displaced = |row: &crate::observation::Row| {
            row.pose.as_ref().map_or(0.0, |pose| {
                let (sin, cos) = pose.positions[c].sin_cos();
                let along = row.normal.x * cos - row.normal.y * sin;
                row.weight * along * size(pose.positions[x])
            })
        };
        let values: Vec<f64> = observations.rows.iter().map(displaced).collect();
        let power: f64 = values.iter().map(|value| value * value).sum();
        let explained = |column: Vec<f64>| {
            let product: f64 = column.iter().zip(&values).map(|(a, b)| a * b).sum();
            let own: f64 = column.iter().map(|value| value * value).sum();
            if own > 0.0 {
                product * product / own
            } else {
                0.0
            }
        };
        let localised = Localised::new(observations);
        let columns = localised.columns();
        let all: Vec<f64> = (columns.chunks_exact(values.len()))
            .map(|column| explained(column.to_vec()))
            .collect();
        let best = (0..localised.count())
            .max_by(|&one, &other| all[one].total_cmp(&all[other]))
            .expect("an axis that moves");
        let (most, found) = localised.refined(best, explained);
        assert_eq!(found.axis, x);
        (most / power, found)
    }

    fn axis(observations: &Observations, name: &str) -> usize {
        let axes = 0..observations.chain.axes().len();
        let mut named = axes.filter(|&axis| observations.chain.axis(axis).name == name);
        named.next().expect("an axis")
    }

    /// A bump is found and moved to where it is, whatever the grid.
    #[test]
    fn a_bump_between_the_places_that_are_compared_is_found() {
        let observations = observe(&session()).expect("rows");
        let (middle, length) = (0.0173, 0.0061);
        let bump = |at: f64| (-0.5 * ((at - middle) / length).powi(2)).exp();
        let (share, found) = found(&observations, bump);
        assert!(share > 0.999, "{share} of the bump");
        let Part::Range {
            middle: at,
            length: long,
        } = found.part
        else {
            panic!("a range");
        };
        assert!((at - middle).abs() < 0.1 * length, "{at}");
        assert!((long - length).abs() < 0.1 * length, "{long}");
    }

    /// What grows from a place on, towards either end, is found and moved to where it begins.
    #[test]
    fn what_grows_from_between_the_places_that_are_compared_is_found() {
        let observations = observe(&session()).expect("rows");
        let (low, high) = observations.travel(axis(&observations, "X"));
        let begin = low + 0.437 * (high - low);
        for sense in [1.0, -1.0] {
            let (share, found) = found(&observations, |at| (sense * (at - begin)).max(0.0));
            assert!(share > 0.999, "{share} of what grows");
            let Part::From { place, distance } = found.part else {
                panic!("what grows from a place on");
            };
            assert!(
                (place - begin).abs() < 0.01 * (high - low),
                "{place} for {begin}"
            );
            assert!(sense * distance > 0.0, "{distance}");
        }
    }
}
