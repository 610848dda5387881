//! The page: blocks in the order in which they are added, and the few styles that screen and paper need.

use std::fmt::Write;

use crate::{Bars, Plot, PlotError, Strips};

/// A page that stands alone: HTML that a program for XML reads as well.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    body: String,
}

/// A table. Cells are plain text.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// What stands above it.
    pub caption: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Rows of as many cells.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table with these columns.
    pub fn new(caption: impl Into<String>, columns: &[&str]) -> Self {
        Self {
            caption: caption.into(),
            columns: columns.iter().map(|&name| name.to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) -> &mut Self {
        self.rows.push(cells);
        self
    }
}

const STYLE: &str = "
body { font: 15px/1.45 system-ui, sans-serif; color: #1a1a1a; background: #fff; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; border-bottom: 1px solid #ddd; }
table { border-collapse: collapse; margin: .8rem 0; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding-bottom: .3rem; }
th, td { text-align: left; vertical-align: top; padding: .2rem .8rem .2rem 0; border-bottom: 1px solid #e5e5e5; }
.plots { display: flex; flex-wrap: wrap; gap: 1rem; } figure { margin: 0; break-inside: avoid; }
figcaption { font-size: .85rem; color: #444; max-width: 46rem; } .plots figcaption { max-width: 480px; } svg { max-width: 100%; height: auto; }
.lead { font-size: 1.1rem; } li { margin: .2rem 0; }
@page { size: A4; margin: 15mm; }
@media print { body { margin: 0; padding: 0; max-width: none; font-size: 10pt; } h1, h2, caption { break-after: avoid; } tr { break-inside: avoid; } tr:has(th) { break-after: avoid; } table { font-size: 8.5pt; } th, td { padding-right: .5rem; } .plots { display: block; } figure { margin: .5rem 0; } }
";

impl Page {
    /// A page with its title and nothing else.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            body: String::new(),
        }
    }

    /// A heading of the second order.
    pub fn heading(&mut self, text: &str) -> &mut Self {
        self.add("h2", "", text)
    }

    /// A paragraph in larger letters: what somebody in a hurry reads.
    pub fn lead(&mut self, text: &str) -> &mut Self {
        self.add("p", " class=\"lead\"", text)
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: &str) -> &mut Self {
        self.add("p", "", text)
    }

    /// A list of sentences; nothing when there are none.
    pub fn list(&mut self, items: &[String]) -> &mut Self {
        if items.is_empty() {
            return self;
        }
        self.body.push_str("<ul>\n");
        for item in items {
            self.add("li", "", item);
        }
        self.body.push_str("</ul>\n");
        self
    }

    /// A table.
    pub fn table(&mut self, table: &Table) -> &mut Self {
        self.body.push_str("<table>\n");
        if !table.caption.is_empty() {
            self.add("caption", "", &table.caption);
        }
        let mut row = |cells: &[String], tag: &str| {
            self.body.push_str("<tr>");
            for cell in cells {
                put(
                    &mut self.body,
                    format_args!("<{tag}>{}</{tag}>", escaped(cell)),
                );
            }
            self.body.push_str("</tr>\n");
        };
        row(&table.columns, "th");
        for cells in &table.rows {
            row(cells, "td");
        }
        self.body.push_str("</table>\n");
        self
    }

    /// A plot.
    ///
    /// # Errors
    /// [`PlotError`] when it cannot be drawn.
    pub fn plot(&mut self, plot: &Plot) -> Result<&mut Self, PlotError> {
        self.plots(std::slice::from_ref(plot))
    }

    /// Plots beside each other as far as the page is wide; those with nothing to show are left out.
    ///
    /// # Errors
    /// [`PlotError`] when one cannot be drawn.
    pub fn plots(&mut self, plots: &[Plot]) -> Result<&mut Self, PlotError> {
        let shown: Vec<&Plot> = plots.iter().filter(|plot| !plot.is_empty()).collect();
        if shown.is_empty() {
            return Ok(self);
        }
        self.body.push_str("<div class=\"plots\">\n");
        for plot in shown {
            let svg = plot.svg()?;
            self.figure(&svg, &plot.caption);
        }
        self.body.push_str("</div>\n");
        Ok(self)
    }

    /// A bar chart.
    ///
    /// # Errors
    /// [`PlotError`] when it cannot be drawn.
    pub fn bars(&mut self, bars: &Bars) -> Result<&mut Self, PlotError> {
        let svg = bars.svg()?;
        self.figure(&svg, &bars.caption);
        Ok(self)
    }

    /// Strips beside each other as far as the page is wide; those with nothing to show are left out.
    ///
    /// # Errors
    /// [`PlotError`] when one cannot be drawn.
    pub fn strips(&mut self, strips: &[Strips]) -> Result<&mut Self, PlotError> {
        let shown: Vec<&Strips> = strips.iter().filter(|strips| !strips.is_empty()).collect();
        if shown.is_empty() {
            return Ok(self);
        }
        self.body.push_str("<div class=\"plots\">\n");
        for strips in shown {
            let svg = strips.svg()?;
            self.figure(&svg, &strips.caption);
        }
        self.body.push_str("</div>\n");
        Ok(self)
    }

    fn figure(&mut self, svg: &str, caption: &str) {
        put(&mut self.body, format_args!("<figure>\n{svg}"));
        if !caption.is_empty() {
            self.add("figcaption", "", caption);
        }
        self.body.push_str("</figure>\n");
    }

    fn add(&mut self, tag: &str, attributes: &str, text: &str) -> &mut Self {
        let text = escaped(text);
        put(
            &mut self.body,
            format_args!("<{tag}{attributes}>{text}</{tag}>\n"),
        );
        self
    }

    /// The whole page, UTF-8.
    pub fn html(&self) -> String {
        let (title, body) = (escaped(&self.title), &self.body);
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
             <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{body}</body>\n</html>\n"
        )
    }
}

/// Text that is no markup.
pub(crate) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            letter if letter.is_control() && letter != '\n' => safe.push(' '),
            letter => safe.push(letter),
        }
    }
    safe
}

fn put(body: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    if body.write_fmt(text).is_err() {
        debug_assert!(false, "a string refused text");
    }
}
