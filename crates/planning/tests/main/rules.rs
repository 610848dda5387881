//! Stages, precedence and alternative poses against brute force.

use planning::{CostMatrix, Options, Problem, ProblemError, Solution, solve};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{RngCore, SeedableRng};

fn table(poses: usize, seed: u64) -> CostMatrix {
    let mut rng = Pcg32::seed_from_u64(seed);
    let positions: Vec<[f64; 2]> = (0..poses)
        .map(|_| [0, 1].map(|_| f64::from(rng.next_u32()) / 4_294_967_296.0))
        .collect();
    // Slightly asymmetric, as with retracts that end elsewhere than approaches begin.
    CostMatrix::from_fn(poses, |i, j| {
        let [a, b] = [positions[i], positions[j]];
        (a[0] - b[0]).hypot(a[1] - b[1]) + 0.05 * f64::from(rng.next_u32()) / 4_294_967_296.0
    })
    .unwrap()
}

fn shortest(problem: &Problem, kicks: u64) -> Solution {
    solve(
        problem,
        &Options {
            seed: 3,
            kicks,
            report_every: 100,
        },
        &mut |_| true,
    )
    .unwrap()
}

struct Rules {
    poses_of: Vec<Vec<usize>>,
    stages: Vec<u32>,
    precedence: Vec<(usize, usize)>,
}

impl Rules {
    fn problem(&self, costs: CostMatrix) -> Problem {
        Problem::new(costs)
            .alternatives(self.poses_of.clone())
            .stages(self.stages.clone())
            .precedence(self.precedence.clone())
    }

    fn allow(&self, order: &[usize]) -> bool {
        let point = |pose: &usize| {
            self.poses_of
                .iter()
                .position(|own| own.contains(pose))
                .unwrap()
        };
        let points: Vec<usize> = order.iter().map(point).collect();
        let at = |point: usize| points.iter().position(|&p| p == point);
        let mut sorted = points.clone();
        sorted.sort_unstable();
        sorted.into_iter().eq(0..self.poses_of.len())
            && points
                .windows(2)
                .all(|pair| self.stages[pair[0]] <= self.stages[pair[1]])
            && self
                .precedence
                .iter()
                .all(|&(before, after)| at(before) < at(after))
    }

    /// Cost of the best of all orders of all choices.
    fn brute_force(&self, costs: &CostMatrix) -> f64 {
        fn extend(
            rules: &Rules,
            costs: &CostMatrix,
            order: &mut Vec<usize>,
            left: &mut Vec<usize>,
            best: &mut f64,
        ) {
            if left.is_empty() && rules.allow(order) {
                *best = best.min(costs.path_cost(order));
            }
            for at in 0..left.len() {
                let point = left.remove(at);
                for &pose in &rules.poses_of[point] {
                    order.push(pose);
                    extend(rules, costs, order, left, best);
                    order.pop();
                }
                left.insert(at, point);
            }
        }
        let mut best = f64::INFINITY;
        extend(
            self,
            costs,
            &mut Vec::new(),
            &mut (0..self.poses_of.len()).collect(),
            &mut best,
        );
        best
    }
}

fn rules(points: usize, poses: usize, seed: u64) -> Rules {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut precedence = Vec::new();
    for before in 0..points {
        for after in before + 1..points {
            if rng.next_u32() % (2 * points as u32) == 0 {
                precedence.push((before, after));
            }
        }
    }
    Rules {
        poses_of: (0..points)
            .map(|point| (0..poses).map(|pose| point + pose * points).collect())
            .collect(),
        stages: (0..points)
            .map(|point| u32::from(point >= points / 3))
            .collect(),
        precedence,
    }
}

#[test]
fn exact_with_all_rules_equals_brute_force() {
    for seed in 0..10 {
        let rules = rules(6, 2, seed);
        let costs = table(12, seed);
        let solution = shortest(&rules.problem(costs.clone()), 0);
        assert!(
            solution.optimal && rules.allow(&solution.order),
            "{:?}",
            solution.order
        );
        assert!((solution.cost - rules.brute_force(&costs)).abs() < 1e-12);
    }
}

/// The search is given the exact problem with points added behind a fixed, far end: it must find the exact part.
#[test]
fn search_with_all_rules_equals_exact() {
    let (mut hit, mut runs) = (0, 0);
    for seed in 0..12 {
        let small = rules(11, 3, seed);
        let costs = table(33, seed);
        let exact = shortest(&small.problem(costs.clone()), 0);
        assert!(exact.optimal);
        // Three more points in a last stage of their own, each as far from all as from another.
        let mut large = Rules {
            poses_of: small.poses_of.clone(),
            stages: small.stages.clone(),
            precedence: small.precedence.clone(),
        };
        for extra in 33..36 {
            large.poses_of.push(vec![extra]);
            large.stages.push(9);
        }
        let costs = CostMatrix::from_fn(
            36,
            |i, j| if i.max(j) > 32 { 1.0 } else { costs.cost(i, j) },
        )
        .unwrap();
        let searched = shortest(&large.problem(costs), 20_000);
        assert!(!searched.optimal && large.allow(&searched.order));
        assert!(searched.cost >= exact.cost + 3.0 - 1e-9);
        runs += 1;
        hit += u32::from(searched.cost <= exact.cost + 3.0 + 1e-9);
    }
    assert_eq!(
        hit, runs,
        "the search found the exact order in {hit} of {runs} problems"
    );
}

/// Alternatives alone, with costs alike in both directions: again the exact problem, with points far from all that are
/// cheapest at one end or the other. Every report is complete and never longer than the order given.
#[test]
fn search_of_poses_equals_exact() {
    for seed in 0..12 {
        let poses = 2 + seed as usize % 3;
        let mut poses_of = rules(11, poses, seed).poses_of;
        let poses = 11 * poses;
        let one_way = table(poses, seed);
        let small = CostMatrix::from_fn(poses, |i, j| one_way.cost(i.min(j), i.max(j))).unwrap();
        let exact = Problem::new(small.clone()).alternatives(poses_of.clone());
        let exact = shortest(&exact, 0);
        assert!(exact.optimal);
        poses_of.extend((poses..poses + 3).map(|extra| vec![extra]));
        let costs = CostMatrix::from_fn(poses + 3, |i, j| {
            if i.max(j) < poses {
                small.cost(i, j)
            } else {
                f64::from(u8::from(i != j)) * 2.0
            }
        })
        .unwrap();
        let large = Rules {
            stages: vec![0; poses_of.len()],
            poses_of,
            precedence: Vec::new(),
        };
        let problem = large.problem(costs);
        assert!(problem.costs().is_symmetric());
        let options = Options {
            seed,
            kicks: 3_000,
            report_every: 500,
        };
        let searched = solve(&problem, &options, &mut |progress| {
            assert!(large.allow(progress.order) && progress.cost <= progress.given_cost);
            true
        })
        .unwrap();
        assert!(!searched.optimal && large.allow(&searched.order));
        assert_eq!(searched.cost, problem.costs().path_cost(&searched.order));
        assert!((searched.cost - exact.cost - 6.0).abs() < 1e-6, "{seed}");
        assert_eq!(searched, solve(&problem, &options, &mut |_| true).unwrap());
    }
}

/// Where few points have so many poses that no exact table is kept, and where an end is fixed at one of its poses.
#[test]
fn few_points_of_many_poses_are_searched() {
    for (points, poses) in [(2, 60), (5, 30), (8, 15), (11, 12)] {
        let poses_of = rules(points, poses, 7).poses_of;
        let poses = points * poses;
        let one_way = table(poses, 7);
        let costs = CostMatrix::from_fn(poses, |i, j| one_way.cost(i.min(j), i.max(j))).unwrap();
        let free = Problem::new(costs).alternatives(poses_of);
        let best = shortest(&free, 2_000);
        let (first, last) = (best.order[0], best.order[points - 1]);
        let fixed = shortest(&free.starting_at(first).ending_at(last), 2_000);
        assert_eq!([fixed.order[0], fixed.order[points - 1]], [first, last]);
        assert!((fixed.cost - best.cost).abs() < 1e-9, "{points} points");
    }
}

#[test]
fn searched_orders_keep_every_rule() {
    for (points, poses) in [(20, 1), (40, 3), (90, 2)] {
        let rules = rules(points, poses, 4);
        let problem = rules.problem(table(points * poses, 4));
        let mut reports = 0;
        let options = Options {
            seed: 5,
            kicks: 1_000,
            report_every: 50,
        };
        let solution = solve(&problem, &options, &mut |progress| {
            assert!(rules.allow(progress.order), "{:?}", progress.order);
            reports += 1;
            true
        })
        .unwrap();
        assert_eq!(reports, 21);
        assert!(rules.allow(&solution.given) && solution.cost < solution.given_cost);
        assert_eq!(solution.cost, problem.costs().path_cost(&solution.order));
        assert_eq!(solution, solve(&problem, &options, &mut |_| true).unwrap());
    }
}

/// More freedom never makes the answer longer: with poses and rules against either alone.
#[test]
fn poses_help_and_rules_cost() {
    for seed in 0..5 {
        let all = rules(12, 2, seed);
        let costs = table(24, seed);
        let free = Rules {
            poses_of: all.poses_of.clone(),
            stages: vec![0; 12],
            precedence: Vec::new(),
        };
        let first = CostMatrix::from_fn(12, |i, j| costs.cost(i, j)).unwrap();
        let one_pose = Problem::new(first)
            .stages(all.stages.clone())
            .precedence(all.precedence.clone());
        let both = shortest(&all.problem(costs.clone()), 0).cost;
        assert!(both <= shortest(&one_pose, 0).cost + 1e-12);
        assert!(both >= shortest(&free.problem(costs), 0).cost - 1e-12);
    }
}

#[test]
fn contradictions_are_named() {
    let problem = Problem::new(table(5, 1));
    assert_eq!(
        problem
            .clone()
            .precedence(vec![(1, 2), (2, 3), (3, 1)])
            .check(),
        Err(ProblemError::Contradiction(1))
    );
    assert!(matches!(
        problem
            .clone()
            .starting_at(2)
            .precedence(vec![(1, 2)])
            .check(),
        Err(ProblemError::Contradiction(_))
    ));
    assert!(matches!(
        problem
            .clone()
            .ending_at(0)
            .stages(vec![0, 1, 1, 1, 1])
            .check(),
        Err(ProblemError::Contradiction(_))
    ));
    assert_eq!(
        problem.clone().stages(vec![0]).check(),
        Err(ProblemError::Stages {
            stages: 1,
            points: 5
        })
    );
    assert_eq!(
        problem.clone().precedence(vec![(0, 5)]).check(),
        Err(ProblemError::Precedence {
            point: 5,
            points: 5
        })
    );
    let halves = vec![vec![0, 1], vec![2, 3]];
    assert_eq!(
        problem.clone().alternatives(halves).check(),
        Err(ProblemError::Alternatives(4))
    );
    assert_eq!(
        problem.clone().alternatives(vec![vec![], vec![0]]).check(),
        Err(ProblemError::NoPose(0))
    );
    assert_eq!(
        problem
            .precedence(vec![(0, 1)])
            .given(vec![1, 0, 2, 3, 4])
            .check(),
        Err(ProblemError::GivenForbidden(1))
    );
}
