//! The cell that a recording carries: in attachments of this project's recorder, or in what the cell publishes of itself,
//! where another program has recorded it.

use anyhow::Context;
use bags::Bag;
use cell::{Cell, CellText};
use graph::topics::{self, PROGRAM_LINE};
use probecell_msgs::{from_cdr, std_msgs};

/// Name of the attachment with the cell file.
pub const CELL_FILE: &str = "cell.toml";
/// Name of the attachment with the robot description.
pub const ROBOT_FILE: &str = "robot.urdf";
/// Name of the attachment with the cell's public key.
pub const KEY_FILE: &str = "cell.pub";
/// Name of the table of what made a recording: version and source revision of the program.
pub const PROVENANCE: &str = "probecell";

/// Version and source revision of the program that made a recording; empty where it does not say.
pub fn program(bag: &Bag) -> (String, String) {
    let of = |key: &str| {
        let tables = bag.metadata().filter(|(name, _)| *name == PROVENANCE);
        let values = tables.filter_map(|(_, table)| table.get(key));
        values.last().cloned().unwrap_or_default()
    };
    (of("version"), of("source_revision"))
}

/// Prefix of the first line of a description: a comment in TOML.
const KEY_LINE: &str = "# public key of the cell: ";

/// What a cell publishes of itself: as comments its public key and the version of the program, and its file without passwords.
pub fn description(cell: &Cell, key: &str, version: &str) -> String {
    let text = cell::secrets::redacted(&cell.text().cell);
    format!("{KEY_LINE}{key}\n{PROGRAM_LINE}{version}\n{text}")
}

/// Key and cell file of a description.
fn parts(description: &str) -> (String, String) {
    let (key, text) = after(KEY_LINE, description).unwrap_or(("", description));
    let (_, text) = after(PROGRAM_LINE, text).unwrap_or(("", text));
    (key.to_owned(), text.to_owned())
}

/// The rest of a first line that begins so, and what follows that line.
fn after<'a>(begin: &str, text: &'a str) -> Option<(&'a str, &'a str)> {
    text.strip_prefix(begin)?.split_once('\n')
}

/// The cell of a recording; `None` where it carries none.
///
/// # Errors
/// An attachment that cannot be read, or a cell file that is not valid.
pub fn cell(bag: &Bag) -> anyhow::Result<Option<Cell>> {
    let Some(text) = text(bag)? else {
        return Ok(None);
    };
    Ok(Some(Cell::from_text(text)?))
}

/// Its texts: those of the first file that has some.
///
/// # Errors
/// An attachment that cannot be read.
pub fn text(bag: &Bag) -> anyhow::Result<Option<CellText>> {
    let mut text = CellText {
        name: format!("{} of {}", CELL_FILE, bag.path().display()),
        ..CellText::default()
    };
    for attachment in bag.attachments().flatten() {
        let content = String::from_utf8(attachment.data.to_vec());
        match attachment.name.as_str() {
            CELL_FILE => text.cell = content.context("the embedded cell file is not text")?,
            ROBOT_FILE => {
                text.robot_description =
                    content.context("the embedded robot description is not text")?;
            }
            KEY_FILE => text.key = content.context("the embedded key is not text")?,
            _ => {}
        }
    }
    if text.cell.is_empty() {
        published(bag, &mut text)?;
    }
    Ok((!text.cell.is_empty()).then_some(text))
}

/// What a cell has published of itself: of several cells the one that said it first.
fn published(bag: &Bag, text: &mut CellText) -> anyhow::Result<()> {
    let suffix = format!("/{}", topics::CELL_DESCRIPTION.name);
    let mut topics = bag.channels().iter().map(|channel| &channel.topic);
    let Some(namespace) = topics.find_map(|topic| topic.strip_suffix(&suffix)) else {
        return Ok(());
    };
    let first = |topic: graph::Topic| -> anyhow::Result<String> {
        let name = format!("{namespace}/{}", topic.name);
        let mut messages = bag.messages_on(&[&name]).flatten();
        messages.next().map_or(Ok(String::new()), |message| {
            let text = from_cdr::<std_msgs::String>(&message.payload);
            Ok(text
                .with_context(|| format!("{name} of {}", bag.path().display()))?
                .data)
        })
    };
    (text.key, text.cell) = parts(&first(topics::CELL_DESCRIPTION)?);
    text.robot_description = first(topics::ROBOT_DESCRIPTION)?;
    text.name = format!("{}{suffix} of {}", namespace, bag.path().display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_gives_back_the_file_to_the_byte_and_the_key() {
        let file = "[cell]\nname = \"a\" # as written\n";
        let described = format!("{KEY_LINE}5f0c\n{file}");
        assert_eq!(parts(&described), ("5f0c".to_owned(), file.to_owned()));
        let described = format!("{KEY_LINE}5f0c\n{PROGRAM_LINE}0.2.0\n{file}");
        assert_eq!(parts(&described), ("5f0c".to_owned(), file.to_owned()));
        assert_eq!(parts(file), (String::new(), file.to_owned()));
    }
}
