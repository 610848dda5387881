//! Measures the gap to the published optimum, in CPU time, on TSPLIB instances kept beside the project.
//!
//! `cargo bench -p planning --bench tsplib -- [seconds] [instance …]`
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a bench talks to a person and stops at bad files"
)]

use std::path::PathBuf;

use cpu_time::ThreadTime;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{RngCore, SeedableRng};
use planning::{CostMatrix, Options, Problem, solve};

fn library() -> PathBuf {
    PathBuf::from(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/tsplib"
    ))
}

/// Integer distances of a coordinate instance.
fn distances(text: &str) -> (usize, impl Fn(usize, usize) -> f64) {
    let up = text.contains("CEIL_2D");
    let section = text.split("NODE_COORD_SECTION").nth(1).unwrap();
    let points: Vec<[f64; 2]> = section
        .lines()
        .map(|line| line.split_whitespace().collect::<Vec<_>>())
        .filter(|fields| fields.len() == 3)
        .map(|fields| [fields[1].parse().unwrap(), fields[2].parse().unwrap()])
        .collect();
    (points.len(), move |i, j| {
        let distance = (points[i][0] - points[j][0]).hypot(points[i][1] - points[j][1]);
        if up {
            distance.ceil()
        } else {
            (distance + 0.5).floor()
        }
    })
}

fn main() {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let seconds: f64 = arguments.first().map_or(1.0, |a| a.parse().unwrap());
    let Ok(optima) = std::fs::read_to_string(library().join("solutions_stsp.txt")) else {
        println!("skipped: no instances");
        return;
    };
    let wanted = &arguments[arguments.len().min(1)..];
    let mut instances: Vec<(usize, String)> = std::fs::read_dir(library().join("tsp"))
        .unwrap()
        .map(|entry| {
            entry
                .unwrap()
                .path()
                .file_stem()
                .unwrap()
                .to_string_lossy()
                .into_owned()
        })
        .filter(|name| wanted.is_empty() || wanted.contains(name))
        .map(|name| {
            (
                name.trim_start_matches(|c: char| c.is_alphabetic())
                    .parse()
                    .unwrap(),
                name,
            )
        })
        .collect();
    instances.sort();
    println!(
        "{:<10} {:>8} {:>8} {:>8} {:>9} {:>6}",
        "instance", "optimum", "found", "gap %", "kicks", "CPU s"
    );
    let mut total = 0.0;
    for (_, name) in &instances {
        let optimum: f64 = optima
            .lines()
            .find_map(|line| line.strip_prefix(&format!("{name} :")))
            .unwrap()
            .split_whitespace()
            .next()
            .unwrap()
            .parse()
            .unwrap();
        let text =
            std::fs::read_to_string(library().join("tsp").join(format!("{name}.tsp"))).unwrap();
        let (cities, distance) = distances(&text);
        // Some files list their cities in the order of the best tour: shuffle.
        let mut rng = Pcg32::seed_from_u64(1);
        let mut labels: Vec<usize> = (0..cities).collect();
        for i in (1..cities).rev() {
            labels.swap(i, rng.next_u32() as usize % (i + 1));
        }
        // A closed tour is an open path from a city to a copy of it.
        let costs =
            CostMatrix::from_fn(cities + 1, |i, j| distance(labels[i % cities], labels[j % cities])).unwrap();
        let problem = Problem::new(costs).starting_at(0).ending_at(cities);
        let options = Options {
            seed: 1,
            kicks: 100_000_000,
            report_every: 100,
        };
        let begun = ThreadTime::now();
        let solution = solve(&problem, &options, &mut |_| {
            begun.elapsed().as_secs_f64() < seconds
        })
        .unwrap();
        let gap = 100.0 * (solution.cost / optimum - 1.0);
        total += gap;
        println!(
            "{name:<10} {optimum:>8} {:>8} {gap:>8.3} {:>9} {:>6.2}",
            solution.cost,
            solution.kicks,
            begun.elapsed().as_secs_f64()
        );
    }
    println!("mean {:.3}", total / instances.len() as f64);
}
