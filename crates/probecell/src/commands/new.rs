//! `probecell new`: a cell to begin with.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use cell::new_robot::{Wanted, new_robot};
use session_io::import::text_of;

use crate::{GOOD, output};

/// What to begin with.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// A cell for an arm, from the robot description that its maker ships.
    Robot(Robot),
}

/// What the user says of the arm.
#[derive(clap::Args)]
#[command(
    after_help = "The cell checks the joints on three reference balls, on the simulated arm first.\n\n\
Examples:\n  \
probecell new robot --urdf ur10e.urdf --mount tool0 --out my_robot\n  \
probecell new robot --urdf panda.urdf --mount panda_link8 --hold panda_joint3=0 --out my_robot\n  \
probecell up my_robot/my_robot.toml --once"
)]
pub(crate) struct Robot {
    /// Robot description (URDF, expanded from xacro).
    #[arg(long, value_name = "FILE")]
    urdf: PathBuf,
    /// Folder to write; the cell has its name. Must not exist.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Link that carries the probe; default: the one behind the most joints.
    #[arg(long, value_name = "LINK")]
    mount: Option<String>,
    /// Direction from that link to the ball, in its frame; default: along the last axis, away from the arm.
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
    stem: Option<[f64; 3]>,
    /// From that link to the centre of the ball, mm.
    #[arg(long, value_name = "MM", default_value_t = 100.0, value_parser = length)]
    stylus_mm: f64,
    /// Radius of the ball, mm.
    #[arg(long, value_name = "MM", default_value_t = 2.0, value_parser = length)]
    ball_radius_mm: f64,
    /// A joint that stands still while the arm measures, and where, of an arm of seven or more; may be repeated.
    #[arg(long, value_name = "JOINT=DEGREES", value_parser = held, allow_hyphen_values = true)]
    hold: Vec<(String, f64)>,
}

/// Writes a cell.
pub(crate) fn run(command: &Command) -> anyhow::Result<u8> {
    let Command::Robot(arguments) = command;
    let name = arguments.out.file_name().and_then(|name| name.to_str());
    let name = name.context("--out has no name")?.to_owned();
    if arguments.out.exists() {
        bail!("{} exists: name another folder", arguments.out.display());
    }
    let file = &arguments.urdf;
    let text = text_of(file)?;
    let wanted = Wanted {
        description: format!("{name}.urdf"),
        name,
        mount: arguments.mount.clone(),
        stem: arguments.stem,
        stylus: arguments.stylus_mm * 1e-3,
        ball_radius: arguments.ball_radius_mm * 1e-3,
        held: arguments.hold.clone(),
    };
    let made = output::with_progress(|progress| new_robot(&text, &wanted, progress))
        .with_context(|| file.display().to_string())?;
    let cell = arguments.out.join(&made.text.name);
    write(
        &arguments.out.join(&wanted.description),
        &made.text.robot_description,
    )?;
    write(&cell, &made.text.cell)?;
    for assumed in &made.assumed {
        output::line(&format!("assumed: {assumed}"));
    }
    output::line(&format!("written: {}", cell.display()));
    output::line(&format!(
        "next: probecell up {} --once, then probecell diagnose of its recording",
        cell.display()
    ));
    Ok(GOOD)
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    fs::write(path, text).with_context(|| path.display().to_string())
}

fn length(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (0.1..=2000.0).contains(&value) => Ok(value),
        _ => Err("expected 0.1 to 2000 mm".to_owned()),
    }
}

fn direction(text: &str) -> Result<[f64; 3], String> {
    let wrong = || "expected three numbers that are not all 0, such as 0,0,1".to_owned();
    let each: Result<Vec<f64>, _> = text.split(',').map(|one| one.trim().parse()).collect();
    let each = <[f64; 3]>::try_from(each.map_err(|_| wrong())?).map_err(|_| wrong())?;
    let square: f64 = each.iter().map(|one| one * one).sum();
    if square.is_finite() && square > 1e-12 {
        Ok(each)
    } else {
        Err(wrong())
    }
}

fn held(text: &str) -> Result<(String, f64), String> {
    let (name, degrees) = text.split_once('=').ok_or("expected JOINT=DEGREES")?;
    match degrees.parse::<f64>() {
        Ok(value) if value.abs() <= 360.0 => Ok((name.to_owned(), value.to_radians())),
        _ => Err(format!("{degrees:?} is no angle of -360 to 360 degrees")),
    }
}
