//! `probecell recover`: what can be read of a damaged recording, as a whole one.

use std::path::Path;

use crate::{GOOD, LOSS, report};

/// Writes the copy and says what was lost.
pub(crate) fn run(from: &Path, to: &Path) -> anyhow::Result<u8> {
    let recovery = bags::recover(from, to)?;
    report::line(&format!(
        "{} messages and {} attachments saved in {}",
        recovery.messages,
        recovery.attachments,
        to.display()
    ));
    for damage in &recovery.damage {
        report::line(&format!("damage    {damage}"));
    }
    Ok(if recovery.lost_messages() { LOSS } else { GOOD })
}
