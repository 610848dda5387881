//! A machine over months: what each of its recordings says of it, and where that changed.

use std::collections::BTreeMap;

use graph::Stamp;
use probecell_msgs::{Correction, PartReport};

use crate::state::{CellState, Characteristic, wording};
use crate::view::{cause, changed_by};

/// A parameter of an effect as one session found it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Found {
    /// In the unit.
    pub(crate) value: f64,
    /// 95 % interval.
    pub(crate) ci95: [f64; 2],
    /// SI unit.
    pub(crate) unit: String,
    /// Effects that the session cannot distinguish, itself included.
    pub(crate) group: Vec<String>,
}

/// A size of one part.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sized {
    /// m, from nominal.
    pub(crate) deviation: f64,
    /// Limits of the deviation, m.
    pub(crate) limits: Option<(f64, f64)>,
    /// A reference contradicts the readings of it.
    pub(crate) contradicted: bool,
}

/// A part, and how it ended.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Made {
    pub(crate) name: String,
    pub(crate) end: &'static str,
    /// `good`, `unsure` or `bad`.
    pub(crate) class: &'static str,
}

impl Made {
    fn last_of(cell: &CellState) -> Option<Self> {
        if cell.is_making() {
            return Some(Self {
                name: cell.part.part_id.clone(),
                end: "not ended",
                class: "unsure",
            });
        }
        let last = cell.ended.back()?;
        let class = match last.verdict {
            PartReport::QUALIFIED => "good",
            PartReport::MEASURED => "unsure",
            _ => "bad",
        };
        Some(Self {
            name: last.part_id.clone(),
            end: last.end(),
            class,
        })
    }
}

/// What a recording says of a machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Summary {
    /// Name of the recording.
    pub(crate) recording: String,
    /// When it begins.
    pub(crate) begin: Stamp,
    /// The part made last.
    pub(crate) part: Option<Made>,
    /// Parts that ended.
    pub(crate) parts: u64,
    /// The leading cause of its gap with its size.
    pub(crate) cause: Option<String>,
    /// Gap over noise of its last report.
    pub(crate) ratio: Option<f64>,
    /// Effects found, by identifier and parameter.
    pub(crate) effects: BTreeMap<(String, String), Found>,
    /// Effects that the model declared, with what they promised and achieved in words.
    pub(crate) declared: BTreeMap<String, String>,
    /// Corrections that were applied, in words.
    pub(crate) applied: Vec<String>,
    /// m, what the machine read back after its last correction, by what is corrected.
    pub(crate) offsets: BTreeMap<String, f64>,
    /// °C at its end, by place.
    pub(crate) temperatures: BTreeMap<String, f64>,
    /// Parts by characteristic.
    pub(crate) sizes: BTreeMap<Characteristic, Vec<Sized>>,
}

impl Summary {
    /// Of the state of a machine at the end of a recording.
    pub(crate) fn of(cell: &CellState, recording: &str, begin: Stamp) -> Self {
        let report = cell.report.as_deref();
        let effects = report.into_iter().flat_map(|report| &report.effects);
        let effects = effects.flat_map(|effect| {
            effect.parameters.iter().map(|one| {
                let found = Found {
                    value: one.value,
                    ci95: one.ci95,
                    unit: one.unit.clone(),
                    group: effect.group.clone(),
                };
                ((effect.effect.clone(), one.name.clone()), found)
            })
        });
        let declared = report.into_iter().flat_map(|report| &report.declared);
        let declared = declared.map(|one| {
            let sizes = |sizes: &diagnosis::report::Sizes| {
                let [before, after] = [sizes.rms_before, sizes.rms_after].map(wording::micrometres);
                format!("{before} → {after} rms")
            };
            let promised = one.promised.as_ref().map_or("nothing".to_owned(), sizes);
            let achieved = one.achieved.as_ref().map_or("not judged".to_owned(), sizes);
            let text = format!("promised {promised}, achieved {achieved}");
            (one.effect.clone(), text)
        });
        let applied = cell
            .corrections()
            .filter(|one| one.is_applied())
            .map(|one| {
                let promised = wording::micrometres(one.correction.measured_error);
                let achieved = one.achieved_error();
                let achieved = achieved.map_or("not measured".to_owned(), wording::micrometres);
                let what = changed_by(&one.correction);
                let doubt = if one.is_refuted() {
                    " by readings that the reference contradicts: do not rely on it"
                } else {
                    ""
                };
                format!("{what}: promised {promised} → 0, achieved → {achieved}{doubt}")
            });
        let offsets = cell.corrections().filter(|one| one.is_applied());
        let offsets = offsets.filter_map(|one| {
            let read_back = one.acknowledgement.as_ref()?.value_after;
            Some((offset(&one.correction)?, read_back))
        });
        let machine = cell.machine().unwrap_or_default();
        let temperatures = machine
            .temperature_names
            .into_iter()
            .zip(machine.temperatures);
        let sizes = cell.runs.iter().map(|(key, made)| {
            let each = made.iter().map(|one| Sized {
                deviation: one.deviation,
                limits: one.limits,
                contradicted: one.contradicted,
            });
            (key.clone(), each.collect())
        });
        Self {
            recording: recording.to_owned(),
            begin,
            part: Made::last_of(cell),
            parts: cell.parts.values().sum(),
            cause: cause(cell),
            ratio: cell.gap_ratio(),
            effects: effects.collect(),
            declared: declared.collect(),
            applied: applied.collect(),
            offsets: offsets.collect(),
            temperatures: temperatures.collect(),
            sizes: sizes.collect(),
        }
    }
}

/// The one value that a correction changes, in words.
fn offset(correction: &Correction) -> Option<String> {
    match correction.kind {
        Correction::TOOL_WEAR => Some(format!("tool {}", correction.tool_number)),
        Correction::WORK_OFFSET => Some(correction.axis.clone()),
        _ => None,
    }
}

/// An effect that the model of the machine declares from a session on, or does not declare any more.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Adoption {
    /// The first session with the other model.
    pub(crate) at: Stamp,
    /// The effect.
    pub(crate) effect: String,
    /// It was adopted; taken back otherwise.
    pub(crate) adopted: bool,
    /// Gap over noise of the sessions before and after.
    pub(crate) ratios: [Option<f64>; 2],
    /// What the effect promised and achieved, in words, where the later session tells.
    pub(crate) kept: String,
}

impl Adoption {
    /// What was done to the model, in words.
    pub(crate) fn description(&self) -> String {
        let effect = effects::vocabulary::describe(&self.effect);
        let what = if self.adopted {
            "Adopted"
        } else {
            "Taken back"
        };
        format!("{what}: {effect}")
    }
}

/// Changes of the model between successive sessions, in the order of time.
pub(crate) fn adoptions(sessions: &[Summary]) -> Vec<Adoption> {
    let mut found = Vec::new();
    for pair in sessions.windows(2) {
        let (old, new) = (&pair[0], &pair[1]);
        let make = |effect: &String, adopted: bool| Adoption {
            at: new.begin,
            effect: effect.clone(),
            adopted,
            ratios: [old.ratio, new.ratio],
            kept: new.declared.get(effect).cloned().unwrap_or_default(),
        };
        let added = new.declared.keys();
        let added = added.filter(|one| !old.declared.contains_key(*one));
        found.extend(added.map(|one| make(one, true)));
        let removed = old.declared.keys();
        let removed = removed.filter(|one| !new.declared.contains_key(*one));
        found.extend(removed.map(|one| make(one, false)));
    }
    found
}

/// A parameter whose 95 % intervals before and after exclude one another.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Change {
    /// Effect and parameter.
    pub(crate) of: (String, String),
    /// The session from which on it is another.
    pub(crate) at: Stamp,
    /// Before and after.
    pub(crate) found: [Found; 2],
    /// What was done between the two sessions, as far as is recorded.
    pub(crate) done: Vec<String>,
}

/// Changes between sessions of one machine, in the order of time. An effect that a session does not find makes no change: it may
/// not have been seen.
pub(crate) fn changes(sessions: &[Summary]) -> Vec<Change> {
    let mut last: BTreeMap<&(String, String), usize> = BTreeMap::new();
    let mut found = Vec::new();
    for (index, session) in sessions.iter().enumerate() {
        for (of, new) in &session.effects {
            if let Some(before) = last.insert(of, index) {
                let old = &sessions[before].effects[of];
                if old.ci95[1] < new.ci95[0] || new.ci95[1] < old.ci95[0] {
                    found.push(Change {
                        of: of.clone(),
                        at: session.begin,
                        found: [old.clone(), new.clone()],
                        done: done(&sessions[before..=index]),
                    });
                }
            }
        }
    }
    found
}

/// What was adopted, taken back and corrected from the first of the sessions to the last.
fn done(sessions: &[Summary]) -> Vec<String> {
    let before = &sessions[..sessions.len().saturating_sub(1)];
    let corrected = before.iter().flat_map(|one| one.applied.iter().cloned());
    let model = adoptions(sessions);
    let model = model.iter().map(Adoption::description);
    corrected.chain(model).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bags::Bag;
    use probecell_msgs::{Verdict, to_cdr};

    use super::*;
    use crate::state::Hall;
    use crate::view::machine_page;

    fn session(day: i64, value: f64, half: f64) -> Summary {
        let found = Found {
            value,
            ci95: [value - half, value + half],
            unit: "m".to_owned(),
            group: Vec::new(),
        };
        Summary {
            begin: Stamp(day * 86_400_000_000_000),
            effects: [(("probe.radius".to_owned(), "error".to_owned()), found)].into(),
            ..Summary::default()
        }
    }

    /// A sample whose reference contradicts the last measurement of a run that was corrected by the same probe.
    #[test]
    fn what_a_reference_contradicts_is_not_told_as_achieved() {
        let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/samples");
        let bag = Bag::open(samples.join("punch_uncalibrated.mcap")).unwrap();
        let mut hall = Hall::default();
        for message in bag.messages() {
            let message = message.unwrap();
            let at = Stamp(message.log_time as i64);
            hall.apply(&message.channel.topic, &message.payload, at);
        }
        let summary = |hall: &Hall| {
            let cell = hall.cells().next().unwrap();
            Summary::of(cell, "punch_uncalibrated", Stamp(0))
        };
        let Summary { applied, sizes, .. } = summary(&hall);
        // Of the blanks and of the finished part alike: readings of one probe.
        let contradicted = |feature: &str| {
            let of_it = sizes.iter().filter(|(key, _)| key.1 == feature);
            let made: Vec<&Sized> = of_it.flat_map(|(_, made)| made).collect();
            !made.is_empty() && made.iter().all(|one| one.contradicted)
        };
        for feature in ["D1", "D2", "L1", "L2", "L3", "flat_1", "flat_6"] {
            assert!(contradicted(feature), "{feature}");
        }
        let page = machine_page("turn_mill", &[summary(&hall)], 0, None).into_string();
        let told = "1 part, of which 1 is not counted: a reference contradicts the readings";
        assert!(page.contains(told) && !page.contains("mean "), "{page}");
        assert!(!applied.is_empty());
        let warned = |one: &String| one.contains("the reference contradicts: do not rely on it");
        assert!(applied.iter().all(warned), "{applied:?}");
        // Nor after another part was measured.
        let other = Verdict {
            plan_id: "punch#2/rough/1".to_owned(),
            feature_id: "D1".to_owned(),
            ..Verdict::default()
        };
        let name = hall.cells().next().unwrap().name.clone();
        let topic = format!("/{name}/verdicts");
        hall.apply(&topic, &to_cdr(&other), Stamp(i64::MAX));
        let applied = summary(&hall).applied;
        assert!(applied.iter().all(warned), "{applied:?}");
    }

    #[test]
    fn a_change_is_where_intervals_exclude_one_another_with_what_was_done_before() {
        let mut sessions = vec![
            session(1, 10e-6, 2e-6),
            session(2, 12e-6, 2e-6),
            Summary {
                begin: Stamp(3 * 86_400_000_000_000),
                ..Summary::default()
            },
            session(4, 2e-6, 2e-6),
        ];
        sessions[1].applied.push("Wear of tool 2".to_owned());
        sessions[3]
            .declared
            .insert("probe.radius".to_owned(), String::new());
        let found = changes(&sessions);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].at, sessions[3].begin);
        assert_eq!(
            found[0].found.each_ref().map(|one| one.value),
            [12e-6, 2e-6]
        );
        assert_eq!(found[0].done, ["Wear of tool 2", "Adopted: probe.radius"]);
        let model = adoptions(&sessions);
        assert_eq!(model.len(), 1, "{model:?}");
        assert_eq!((model[0].at, model[0].adopted), (sessions[3].begin, true));
        sessions.reverse();
        assert!(!adoptions(&sessions)[0].adopted);
    }
}
