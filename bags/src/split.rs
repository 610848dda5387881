//! One `.mcap` file being written.
//!
//! Chunks are built in memory and appended whole, so a file that ends anywhere holds every chunk closed before.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Compression, WriteOptions, Writer};
use sha2::{Digest, Sha256};

use crate::channel::Channel;
use crate::disk::{Disk, Place, Stream};
use crate::error::Error;
use crate::metadata::FileInformation;
use crate::seal::{Digested, hexadecimal};

/// Name of this program in the header of the files that it writes.
pub(crate) const LIBRARY: &str = "probecell";

/// A file that counts what was written to it.
struct CountingFile {
    file: BufWriter<Stream>,
    written: Arc<AtomicU64>,
    digest: Arc<Mutex<Option<Sha256>>>,
}

impl Write for CountingFile {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        let count = self.file.write(buffer)?;
        self.written.fetch_add(count as u64, Ordering::Relaxed);
        let mut digest = self.digest.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(digest) = digest.as_mut() {
            digest.update(&buffer[..count]);
        }
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// How chunks are made.
#[derive(Debug, Clone)]
pub(crate) struct ChunkOptions {
    pub(crate) bytes: u64,
    pub(crate) zstd: bool,
    pub(crate) zstd_level: u32,
    pub(crate) data_crc: bool,
}

/// MCAP options of every file this crate writes: profile `ros2`, indexed, chunk CRCs, compressed on the calling thread.
pub(crate) fn write_options(chunks: &ChunkOptions) -> WriteOptions {
    WriteOptions::new()
        .profile("ros2")
        .library(format!("{LIBRARY} {}", env!("CARGO_PKG_VERSION")))
        .compression(chunks.zstd.then_some(Compression::Zstd))
        .compression_level(chunks.zstd_level)
        .compression_threads(0)
        .chunk_size(Some(chunks.bytes))
        .calculate_data_section_crc(chunks.data_crc)
        .disable_seeking(true)
}

pub(crate) struct SplitFile {
    writer: Writer<NoSeek<CountingFile>>,
    file: Stream,
    written: Arc<AtomicU64>,
    /// Of everything written so far, where the recording is sealed.
    digest: Arc<Mutex<Option<Sha256>>>,
    path: PathBuf,
    /// MCAP channel id of each of the recorder's channels already named in this file.
    ids: Vec<Option<u16>>,
    pub(crate) information: FileInformation,
}

impl SplitFile {
    /// Creates the file; `digested`: its digest is asked for.
    pub(crate) fn create(
        disk: &dyn Disk,
        path: &Path,
        chunks: &ChunkOptions,
        digested: bool,
    ) -> Result<Self, Error> {
        let failed = |source| Error::io("create the recording", path, source);
        let file = Stream::new(disk.create(path, true).map_err(failed)?);
        let written = Arc::new(AtomicU64::new(0));
        let digest = Arc::new(Mutex::new(digested.then(Sha256::new)));
        let counting = CountingFile {
            file: BufWriter::with_capacity(1 << 16, file.clone()),
            written: Arc::clone(&written),
            digest: Arc::clone(&digest),
        };
        let writer = write_options(chunks)
            .create(NoSeek::new(counting))
            .map_err(|source| Error::mcap(path, source))?;
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        Ok(Self {
            writer,
            file,
            written,
            digest,
            path: path.to_owned(),
            ids: Vec::new(),
            information: FileInformation {
                path: name,
                bounds: None,
                message_count: 0,
            },
        })
    }

    /// Bytes handed to the operating system or its buffer; an open chunk is not counted.
    pub(crate) fn written(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Length and SHA-256 digest of everything written so far, where they were asked for.
    pub(crate) fn digest(&self) -> Option<Digested> {
        let digest = self.digest.lock().unwrap_or_else(PoisonError::into_inner);
        let digest = digest.clone()?.finalize();
        Some((self.written(), hexadecimal(&digest)))
    }

    /// Number of the channel in this file, naming it first if it is new here.
    fn id(&mut self, index: usize, channel: &Channel) -> Result<u16, Error> {
        if let Some(Some(id)) = self.ids.get(index) {
            return Ok(*id);
        }
        let failed = |source| Error::mcap(&self.path, source);
        let schema = if channel.type_name.is_empty() {
            0
        } else {
            self.writer
                .add_schema(&channel.type_name, "ros2msg", channel.definition.as_bytes())
                .map_err(failed)?
        };
        let id = self
            .writer
            .add_channel(
                schema,
                &channel.topic,
                &channel.message_encoding,
                &channel.mcap_metadata(),
            )
            .map_err(failed)?;
        if self.ids.len() <= index {
            self.ids.resize(index + 1, None);
        }
        self.ids[index] = Some(id);
        Ok(id)
    }

    pub(crate) fn write(
        &mut self,
        index: usize,
        channel: &Channel,
        sequence: u32,
        times: (u64, u64),
        payload: &[u8],
    ) -> Result<(), Error> {
        let id = self.id(index, channel)?;
        self.write_to(id, sequence, times, payload)
    }

    /// Names a channel of another file here, word for word.
    pub(crate) fn copy_channel(&mut self, channel: &mcap::Channel<'_>) -> Result<u16, Error> {
        let failed = |source| Error::mcap(&self.path, source);
        let schema = match &channel.schema {
            Some(schema) => self
                .writer
                .add_schema(&schema.name, &schema.encoding, &schema.data)
                .map_err(failed)?,
            None => 0,
        };
        self.writer
            .add_channel(
                schema,
                &channel.topic,
                &channel.message_encoding,
                &channel.metadata,
            )
            .map_err(failed)
    }

    /// Writes a message; `times` are log and publish time.
    pub(crate) fn write_to(
        &mut self,
        id: u16,
        sequence: u32,
        times: (u64, u64),
        payload: &[u8],
    ) -> Result<(), Error> {
        let (log_time, publish_time) = times;
        let header = MessageHeader {
            channel_id: id,
            sequence,
            log_time,
            publish_time,
        };
        self.writer
            .write_to_known_channel(&header, payload)
            .map_err(|source| Error::mcap(&self.path, source))?;
        let (start, end) = self.information.bounds.unwrap_or((log_time, log_time));
        self.information.bounds = Some((start.min(log_time), end.max(log_time)));
        self.information.message_count += 1;
        Ok(())
    }

    pub(crate) fn attach(
        &mut self,
        time: u64,
        name: &str,
        media_type: &str,
        data: &[u8],
    ) -> Result<(), Error> {
        let attachment = mcap::Attachment {
            log_time: time,
            create_time: time,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: data.into(),
        };
        self.writer
            .attach(&attachment)
            .map_err(|source| Error::mcap(&self.path, source))
    }

    pub(crate) fn metadata(&mut self, metadata: &Metadata) -> Result<(), Error> {
        self.writer
            .write_metadata(metadata)
            .map_err(|source| Error::mcap(&self.path, source))
    }

    /// Whether the file still stands where it was made.
    pub(crate) fn place(&self) -> Result<Place, Error> {
        let place = self.file.file().place(&self.path);
        place.map_err(|source| Error::io("look at the recording", &self.path, source))
    }

    /// Another handle of the file.
    pub(crate) fn stream(&self) -> Stream {
        self.file.clone()
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Closes the chunk and makes everything so far durable.
    pub(crate) fn sync(&mut self) -> Result<(), Error> {
        self.writer
            .flush()
            .map_err(|source| Error::mcap(&self.path, source))?;
        self.file
            .sync()
            .map_err(|source| Error::io("sync the recording", &self.path, source))
    }

    /// Writes summary and footer, durably; gives the digest of the whole, too.
    pub(crate) fn finish(mut self) -> Result<(FileInformation, u64, Option<Digested>), Error> {
        self.writer
            .finish()
            .map_err(|source| Error::mcap(&self.path, source))?;
        let (written, digest) = (self.written(), self.digest());
        // Dropping the stream would hide a failure of its last write.
        let mut stream = self.writer.into_inner().into_inner();
        let failed = |source| Error::io("write the recording", &self.path, source);
        stream.flush().map_err(failed)?;
        self.file.sync().map_err(failed)?;
        Ok((self.information, written, digest))
    }

    /// Gives the file up after a failure: what is on disk stays, nothing more is written.
    pub(crate) fn abandon(self) {
        let stream = self.writer.into_inner().into_inner();
        // Neither summary nor buffered bytes: the device has already refused some.
        drop(stream.file.into_parts());
    }
}
