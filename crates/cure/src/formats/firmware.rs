//! Firmware of routers and printers that is set by lines: GRBL, Marlin, RepRapFirmware (Duet).
//!
//! Steps per mm are divided by what the axis goes too far: the true travel is the reading times 1 + k, so that a mm has fewer steps
//! (GRBL `$100`–`$105`, Marlin and Duet `M92`). Backlash adds to what is set (`M425`). Skew: Marlin's `M852 I J K` are the factors by
//! which x follows y and z, and y follows z (`planner.h`: x − y·I − z·(J − I·K), y − z·K); RepRapFirmware adds tangents
//! (`Move::AxisTransform`: x + y·X/S + z·Z/S, y + z·Y/S).

use crate::CureError;
use crate::cause::Cause;
use crate::head::{Change, commented, number};
use crate::job::{File, Format, Job};
use crate::skew::skew;

const HOLDS: &[&str] = &["axis.<A>.scale", "axis.<A>.backlash", "link.E<c>0<A>"];

/// GRBL and grblHAL.
pub(crate) const GRBL: Format = Format {
    name: "grbl",
    about: "GRBL's steps per mm, as lines to send; --current FILE with what $$ says",
    holds: &["axis.<A>.scale"],
    write: grbl,
};

/// Marlin.
pub(crate) const MARLIN: Format = Format {
    name: "marlin",
    about: "Marlin's M92, M425 and M852, as lines to send; --current FILE with what M503 says, for skew --urdf",
    holds: HOLDS,
    write: marlin,
};

/// RepRapFirmware.
pub(crate) const DUET: Format = Format {
    name: "duet",
    about: "RepRapFirmware's M92, M425 and M556, for config.g; --current config.g, for skew --urdf",
    holds: HOLDS,
    write: duet,
};

/// Length over which the tangents of `M556` are stated, mm.
const OVER: f64 = 100.0;

fn grbl(job: &Job<'_>) -> Result<String, CureError> {
    let file = job.current("what $$ says, as it was when the machine was measured")?;
    let (mut changes, mut lines, mut undo) = (Vec::new(), Vec::new(), Vec::new());
    for cause in &job.causes {
        let place = "XYZABC"
            .find(cause.axis())
            .filter(|_| cause.axis().len() == 1);
        let key = place.map(|place| format!("${}", 100 + place));
        let key = key.ok_or_else(|| file.wrong(format!("GRBL has no axis {}", cause.axis())))?;
        let setting = |line: &str| {
            line.trim()
                .strip_prefix(&key)?
                .strip_prefix('=')
                .map(str::to_owned)
        };
        let value = file.text.lines().find_map(setting);
        let value = value.ok_or_else(|| file.wrong(format!("it has no {key}")))?;
        let word = value.split([' ', '(']).next().unwrap_or_default();
        let before: f64 = word
            .parse()
            .map_err(|_| file.wrong(format!("{key} is {word:?}, not a number")))?;
        let change = steps(&key, before, cause);
        lines.push(format!("{key}={}\n", number(change.after)));
        undo.push(format!("{key}={}", number(before)));
        changes.push(change);
    }
    let head = job.head(
        &job.causes,
        &changes,
        &format!("send {}, and home", undo.join(", ")),
    );
    Ok(commented(";", &head) + &lines.concat())
}

fn marlin(job: &Job<'_>) -> Result<String, CureError> {
    let file = job.current("what M503 says, as it was when the machine was measured")?;
    let mut set = Sent::of(job, file);
    set.scales()?;
    set.backlash(" F1")?;
    if set.has_skew() {
        let skew = skew(job)?;
        set.free("M852")?;
        let line = format!("M852 I{:.8} J{:.8} K{:.8}", skew.xy, skew.xz, skew.yz);
        set.push(line, "M852 I0 J0 K0".to_owned());
    }
    Ok(set.text("send the lines, then M500 keeps them"))
}

fn duet(job: &Job<'_>) -> Result<String, CureError> {
    let file = job.current("the config.g with which the machine was measured")?;
    let mut set = Sent::of(job, file);
    set.scales()?;
    set.backlash("")?;
    if set.has_skew() {
        let skew = skew(job)?;
        set.free("M556")?;
        // x + y·a + z·b has to go back by what x follows y and z once y goes back by what it follows z.
        let (xy, yz, xz) = (-skew.xy, -skew.yz, skew.xy * skew.yz - skew.xz);
        let line = format!(
            "M556 S{OVER} X{:.6} Y{:.6} Z{:.6}",
            OVER * xy,
            OVER * yz,
            OVER * xz
        );
        set.push(line, format!("M556 S{OVER} X0 Y0 Z0"));
    }
    Ok(set.text("put the lines in place of those of config.g, and restart"))
}

fn steps(what: &str, before: f64, cause: &Cause) -> Change {
    let by = |k: f64| before / (1.0 + k);
    Change {
        what: what.to_owned(),
        before: Some(before),
        after: by(cause.value("k")),
        interval: Some(cause.interval("k").map(by)),
    }
}

/// Lines that are sent, with those that undo them.
struct Sent<'a> {
    job: &'a Job<'a>,
    file: &'a File,
    changes: Vec<Change>,
    lines: Vec<String>,
    undo: Vec<String>,
}

impl<'a> Sent<'a> {
    fn of(job: &'a Job<'a>, file: &'a File) -> Self {
        Self {
            job,
            file,
            changes: Vec::new(),
            lines: Vec::new(),
            undo: Vec::new(),
        }
    }

    fn push(&mut self, line: String, undo: String) {
        self.lines.push(line);
        self.undo.push(undo);
    }

    fn causes(&self, kind: &str) -> Vec<&'a Cause> {
        self.job
            .causes
            .iter()
            .filter(|cause| cause.kind() == kind)
            .collect()
    }

    fn has_skew(&self) -> bool {
        !self.causes("link.E<c>0<A>").is_empty()
    }

    /// The words of the last line with a command: later ones override.
    fn words(&self, command: &str) -> Option<Vec<(char, f64)>> {
        let lines = self.file.text.lines().rev();
        let mut words = lines.filter_map(|line| {
            let line = line.trim().trim_start_matches("echo:").trim_start();
            let line = line.split(';').next()?;
            let rest = line.strip_prefix(command)?;
            rest.starts_with([' ', '\t']).then(|| rest.to_owned())
        });
        let rest = words.next()?;
        let words = rest.split_whitespace().filter_map(|word| {
            let letter = word.chars().next()?;
            // The first of several extruders.
            let value = word[letter.len_utf8()..].split(':').next()?;
            Some((letter, value.parse().ok()?))
        });
        Some(words.collect())
    }

    fn value(&self, command: &str, letter: &str) -> Option<f64> {
        let words = self.words(command)?;
        words
            .into_iter()
            .find_map(|(own, value)| (letter == own.to_string()).then_some(value))
    }

    /// `M92` of the axes whose scale errs.
    fn scales(&mut self) -> Result<(), CureError> {
        let causes = self.causes("axis.<A>.scale");
        if causes.is_empty() {
            return Ok(());
        }
        if self.value("M669", "K").is_some_and(|kind| kind != 0.0) {
            return Err(self
                .file
                .wrong("M669 names kinematics in which a motor is no axis: M92 is not written"));
        }
        let (mut line, mut undo) = (vec!["M92".to_owned()], vec!["M92".to_owned()]);
        for cause in causes {
            let axis = cause.axis();
            let before = self.value("M92", axis);
            let before =
                before.ok_or_else(|| self.file.wrong(format!("it has no M92 with {axis}")))?;
            let change = steps(&format!("M92 {axis}"), before, cause);
            line.push(format!("{axis}{}", number(change.after)));
            undo.push(format!("{axis}{}", number(before)));
            self.changes.push(change);
        }
        self.push(line.join(" "), undo.join(" "));
        Ok(())
    }

    /// `M425` of the axes with lost motion.
    fn backlash(&mut self, share: &str) -> Result<(), CureError> {
        let causes = self.causes("axis.<A>.backlash");
        if causes.is_empty() {
            return Ok(());
        }
        if !share.is_empty()
            && self
                .value("M425", "F")
                .is_some_and(|now| now != 0.0 && now != 1.0)
        {
            return Err(self
                .file
                .wrong("M425 F is neither 0 nor 1: set it to 1 and measure again"));
        }
        let is_on = share.is_empty() || self.value("M425", "F") == Some(1.0);
        let (mut line, mut undo) = (vec![format!("M425{share}")], vec!["M425".to_owned()]);
        if !share.is_empty() {
            undo.push(if is_on {
                "F1".to_owned()
            } else {
                "F0".to_owned()
            });
        }
        for cause in causes {
            let axis = cause.axis();
            if cause.parameter("places").is_some() {
                let why = "it varies over the travel, and M425 is one number".to_owned();
                return Err(CureError::Refused {
                    effect: cause.name.clone(),
                    why,
                });
            }
            let before = self.value("M425", axis);
            let base = before.filter(|_| is_on).unwrap_or(0.0);
            let by = |b: f64| base + b * 1e3;
            let after = by(cause.value("b"));
            if after < 0.0 {
                return Err(self.file.wrong(format!(
                    "M425 {axis} would become {}, less than nothing",
                    number(after)
                )));
            }
            line.push(format!("{axis}{after:.4}"));
            undo.push(format!("{axis}{}", number(before.unwrap_or(0.0))));
            let (what, interval) = (format!("M425 {axis}"), Some(cause.interval("b").map(by)));
            self.changes.push(Change {
                what,
                before,
                after,
                interval,
            });
        }
        self.push(line.join(" "), undo.join(" "));
        Ok(())
    }

    /// No skew is corrected yet.
    fn free(&self, command: &str) -> Result<(), CureError> {
        let words = self.words(command).unwrap_or_default();
        if words
            .iter()
            .any(|&(letter, value)| letter != 'S' && value != 0.0)
        {
            let what = format!("{command} corrects skew already: set it to 0 and measure again");
            return Err(self.file.wrong(what));
        }
        Ok(())
    }

    fn text(self, how: &str) -> String {
        let undo = self.undo.join(", ");
        let mut head = self.job.head(&self.job.causes, &self.changes, &undo);
        head.push(how.to_owned());
        commented(";", &head) + &self.lines.join("\n") + "\n"
    }
}
