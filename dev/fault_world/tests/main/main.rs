//! The world of faults: that it finds what is wrong, and that the real nodes break nothing in it.
//!
//! - `bites`: every invariant catches a node that is deliberately wrong
//! - `found`: counterexamples that seeds have found, as shortened
//! - `gate`: every order of events about two corrections and two operators
//! - `seeds`: the seeds of every change

mod bites;
mod found;
mod gate;
mod seeds;
