//! One connection in memory, for tests and fuzzing: the bytes that a client sends, and those
//! of the answers.

use crate::requests::Answering;
use crate::server::{Waits, converse};
use std::io;
use std::sync::Arc;
use tokio::io::{AsyncReadExt, AsyncWriteExt};

/// Bytes that are on their way in each direction at most.
const ROOM: usize = 1 << 16;

/// Sends bytes as one connection, ends it, and returns what was answered.
///
/// # Errors
/// The system has no resources for it.
pub fn talk(answering: &Arc<Answering>, bytes: &[u8]) -> io::Result<Vec<u8>> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let (client, server) = tokio::io::duplex(ROOM);
        let (mut from_server, mut to_server) = tokio::io::split(client);
        let answering = Arc::clone(answering);
        let serving = tokio::spawn(async move {
            converse(server, &answering, Waits::default(), None).await;
        });
        let bytes = bytes.to_vec();
        let sending = tokio::spawn(async move {
            // A server that has heard enough closes the connection.
            let _ = to_server.write_all(&bytes).await;
            let _ = to_server.shutdown().await;
        });
        let mut answers = Vec::new();
        from_server.read_to_end(&mut answers).await?;
        let _ = sending.await;
        let _ = serving.await;
        Ok(answers)
    })
}
