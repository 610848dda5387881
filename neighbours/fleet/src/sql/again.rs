//! Diagnosing the sessions of a lake anew, here or in a cluster: one plan for both.
//!
//! The list of sessions is cut into parts, each part is a map of `diagnose`, and the answers are brought together by machine and month.
//! There is no other shape: no join and no set operation.

use std::collections::BTreeMap;
use std::hash::{BuildHasher, RandomState};
use std::sync::Arc;

use anyhow::{Context, anyhow, ensure};
use arrow_array::cast::AsArray;
use arrow_array::{Array, ArrayRef, RecordBatch, StringArray, UInt32Array};
use arrow_json::writer::{LineDelimited, WriterBuilder};
use arrow_ord::sort::{SortColumn, lexsort_to_indices};
use arrow_schema::{DataType, Field, Schema};
use arrow_select::concat::concat_batches;
use arrow_select::take::{take, take_record_batch};
use datafusion::common::DataFusionError;
use datafusion::functions::core::named_struct;
use datafusion::functions_aggregate::array_agg::array_agg;
use datafusion::logical_expr::{LogicalPlan, LogicalPlanBuilder, Union};
use datafusion::prelude::{Expr, SessionContext, col, lit};
use rand::SeedableRng;
use rand::seq::index::sample;
use rand_pcg::Pcg64Mcg;
use url::Url;

use super::{Engine, functions, sentence};
use crate::answer::ANSWER;
use crate::lake::remote::is_url;

/// Name of the table of the answers.
pub const DIAGNOSES: &str = "diagnoses";

/// What is asked of the answers unless something else is.
pub const SUMMARY: &str = "SELECT machine, \"month\", count(*) AS sessions, \
     sum(CASE WHEN diagnosis['verdict'] IS NOT DISTINCT FROM verdict THEN 0 ELSE 1 END) AS verdict_differs, \
     count(diagnosis['refusal']) AS refused \
     FROM diagnoses GROUP BY machine, \"month\" ORDER BY machine, \"month\"";

/// A session that is to be diagnosed anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Asked {
    bag: String,
    machine: String,
    month: String,
    uri: String,
    verdict: Option<String>,
}

/// Where the recordings are, of which the lake knows the paths.
#[derive(Debug, Clone)]
pub struct Recordings(Url);

impl Recordings {
    /// Below a URL, `s3://BUCKET/FOLDER`: `bags/a.mcap` is `s3://BUCKET/FOLDER/bags/a.mcap`.
    ///
    /// # Errors
    /// It is no such URL.
    pub fn below(url: &str) -> anyhow::Result<Self> {
        let parsed = Url::parse(url).with_context(|| format!("{url:?} is no URL"))?;
        ensure!(
            parsed.scheme() == "s3" && parsed.host_str().is_some(),
            "{url:?} is not s3://BUCKET/FOLDER"
        );
        Ok(Self(parsed))
    }

    fn of(&self, path: &str) -> String {
        if is_url(path) {
            return path.to_owned();
        }
        let mut url = self.0.clone();
        if let Ok(mut parts) = url.path_segments_mut() {
            parts.pop_if_empty();
            parts.extend(
                path.split('/')
                    .filter(|part| !part.is_empty() && *part != "."),
            );
        }
        url.into()
    }
}

/// The plan of new diagnoses of some sessions, so many in a part: machine, month, and a list of bag, uri and diagnosis.
pub(crate) fn plan(asked: &[Asked], part: usize) -> Result<LogicalPlan, DataFusionError> {
    let diagnose = functions::diagnose();
    let answered = |part: &[Asked]| -> Result<Arc<LogicalPlan>, DataFusionError> {
        let row = |one: &Asked| -> Vec<Expr> {
            [&one.machine, &one.month, &one.bag, &one.uri]
                .map(|text| lit(text.as_str()))
                .to_vec()
        };
        let [bag, uri] = [col("column3"), col("column4")];
        let session = named_struct().call(vec![
            lit("bag"),
            bag,
            lit("uri"),
            uri.clone(),
            lit("diagnosis"),
            diagnose.call(vec![uri]),
        ]);
        let plan = LogicalPlanBuilder::values(part.iter().map(row).collect())?
            .project(vec![
                col("column1").alias("machine"),
                col("column2").alias("month"),
                session.alias("session"),
            ])?
            .build()?;
        Ok(Arc::new(plan))
    };
    let parts = asked
        .chunks(part.max(1))
        .map(answered)
        .collect::<Result<Vec<_>, _>>()?;
    let all = match <[Arc<LogicalPlan>; 1]>::try_from(parts) {
        Ok([one]) => Arc::unwrap_or_clone(one),
        Err(several) => LogicalPlan::Union(Union::try_new(several)?),
    };
    LogicalPlanBuilder::from(all)
        .aggregate(
            vec![col("machine"), col("month")],
            vec![array_agg(col("session")).alias("sessions")],
        )?
        .build()
}

/// The answers to [`plan`] as rows of machine, month, bag, uri, verdict (of the lake) and diagnosis, by machine, month and bag.
///
/// # Errors
/// A session has no answer or several, or an answer is of none that was asked.
pub(crate) fn rows(asked: &[Asked], batches: &[RecordBatch]) -> anyhow::Result<RecordBatch> {
    let verdicts: BTreeMap<&str, Option<&str>> = asked
        .iter()
        .map(|one| (one.bag.as_str(), one.verdict.as_deref()))
        .collect();
    let text = |name: &str| Field::new(name, DataType::Utf8, true);
    let schema = Arc::new(Schema::new(vec![
        text("machine"),
        text("month"),
        text("bag"),
        text("uri"),
        text("verdict"),
        Field::new("diagnosis", DataType::Struct(ANSWER.clone()), true),
    ]));
    let flat = |batch: &RecordBatch| -> anyhow::Result<RecordBatch> {
        let lists = batch
            .column(2)
            .as_list_opt::<i32>()
            .context("no list of answers")?;
        let offsets = lists.value_offsets();
        let (first, last) = (offsets[0] as usize, offsets[lists.len()] as usize);
        let groups: UInt32Array = (0..lists.len())
            .flat_map(|row| vec![row as u32; lists.value_length(row) as usize])
            .collect();
        let sessions = lists.values().slice(first, last - first);
        let sessions = sessions.as_struct_opt().context("no answers")?;
        let of_group = |column: usize| -> anyhow::Result<ArrayRef> {
            let texts = arrow_cast::cast(batch.column(column), &DataType::Utf8)?;
            Ok(take(&texts, &groups, None)?)
        };
        let bags = sessions
            .column(0)
            .as_string_opt::<i32>()
            .context("no bags")?;
        let verdicts: StringArray = bags
            .iter()
            .map(|bag| verdicts.get(bag.unwrap_or_default()).copied().flatten())
            .collect();
        let columns = vec![
            of_group(0)?,
            of_group(1)?,
            sessions.column(0).clone(),
            sessions.column(1).clone(),
            Arc::new(verdicts),
            sessions.column(2).clone(),
        ];
        Ok(RecordBatch::try_new(schema.clone(), columns)?)
    };
    let flat = batches
        .iter()
        .map(flat)
        .collect::<anyhow::Result<Vec<_>>>()?;
    let all = concat_batches(&schema, &flat)?;
    once(asked, &all)?;
    let by = |column: usize| SortColumn {
        values: all.column(column).clone(),
        options: None,
    };
    let order = lexsort_to_indices(&[by(0), by(1), by(2)], None)?;
    Ok(take_record_batch(&all, &order)?)
}

/// Makes sure that each session has answered once.
fn once(asked: &[Asked], rows: &RecordBatch) -> anyhow::Result<()> {
    let mut left: BTreeMap<&str, usize> = asked.iter().map(|one| (one.bag.as_str(), 0)).collect();
    let bags = rows.column(2).as_string::<i32>();
    for bag in bags {
        let bag = bag.context("an answer is of no session")?;
        *left
            .get_mut(bag)
            .with_context(|| format!("an answer is of {bag}, which was not asked"))? += 1;
    }
    let wrong = |times: fn(usize) -> bool| left.iter().filter(move |(_, count)| times(**count));
    let (none, several) = (wrong(|count| count == 0), wrong(|count| count > 1));
    let first = none.clone().chain(several.clone()).next();
    if let Some((bag, _)) = first {
        anyhow::bail!(
            "of {} sessions {} have no answer and {} have several, the first of them {bag}",
            asked.len(),
            none.count(),
            several.count()
        );
    }
    Ok(())
}

impl Engine {
    /// The sessions of the lake for which a condition of SQL holds; all where there is none.
    ///
    /// # Errors
    /// The condition cannot be understood.
    pub fn sessions(
        &self,
        condition: Option<&str>,
        recordings: Option<&Recordings>,
    ) -> anyhow::Result<Vec<Asked>> {
        let condition = condition.unwrap_or("true");
        let statement = format!(
            "SELECT bag, machine, \"month\", uri, verdict FROM sessions WHERE {condition} ORDER BY machine, \"month\", bag"
        );
        let mut asked = Vec::new();
        for batch in self.ask(&statement)? {
            let batch = batch?;
            let columns = (0..5)
                .map(|column| arrow_cast::cast(batch.column(column), &DataType::Utf8))
                .collect::<Result<Vec<_>, _>>()?;
            let text = |column: usize, row: usize| {
                let texts = columns[column].as_string::<i32>();
                texts.is_valid(row).then(|| texts.value(row).to_owned())
            };
            for row in 0..batch.num_rows() {
                let uri = text(3, row).unwrap_or_default();
                asked.push(Asked {
                    bag: text(0, row).context("a session of the lake has no key")?,
                    machine: text(1, row).unwrap_or_default(),
                    month: text(2, row).unwrap_or_default(),
                    uri: recordings.map_or_else(|| uri.clone(), |place| place.of(&uri)),
                    verdict: text(4, row),
                });
            }
        }
        Ok(asked)
    }

    /// New diagnoses of sessions, computed here.
    ///
    /// # Errors
    /// The engine fails; a recording that cannot be diagnosed is no error.
    pub fn diagnosed(&self, asked: &[Asked]) -> anyhow::Result<RecordBatch> {
        let batches = if asked.is_empty() {
            Vec::new()
        } else {
            let answered = collect(&self.context, asked, asked.len());
            self.runtime.block_on(answered)?
        };
        rows(asked, &batches)
    }

    /// Makes rows known as the table `diagnoses`.
    ///
    /// # Errors
    /// There is one already.
    pub fn know(&self, rows: RecordBatch) -> anyhow::Result<()> {
        self.context
            .register_batch(DIAGNOSES, rows)
            .map_err(|error| anyhow!(sentence(&error)))?;
        Ok(())
    }

    /// Computes sessions again that are chosen at random, one in `one_in` and at least three, and compares them byte for byte with the answers that
    /// came from elsewhere; gives their number.
    ///
    /// # Errors
    /// An answer differs.
    pub fn checked(
        &self,
        asked: &[Asked],
        rows: &RecordBatch,
        one_in: usize,
    ) -> anyhow::Result<usize> {
        let count = asked.len().div_ceil(one_in.max(1)).max(3).min(asked.len());
        let mut random = Pcg64Mcg::seed_from_u64(RandomState::new().hash_one(asked.len()));
        let chosen: BTreeMap<&str, &Asked> = sample(&mut random, asked.len(), count)
            .iter()
            .map(|place| (asked[place].bag.as_str(), &asked[place]))
            .collect();
        let bags = rows.column(2).as_string::<i32>();
        let places: UInt32Array = (0..rows.num_rows())
            .filter(|row| chosen.contains_key(bags.value(*row)))
            .map(|row| row as u32)
            .collect();
        let theirs = lines(&take_record_batch(rows, &places)?)?;
        let again: Vec<Asked> = chosen.into_values().cloned().collect();
        let ours = self.diagnosed(&again)?;
        let bags = ours.column(2).as_string::<i32>();
        let ours = lines(&ours)?;
        let differs = ours.lines().zip(theirs.lines()).position(|(a, b)| a != b);
        if let Some(place) = differs.or((ours.len() != theirs.len()).then_some(0)) {
            anyhow::bail!(
                "session {} was answered otherwise by the cluster than it is here: its answers are not to be trusted",
                bags.value(place)
            );
        }
        Ok(count)
    }
}

/// The answers to [`plan`] in a session.
pub(crate) async fn collect(
    context: &SessionContext,
    asked: &[Asked],
    part: usize,
) -> anyhow::Result<Vec<RecordBatch>> {
    let answered = async {
        let frame = context.execute_logical_plan(plan(asked, part)?).await?;
        frame.collect().await
    };
    answered.await.map_err(|error| anyhow!(sentence(&error)))
}

/// A line of JSON for each row.
fn lines(rows: &RecordBatch) -> anyhow::Result<String> {
    let mut text = Vec::new();
    let mut writer = WriterBuilder::new()
        .with_explicit_nulls(true)
        .build::<_, LineDelimited>(&mut text);
    writer.write(rows)?;
    writer.finish()?;
    drop(writer);
    Ok(String::from_utf8(text)?)
}

#[cfg(test)]
mod tests;
