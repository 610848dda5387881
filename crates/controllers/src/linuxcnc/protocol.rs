//! The words of `linuxcncrsh`, LinuxCNC's remote shell: what is asked, and what the answers mean. No input or output.
//!
//! One request is one line. A `set` is answered by `SET … ACK` or `SET … NAK`, a `get` by its subject and the value.
//! Line ends are mixed (`\r\n` after a `get`, `\n\r` after a `set`); [`crate::text::Lines`] takes them all. Positions
//! are as the controller counts them: mm and degrees.
//!
//! Left out on purpose: `get ini` desynchronises the replies, `get tool_offset` prints another type's bits, `get spindle`
//! without a number ends the server, and an unknown command gets no answer at all.

use crate::text::{ParseError, Words};

/// The server keeps a request in 256 bytes and does not check.
const REQUEST_LIMIT: usize = 250;

/// What can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Get {
    /// Readings of the joints.
    JointPositions,
    /// Commanded position in the machine's coordinates.
    CommandedPosition,
    /// Whether the emergency stop is active.
    EmergencyStop,
    /// Whether the machine is on.
    Machine,
    /// Manual, MDI or automatic.
    Mode,
    /// Whether a program runs.
    ProgramStatus,
    /// Line of the program that is open.
    ProgramLine,
    /// File of the program that is open.
    Program,
    /// Modal codes, feed and speed that are active.
    ProgramCodes,
    /// Number of the tool in the spindle.
    Tool,
    /// Feed override in per cent.
    FeedOverride,
    /// Direction of the first spindle.
    Spindle,
    /// Level of the probe input.
    ProbeValue,
    /// Which joints are homed.
    JointHomed,
    /// The next error text; it is gone from the controller once read.
    Error,
}

impl Get {
    /// Word of the subject as it begins the answer.
    pub fn subject(self) -> &'static str {
        match self {
            Self::JointPositions => "JOINT_POS",
            Self::CommandedPosition => "ABS_CMD_POS",
            Self::EmergencyStop => "ESTOP",
            Self::Machine => "MACHINE",
            Self::Mode => "MODE",
            Self::ProgramStatus => "PROGRAM_STATUS",
            Self::ProgramLine => "PROGRAM_LINE",
            Self::Program => "PROGRAM",
            Self::ProgramCodes => "PROGRAM_CODES",
            Self::Tool => "TOOL",
            Self::FeedOverride => "FEED_OVERRIDE",
            Self::Spindle => "SPINDLE",
            Self::ProbeValue => "PROBE_VALUE",
            Self::JointHomed => "JOINT_HOMED",
            Self::Error => "ERROR",
        }
    }

    /// The request's line, without its end.
    pub fn encode(self) -> String {
        let number = if self == Self::Spindle { " 0" } else { "" };
        format!("get {}{number}", self.subject().to_ascii_lowercase())
    }
}

/// What can be set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Set {
    /// Repeat each request before its answer.
    Echo(bool),
    /// Answer a `set` that went well, too.
    Verbose(bool),
    /// Take control with the password.
    Enable(String),
    /// Answer a `set` when it was received, not when its motion has ended.
    WaitReceived,
    /// Put the emergency stop on or off.
    EmergencyStop(bool),
    /// Switch the machine on or off.
    Machine(bool),
    /// Change the mode.
    Mode(Mode),
    /// Home all joints in the order of the configuration.
    HomeAll,
    /// Run one block.
    Mdi(String),
    /// Open a program by the path that the controller knows it under.
    Open(String),
    /// Run the open program from its beginning.
    Run,
    /// Stop motion and program.
    Abort,
}

/// Mode of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Jogging.
    Manual,
    /// Single blocks.
    Mdi,
    /// Programs.
    Auto,
}

/// State of the program interpreter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpreter {
    /// No program runs.
    Idle,
    /// A program runs.
    Running,
    /// A program is held.
    Paused,
}

/// A request that cannot be sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// It would be cut into two requests.
    #[error("request {0:?} contains a line end or another control character")]
    ControlCharacter(String),
    /// The server would overrun its buffer.
    #[error(
        "request of {0} bytes is longer than the {REQUEST_LIMIT} bytes that the remote shell can take"
    )]
    TooLong(usize),
}

impl Set {
    /// Word of the subject as it stands in the answer.
    pub fn subject(&self) -> &'static str {
        match self {
            Self::Echo(_) => "ECHO",
            Self::Verbose(_) => "VERBOSE",
            Self::Enable(_) => "ENABLE",
            Self::WaitReceived => "SET_WAIT",
            Self::EmergencyStop(_) => "ESTOP",
            Self::Machine(_) => "MACHINE",
            Self::Mode(_) => "MODE",
            Self::HomeAll => "HOME",
            Self::Mdi(_) => "MDI",
            Self::Open(_) => "OPEN",
            Self::Run => "RUN",
            Self::Abort => "ABORT",
        }
    }

    /// The request's line, without its end.
    ///
    /// # Errors
    /// A text with a control character, or longer than the remote shell takes.
    pub fn encode(&self) -> Result<String, RequestError> {
        let subject = self.subject().to_ascii_lowercase();
        check(match self {
            Self::Echo(on) | Self::Verbose(on) | Self::EmergencyStop(on) | Self::Machine(on) => {
                format!("set {subject} {}", if *on { "on" } else { "off" })
            }
            Self::Enable(text) | Self::Mdi(text) | Self::Open(text) => {
                format!("set {subject} {text}")
            }
            Self::WaitReceived => format!("set {subject} received"),
            Self::Mode(Mode::Manual) => format!("set {subject} manual"),
            Self::Mode(Mode::Mdi) => format!("set {subject} mdi"),
            Self::Mode(Mode::Auto) => format!("set {subject} auto"),
            Self::HomeAll => format!("set {subject} -1"),
            Self::Run | Self::Abort => format!("set {subject}"),
        })
    }
}

/// The request that opens a session: password, and name of the client.
///
/// # Errors
/// A text with a control character, or longer than the remote shell takes.
pub fn hello(password: &str, client: &str) -> Result<String, RequestError> {
    check(format!("hello {password} {client} 1.0"))
}

fn check(line: String) -> Result<String, RequestError> {
    if line.len() > REQUEST_LIMIT {
        return Err(RequestError::TooLong(line.len()));
    }
    if line.chars().any(char::is_control) {
        return Err(RequestError::ControlCharacter(line));
    }
    Ok(line)
}

/// One line of the server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// The session is open.
    Welcome {
        /// Name and version of the server.
        server: String,
    },
    /// A request was refused; `None` where the server does not say which.
    Refused(Option<String>),
    /// A `set` was taken.
    Accepted(String),
    /// The answer to a `get`: its subject, and the column at which the value begins.
    Value {
        /// First word.
        subject: String,
        /// The rest of the line.
        value: String,
    },
}

/// Reads one line of the server; `line` is its number.
///
/// # Errors
/// Column of what is not of the protocol.
pub fn parse(line: u64, text: &str) -> Result<Reply, ParseError> {
    let mut words = Words::new(line, text);
    let first = words.take("a reply", |word| {
        let known =
            |letter: char| letter.is_ascii_uppercase() || letter.is_ascii_digit() || letter == '_';
        word.chars().all(known).then_some(word)
    })?;
    match first {
        "HELLO" => {
            let accepted = words.take("ACK or NAK", verdict)?;
            if !accepted {
                words.end()?;
                return Ok(Reply::Refused(Some("HELLO".to_owned())));
            }
            Ok(Reply::Welcome {
                server: words.rest().to_owned(),
            })
        }
        "SET" | "GET" | "SHUTDOWN" => {
            let second = words.take("a subject, ACK or NAK", Some)?;
            let reply = match second {
                "NAK" => Reply::Refused(None),
                subject => {
                    let accepted = words.take("ACK or NAK", verdict)?;
                    if accepted {
                        Reply::Accepted(subject.to_owned())
                    } else {
                        Reply::Refused(Some(subject.to_owned()))
                    }
                }
            };
            words.end()?;
            Ok(reply)
        }
        subject => Ok(Reply::Value {
            subject: subject.to_owned(),
            value: words.rest().to_owned(),
        }),
    }
}

fn verdict(word: &str) -> Option<bool> {
    match word {
        "ACK" => Some(true),
        "NAK" => Some(false),
        _ => None,
    }
}

/// Reads the answer to `get`: the words after its subject, which was checked.
///
/// # Errors
/// Column of what is not the answer to `get`.
pub fn value(get: Get, line: u64, text: &str) -> Result<Words<'_>, ParseError> {
    let mut words = Words::new(line, text);
    words.keyword(get.subject())?;
    Ok(words)
}

/// Six positions, as `joint_pos` (joints 0 to 5) and `abs_cmd_pos` (X Y Z A B C) give them; mm and degrees.
///
/// # Errors
/// Column of what is not a number.
pub fn positions(mut words: Words) -> Result<[f64; 6], ParseError> {
    let mut positions = [0.0; 6];
    for position in &mut positions {
        *position = words.number()?;
    }
    words.end()?;
    Ok(positions)
}

/// `ON` or `OFF`.
///
/// # Errors
/// Column of what is neither.
pub fn on_or_off(words: Words) -> Result<bool, ParseError> {
    one(words, "ON or OFF", |word| match word {
        "ON" => Some(true),
        "OFF" => Some(false),
        _ => None,
    })
}

/// Mode of the controller.
///
/// # Errors
/// Column of what is no mode.
pub fn mode(words: Words) -> Result<Mode, ParseError> {
    one(words, "MANUAL, MDI or AUTO", |word| match word {
        "MANUAL" => Some(Mode::Manual),
        "MDI" => Some(Mode::Mdi),
        "AUTO" => Some(Mode::Auto),
        _ => None,
    })
}

/// State of the interpreter.
///
/// # Errors
/// Column of what is no state.
pub fn interpreter(words: Words) -> Result<Interpreter, ParseError> {
    one(words, "IDLE, RUNNING or PAUSED", |word| match word {
        "IDLE" => Some(Interpreter::Idle),
        "RUNNING" => Some(Interpreter::Running),
        "PAUSED" => Some(Interpreter::Paused),
        _ => None,
    })
}

/// A number that counts something: line, tool, per cent, level.
///
/// # Errors
/// Column of what is no number.
pub fn count(mut words: Words) -> Result<u32, ParseError> {
    let count = words.count()?;
    words.end()?;
    Ok(count)
}

/// Sign of the spindle's rotation. Newer servers repeat the spindle's number before the word.
///
/// # Errors
/// Column of what is no direction.
pub fn spindle_direction(mut words: Words) -> Result<f64, ParseError> {
    let mut with_number = words.clone();
    if with_number.count().is_ok() {
        words = with_number;
    }
    one(words, "the state of the spindle", |word| match word {
        "FORWARD" => Some(1.0),
        "REVERSE" => Some(-1.0),
        // Increasing and decreasing are states of a speed button, not of the spindle.
        "OFF" | "INCREASE" | "DECREASE" => Some(0.0),
        _ => None,
    })
}

/// Programmed spindle speed in revolutions per minute, from the list of active codes.
///
/// # Errors
/// Column of what is no number.
pub fn programmed_speed(mut words: Words) -> Result<f64, ParseError> {
    let mut speed = 0.0;
    while let Some(word) = words.clone().next_word() {
        if let Some(digits) = word.strip_prefix('S') {
            let read = |_| digits.parse().ok().filter(|value: &f64| value.is_finite());
            speed = words.take("a spindle speed", read)?;
        } else {
            words.next_word();
        }
    }
    Ok(speed)
}

/// Whether each of the first six joints is homed.
///
/// # Errors
/// Column of what is neither.
pub fn homed(mut words: Words) -> Result<[bool; 6], ParseError> {
    let mut homed = [false; 6];
    for joint in &mut homed {
        *joint = words.take("YES or NO", |word| match word {
            "YES" => Some(true),
            "NO" => Some(false),
            _ => None,
        })?;
    }
    words.end()?;
    Ok(homed)
}

/// A text; `None` where the server says `OK` (no error) or `NONE` (no program).
pub fn text(mut words: Words) -> Option<String> {
    let text = words.rest();
    (!matches!(text, "OK" | "NONE" | "")).then(|| text.to_owned())
}

fn one<T>(
    mut words: Words,
    expected: &str,
    read: impl FnOnce(&str) -> Option<T>,
) -> Result<T, ParseError> {
    let value = words.take(expected, read)?;
    words.end()?;
    Ok(value)
}
