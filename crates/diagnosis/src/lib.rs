//! Why a session differs from the declared model of its cell.

pub mod attribution;
pub mod candidate;
pub mod effects;
pub mod evidence;
pub mod observation;
pub mod rivals;
pub mod search;
pub mod session;
