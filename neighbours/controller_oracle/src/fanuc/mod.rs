//! FANUC custom macro: expressions, blocks, and the interpreter of both.

mod block;
pub mod expression;
pub mod interpreter;
mod print;
mod words;

pub use interpreter::Interpreter;
