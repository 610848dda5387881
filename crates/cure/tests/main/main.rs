//! What is written, read back by readers that share nothing with the writer.
//!
//! ```text
//!   after       what became of a cause: gone, left, doubled
//!   certainty   what is not certain, or not the machine's, is refused by name
//!   known       machines whose errors are known, drawn at random, and their reports
//!   arm         masses and friction of an arm in motion, by the crate `machine`
//!   robot       robot descriptions, by the chain of the crate `machine`
//!   firmware    Klipper, GRBL, Marlin, RepRapFirmware, by their public formulas
//!   tables      compensation of a control, ISO 230-2
//!   linuxcnc    INI and compensation table, by the formulas of LinuxCNC's manual
//! ```

mod after;
mod arm;
mod certainty;
mod firmware;
mod known;
mod linuxcnc;
mod robot;
mod tables;
