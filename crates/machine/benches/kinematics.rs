//! Times forward kinematics with all link-error derivatives: `cargo bench -p machine`. `benches/pin_kinematics.py` runs
//! Pinocchio beside it and compares the numbers.
//!
//! Prints one line per machine and task: machine, task, poses per second (the fastest of several runs). With an argument
//! `check` it prints, for the first poses, the ball in the part and its derivatives instead.

use std::hint::black_box;
use std::io::Write;
use std::time::Instant;

use machine::Chain;
use machine::models::WCBXFZYST;
use nalgebra::{Isometry3, Point3};

const ARM: &str = include_str!("arm.urdf");
const POSES: usize = 20_000;
const RUNS: usize = 9;
const CHECKED: usize = 5;

/// Positions of axis `axis` in pose `pose`; the script makes the same.
fn position(pose: usize, axis: usize) -> f64 {
    0.3 * (0.37 * pose as f64 + 1.7 * axis as f64).sin()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::stdout().lock();
    let (part, ball) = (Isometry3::identity(), Point3::new(0.001, 0.002, -0.15));
    let check = std::env::args().any(|argument| argument == "check");
    for (name, text) in [("wcbxfzyst", WCBXFZYST), ("arm", ARM)] {
        let chain = Chain::from_urdf(text)?;
        let axes = chain.axes().len();
        let poses: Vec<Vec<f64>> = (0..POSES)
            .map(|pose| (0..axes).map(|axis| position(pose, axis)).collect())
            .collect();
        if check {
            for pose in &poses[..CHECKED] {
                let sensitivity = chain.sensitivity(pose, &part, &ball);
                let location = chain
                    .axes()
                    .iter()
                    .flat_map(|&joint| &sensitivity.location[joint]);
                let values = (sensitivity.ball.iter())
                    .chain(location.flat_map(|column| column.iter()))
                    .map(f64::to_string)
                    .collect::<Vec<_>>();
                writeln!(out, "{name} {}", values.join(" "))?;
            }
            continue;
        }
        let time = |task: &dyn Fn(&[f64]) -> f64| {
            let fastest = (0..RUNS)
                .map(|_| {
                    let begin = Instant::now();
                    for pose in &poses {
                        black_box(task(black_box(pose)));
                    }
                    begin.elapsed().as_secs_f64()
                })
                .fold(f64::INFINITY, f64::min);
            POSES as f64 / fastest
        };
        let forward = time(&|pose| chain.ball_in_part(pose, &part, &ball).x);
        let links = time(&|pose| chain.sensitivity(pose, &part, &ball).location[0][3].y);
        writeln!(out, "{name} forward {forward:.0}")?;
        writeln!(out, "{name} links {links:.0}")?;
    }
    Ok(())
}
