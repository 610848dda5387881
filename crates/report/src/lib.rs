//! A report that a person reads: headings, paragraphs, tables and plots on one HTML page that needs nothing else.
//!
//! Data go in as in the rest of the project, in SI units; a [`Unit`] says what people read instead (mm, µm, °, µrad).
//! Plots are inline SVG, nothing is loaded from elsewhere, nothing runs in the reader's browser, and the page can be
//! printed. The same data give the same bytes. This crate knows nothing of machines, and writes no files.
//!
//! ```
//! use report::{Axis, Page, Plot, Series, Unit};
//!
//! let mut page = Page::new("Straightness of X");
//! page.paragraph("The guideway sags between its feet.");
//! page.plot(
//!     &Plot::new("Straightness", Axis::new("X", Unit::MM), Axis::new("deviation", Unit::UM))
//!         .with(Series::line("fitted", vec![(0.0, 0.0), (0.1, -3e-6), (0.2, 0.0)]))
//!         .with(Series::points("measured", vec![(0.1, -2.8e-6)])),
//! )?;
//! assert!(page.html().contains("<svg"));
//! # Ok::<(), report::PlotError>(())
//! ```

mod bars;
mod colours;
mod draw;
mod page;
mod plot;
mod strips;
mod unit;

pub use bars::{Bar, Bars};
pub use draw::PlotError;
pub use page::{Page, Table};
pub use plot::{Arrow, Axis, Heat, Name, Plot, Series, Side};
pub use strips::{Strip, Strips};
pub use unit::Unit;
