//! The yarn of one thread as it was spun.

use crate::evenness::{Profile, thread_mass};
use crate::yarn::Yarn;
use organza_basis::PathRng;
use std::sync::Arc;

/// Family of the random numbers of a thread's mass.
const SPINNING: u64 = 4 << 40;

/// A yarn with the mass of one thread, which uneven yarn shares with no other.
#[derive(Clone, Debug)]
pub(super) struct Spun {
    pub yarn: Arc<Yarn>,
    /// Mass along the thread; `None` if it is even.
    pub profile: Option<Arc<Profile>>,
}

impl Spun {
    /// The yarn as it is, whatever its unevenness.
    pub fn even(yarn: &Arc<Yarn>) -> Spun {
        Spun {
            yarn: yarn.clone(),
            profile: None,
        }
    }

    /// The yarn of thread `batch`, whose period has about the given length.
    pub fn new(yarn: &Arc<Yarn>, length_mm: f64, seed: u64, batch: usize) -> Spun {
        if yarn.evenness.is_none() && yarn.slubs.is_none() {
            return Spun::even(yarn);
        }
        let mut rng = PathRng::new(seed, batch as u64, SPINNING);
        let mass = thread_mass(yarn, length_mm, &mut rng);
        let profile = Profile::new(yarn, length_mm, &mut rng);
        Spun {
            yarn: Arc::new(yarn.with_mass(mass)),
            profile: profile.map(Arc::new),
        }
    }

    /// The threads of a system, which begin with batch `first`.
    pub fn system(
        yarns: &[Arc<Yarn>],
        of_thread: impl Iterator<Item = usize>,
        length_mm: f64,
        seed: u64,
        first: usize,
    ) -> Vec<Spun> {
        of_thread
            .enumerate()
            .map(|(i, yarn)| Spun::new(&yarns[yarn], length_mm, seed, first + i))
            .collect()
    }
}
