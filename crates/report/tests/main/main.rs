//! Pages as a reader and another program see them.
//!
//! - `kit`: pages are well-formed, stand alone, and are the same every time
//! - `shift`: what a foreman reads of a session of several parts

mod kit;
mod shift;
