//! Delimited text (RFC 4180, any delimiter) whose every cell knows its line and column.
//!
//! Lines and columns count from 1, columns in characters. Nothing is guessed: the delimiter and the decimal sign are what the
//! caller says they are.

use crate::ImportError;

/// How a file of delimited text is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Between cells.
    pub delimiter: char,
    /// Numbers have a decimal comma.
    pub decimal_comma: bool,
    /// The first line that is neither blank nor a comment names the columns.
    pub header: bool,
}

impl Default for Layout {
    fn default() -> Self {
        Self {
            delimiter: ',',
            decimal_comma: false,
            header: true,
        }
    }
}

/// A cell and where it begins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cell {
    /// Without quotes and without blanks around it.
    pub text: String,
    /// Column of its first character.
    pub column: u64,
}

/// A row that is neither blank nor a comment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Its line; of a row with quoted line breaks the first.
    pub line: u64,
    /// Its cells.
    pub cells: Vec<Cell>,
}

/// A file of delimited text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// Names of the columns; empty where the file has none.
    pub header: Vec<String>,
    /// Line of the header.
    pub header_line: u64,
    /// Rows below the header.
    pub rows: Vec<Row>,
    /// Lines that are blank, or comments (`#` first), in number.
    pub passed_over: u64,
    /// Comments, with their lines.
    pub comments: Vec<(u64, String)>,
}

impl Table {
    /// Reads a whole file; a byte order mark at its start is passed over.
    ///
    /// # Errors
    /// A quote that is not closed, or text behind a closing quote.
    pub fn read(text: &str, layout: Layout) -> Result<Self, ImportError> {
        let mut rows = Vec::new();
        let mut table = Self::default();
        let mut scanner = Scanner {
            text: text.trim_start_matches('\u{feff}').chars().peekable(),
            line: 1,
            column: 1,
            delimiter: layout.delimiter,
        };
        while let Some(row) = scanner.row()? {
            let blank = row.cells.iter().all(|cell| cell.text.is_empty());
            let comment = row.cells[0].text.starts_with('#');
            if comment {
                let cells = row.cells.iter().map(|cell| cell.text.as_str());
                let joined = cells.collect::<Vec<_>>().join(",");
                let said = joined.trim_start_matches('#').trim().to_owned();
                table.comments.push((row.line, said));
            }
            if blank || comment {
                table.passed_over += 1;
            } else {
                rows.push(row);
            }
        }
        if layout.header && !rows.is_empty() {
            let first = rows.remove(0);
            table.header_line = first.line;
            table.header = first.cells.into_iter().map(|cell| cell.text).collect();
        }
        table.rows = rows;
        table.not_wider_than_its_header()?;
        Ok(table)
    }

    /// A cell without a column is refused: what a decimal comma cuts in two would be read as another number.
    fn not_wider_than_its_header(&self) -> Result<(), ImportError> {
        let columns = self.header.len();
        if columns == 0 {
            return Ok(());
        }
        let beyond = self.rows.iter().find_map(|row| {
            let behind = row.cells.iter().skip(columns);
            let cell = behind.into_iter().find(|cell| !cell.text.is_empty())?;
            Some((row, cell))
        });
        match beyond {
            None => Ok(()),
            Some((row, cell)) => Err(ImportError::at(
                row.line,
                cell.column,
                format!(
                    "the row has {} cells, and the header {columns} columns: is the decimal sign a comma \
                     (--delimiter ';' --decimal-comma), or a quote missing?",
                    row.cells.len()
                ),
            )),
        }
    }

    /// Index of a column: its name, or `#N` for the N-th, from 1.
    ///
    /// # Errors
    /// No column, or several, of that name.
    pub fn column(&self, name: &str) -> Result<usize, ImportError> {
        if let Some(number) = name.strip_prefix('#') {
            let widest = self.rows.iter().map(|row| row.cells.len()).max();
            let count = self.header.len().max(widest.unwrap_or(0));
            let number = number.parse::<usize>().ok();
            return number
                .filter(|number| (1..=count).contains(number))
                .map(|number| number - 1)
                .ok_or_else(|| {
                    ImportError::whole(format!(
                        "there is no column {name}: the file has {count} columns"
                    ))
                });
        }
        let mut found = (0..self.header.len()).filter(|&index| self.header[index] == name);
        match (found.next(), found.next()) {
            (Some(index), None) => Ok(index),
            (Some(_), Some(_)) => Err(ImportError::at(
                self.header_line,
                1,
                format!("two columns are named {name:?}: say #N for the N-th column"),
            )),
            (None, _) => Err(ImportError::at(
                self.header_line.max(1),
                1,
                format!(
                    "there is no column {name:?}; the file has {}",
                    self.named_columns()
                ),
            )),
        }
    }

    fn named_columns(&self) -> String {
        let names: Vec<_> = self.header.iter().map(|name| format!("{name:?}")).collect();
        if names.is_empty() {
            "no header, so that columns are named #1, #2 and so on".to_owned()
        } else {
            names.join(", ")
        }
    }
}

impl Row {
    /// The cell of a column.
    ///
    /// # Errors
    /// The row ends before it.
    pub fn cell(&self, index: usize) -> Result<&Cell, ImportError> {
        self.cells.get(index).ok_or_else(|| {
            let end = self
                .cells
                .last()
                .map_or(1, |cell| cell.column + cell.text.chars().count() as u64);
            ImportError::at(
                self.line,
                end,
                format!(
                    "the row ends after {} cells, and column {} is needed",
                    self.cells.len(),
                    index + 1
                ),
            )
        })
    }

    /// The finite number in a column.
    ///
    /// # Errors
    /// The cell holds none; a decimal comma where none was announced is named.
    pub fn number(&self, index: usize, layout: Layout) -> Result<f64, ImportError> {
        let cell = self.cell(index)?;
        let text = if layout.decimal_comma {
            cell.text.replace(',', ".")
        } else {
            cell.text.clone()
        };
        let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
        value.ok_or_else(|| {
            let hint = if !layout.decimal_comma && cell.text.contains(',') {
                " (a decimal comma is read with --decimal-comma)"
            } else {
                ""
            };
            self.wrong(index, &format!("expected a finite number{hint}"))
        })
    }

    /// An error at a column: `expected`, and what stands there.
    pub fn wrong(&self, index: usize, expected: &str) -> ImportError {
        match self.cell(index) {
            Ok(cell) if cell.text.is_empty() => {
                ImportError::at(self.line, cell.column, format!("{expected}, found nothing"))
            }
            Ok(cell) => ImportError::at(
                self.line,
                cell.column,
                format!("{expected}, found {:?}", cell.text),
            ),
            Err(error) => error,
        }
    }
}

struct Scanner<'a> {
    text: std::iter::Peekable<std::str::Chars<'a>>,
    line: u64,
    column: u64,
    delimiter: char,
}

impl Scanner<'_> {
    fn next(&mut self) -> Option<char> {
        let letter = self.text.next()?;
        if letter == '\n' {
            self.line += 1;
            self.column = 1;
        } else {
            self.column += 1;
        }
        Some(letter)
    }

    /// The next row; `None` at the end of the text.
    fn row(&mut self) -> Result<Option<Row>, ImportError> {
        if self.text.peek().is_none() {
            return Ok(None);
        }
        let line = self.line;
        let mut cells = Vec::new();
        loop {
            let (cell, more) = self.cell()?;
            cells.push(cell);
            if !more {
                return Ok(Some(Row { line, cells }));
            }
        }
    }

    /// A cell, and whether another follows in the row.
    fn cell(&mut self) -> Result<(Cell, bool), ImportError> {
        while self.text.peek().is_some_and(|&letter| {
            letter.is_whitespace() && letter != '\n' && letter != self.delimiter
        }) {
            self.next();
        }
        let column = self.column;
        let quoted = self.text.peek() == Some(&'"');
        let mut text = String::new();
        if quoted {
            text = self.quoted()?;
        }
        loop {
            let end = (self.line, self.column);
            match self.next() {
                None | Some('\n') => {
                    let text = text.trim_end().to_owned();
                    return Ok((Cell { text, column }, false));
                }
                Some(letter) if letter == self.delimiter => {
                    let text = text.trim_end().to_owned();
                    return Ok((Cell { text, column }, true));
                }
                Some(letter) if quoted && !letter.is_whitespace() => {
                    return Err(ImportError::at(
                        end.0,
                        end.1,
                        format!("{letter:?} follows a closing quote"),
                    ));
                }
                Some(letter) if !quoted => text.push(letter),
                Some(_) => {}
            }
        }
    }

    fn quoted(&mut self) -> Result<String, ImportError> {
        let (line, column) = (self.line, self.column);
        self.next();
        let mut text = String::new();
        loop {
            match self.next() {
                None => {
                    let what = "a quote that is not closed".to_owned();
                    return Err(ImportError::at(line, column, what));
                }
                Some('"') if self.text.peek() == Some(&'"') => {
                    self.next();
                    text.push('"');
                }
                Some('"') => return Ok(text),
                Some(letter) => text.push(letter),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_know_where_they_stand() {
        let text = "\u{feff}# made by hand\n\"a \"\"b\"\"\", b ,c\r\n\n 1.5,\"x,\ny\",3\n";
        let table = Table::read(text, Layout::default()).expect("a table");
        assert_eq!(table.header, ["a \"b\"", "b", "c"]);
        assert_eq!(table.passed_over, 2);
        assert_eq!(table.comments, [(1, "made by hand".to_owned())]);
        let row = &table.rows[0];
        assert_eq!(
            (row.line, row.cells[0].column, row.cells[1].column),
            (4, 2, 6)
        );
        assert_eq!(row.cells[1].text, "x,\ny");
        assert_eq!(row.number(0, Layout::default()), Ok(1.5));
        let wrong = row.number(1, Layout::default()).expect_err("no number");
        assert_eq!(
            wrong.to_string(),
            "line 4, column 6: expected a finite number (a decimal comma is read with --decimal-comma), found \"x,\\ny\""
        );
        assert!(table.column("d").is_err() && table.column("#4").is_err());
        assert_eq!(table.column("#3"), Ok(2));
    }

    #[test]
    fn what_no_reader_understands_alike_is_refused() {
        let layout = Layout::default();
        let open = Table::read("a,b\n1,\"2\n3,4\n", layout).expect_err("open");
        assert_eq!(
            open.to_string(),
            "line 2, column 3: a quote that is not closed"
        );
        let behind = Table::read("\"1\"2,3\n", layout).expect_err("behind");
        assert!(behind.to_string().contains("line 1, column 4"));
        let short = Table::read("a,b\n1\n", layout).expect("a table");
        assert!(short.rows[0].number(1, layout).is_err());
        let twice = Table::read("a,a\n1,2\n", layout).expect("a table");
        assert!(twice.column("a").is_err());
    }

    #[test]
    fn a_decimal_comma_is_read_only_where_it_is_announced() {
        let layout = Layout {
            delimiter: ';',
            decimal_comma: true,
            header: false,
        };
        let table = Table::read("1,25;-3\n", layout).expect("a table");
        assert_eq!(table.rows[0].number(0, layout), Ok(1.25));
    }
}
