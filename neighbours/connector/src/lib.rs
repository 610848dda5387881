//! What connectors and formats share. Pure: nothing here knows a socket, a file or the clock.
//!
//! ```text
//! a running cell's messages --> live::Sizes --> mtconnect::agent, probecell-sparkplug, probecell-opcua
//! a session's record --> exchange::export::Record --> mtconnect
//! ```

pub mod live;
pub mod mtconnect;
pub mod uuid;
pub mod xml;
