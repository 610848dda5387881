//! Measures the gap to the published best length, in CPU time, on TSPLIB instances kept beside the project.
//!
//! `cargo bench -p planning --bench tsplib -- tsp|atsp|gtsp|sop [seconds] [seeds] [instance …]` runs seeds 1 to `seeds`. With
//! `lengths SECONDS SEEDS FILE` it prints length, CPU seconds and kicks for each seed, of any file of coordinates.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a bench talks to a person and stops at bad files"
)]

use std::path::PathBuf;

use cpu_time::ThreadTime;
use planning::{CostMatrix, Options, Problem, solve};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{RngCore, SeedableRng};

/// Published optima of the asymmetric instances (TSPLIB 95).
const ATSP: [(&str, f64); 19] = [
    ("br17", 39.0),
    ("ft53", 6905.0),
    ("ft70", 38673.0),
    ("ftv33", 1286.0),
    ("ftv35", 1473.0),
    ("ftv38", 1530.0),
    ("ftv44", 1613.0),
    ("ftv47", 1776.0),
    ("ftv55", 1608.0),
    ("ftv64", 1839.0),
    ("ftv70", 1950.0),
    ("ftv170", 2755.0),
    ("kro124p", 36230.0),
    ("p43", 5620.0),
    ("rbg323", 1326.0),
    ("rbg358", 1163.0),
    ("rbg403", 2465.0),
    ("rbg443", 2720.0),
    ("ry48p", 14422.0),
];

/// Regenerated clusters of these differ from the published ones.
const LEFT_OUT: [&str; 2] = ["45tsp225", "212u1060"];

fn library() -> PathBuf {
    PathBuf::from(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/tsplib"
    ))
}

fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace()
        .map_while(|word| word.parse().ok())
        .collect()
}

/// Lengths between cities: rounded distances of coordinates, or the table as it stands.
fn lengths(text: &str) -> (usize, Box<dyn Fn(usize, usize) -> f64>) {
    if let Some(section) = text.split("EDGE_WEIGHT_SECTION").nth(1) {
        let table = numbers(section);
        let square = |count: usize| (count as f64).sqrt().round() as usize;
        // Sequential ordering files repeat the number of cities first.
        let repeated = square(table.len()).pow(2) != table.len();
        let table = table[usize::from(repeated)..].to_vec();
        let cities = square(table.len());
        return (cities, Box::new(move |i, j| table[i * cities + j]));
    }
    let up = text.contains("CEIL_2D");
    let table = numbers(text.split("NODE_COORD_SECTION").nth(1).unwrap());
    let cities = table.len() / 3;
    let distance = move |i: usize, j: usize| {
        let length =
            (table[3 * i + 1] - table[3 * j + 1]).hypot(table[3 * i + 2] - table[3 * j + 2]);
        if up {
            length.ceil()
        } else {
            (length + 0.5).floor()
        }
    };
    (cities, Box::new(distance))
}

/// A closed tour as an open path from a city to a copy of it. Some files list their cities in the order of the best
/// tour, so they are shuffled.
fn closed(text: &str) -> Problem {
    let (cities, length) = lengths(text);
    let mut rng = Pcg32::seed_from_u64(1);
    let mut labels: Vec<usize> = (0..cities).collect();
    for i in (1..cities).rev() {
        labels.swap(i, rng.next_u32() as usize % (i + 1));
    }
    let length = |i: usize, j: usize| {
        let [i, j] = [labels[i % cities], labels[j % cities]];
        if i == j { 0.0 } else { length(i, j) }
    };
    Problem::new(CostMatrix::from_fn(cities + 1, length).unwrap())
        .starting_at(0)
        .ending_at(cities)
}

/// A closed generalised tour. The path begins and ends in copies of the smallest cluster; that both are the same
/// pose is not a rule the solver knows, so each pose of that cluster is tried as a fixed end.
fn clustered(text: &str) -> Vec<Problem> {
    let (cities, length) = lengths(text);
    let section = text.split("GTSP_SET_SECTION").nth(1).unwrap();
    let mut clusters: Vec<Vec<usize>> = Vec::new();
    let mut row = Vec::new();
    for number in numbers(section) {
        if number < 0.0 {
            clusters.push(
                row[1..]
                    .iter()
                    .map(|&city: &f64| city as usize - 1)
                    .collect(),
            );
            row.clear();
        } else {
            row.push(number);
        }
    }
    let smallest = (0..clusters.len())
        .min_by_key(|&cluster| clusters[cluster].len())
        .unwrap();
    let ends = clusters[smallest].clone();
    let pose = |i: usize, end: usize| if i == cities { end } else { i };
    ends.into_iter()
        .map(|end| {
            let costs =
                CostMatrix::from_fn(cities + 1, |i, j| length(pose(i, end), pose(j, end))).unwrap();
            let copy = std::iter::once(vec![cities]);
            Problem::new(costs)
                .alternatives(clusters.iter().cloned().chain(copy).collect())
                .starting_at(end)
                .ending_at(cities)
        })
        .collect()
}

/// Entries of -1 say that the column comes first.
fn sequential(text: &str) -> Problem {
    let (cities, length) = lengths(text);
    let pairs = (0..cities).flat_map(|i| (0..cities).map(move |j| (i, j)));
    let precedence = pairs
        .filter(|&(i, j)| length(i, j) < 0.0)
        .map(|(i, j)| (j, i))
        .collect();
    Problem::new(CostMatrix::from_fn(cities, |i, j| length(i, j).max(0.0)).unwrap())
        .precedence(precedence)
        .starting_at(0)
        .ending_at(cities - 1)
}

fn best_known(kind: &str, name: &str) -> Option<f64> {
    let csv = |file: &str| {
        let text = std::fs::read_to_string(library().join(file)).ok()?;
        let line = text.lines().find_map(|line| {
            line.strip_prefix(name)?
                .strip_prefix(',')
                .map(str::to_owned)
        })?;
        line.split(',').next()?.parse().ok()
    };
    match kind {
        "tsp" => {
            let text = std::fs::read_to_string(library().join("solutions_stsp.txt")).ok()?;
            let line = text
                .lines()
                .find_map(|line| line.strip_prefix(name)?.strip_prefix(" :"))?;
            line.split_whitespace().next()?.parse().ok()
        }
        "atsp" => ATSP
            .iter()
            .find(|(instance, _)| *instance == name)
            .map(|&(_, best)| best),
        _ => csv(&format!("{kind}/best_known.csv")),
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|argument| argument != "--bench")
        .collect();
    let kinds: Vec<&str> = match arguments.first() {
        Some(kind) => vec![kind],
        None => vec!["tsp", "atsp", "gtsp", "sop"],
    };
    let seconds: f64 = arguments
        .get(1)
        .map_or(1.0, |seconds| seconds.parse().unwrap());
    let seeds: u64 = arguments.get(2).map_or(1, |seeds| seeds.parse().unwrap());
    if let [kind, _, _, path] = &arguments[..]
        && kind == "lengths"
    {
        let problem = closed(&std::fs::read_to_string(path).unwrap());
        for seed in 1..=seeds {
            let run = Run::new(std::slice::from_ref(&problem), seed, seconds);
            println!("{} {:.2} {}", run.found, run.spent, run.kicks);
        }
        return;
    }
    for kind in kinds {
        run(kind, seconds, seeds, arguments.get(3..).unwrap_or_default());
    }
}

fn run(kind: &str, seconds: f64, seeds: u64, wanted: &[String]) {
    let Ok(files) = std::fs::read_dir(library().join(kind)) else {
        println!("skipped: no {kind} instances");
        return;
    };
    let digits = |name: &str| {
        let tail = name
            .trim_start_matches(|c: char| c.is_ascii_digit())
            .trim_start_matches(|c: char| c.is_alphabetic());
        tail.split('.')
            .next()
            .and_then(|size| size.trim_end_matches(char::is_alphabetic).parse().ok())
            .unwrap_or(0_usize)
    };
    let mut instances: Vec<(usize, String)> = files
        .map(|file| file.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == kind))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .filter(|name| wanted.is_empty() && !LEFT_OUT.contains(&&name[..]) || wanted.contains(name))
        .map(|name| (digits(&name), name))
        .collect();
    instances.sort();
    println!(
        "{kind:<10} {:>9} {:>8} {:>8} {:>9} {:>6}",
        "best", "gap %", "worst %", "kicks", "CPU s"
    );
    let mut gaps = Vec::new();
    for (_, name) in &instances {
        let Some(best) = best_known(kind, name) else {
            continue;
        };
        let text =
            std::fs::read_to_string(library().join(kind).join(format!("{name}.{kind}"))).unwrap();
        let problems = match kind {
            "gtsp" => clustered(&text),
            "sop" => vec![sequential(&text)],
            _ => vec![closed(&text)],
        };
        let mut runs: Vec<Run> = (1..=seeds)
            .map(|seed| Run::new(&problems, seed, seconds))
            .collect();
        runs.sort_by(|a, b| a.found.total_cmp(&b.found));
        let gap = |run: &Run| 100.0 * (run.found / best - 1.0);
        let (median, worst) = (&runs[runs.len() / 2], &runs[runs.len() - 1]);
        gaps.push(gap(median));
        println!(
            "{name:<10} {best:>9} {:>8.3} {:>8.3} {:>9} {:>6.2}",
            gap(median),
            gap(worst),
            median.kicks,
            median.spent
        );
    }
    gaps.sort_by(f64::total_cmp);
    if let (Some(median), Some(worst)) = (gaps.get(gaps.len() / 2), gaps.last()) {
        let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
        println!("mean {mean:.3}, median {median:.3}, worst {worst:.3}\n");
    }
}

/// One search with one seed, the time shared by the problems.
struct Run {
    found: f64,
    kicks: u64,
    /// CPU time, s.
    spent: f64,
}

impl Run {
    fn new(problems: &[Problem], seed: u64, seconds: f64) -> Self {
        let share = seconds / problems.len() as f64;
        let begun = ThreadTime::now();
        let (mut found, mut kicks) = (f64::INFINITY, 0);
        for problem in problems {
            let options = Options {
                seed,
                kicks: 100_000_000,
                report_every: 100,
            };
            let begun = ThreadTime::now();
            let solution = solve(problem, &options, &mut |_| {
                begun.elapsed().as_secs_f64() < share
            })
            .unwrap();
            found = found.min(solution.cost);
            kicks += solution.kicks;
        }
        Self {
            found,
            kicks,
            spent: begun.elapsed().as_secs_f64(),
        }
    }
}
