//! A year of a hall: `cargo run --release --example year -- FOLDER [MACHINES] [SESSIONS]` writes recordings with known
//! histories below FOLDER, adds them to the lake FOLDER/lake, and prints what the trends have found of them. Times are of
//! this run.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use probecell_fleet::lake::Lake;
use probecell_fleet::trend::hall::{Options, conclude};
use probecell_fleet::trend::series::{events, series};
use probecell_fleet::year::judge::judge;
use probecell_fleet::year::{Size, make};

#[expect(clippy::print_stdout, reason = "this is a program")]
fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().context("the first argument is a folder")?);
    let mut number = |default: usize| arguments.next().map_or(Ok(default), |text| text.parse());
    let size = Size {
        machines: number(50)?,
        sessions: number(400)?,
        seed: 1,
    };
    std::fs::create_dir_all(&folder)?;
    let bags = folder.join("bags");
    let clock = Instant::now();
    let (planted, services) = make(&bags, size)?;
    println!(
        "made {} sessions: {:.1} s",
        size.machines * size.sessions,
        clock.elapsed().as_secs_f64()
    );
    let clock = Instant::now();
    let lake = Lake::open_or_create(&folder.join("lake"))?;
    let added = lake.add(&[bags], &mut |_, _| {})?;
    lake.add_events(&services)?;
    println!(
        "added {}: {:.1} s",
        added.new,
        clock.elapsed().as_secs_f64()
    );
    let clock = Instant::now();
    let (before, after) = lake.compact()?;
    println!(
        "{before} files became {after}: {:.1} s",
        clock.elapsed().as_secs_f64()
    );
    let clock = Instant::now();
    let series = series(&lake, 5)?;
    let options = Options {
        false_alarms: 1.0,
        limits: [("axis.X.scale.k".to_owned(), 5e-5)].into(),
    };
    let conclusions = conclude(&series, &events(&lake)?, &options);
    println!("trends: {:.1} s", clock.elapsed().as_secs_f64());
    println!("{}", conclusions.text());
    println!(
        "{}",
        serde_json::to_string_pretty(&judge(&planted, &series, &conclusions))?
    );
    Ok(())
}
