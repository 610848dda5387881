//! Speaks with real controllers: programs out, results in, and the role of a cell's driver.
//!
//! | module | what it holds |
//! |---|---|
//! | [`linuxcnc`] | LinuxCNC as the machine of a cell: its driver, and measuring programs in G-code |
//! | [`fanuc`] | measuring and deciding programs in custom macro, and an interpreter that proves what they do |
//! | [`sinumerik`] | the same in SINUMERIK's language |
//! | [`contour`] | milling programs |
//! | [`results`] | what controllers print and write |
//! | [`axes`], [`measuring`], [`control`], [`arithmetic`] | what writers and interpreters share |
//! | [`text`] | what every reader of lines is built on: each mistake is told once, with line and column |
//!
//! Outside of this crate everything is SI (m, rad, s, m/s); inside the texts of a controller lengths are mm, angles
//! are degrees and feeds are mm/min.

pub mod arithmetic;
pub mod axes;
pub mod contour;
pub mod control;
pub mod fanuc;
pub mod linuxcnc;
pub mod measuring;
mod reader;
pub mod results;
pub mod sinumerik;
pub mod text;
