//! The node step by step.
//!
//! - `orders`: every part of an order is made once, whatever ends at whatever instant
//! - `steps`: what the part program asks of the machine, and when it ends

mod orders;
mod steps;
