//! Shows a render in a window of another program while it goes on, by the protocol of the
//! viewer tev.
//!
//! A thread of its own sends the pictures, so that a server that is slow, absent or gone never
//! holds up the render: at most one picture waits, and while it does, no other is made.

mod packet;

use crate::terminal::note;
use glam::UVec2;
use organza_film::Film;
use rayon::prelude::*;
use std::io::Write;
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time that a server has to answer the first call.
const CONNECT: Duration = Duration::from_secs(5);

/// Time that a server has for the last picture when the render is done.
const LAST_PICTURE: Duration = Duration::from_secs(3);

/// Length of a picture's part that is sent at a time, bytes.
const PART_BYTES: usize = 1 << 20;

/// Where a server listens, as `HOST:PORT`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address(String);

impl Address {
    /// Reads `HOST:PORT`; an IPv6 address stands in brackets.
    ///
    /// # Errors
    /// Says what was expected.
    pub fn parse(text: &str) -> Result<Address, String> {
        let parts = text.rsplit_once(':');
        let is_host = |host: &str| match host.strip_prefix('[') {
            Some(rest) => rest.ends_with(']'),
            None => !host.is_empty() && !host.contains([':', '/', ' ']),
        };
        match parts {
            Some((host, port)) if is_host(host) && port.parse::<u16>().is_ok_and(|p| p > 0) => {
                Ok(Address(text.to_owned()))
            }
            _ => Err("expected HOST:PORT such as 127.0.0.1:14158".into()),
        }
    }
}

/// Memory that showing a picture takes, bytes: one that waits, and one that is sent.
pub fn memory_bytes(size: UVec2) -> u64 {
    2 * 12 * u64::from(size.x) * u64::from(size.y)
}

/// A picture that is to be shown: red, green and blue of every pixel, in rows from the top.
type Picture = Vec<[f32; 3]>;

/// What the render and the sending thread share.
#[derive(Default)]
struct Desk {
    waiting: Option<Picture>,
    /// No more pictures will come.
    is_done: bool,
    /// The server was too slow in the end.
    is_given_up: bool,
    /// The thread sends no more.
    is_closed: bool,
    /// To interrupt a server that is too slow in the end.
    stream: Option<TcpStream>,
}

#[derive(Default)]
struct Shared {
    desk: Mutex<Desk>,
    changed: Condvar,
}

impl Shared {
    fn desk(&self) -> MutexGuard<'_, Desk> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A display server that a render is shown on.
pub struct DisplayServer {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    address: Address,
    quiet: bool,
}

impl DisplayServer {
    /// Begins to show pictures of a size under a name. A server that does not answer is a
    /// warning, unless `quiet`.
    pub fn start(address: &Address, name: &str, size: UVec2, quiet: bool) -> DisplayServer {
        let shared = Arc::new(Shared::default());
        let sender = Sender {
            shared: shared.clone(),
            name: name.to_owned(),
            size,
        };
        let to = address.clone();
        let thread = std::thread::spawn(move || {
            if let Err(e) = sender.run(&to)
                && !sender.shared.desk().is_given_up
                && !quiet
            {
                note!(
                    "organza: warning: display server {}: {e}; the picture is rendered without it",
                    to.0
                );
            }
            sender.shared.desk().is_closed = true;
            sender.shared.changed.notify_all();
        });
        DisplayServer {
            shared,
            thread: Some(thread),
            address: address.clone(),
            quiet,
        }
    }

    /// Shows what a film holds so far, unless an earlier picture still waits.
    pub fn show(&self, film: &Film) {
        let is_free = {
            let desk = self.shared.desk();
            desk.waiting.is_none() && !desk.is_closed
        };
        if is_free {
            self.put(film);
        }
    }

    fn put(&self, film: &Film) {
        let pixels = film.pixels().par_iter();
        let picture = pixels.map(|p| p.mean().0.to_array()).collect();
        self.shared.desk().waiting = Some(picture);
        self.shared.changed.notify_all();
    }

    /// Shows the whole film in place of a picture that still waits, and gives the server a
    /// little time to take it.
    pub fn finish(mut self, film: &Film) {
        if !self.shared.desk().is_closed {
            self.put(film);
        }
        let mut desk = self.shared.desk();
        desk.is_done = true;
        self.shared.changed.notify_all();
        let end = Instant::now() + LAST_PICTURE;
        while !desk.is_closed {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            let waited = self.shared.changed.wait_timeout(desk, left);
            desk = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        if desk.is_closed {
            drop(desk);
            if let Some(thread) = self.thread.take() {
                let _ = thread.join();
            }
            return;
        }
        // The thread may sit in a call that only the end of the connection ends, or in the
        // first call, which ends by itself.
        desk.is_given_up = true;
        if let Some(stream) = desk.stream.take() {
            let _ = stream.shutdown(Shutdown::Both);
        }
        drop(desk);
        if !self.quiet {
            note!(
                "organza: warning: display server {}: it has not taken the last picture",
                self.address.0
            );
        }
    }
}

/// The sending thread.
struct Sender {
    shared: Arc<Shared>,
    name: String,
    size: UVec2,
}

impl Sender {
    fn run(&self, address: &Address) -> std::io::Result<()> {
        let mut stream = connect(address)?;
        self.shared.desk().stream = stream.try_clone().ok();
        stream.write_all(&packet::create_image(&self.name, self.size))?;
        let mut packet = Vec::new();
        while let Some(picture) = self.next() {
            let rows = (PART_BYTES / (12 * self.size.x.max(1) as usize)).max(1);
            let width = self.size.x as usize;
            for (part, pixels) in picture.chunks((rows * width).max(1)).enumerate() {
                let first_row = (part * rows) as u32;
                packet::update_image(&self.name, first_row, self.size.x, pixels, &mut packet);
                stream.write_all(&packet)?;
            }
        }
        stream.flush()
    }

    /// Waits for the next picture; `None` after the last one.
    fn next(&self) -> Option<Picture> {
        let mut desk = self.shared.desk();
        loop {
            if let Some(picture) = desk.waiting.take() {
                return Some(picture);
            }
            if desk.is_done {
                return None;
            }
            let changed = self.shared.changed.wait(desk);
            desk = changed.unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// A connection to the first of the host's addresses that answers.
fn connect(address: &Address) -> std::io::Result<TcpStream> {
    let mut failed = std::io::Error::other("the host has no address");
    for address in address.0.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT) {
            Ok(stream) => return Ok(stream),
            Err(e) => failed = e,
        }
    }
    Err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_a_host_and_a_port() {
        for right in ["127.0.0.1:14158", "localhost:1", "[::1]:14158"] {
            assert_eq!(Address::parse(right), Ok(Address(right.into())));
        }
        for wrong in [
            "",
            "localhost",
            ":14158",
            "a:0",
            "a:70000",
            "::1:14158",
            "http://a:1",
        ] {
            let words = Address::parse(wrong).unwrap_err();
            assert!(words.contains("HOST:PORT"), "{wrong}");
        }
    }
}
