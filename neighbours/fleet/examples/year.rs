//! A year of a hall: `cargo run --release --example year -- FOLDER [MACHINES] [SESSIONS] [SEED]` writes recordings with known
//! histories below FOLDER, adds them to the lake FOLDER/lake, and prints what the trends have found of them. What is there
//! already is judged again. Times are of this run.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use probecell_fleet::lake::{Event, Lake};
use probecell_fleet::trend::hall::{Options, conclude};
use probecell_fleet::trend::series::{events, series};
use probecell_fleet::year::judge::judge;
use probecell_fleet::year::{Planted, Size, make};

/// Names of the files below the folder.
const PLANTED: &str = "planted.json";

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().context("the first argument is a folder")?);
    let mut number = |default: usize| arguments.next().map_or(Ok(default), |text| text.parse());
    let size = Size {
        machines: number(50)?,
        sessions: number(400)?,
        seed: number(1)? as u64,
    };
    let planted = recordings(&folder, size)?;
    let lake = lake_of(&folder, size, &planted.1)?;
    let planted = planted.0;
    let series = timed("series of the lake", || series(&lake, 5))?;
    let options = Options {
        false_alarms: 1.0,
        limits: [("axis.X.scale.k".to_owned(), 5e-5)].into(),
    };
    let events = events(&lake)?;
    let conclusions = timed("trends", || Ok(conclude(&series, &events, &options)))?;
    let card = judge(&planted, &series, &conclusions);
    print(&format!(
        "{}\n{}",
        conclusions.text(),
        serde_json::to_string_pretty(&card)?
    ));
    Ok(())
}

/// Makes the recordings, unless they are there, and gives what was planted and what is on record.
fn recordings(folder: &Path, size: Size) -> anyhow::Result<(Vec<Planted>, Vec<Event>)> {
    let file = folder.join(PLANTED);
    if file.is_file() {
        return Ok(serde_json::from_slice(&fs::read(file)?)?);
    }
    fs::create_dir_all(folder)?;
    let made = timed("recordings", || make(&folder.join("bags"), size))?;
    fs::write(file, serde_json::to_vec_pretty(&made)?)?;
    Ok(made)
}

/// Adds the recordings to the lake, unless it is there.
fn lake_of(folder: &Path, size: Size, services: &[Event]) -> anyhow::Result<Lake> {
    let place = folder.join("lake");
    if place.is_dir() {
        return Lake::open(&place);
    }
    let lake = Lake::open_or_create(&place)?;
    let added = timed("lake add", || {
        lake.add(&[folder.join("bags")], &mut |_, _| {})
    })?;
    anyhow::ensure!(added.new == size.machines * size.sessions, "{added:?}");
    lake.add_events(services)?;
    let (before, after) = timed("lake compact", || lake.compact())?;
    print(&format!("{before} files became {after}"));
    Ok(lake)
}

/// What `work` gives, and how long it took.
fn timed<T>(what: &str, work: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    let clock = Instant::now();
    let done = work()?;
    print(&format!("{what}: {:.1} s", clock.elapsed().as_secs_f64()));
    Ok(done)
}

#[expect(clippy::print_stdout, reason = "this is a program")]
fn print(text: &str) {
    println!("{text}");
}
