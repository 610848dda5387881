//! Values of a settings file with sections (LinuxCNC's INI, Klipper's printer.cfg), found and replaced where they stand: every
//! other byte stays. No crate of the registry keeps bytes of such files.

use std::ops::Range;

use crate::CureError;
use crate::job::File;

/// A settings file and what is changed in it.
#[derive(Debug)]
pub(crate) struct Settings<'a> {
    file: &'a File,
    edits: Vec<(Range<usize>, String)>,
}

impl<'a> Settings<'a> {
    pub(crate) fn of(file: &'a File) -> Self {
        Self {
            file,
            edits: Vec::new(),
        }
    }

    /// Lines with the byte where each begins, behind the header of a section.
    fn section(&self, section: &str) -> impl Iterator<Item = (usize, &'a str)> {
        let header = format!("[{section}]");
        let mut inside = false;
        lines(&self.file.text).filter(move |(_, line)| {
            let line = line.trim();
            if line.starts_with('[') {
                inside = line.starts_with(&header);
                return false;
            }
            inside
        })
    }

    /// First word of a value, as it stands, with its bytes.
    fn entry(&self, section: &str, key: &str) -> Option<(Range<usize>, &'a str)> {
        self.section(section).find_map(|(begin, line)| {
            let place = line.find(['=', ':'])?;
            if line[..place].trim() != key {
                return None;
            }
            let rest = &line[place + 1..];
            let skipped = rest.len() - rest.trim_start().len();
            let word = rest
                .trim_start()
                .split([' ', '\t', '\r', '\n', '#', ';'])
                .next()?;
            let from = begin + place + 1 + skipped;
            Some((from..from + word.len(), word))
        })
    }

    /// A value as text; `None` where the section has no such key.
    pub(crate) fn text(&self, section: &str, key: &str) -> Option<&'a str> {
        self.entry(section, key).map(|(_, word)| word)
    }

    /// All words of a value.
    pub(crate) fn words(&self, section: &str, key: &str) -> Option<&'a str> {
        let (bytes, _) = self.entry(section, key)?;
        self.file.text[bytes.start..].lines().next()
    }

    /// A value as a number; `None` where the section has no such key.
    ///
    /// # Errors
    /// [`CureError::File`] for a value that is no number.
    pub(crate) fn number(&self, section: &str, key: &str) -> Result<Option<f64>, CureError> {
        let Some(word) = self.text(section, key) else {
            return Ok(None);
        };
        match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Some(value)),
            _ => Err(self.wrong(&format!("[{section}] {key} is {word:?}, not a number"))),
        }
    }

    /// Replaces the value of a key, or adds the key below the header of its section.
    ///
    /// # Errors
    /// [`CureError::File`] for a file without the section.
    pub(crate) fn set(&mut self, section: &str, key: &str, value: &str) -> Result<(), CureError> {
        if let Some((bytes, _)) = self.entry(section, key) {
            self.edits.push((bytes, value.to_owned()));
            return Ok(());
        }
        let header = format!("[{section}]");
        let mut all = lines(&self.file.text);
        let Some((begin, line)) = all.find(|(_, line)| line.trim_start().starts_with(&header))
        else {
            return Err(self.wrong(&format!("it has no section [{section}]")));
        };
        let end = begin + line.len();
        let break_before = if line.ends_with('\n') { "" } else { "\n" };
        self.edits
            .push((end..end, format!("{break_before}{key} = {value}\n")));
        Ok(())
    }

    /// The first section whose name begins so.
    pub(crate) fn begins(&self, name: &str) -> Option<&'a str> {
        let headers = lines(&self.file.text).filter_map(|(_, line)| line.trim().strip_prefix('['));
        let mut names = headers.filter_map(|rest| rest.split(']').next());
        names.find(|own| own.starts_with(name))
    }

    /// Adds lines at the end, or before the first line that begins so.
    pub(crate) fn append(&mut self, new: &str, before: &str) {
        let text = &self.file.text;
        let mut all = lines(text);
        let place = all.find_map(|(begin, line)| line.starts_with(before).then_some(begin));
        let place = place.unwrap_or(text.len());
        let whole = text[..place].is_empty() || text[..place].ends_with('\n');
        let break_before = if whole { "" } else { "\n" };
        self.edits
            .push((place..place, format!("{break_before}{new}")));
    }

    /// What is wrong with the file.
    pub(crate) fn wrong(&self, what: &str) -> CureError {
        self.file.wrong(what)
    }

    /// The text with its changes.
    pub(crate) fn changed(self) -> String {
        replaced(&self.file.text, self.edits)
    }
}

/// Lines with their ends, and the byte where each begins.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut begin = 0;
    text.split_inclusive('\n').map(move |line| {
        let at = begin;
        begin += line.len();
        (at, line)
    })
}

/// A text in which byte ranges that do not overlap are replaced.
pub(crate) fn replaced(text: &str, mut edits: Vec<(Range<usize>, String)>) -> String {
    edits.sort_by_key(|(bytes, _)| (bytes.start, bytes.end));
    let mut parts = Vec::new();
    let mut at = 0;
    for (bytes, new) in edits {
        parts.push(text[at..bytes.start].to_owned());
        parts.push(new);
        at = bytes.end;
    }
    parts.push(text[at..].to_owned());
    parts.concat()
}
