//! SINUMERIK's language: expressions, blocks, and the interpreter of both.

mod block;
pub mod expression;
mod flow;
pub mod interpreter;
mod memory;

pub use interpreter::Interpreter;
pub use memory::Variables;
