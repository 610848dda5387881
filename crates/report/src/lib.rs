//! What does an engineer file? Reports on one HTML page that needs nothing else, or as plain text.
//!
//! ```text
//!  diagnosis::Report, Residuals ──► pages::diagnosis_page ──┐
//!  messages of a session        ──► pages::part_page      ──┼──► kit::Page ──► .html(), .text()
//!  anything else                ──► Page, Table, Plot     ──┘
//! ```
//!
//! - [`kit`]: the building blocks. Data go in as in the rest of the project, in SI units; a [`Unit`] says what people read
//!   instead (mm, µm, °, µrad). Plots are inline SVG; nothing is loaded from elsewhere, nothing runs in the browser, and the
//!   page can be printed on A4.
//! - [`pages`]: the page of a diagnosis, and the record of the parts that a session made.
//! - [`predictive`]: simulates a session again with the model before and after its diagnosis, and compares the residuals.
//!
//! The same data give the same bytes. Texts from outside are escaped. This crate writes no files.
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

pub mod kit;
pub mod pages;
pub mod predictive;

pub use kit::{
    Arrow, Axis, Bar, Bars, Heat, Name, Page, Plot, PlotError, Series, Side, Strip, Strips, Table,
    Unit,
};
pub use pages::{
    PartSession, ShortDiagnosis, SizeRecord, add_diagnosis, diagnosis_page, part_page,
    part_session, run_of, shift_page, shift_parts, size_records, table_entries,
};
