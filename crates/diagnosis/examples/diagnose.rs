//! Diagnoses bags: `diagnose [--json] [--without=EFFECT]… BAG…`; an effect that a machine lacks is ignored. The command `probecell diagnose` is the same with more choices.
#![expect(clippy::print_stdout, reason = "a program for a person")]

use std::path::Path;

use anyhow::Result;
use diagnosis::{Options, diagnose};
use effects::vocabulary::identifiers;
use machine::Chain;

mod common;

fn main() -> Result<()> {
    let (flags, paths): (Vec<String>, Vec<String>) = std::env::args()
        .skip(1)
        .partition(|argument| argument.starts_with("--"));
    for path in paths {
        let session = common::read(Path::new(&path))?;
        let known = Chain::from_urdf(&session.robot_description)
            .map(|chain| identifiers(&chain))
            .unwrap_or_default();
        let without = flags
            .iter()
            .filter_map(|flag| flag.strip_prefix("--without="));
        let options = Options {
            without: without
                .map(str::to_owned)
                .filter(|effect| known.contains(effect))
                .collect(),
            ..Options::default()
        };
        let report = diagnose(&session, &options)?;
        if flags.iter().any(|flag| flag == "--json") {
            println!("{}", serde_json::to_string_pretty(&report)?);
        } else {
            println!("{report}");
        }
    }
    Ok(())
}
