//! LinuxCNC: slides that are out of square, corrected between motion and drives by a HAL file.
//!
//! Trivial kinematics know no skew. Components `sum2` (`sum2(9)`: out = in0·gain0 + in1·gain1) take the command of each joint on its way to
//! the drive from x to x − y·xy − z·(xz − xy·yz) and from y to y − z·yz, and what the drives report back by x + y·xy + z·xz and
//! y + z·yz, so that the following error stays what it is.

use crate::CureError;
use crate::head::{Change, commented};
use crate::job::{File, Format, Job};
use crate::settings::replaced;
use crate::skew::{Skew, skew};

/// The HAL file with a correction of skew.
pub(crate) const HAL: Format = Format {
    name: "linuxcnc-hal",
    about: "LinuxCNC's HAL file with a correction of skew (sum2); --current HALFILE and --urdf, joints 0 1 2 are X Y Z",
    holds: &["link.E<c>0<A>"],
    write,
};

/// Instances of the component.
const NAMES: [&str; 6] = [
    "skew-xy",
    "skew-x",
    "skew-y",
    "unskew-xy",
    "unskew-x",
    "unskew-y",
];

fn write(job: &Job<'_>) -> Result<String, CureError> {
    let file = job.current("the HAL file that connects the joints with the drives")?;
    let skew = skew(job)?;
    let net = Net { file };
    if file.text.contains("loadrt sum2") {
        return Err(net.wrong(
            "it loads sum2 already: add the names of this correction to that line by hand",
        ));
    }
    let command: Vec<Pin<'_>> = (0..3)
        .map(|joint| net.pin(joint, "motor-pos-cmd"))
        .collect::<Result<_, _>>()?;
    let back: Vec<Pin<'_>> = (0..3)
        .map(|joint| net.pin(joint, "motor-pos-fb"))
        .collect::<Result<_, _>>()?;
    let before = net.function("motion-command-handler")?;
    let after = net.function("motion-controller")?;
    let thread = after.1;
    let add = |names: &[&str]| {
        let lines = names.iter().map(|name| format!("addf {name} {thread}\n"));
        lines.collect::<Vec<_>>().concat()
    };
    let mut edits = vec![
        (0..0, format!("loadrt sum2 names={}\n", NAMES.join(","))),
        (before.0..before.0, add(&NAMES[3..])),
        (after.2..after.2, add(&NAMES[..3])),
    ];
    // X and Y leave through the correction; their nets begin, and end, there.
    for (pin, instead) in [
        (&command[0], "skew-x.out"),
        (&command[1], "skew-y.out"),
        (&back[0], "unskew-xy.in0"),
        (&back[1], "unskew-y.in0"),
    ] {
        edits.push((pin.bytes.clone(), instead.to_owned()));
    }
    let tail = file.text.len();
    let ends = if file.text.ends_with('\n') { "" } else { "\n" };
    edits.push((
        tail..tail,
        format!("{ends}{}", connections(&skew, &command, &back)),
    ));
    let change = |(what, after): (&str, f64)| Change {
        what: what.to_owned(),
        before: None,
        after,
        interval: None,
    };
    let changes = [
        ("x per y", skew.xy),
        ("x per z", skew.xz),
        ("y per z", skew.yz),
    ]
    .map(change);
    let undo = format!("load {} again", file.name);
    let head = job.head(&job.causes, &changes, &undo);
    Ok(commented("#", &head) + &replaced(&file.text, edits))
}

/// Gains and nets of the correction.
fn connections(skew: &Skew, command: &[Pin<'_>], back: &[Pin<'_>]) -> String {
    let Skew { xy, xz, yz } = *skew;
    let gains = [
        ("skew-xy", -xy),
        ("skew-x", -(xz - xy * yz)),
        ("skew-y", -yz),
        ("unskew-xy", xy),
        ("unskew-x", xz),
        ("unskew-y", yz),
    ];
    let gains = gains.map(|(name, gain)| format!("setp {name}.gain1 {gain:.12}\n"));
    let [z_command, z_back] = [&command[2], &back[2]].map(|pin| pin.net);
    let y_back = back[1].net;
    let nets = [
        "net skew-x-cmd joint.0.motor-pos-cmd => skew-xy.in0".to_owned(),
        "net skew-y-cmd joint.1.motor-pos-cmd => skew-y.in0 skew-xy.in1".to_owned(),
        format!("net {z_command} => skew-x.in1 skew-y.in1"),
        "net skew-x-between skew-xy.out => skew-x.in0".to_owned(),
        format!("net {y_back} => unskew-xy.in1"),
        format!("net {z_back} => unskew-x.in1 unskew-y.in1"),
        "net unskew-x-between unskew-xy.out => unskew-x.in0".to_owned(),
        "net unskew-x-fb unskew-x.out => joint.0.motor-pos-fb".to_owned(),
        "net unskew-y-fb unskew-y.out => joint.1.motor-pos-fb".to_owned(),
    ];
    gains.concat() + &nets.join("\n") + "\n"
}

/// A pin where it stands in a line `net`.
struct Pin<'a> {
    bytes: std::ops::Range<usize>,
    /// Name of its net.
    net: &'a str,
}

struct Net<'a> {
    file: &'a File,
}

impl<'a> Net<'a> {
    fn wrong(&self, what: &str) -> CureError {
        self.file.wrong(what)
    }

    /// Lines without comments, and the byte where each begins and ends.
    fn lines(&self) -> impl Iterator<Item = (usize, &'a str, usize)> {
        let mut at = 0;
        self.file.text.split_inclusive('\n').map(move |line| {
            let begin = at;
            at += line.len();
            (begin, line.split('#').next().unwrap_or_default(), at)
        })
    }

    /// The only place of a pin of a joint.
    fn pin(&self, joint: usize, name: &str) -> Result<Pin<'a>, CureError> {
        let pin = format!("joint.{joint}.{name}");
        let mut found = Vec::new();
        for (begin, line, _) in self.lines() {
            let mut words = line.split_whitespace();
            let (Some("net"), Some(net)) = (words.next(), words.next()) else {
                continue;
            };
            if words.any(|word| word == pin)
                && let Some(place) = line.find(&pin)
            {
                let from = begin + place;
                found.push(Pin {
                    bytes: from..from + pin.len(),
                    net,
                });
            }
        }
        let count = found.len();
        match found.pop() {
            Some(pin) if count == 1 => Ok(pin),
            _ => Err(self.wrong(&format!(
                "{pin} stands in {count} lines net, and must stand in one"
            ))),
        }
    }

    /// The line that adds a function to a thread: where it begins, its thread, and where it ends.
    fn function(&self, name: &str) -> Result<(usize, &'a str, usize), CureError> {
        let mut lines = self.lines();
        let found = lines.find_map(|(begin, line, end)| {
            let mut words = line.split_whitespace();
            let is_it = words.next() == Some("addf") && words.next() == Some(name);
            Some((begin, words.next().filter(|_| is_it)?, end))
        });
        found.ok_or_else(|| self.wrong(&format!("no line is addf {name} THREAD")))
    }
}
