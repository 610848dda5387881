//! Speaks with real controllers: programs out, results in, and the role of a cell's driver.
//!
//! [`linuxcnc`] drives a LinuxCNC controller over its remote shell and takes the part of the cell's driver process:
//! raw status, raw probe triggers and replies come out, commands go in. [`text`] is what every reader of a
//! controller's lines is built on: each mistake is told once, with line and column. [`fanuc`] writes measuring programs in
//! FANUC custom macro and interprets them; [`contour`] writes milling programs; [`results`] reads what such
//! controllers print.
//!
//! Outside of this crate everything is SI (m, rad, s, m/s); inside the texts of a controller lengths are mm, angles
//! are degrees and feeds are mm/min.

pub mod contour;
pub mod fanuc;
pub mod linuxcnc;
pub mod results;
pub mod text;
