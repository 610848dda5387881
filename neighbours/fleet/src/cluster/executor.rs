//! An executor: asks the scheduler for parts, diagnoses, and keeps the answers until they are fetched.

use std::net::SocketAddr;
use std::sync::Arc;

use anyhow::{Context, anyhow};
use arrow_flight::flight_service_server::FlightServiceServer;
use ballista_core::config::TaskSchedulingPolicy;
use ballista_core::error::BallistaError;
use ballista_core::registry::BallistaFunctionRegistry;
use ballista_core::utils::GrpcServerConfig;
use ballista_executor::executor_process::{ExecutorProcessConfig, start_executor_process};
use ballista_executor::flight_service::BallistaFlightService;
use ballista_executor::shutdown::Shutdown;
use log::info;
use tonic::service::interceptor::InterceptedService;

use super::client::greeted;
use super::identity::SameRevision;
use super::{Credentials, MESSAGE, Place, config, line, runtime, state};

/// Runs an executor until the process is ended: SIGTERM or an interrupt lets it finish what it has in hand. Others reach it as `host` at the port on
/// which it listens; it works on so many parts at once, each on all processors.
///
/// # Errors
/// The scheduler cannot be reached, or is of another revision; the address cannot be listened on.
pub fn execute(
    scheduler: &Place,
    listen: SocketAddr,
    host: Option<String>,
    parts: usize,
    credentials: &Credentials,
) -> anyhow::Result<()> {
    let folder = tempfile::tempdir().context("cannot make a folder for the answers")?;
    let own = credentials.clone();
    let functions = state(config(credentials)).map_err(|error| anyhow!(line(&error)))?;
    let served = credentials.clone();
    let flight =
        move |folder: String, address: SocketAddr, shutdown: Shutdown, _: GrpcServerConfig| {
            tokio::spawn(serve(served.clone(), folder, address, shutdown))
        };
    let settings = ExecutorProcessConfig {
        bind_host: listen.ip().to_string(),
        external_host: Some(host.unwrap_or_else(|| listen.ip().to_string())),
        port: listen.port(),
        scheduler_host: scheduler.host.clone(),
        scheduler_port: scheduler.port,
        vcores: parts,
        task_scheduling_policy: TaskSchedulingPolicy::PullStaged,
        work_dir: Some(folder.path().to_string_lossy().into_owned()),
        grpc_max_decoding_message_size: MESSAGE as u32,
        grpc_max_encoding_message_size: MESSAGE as u32,
        override_function_registry: Some(Arc::new(BallistaFunctionRegistry::from(&functions))),
        override_config_producer: Some(Arc::new(move || config(&own))),
        override_arrow_flight_service: Some(Arc::new(flight)),
        override_create_grpc_client_endpoint: Some(credentials.overriding()),
        ..ExecutorProcessConfig::default()
    };
    runtime()?.block_on(async {
        greeted(scheduler, credentials).await?;
        // Before the scheduler knows of it.
        drop(
            tokio::net::TcpListener::bind(listen)
                .await
                .with_context(|| format!("cannot listen on {listen}"))?,
        );
        info!("executor on {listen} for the scheduler on {scheduler}");
        start_executor_process(Arc::new(settings))
            .await
            .map_err(|error| anyhow!("the executor: {}", line(&error)))
    })
}

/// Hands out answers, to holders of a certificate and of this revision.
async fn serve(
    credentials: Credentials,
    folder: String,
    address: SocketAddr,
    mut shutdown: Shutdown,
) -> Result<(), BallistaError> {
    let service = FlightServiceServer::new(BallistaFlightService::new(folder))
        .max_decoding_message_size(MESSAGE)
        .max_encoding_message_size(MESSAGE);
    credentials
        .server()
        .map_err(|error| BallistaError::General(error.to_string()))?
        .add_service(InterceptedService::new(service, SameRevision))
        .serve_with_shutdown(address, shutdown.recv())
        .await
        .map_err(BallistaError::TonicError)
}
