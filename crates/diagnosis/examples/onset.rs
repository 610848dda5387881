//! Streams of parts in which an effect begins at an unknown part, and streams in which none does, watched as node `gap` watches
//! them ([`diagnosis::onset::ChangeMonitor`]): `onset EACH SEED [--verbose]`.
#![expect(clippy::print_stdout, reason = "a table for a person")]
#![expect(clippy::unwrap_used, reason = "a part that cannot be read ends it")]

use std::f64::consts::TAU;

use diagnosis::onset::{Change, ChangeMonitor};
use diagnosis::{Options, Session};
use metrology::statistics::{chi_squared_quantile, rms};
use streams::{Numbers, Scatter, part, touches};

#[path = "../tests/main/streams.rs"]
mod streams;

/// Parts of a stream.
const PARTS: u64 = 120;
/// Stated false alarms in 1,000 parts.
const RATE: f64 = 1.0;
/// First parts with an effect.
const ONSETS: [u64; 2] = [8, 80];
/// Rms of an effect over the touches, or of a growing one after ten parts, over the standard deviation of a touch.
const SIZES: [f64; 2] = [1.5, 8.0];
/// Share of the touches that meet a chip, in streams with chips; m.
const CHIPS: f64 = 0.01;
const CHIP: [f64; 2] = [1e-5, 1e-4];

/// An effect that begins: its identifier, and how it displaces a reading by normal and place, to any scale.
type Cause = (&'static str, Box<dyn Fn([f64; 3], [f64; 3]) -> f64>);

/// A stream whose truth is known.
struct Stream {
    cause: Option<Cause>,
    /// Times the cause's displacement, m over its unit; for each part since its onset where it grows.
    size: f64,
    grows: bool,
    /// Number of the first changed part, from 0.
    onset: u64,
    scatter: Scatter,
    chips: bool,
    numbers: Numbers,
}

/// What was found in one.
struct Watched {
    /// Parts with nothing in them so far, and findings there.
    unchanged: u64,
    early: u64,
    /// The finding, and how many changed parts it took, the first included.
    found: Option<(Change, u64)>,
}

fn between(numbers: &mut Numbers, [least, most]: [f64; 2]) -> f64 {
    least + (most - least) * numbers.share()
}

fn one_of(numbers: &mut Numbers, count: usize) -> usize {
    ((numbers.share() * count as f64) as usize).min(count - 1)
}

/// A direction, uniform on the sphere.
fn direction(numbers: &mut Numbers) -> [f64; 3] {
    let (up, about) = (between(numbers, [-1.0, 1.0]), TAU * numbers.share());
    let flat = (1.0 - up * up).sqrt();
    [flat * about.cos(), flat * about.sin(), up]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn cause(numbers: &mut Numbers) -> Cause {
    let along = direction(numbers);
    match one_of(numbers, 7) {
        0 => ("probe.ball_radius", Box::new(|_, _| 1.0)),
        1 => ("fixture.shift", Box::new(move |n, _| dot(n, along))),
        2 => (
            "fixture.tilt",
            Box::new(move |n, [x, y, z]| {
                let [a, b, c] = along;
                dot(n, [b * z - c * y, c * x - a * z, a * y - b * x])
            }),
        ),
        3 => ("axis.X.scale", Box::new(|n, p| n[0] * p[0])),
        4 => ("axis.Y.scale", Box::new(|n, p| n[1] * p[1])),
        5 => ("axis.X.backlash", Box::new(|n, _| n[0].abs())),
        _ => ("axis.Y.backlash", Box::new(|n, _| n[1].abs())),
    }
}

impl Stream {
    fn drawn(seed: u64, changes: bool, chips: bool) -> Self {
        let mut numbers = Numbers(seed.wrapping_mul(0x2545_F491_4F6C_DD1D) ^ 0x6A09_E667_F3BC_C909);
        let touch = between(&mut numbers, [5e-7, 2e-6]);
        let scatter = Scatter {
            touch,
            clamping: touch * between(&mut numbers, [0.0, 2.0]),
        };
        let cause = changes.then(|| cause(&mut numbers));
        let grows = numbers.share() < 0.25;
        let sign = if numbers.share() < 0.5 { -1.0 } else { 1.0 };
        let rms = sign * touch * between(&mut numbers, SIZES);
        let onset = between(&mut numbers, ONSETS.map(|part| part as f64)) as u64;
        let mut stream = Self {
            cause,
            size: if grows { 0.1 } else { 1.0 },
            grows,
            onset: if changes { onset } else { PARTS },
            scatter,
            chips,
            numbers,
        };
        if changes {
            stream.size *= rms / stream.unit();
        }
        stream
    }

    /// Root mean square of the cause's displacement over the touches, of its unit.
    fn unit(&self) -> f64 {
        let Some((_, shape)) = &self.cause else {
            return 0.0;
        };
        let all: Vec<f64> = touches().into_iter().map(|(n, p)| shape(n, p)).collect();
        rms(&all)
    }

    /// Of what has begun, over the touches, and after ten parts where it grows, over the scatter of a touch.
    fn ratio(&self) -> f64 {
        let parts = if self.grows { 10.0 } else { 1.0 };
        parts * self.size.abs() * self.unit() / self.scatter.touch
    }

    fn part(&mut self, number: u64) -> Session {
        let since = (number + 1).saturating_sub(self.onset) as f64;
        let size = match since {
            0.0 => 0.0,
            _ if self.grows => self.size * since,
            _ => self.size,
        };
        let cause = self.cause.as_ref();
        let begun = |normal: [f64; 3], place: [f64; 3]| {
            cause.map_or(0.0, |(_, shape)| size * shape(normal, place))
        };
        let mut session = part(number, &mut self.numbers, self.scatter, &begun);
        if self.chips {
            for (event, (normal, _)) in session.events.iter_mut().zip(touches()) {
                if self.numbers.share() < CHIPS {
                    let chip = between(&mut self.numbers, CHIP);
                    for (position, normal) in event.axis_positions.iter_mut().zip(normal) {
                        *position += chip * normal;
                    }
                }
            }
        }
        session
    }

    fn watched(&mut self) -> Watched {
        let (mut watch, mut early) = (ChangeMonitor::default(), 0);
        for number in 0..PARTS {
            let session = self.part(number);
            let found = watch.part(&session, &Options::default(), RATE).unwrap();
            match found {
                Some(_) if number < self.onset => early += 1,
                Some(change) => {
                    return Watched {
                        unchanged: self.onset,
                        early,
                        found: Some((change, number + 1 - self.onset)),
                    };
                }
                None => {}
            }
        }
        Watched {
            unchanged: self.onset,
            early,
            found: None,
        }
    }
}

/// Counts over streams.
#[derive(Default)]
struct Card {
    streams: usize,
    found: usize,
    /// The hidden cause is the first of the named group, or within it; another is named, or none.
    first: usize,
    within: usize,
    wrong: usize,
    /// Onsets told exactly, and within two parts.
    exact: usize,
    near: usize,
    groups: usize,
    delays: Vec<u64>,
    unchanged: u64,
    early: u64,
}

impl Card {
    fn take(&mut self, stream: &Stream, watched: &Watched) {
        self.streams += 1;
        self.unchanged += watched.unchanged;
        self.early += watched.early;
        let (Some((change, delay)), Some((hidden, _))) = (&watched.found, &stream.cause) else {
            return;
        };
        self.found += 1;
        self.delays.push(*delay);
        let off = change.onset.abs_diff(stream.onset + 1);
        self.exact += usize::from(off == 0);
        self.near += usize::from(off <= 2);
        if let Some(effect) = &change.cause {
            let within = effect.group.iter().any(|name| name == hidden);
            self.first += usize::from(effect.effect == *hidden);
            self.within += usize::from(within);
            self.wrong += usize::from(!within);
            self.groups += effect.group.len();
        }
    }

    fn print(&mut self, name: &str) {
        // Garwood 1936: the 95 % interval of a Poisson count.
        let least = match self.early {
            0 => 0.0,
            count => 0.5 * chi_squared_quantile(0.025, 2.0 * count as f64),
        };
        let most = 0.5 * chi_squared_quantile(0.975, 2.0 * (self.early + 1) as f64);
        let thousand = self.unchanged as f64 / 1000.0;
        self.delays.sort_unstable();
        let at = |share: usize| {
            let place = self.delays.len() * share / 100;
            self.delays
                .get(place)
                .map_or("-".to_owned(), u64::to_string)
        };
        let of = |count: usize| format!("{count}/{}", self.found);
        println!(
            "| {name} | {} | {}/{} | {}, {} | {} | {} | {} | {} | {} | {:.1} | {} in {} ({:.2} to {:.2} in 1,000) |",
            self.streams,
            self.found,
            if self.delays.is_empty() {
                0
            } else {
                self.streams
            },
            at(50),
            at(90),
            of(self.within),
            of(self.first),
            of(self.wrong),
            of(self.exact),
            of(self.near),
            self.groups as f64 / self.within.max(1) as f64,
            self.early,
            self.unchanged,
            least / thousand,
            most / thousand,
        );
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |place: usize| {
        arguments
            .get(place)
            .and_then(|text| text.parse::<u64>().ok())
    };
    let (each, seed) = (number(0).unwrap_or(20), number(1).unwrap_or(1));
    let verbose = arguments.iter().any(|one| one == "--verbose");
    println!(
        "| streams | | found | delay in parts: median, 90 % | cause in the named group | first of it | another cause | onset exact | \
         within two parts | effects in a group | false alarms |\n|---|---|---|---|---|---|---|---|---|---|---|"
    );
    let kinds = [
        ("nothing begins", false, false),
        ("nothing begins, chips on 1 % of the touches", false, true),
        ("an effect begins", true, false),
        ("an effect begins, chips on 1 % of the touches", true, true),
    ];
    for (kind, (name, changes, chips)) in kinds.into_iter().enumerate() {
        let (mut all, mut small, mut large, mut growing) = (
            Card::default(),
            Card::default(),
            Card::default(),
            Card::default(),
        );
        for index in 0..each {
            let own = seed
                .wrapping_mul(1_000_003)
                .wrapping_add(index * 8 + kind as u64);
            let mut stream = Stream::drawn(own, changes, chips);
            let watched = stream.watched();
            all.take(&stream, &watched);
            let part = match () {
                () if stream.grows => &mut growing,
                () if stream.ratio() < 3.0 => &mut small,
                () => &mut large,
            };
            part.take(&stream, &watched);
            if verbose && changes {
                tell(&stream, &watched);
            }
        }
        all.print(name);
        if changes {
            small.print("- of 1.5 to 3 times the scatter of a touch");
            large.print("- of 3 to 8 times");
            growing.print("- that grows from part to part");
        }
    }
}

fn tell(stream: &Stream, watched: &Watched) {
    let hidden = stream.cause.as_ref().map_or("", |(name, _)| name);
    let (clamping, touch) = (stream.scatter.clamping, stream.scatter.touch);
    let text = watched
        .found
        .as_ref()
        .map_or("-".to_owned(), |(change, delay)| {
            let group = change
                .cause
                .as_ref()
                .map_or("none".to_owned(), |cause| cause.group.join(" "));
            format!(
                "after {delay}, onset {} told {}: {group}",
                stream.onset + 1,
                change.onset
            )
        });
    println!(
        "  {hidden}{} {:.1} of a touch, clamping {:.1}; {text}; {} early",
        if stream.grows { " growing" } else { "" },
        stream.ratio(),
        clamping / touch,
        watched.early
    );
}
