//! A search that is put down, written away and taken up again after so many kicks, against one run of it.

use planning::{CostMatrix, Options, Problem, Search, Solution, solve};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{RngCore, SeedableRng};

/// Distances on a plate, of points in four far corners where `clusters`; longer by a part of itself one way.
fn table(poses: usize, clusters: bool, one_way: f64) -> CostMatrix {
    let mut rng = Pcg32::seed_from_u64(poses as u64);
    let mut draw = || f64::from(rng.next_u32()) / 4_294_967_296.0;
    let corner = |at: usize| f64::from(u8::from(at % 4 > 1)) * 50.0;
    let positions: Vec<[f64; 2]> = (0..poses)
        .map(|at| {
            let off = if clusters {
                [corner(at), corner(at + 1)]
            } else {
                [0.0; 2]
            };
            [off[0] + draw(), off[1] + draw()]
        })
        .collect();
    CostMatrix::from_fn(poses, |i, j| {
        let [a, b] = [positions[i], positions[j]];
        (a[0] - b[0]).hypot(a[1] - b[1]) * (1.0 + one_way * f64::from(u8::from(i > j)))
    })
    .unwrap()
}

fn in_threes(poses: usize) -> Vec<Vec<usize>> {
    (0..poses / 3)
        .map(|point| (3 * point..3 * point + 3).collect())
        .collect()
}

fn options(kicks: u64) -> Options {
    Options {
        kicks,
        ..Options::default()
    }
}

fn in_slices(problem: &Problem, options: &Options, slice: u64) -> Solution {
    let mut search = Search::new(problem.clone(), options).unwrap();
    let (mut share, mut cost) = (-1.0, f64::INFINITY);
    while !search.is_done() {
        assert!(search.share() > share && search.solution().cost <= cost);
        (share, cost) = (search.share(), search.solution().cost);
        let text = serde_json::to_string(&search).unwrap();
        let read: Search = serde_json::from_str(&text).unwrap();
        assert!(read == search, "what is read back is another search");
        search = read;
        search.advance(slice).unwrap();
    }
    assert_eq!(search.share(), 1.0);
    assert!(search.advance(slice).unwrap(), "nothing is left to do");
    search.solution().clone()
}

/// One of each class of search, with the kicks made and the slices: what is found does not depend on them.
#[test]
fn slices_of_any_size_give_the_path_of_one_run() {
    let plain = |poses, clusters, one_way| Problem::new(table(poses, clusters, one_way));
    let staged: Vec<u32> = (0..60).map(|point| u32::from(point % 2 == 0)).collect();
    let poses = |one_way| plain(90, false, one_way).alternatives(in_threes(90));
    let few: &[(u64, u64)] = &[(1, 150), (7, 1_100), (1_000, 1_100)];
    for (what, problem, slices) in [
        ("ring", plain(60, false, 0.0), few),
        ("ring of clusters", plain(80, true, 0.0).starting_at(3), few),
        ("large ring", plain(1_600, false, 0.0), &[(7, 45), (30, 45)]),
        (
            "walks",
            plain(220, false, 0.0).ending_at(9),
            &[(150, 1_900)],
        ),
        ("one way", plain(60, false, 0.1).ending_at(5), few),
        ("stages", plain(60, false, 0.0).stages(staged), few),
        ("poses", poses(0.0), few),
        ("poses, one way", poses(0.1).starting_at(4), few),
        ("few points", plain(9, false, 0.1), few),
        (
            "too few to kick",
            plain(14, false, 0.1).alternatives(vec![(0..14).collect()]),
            few,
        ),
    ] {
        for &(slice, kicks) in slices {
            let options = options(kicks);
            let whole = solve(&problem, &options, &mut |_| true).unwrap();
            let sliced = in_slices(&problem, &options, slice);
            assert_eq!(sliced, whole, "{what}, slices of {slice}");
        }
    }
}

#[test]
fn a_search_stopped_in_the_middle_has_an_answer_no_longer_than_the_order_given() {
    let problem =
        Problem::new(table(200, false, 0.1)).stages((0..200).map(|at| at / 100).collect());
    let mut search = Search::new(problem.clone(), &options(100_000)).unwrap();
    for _ in 0..3 {
        assert!(!search.advance(100).unwrap());
        let solution = search.solution();
        assert!(solution.cost <= solution.given_cost && !solution.optimal);
        assert_eq!(solution.cost, problem.costs().path_cost(&solution.order));
    }
    assert_eq!(search.solution().kicks, 300);
}

#[test]
fn a_contradiction_is_told_before_anything_is_searched() {
    let problem = Problem::new(table(20, false, 0.0)).starting_at(20);
    assert!(Search::new(problem, &options(10)).is_err());
}
