//! The connections that the server has at a time.
//!
//! One that has sent a request of this session keeps its seat until it ends. Of the others the
//! oldest gives its seat to a new one when all are taken: a browser sends its request at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::Notify;

/// Connections at a time; others wait to be taken.
const MAX_CONNECTIONS: usize = 64;

/// The seats, in the order in which they were taken.
#[derive(Default)]
pub(crate) struct Seats {
    taken: Mutex<Vec<Arc<State>>>,
    /// A seat was left, or its connection may keep it no longer.
    left: Notify,
}

#[derive(Default)]
struct State {
    is_kept: AtomicBool,
    taken_away: Notify,
}

/// The seat of a connection, which is left when this is dropped.
pub(crate) struct Seat {
    seats: Arc<Seats>,
    state: Arc<State>,
}

impl Seats {
    fn list(&self) -> std::sync::MutexGuard<'_, Vec<Arc<State>>> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn has_room(&self) -> bool {
        let list = self.list();
        list.len() < MAX_CONNECTIONS || list.iter().any(|s| !s.is_kept.load(Ordering::Relaxed))
    }

    /// Waits until a connection can be taken.
    pub async fn wait(&self) {
        while !self.has_room() {
            self.left.notified().await;
        }
    }

    /// A seat; where all are taken, that of the oldest connection without a request of this
    /// session.
    pub fn take(self: &Arc<Seats>) -> Seat {
        let state = Arc::<State>::default();
        let mut list = self.list();
        if list.len() >= MAX_CONNECTIONS
            && let Some(oldest) = list.iter().position(|s| !s.is_kept.load(Ordering::Relaxed))
        {
            list.remove(oldest).taken_away.notify_one();
        }
        list.push(Arc::clone(&state));
        Seat {
            seats: Arc::clone(self),
            state,
        }
    }
}

impl Seat {
    /// Keeps the seat for the connection until it ends.
    pub(crate) fn keep(&self) {
        self.state.is_kept.store(true, Ordering::Relaxed);
    }

    /// Waits until another connection has the seat.
    pub(crate) async fn is_taken_away(&self) {
        self.state.taken_away.notified().await;
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        let mut list = self.seats.list();
        list.retain(|s| !Arc::ptr_eq(s, &self.state));
        drop(list);
        self.seats.left.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_without_a_request_gives_its_seat() {
        let seats = Arc::new(Seats::default());
        let all: Vec<Seat> = (0..MAX_CONNECTIONS).map(|_| seats.take()).collect();
        all[0].keep();
        let next = seats.take();
        let is_there = |seat: &Seat| seats.list().iter().any(|s| Arc::ptr_eq(s, &seat.state));
        assert!(is_there(&all[0]) && !is_there(&all[1]) && is_there(&all[2]) && is_there(&next));
        for seat in &all[2..] {
            seat.keep();
        }
        next.keep();
        assert!(!seats.has_room());
        drop(next);
        assert!(seats.has_room());
    }
}
