//! Reads the signals of one controller, each at its period, for as long as there is a receiver.

use std::{
    thread,
    time::{Duration, Instant},
};

use crate::{Connection, Controller, DataType, ReadError};

/// Wait between two attempts to connect.
const AGAIN: Duration = Duration::from_millis(500);

/// A signal of a controller.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Its name in the cell.
    pub name: String,
    /// Where it stands.
    pub address: String,
    /// How it stands there.
    pub data_type: DataType,
    /// `value = stored * scale + offset`, in `unit`.
    pub scale: f64,
    /// See `scale`.
    pub offset: f64,
    /// SI, or degC; 1 for a switch.
    pub unit: String,
    /// Time between two readings.
    pub period: Duration,
}

/// A controller and its signals.
#[derive(Debug)]
pub struct Poll {
    /// As the cell file names it.
    pub source: String,
    /// The same, ready to be connected.
    pub controller: Box<dyn Controller>,
    /// What is read of it.
    pub signals: Vec<Signal>,
}

impl Poll {
    /// Reads until `listen` says that it has heard enough; it is given each signal with its value, in the unit of the signal, or a
    /// sentence that names the source, and the address where that is what is wrong. A lost connection is made again.
    pub fn run(&self, mut listen: impl FnMut(&Signal, Result<f64, String>) -> bool) {
        let mut due = vec![Instant::now(); self.signals.len()];
        let mut connection = None;
        while let Some(next) = (0..due.len()).min_by_key(|index| due[*index]) {
            thread::sleep(due[next].saturating_duration_since(Instant::now()));
            let signal = &self.signals[next];
            due[next] = (due[next] + signal.period).max(Instant::now());
            let is_heard = match self.value(&mut connection, signal) {
                Ok(value) => listen(signal, Ok(value)),
                Err(ReadError::Refused(text)) => listen(signal, Err(text)),
                Err(ReadError::Lost(text)) => {
                    // The others would fail in the same way, one timeout after the other.
                    let again = Instant::now() + AGAIN;
                    due.fill(again);
                    // Nor are they read in vain, should this one be why.
                    due[next] = again + signal.period;
                    (self.signals.iter()).all(|signal| listen(signal, Err(text.clone())))
                }
            };
            if !is_heard {
                return;
            }
        }
    }

    /// Reads each signal once, on a connection of its own.
    ///
    /// # Errors
    /// A sentence about the first that cannot be read.
    pub fn once(&self) -> Result<Vec<(&Signal, f64)>, String> {
        let mut connection = None;
        let values = self.signals.iter().map(|signal| {
            let value = self.value(&mut connection, signal);
            value.map(|value| (signal, value))
        });
        values
            .collect::<Result<_, _>>()
            .map_err(|error| error.text().to_owned())
    }

    /// Reads a signal, and connects where that is needed. A connection that fails is dropped.
    fn value(
        &self,
        connection: &mut Option<Box<dyn Connection>>,
        signal: &Signal,
    ) -> Result<f64, ReadError> {
        let source = &self.source;
        let mut open = match connection.take() {
            Some(open) => open,
            None => (self.controller.connect())
                .map_err(|text| ReadError::Lost(format!("{source}: {text}")))?,
        };
        let stored = match open.read(&signal.address, signal.data_type) {
            Err(ReadError::Lost(text)) => {
                let address = &signal.address;
                return Err(ReadError::Lost(format!("{address} of {source}: {text}")));
            }
            stored => stored,
        };
        *connection = Some(open);
        let refused = |text: &str| {
            let (name, address) = (&signal.name, &signal.address);
            ReadError::Refused(format!("{name:?}, {address} of {source}: {text}"))
        };
        let stored = stored.map_err(|error| refused(error.text()))?;
        let value = stored * signal.scale + signal.offset;
        if !value.is_finite() {
            return Err(refused(&format!("{value} is not a finite number")));
        }
        Ok(value)
    }
}
