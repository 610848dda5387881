//! Bounds of the log: how often one place of the code may write in a minute, and how long a line may be, whatever strangers send.
//!
//! A place is a call of a macro of `tracing`. Errors are never left out. What was left out is counted, and told with the next line
//! of the same place.

use std::{
    collections::HashMap,
    hash::Hash,
    io::Write,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use tracing::{Event, Level, Subscriber, callsite::Identifier};
use tracing_subscriber::{Layer, layer::Context};

/// Lines of one place in a window of time.
const MAX_LINES: u32 = 10;
const WINDOW: Duration = Duration::from_secs(60);
/// Bytes of a line.
const MAX_BYTES: usize = 4096;

/// Leaves out what one place writes more often.
pub fn layer<S: Subscriber>() -> impl Layer<S> {
    Limit::<Identifier>(Mutex::default())
}

/// What one place wrote since the beginning of its window.
struct Place {
    begun: Instant,
    lines: u32,
}

struct Limit<P>(Mutex<HashMap<P, Place>>);

impl<P: Eq + Hash> Limit<P> {
    /// Whether a line is written, and how many were left out before it.
    fn take(&self, place: P, now: Instant) -> (bool, u32) {
        let mut places = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = places.entry(place).or_insert(Place {
            begun: now,
            lines: 0,
        });
        let mut left_out = 0;
        if now.duration_since(place.begun) >= WINDOW {
            left_out = place.lines.saturating_sub(MAX_LINES);
            *place = Place {
                begun: now,
                lines: 0,
            };
        }
        place.lines = place.lines.saturating_add(1);
        (place.lines <= MAX_LINES, left_out)
    }
}

impl<S: Subscriber> Layer<S> for Limit<Identifier> {
    fn event_enabled(&self, event: &Event<'_>, _: Context<'_, S>) -> bool {
        let metadata = event.metadata();
        if *metadata.level() == Level::ERROR || metadata.target() == module_path!() {
            return true;
        }
        let (is_written, left_out) = self.take(metadata.callsite(), Instant::now());
        if left_out > 0 {
            tracing::warn!("{left_out} messages like the next one were left out of the log");
        }
        is_written
    }
}

/// As much of a text as a line may have.
pub fn shortened(text: &str) -> &str {
    let mut end = text.len().min(MAX_BYTES);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    &text[..end]
}

/// A writer to the terminal that cuts each line.
pub struct Terminal;

impl Write for Terminal {
    fn write(&mut self, line: &[u8]) -> std::io::Result<usize> {
        let mut terminal = std::io::stderr().lock();
        let text = String::from_utf8_lossy(line);
        let kept = shortened(&text);
        terminal.write_all(kept.as_bytes())?;
        if kept.len() < text.len() {
            writeln!(terminal, "… ({} bytes more)", text.len() - kept.len())?;
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        std::io::stderr().flush()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, atomic::AtomicUsize, atomic::Ordering};

    use tracing_subscriber::layer::SubscriberExt;

    use super::*;

    struct Count(Arc<AtomicUsize>);

    impl<S: Subscriber> Layer<S> for Count {
        fn on_event(&self, _: &Event<'_>, _: Context<'_, S>) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn one_place_writes_ten_lines_a_minute_and_errors_are_all_written() {
        let count = Arc::new(AtomicUsize::new(0));
        let own = tracing_subscriber::registry()
            .with(layer())
            .with(Count(count.clone()));
        tracing::subscriber::with_default(own, || {
            for call in 0..1000 {
                tracing::warn!(target: "strangers", call, "an act is refused");
            }
            assert_eq!(count.swap(0, Ordering::Relaxed), 10);
            for call in 0..30 {
                tracing::error!(target: "strangers", call, "the disk is full");
            }
            assert_eq!(count.swap(0, Ordering::Relaxed), 30);
            tracing::warn!(target: "strangers", "another place");
            assert_eq!(count.load(Ordering::Relaxed), 1);
        });
    }

    #[test]
    fn what_was_left_out_is_told_after_a_minute() {
        let limit = Limit(Mutex::default());
        let begun = Instant::now();
        let taken: Vec<bool> = (0..25).map(|_| limit.take("place", begun).0).collect();
        assert_eq!(taken.iter().filter(|&&taken| taken).count(), 10);
        assert_eq!(limit.take("place", begun + WINDOW), (true, 15));
        assert_eq!(limit.take("place", begun + WINDOW), (true, 0));
        assert_eq!(limit.take("another", begun), (true, 0));
    }

    #[test]
    fn a_text_is_cut_between_letters() {
        let long = format!("a{}", "ü".repeat(MAX_BYTES));
        assert_eq!(shortened(&long).len(), MAX_BYTES - 1);
        assert_eq!(shortened("short"), "short");
    }
}
