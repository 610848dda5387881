//! Tasks of the workspace, run as `cargo run -p xtask -- TASK`.

use anyhow::{Result, bail};
use xtask::{codegen, workspace_root};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["codegen"] => codegen::write(&workspace_root()?.join("msgs")),
        _ => bail!("usage: cargo run -p xtask -- codegen"),
    }
}
