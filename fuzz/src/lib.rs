//! What must hold whatever bytes come in: one module for each reader of bytes of others.
//!
//! Each has `target`, which panics where a promise is broken, and `seeds`, valid inputs to begin from. libFuzzer calls
//! the targets through `fuzz_targets/`; `tests/mutations.rs` calls them with seeded mutations, so that they run on
//! every toolchain. A target that returns says nothing about the input: most inputs are refused, as they should be.
#![forbid(unsafe_code)]

pub mod cdr;
pub mod cell_file;
pub mod documents;
pub mod folder;
pub mod mcap;
pub mod remote_shell;
pub mod report;
pub mod table;
pub mod urdf;

/// A reader of bytes of others.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, as libFuzzer's binary has it.
    pub name: &'static str,
    /// Takes any bytes; panics where a promise is broken.
    pub run: fn(&[u8]),
    /// Inputs that are accepted.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// All of them.
pub const TARGETS: [Target; 9] = [
    Target {
        name: "cdr",
        run: cdr::target,
        seeds: cdr::seeds,
    },
    Target {
        name: "mcap",
        run: mcap::target,
        seeds: mcap::seeds,
    },
    Target {
        name: "urdf",
        run: urdf::target,
        seeds: urdf::seeds,
    },
    Target {
        name: "cell_file",
        run: cell_file::target,
        seeds: cell_file::seeds,
    },
    Target {
        name: "remote_shell",
        run: remote_shell::target,
        seeds: remote_shell::seeds,
    },
    Target {
        name: "folder",
        run: folder::target,
        seeds: folder::seeds,
    },
    Target {
        name: "table",
        run: table::target,
        seeds: table::seeds,
    },
    Target {
        name: "report",
        run: report::target,
        seeds: report::seeds,
    },
    Target {
        name: "documents",
        run: documents::target,
        seeds: documents::seeds,
    },
];
