//! The scheduler: hands out the parts of a question, and counts them.

use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use anyhow::{Context, anyhow};
use ballista_core::config::TaskSchedulingPolicy;
use ballista_core::serde::protobuf::scheduler_grpc_server::{SchedulerGrpc, SchedulerGrpcServer};
use ballista_core::serde::protobuf::{
    CancelJobParams, CancelJobResult, CleanJobDataParams, CleanJobDataResult,
    CreateUpdateSessionParams, CreateUpdateSessionResult, ExecuteQueryParams, ExecuteQueryResult,
    ExecutorStoppedParams, ExecutorStoppedResult, GetJobMetricsParams, GetJobMetricsResult,
    GetJobStatusParams, GetJobStatusResult, HeartBeatParams, HeartBeatResult, PollWorkParams,
    PollWorkResult, RegisterExecutorParams, RegisterExecutorResult, RemoveSessionParams,
    RemoveSessionResult, UpdateTaskStatusParams, UpdateTaskStatusResult, task_status,
};
use ballista_scheduler::cluster::BallistaCluster;
use ballista_scheduler::config::SchedulerConfig;
use ballista_scheduler::scheduler_process::create_scheduler;
use ballista_scheduler::scheduler_server::SchedulerServer;
use datafusion_proto::protobuf::{LogicalPlanNode, PhysicalPlanNode};
use log::info;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status};

use super::client::{GIVEN, SILENT, STAGES};
use super::identity::SameRevision;
use super::{Credentials, MESSAGE, config, line, runtime, state};

/// Jobs whose parts are remembered.
const JOBS: usize = 100;
/// s between two looks for executors that are lost.
const LOOK: u64 = 1;

/// Runs a scheduler until the process is ended. An executor that is silent for `lost_after` (s) is lost.
///
/// # Errors
/// The address cannot be listened on, or the certificate not be used.
pub fn schedule(
    listen: SocketAddr,
    credentials: &Credentials,
    lost_after: u64,
) -> anyhow::Result<()> {
    let own = credentials.clone();
    let settings = SchedulerConfig {
        external_host: listen.ip().to_string(),
        bind_host: listen.ip().to_string(),
        bind_port: listen.port(),
        scheduling_policy: TaskSchedulingPolicy::PullStaged,
        executor_timeout_seconds: lost_after,
        no_executors_grace_period_seconds: lost_after,
        expire_dead_executor_interval_seconds: LOOK,
        grpc_server_max_decoding_message_size: MESSAGE as u32,
        grpc_server_max_encoding_message_size: MESSAGE as u32,
        grpc_client_max_message_size: MESSAGE as u32,
        override_config_producer: Some(Arc::new(move || config(&own))),
        override_session_builder: Some(Arc::new(state)),
        override_create_grpc_client_endpoint: Some(credentials.overriding()),
        use_tls: true,
        ..SchedulerConfig::default()
    };
    runtime()?.block_on(async {
        let failed =
            |error: ballista_core::error::BallistaError| anyhow!("the scheduler: {}", line(&error));
        let cluster = BallistaCluster::new_from_config(&settings)
            .await
            .map_err(failed)?;
        let inner =
            create_scheduler::<LogicalPlanNode, PhysicalPlanNode>(cluster, Arc::new(settings))
                .await
                .map_err(failed)?;
        let listener = tokio::net::TcpListener::bind(listen)
            .await
            .with_context(|| format!("cannot listen on {listen}"))?;
        let service = SchedulerGrpcServer::new(Watched {
            inner,
            known: Arc::new(Mutex::new(Known {
                executors: BTreeSet::new(),
                jobs: BTreeMap::new(),
                asked: Instant::now(),
            })),
        })
        .max_decoding_message_size(MESSAGE)
        .max_encoding_message_size(MESSAGE);
        let server = credentials
            .server()?
            .add_service(InterceptedService::new(service, SameRevision));
        info!("scheduler on {listen}");
        server
            .serve_with_incoming(TcpIncoming::from(listener))
            .await
            .map_err(|error| anyhow!("the scheduler: {}", line(&error)))
    })
}

/// Of a job: how many tasks were handed out, and its stages.
#[derive(Debug, Default)]
struct Handed {
    given: usize,
    stages: BTreeSet<u32>,
}

/// What was seen of executors and jobs.
#[derive(Debug)]
struct Known {
    executors: BTreeSet<String>,
    jobs: BTreeMap<String, Handed>,
    /// When an executor has last asked for work, or else the beginning.
    asked: Instant,
}

/// The scheduler of Ballista, with an eye on what passes.
struct Watched {
    inner: SchedulerServer<LogicalPlanNode, PhysicalPlanNode>,
    known: Arc<Mutex<Known>>,
}

impl Watched {
    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes note of what an executor says.
    fn heard(&self, from: &str, said: &PollWorkParams) {
        let mut known = self.known();
        known.asked = Instant::now();
        let new = known.executors.insert(from.to_owned());
        drop(known);
        if new {
            info!("executor {from} has joined");
        }
        for task in &said.task_status {
            let end = match &task.status {
                Some(task_status::Status::Successful(_)) => "finished",
                Some(task_status::Status::Failed(_)) => "failed",
                _ => continue,
            };
            info!(
                "job {} stage {} task {}: {end} by {from}",
                task.job_id, task.stage_id, task.task_id
            );
        }
    }

    /// Takes note of what an executor is given.
    fn given(&self, to: &str, work: &PollWorkResult) {
        let mut known = self.known();
        for task in &work.tasks {
            let job = known.jobs.entry(task.job_id.clone()).or_default();
            job.given += 1;
            job.stages.insert(task.stage_id);
            info!(
                "job {} stage {} task {}: given to {to}",
                task.job_id, task.stage_id, task.task_id
            );
        }
        while known.jobs.len() > JOBS {
            known.jobs.pop_first();
        }
    }
}

/// Hands calls over.
macro_rules! pass {
    ($($call:ident: $params:ty => $result:ty),* $(,)?) => {
        #[tonic::async_trait]
        impl SchedulerGrpc for Watched {
            type ExecuteQueryPushStream =
                <SchedulerServer<LogicalPlanNode, PhysicalPlanNode> as SchedulerGrpc>::ExecuteQueryPushStream;

            async fn poll_work(
                &self,
                request: Request<PollWorkParams>,
            ) -> Result<Response<PollWorkResult>, Status> {
                let executor = request.get_ref().metadata.as_ref().map_or_else(String::new, |told| {
                    format!("{}:{}", told.host.as_deref().unwrap_or_default(), told.port)
                });
                self.heard(&executor, request.get_ref());
                let response = SchedulerGrpc::poll_work(&self.inner, request).await?;
                self.given(&executor, response.get_ref());
                Ok(response)
            }

            async fn get_job_status(
                &self,
                request: Request<GetJobStatusParams>,
            ) -> Result<Response<GetJobStatusResult>, Status> {
                let job = request.get_ref().job_id.clone();
                // A greeting: whoever gets this far is one of us.
                if job.is_empty() {
                    let mut greeting = Response::new(GetJobStatusResult { status: None, flight_proxy: None });
                    let silent = self.known().asked.elapsed().as_secs();
                    greeting.metadata_mut().insert(SILENT, silent.into());
                    return Ok(greeting);
                }
                let mut response = SchedulerGrpc::get_job_status(&self.inner, request).await?;
                if let Some(handed) = self.known().jobs.get(&job) {
                    response.metadata_mut().insert(GIVEN, handed.given.into());
                    response.metadata_mut().insert(STAGES, handed.stages.len().into());
                }
                Ok(response)
            }

            async fn execute_query_push(
                &self,
                request: Request<ExecuteQueryParams>,
            ) -> Result<Response<Self::ExecuteQueryPushStream>, Status> {
                SchedulerGrpc::execute_query_push(&self.inner, request).await
            }

            $(async fn $call(&self, request: Request<$params>) -> Result<Response<$result>, Status> {
                SchedulerGrpc::$call(&self.inner, request).await
            })*
        }
    };
}

pass! {
    register_executor: RegisterExecutorParams => RegisterExecutorResult,
    heart_beat_from_executor: HeartBeatParams => HeartBeatResult,
    update_task_status: UpdateTaskStatusParams => UpdateTaskStatusResult,
    create_update_session: CreateUpdateSessionParams => CreateUpdateSessionResult,
    remove_session: RemoveSessionParams => RemoveSessionResult,
    execute_query: ExecuteQueryParams => ExecuteQueryResult,
    get_job_metrics: GetJobMetricsParams => GetJobMetricsResult,
    executor_stopped: ExecutorStoppedParams => ExecutorStoppedResult,
    cancel_job: CancelJobParams => CancelJobResult,
    clean_job_data: CleanJobDataParams => CleanJobDataResult,
}
