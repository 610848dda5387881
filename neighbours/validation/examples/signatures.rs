//! Writes what the diagnosis of touches sees as a regression problem, for other methods to solve.
//!
//! `signatures BAG... FOLDER`: bags laid out together. `signatures --blind SEED CONTENT FOLDER`: a sealed session
//! (`clean`, `known1` to `known3`, `strange`, `mixed`) with its truth. `matrix.npy` holds one row for each touch and
//! reference value and one column for each parameter of each effect, m per unit; `problem.json` the weighted
//! deviations, and effect, variant, shape and plausible size of every column, the truth and our own report with its
//! time. Variants with a nonlinear parameter stand at up to [`SHAPES`] of its values.

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use bags::Measurement;
use diagnosis::{Options, Session, diagnose_together_with_residuals};
use diagnosis::{diagnose, joint::Joined};
use effects::library;
use validation::blind::{Content, session};

/// Values of a nonlinear parameter that are written at most.
const SHAPES: usize = 8;

/// The session of a bag.
fn read(bag: &Path) -> anyhow::Result<Session> {
    Ok(session_io::measured(bag, &Measurement::Last, None)?.session)
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((folder, given)) = arguments
        .split_last()
        .filter(|(_, given)| !given.is_empty())
    else {
        anyhow::bail!("usage: signatures BAG... FOLDER, or signatures --blind SEED CONTENT FOLDER");
    };
    let (sessions, truth) = sessions(given)?;
    let begun = Instant::now();
    let report = match sessions.as_slice() {
        [one] => diagnose(one, &Options::default())?,
        several => diagnose_together_with_residuals(several, &[], &Options::default())?.0,
    };
    let took = begun.elapsed().as_secs_f64() * 1e3;
    let joined = Joined::new(&sessions.iter().collect::<Vec<_>>())?;
    let observations = &joined.observations;
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let mut about = Vec::new();
    for (number, variant) in library(observations).iter().enumerate() {
        let trials = variant.shape.as_ref().map_or_else(
            || vec![0.0],
            |shape| {
                let stride = shape.trials.len().div_ceil(SHAPES);
                shape.trials.iter().copied().step_by(stride).collect()
            },
        );
        for shape in trials {
            let built = variant.columns(observations, shape);
            for (column, parameter) in built.into_iter().zip(&variant.parameters) {
                let rows = column.signature.iter().zip(&observations.rows);
                columns.push(rows.map(|(value, row)| value * row.weight).collect());
                about.push(serde_json::json!({
                    "effect": variant.effect, "variant": number, "shape": shape,
                    "parameter": parameter.name, "plausible": parameter.plausible,
                }));
            }
        }
    }
    let y: Vec<f64> = (observations.deviations.iter().zip(&observations.rows))
        .map(|(deviation, row)| deviation * row.weight)
        .collect();
    std::fs::create_dir_all(folder)?;
    let folder = Path::new(folder);
    let problem = serde_json::json!({
        "y": y, "columns": about, "session": joined.session, "truth": truth,
        "report": report, "ms": took,
    });
    std::fs::write(folder.join("problem.json"), problem.to_string())?;
    write_npy(&folder.join("matrix.npy"), &columns, y.len())
}

/// The sessions that are asked for, and what is hidden in them where it is known.
fn sessions(given: &[String]) -> anyhow::Result<(Vec<Session>, Option<Vec<String>>)> {
    if let [flag, seed, content] = given
        && flag == "--blind"
    {
        let content = match content.as_str() {
            "clean" => Content::Clean,
            "known1" => Content::Known(1),
            "known2" => Content::Known(2),
            "known3" => Content::Known(3),
            "strange" => Content::Strange,
            "mixed" => Content::Mixed,
            other => anyhow::bail!("there is no content `{other}`"),
        };
        let (session, truth) = session(seed.parse()?, content);
        return Ok((vec![session], Some(truth.effects)));
    }
    let read = given.iter().map(|bag| read(Path::new(bag)));
    Ok((read.collect::<anyhow::Result<Vec<_>>>()?, None))
}

/// Columns as a NumPy array of shape (rows, columns), Fortran order.
fn write_npy(path: &Path, columns: &[Vec<f64>], rows: usize) -> anyhow::Result<()> {
    let mut header = format!(
        "{{'descr': '<f8', 'fortran_order': True, 'shape': ({rows}, {}), }}",
        columns.len()
    );
    // Magic, version, length and header together fill whole units of 64 bytes, the last of them a line feed.
    let padding = 64 - (10 + header.len() + 1) % 64;
    header.extend(std::iter::repeat_n(' ', padding % 64));
    header.push('\n');
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    file.write_all(b"\x93NUMPY\x01\x00")?;
    file.write_all(&u16::try_from(header.len())?.to_le_bytes())?;
    file.write_all(header.as_bytes())?;
    for value in columns.iter().flatten() {
        file.write_all(&value.to_le_bytes())?;
    }
    Ok(file.flush()?)
}
