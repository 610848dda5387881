//! Decides, for each publisher, which sample is delivered next, which is missing, and when a missing one counts as lost.
//!
//! A pure state machine: no transport, no clock (`now` is an argument, a duration since any fixed origin). It works
//! on the positions that an advanced publisher of Zenoh counts from 0 and answers queries for, extended here to
//! 64 bits. Rules:
//!
//! - What a publisher had published when the subscription joined is past: it is neither delivered nor missing. The
//!   join ends when every reachable cache has reported its last position, and publishers have had the time to report it by
//!   heartbeat. Of a publisher discovered later, everything is due.
//! - A gap holds back what follows it. Delivery is in order, once each.
//! - Heartbeats and replies may take another route than the samples and overtake them. Hence a gap is considered only
//!   when nothing has filled any of it for two ticks: then the publisher's cache is queried.
//! - The query has an open end. The cache always holds the newest sample, hence a reply without any sample is none, and the
//!   query is repeated; a reply whose oldest sample lies behind the gap proves, after ten more quiet ticks, that the gap is
//!   lost.
//! - After `timeout` without a reply the gap is lost, so that a dead publisher does not block a subscription.

use std::collections::BTreeMap;
use std::time::Duration;

/// Number of queries for a gap inside a range that was replied to before it counts as lost.
const ATTEMPTS: u32 = 3;

/// Ticks without progress after which a gap is queried.
const QUIET_TICKS: u32 = 2;

/// Ticks without progress after which what the cache no longer has counts as lost, and is not merely overtaken.
const LOST_TICKS: u32 = 10;

/// What the transport must do.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Action<K, S> {
    /// Hand this sample to the subscriber.
    Deliver(S),
    /// Query the cache of `source` for everything from `from` on, then report with [`Recovery::replied`].
    Query { source: K, from: u64 },
    /// `count` samples from position `first` on will never come.
    Lost { source: K, first: u64, count: u64 },
}

#[derive(Debug)]
struct Source<S> {
    /// Position of the next sample to deliver.
    next: u64,
    /// The sample at `next` was already published when this subscription joined: delivered if it comes, but not due.
    next_is_past: bool,
    /// Samples behind a gap.
    held: BTreeMap<u64, S>,
    /// Newest position known to exist, plus one.
    end: u64,
    /// A query is under way.
    querying: bool,
    /// Oldest position that the query under way has returned.
    oldest_reply: Option<u64>,
    /// The cache no longer has what lies before this position.
    gone_before: Option<u64>,
    /// Queries whose replies left this gap open.
    attempts: u32,
    /// Ticks since a sample was last delivered or queried.
    quiet: u32,
    /// Since when the gap is known without progress.
    gap_since: Option<Duration>,
}

/// State of one subscription over all its publishers.
#[derive(Debug)]
pub(crate) struct Recovery<K, S> {
    sources: BTreeMap<K, Source<S>>,
    joined: bool,
    timeout: Duration,
}

impl<K: Ord + Copy, S> Recovery<K, S> {
    pub(crate) fn new(timeout: Duration) -> Self {
        Self {
            sources: BTreeMap::new(),
            joined: false,
            timeout,
        }
    }

    /// A cache reported, while joining, that `position` is its newest sample.
    pub(crate) fn past(&mut self, source: K, position: u32) {
        if !self.joined {
            let position = u64::from(position);
            self.sources
                .entry(source)
                .or_insert_with(|| Source::new(position, true));
        }
    }

    /// Every reachable publisher has reported its newest sample.
    pub(crate) fn joined(&mut self) {
        self.joined = true;
    }

    /// The common case at little cost: nothing is missing, and the sample is the next one. It is to be delivered at
    /// once when this is true, and given to [`Self::sample`] when not.
    pub(crate) fn is_next(&mut self, source: K, position: u32) -> bool {
        match self.sources.get_mut(&source) {
            Some(state) if !state.querying && !state.has_gap() && state.next as u32 == position => {
                state.next += 1;
                state.next_is_past = false;
                state.end = state.next;
                true
            }
            _ => false,
        }
    }

    /// A sample arrived, by itself or as part of a reply.
    pub(crate) fn sample(
        &mut self,
        now: Duration,
        source: K,
        position: u32,
        is_reply: bool,
        sample: S,
        actions: &mut Vec<Action<K, S>>,
    ) {
        let joined = self.joined;
        let state = self
            .sources
            .entry(source)
            .or_insert_with(|| Source::new(if joined { 0 } else { u64::from(position) }, false));
        let position = state.extend(position);
        state.end = state.end.max(position + 1);
        if is_reply {
            state.oldest_reply = Some(
                state
                    .oldest_reply
                    .map_or(position, |oldest| oldest.min(position)),
            );
        }
        state.skip_past(position);
        if position < state.next {
            return; // a duplicate
        }
        if position > state.next {
            state.held.entry(position).or_insert(sample);
            state.gap_since.get_or_insert(now);
        } else {
            state.deliver(now, sample, actions);
        }
    }

    /// A publisher reported that `position` is its newest sample.
    pub(crate) fn heartbeat(&mut self, now: Duration, source: K, position: u32) {
        let joined = self.joined;
        let state = self.sources.entry(source).or_insert_with(|| {
            if joined {
                Source::new(0, false)
            } else {
                Source::new(u64::from(position), true)
            }
        });
        let position = state.extend(position);
        state.skip_past(position);
        if !(state.next_is_past && position == state.next) {
            state.end = state.end.max(position + 1);
        }
        if state.has_gap() {
            state.gap_since.get_or_insert(now);
        }
    }

    /// The query asked for has ended, answered or not.
    pub(crate) fn replied(&mut self, source: K) {
        let Some(state) = self.sources.get_mut(&source) else {
            return;
        };
        state.querying = false;
        state.quiet = 0;
        let Some(oldest) = state.oldest_reply.take() else {
            return;
        };
        state.attempts += 1;
        if state.attempts >= ATTEMPTS {
            let reachable = state.held.first_key_value().map(|(&held, _)| held);
            state.gone_before = Some(reachable.unwrap_or(state.end));
        } else if oldest > state.next {
            state.gone_before = Some(oldest);
        }
    }

    /// A tick has passed: asks, or gives up.
    pub(crate) fn tick(&mut self, now: Duration, actions: &mut Vec<Action<K, S>>) {
        for (&source, state) in &mut self.sources {
            if !state.has_gap() || state.querying {
                continue;
            }
            state.quiet += 1;
            let quiet_ticks = if state.gone_before.is_some() {
                LOST_TICKS
            } else {
                QUIET_TICKS
            };
            if state.quiet < quiet_ticks {
                continue;
            }
            let waited = now.saturating_sub(*state.gap_since.get_or_insert(now));
            if let Some(gone) = state.gone_before.take() {
                state.give_up_before(now, source, gone, actions);
            } else if waited >= self.timeout {
                state.give_up_all(now, source, actions);
            } else {
                state.querying = true;
                actions.push(Action::Query {
                    source,
                    from: state.next,
                });
            }
        }
    }

    /// Something is missing, so that [`Self::tick`] has work to do.
    pub(crate) fn has_gap(&self) -> bool {
        self.sources.values().any(Source::has_gap)
    }
}

impl<S> Source<S> {
    fn new(next: u64, next_is_past: bool) -> Self {
        Self {
            next,
            next_is_past,
            held: BTreeMap::new(),
            end: next,
            querying: false,
            oldest_reply: None,
            gone_before: None,
            attempts: 0,
            quiet: 0,
            gap_since: None,
        }
    }

    /// The 64-bit position nearest to `next` that has these low 32 bits.
    fn extend(&self, position: u32) -> u64 {
        let ahead = position.wrapping_sub(self.next as u32) as i32;
        self.next.saturating_add_signed(i64::from(ahead))
    }

    /// A later sample exists: the one published before the join is not waited for.
    fn skip_past(&mut self, position: u64) {
        if self.next_is_past && position > self.next {
            self.next += 1;
            self.next_is_past = false;
        }
    }

    fn has_gap(&self) -> bool {
        self.end > self.next
    }

    fn deliver<K>(&mut self, now: Duration, sample: S, actions: &mut Vec<Action<K, S>>) {
        actions.push(Action::Deliver(sample));
        self.next += 1;
        self.next_is_past = false;
        self.flush(now, actions);
    }

    /// Delivers what was held back for the samples before it; the clock of the rest of the gap starts anew.
    fn flush<K>(&mut self, now: Duration, actions: &mut Vec<Action<K, S>>) {
        while let Some(sample) = self.held.remove(&self.next) {
            actions.push(Action::Deliver(sample));
            self.next += 1;
        }
        self.end = self.end.max(self.next);
        self.quiet = 0;
        self.gone_before = self.gone_before.filter(|&gone| gone > self.next);
        self.gap_since = self.has_gap().then_some(now);
        if !self.has_gap() {
            self.attempts = 0;
        }
    }

    /// Everything before `position` that did not come is lost.
    fn give_up_before<K: Copy>(
        &mut self,
        now: Duration,
        source: K,
        position: u64,
        actions: &mut Vec<Action<K, S>>,
    ) {
        while self.next < position {
            let reachable = self
                .held
                .first_key_value()
                .map_or(position, |(&held, _)| held.min(position));
            actions.push(Action::Lost {
                source,
                first: self.next,
                count: reachable - self.next,
            });
            self.next = reachable;
            self.next_is_past = false;
            self.flush(now, actions);
        }
    }

    /// Everything that is known to exist and did not come is lost.
    fn give_up_all<K: Copy>(&mut self, now: Duration, source: K, actions: &mut Vec<Action<K, S>>) {
        self.give_up_before(now, source, self.end, actions);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: Duration = Duration::from_secs(10);

    /// A subscription and what it did; a sample is its own position.
    struct Bench {
        recovery: Recovery<u8, u32>,
        now: Duration,
        actions: Vec<Action<u8, u32>>,
    }

    impl Bench {
        fn joining() -> Self {
            Self {
                recovery: Recovery::new(TIMEOUT),
                now: Duration::ZERO,
                actions: Vec::new(),
            }
        }

        fn joined() -> Self {
            let mut bench = Self::joining();
            bench.recovery.joined();
            bench
        }

        fn live(&mut self, positions: impl IntoIterator<Item = u32>) {
            for position in positions {
                if self.recovery.is_next(0, position) {
                    self.actions.push(Action::Deliver(position));
                } else {
                    self.recovery
                        .sample(self.now, 0, position, false, position, &mut self.actions);
                }
            }
        }

        fn answer(&mut self, positions: impl IntoIterator<Item = u32>) {
            for position in positions {
                self.recovery
                    .sample(self.now, 0, position, true, position, &mut self.actions);
            }
            self.recovery.replied(0);
        }

        fn heartbeat(&mut self, position: u32) {
            self.recovery.heartbeat(self.now, 0, position);
        }

        /// Ticks within which nothing comes, until a gap is asked for.
        fn quiet(&mut self) {
            self.quiet_for(QUIET_TICKS);
        }

        fn quiet_for(&mut self, ticks: u32) {
            for _ in 0..ticks {
                self.now += Duration::from_millis(100);
                self.recovery.tick(self.now, &mut self.actions);
            }
        }

        fn did(&mut self) -> Vec<Action<u8, u32>> {
            std::mem::take(&mut self.actions)
        }
    }

    fn delivered(positions: impl IntoIterator<Item = u32>) -> Vec<Action<u8, u32>> {
        positions.into_iter().map(Action::Deliver).collect()
    }

    fn ask(from: u64) -> Action<u8, u32> {
        Action::Query { source: 0, from }
    }

    fn lost(first: u64, count: u64) -> Action<u8, u32> {
        Action::Lost {
            source: 0,
            first,
            count,
        }
    }

    #[test]
    fn samples_in_order_are_delivered_once() {
        let mut bench = Bench::joined();
        bench.live([0, 1, 1, 0, 2]);
        assert_eq!(bench.did(), delivered([0, 1, 2]));
        assert!(!bench.recovery.has_gap());
    }

    #[test]
    fn a_gap_is_fetched_and_delivered_in_order() {
        let mut bench = Bench::joined();
        bench.live([0, 1, 5]);
        bench.quiet();
        assert_eq!(bench.did(), [delivered([0, 1]), vec![ask(2)]].concat_all());
        bench.live([6]);
        assert_eq!(bench.did(), vec![]);
        bench.answer([2, 3, 4, 5, 6]);
        assert_eq!(bench.did(), delivered([2, 3, 4, 5, 6]));
        assert!(!bench.recovery.has_gap());
    }

    #[test]
    fn what_was_only_overtaken_is_not_asked_for() {
        let mut bench = Bench::joined();
        bench.live([0, 2]);
        bench.heartbeat(40);
        for position in [1, 3, 4, 5, 6] {
            bench.recovery.tick(bench.now, &mut bench.actions);
            bench.live([position]);
        }
        assert_eq!(bench.did(), delivered(0..=6));
    }

    #[test]
    fn an_answer_that_overtakes_the_samples_loses_none() {
        let mut bench = Bench::joined();
        bench.live([0]);
        bench.heartbeat(9);
        bench.quiet();
        bench.answer([8, 9]);
        bench.did();
        bench.live(1..=9);
        bench.quiet_for(LOST_TICKS);
        assert_eq!(bench.did(), delivered(1..=9));
    }

    #[test]
    fn a_cache_that_was_too_small_gives_the_number_of_the_first_lost() {
        let mut bench = Bench::joined();
        bench.live([0, 9]);
        bench.quiet();
        bench.answer([7, 8, 9]);
        bench.did();
        bench.quiet_for(LOST_TICKS - 1);
        assert_eq!(bench.did(), vec![]);
        bench.quiet_for(1);
        assert_eq!(
            bench.did(),
            [vec![lost(1, 6)], delivered([7, 8, 9])].concat_all()
        );
    }

    #[test]
    fn the_last_samples_are_fetched_by_heartbeat() {
        let mut bench = Bench::joined();
        bench.live([0]);
        bench.did();
        bench.heartbeat(3);
        bench.quiet();
        assert_eq!(bench.did(), vec![ask(1)]);
        bench.answer([1, 2, 3]);
        assert_eq!(bench.did(), delivered([1, 2, 3]));
    }

    #[test]
    fn an_empty_answer_is_asked_again_and_given_up_in_the_end() {
        let mut bench = Bench::joined();
        bench.live([0, 3]);
        bench.quiet();
        bench.did();
        bench.answer([]);
        bench.quiet();
        assert_eq!(bench.did(), vec![ask(1)]);
        bench.answer([]);
        bench.now += TIMEOUT;
        bench.quiet();
        assert_eq!(bench.did(), [vec![lost(1, 2)], delivered([3])].concat_all());
        assert!(!bench.recovery.has_gap());
    }

    #[test]
    fn a_dead_publisher_loses_its_unseen_tail_by_number() {
        let mut bench = Bench::joined();
        bench.live([0]);
        bench.heartbeat(4);
        bench.quiet();
        bench.did();
        bench.answer([]);
        bench.now += TIMEOUT;
        bench.quiet();
        assert_eq!(bench.did(), vec![lost(1, 4)]);
    }

    #[test]
    fn what_was_published_before_the_join_is_not_owed() {
        let mut bench = Bench::joining();
        bench.recovery.past(0, 41);
        bench.recovery.joined();
        bench.heartbeat(41);
        assert_eq!(bench.did(), vec![]);
        bench.live([42]);
        assert_eq!(bench.did(), delivered([42]));
    }

    #[test]
    fn a_sample_that_arrives_while_joining_is_kept_even_if_the_cache_told_it_first() {
        let mut bench = Bench::joining();
        bench.recovery.past(0, 41);
        bench.live([41, 42]);
        assert_eq!(bench.did(), delivered([41, 42]));
    }

    #[test]
    fn after_the_join_a_gap_behind_the_past_is_owed() {
        let mut bench = Bench::joining();
        bench.recovery.past(0, 41);
        bench.recovery.joined();
        bench.live([44]);
        bench.quiet();
        assert_eq!(bench.did(), vec![ask(42)]);
    }

    #[test]
    fn a_publisher_met_after_the_join_owes_everything() {
        let mut bench = Bench::joined();
        bench.heartbeat(2);
        bench.quiet();
        assert_eq!(bench.did(), vec![ask(0)]);
        bench.answer([0, 1, 2]);
        assert_eq!(bench.did(), delivered([0, 1, 2]));
    }

    #[test]
    fn positions_wrap_after_32_bits() {
        let mut bench = Bench::joining();
        bench.live([u32::MAX - 1, u32::MAX, 0, 2]);
        bench.quiet();
        assert_eq!(
            bench.did(),
            [
                delivered([u32::MAX - 1, u32::MAX, 0]),
                vec![ask((1 << 32) + 1)]
            ]
            .concat_all()
        );
    }

    #[test]
    fn a_hole_in_an_answer_is_asked_for_again() {
        let mut bench = Bench::joined();
        bench.live([0, 4]);
        bench.quiet();
        bench.did();
        bench.answer([1, 3, 4]);
        bench.quiet();
        assert_eq!(bench.did(), [delivered([1]), vec![ask(2)]].concat_all());
        bench.answer([2, 3, 4]);
        assert_eq!(bench.did(), delivered([2, 3, 4]));
    }

    trait ConcatAll {
        fn concat_all(self) -> Vec<Action<u8, u32>>;
    }

    impl<const N: usize> ConcatAll for [Vec<Action<u8, u32>>; N] {
        fn concat_all(self) -> Vec<Action<u8, u32>> {
            self.into_iter().flatten().collect()
        }
    }
}
