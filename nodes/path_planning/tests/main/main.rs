//! The node `path_planning`.
//!
//! - `poses`: points that may be touched at several poses, against every order at every choice
//! - `steps`: step by step: which plan is published for which request
//! - `underway`: while an order is made: what is told of it, and what ends it
//! - `ways`: ways between touches keep clear of what the plan tells of the part

mod poses;
mod steps;
mod underway;
mod ways;
