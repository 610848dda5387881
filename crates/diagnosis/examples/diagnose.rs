//! Diagnoses bags: `diagnose [--json] BAG…`. The command `probecell diagnose` is the same with more choices.
#![expect(clippy::print_stdout, reason = "a program for a person")]

use std::path::Path;

use anyhow::Result;
use diagnosis::{Options, diagnose};

mod common;

fn main() -> Result<()> {
    let (flags, paths): (Vec<String>, Vec<String>) = std::env::args()
        .skip(1)
        .partition(|argument| argument.starts_with("--"));
    for path in paths {
        let session = common::read(Path::new(&path))?;
        let report = diagnose(&session, &Options::default())?;
        if flags.iter().any(|flag| flag == "--json") {
            println!("{}", serde_json::to_string_pretty(&report)?);
        } else {
            println!("{report}");
        }
    }
    Ok(())
}
