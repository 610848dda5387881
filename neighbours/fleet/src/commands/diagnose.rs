//! `diagnose`, and the processes of a cluster.

use clap::Args;
use probecell_fleet::lake::Lake;
use probecell_fleet::sql::again::{Recordings, SUMMARY};
use probecell_fleet::sql::{self, Engine};

use super::{Output, Printed, Where};

// Diagnose the sessions of a lake anew.
#[derive(Args)]
pub(super) struct Diagnose {
    #[command(flatten)]
    lake: Where,
    /// Only the sessions for which this condition on the table `sessions` holds, as `machine = 'mill_003'`.
    #[arg(long = "where", value_name = "CONDITION")]
    condition: Option<String>,
    /// Where the recordings are: `bags/a.mcap` at s3://BUCKET/FOLDER/bags/a.mcap.
    #[arg(long, value_name = "URL")]
    recordings: Option<String>,
    /// What to ask of the answers: the table `diagnoses` of machine, month, bag, uri, verdict (of the lake) and diagnosis, beside
    /// the tables of the lake.
    #[arg(long, value_name = "STATEMENT", default_value = SUMMARY, hide_default_value = true)]
    sql: String,
    #[command(flatten)]
    printed: Printed,
    #[cfg(feature = "cluster")]
    #[command(flatten)]
    cluster: cluster::Asked,
}

pub(super) fn diagnose(arguments: Diagnose) -> anyhow::Result<u8> {
    let recordings = arguments.recordings.as_deref().map(Recordings::below);
    let recordings = recordings.transpose()?;
    let engine = Engine::open(&Lake::open(&arguments.lake.folder)?)?;
    let asked = engine.sessions(arguments.condition.as_deref(), recordings.as_ref())?;
    #[cfg(feature = "cluster")]
    let rows = match arguments.cluster.diagnosed(&engine, &asked)? {
        Some(rows) => rows,
        None => engine.diagnosed(&asked)?,
    };
    #[cfg(not(feature = "cluster"))]
    let rows = engine.diagnosed(&asked)?;
    engine.know(rows)?;
    let answer = engine.ask(&arguments.sql)?;
    sql::write(answer, arguments.printed.form(), &mut Output::default())?;
    Ok(0)
}

#[cfg(feature = "cluster")]
pub(super) mod cluster {
    //! The processes of a cluster, and how one is asked.

    use std::net::SocketAddr;
    use std::path::PathBuf;
    use std::sync::Mutex;

    use anyhow::Context;
    use arrow_array::RecordBatch;
    use log::{Level, LevelFilter, Log, Metadata, Record};
    use probecell_fleet::cluster::{Cluster, Credentials, Place, execute, schedule};
    use probecell_fleet::sql::again;

    use super::super::remark;
    use super::{Args, Engine};

    // Certificates, PEM.
    #[derive(Args)]
    struct Certificates {
        /// Certificates of the authority that has signed those of the cluster.
        #[arg(long, value_name = "FILE")]
        ca: PathBuf,
        /// Own certificate.
        #[arg(long, value_name = "FILE")]
        certificate: PathBuf,
        /// Key of the own certificate.
        #[arg(long, value_name = "FILE")]
        key: PathBuf,
    }

    impl Certificates {
        fn read(&self) -> anyhow::Result<Credentials> {
            Credentials::read(&self.ca, &self.certificate, &self.key)
        }
    }

    // A cluster that is asked.
    #[derive(Args)]
    pub(in super::super) struct Asked {
        /// Diagnose in the cluster of the scheduler at HOST:PORT.
        #[arg(long, value_name = "HOST:PORT", requires_all = ["ca", "certificate", "key"])]
        cluster: Option<Place>,
        /// Certificates of the authority that has signed those of the cluster.
        #[arg(long, value_name = "FILE", requires = "cluster")]
        ca: Option<PathBuf>,
        /// Own certificate.
        #[arg(long, value_name = "FILE", requires = "cluster")]
        certificate: Option<PathBuf>,
        /// Key of the own certificate.
        #[arg(long, value_name = "FILE", requires = "cluster")]
        key: Option<PathBuf>,
        /// Sessions in a part, which is what is lost with an executor.
        #[arg(long, value_name = "NUMBER", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
        part: u32,
        /// Give up when no executor has asked the scheduler for work for so many seconds.
        #[arg(long, value_name = "S", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=86_400))]
        wait: u64,
        /// Compute one session in so many again here, chosen at random, and at least three; refuse all answers if one differs.
        #[arg(long, value_name = "NUMBER", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
        check: u32,
    }

    impl Asked {
        /// The answers of the cluster, checked; none where none is asked.
        pub(super) fn diagnosed(
            self,
            engine: &Engine,
            asked: &[again::Asked],
        ) -> anyhow::Result<Option<RecordBatch>> {
            let Some(scheduler) = self.cluster else {
                return Ok(None);
            };
            let missing = "--cluster needs --ca, --certificate and --key";
            let certificates = Certificates {
                ca: self.ca.context(missing)?,
                certificate: self.certificate.context(missing)?,
                key: self.key.context(missing)?,
            };
            let cluster = Cluster::new(scheduler, certificates.read()?, self.wait);
            let (rows, tasks) = cluster.diagnosed(asked, self.part as usize)?;
            let same = engine.checked(asked, &rows, self.check as usize)?;
            remark(&format!(
                "{} sessions in {} tasks, {} of them run again; {same} sessions computed here as well, alike byte for byte",
                asked.len(),
                tasks.tasks,
                tasks.again
            ));
            Ok(Some(rows))
        }
    }

    // A scheduler.
    #[derive(Args)]
    pub(in super::super) struct Scheduler {
        /// Address on which it listens.
        #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:50050")]
        listen: SocketAddr,
        /// An executor that is silent for so many seconds is lost (one that works speaks every 5 s).
        #[arg(long, value_name = "S", default_value_t = 30, value_parser = clap::value_parser!(u64).range(10..=3600))]
        lost_after: u64,
        #[command(flatten)]
        certificates: Certificates,
    }

    impl Scheduler {
        pub(in super::super) fn run(&self) -> anyhow::Result<u8> {
            log_to_terminal();
            schedule(self.listen, &self.certificates.read()?, self.lost_after)?;
            Ok(0)
        }
    }

    // An executor.
    #[derive(Args)]
    pub(in super::super) struct Executor {
        /// The scheduler.
        #[arg(long, value_name = "HOST:PORT")]
        scheduler: Place,
        /// Address on which it listens.
        #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:50051")]
        listen: SocketAddr,
        /// Name or address by which others reach it, as its certificate has it; the address on which it listens unless given.
        #[arg(long, value_name = "HOST")]
        host: Option<String>,
        /// Parts at a time, each on all processors.
        #[arg(long, value_name = "NUMBER", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
        parts: u16,
        #[command(flatten)]
        certificates: Certificates,
    }

    impl Executor {
        pub(in super::super) fn run(self) -> anyhow::Result<u8> {
            log_to_terminal();
            let credentials = self.certificates.read()?;
            execute(
                &self.scheduler,
                self.listen,
                self.host,
                usize::from(self.parts),
                &credentials,
            )?;
            Ok(0)
        }
    }

    /// What the cluster says, on standard error: all of ours, warnings of others; a line that is said again and again once.
    struct Terminal {
        last: Mutex<String>,
    }

    impl Log for Terminal {
        fn enabled(&self, metadata: &Metadata<'_>) -> bool {
            let ours = metadata.target().starts_with("probecell_fleet");
            metadata.level() <= if ours { Level::Info } else { Level::Warn }
        }

        fn log(&self, record: &Record<'_>) {
            if !self.enabled(record.metadata()) {
                return;
            }
            let text = match record.level() {
                Level::Error => format!("error: {}", record.args()),
                Level::Warn => format!("warning: {}", record.args()),
                _ => record.args().to_string(),
            };
            let mut last = self
                .last
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner);
            if *last != text {
                remark(&text);
                *last = text;
            }
        }

        fn flush(&self) {}
    }

    fn log_to_terminal() {
        static TERMINAL: Terminal = Terminal {
            last: Mutex::new(String::new()),
        };
        if log::set_logger(&TERMINAL).is_ok() {
            log::set_max_level(LevelFilter::Info);
        }
    }
}
