//! Reads the signals of one controller, each at its period.

use std::{
    thread,
    time::{Duration, Instant},
};

use plc::{Controller, Outcome, Poll, Reading, Signal};

use crate::{Connection, ReadError, connect};

/// Wait between two attempts to connect.
const AGAIN: Duration = Duration::from_millis(500);

/// A controller and its signals.
pub(crate) struct Polling {
    /// What is read of it.
    pub(crate) poll: Poll,
    /// The source of `poll`, ready to be connected.
    pub(crate) controller: Controller,
}

impl Polling {
    /// Reads for ever, and gives `tell` each reading. A lost connection is made again.
    pub(crate) fn run(&self, mut tell: impl FnMut(&Reading)) {
        let signals = &self.poll.signals;
        let periods = signals
            .iter()
            .map(|one| Duration::from_secs_f64(one.period_s));
        let periods: Vec<_> = periods.collect();
        let mut due = vec![Instant::now(); signals.len()];
        let mut connection = None;
        while let Some(next) = (0..due.len()).min_by_key(|index| due[*index]) {
            thread::sleep(due[next].saturating_duration_since(Instant::now()));
            let signal = &signals[next];
            due[next] = (due[next] + periods[next]).max(Instant::now());
            match self.value(&mut connection, signal) {
                Ok(value) => tell(&self.reading(signal, Outcome::Value(value))),
                Err(ReadError::Refused(text)) => {
                    tell(&self.reading(signal, Outcome::Failure(text)));
                }
                Err(ReadError::Lost(text)) => {
                    // The others would fail in the same way, one timeout after the other.
                    let again = Instant::now() + AGAIN;
                    due.fill(again);
                    // Nor are they read in vain, should this one be why.
                    due[next] = again + periods[next];
                    for signal in signals {
                        tell(&self.reading(signal, Outcome::Failure(text.clone())));
                    }
                }
            }
        }
    }

    /// Reads each signal once. A connection that is lost is not made again: what was to be read by it has failed.
    pub(crate) fn once(&self) -> Vec<Reading> {
        let (mut connection, mut lost) = (None, None);
        let readings = self.poll.signals.iter().map(|signal| {
            let read = lost
                .clone()
                .map_or_else(|| self.value(&mut connection, signal), Err);
            let outcome = match read {
                Ok(value) => Outcome::Value(value),
                Err(ReadError::Refused(text)) => Outcome::Failure(text),
                Err(ReadError::Lost(text)) => {
                    lost = Some(ReadError::Lost(text.clone()));
                    Outcome::Failure(text)
                }
            };
            self.reading(signal, outcome)
        });
        readings.collect()
    }

    fn reading(&self, signal: &Signal, outcome: Outcome) -> Reading {
        Reading {
            source: self.poll.source.clone(),
            signal: signal.name.clone(),
            outcome,
        }
    }

    /// Reads a signal, and connects where that is needed. A connection that fails is dropped.
    fn value(
        &self,
        connection: &mut Option<Box<dyn Connection>>,
        signal: &Signal,
    ) -> Result<f64, ReadError> {
        let source = &self.poll.source;
        let mut open = match connection.take() {
            Some(open) => open,
            None => connect(&self.controller)
                .map_err(|text| ReadError::Lost(format!("{source}: {text}")))?,
        };
        let refused = |text: &str| {
            let (name, address) = (&signal.name, &signal.address);
            ReadError::Refused(format!("{name:?}, {address} of {source}: {text}"))
        };
        let stored = match open.read(&signal.address, signal.data_type) {
            Err(ReadError::Lost(text)) => {
                let address = &signal.address;
                return Err(ReadError::Lost(format!("{address} of {source}: {text}")));
            }
            Err(ReadError::Refused(text)) => Err(refused(&text)),
            Ok(stored) => Ok(stored),
        };
        *connection = Some(open);
        let value = stored? * signal.scale + signal.offset;
        if !value.is_finite() {
            return Err(refused(&format!("{value} is not a finite number")));
        }
        Ok(value)
    }
}
