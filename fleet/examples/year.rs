//! A year of a hall: `cargo run --release --example year -- FOLDER [MACHINES] [SESSIONS]` writes recordings with known
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
        seed: 1,
    };
    let planted: Vec<Planted> = if folder.join(PLANTED).is_file() {
        serde_json::from_slice(&fs::read(folder.join(PLANTED))?)?
    } else {
        lake_of(&folder, size)?
    };
    let lake = Lake::open(&folder.join("lake"))?;
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

/// Makes the recordings and their lake, and gives what was planted.
fn lake_of(folder: &Path, size: Size) -> anyhow::Result<Vec<Planted>> {
    fs::create_dir_all(folder)?;
    let bags = folder.join("bags");
    let (planted, services): (Vec<Planted>, Vec<Event>) =
        timed("recordings", || make(&bags, size))?;
    let lake = Lake::open_or_create(&folder.join("lake"))?;
    let added = timed("lake add", || lake.add(&[bags], &mut |_, _| {}))?;
    anyhow::ensure!(added.new == size.machines * size.sessions, "{added:?}");
    lake.add_events(&services)?;
    let (before, after) = timed("lake compact", || lake.compact())?;
    print(&format!("{before} files became {after}"));
    fs::write(folder.join(PLANTED), serde_json::to_vec_pretty(&planted)?)?;
    Ok(planted)
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
