//! Questions in SQL: the tables of a lake, views of what people ask, and the diagnosis and the trends as functions.
//!
//! Apache DataFusion in this process; a question reads and never writes.

pub mod again;
mod functions;
mod print;
mod views;

pub use functions::FUNCTIONS;
#[cfg(feature = "cluster")]
pub(crate) use functions::register;
pub use print::{Form, write};
pub use views::{VIEWS, View};

use std::sync::Arc;

use anyhow::{Context, anyhow};
use arrow_array::RecordBatch;
use arrow_schema::{DataType, SchemaRef};
use datafusion::common::DataFusionError;
use datafusion::datasource::file_format::parquet::ParquetFormat;
use datafusion::datasource::listing::ListingOptions;
use datafusion::execution::SendableRecordBatchStream;
use datafusion::prelude::{SQLOptions, SessionConfig, SessionContext};
use futures::StreamExt;
use tokio::runtime::Runtime;

use crate::lake::Lake;
use crate::lake::schema::{MONTH, TABLES, schema};

/// An engine with the tables of a lake.
pub struct Engine {
    context: SessionContext,
    runtime: Runtime,
}

/// The answer to a question, batch by batch.
pub struct Answer<'e> {
    engine: &'e Engine,
    stream: SendableRecordBatchStream,
}

impl Engine {
    /// An engine on a lake.
    ///
    /// # Errors
    /// The folder of the lake cannot be read.
    pub fn open(lake: &Lake) -> anyhow::Result<Self> {
        if let Some(remote) = lake.remote() {
            let engine = Self::begin()?;
            let (url, store) = remote.store();
            engine.context.register_object_store(url, store);
            return engine.with_tables(&remote.folder())?.with_views();
        }
        let root = lake
            .root()
            .canonicalize()
            .with_context(|| format!("cannot read {}", lake.root().display()))?;
        let url = url::Url::from_directory_path(&root)
            .map_err(|()| anyhow!("{} is no absolute path", root.display()))?;
        Self::begin()?.with_tables(url.as_str())?.with_views()
    }

    /// An engine without tables.
    fn begin() -> anyhow::Result<Self> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .enable_all()
            .build()
            .context("cannot start the threads of the engine")?;
        let config = SessionConfig::new().with_information_schema(true);
        let context = SessionContext::new_with_config(config);
        functions::register(&context);
        Ok(Self { context, runtime })
    }

    /// The tables below a URL that ends with `/`. A column that a file of an older version lacks is null.
    fn with_tables(self, root: &str) -> anyhow::Result<Self> {
        for table in TABLES {
            let options = ListingOptions::new(Arc::new(ParquetFormat::default()))
                .with_file_extension(".parquet")
                .with_table_partition_cols(vec![(MONTH.to_owned(), DataType::Utf8)]);
            let url = format!("{root}{}/", table.name);
            let registered = self.context.register_listing_table(
                table.name,
                url,
                options,
                Some(schema(table)),
                None,
            );
            self.runtime
                .block_on(registered)
                .map_err(|error| anyhow!("table {}: {}", table.name, sentence(&error)))?;
        }
        Ok(self)
    }

    fn with_views(self) -> anyhow::Result<Self> {
        for view in VIEWS {
            let made = self.runtime.block_on(self.context.sql(&view.statement()));
            made.map_err(|error| anyhow!("view {}: {}", view.name, sentence(&error)))?;
        }
        Ok(self)
    }

    /// The answer to a question: one statement that reads.
    ///
    /// # Errors
    /// The statement cannot be understood, or would write.
    pub fn ask(&self, statement: &str) -> anyhow::Result<Answer<'_>> {
        let reads = SQLOptions::new()
            .with_allow_ddl(false)
            .with_allow_dml(false)
            .with_allow_statements(false);
        let asked = async {
            let frame = self.context.sql_with_options(statement, reads).await?;
            frame.execute_stream().await
        };
        let stream = self
            .runtime
            .block_on(asked)
            .map_err(|error| anyhow!(sentence(&error)))?;
        Ok(Answer {
            engine: self,
            stream,
        })
    }
}

impl Answer<'_> {
    /// Its columns.
    pub fn schema(&self) -> SchemaRef {
        self.stream.schema()
    }
}

impl Iterator for Answer<'_> {
    type Item = anyhow::Result<RecordBatch>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = self.engine.runtime.block_on(self.stream.next())?;
        Some(next.map_err(|error| anyhow!(sentence(&error))))
    }
}

/// What is wrong, as one sentence without the layers that passed it on.
fn sentence(error: &DataFusionError) -> String {
    use datafusion::sql::sqlparser::parser::ParserError;
    let text = match error.find_root() {
        DataFusionError::SQL(error, _) => match error.as_ref() {
            ParserError::ParserError(text) | ParserError::TokenizerError(text) => text.clone(),
            ParserError::RecursionLimitExceeded => "the statement is nested too deeply".to_owned(),
        },
        DataFusionError::Plan(text) if text.starts_with("table '") => {
            let names: Vec<&str> = TABLES
                .iter()
                .map(|table| table.name)
                .chain(VIEWS.iter().map(|view| view.name))
                .collect();
            format!(
                "{}; there are {}",
                text.replace("datafusion.public.", ""),
                names.join(", ")
            )
        }
        DataFusionError::Plan(text) | DataFusionError::Execution(text) => text.clone(),
        DataFusionError::External(error) => error.to_string(),
        other => other.strip_backtrace(),
    };
    let line: Vec<&str> = text.split_whitespace().collect();
    line.join(" ")
}

#[cfg(test)]
mod tests;
