//! What is wrong with a file, and where.

/// What is wrong with a file of another system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImportError {
    /// Line and column, from 1; none where the file as a whole is concerned.
    pub place: Option<(u64, u64)>,
    /// What is wrong, a sentence without full stop.
    pub what: String,
}

impl ImportError {
    /// An error at a line and a column, both from 1.
    pub fn at(line: u64, column: u64, what: impl Into<String>) -> Self {
        Self {
            place: Some((line, column)),
            what: what.into(),
        }
    }

    /// An error of the file as a whole.
    pub fn whole(what: impl Into<String>) -> Self {
        Self {
            place: None,
            what: what.into(),
        }
    }
}

impl std::fmt::Display for ImportError {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.place {
            Some((line, column)) => write!(out, "line {line}, column {column}: {}", self.what),
            None => out.write_str(&self.what),
        }
    }
}

impl std::error::Error for ImportError {}
