//! The page: blocks in the order in which they are added, and the few styles that screen and paper need.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt::Write;

use super::{
    bars::Bars,
    error::PlotError,
    plot::Plot,
    strips::Strips,
    text::{escaped, plain},
};

/// A page that stands alone: HTML that a program for XML reads as well, or plain text without the pictures.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    blocks: Vec<Block>,
}

/// A block of a page. Texts are plain.
#[derive(Clone, Debug)]
enum Block {
    Heading(String),
    /// On paper only: who released the record, when, and the signature.
    Signature,
    Lead(String),
    Paragraph(String),
    List(Vec<String>),
    Table(Table),
    /// Figures with their captions; `inline` ones flow side by side over the width of the page.
    Figures {
        figures: Vec<(String, String)>,
        inline: bool,
    },
}

/// A table. Cells are plain text.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Caption above the table.
    pub caption: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Rows of as many cells.
    pub rows: Vec<Vec<String>>,
    /// Numbers of rows that ask for attention.
    pub marked: BTreeSet<usize>,
    /// Addresses to which the first cells of rows lead, by number of the row.
    pub links: BTreeMap<usize, String>,
}

impl Table {
    /// An empty table with these columns.
    pub fn new(caption: impl Into<String>, columns: &[&str]) -> Self {
        Self {
            caption: caption.into(),
            columns: columns.iter().map(|&name| name.to_owned()).collect(),
            ..Self::default()
        }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) -> &mut Self {
        self.rows.push(cells);
        self
    }
}

/// Rows from which on a printed table may continue on the next sheet, with its head repeated.
const KEPT_WHOLE: usize = 20;
/// Rows up to which a wide table, whose rows may be of several lines, is moved as a whole to the next sheet instead.
const MOVED_WHOLE: usize = 12;
/// Most columns that a phone or tablet shows side by side; of a wider table each row is a block of names and values there.
const NARROW: usize = 4;
/// Characters of a quantity that a phone does not break either.
const BRIEF: usize = 8;
/// Characters on a line of plain text; a wider table is printed row by row, where its last column has no room to go on below itself.
const LINE: usize = 100;
/// Least width of a column that goes on below itself.
const LEAST: usize = 30;

/// Light or dark as the reader's system has it; on paper always light. Pictures are drawn for white: in the dark their
/// lightness is turned over and their hues are kept.
const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1a1a1a; --ground: #fff; --quiet: #444; --rule: #ddd; }
@media screen and (prefers-color-scheme: dark) {
:root { --ink: #e6e6e6; --ground: #161616; --quiet: #b4b4b4; --rule: #3a3a3a; }
svg { filter: invert(.92) hue-rotate(180deg); }
}
body { font: 15px/1.45 system-ui, sans-serif; color: var(--ink); background: var(--ground); max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; border-bottom: 1px solid var(--rule); }
table { border-collapse: collapse; margin: .8rem 0; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding-bottom: .3rem; }
th, td { text-align: left; vertical-align: top; padding: .2rem .8rem .2rem 0; border-bottom: 1px solid var(--rule); } td.quantity { white-space: nowrap; }
.plots { display: flex; flex-wrap: wrap; gap: 1rem; } figure { margin: 0; break-inside: avoid; }
figcaption { font-size: .85rem; color: var(--quiet); max-width: 46rem; } .plots figcaption { max-width: 480px; } svg { max-width: 100%; height: auto; }
.marked td:first-child { font-weight: 600; border-left: 4px solid currentColor; padding-left: .4rem; }
.lead { font-size: 1.1rem; } li { margin: .2rem 0; }
@media screen and (max-width: 40rem) {
body { overflow-wrap: anywhere; } td.quantity:not(.brief) { white-space: normal; } table { font-size: .85rem; } th, td { padding-right: .4rem; }
th { overflow-wrap: normal; } td:first-child { min-width: 5.5rem; }
}
@media screen and (max-width: 56rem) {
.wide, .wide tbody, .wide tr, .wide caption { display: block; } .wide thead { display: none; } .wide tr { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 15rem), 1fr)); column-gap: 1rem; border-bottom: 1px solid var(--rule); padding: .3rem 0; }
.wide td { display: grid; grid-template-columns: 7rem minmax(0, 1fr); border: 0; padding: .1rem 0; overflow-wrap: anywhere; } .wide td.quantity { white-space: normal; } .wide td::before { content: attr(data-label); color: var(--quiet); }
.wide td:first-child { font-weight: 600; grid-column: 1 / -1; } .wide td:first-child::before { font-weight: 400; }
}
.signature { display: none; }
@page { size: A4; margin: 15mm; @bottom-right { content: counter(page) ' / ' counter(pages); font-size: 8pt; } }
@media print {
body { margin: 0; padding: 0; max-width: none; font-size: 10pt; color: #000; background: none; }
h1, h2, caption { break-after: avoid; } p, li { orphans: 3; widows: 3; }
table { font-size: 8pt; max-width: 100%; break-inside: avoid; } table.long, table.wide { break-inside: auto; } thead { display: table-header-group; }
tr { break-inside: avoid; } th, td { padding-right: .5rem; border-bottom: .5pt solid #999; } td { overflow-wrap: break-word; }
.signature { display: flex; gap: 8mm; margin-top: 14mm; break-inside: avoid; } .signature span { flex: 1; border-top: .5pt solid #000; padding-top: 1mm; font-size: 8pt; }
figure { margin: .5rem 0; } figcaption { color: #000; max-width: none; } svg { max-height: 230mm; }
figure svg { width: 70%; } p:has(+ .plots) { break-after: avoid; } .kept { break-inside: avoid !important; }
.plots { display: block; orphans: 1; widows: 1; } .plots figure { display: inline-block; vertical-align: top; width: 49%; } .plots figure:only-child { width: 100%; }
.plots figure:not(:only-child) svg { width: 100%; } figcaption { font-size: 8pt; }
}
";

impl Page {
    /// A page with its title and nothing else.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            blocks: Vec::new(),
        }
    }

    /// A heading of the second order.
    pub fn heading(&mut self, text: &str) -> &mut Self {
        self.add(Block::Heading(text.to_owned()))
    }

    /// A line to be signed, which is on paper only.
    pub fn signature(&mut self) -> &mut Self {
        self.add(Block::Signature)
    }

    /// A paragraph in larger type: the conclusion.
    pub fn lead(&mut self, text: &str) -> &mut Self {
        self.add(Block::Lead(text.to_owned()))
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: &str) -> &mut Self {
        self.add(Block::Paragraph(text.to_owned()))
    }

    /// A list of sentences; nothing when there are none.
    pub fn list(&mut self, items: &[String]) -> &mut Self {
        if items.is_empty() {
            return self;
        }
        self.add(Block::List(items.to_vec()))
    }

    /// A table.
    pub fn table(&mut self, table: &Table) -> &mut Self {
        self.add(Block::Table(table.clone()))
    }

    /// A plot.
    ///
    /// # Errors
    /// [`PlotError`] when it cannot be drawn.
    pub fn plot(&mut self, plot: &Plot) -> Result<&mut Self, PlotError> {
        self.plots(std::slice::from_ref(plot))
    }

    /// Plots side by side over the width of the page; those with nothing to show are left out.
    ///
    /// # Errors
    /// [`PlotError`] when one cannot be drawn.
    pub fn plots(&mut self, plots: &[Plot]) -> Result<&mut Self, PlotError> {
        let shown = plots.iter().filter(|plot| !plot.is_empty());
        let drawn = shown.map(|plot| Ok((plot.svg()?, plot.caption.clone())));
        Ok(self.figures(drawn.collect::<Result<_, _>>()?, true))
    }

    /// A bar chart.
    ///
    /// # Errors
    /// [`PlotError`] when it cannot be drawn.
    pub fn bars(&mut self, bars: &Bars) -> Result<&mut Self, PlotError> {
        Ok(self.figures(vec![(bars.svg()?, bars.caption.clone())], false))
    }

    /// Strips side by side over the width of the page; those with nothing to show are left out.
    ///
    /// # Errors
    /// [`PlotError`] when one cannot be drawn.
    pub fn strips(&mut self, strips: &[Strips]) -> Result<&mut Self, PlotError> {
        let shown = strips.iter().filter(|strips| !strips.is_empty());
        let drawn = shown.map(|strips| Ok((strips.svg()?, strips.caption.clone())));
        Ok(self.figures(drawn.collect::<Result<_, _>>()?, true))
    }

    fn figures(&mut self, figures: Vec<(String, String)>, inline: bool) -> &mut Self {
        if figures.is_empty() {
            return self;
        }
        self.add(Block::Figures { figures, inline })
    }

    fn add(&mut self, block: Block) -> &mut Self {
        self.blocks.push(block);
        self
    }

    /// The whole page, UTF-8.
    pub fn html(&self) -> String {
        let title = escaped(&self.title);
        let mut body = String::new();
        for block in &self.blocks {
            block.html(&mut body);
        }
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
             <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n{body}</main>\n</body>\n</html>\n"
        )
    }

    /// The page as plain text for a terminal; figures, and headings with nothing but figures, are omitted.
    pub fn text(&self) -> String {
        let mut text = format!("{}\n", plain(&self.title));
        let mut heading = None;
        for block in &self.blocks {
            match block {
                Block::Heading(_) => heading = Some(block),
                Block::Figures { .. } => {}
                other => {
                    if let Some(heading) = heading.take() {
                        heading.text(&mut text);
                    }
                    other.text(&mut text);
                }
            }
        }
        text
    }
}

impl Block {
    fn html(&self, body: &mut String) {
        match self {
            Self::Heading(text) => element(body, "h2", "", text),
            Self::Signature => {
                let names = ["Released by", "Date", "Signature"];
                let lines = names.map(|name| format!("<span>{name}</span>"));
                put(
                    body,
                    format_args!("<p class=\"signature\">{}</p>\n", lines.concat()),
                );
            }
            Self::Lead(text) => element(body, "p", " class=\"lead\"", text),
            Self::Paragraph(text) => element(body, "p", "", text),
            Self::List(items) => {
                body.push_str("<ul>\n");
                for item in items {
                    element(body, "li", "", item);
                }
                body.push_str("</ul>\n");
            }
            Self::Table(table) => table.html(body),
            Self::Figures { figures, inline } => {
                if *inline {
                    body.push_str("<div class=\"plots\">\n");
                }
                for (svg, caption) in figures {
                    put(body, format_args!("<figure>\n{svg}"));
                    if !caption.is_empty() {
                        element(body, "figcaption", "", caption);
                    }
                    body.push_str("</figure>\n");
                }
                if *inline {
                    body.push_str("</div>\n");
                }
            }
        }
    }

    fn text(&self, text: &mut String) {
        match self {
            Self::Heading(name) => {
                let name = plain(name);
                let line = "-".repeat(name.chars().count());
                put(text, format_args!("\n{name}\n{line}\n"));
            }
            Self::Lead(words) | Self::Paragraph(words) => {
                text.push('\n');
                for line in broken(&plain(words), LINE) {
                    put(text, format_args!("{line}\n"));
                }
            }
            Self::List(items) => {
                text.push('\n');
                for item in items {
                    for (number, line) in broken(&plain(item), LINE - 2).iter().enumerate() {
                        let mark = if number == 0 { "- " } else { "  " };
                        put(text, format_args!("{mark}{line}\n"));
                    }
                }
            }
            Self::Table(table) => table.text(text),
            Self::Figures { .. } | Self::Signature => {}
        }
    }
}

impl Table {
    fn has_head(&self) -> bool {
        self.columns.iter().any(|name| !name.is_empty())
    }

    fn html(&self, body: &mut String) {
        let long = self.rows.len() > KEPT_WHOLE;
        let wide = self.has_head() && self.columns.len() > NARROW;
        // A short one is moved to the next sheet as a whole.
        let kept = self.rows.len() <= MOVED_WHOLE;
        let classes = [(long, "long"), (wide, "wide"), (wide && kept, "kept")];
        let classes = classes.iter().filter(|(is, _)| *is).map(|(_, name)| *name);
        match classes.collect::<Vec<_>>().join(" ").as_str() {
            "" => body.push_str("<table>\n"),
            classes => put(body, format_args!("<table class=\"{classes}\">\n")),
        }
        if !self.caption.is_empty() {
            element(body, "caption", "", &self.caption);
        }
        if self.has_head() {
            // Repeated on every sheet to which the table continues.
            body.push_str("<thead>\n");
            body.push_str("<tr>");
            for name in &self.columns {
                put(body, format_args!("<th>{}</th>", escaped(name)));
            }
            body.push_str("</tr>\n");
            body.push_str("</thead>\n");
        }
        body.push_str("<tbody>\n");
        for (row, cells) in self.rows.iter().enumerate() {
            body.push_str(if self.marked.contains(&row) {
                "<tr class=\"marked\">"
            } else {
                "<tr>"
            });
            for (column, cell) in cells.iter().enumerate() {
                // What a phone writes before the cell, where the row stands upright.
                let name = self.columns.get(column).filter(|_| wide);
                let label = name.map_or(String::new(), |name| {
                    format!(" data-label=\"{}\"", escaped(name))
                });
                let class = match (is_quantity(cell), cell.chars().count()) {
                    (true, ..=BRIEF) => " class=\"quantity brief\"",
                    (true, _) => " class=\"quantity\"",
                    (false, _) => "",
                };
                let text = escaped(cell);
                let link = self.links.get(&row).filter(|_| column == 0);
                let text = link.map_or(text.clone(), |to| {
                    format!("<a href=\"{}\">{text}</a>", escaped(to))
                });
                put(body, format_args!("<td{class}{label}>{text}</td>"));
            }
            body.push_str("</tr>\n");
        }
        body.push_str("</tbody>\n");
        body.push_str("</table>\n");
    }

    /// Aligned columns, or row by row where they would not fit on a line.
    fn text(&self, text: &mut String) {
        let cells = |row: &[String]| -> Vec<String> { row.iter().map(|one| plain(one)).collect() };
        let head = self.has_head().then(|| cells(&self.columns));
        let rows: Vec<Vec<String>> = (head.iter().cloned())
            .chain(self.rows.iter().map(|row| cells(row)))
            .collect();
        let mut widths = vec![0; self.columns.len()];
        for row in &rows {
            for (width, cell) in widths.iter_mut().zip(row) {
                *width = cell.chars().count().max(*width);
            }
        }
        if let Some((last, others)) = widths.split_last_mut() {
            let indent = others.iter().map(|width| width + 2).sum::<usize>() + 2;
            if indent + LEAST <= LINE {
                *last = (*last).min(LINE - indent);
            }
        }
        text.push('\n');
        if !self.caption.is_empty() {
            put(text, format_args!("{}\n", plain(&self.caption)));
        }
        if let (Some(names), true) = (
            &head,
            widths.iter().map(|width| width + 2).sum::<usize>() > LINE,
        ) {
            for row in &rows[1..] {
                for (column, (name, cell)) in names.iter().zip(row).enumerate() {
                    let mark = if column == 0 { "- " } else { "  " };
                    put(text, format_args!("  {mark}{name}: {cell}\n"));
                }
            }
            return;
        }
        for row in &rows {
            let mut below: Vec<VecDeque<String>> = (row.iter().zip(&widths))
                .map(|(cell, width)| broken(cell, *width))
                .collect();
            while below.iter().any(|lines| !lines.is_empty()) {
                let next = below.iter_mut().zip(&widths).map(|(lines, width)| {
                    let cell = lines.pop_front().unwrap_or_default();
                    format!("{cell:<width$}", width = width.min(&LINE))
                });
                let line = next.collect::<Vec<_>>().join("  ");
                put(text, format_args!("  {}\n", line.trim_end()));
            }
        }
    }
}

/// A cell in lines of that width; a word that is longer stays whole.
fn broken(cell: &str, width: usize) -> VecDeque<String> {
    let mut lines: VecDeque<String> = VecDeque::new();
    for word in cell.split(' ') {
        match lines.back_mut() {
            Some(last) if last.chars().count() + 1 + word.chars().count() <= width => {
                last.push(' ');
                last.push_str(word);
            }
            _ => lines.push_back(word.to_owned()),
        }
    }
    lines
}

/// A number with its unit, or two limits: not to be broken into lines.
fn is_quantity(cell: &str) -> bool {
    let is_short = cell.chars().count() <= 22;
    is_short && cell.starts_with(|first: char| first.is_ascii_digit() || "+-−±".contains(first))
}

fn element(body: &mut String, tag: &str, attributes: &str, text: &str) {
    let text = escaped(text);
    put(body, format_args!("<{tag}{attributes}>{text}</{tag}>\n"));
}

fn put(body: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    if body.write_fmt(text).is_err() {
        debug_assert!(false, "a string refused text");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names of the measurements of a shift, in one cell of a table without a head.
    #[test]
    fn a_cell_of_any_length_is_written() {
        let long = "punch_1/finish/1 ".repeat(10_000);
        let mut table = Table::new("", &["", ""]);
        table.row(vec!["measurements".to_owned(), long.clone()]);
        table.row(vec!["cell".to_owned(), "turn_mill".to_owned()]);
        let mut text = String::new();
        table.text(&mut text);
        assert_eq!(text.matches("punch_1/finish/1").count(), 10_000);
        assert!(text.lines().all(|line| line.chars().count() <= LINE));
        assert!(
            text.ends_with("  cell          turn_mill\n"),
            "{:?}",
            &text[text.len() - 40..]
        );
    }
}
