//! `probecell recover`: what can be read of a damaged recording, as a whole one.

use std::path::Path;

use crate::{GOOD, LOSS, output};

/// Writes the copy and prints what was lost.
pub(crate) fn run(from: &Path, to: &Path, later: Option<&Path>) -> anyhow::Result<u8> {
    let recovery = bags::recover(from, to, later)?;
    output::line(&format!(
        "{} messages and {} attachments recovered to {}",
        recovery.messages,
        recovery.attachments,
        to.display()
    ));
    for damage in &recovery.damage {
        output::line(&format!("damage    {damage}"));
    }
    for gap in &recovery.gaps {
        output::line(&format!("missing   {gap}"));
    }
    Ok(if recovery.lost_messages() { LOSS } else { GOOD })
}
