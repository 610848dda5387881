//! Programs for controllers that no driver of the cell reaches, and what such controllers report.
//!
//! ```text
//!                      registry::DIALECTS
//!         linuxcnc   fanuc   sinumerik   inspection
//!         programs: plan + order -> text
//!         results:  text -> touches, sizes
//!              ^                    |
//!              |                    v
//!      probecell program     probecell results
//! ```
//!
//! A dialect is one file or folder, and one line in the registry, from which commands and help texts follow.
//!
//! | module | content |
//! |---|---|
//! | [`dialect`] | trait [`dialect::Dialect`] |
//! | [`registry`] | the dialects there are |
//! | [`linuxcnc`], [`fanuc`], [`sinumerik`] | measuring programs, of two of them decision programs, results |
//! | [`inspection`] | dialect without programs: results of measuring cycles and inspection software |
//! | [`results`] | content of a result file, whatever its format |
//! | [`contour`] | milling programs of profiles (`probecell correct`) |
//! | [`measuring`] | a plan decomposed into checked moves |
//!
//! ```
//! use programs::{dialect::recognise, registry::DIALECTS};
//!
//! // Printed by a FANUC: one touch, and one probing move without contact.
//! let text = "AXES X Y Z\nTOUCH 1 4 10. 0. -5.\nMISS 2 7 12. 0. -5.\n";
//! let format = recognise(DIALECTS, text)?;
//! assert_eq!(format.name(), "dprnt");
//! let touches = format.read(text)?.touches;
//! assert_eq!(touches[0].point_index, 4);
//! assert_eq!(touches[0].position, [10e-3, 0.0, -5e-3]); // m
//! # Ok::<(), programs::results::ResultsError>(())
//! ```
//!
//! Outside of this crate everything is SI (m, rad, s, m/s); inside the texts of a controller lengths are mm, angles
//! are degrees and feeds are mm/min.

pub mod contour;
pub mod dialect;
pub mod fanuc;
pub mod inspection;
pub mod linuxcnc;
pub mod measuring;
pub mod registry;
pub mod results;
pub mod sinumerik;
