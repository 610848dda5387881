//! FANUC custom macro: measuring programs out, and an interpreter that proves what they do.
//!
//! | module | what it holds |
//! |---|---|
//! | [`expression`] | numbers, variables, functions, comparisons |
//! | [`interpreter`] | programs, calls, loops, moves, skip signals, prints |
//! | [`program`] | a measuring program from an inspection plan |
//! | [`decision`] | the macros that decide after a measured size |
//!
//! Lengths are mm in the programs, as everywhere in a controller's text.

mod block;
pub mod decision;
pub mod expression;
pub mod interpreter;
mod print;
pub mod program;
mod words;

pub use interpreter::Interpreter;
