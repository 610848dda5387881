//! Shortest open paths against brute force, the published figures and the properties every order must have.

use planning::{CostError, CostMatrix, Options, Problem, ProblemError, Solution, solve};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{RngCore, SeedableRng};

fn uniform(rng: &mut Pcg32) -> f64 {
    f64::from(rng.next_u32()) / 4_294_967_296.0
}

fn plate(points: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut rng = Pcg32::seed_from_u64(seed);
    (0..points)
        .map(|_| {
            [
                uniform(&mut rng),
                uniform(&mut rng),
                0.1 * uniform(&mut rng),
            ]
        })
        .collect()
}

fn table(points: usize, seed: u64) -> CostMatrix {
    let mut rng = Pcg32::seed_from_u64(seed);
    CostMatrix::from_fn(points, |_, _| uniform(&mut rng)).unwrap()
}

fn options(seed: u64, kicks: u64) -> Options {
    Options {
        seed,
        kicks,
        ..Options::default()
    }
}

fn shortest(problem: &Problem, kicks: u64) -> Solution {
    solve(problem, &options(7, kicks), &mut |_| true).unwrap()
}

/// Every order in turn, lexicographic; the first of the shortest.
fn brute_force(costs: &CostMatrix, start: Option<usize>, end: Option<usize>) -> (Vec<usize>, f64) {
    fn extend(
        costs: &CostMatrix,
        end: Option<usize>,
        order: &mut Vec<usize>,
        best: &mut (Vec<usize>, f64),
    ) {
        if order.len() == costs.len() {
            let cost = costs.path_cost(order);
            if end.is_none_or(|end| order.last() == Some(&end)) && cost < best.1 {
                *best = (order.clone(), cost);
            }
            return;
        }
        for next in 0..costs.len() {
            if !order.contains(&next) {
                order.push(next);
                extend(costs, end, order, best);
                order.pop();
            }
        }
    }
    let mut best = (Vec::new(), f64::INFINITY);
    for first in start.map_or(0..costs.len(), |s| s..s + 1) {
        extend(costs, end, &mut vec![first], &mut best);
    }
    best
}

fn assert_sound(problem: &Problem, solution: &Solution) {
    let mut sorted = solution.order.clone();
    sorted.sort_unstable();
    assert!(
        sorted.into_iter().eq(0..problem.costs().len()),
        "every point once: {:?}",
        solution.order
    );
    assert_eq!(
        solution.cost,
        problem.costs().path_cost(&solution.order),
        "reported cost is the cost of the order"
    );
    assert!(
        solution.cost <= solution.given_cost,
        "{} is longer than given {}",
        solution.cost,
        solution.given_cost
    );
}

#[test]
fn exact_equals_brute_force() {
    for seed in 0..20 {
        for costs in [
            CostMatrix::euclidean(&plate(7, seed)).unwrap(),
            table(7, seed),
        ] {
            for (start, end) in [
                (None, None),
                (Some(3), None),
                (None, Some(0)),
                (Some(6), Some(2)),
            ] {
                let mut problem = Problem::new(costs.clone());
                problem = start.map_or(problem.clone(), |point| problem.starting_at(point));
                problem = end.map_or(problem.clone(), |point| problem.ending_at(point));
                let solution = shortest(&problem, 0);
                assert_sound(&problem, &solution);
                let (_, cost) = brute_force(&costs, start, end);
                assert!(
                    (solution.cost - cost).abs() < 1e-12,
                    "{} against {cost}",
                    solution.cost
                );
                assert!(solution.optimal);
            }
        }
    }
}

#[test]
fn equal_paths_give_the_lowest_indices() {
    let costs = CostMatrix::from_fn(6, |_, _| 1.0).unwrap();
    let given = vec![5, 4, 3, 2, 1, 0];
    let solution = shortest(&Problem::new(costs).given(given), 0);
    assert_eq!(solution.order, [0, 1, 2, 3, 4, 5]);
}

/// `docs/source_systems.md, C.2`: s = n (s_a + s_c) + d with s_a = s_c = 5 mm.
#[test]
fn shaft_and_bore_are_swept_monotonically() {
    for (points, spacing, d, s) in [(12_usize, 0.020, 0.220, 0.340), (11, 0.100, 1.000, 1.110)] {
        let mut positions: Vec<[f64; 3]> = (0..points)
            .map(|i| [0.0, 0.0, spacing * i as f64])
            .collect();
        // Shuffled, so that the sweep has to be found.
        let mut rng = Pcg32::seed_from_u64(3);
        for i in (1..points).rev() {
            positions.swap(i, rng.next_u32() as usize % (i + 1));
        }
        let problem = Problem::new(CostMatrix::euclidean(&positions).unwrap());
        let solution = shortest(&problem, 0);
        assert!((solution.cost - d).abs() < 1e-12, "{}", solution.cost);
        assert!((solution.cost + points as f64 * 0.010 - s).abs() < 1e-12);
        let heights: Vec<f64> = solution.order.iter().map(|&i| positions[i][2]).collect();
        assert!(
            heights.is_sorted() || heights.iter().rev().is_sorted(),
            "{heights:?}"
        );
    }
}

#[test]
fn searched_orders_are_sound_and_keep_their_ends() {
    for points in [13, 14, 20, 60, 150] {
        for (seed, costs) in [
            (1, CostMatrix::euclidean(&plate(points, 5)).unwrap()),
            (2, table(points, 6)),
        ] {
            let free = Problem::new(costs);
            for problem in [
                free.clone(),
                free.clone().starting_at(4),
                free.clone().ending_at(0),
                free.clone().starting_at(9).ending_at(2),
            ] {
                let solution = solve(&problem, &options(seed, 2_000), &mut |_| true).unwrap();
                assert_sound(&problem, &solution);
                let again = solve(&problem, &options(seed, 2_000), &mut |_| true).unwrap();
                assert_eq!(solution, again, "same seed and budget give the same path");
            }
            let ends = shortest(&free.clone().starting_at(9).ending_at(2), 500).order;
            assert_eq!((ends[0], ends[points - 1]), (9, 2));
        }
    }
}

/// A line of points has a known answer at any size.
#[test]
fn collinear_and_coincident_points() {
    let positions: Vec<[f64; 3]> = (0..80)
        .map(|i| [f64::from(i * 37 % 80) * 0.01, 0.0, 0.0])
        .collect();
    let line = Problem::new(CostMatrix::euclidean(&positions).unwrap());
    assert!((shortest(&line, 5_000).cost - 0.79).abs() < 1e-12);

    let same = Problem::new(CostMatrix::euclidean(&[[0.5, 0.5, 0.5]; 40]).unwrap());
    let solution = shortest(&same, 100);
    assert_sound(&same, &solution);
    assert_eq!(solution.cost, 0.0);
}

#[test]
fn none_one_and_two_points() {
    for points in 0..3 {
        let problem = Problem::new(CostMatrix::euclidean(&plate(points, 1)).unwrap());
        let solution = shortest(&problem, 10);
        assert_sound(&problem, &solution);
        assert!(solution.order.iter().copied().eq(0..points));
    }
    let one = Problem::new(CostMatrix::euclidean(&plate(1, 1)).unwrap())
        .starting_at(0)
        .ending_at(0);
    assert_eq!(shortest(&one, 0).order, [0]);
}

/// Multiples of a power of two keep every bit of every comparison; a shift does so within rounding.
#[test]
fn scale_and_shift_do_not_change_the_path() {
    let positions = plate(90, 12);
    let solve_moved = |scale: f64, shift: f64| {
        let moved: Vec<[f64; 3]> = positions
            .iter()
            .map(|p| p.map(|x| x * scale + shift))
            .collect();
        shortest(&Problem::new(CostMatrix::euclidean(&moved).unwrap()), 3_000)
    };
    let plain = solve_moved(1.0, 0.0);
    for scale in [0.125, 1024.0] {
        let scaled = solve_moved(scale, 0.0);
        assert_eq!(plain.order, scaled.order);
        assert_eq!(plain.cost * scale, scaled.cost);
    }
    let shifted = solve_moved(1.0, 4.0);
    assert!((shifted.cost / plain.cost - 1.0).abs() < 0.01);
}

#[test]
fn relabelling_does_not_change_an_exact_cost() {
    let positions = plate(11, 8);
    let mut turned = positions.clone();
    turned.rotate_left(4);
    let cost = |positions: &[[f64; 3]]| {
        shortest(&Problem::new(CostMatrix::euclidean(positions).unwrap()), 0).cost
    };
    assert!((cost(&positions) - cost(&turned)).abs() < 1e-12);
}

#[test]
fn ten_points_are_found_by_the_search_too() {
    // A path of ten points, made searchable by fixing four more far away in a row behind its end.
    for seed in 0..20 {
        let mut positions = plate(10, seed);
        let exact = shortest(
            &Problem::new(CostMatrix::euclidean(&positions).unwrap()).ending_at(9),
            0,
        );
        let anchor = positions[9];
        positions.extend((1..5).map(|i| [anchor[0], anchor[1], anchor[2] + 10.0 * f64::from(i)]));
        let searched = shortest(
            &Problem::new(CostMatrix::euclidean(&positions).unwrap()).ending_at(13),
            2_000,
        );
        assert!(
            searched.cost <= exact.cost + 40.0 + 1e-9,
            "{} against {}",
            searched.cost - 40.0,
            exact.cost
        );
    }
}

#[test]
fn a_short_given_order_comes_back() {
    let positions: Vec<[f64; 3]> = (0..30).map(|i| [f64::from(i), 0.0, 0.0]).collect();
    let problem = Problem::new(CostMatrix::euclidean(&positions).unwrap());
    let solution = solve(&problem, &options(1, 0), &mut |_| false).unwrap();
    assert!(solution.order.iter().copied().eq(0..30));
}

#[test]
fn progress_never_gets_worse_and_can_stop() {
    let problem = Problem::new(CostMatrix::euclidean(&plate(120, 4)).unwrap());
    let mut costs = Vec::new();
    let solution = solve(
        &problem,
        &Options {
            seed: 1,
            kicks: 1_000_000,
            report_every: 100,
        },
        &mut |progress| {
            assert_eq!(progress.cost, problem.costs().path_cost(progress.order));
            costs.push(progress.cost);
            costs.len() < 20
        },
    )
    .unwrap();
    assert_eq!(costs.len(), 20);
    assert!(costs.is_sorted_by(|a, b| a >= b), "{costs:?}");
    assert_eq!(solution.kicks, 1_900);
    assert!(!solution.optimal);
}

#[test]
fn bad_input_is_named() {
    assert_eq!(
        CostMatrix::new(2, vec![0.0; 3]),
        Err(CostError::Shape {
            points: 2,
            entries: 3
        })
    );
    let entry = CostMatrix::new(2, vec![0.0, -1.0, 1.0, 0.0]).unwrap_err();
    assert_eq!(
        entry.to_string(),
        "the cost from point 0 to point 1 is -1; it must be finite and not negative"
    );
    assert!(CostMatrix::new(2, vec![0.0, f64::NAN, 1.0, 0.0]).is_err());
    assert!(CostMatrix::euclidean(&[[0.0; 3], [f64::NAN, 0.0, 0.0]]).is_err());

    let problem = Problem::new(CostMatrix::euclidean(&plate(5, 1)).unwrap());
    let error = |problem: Problem| solve(&problem, &options(1, 1), &mut |_| true).unwrap_err();
    assert_eq!(
        error(problem.clone().starting_at(5)),
        ProblemError::End {
            end: "start",
            pose: 5,
            poses: 5
        }
    );
    assert_eq!(
        error(problem.clone().starting_at(1).ending_at(1)),
        ProblemError::SameEnds(1)
    );
    assert_eq!(
        error(problem.clone().given(vec![0, 1, 2, 3, 3])),
        ProblemError::GivenNotAPermutation(3)
    );
    assert_eq!(
        error(problem.clone().given(vec![0, 1, 2, 3])),
        ProblemError::GivenNotAPermutation(4)
    );
    assert_eq!(
        error(problem.starting_at(1).given(vec![0, 1, 2, 3, 4])),
        ProblemError::GivenForbidden(0)
    );
}
