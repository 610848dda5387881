//! Pages and their parts as HTML: functions of the state and an instant, nothing else. Everything that stands still is SVG.

mod cell;
mod compare;
mod deeds;
mod effects;
mod gap;
mod hall;
mod ledger;
mod machine;
mod months;
mod numbers;
mod page;
mod parts;
mod picture;
mod runs;
mod sessions;
mod sizes;
mod terminal;

pub use cell::{cell_page, section, section_id};
pub use compare::{Compared, compare_page};
pub(crate) use deeds::key_page;
pub(crate) use hall::sums;
pub use hall::{hall_page, order_of, tile, tile_id};
pub(crate) use ledger::changed_by;
pub(crate) use machine::{machine_page, machines_page};
pub use page::{Place, message_page};
pub use picture::View;
pub use sessions::{Listed, SessionView, session_page, sessions_page};
pub use terminal::hall_text;
