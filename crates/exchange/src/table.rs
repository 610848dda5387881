//! Delimited text (RFC 4180, any delimiter) whose every cell knows its line and column.
//!
//! Lines and columns count from 1, columns in characters. Nothing is guessed: the delimiter and the decimal sign are what the
//! caller says they are.

pub mod forms;

use crate::ImportError;

/// Most rows and cells of a table that are held, and most cells of a row.
const MOST_ROWS: usize = 100_000;
const MOST_CELLS: usize = 2_000_000;
const WIDEST: usize = 10_000;
/// Successive rows that are held or left out together, so that most keep the row before: axes came from there.
const RUN: u64 = 32;

/// How a file of delimited text is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Between cells; a blank stands for any number of blanks and tabs.
    pub delimiter: char,
    /// Numbers have a decimal comma.
    pub decimal_comma: bool,
    /// The first line that is neither blank nor a comment names the columns.
    pub header: bool,
    /// First and last line of the table in the file, from 1; what stands above and below, such as a title, is passed over.
    pub lines: (u64, u64),
}

impl Default for Layout {
    fn default() -> Self {
        Self {
            delimiter: ',',
            decimal_comma: false,
            header: true,
            lines: (1, u64::MAX),
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
    /// Lines that are blank, or comments (`#` first, unless a cell `#` begins the header), in number.
    pub passed_over: u64,
    /// Comments in number, and the line of the first.
    pub comments: (u64, u64),
    /// Rows below the header that are left out since they are very many: those held are spread evenly over the file.
    pub left_out: u64,
    /// How often half of the rows were left out.
    pub halved: u32,
}

impl Table {
    /// Reads a whole file; a byte order mark at its start is passed over.
    ///
    /// # Errors
    /// A quote that is not closed or may belong to either of two cells, text behind a closing quote, or a row without its columns.
    pub fn read(text: &str, layout: Layout) -> Result<Self, ImportError> {
        let mut table = Self::default();
        let text = text.trim_start_matches('\u{feff}');
        let (first, last) = layout.lines;
        let count = text.lines().count() as u64;
        if first > count.max(1) {
            let what = format!(
                "the table is said to begin in line {first}, and the file has {count} lines"
            );
            return Err(ImportError::whole(what));
        }
        table.passed_over = first - 1 + count.saturating_sub(last);
        let mut scanner = Scanner {
            text: lines_of(text, layout.lines).chars().peekable(),
            line: first,
            column: 1,
            delimiter: layout.delimiter,
        };
        let (mut counts_rows, mut begun, mut columns) = (false, false, 0);
        // A wrong width is told only of a file that can be read to its end.
        let mut wrong = Ok(());
        while let Some(row) = scanner.row()? {
            let blank = row.cells.iter().all(|cell| cell.text.is_empty());
            let first = &row.cells[0].text;
            if !begun && layout.header && layout.delimiter != ' ' {
                counts_rows |= first == "#" && row.cells.len() > 1;
            }
            let comment = !counts_rows && first.starts_with('#');
            if comment {
                let (count, first) = table.comments;
                table.comments = (count + 1, if count == 0 { row.line } else { first });
            }
            if blank || comment {
                table.passed_over += 1;
                continue;
            }
            if !begun {
                (begun, columns) = (true, row.cells.len());
                if layout.header {
                    table.header_line = row.line;
                    table.header = row.cells.into_iter().map(|cell| cell.text).collect();
                    continue;
                }
            }
            if wrong.is_ok() {
                wrong = match layout.delimiter {
                    ' ' => row.as_wide_as(columns),
                    _ => table.not_wider_than_header(&row),
                };
            }
            table.push(row);
        }
        wrong.map(|()| table)
    }

    /// Adds a row, unless it is one of very many.
    fn push(&mut self, row: Row) {
        // By the multiples of the golden ratio, whatever the period of the pattern that is measured (Weyl 1916).
        let is_kept = |number: u64, halved: u32| {
            let place = (number / RUN).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            place <= u64::MAX.checked_shr(halved).unwrap_or(0)
        };
        let number = self.rows.len() as u64 + self.left_out;
        if !is_kept(number, self.halved) {
            self.left_out += 1;
            return;
        }
        let most = MOST_ROWS.min(MOST_CELLS / row.cells.len().max(1));
        self.rows.push(row);
        while self.rows.len() > most {
            let before = self.halved;
            self.halved += 1;
            let mut numbers = (0..=number).filter(|&number| is_kept(number, before));
            self.rows.retain(|_| {
                numbers
                    .next()
                    .is_some_and(|number| is_kept(number, before + 1))
            });
            self.left_out = number + 1 - self.rows.len() as u64;
        }
    }

    /// That no row is left out.
    ///
    /// # Errors
    /// Rows are.
    pub(crate) fn whole(&self) -> Result<(), ImportError> {
        if self.left_out == 0 {
            return Ok(());
        }
        Err(ImportError::whole(format!(
            "the table has {} rows of {} cells; of this kind it has at most {MOST_ROWS} rows and {MOST_CELLS} cells",
            self.rows.len() as u64 + self.left_out,
            self.rows.first().map_or(0, |row| row.cells.len()),
        )))
    }

    /// What the user may not know of a file whose columns or rows are not found; empty where there is nothing.
    pub(crate) fn hint(&self) -> String {
        let hidden = match self.comments {
            (0, _) => String::new(),
            (count, line) => format!(
                "; lines that begin with # were taken for comments, {count} of them from line {line} on (a column of numbers like #1 \
                 is read where its name in the header is #)"
            ),
        };
        let other = match self.header.as_slice() {
            [one] if one.contains(';') => "';'",
            [one] if one.contains('\t') => "tab",
            [one] if one.contains(',') => "','",
            [one] if one.contains(char::is_whitespace) => "blanks",
            header => {
                let widest = self.rows.iter().map(|row| row.cells.len()).max();
                let named = header.iter().filter(|name| !name.is_empty()).count();
                if named > 0 && widest.is_some_and(|widest| widest > named) {
                    return format!(
                        "; is line {} a title (--lines {}- begins behind it)?{hidden}",
                        self.header_line,
                        self.header_line + 1
                    );
                }
                return hidden;
            }
        };
        format!(
            "; is the delimiter another (--delimiter {other}), or the first line a title (--lines {}- begins behind it)?{hidden}",
            self.header_line + 1
        )
    }

    /// A cell without a column is refused: what a decimal comma cuts in two would be read as another number.
    fn not_wider_than_header(&self, row: &Row) -> Result<(), ImportError> {
        let columns = self.header.len();
        let mut behind = row.cells.iter().skip(columns);
        match behind.find(|cell| columns > 0 && !cell.text.is_empty()) {
            None => Ok(()),
            Some(cell) => Err(ImportError::at(
                row.line,
                cell.column,
                format!(
                    "the row has {} cells, and the header {columns} columns: is the decimal sign a comma \
                     (--delimiter ';' --decimal-comma), a quote missing, or line {} a title (--lines {}- begins behind it)?",
                    row.cells.len(),
                    self.header_line,
                    self.header_line + 1
                ),
            )),
        }
    }

    /// A grid, whose header has X, whose first column Y and whose other cells Z, as a table of X, Y, Z; and the number of its empty
    /// cells, which are left out.
    ///
    /// # Errors
    /// No header, or a cell of it that is no number.
    pub fn of_grid(&self, layout: Layout) -> Result<(Self, usize), ImportError> {
        let Some((_, across)) = self.header.split_first() else {
            return Err(ImportError::whole("a grid has a header, whose cells are X"));
        };
        let header = Row {
            line: self.header_line,
            cells: across
                .iter()
                .map(|text| Cell {
                    text: text.clone(),
                    column: 1,
                })
                .collect(),
        };
        self.whole()?;
        let mut empty = 0;
        let mut table = Self {
            header: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
            header_line: self.header_line,
            passed_over: self.passed_over,
            comments: self.comments,
            ..Self::default()
        };
        for row in &self.rows {
            for (index, x) in header.cells.iter().enumerate() {
                let z = row
                    .cells
                    .get(index + 1)
                    .filter(|cell| !cell.text.is_empty());
                let Some(z) = z else {
                    empty += usize::from(!x.text.is_empty());
                    continue;
                };
                header.number(index, layout)?;
                let cells = vec![x.clone(), row.cell(0)?.clone(), z.clone()];
                table.push(Row {
                    line: row.line,
                    cells,
                });
            }
        }
        Ok((table, empty))
    }

    /// Adds a column with the same text in every row, and gives its index.
    pub(crate) fn add_constant(&mut self, text: &str) -> usize {
        let widest = self.rows.iter().map(|row| row.cells.len()).max();
        let index = self.header.len().max(widest.unwrap_or(0));
        let cell = |text: &str| Cell {
            text: text.to_owned(),
            column: 1,
        };
        for row in &mut self.rows {
            row.cells.resize(index, cell(""));
            row.cells.push(cell(text));
        }
        index
    }

    /// Index of a column: its name, or `#N` for the N-th, from 1.
    ///
    /// # Errors
    /// No column, or several, of that name.
    pub fn column(&self, name: &str) -> Result<usize, ImportError> {
        if let Some(number) = name.strip_prefix('#').filter(|rest| !rest.is_empty()) {
            let widest = self.rows.iter().map(|row| row.cells.len()).max();
            let count = self.header.len().max(widest.unwrap_or(0));
            let number = number.parse::<usize>().ok();
            return number
                .filter(|number| (1..=count).contains(number))
                .map(|number| number - 1)
                .ok_or_else(|| {
                    ImportError::whole(format!(
                        "there is no column {name}: the file has {count} columns{}",
                        self.hint()
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
                    "there is no column {name:?}; the file has {}{}",
                    self.named_columns(),
                    self.hint()
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
    /// Between blanks an empty cell is not seen, so that a row that lacks one would be read in wrong columns.
    fn as_wide_as(&self, columns: usize) -> Result<(), ImportError> {
        if self.cells.len() == columns {
            return Ok(());
        }
        Err(ImportError::at(
            self.line,
            self.cells.last().map_or(1, |cell| cell.column),
            format!(
                "the row has {} cells between blanks, and {columns} are expected: put quotes around a text with blanks, and \
                 around nothing (\"\") for an empty cell",
                self.cells.len()
            ),
        ))
    }

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
        if layout.decimal_comma && cell.text.contains('.') {
            return Err(self.wrong(
                index,
                "expected a number with a decimal comma and no point (leave out points that group thousands; without \
                 --decimal-comma a point is the decimal sign)",
            ));
        }
        let text = if layout.decimal_comma {
            cell.text.replace(',', ".")
        } else {
            cell.text.clone()
        };
        let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
        value.ok_or_else(|| {
            let hint = if cell.text.contains(',') && cell.text.contains('.') {
                " (leave out what groups thousands)"
            } else if !layout.decimal_comma && cell.text.contains(',') {
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

/// The lines from the first to the last, from 1.
fn lines_of(text: &str, (first, last): (u64, u64)) -> &str {
    let begins = |line: u64| {
        let behind = usize::try_from(line.saturating_sub(2)).unwrap_or(usize::MAX);
        match line {
            0 | 1 => Some(0),
            _ => text.match_indices('\n').nth(behind).map(|(at, _)| at + 1),
        }
    };
    let begin = begins(first).unwrap_or(text.len());
    let end = begins(last.saturating_add(1)).unwrap_or(text.len());
    &text[begin..end.max(begin)]
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
            if cells.len() == WIDEST {
                let what = format!("the row has more than {WIDEST} cells");
                return Err(ImportError::at(line, cell.column, what));
            }
            cells.push(cell);
            if !more {
                return Ok(Some(Row { line, cells }));
            }
        }
    }

    fn delimits(&self, letter: char) -> bool {
        letter == self.delimiter
            || (self.delimiter == ' ' && letter.is_whitespace() && letter != '\n')
    }

    /// Passes over blanks within a line that are no delimiters of their own.
    fn blanks(&mut self) {
        while self.text.peek().is_some_and(|&letter| {
            letter.is_whitespace() && letter != '\n' && (letter != self.delimiter || letter == ' ')
        }) {
            self.next();
        }
    }

    /// Whether the next quote is the whole cell, as a mark for "as above"; else it begins quoted text.
    fn lone_quote(&self) -> Result<bool, ImportError> {
        let mut ahead = self.text.clone();
        ahead.next();
        while ahead
            .next_if(|&letter| letter.is_whitespace() && letter != '\n' && letter != self.delimiter)
            .is_some()
        {}
        match ahead.next() {
            None | Some('\n') => Ok(true),
            Some(letter) if letter == self.delimiter => {
                if ahead
                    .take_while(|&letter| letter != '\n')
                    .any(|letter| letter == '"')
                {
                    let what = "a quote that stands alone in its cell, or begins a text that goes on behind the delimiter: write a \
                                mark for \"as above\" out, or leave its cell empty";
                    return Err(ImportError::at(self.line, self.column, what));
                }
                Ok(true)
            }
            Some(_) => Ok(false),
        }
    }

    /// A cell, and whether another follows in the row.
    fn cell(&mut self) -> Result<(Cell, bool), ImportError> {
        self.blanks();
        let column = self.column;
        let quoted = self.text.peek() == Some(&'"') && !self.lone_quote()?;
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
                Some(letter) if self.delimits(letter) => {
                    let text = text.trim_end().to_owned();
                    let more = self.delimiter != ' ' || {
                        self.blanks();
                        match self.text.peek() {
                            Some('\n') => self.next().is_none(),
                            next => next.is_some(),
                        }
                    };
                    return Ok((Cell { text, column }, more));
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
        assert_eq!(table.comments, (1, 1));
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

    /// A pattern of 25 points, 12,000 times round: every point keeps its share, and nearly every row the one before.
    #[test]
    fn of_very_many_rows_some_are_held_evenly_spread() {
        let row = |number: u64| format!("{number},{}\n", number % 25);
        let text = |rows: u64| format!("N,P\n{}", (0..rows).map(row).collect::<String>());
        let most = Table::read(&text(100_000), Layout::default()).expect("a table");
        assert_eq!((most.rows.len(), most.left_out), (100_000, 0));
        let table = Table::read(&text(300_000), Layout::default()).expect("a table");
        let held = table.rows.len();
        assert!((50_000..=100_000).contains(&held));
        assert_eq!(held as u64 + table.left_out, 300_000);
        let numbers: Vec<usize> = (table.rows.iter())
            .map(|row| row.cells[0].text.parse().expect("its number"))
            .collect();
        let mut of_point = [0; 25];
        for number in &numbers {
            of_point[number % 25] += 1;
        }
        let share = held / 25;
        assert!(
            of_point
                .iter()
                .all(|count| share.abs_diff(*count) < share / 50)
        );
        let breaks = numbers.windows(2).filter(|pair| pair[1] != pair[0] + 1);
        assert!(breaks.count() < held / 30);
        let widest = format!("{}1\n", "1,".repeat(10_000));
        let wrong = Table::read(&widest, Layout::default()).expect_err("too wide");
        assert!(
            wrong.to_string().contains("more than 10000 cells"),
            "{wrong}"
        );
        let wrong = table.whole().expect_err("rows are left out");
        assert!(
            wrong.to_string().starts_with("the table has 300000 rows"),
            "{wrong}"
        );
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
            ..Layout::default()
        };
        let table = Table::read("1,25;-3\n", layout).expect("a table");
        assert_eq!(table.rows[0].number(0, layout), Ok(1.25));
    }

    #[test]
    fn blanks_of_any_number_part_cells() {
        let layout = Layout {
            delimiter: ' ',
            ..Layout::default()
        };
        let text = "\t  X     Y  DEV \r\n  -60.000 \t 12.230   -27.44\n\n 1 2 \"a b\"\n3   4   5";
        let table = Table::read(text, layout).expect("a table");
        assert_eq!(table.header, ["X", "Y", "DEV"]);
        let lines: Vec<u64> = table.rows.iter().map(|row| row.line).collect();
        assert_eq!(lines, [2, 4, 5]);
        assert_eq!(table.rows[0].number(2, layout), Ok(-27.44));
        assert_eq!(table.rows[1].cells[2].text, "a b");
        // A row without one of its cells would be read in wrong columns.
        for (text, place) in [
            ("X Y Z\n1 2 3\n4      6\n", "line 3, column 8"),
            ("1 2\n1 2 3\n", "line 2, column 5"),
        ] {
            let refused = Table::read(text, layout).expect_err(text).to_string();
            assert!(refused.starts_with(place), "{refused}");
        }
        let comma = Table::read(text, Layout::default()).expect("one column");
        let asked = comma.column("DEV").expect_err("one column").to_string();
        assert!(asked.contains("--delimiter blanks"), "{asked}");
    }

    #[test]
    fn a_lone_quote_swallows_no_row() {
        let layout = Layout::default();
        let table = Table::read("X,By\n1,A\n2,\"\n3,\" \n4,\"\n5,\"", layout).expect("a table");
        let by: Vec<&str> = table
            .rows
            .iter()
            .map(|row| row.cells[1].text.as_str())
            .collect();
        assert_eq!(by, ["A", "\"", "\"", "\"", "\""]);
        let within = Table::read("By,X\nA,1\n\",2\n\",3\n", layout).expect("a table");
        let numbers: Vec<_> = within
            .rows
            .iter()
            .map(|row| row.number(1, layout))
            .collect();
        assert_eq!(numbers, [Ok(1.0), Ok(2.0), Ok(3.0)]);
        // Two marks in a row are what begins and ends a text as well.
        let two = Table::read("By,To,X\nA,B,1\n\",\",2\n", layout).expect_err("two marks");
        assert!(
            two.to_string()
                .starts_with("line 3, column 1: a quote that stands alone")
        );
        let empty = Table::read("By,X\n\"\",1\n", layout).expect("a table");
        assert_eq!(empty.rows[0].cells[0].text, "");
    }

    #[test]
    fn rows_that_are_numbered_with_a_hash_are_no_comments() {
        let text = "# by hand\n#,X,Dev\n#1,2,3\n#2,4,5\n";
        let table = Table::read(text, Layout::default()).expect("a table");
        assert_eq!((table.rows.len(), table.passed_over), (2, 1));
        assert_eq!((table.column("#"), table.column("#1")), (Ok(0), Ok(0)));
        let bare = Layout {
            header: false,
            ..Layout::default()
        };
        let hidden = Table::read(text, bare).expect("a table");
        let asked = hidden.column("#2").expect_err("no row").to_string();
        assert!(
            asked.contains("were taken for comments, 4 of them from line 1 on"),
            "{asked}"
        );
    }

    #[test]
    fn a_grid_has_x_across_and_y_down() {
        let text = "Y \\ X;10;20,5;30\n1;0,1;0,2;\n2;0,3;-0,4;0,5\n";
        let layout = Layout {
            delimiter: ';',
            decimal_comma: true,
            ..Layout::default()
        };
        let grid = |text: &str| Table::read(text, layout).and_then(|table| table.of_grid(layout));
        let (table, empty) = grid(text).expect("a grid");
        assert_eq!((table.rows.len(), empty, table.passed_over), (5, 1, 0));
        let numbers = |row: usize| [0, 1, 2].map(|column| table.rows[row].number(column, layout));
        assert_eq!(numbers(1), [Ok(20.5), Ok(1.0), Ok(0.2)]);
        assert_eq!(numbers(4), [Ok(30.0), Ok(2.0), Ok(0.5)]);
        assert_eq!((table.rows[3].line, table.rows[3].cells[2].column), (3, 7));
        let wrong = grid(&text.replace("20,5", "left"))
            .expect_err("a word")
            .to_string();
        assert_eq!(
            wrong,
            "line 1, column 1: expected a finite number, found \"left\""
        );
    }

    #[test]
    fn a_title_above_and_sums_below_the_table_are_left_out_by_their_lines() {
        let text = "Probe log of shop 3\n\nX,Dev\n1,2\n3,4\nMean,3\n";
        let titled = Table::read(text, Layout::default())
            .expect_err("a title")
            .to_string();
        assert!(
            titled.contains("line 1 a title (--lines 2- begins behind it)"),
            "{titled}"
        );
        let padded = Table::read(&text.replacen("shop 3", "shop 3,", 1), Layout::default());
        let asked = padded
            .expect("a table")
            .column("X")
            .expect_err("a title")
            .to_string();
        assert!(asked.contains("is line 1 a title"), "{asked}");
        let layout = Layout {
            lines: (3, 5),
            ..Layout::default()
        };
        let table = Table::read(text, layout).expect("a table");
        assert_eq!(table.header, ["X", "Dev"]);
        assert_eq!(
            (table.header_line, table.passed_over, table.rows.len()),
            (3, 3, 2)
        );
        assert_eq!(table.rows[1].line, 5);
        let beyond = Layout {
            lines: (9, u64::MAX),
            ..Layout::default()
        };
        let told = Table::read(text, beyond).expect_err("beyond").to_string();
        assert_eq!(
            told,
            "the table is said to begin in line 9, and the file has 6 lines"
        );
    }

    #[test]
    fn a_point_before_thousands_is_refused_in_its_place() {
        let layout = Layout {
            delimiter: ';',
            decimal_comma: true,
            ..Layout::default()
        };
        let table =
            Table::read("target;deviation\n900;-6,08\n1.000;-3,27\n", layout).expect("a table");
        let refused = table.rows[1]
            .number(0, layout)
            .expect_err("a point")
            .to_string();
        assert!(
            refused.starts_with("line 3, column 1: expected a number with a decimal comma"),
            "{refused}"
        );
        let english = Table::read("a\n\"1,000.5\"\n", Layout::default()).expect("a table");
        let refused = english.rows[0]
            .number(0, Layout::default())
            .expect_err("grouped");
        assert!(
            refused
                .to_string()
                .contains("leave out what groups thousands")
        );
    }
}
