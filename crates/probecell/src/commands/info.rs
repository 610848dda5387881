//! `probecell info`: what a recording holds.

use std::path::Path;

use bags::Bag;

use crate::{GOOD, LOSS, output};

/// Prints the description.
pub(crate) fn run(path: &Path, verify: bool, json: bool) -> anyhow::Result<u8> {
    let mut info = Bag::open(path)?.info(verify);
    // A recording of an earlier version may hold the cell file with its passwords.
    for table in info.metadata.values_mut() {
        for value in table.values_mut() {
            *value = cell::secrets::redacted(value);
        }
    }
    if json {
        output::json(&info)?;
    } else {
        output::line(&format!("{}  ({})", info.path.display(), info.library));
        let seconds = info.duration_ns as f64 * 1e-9;
        output::line(&format!(
            "{} messages in {seconds:.1} s, {} file(s)",
            info.messages,
            info.files.len()
        ));
        for topic in &info.topics {
            let missing = topic.losses.missing();
            let lost = if missing > 0 {
                format!("  {missing} MISSING")
            } else {
                String::new()
            };
            output::line(&format!(
                "{:>9}  {}  [{}]{lost}",
                topic.messages, topic.topic, topic.type_name
            ));
        }
        for attachment in &info.attachments {
            output::line(&format!(
                "attached  {} ({} bytes)",
                attachment.name, attachment.bytes
            ));
        }
        for (name, table) in &info.metadata {
            for (key, value) in table {
                let value = value.trim_end().replace('\n', "; ");
                output::line(&format!("{name}  {key}: {value}"));
            }
        }
        for damage in &info.damage {
            output::line(&format!("damage    {damage}"));
        }
    }
    Ok(if info.damage.is_empty() { GOOD } else { LOSS })
}
