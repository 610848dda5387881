//! `probecell info`: what a recording holds.

use std::path::Path;

use anyhow::Context;
use bags::{Bag, Gap, Info, Sealed, verify_seals};
use serde::Serialize;
use signatures::PublicKey;

use session_io::embedded::{self, KEY_FILE};

use super::record::sealing;
use crate::{FAILED, GOOD, LOSS, output};

/// What the seals of a recording say.
#[derive(Serialize)]
struct Seals {
    /// Public key of the cell that recorded, as the recording has it.
    key: Option<String>,
    /// What the seals say; nothing where there are none.
    #[serde(flatten)]
    sealed: Option<Sealed>,
}

impl Seals {
    fn read(bag: &Bag) -> anyhow::Result<Self> {
        let mut attached = bag
            .attachments()
            .flatten()
            .filter(|one| one.name == KEY_FILE);
        let key = attached.next().map(|one| -> anyhow::Result<PublicKey> {
            let text = String::from_utf8_lossy(&one.data);
            text.parse()
                .with_context(|| format!("{KEY_FILE} of {}", bag.path().display()))
        });
        // One that is none fits no seal.
        let key = key.and_then(Result::ok);
        let is_signed = |seal: &[u8], signature: &[u8]| {
            key.is_some_and(|key| key.verifies(&sealing(key, seal), signature))
        };
        Ok(Self {
            sealed: verify_seals(bag.path(), &is_signed)?,
            key: key.map(|key| key.to_string()),
        })
    }

    fn is_changed(&self) -> bool {
        (self.sealed.as_ref()).is_some_and(|sealed| !sealed.changes.is_empty())
    }

    fn print(&self) {
        let Some(sealed) = &self.sealed else {
            return output::line("seals     none: later changes cannot be detected");
        };
        for change in &sealed.changes {
            output::line(&format!("CHANGED   {change}"));
        }
        let key = self.key.as_deref().unwrap_or("no key");
        let count = sealed.seals;
        if !sealed.ended {
            let bytes: u64 = sealed.unsealed.values().sum();
            let text = "the recorder was killed, or the end was cut off";
            output::line(&format!(
                "seals     {count} by {key}, and no last one: {text}; {bytes} bytes are not sealed"
            ));
        } else if sealed.changes.is_empty() {
            output::line(&format!(
                "seals     {count} by {key}: nothing was changed since"
            ));
        }
    }
}

/// Messages that are missing by number. They are looked for where the whole recording is read, or where it was cut off so that it
/// has to be.
fn gaps(bag: &Bag, info: &Info, verify: bool, later: Option<&Path>) -> anyhow::Result<Vec<Gap>> {
    if !verify && info.damage.is_empty() && later.is_none() {
        return Ok(Vec::new());
    }
    let later = later.map(Bag::open).transpose()?;
    Ok(bag.gaps(later.as_ref()))
}

/// Prints the description. `later`: a recording of the same session begun after it.
pub(crate) fn run(
    path: &Path,
    verify: bool,
    json: bool,
    later: Option<&Path>,
) -> anyhow::Result<u8> {
    let bag = Bag::open(path)?;
    let mut info = bag.info(verify);
    let gaps = gaps(&bag, &info, verify, later)?;
    let seals = verify.then(|| Seals::read(&bag)).transpose()?;
    // A recording of an earlier version may hold the cell file with its passwords.
    for table in info.metadata.values_mut() {
        for value in table.values_mut() {
            *value = cell::secrets::redacted(value);
        }
    }
    if json {
        let mut value = serde_json::to_value(&info)?;
        value["gaps"] = serde_json::to_value(&gaps)?;
        if let Some(seals) = &seals {
            value["seals"] = serde_json::to_value(seals)?;
        }
        output::json(&value)?;
    } else {
        let revision = match embedded::program(&bag).1 {
            revision if revision.is_empty() => revision,
            revision => format!(", source {revision}"),
        };
        output::line(&format!(
            "{}  ({}{revision})",
            info.path.display(),
            info.library
        ));
        let seconds = info.duration_ns as f64 * 1e-9;
        output::line(&format!(
            "{} messages in {seconds:.1} s, {} file(s)",
            info.messages,
            info.files.len()
        ));
        let rows: Vec<_> = (info.topics.iter())
            .map(|topic| {
                let lost = match topic.losses.missing() {
                    0 => String::new(),
                    missing => format!("{missing} MISSING"),
                };
                let (messages, kind) = (topic.messages.to_string(), topic.type_name.clone());
                [messages, topic.topic.clone(), kind, lost]
            })
            .collect();
        output::table(["messages", "topic", "type", ""], &rows);
        for (channel, changes) in bag.migrated() {
            output::line(&format!(
                "version   fields of {}: {}",
                channel.topic,
                changes.join(", ")
            ));
        }
        for attachment in &info.attachments {
            output::line(&format!(
                "attached  {} ({} bytes)",
                attachment.name, attachment.bytes
            ));
        }
        // The sections of the cell file stand there as it is attached, or in the JSON.
        let short = |(_, value): &(&String, &String)| !value.trim_end().contains('\n');
        for (name, table) in &info.metadata {
            for (key, value) in table.iter().filter(short) {
                output::line(&format!("{name}  {key}: {}", value.trim_end()));
            }
            let long = table
                .iter()
                .filter(|one| !short(one))
                .map(|(key, _)| key.as_str());
            let long = long.collect::<Vec<_>>().join(", ");
            if !long.is_empty() {
                output::wrapped(&format!("{name}  see --json: "), 4, &long);
            }
        }
        for damage in &info.damage {
            output::line(&format!("damage    {damage}"));
        }
        for gap in &gaps {
            output::line(&format!("missing   {gap}"));
        }
        if let Some(seals) = &seals {
            seals.print();
        }
    }
    if seals.is_some_and(|seals| seals.is_changed()) {
        return Ok(FAILED);
    }
    let whole = info.damage.is_empty() && gaps.is_empty();
    Ok(if whole { GOOD } else { LOSS })
}
