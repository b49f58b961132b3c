//! The server: connections on the loopback interface, bounded in number, size and time.

use crate::patient::Patient;
use crate::requests::Answering;
use crate::seats::{Seat, Seats};
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use std::convert::Infallible;
use std::future::{Future, poll_fn};
use std::net::{Ipv4Addr, TcpListener};
use std::pin::pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};

/// Bytes of the head of a request, and its headers, at most.
const MAX_HEAD_BYTES: usize = 16 << 10;
const MAX_HEADERS: usize = 64;
/// Between two looks at whether the session is over.
const LOOK: Duration = Duration::from_millis(100);

/// How long a connection may keep the server waiting.
#[derive(Clone, Copy, Debug)]
pub struct Waits {
    /// For the whole head of a request, from the end of the one before.
    pub head: Duration,
    /// For a client to take the next bytes of an answer.
    pub write: Duration,
    /// Altogether.
    pub connection: Duration,
}

impl Default for Waits {
    fn default() -> Waits {
        Waits {
            head: Duration::from_secs(10),
            write: Duration::from_secs(20),
            connection: Duration::from_secs(600),
        }
    }
}

/// A listener on a port of the loopback interface; on any that is free for 0.
///
/// # Errors
/// The port is taken, or may not be used.
pub fn listen(port: u16) -> std::io::Result<TcpListener> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

/// Serves until `is_over`.
///
/// # Errors
/// The system has no resources for it.
pub fn serve(
    listener: TcpListener,
    answering: Answering,
    waits: Waits,
    is_over: &dyn Fn() -> bool,
) -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .max_blocking_threads(2)
        .build()?;
    runtime.block_on(async {
        let listener = tokio::net::TcpListener::from_std(listener)?;
        let answering = Arc::new(answering);
        let seats = Arc::new(Seats::default());
        while !is_over() {
            let next = async {
                seats.wait().await;
                listener.accept().await
            };
            let Ok(accepted) = tokio::time::timeout(LOOK, next).await else {
                continue;
            };
            let Ok((stream, _)) = accepted else {
                // Out of descriptors, most likely: others have to end first.
                tokio::time::sleep(LOOK).await;
                continue;
            };
            let _ = stream.set_nodelay(true);
            let (answering, seat) = (Arc::clone(&answering), seats.take());
            tokio::spawn(async move {
                let mut taken_away = pin!(seat.is_taken_away());
                let mut talk = pin!(converse(stream, &answering, waits, Some(&seat)));
                let either = |context: &mut Context<'_>| match taken_away.as_mut().poll(context) {
                    Poll::Ready(()) => Poll::Ready(()),
                    Poll::Pending => talk.as_mut().poll(context),
                };
                poll_fn(either).await;
            });
        }
        std::io::Result::Ok(())
    })?;
    // A draft that is being woven is nobody's any more.
    runtime.shutdown_background();
    Ok(())
}

/// Answers the requests of one connection until it ends, breaks off or takes too long.
pub(crate) async fn converse<S>(
    stream: S,
    answering: &Arc<Answering>,
    waits: Waits,
    seat: Option<&Seat>,
) where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let service = service_fn(|request: Request<Incoming>| {
        if let Some(seat) = seat.filter(|_| answering.is_own(&request)) {
            seat.keep();
        }
        let answering = Arc::clone(answering);
        async move { Ok::<_, Infallible>(answering.answer(request).await) }
    });
    let stream = TokioIo::new(Patient::new(stream, waits.write));
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(waits.head)
        // A client that has said all may still listen.
        .half_close(true)
        .max_headers(MAX_HEADERS)
        .max_buf_size(MAX_HEAD_BYTES)
        .serve_connection(stream, service);
    // What goes wrong on a connection is the other side's affair.
    let _ = tokio::time::timeout(waits.connection, connection).await;
}
