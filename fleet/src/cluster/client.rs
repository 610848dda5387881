//! Asking a cluster.

use anyhow::{Context, anyhow};
use arrow_array::RecordBatch;
use ballista_core::JobId;
use ballista_core::execution_plans::DistributedQueryExec;
use ballista_core::extension::SessionStateExt;
use ballista_core::serde::protobuf::GetJobStatusParams;
use ballista_core::serde::protobuf::scheduler_grpc_client::SchedulerGrpcClient;
use datafusion::common::DataFusionError;
use datafusion::physical_plan::collect;
use datafusion::prelude::SessionContext;
use datafusion_proto::protobuf::LogicalPlanNode;
use tonic::Status;
use tonic::metadata::MetadataMap;
use tonic::transport::Channel;

use super::{Credentials, GROUPS, Place, config, line, runtime, state};
use crate::sql::again::{Asked, plan, rows};

/// Headers with the tasks of a job that were handed out, and its stages.
pub(super) const GIVEN: &str = "probecell-given";
/// See [`GIVEN`].
pub(super) const STAGES: &str = "probecell-stages";

/// Parts of a job: each task is sent the plan of all parts, without the rows of the others.
const PARTS_OF_JOB: usize = 200;

/// A cluster, by its scheduler.
pub struct Cluster {
    scheduler: Place,
    credentials: Credentials,
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
    /// The cluster of a scheduler.
    pub fn new(scheduler: Place, credentials: Credentials) -> Self {
        Self {
            scheduler,
            credentials,
        }
    }

    /// New diagnoses of sessions, so many in a part; waits until there is an executor.
    ///
    /// # Errors
    /// The scheduler cannot be reached, or is of another revision; the question fails; a session has not answered exactly once.
    pub fn diagnosed(&self, asked: &[Asked], part: usize) -> anyhow::Result<(RecordBatch, Tasks)> {
        runtime()?.block_on(async {
            let mut scheduler = greeted(&self.scheduler, &self.credentials).await?;
            let context = self.session().map_err(|error| self.failed(&error))?;
            let mut all = Tasks { tasks: 0, again: 0 };
            let mut batches = Vec::new();
            for some in asked.chunks(PARTS_OF_JOB * part.max(1)) {
                let (job, answered) = collected(&context, some, part)
                    .await
                    .map_err(|error| self.failed(&error))?;
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

/// Number and answers of one job.
async fn collected(
    context: &SessionContext,
    asked: &[Asked],
    part: usize,
) -> Result<(Option<String>, Vec<RecordBatch>), DataFusionError> {
    let logical = plan(asked, part)?;
    let physical = context.state().create_physical_plan(&logical).await?;
    let batches = collect(physical.clone(), context.task_ctx()).await?;
    let job = physical
        .downcast_ref::<DistributedQueryExec<LogicalPlanNode>>()
        .and_then(DistributedQueryExec::job_id);
    Ok((job.map(JobId::into_inner), batches))
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
