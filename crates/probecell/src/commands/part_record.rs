//! `probecell report`: the record of the parts that a session made, one page to be filed.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use bags::Bag;
use diagnosis::Options;
use graph::{Topic, topics};
use probecell_msgs::{Fault, InspectionPlan, Message};
use records::{PartSession, ShortDiagnosis, part_page};

use super::diagnose;
use super::record::PROVENANCE;
use crate::report;

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Bag: a folder or an .mcap file.
    bag: PathBuf,
    /// The page to write; it needs nothing else, and can be printed.
    #[arg(long, value_name = "FILE")]
    html: PathBuf,
}

/// Writes the page.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let bag = Bag::open(&arguments.bag)?;
    let damage = bag.verify();
    let session = PartSession {
        damage: damage.iter().map(ToString::to_string).collect(),
        ..gather(&bag, &arguments.bag)?
    };
    let command = format!("probecell diagnose {} --html FILE", session.name);
    let made = diagnose::read(&arguments.bag, &diagnose::Arguments::default())
        .and_then(|session| Ok(diagnosis::diagnose(&session, &Options::default())?));
    let reason;
    let short = match &made {
        Ok(found) => ShortDiagnosis::Made(found, &command),
        Err(error) => {
            reason = format!("{error:#}");
            ShortDiagnosis::None(&reason)
        }
    };
    let page = part_page(&session, short)?;
    std::fs::write(&arguments.html, page.html())
        .with_context(|| format!("cannot write {}", arguments.html.display()))?;
    Ok(report::damage(&damage))
}

/// What the recording holds of its parts.
fn gather(bag: &Bag, path: &Path) -> anyhow::Result<PartSession> {
    let namespace = namespace(bag, path)?;
    let reader = Reader {
        bag,
        namespace: &namespace,
    };
    let mut plans: Vec<InspectionPlan> = Vec::new();
    for plan in reader.all::<InspectionPlan>(topics::INSPECTION_PLAN)? {
        match plans.iter_mut().find(|known| known.plan_id == plan.plan_id) {
            Some(known) => *known = plan,
            None => plans.push(plan),
        }
    }
    if plans.is_empty() {
        bail!(
            "{}: no inspection plan was recorded, so no part was measured",
            path.display()
        );
    }
    let mut faults: Vec<Fault> = Vec::new();
    let reporting = topics::ALL.iter();
    for topic in reporting.filter(|topic| topic.message.name == Fault::TYPE.name) {
        faults.extend(reader.all(*topic)?);
    }
    faults.sort_by_key(|fault| (fault.header.stamp.sec, fault.header.stamp.nanosec));
    let provenance = |key: &str| {
        let tables = bag.metadata().filter(|(name, _)| *name == PROVENANCE);
        let values = tables.filter_map(|(_, table)| table.get(key));
        values.last().cloned().unwrap_or_default()
    };
    let losses = bag.losses();
    let losses = losses
        .iter()
        .map(|(topic, lost)| (topic.clone(), lost.missing()));
    let mut session = PartSession {
        name: path
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        cell: namespace.trim_start_matches('/').to_owned(),
        version: provenance("version"),
        revision: provenance("source_revision"),
        plans,
        results: reader.all(topics::FEATURE_RESULTS)?,
        touches: reader.all(topics::TOUCH_DEVIATIONS)?,
        verdicts: reader.all(topics::VERDICTS)?,
        decisions: reader.all(topics::PASS_DECISIONS)?,
        corrections: reader.all(topics::CORRECTIONS)?,
        acknowledgements: reader.all(topics::CORRECTION_ACKNOWLEDGEMENTS)?,
        runs: reader.all(topics::RUN_REQUESTS)?,
        approvals: reader.all(topics::APPROVALS)?,
        approval_replies: reader.all(topics::APPROVAL_REPLIES)?,
        parts: reader.all(topics::PART_REPORTS)?,
        faults,
        losses: losses.filter(|(_, missing)| *missing > 0).collect(),
        damage: Vec::new(),
    };
    // A plan that was made and not yet measured says nothing of a part.
    if session
        .touches
        .iter()
        .any(|touch| !touch.plan_id.is_empty())
    {
        let touches = &session.touches;
        session
            .plans
            .retain(|plan| touches.iter().any(|touch| touch.plan_id == plan.plan_id));
    }
    Ok(session)
}

/// The only cell of the bag that makes parts.
fn namespace(bag: &Bag, path: &Path) -> anyhow::Result<String> {
    let suffix = format!("/{}", topics::INSPECTION_PLAN.name);
    let mut found: Vec<&str> = (bag.channels().iter())
        .filter_map(|channel| channel.topic.strip_suffix(suffix.as_str()))
        .collect();
    found.sort_unstable();
    found.dedup();
    match found.as_slice() {
        [one] => Ok((*one).to_owned()),
        [] => bail!(
            "{}: no inspection plan was recorded, so no part was measured",
            path.display()
        ),
        several => bail!(
            "{}: several cells were recorded: {}",
            path.display(),
            several.join(", ")
        ),
    }
}

struct Reader<'a> {
    bag: &'a Bag,
    namespace: &'a str,
}

impl Reader<'_> {
    /// All messages of a topic that can be read; none if it was not recorded.
    fn all<M: Message>(&self, topic: Topic) -> anyhow::Result<Vec<M>> {
        let name = format!("{}/{}", self.namespace, topic.name);
        if self.bag.channels_of(&name).next().is_none() {
            return Ok(Vec::new());
        }
        let mut messages = Vec::new();
        for message in self.bag.typed::<M>(&name)? {
            match message {
                Ok(stamped) => messages.push(stamped.message),
                // Told with all other damage of the bag.
                Err(bags::Error::Damaged(_)) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(messages)
    }
}

#[cfg(test)]
mod tests {
    use bags::{Channel, Overflow, Qos, Recorder, RecorderOptions};
    use cell::{Cell, CellText};
    use graph::{Executor, Published, Stamp};
    use probecell_msgs::{Correction, FeatureResult, OperatorRequest, Verdict, from_cdr, to_cdr};
    use roxmltree::{Document, Node, ParsingOptions};

    use super::*;

    const BEGIN: Stamp = Stamp(1_767_225_600_000_000_000);

    /// What the turn-mill publishes while it makes a punch.
    fn made() -> Vec<Published> {
        let file = include_str!("../../../../launch-scripts/turn_mill.toml");
        let short = "[path_planning]\nkicks = 50\n";
        let cell = Cell::from_text(CellText {
            name: "turn_mill".to_owned(),
            cell: file.replacen("[path_planning]\n", short, 1),
            robot_description: include_str!("../../../../launch-scripts/turn_mill.urdf").to_owned(),
        })
        .expect("a cell");
        let mut executor = Executor::new(cell.nodes(false).expect("nodes"), BEGIN).expect("wiring");
        let request = OperatorRequest {
            subject: "punch".to_owned(),
            operator_name: "Ada <Lovelace>".to_owned(),
            ..OperatorRequest::default()
        };
        let asked = topics::RUN_REQUESTS.name;
        executor.inject(BEGIN.after_s(1.0), asked, to_cdr(&request));
        let limit = BEGIN.after_s(600.0);
        assert!(executor.run_until_published(topics::PART_REPORTS.name, limit));
        executor.run_until(executor.now());
        executor.take_log()
    }

    fn write(log: &[Published], folder: &Path) {
        let recorder = Recorder::start(RecorderOptions {
            overflow: Overflow::Block,
            ..RecorderOptions::new(folder)
        })
        .expect("a recorder");
        for one in log {
            let Some(topic) = topics::by_name(&one.topic) else {
                continue;
            };
            let name = format!("/turn_mill/{}", topic.name);
            let channel = Channel::of(name, topic.message, Qos::default());
            let channel = recorder.channel(&channel).expect("a channel");
            let at = one.at.0 as u64;
            let pushed = recorder.push(channel, one.sequence, at, at, one.payload.clone());
            pushed.expect("a message");
        }
        recorder.stop().expect("a recording");
    }

    fn messages<M: Message>(log: &[Published], topic: Topic) -> Vec<M> {
        let own = log.iter().filter(|one| one.topic == topic.name);
        own.map(|one| from_cdr(&one.payload).expect("a message"))
            .collect()
    }

    fn text(node: Node<'_, '_>) -> String {
        let texts = node.descendants().filter(Node::is_text);
        texts.filter_map(|text| text.text()).collect()
    }

    /// Rows of every table with this caption, headings left out.
    fn rows(page: &Document<'_>, caption: &str) -> Vec<Vec<String>> {
        let tables = page.descendants().filter(|node| node.has_tag_name("table"));
        let wanted = tables.filter(|table| {
            let own = table.children().find(|node| node.has_tag_name("caption"));
            own.is_some_and(|own| text(own) == caption)
        });
        let rows = wanted.flat_map(|table| {
            let rows = table.children().filter(|node| node.has_tag_name("tr"));
            rows.skip(1).collect::<Vec<_>>()
        });
        let cells = |row: Node<'_, '_>| row.children().filter(Node::is_element).map(text).collect();
        rows.map(cells).collect()
    }

    /// The number in a cell, in metres.
    fn metres(cell: &str) -> f64 {
        let mut words = cell.split(' ');
        let number: f64 = words.next().and_then(|word| word.parse().ok()).expect(cell);
        match words.next().map(|unit| unit.trim_end_matches(',')) {
            Some("mm") => number * 1e-3,
            Some("µm") => number * 1e-6,
            unit => panic!("{cell}: {unit:?}"),
        }
    }

    fn close(shown: &str, said: f64) {
        assert!(
            (metres(shown) - said).abs() < 0.051e-6,
            "{shown} for {said} m"
        );
    }

    #[test]
    fn the_page_says_what_the_messages_say_and_stands_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let (bag, file) = (
            folder.path().join("session"),
            folder.path().join("page.html"),
        );
        let log = made();
        write(&log, &bag);
        let arguments = Arguments {
            bag,
            html: file.clone(),
        };
        assert_eq!(run(&arguments).expect("a page"), crate::GOOD);
        let html = std::fs::read_to_string(&file).expect("the page");
        for reference in ["href=", "src=", "url(", "<script", "<link", "@import"] {
            assert!(!html.contains(reference), "{reference}");
        }
        let options = ParsingOptions {
            allow_dtd: true,
            ..ParsingOptions::default()
        };
        let page = Document::parse_with_options(&html, options).expect("a well-formed page");
        assert!(text(page.root()).contains("Ada <Lovelace>"));

        let results: Vec<FeatureResult> = messages(&log, topics::FEATURE_RESULTS);
        let verdicts: Vec<Verdict> = messages(&log, topics::VERDICTS);
        let shown = rows(&page, "Sizes");
        assert_eq!(shown.len(), results.len());
        for (row, result) in shown.iter().zip(&results) {
            assert_eq!(row[0], result.feature_id);
            close(&row[1], result.nominal_size);
            close(&row[2], result.size);
            close(&row[3], result.size_deviation);
            close(
                &row[4],
                result.coverage_factor * result.standard_uncertainty,
            );
            close(&row[5], result.form);
            let verdict = verdicts
                .iter()
                .find(|one| one.plan_id == result.plan_id && one.feature_id == result.feature_id);
            let word = match verdict.map(|one| one.verdict) {
                None => "does not decide",
                Some(Verdict::QUALIFIED) => "qualified",
                Some(Verdict::COMPENSABLE) => "can be corrected",
                other => panic!("{other:?}"),
            };
            assert_eq!(row[8], word);
        }
        let corrections: Vec<Correction> = messages(&log, topics::CORRECTIONS);
        let shown = rows(&page, "Corrections that rest on it");
        assert!(!corrections.is_empty());
        assert_eq!(shown.len(), corrections.len());
        for (row, correction) in shown.iter().zip(&corrections) {
            assert_eq!(row[0], correction.correction_id);
            close(&row[2], correction.previous_value);
            close(&row[3], correction.new_value);
            let (lower, upper) = row[4].split_once(" to ").expect("bounds");
            close(lower, correction.lower_bound);
            close(upper, correction.upper_bound);
            close(&row[5], correction.measured_error);
            assert!(row[7].contains("policy of the cell file"), "{}", row[7]);
            let (applied, read_back) = row[8].split_once(", read back ").expect("an answer");
            assert_eq!(applied, "applied");
            close(read_back, correction.new_value);
        }
        let pictures = page.descendants().filter(|node| node.has_tag_name("svg"));
        assert!(pictures.count() >= 2, "one for each pass at least");
    }

    #[test]
    fn what_holds_no_part_is_refused_in_a_sentence() {
        let folder = tempfile::tempdir().expect("a folder");
        let told = |bag: &Path, html: &Path| {
            let arguments = Arguments {
                bag: bag.to_owned(),
                html: html.to_owned(),
            };
            format!("{:#}", run(&arguments).expect_err("refused"))
        };
        let page = folder.path().join("page.html");
        let absent = folder.path().join("absent");
        assert!(told(&absent, &page).contains("absent"));
        let log = made();
        let planless: Vec<Published> = (log.iter())
            .filter(|one| one.topic != topics::INSPECTION_PLAN.name)
            .cloned()
            .collect();
        let (whole, bare) = (folder.path().join("whole"), folder.path().join("bare"));
        write(&log, &whole);
        write(&planless, &bare);
        assert!(told(&bare, &page).contains("no inspection plan was recorded"));
        let nowhere = folder.path().join("no_folder").join("page.html");
        assert!(told(&whole, &nowhere).contains("cannot write"));
        assert!(!page.exists());
    }
}
