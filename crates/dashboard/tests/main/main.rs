//! What the dashboard makes of messages, on the sample recordings and on states made up here.
//!
//! - `hall`: tiles, which of them are shown, and how much is kept of the last parts and hours
//! - `judgements`: what the pages say where a wrong judgement would be believed
//! - `sample_pages`: pages of the sample recordings against their readable twins and reports
//! - `terminal`: the hall as text

mod hall;
mod judgements;
mod sample_pages;
mod terminal;
