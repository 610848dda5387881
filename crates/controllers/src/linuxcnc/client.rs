//! One connection to `linuxcncrsh`: opens a session, queries, commands, and names each kind of failure.
//!
//! The server keeps state that is shared by all its connections (which connection has control, when a `set` is answered, a tokeniser
//! that is not safe between threads), so a controller should have one client only. After a failed exchange the replies
//! may be out of step with the requests; the connection must then be dropped.

use std::{
    io::{ErrorKind, Read, Write},
    net::{TcpStream, ToSocketAddrs},
    time::{Duration, Instant},
};

use crate::secret::{Secret, SecretError};

use super::protocol::{self, Get, Interpreter, Mode, Reply, RequestError, Set};
use crate::text::{Lines, ParseError};

/// Where the controller listens and how long it may take.
#[derive(Clone, Debug)]
pub struct Address {
    /// Host and port, for example `127.0.0.1:5007`.
    pub host: String,
    /// Password of a session.
    pub connect_password: Secret,
    /// Password of control.
    pub enable_password: Secret,
    /// Longest wait for a connection.
    pub connect_timeout: Duration,
    /// Longest wait for a reply.
    pub reply_timeout: Duration,
}

/// Why an exchange with the controller failed.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// Nobody listens, or the name is unknown.
    #[error("no connection to the controller at {host}: {source}")]
    Connect {
        /// Host and port.
        host: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// A password is not where it is said to be.
    #[error(transparent)]
    Secret(#[from] SecretError),
    /// The connection ended.
    #[error("the controller is gone: its connection ended during {request:?}")]
    Gone {
        /// The request under way.
        request: String,
    },
    /// No reply in time.
    #[error("the controller did not answer {request:?} within {seconds} s")]
    TimedOut {
        /// The request under way.
        request: String,
        /// The longest wait, s.
        seconds: f64,
    },
    /// The controller refused.
    #[error("the controller refused {request:?}")]
    Refused {
        /// The request.
        request: String,
    },
    /// A reply makes no sense.
    #[error("reply to {request:?}: {source}")]
    Reply {
        /// The request.
        request: String,
        /// Where and why.
        source: ParseError,
    },
    /// A request cannot be sent.
    #[error(transparent)]
    Request(#[from] RequestError),
}

impl ClientError {
    /// The controller refused, but the connection is intact.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::Refused { .. } | Self::Request(_))
    }
}

/// One look at the controller. The parts are read one after the other, within about a millisecond.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// From the call to the middle of the exchange that read the positions.
    pub delay: Duration,
    /// mm or degrees, readings of joints 0 to 5.
    pub joints: [f64; 6],
    /// mm or degrees, commanded X Y Z A B C in the machine's coordinates.
    pub commanded: [f64; 6],
    /// The emergency stop is active.
    pub emergency_stop: bool,
    /// The machine is on.
    pub machine_on: bool,
    /// Mode of the controller.
    pub mode: Mode,
    /// State of the interpreter.
    pub interpreter: Interpreter,
    /// Line of the open program.
    pub line: u32,
    /// File of the open program.
    pub program: Option<String>,
    /// Tool in the spindle, 0: none.
    pub tool: u32,
    /// 1.0 = 100 %.
    pub feed_override: f64,
    /// Revolutions per minute as programmed, with the sign of the direction; 0 when the spindle is off.
    pub spindle_speed: f64,
    /// Level of the probe input.
    pub probe_tripped: bool,
}

/// A session with control of the machine.
#[derive(Debug)]
pub struct Client {
    stream: TcpStream,
    lines: Lines,
    reply_timeout: Duration,
}

impl Client {
    /// Connects, opens the session and takes control.
    ///
    /// # Errors
    /// Nobody answers at the address, or the remote shell refuses the session.
    pub fn connect(address: &Address) -> Result<Self, ClientError> {
        let failed = |source| ClientError::Connect {
            host: address.host.clone(),
            source,
        };
        let mut last = std::io::Error::new(ErrorKind::NotFound, "the name has no address");
        for candidate in address.host.to_socket_addrs().map_err(failed)? {
            match TcpStream::connect_timeout(&candidate, address.connect_timeout) {
                Ok(stream) => {
                    stream.set_nodelay(true).map_err(failed)?;
                    return Self::open(stream, address);
                }
                Err(error) => last = error,
            }
        }
        Err(failed(last))
    }

    fn open(stream: TcpStream, address: &Address) -> Result<Self, ClientError> {
        let mut client = Self {
            stream,
            lines: Lines::default(),
            reply_timeout: address.reply_timeout,
        };
        let hello = protocol::hello(&address.connect_password.resolve()?, "probecell")?;
        // The password is not repeated in an error.
        client.send("hello", &hello)?;
        match client.reply("hello")? {
            (_, Reply::Welcome { .. }) => {}
            _ => {
                return Err(ClientError::Refused {
                    request: "hello".to_owned(),
                });
            }
        }
        // Until echo is off the server repeats the requests, so nothing but the last acknowledgement is looked for.
        let verbose = Set::Verbose(true).encode()?;
        client.send(
            &verbose,
            &format!("{}\r\n{verbose}", Set::Echo(false).encode()?),
        )?;
        client.wait_for_line(&verbose, |text| text == "SET VERBOSE ACK")?;
        client.set(&Set::Enable(address.enable_password.resolve()?))?;
        client.set(&Set::WaitReceived)?;
        Ok(client)
    }

    /// Tells the controller something; comes back when it was received, which takes up to 0.1 s.
    ///
    /// # Errors
    /// The connection has ended, or the controller refuses.
    pub fn set(&mut self, set: &Set) -> Result<(), ClientError> {
        let line = set.encode()?;
        let shown = if matches!(set, Set::Enable(_)) {
            "set enable"
        } else {
            line.as_str()
        };
        self.send(shown, &line)?;
        match self.reply(shown)? {
            (_, Reply::Accepted(subject)) if subject == set.subject() => Ok(()),
            (_, Reply::Refused(_)) => Err(ClientError::Refused {
                request: shown.to_owned(),
            }),
            (line, other) => {
                let expected = format!("SET {} ACK or NAK", set.subject());
                let source = ParseError {
                    line,
                    column: 1,
                    expected,
                    found: format!("{other:?}"),
                };
                Err(ClientError::Reply {
                    request: shown.to_owned(),
                    source,
                })
            }
        }
    }

    /// Looks at the controller. The positions come first: they are what is stamped.
    ///
    /// One request waits for the answer to the one before: the server delays small packets, so requests sent together
    /// are answered 40 ms later, requests sent in turn within 1 ms.
    ///
    /// # Errors
    /// The connection has ended, or an answer is not of the protocol.
    pub fn sample(&mut self) -> Result<Sample, ClientError> {
        let begun = Instant::now();
        let joints = self.get(Get::JointPositions, protocol::positions)?;
        let delay = begun.elapsed() / 2;
        let commanded = self.get(Get::CommandedPosition, protocol::positions)?;
        let probe_tripped = self.get(Get::ProbeValue, protocol::count)? != 0;
        let emergency_stop = self.get(Get::EmergencyStop, protocol::on_or_off)?;
        let machine_on = self.get(Get::Machine, protocol::on_or_off)?;
        let mode = self.get(Get::Mode, protocol::mode)?;
        let interpreter = self.get(Get::ProgramStatus, protocol::interpreter)?;
        let line = self.get(Get::ProgramLine, protocol::count)?;
        let program = self.get(Get::Program, |words| Ok(protocol::text(words)))?;
        let tool = self.get(Get::Tool, protocol::count)?;
        let feed_override = f64::from(self.get(Get::FeedOverride, protocol::count)?) / 100.0;
        let direction = self.get(Get::Spindle, protocol::spindle_direction)?;
        let spindle_speed = direction * self.get(Get::ProgramCodes, protocol::programmed_speed)?;
        Ok(Sample {
            delay,
            joints,
            commanded,
            emergency_stop,
            machine_on,
            mode,
            interpreter,
            line,
            program,
            tool,
            feed_override,
            spindle_speed,
            probe_tripped,
        })
    }

    /// Which of joints 0 to 5 are homed.
    ///
    /// # Errors
    /// The connection has ended, or an answer is not of the protocol.
    pub fn homed(&mut self) -> Result<[bool; 6], ClientError> {
        self.get(Get::JointHomed, protocol::homed)
    }

    /// The next error text that the controller holds; reading takes it away.
    ///
    /// The queue behind it also holds operator messages. Only errors are read here: to read both in turn would let the
    /// server overwrite one by the next, which is why results come by a log file and never by a message.
    ///
    /// # Errors
    /// The connection has ended, or an answer is not of the protocol.
    pub fn take_error(&mut self) -> Result<Option<String>, ClientError> {
        self.get(Get::Error, |words| Ok(protocol::text(words)))
    }

    /// Sends a request and waits for its reply. Lines that are no reply are ignored: an error text may have several lines.
    fn get<T>(
        &mut self,
        get: Get,
        read: impl FnOnce(crate::text::Words) -> Result<T, ParseError>,
    ) -> Result<T, ClientError> {
        let request = get.encode();
        self.send(&request, &request)?;
        let refused = format!("GET {} NAK", get.subject());
        let subject = get.subject();
        let begins = |text: &str| text.split_whitespace().next() == Some(subject);
        let (line, text) = self.wait_for_line(&request, |text| begins(text) || text == refused)?;
        if text == refused {
            return Err(ClientError::Refused { request });
        }
        protocol::value(get, line, &text)
            .and_then(read)
            .map_err(|source| ClientError::Reply { request, source })
    }

    fn reply(&mut self, request: &str) -> Result<(u64, Reply), ClientError> {
        let (line, text) = self.wait_for_line(request, |_| true)?;
        let reply = protocol::parse(line, &text);
        reply
            .map(|reply| (line, reply))
            .map_err(|source| ClientError::Reply {
                request: request.to_owned(),
                source,
            })
    }

    fn wait_for_line(
        &mut self,
        request: &str,
        wanted: impl Fn(&str) -> bool,
    ) -> Result<(u64, String), ClientError> {
        let deadline = Instant::now() + self.reply_timeout;
        let timed_out = || ClientError::TimedOut {
            request: request.to_owned(),
            seconds: self.reply_timeout.as_secs_f64(),
        };
        let mut buffer = [0; 4096];
        loop {
            while let Some((line, text)) = self.lines.next_line() {
                if wanted(&text) {
                    return Ok((line, text));
                }
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(timed_out());
            }
            let gone = |_| ClientError::Gone {
                request: request.to_owned(),
            };
            self.stream.set_read_timeout(Some(left)).map_err(gone)?;
            match self.stream.read(&mut buffer) {
                Ok(0) => {
                    return Err(ClientError::Gone {
                        request: request.to_owned(),
                    });
                }
                Ok(length) => {
                    let pushed = self.lines.push(&buffer[..length]);
                    pushed.map_err(|source| ClientError::Reply {
                        request: request.to_owned(),
                        source,
                    })?;
                }
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
                {
                    return Err(timed_out());
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(gone(error)),
            }
        }
    }

    fn send(&mut self, shown: &str, line: &str) -> Result<(), ClientError> {
        let gone = |_| ClientError::Gone {
            request: shown.to_owned(),
        };
        self.stream
            .set_write_timeout(Some(self.reply_timeout))
            .map_err(gone)?;
        self.stream
            .write_all(format!("{line}\r\n").as_bytes())
            .map_err(gone)
    }
}
