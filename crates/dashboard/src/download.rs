//! A file as the body of an answer, read as the client takes it.

use std::io;
use std::path::Path;

use futures::stream::try_unfold;
use hyper::body::Bytes;
use tokio::fs::File;
use tokio::io::AsyncReadExt;

use crate::server::{Body, streamed};

/// Bytes read at once: all that a download holds in memory.
const BLOCK: usize = 64 * 1024;

/// Length and content of a file as it is now; a file that grows is given up to this length.
pub(crate) async fn body(path: &Path) -> io::Result<(u64, Body)> {
    let file = File::open(path).await?;
    let length = file.metadata().await?.len();
    let blocks = try_unfold((file, length), |(mut file, left)| async move {
        let mut block = vec![0; BLOCK.min(left as usize)];
        let read = file.read(&mut block).await?;
        if read == 0 {
            return Ok::<_, io::Error>(None);
        }
        block.truncate(read);
        Ok(Some((Bytes::from(block), (file, left - read as u64))))
    });
    Ok((length, streamed(blocks)))
}
