//! Building blocks of a page: headings, paragraphs, tables and plots, on values in SI units. Knows no machine.

mod bars;
mod colours;
mod draw;
mod error;
mod page;
mod plot;
mod strips;
mod text;
mod unit;

pub use bars::{Bar, Bars};
pub use error::PlotError;
pub use page::{Page, Table};
pub use plot::{Arrow, Axis, Heat, Name, Plot, Series, Side};
pub use strips::{Strip, Strips};
pub use unit::Unit;
