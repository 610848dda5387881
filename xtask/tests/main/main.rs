//! Tasks of the workspace.
//!
//! - `code`: imports and unused items of small workspaces made up here
//! - `codegen`: generated messages against published hashes, committed output and files that are refused
//! - `sbom`: the bill of materials holds what a build takes, and nothing else

mod code;
mod codegen;
mod sbom;
