//! Asking a cluster.

use std::pin::pin;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use arrow_array::RecordBatch;
use ballista_core::JobId;
use ballista_core::execution_plans::DistributedQueryExec;
use ballista_core::extension::SessionStateExt;
use ballista_core::serde::protobuf::scheduler_grpc_client::SchedulerGrpcClient;
use ballista_core::serde::protobuf::{CancelJobParams, GetJobStatusParams};
use datafusion::common::DataFusionError;
use datafusion::physical_plan::collect;
use datafusion::prelude::SessionContext;
use datafusion_proto::protobuf::LogicalPlanNode;
use futures::future::{Either, select};
use tonic::Status;
use tonic::metadata::MetadataMap;
use tonic::transport::Channel;

use super::{Credentials, GROUPS, Place, config, line, runtime, state};
use crate::sql::again::{Asked, plan, rows};

/// Headers with the tasks of a job that were handed out, and its stages.
pub(super) const GIVEN: &str = "probecell-given";
/// See [`GIVEN`].
pub(super) const STAGES: &str = "probecell-stages";
/// Header with the seconds since an executor has last asked for work, or since the scheduler was started.
pub(super) const SILENT: &str = "probecell-silent";

/// Parts of a job: each task is sent the plan of all parts, without the rows of the others.
const PARTS_OF_JOB: usize = 200;

/// s between two looks whether there are executors.
const LOOK: u64 = 1;

/// A cluster, by its scheduler.
pub struct Cluster {
    scheduler: Place,
    credentials: Credentials,
    patience: u64,
}

/// What a question took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tasks {
    /// Tasks of the map and of the grouping.
    pub tasks: usize,
    /// How many more were handed out again, since an executor was lost or has failed.
    pub again: usize,
}

impl Cluster {
    /// The cluster of a scheduler. A question is given up when no executor has asked for work for `patience` (s).
    pub fn new(scheduler: Place, credentials: Credentials, patience: u64) -> Self {
        Self {
            scheduler,
            credentials,
            patience,
        }
    }

    /// New diagnoses of sessions, so many in a part.
    ///
    /// # Errors
    /// The scheduler cannot be reached, or is of another revision; there is no executor; the question fails; a session has not answered
    /// exactly once.
    pub fn diagnosed(&self, asked: &[Asked], part: usize) -> anyhow::Result<(RecordBatch, Tasks)> {
        runtime()?.block_on(async {
            let mut scheduler = greeted(&self.scheduler, &self.credentials).await?;
            let context = self.session().map_err(|error| self.failed(&error))?;
            let mut all = Tasks { tasks: 0, again: 0 };
            let mut batches = Vec::new();
            for some in asked.chunks(PARTS_OF_JOB * part.max(1)) {
                let (job, answered) = self.collected(&context, &mut scheduler, some, part).await?;
                batches.extend(answered);
                let job_id = job.context("the scheduler has given the question no number")?;
                let told = scheduler
                    .get_job_status(GetJobStatusParams { job_id })
                    .await
                    .map_err(|status| refused(&self.scheduler, &status))?;
                let count = |name: &str| number(told.metadata(), name);
                let (given, stages) = (count(GIVEN)?, count(STAGES)?);
                // One part alone is grouped where it was made.
                let needed = some.len().div_ceil(part.max(1)) + GROUPS * stages.saturating_sub(1);
                all.tasks += needed;
                all.again += given.saturating_sub(needed);
            }
            Ok((rows(asked, &batches)?, all))
        })
    }

    /// Number and answers of one job, which is given up where there is nobody to do it.
    async fn collected(
        &self,
        context: &SessionContext,
        scheduler: &mut SchedulerGrpcClient<Channel>,
        asked: &[Asked],
        part: usize,
    ) -> anyhow::Result<(Option<String>, Vec<RecordBatch>)> {
        let failed = |error: DataFusionError| self.failed(&error);
        let logical = plan(asked, part).map_err(failed)?;
        let physical = context.state().create_physical_plan(&logical).await;
        let physical = physical.map_err(failed)?;
        let job = || {
            let asked = physical.downcast_ref::<DistributedQueryExec<LogicalPlanNode>>();
            asked
                .and_then(DistributedQueryExec::job_id)
                .map(JobId::into_inner)
        };
        let answers = pin!(collect(physical.clone(), context.task_ctx()));
        let looks = pin!(self.silent(scheduler.clone()));
        match select(answers, looks).await {
            Either::Left((batches, _)) => Ok((job(), batches.map_err(failed)?)),
            Either::Right((error, _)) => {
                // Or else the next executor would do it for nobody. Where even that fails the first error says more.
                if let Some(job_id) = job() {
                    drop(scheduler.cancel_job(CancelJobParams { job_id }).await);
                }
                Err(error)
            }
        }
    }

    /// Ends with an error, when no executor has asked for work for too long or the scheduler does not answer.
    async fn silent(&self, mut scheduler: SchedulerGrpcClient<Channel>) -> anyhow::Error {
        let begun = Instant::now();
        let mut looks = tokio::time::interval(Duration::from_secs(LOOK));
        loop {
            looks.tick().await;
            let greeting = scheduler.get_job_status(GetJobStatusParams::default());
            let told = match greeting.await {
                Ok(told) => number(told.metadata(), SILENT),
                Err(status) => return refused(&self.scheduler, &status),
            };
            match told {
                Ok(silent) if begun.elapsed().as_secs().min(silent as u64) >= self.patience => {
                    return anyhow!(
                        "{}: no executor has asked for work for {silent} s: start one, or wait longer (--wait)",
                        self.scheduler
                    );
                }
                Ok(_) => {}
                Err(error) => return error,
            }
        }
    }

    fn session(&self) -> Result<SessionContext, DataFusionError> {
        let url = format!("https://{}", self.scheduler);
        let state = state(config(&self.credentials))?.upgrade_for_ballista(url)?;
        let context = SessionContext::new_with_state(state);
        crate::sql::register(&context);
        Ok(context)
    }

    fn failed(&self, error: &DataFusionError) -> anyhow::Error {
        let text = error.strip_backtrace();
        let words: Vec<&str> = text.split_whitespace().collect();
        anyhow!("{}: {}", self.scheduler, words.join(" "))
    }
}

fn number(metadata: &MetadataMap, name: &str) -> anyhow::Result<usize> {
    let text = metadata.get(name).and_then(|value| value.to_str().ok());
    text.and_then(|text| text.parse().ok())
        .with_context(|| format!("the scheduler does not say {name}"))
}

/// A scheduler that has answered, which it does only to its own revision.
pub(super) async fn greeted(
    scheduler: &Place,
    credentials: &Credentials,
) -> anyhow::Result<SchedulerGrpcClient<Channel>> {
    let connection = credentials
        .endpoint(scheduler)?
        .connect()
        .await
        .map_err(|error| anyhow!("cannot reach the scheduler {scheduler}: {}", line(&error)))?;
    let mut client = SchedulerGrpcClient::new(connection);
    client
        .get_job_status(GetJobStatusParams::default())
        .await
        .map_err(|status| refused(scheduler, &status))?;
    Ok(client)
}

fn refused(scheduler: &Place, status: &Status) -> anyhow::Error {
    let cause = std::error::Error::source(status).map(line);
    let cause = cause.map_or_else(String::new, |cause| format!(" ({cause})"));
    anyhow!("{scheduler}: {}{cause}", status.message())
}
