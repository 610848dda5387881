//! What goes out: the record of a session in the formats of other systems, in the units that each asks for.

pub mod aqdef;
pub mod dmis;
pub mod qif;
