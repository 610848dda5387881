//! The program that reads controllers: a child of this process, which is told and heard by lines ([`plc`]).

use std::{
    io::{BufRead, BufReader, Write},
    os::unix::process::CommandExt,
    path::Path,
    process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio},
    thread,
    time::{Duration, Instant},
};

use plc::{Document, Poll, Reading};

/// Timeout of the end of a reader whose input has been closed.
const END_TIMEOUT: Duration = Duration::from_secs(2);
/// Between two looks whether it has ended.
const LOOK: Duration = Duration::from_millis(5);
/// Exit status of a reader that does not take what it is told.
const BAD_INPUT: i32 = 2;

/// A program that reads controllers. It ends when this value is dropped, and with the process: it notices that its input has been
/// closed, so that a process which may send no signals ends it as well.
#[derive(Debug)]
pub struct Reader {
    /// Of its file.
    name: String,
    child: Child,
    /// `None` once it is closed.
    input: Option<ChildStdin>,
}

/// A reader that reads no more.
#[derive(Debug, thiserror::Error)]
#[error("{text}")]
pub struct ReaderEnded {
    text: String,
    /// Another one would end in the same way.
    pub is_of_input: bool,
}

impl Reader {
    /// Starts the program, which waits to be told what to read. It starts no thread: a process that confines itself does so
    /// afterwards.
    ///
    /// # Errors
    /// The program cannot be started.
    pub fn start(program: &Path) -> Result<Self, ReaderEnded> {
        Self::spawn(program, &mut Command::new(program))
    }

    /// Reads each signal once, by a reader of its own. What cannot be read is a reading as well.
    ///
    /// # Errors
    /// The program cannot be started, or does something else.
    pub fn once(program: &Path, polls: &[Poll]) -> Result<Vec<Reading>, ReaderEnded> {
        Self::spawn(program, Command::new(program).arg("--once"))?.all(polls)
    }

    fn spawn(program: &Path, command: &mut Command) -> Result<Self, ReaderEnded> {
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        // Ctrl-C reaches this process alone.
        let child = piped.process_group(0).spawn();
        let mut child = child.map_err(|error| ReaderEnded {
            text: format!("cannot start {}: {error}", program.display()),
            is_of_input: true,
        })?;
        let name = program.file_name().unwrap_or_default();
        Ok(Self {
            name: name.to_string_lossy().into_owned(),
            input: child.stdin.take(),
            child,
        })
    }

    /// Tells it what to read. What it has read follows, until it ends.
    pub(super) fn read(&mut self, polls: &[Poll]) -> Readings {
        let document = Document {
            polls: polls.to_vec(),
        };
        if let Some(input) = &mut self.input {
            // That it has ended already is noticed by its output.
            drop(input.write_all(format!("{document}\n").as_bytes()));
        }
        Readings {
            output: self.child.stdout.take().map(BufReader::new),
        }
    }

    fn all(mut self, polls: &[Poll]) -> Result<Vec<Reading>, ReaderEnded> {
        let readings: Result<Vec<_>, String> = self.read(polls).collect();
        let readings = readings.map_err(|text| self.wrong(&text))?;
        match self.end().and_then(|status| status.code()) {
            Some(0 | 1) => Ok(readings),
            _ => Err(self.ended()),
        }
    }

    /// It says something that is no reading.
    pub(super) fn wrong(&self, text: &str) -> ReaderEnded {
        ReaderEnded {
            text: format!("{}: {text}", self.name),
            is_of_input: false,
        }
    }

    /// Why there are no more readings.
    pub(super) fn ended(&mut self) -> ReaderEnded {
        let (name, status) = (self.name.clone(), self.end());
        let text = match status {
            Some(status) => format!("{name}, which reads the signals, has ended ({status})"),
            None => format!("{name}, which reads the signals, says nothing more"),
        };
        ReaderEnded {
            text,
            is_of_input: status.and_then(|status| status.code()) == Some(BAD_INPUT),
        }
    }

    /// Ends it; `None` where it does not. A confined process cannot kill it.
    fn end(&mut self) -> Option<ExitStatus> {
        self.input = None;
        let deadline = Instant::now() + END_TIMEOUT;
        loop {
            match self.child.try_wait() {
                Ok(None) if Instant::now() < deadline => thread::sleep(LOOK),
                status => return status.ok().flatten(),
            }
        }
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        if self.end().is_none() && self.child.kill().is_ok() {
            drop(self.child.wait());
        }
    }
}

/// What a reader says.
pub(super) struct Readings {
    output: Option<BufReader<ChildStdout>>,
}

impl Iterator for Readings {
    type Item = Result<Reading, String>;

    /// `None` at its end; a last line that was cut off is none.
    fn next(&mut self) -> Option<Self::Item> {
        let mut line = String::new();
        match self.output.as_mut()?.read_line(&mut line) {
            Err(error) => Some(Err(error.to_string())),
            Ok(_) => line.ends_with('\n').then(|| Reading::read(&line)),
        }
    }
}

#[cfg(test)]
mod tests {
    use plc::{DataType, Outcome, Signal};

    use super::*;

    const READING: &str = r#"{"source":"modbus://h/1","signal":"oil","value":21.5}"#;

    /// A shell script in the place of `probecell-plc`.
    fn reader(script: &str) -> Reader {
        let started = Reader::spawn(
            Path::new("bin/reader"),
            Command::new("sh").args(["-c", script]),
        );
        started.expect("sh")
    }

    fn polls() -> Vec<Poll> {
        let signal = Signal {
            name: "oil".to_owned(),
            address: "input:0".to_owned(),
            data_type: DataType::U16,
            scale: 0.1,
            offset: 0.0,
            unit: "degC".to_owned(),
            period_s: 0.2,
        };
        vec![Poll {
            source: "modbus://h/1".to_owned(),
            signals: vec![signal],
        }]
    }

    fn text(end: &ReaderEnded) -> (String, bool) {
        (end.to_string(), end.is_of_input)
    }

    #[test]
    fn it_is_told_what_to_read_in_one_line_and_ends_when_its_input_does() {
        let document = Document { polls: polls() }.to_string();
        let mut one = reader(&format!(
            "read -r told; [ \"$told\" = '{document}' ] && echo '{READING}'; cat; exit 7"
        ));
        let mut readings = one.read(&polls());
        let read = readings.next().expect("a reading").expect("a reading");
        assert_eq!(read.outcome, Outcome::Value(21.5));
        let ended = "reader, which reads the signals, has ended (exit status: 7)";
        assert_eq!(text(&one.ended()), (ended.to_owned(), false));
        assert_eq!(readings.next(), None);
    }

    #[test]
    fn a_reader_that_ends_or_says_something_else_is_told() {
        let mut killed = reader(&format!("echo '{READING}'; printf '{{\"sour'; kill -9 $$"));
        let readings: Vec<_> = killed.read(&polls()).collect();
        assert_eq!(readings.len(), 1, "a line that was cut off is none");
        let (ended, is_of_input) = text(&killed.ended());
        assert!(ended.contains("has ended (signal: 9"), "{ended}");
        assert!(!is_of_input, "another one may do better");
        let mut refused = reader("exit 2");
        assert_eq!(refused.read(&polls()).next(), None);
        assert!(
            refused.ended().is_of_input,
            "another one would refuse as well"
        );
        let wrong = reader("echo ready").all(&polls()).expect_err("no reading");
        assert!(
            wrong
                .to_string()
                .starts_with("reader: \"ready\" is no reading"),
            "{wrong}"
        );
        let none = Reader::start(Path::new("/nonexistent/reader")).expect_err("no program");
        assert!(
            none.to_string()
                .starts_with("cannot start /nonexistent/reader"),
            "{none}"
        );
    }

    #[test]
    fn what_is_read_once_may_have_failed() {
        for (status, is_good) in [(0, true), (1, true), (3, false), (101, false)] {
            let read = reader(&format!("echo '{READING}'; exit {status}")).all(&polls());
            assert_eq!(read.is_ok_and(|all| all.len() == 1), is_good, "{status}");
        }
    }

    #[test]
    fn a_reader_that_is_dropped_ends() {
        let mut one = reader("cat >/dev/null");
        let mut readings = one.read(&polls());
        drop(one);
        assert_eq!(readings.next(), None);
    }
}
