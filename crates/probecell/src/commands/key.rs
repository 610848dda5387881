//! `probecell key`: the keys of the operators of a cell.

use std::path::{Path, PathBuf};

use cell::keys::{KeyFolder, new_operator_key};
use clap::Subcommand;
use serde_json::json;
use signatures::PublicKey;

use crate::{DEFAULT_CELL, GOOD, output, ros_arguments::read_cell};

/// What is done with keys.
#[derive(Subcommand)]
pub(crate) enum Command {
    /// Make a private key for an operator, and register its public half for the cell.
    New {
        /// Name of the operator.
        name: String,
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
    },
    /// Register the public key of an operator who works as another user, or on another device.
    Add {
        /// Name of the operator.
        name: String,
        /// Public key: 64 hexadecimal digits.
        key: PublicKey,
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
    },
    /// List the operators of the cell, and its own public key.
    List {
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Withdraw the keys of an operator: a running cell refuses them within a second.
    Revoke {
        /// Name of the operator.
        name: String,
        /// Cell file.
        #[arg(long, default_value = DEFAULT_CELL)]
        cell: PathBuf,
    },
}

/// Carries it out.
pub(crate) fn run(command: &Command) -> anyhow::Result<u8> {
    match command {
        Command::New { name, cell } => {
            let folder = folder(cell)?;
            let (key, file) = new_operator_key(name)?;
            folder.register(name, key.public())?;
            let public = key.public();
            output::line(&format!(
                "{name}: public key {public}, private key in {}",
                file.display()
            ));
        }
        Command::Add { name, key, cell } => {
            let cell = read_cell(cell)?;
            KeyFolder::of(&cell)?.register(name, *key)?;
            output::line(&format!(
                "{name}: may sign for {}; a running cell knows it within a second",
                cell.cell.name
            ));
        }
        Command::List { cell, json } => list(&folder(cell)?, *json)?,
        Command::Revoke { name, cell } => {
            let cell = read_cell(cell)?;
            KeyFolder::of(&cell)?.withdraw(name)?;
            output::line(&format!(
                "{name}: withdrawn; a running cell refuses the key within a second"
            ));
        }
    }
    Ok(GOOD)
}

fn folder(cell: &Path) -> anyhow::Result<KeyFolder> {
    Ok(KeyFolder::of(&read_cell(cell)?)?)
}

fn list(folder: &KeyFolder, json: bool) -> anyhow::Result<()> {
    let (key, operators) = (folder.public()?, folder.operators()?);
    if json {
        let key = key.to_string();
        return output::json(&json!({ "cell": key, "operators": operators.keys }));
    }
    output::line(&format!(
        "{key}  the cell itself, in {}",
        folder.path().display()
    ));
    for one in operators.keys {
        let state = if one.withdrawn { ", withdrawn" } else { "" };
        output::line(&format!("{}  {}{state}", one.key, one.name));
    }
    Ok(())
}
