//! Reading the lines of `probecell stream`, which runs as a child of the reader.

use std::ffi::OsString;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};

use crate::{FAILED, GOOD, remark};
use anyhow::{Context, anyhow};

use super::{Cell, Line};

/// Environment variable in which `probecell` gives the path of its own program to those that it starts.
pub const PROGRAM_VARIABLE: &str = "PROBECELL";
/// Environment variable in which `probecell` hands on its ROS arguments, a JSON list of words.
pub const ROS_ARGUMENTS_VARIABLE: &str = "PROBECELL_ROS_ARGUMENTS";

/// The cell file that is taken where none is named.
pub const DEFAULT_CELL: &str = "launch-scripts/turn_mill.toml";

/// Of which cell messages are read.
#[derive(Clone, Debug)]
pub enum Source {
    /// The running cell of a cell file.
    Running(PathBuf),
    /// A recording: a folder or an .mcap file.
    Recording(PathBuf),
}

/// Lines of `probecell stream`. The child ends when this value is dropped, or with the process: it notices a closed pipe within
/// 200 ms, so that a reader which may send no signals ends it as well.
#[derive(Debug)]
pub struct Stream {
    child: Child,
    /// `None` once it is closed.
    lines: Option<BufReader<ChildStdout>>,
    line: String,
}

impl Stream {
    /// Starts `probecell stream` for these topics, and reads whose messages they are. It starts no thread: a process that confines
    /// itself does so afterwards.
    ///
    /// Gives the exit status of a child that ends without a line; it has said why on standard error.
    ///
    /// # Errors
    /// The program is not found, or a line is none of a stream.
    pub fn start(source: &Source, topics: &[&str]) -> anyhow::Result<Result<(Cell, Self), u8>> {
        let program = std::env::var_os(PROGRAM_VARIABLE).unwrap_or_else(beside);
        let mut command = Command::new(&program);
        command.arg("stream");
        match source {
            Source::Running(file) => command.arg("--cell").arg(file),
            Source::Recording(bag) => command.arg("--bag").arg(bag),
        };
        command.args(topics);
        if let Ok(words) = std::env::var(ROS_ARGUMENTS_VARIABLE) {
            let words: Vec<String> =
                serde_json::from_str(&words).context(ROS_ARGUMENTS_VARIABLE)?;
            command.args(words);
        }
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {}", program.display()))?;
        let lines = child.stdout.take().map(BufReader::new);
        let mut stream = Self {
            child,
            lines,
            line: String::new(),
        };
        match stream.next()? {
            Some(Line::Cell(cell)) => Ok(Ok((cell, stream))),
            Some(other) => Err(anyhow!(
                "the stream begins with {other} instead of its cell"
            )),
            None => Ok(Err(stream.status())),
        }
    }

    /// The next line; `None` at the end of the stream. A last line that was cut off is none.
    ///
    /// # Errors
    /// The pipe cannot be read, or the line is none of a stream.
    #[expect(clippy::should_implement_trait, reason = "it can fail")]
    pub fn next(&mut self) -> anyhow::Result<Option<Line>> {
        let Some(lines) = &mut self.lines else {
            return Ok(None);
        };
        self.line.clear();
        lines.read_line(&mut self.line)?;
        if !self.line.ends_with('\n') {
            return Ok(None);
        }
        let line = Line::read(&self.line);
        Ok(Some(line.context("a line of the stream cannot be read")?))
    }

    /// Ends `probecell stream` and gives its exit status. Where a signal has ended it, says so and gives 1.
    pub fn status(&mut self) -> u8 {
        self.lines = None;
        let status = self.child.wait();
        let code = status
            .as_ref()
            .ok()
            .and_then(std::process::ExitStatus::code);
        code.and_then(|code| u8::try_from(code).ok())
            .unwrap_or_else(|| {
                match status {
                    Ok(status) => {
                        remark(&format!("probecell stream has ended by a signal: {status}"));
                    }
                    Err(error) => remark(&format!("probecell stream: {error}")),
                }
                FAILED
            })
    }

    /// Gives every line that follows to `take`, on a thread of its own, and sets `end` when there are no more.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn follow(
        mut self,
        end: Arc<AtomicBool>,
        mut take: impl FnMut(Line) + Send + 'static,
    ) -> anyhow::Result<Following> {
        let (ended, ending) = mpsc::channel();
        let run = move || {
            let status = loop {
                match self.next() {
                    Ok(Some(line)) => take(line),
                    Ok(None) => break Ok(self.status()),
                    Err(error) => break Err(error),
                }
            };
            // Who started this thread may not ask.
            drop(ended.send(status));
            end.store(true, Ordering::SeqCst);
        };
        std::thread::Builder::new()
            .name("stream".to_owned())
            .spawn(run)?;
        Ok(Following(ending))
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.lines = None;
        // It may have ended by itself, and a confined process sends no signals.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// A stream that is read on a thread of its own ([`Stream::follow`]).
#[derive(Debug)]
pub struct Following(mpsc::Receiver<anyhow::Result<u8>>);

impl Following {
    /// The exit status with which the stream has ended; 0 where it goes on.
    ///
    /// # Errors
    /// The error by which its reading ended ([`Stream::next`]).
    pub fn status(&self) -> anyhow::Result<u8> {
        self.0.try_recv().unwrap_or(Ok(GOOD))
    }
}

/// The program `probecell` beside this one; else its bare name, to be looked for on PATH.
fn beside() -> OsString {
    let beside = std::env::current_exe()
        .ok()
        .map(|own| own.with_file_name(format!("probecell{}", std::env::consts::EXE_SUFFIX)));
    let there = beside.filter(|file| file.is_file());
    there.map_or_else(|| OsString::from("probecell"), OsString::from)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    /// A stream of a shell script in the place of `probecell stream`.
    fn stream(script: &str) -> Stream {
        let mut command = Command::new("sh");
        let child = command.args(["-c", script]).stdout(Stdio::piped()).spawn();
        let mut child = child.expect("sh");
        let lines = child.stdout.take().map(BufReader::new);
        Stream {
            child,
            lines,
            line: String::new(),
        }
    }

    #[test]
    fn lines_are_read_to_the_end_and_the_status_is_that_of_the_program() {
        let mut stream = stream(r#"echo '{"complete":{}}'; echo '{"presen'; exit 3"#);
        assert_eq!(stream.next().expect("a line"), Some(Line::Complete {}));
        let error = stream.next().expect_err("no line of a stream");
        assert_eq!(error.to_string(), "a line of the stream cannot be read");
        assert_eq!(stream.next().expect("its end"), None);
        assert_eq!(stream.status(), 3);
    }

    #[test]
    fn a_line_that_was_cut_off_is_the_end() {
        let mut stream = stream(r#"echo '{"complete":{}}'; printf '{"complete":{}}'"#);
        assert_eq!(stream.next().expect("a line"), Some(Line::Complete {}));
        assert_eq!(stream.next().expect("its end"), None);
        assert_eq!(stream.status(), 0);
    }

    #[test]
    fn what_is_followed_says_when_and_how_it_has_ended() {
        let stream = stream(r#"echo '{"complete":{}}'; echo '{"complete":{}}'; kill -9 $$"#);
        let (end, count) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(0)));
        let counted = Arc::clone(&count);
        let following = stream.follow(Arc::clone(&end), move |line| {
            assert_eq!(line, Line::Complete {});
            *counted.lock().expect("a number") += 1;
        });
        let following = following.expect("a thread");
        let status = following.0.recv().expect("an end").expect("a status");
        assert_eq!((status, *count.lock().expect("a number")), (FAILED, 2));
        while !end.load(Ordering::SeqCst) {
            std::thread::yield_now();
        }
    }

    #[test]
    fn a_stream_that_is_dropped_ends_its_program() {
        let mut one = stream("while echo '{\"complete\":{}}'; do :; done");
        assert_eq!(one.next().expect("a line"), Some(Line::Complete {}));
        drop(one);
    }
}
