//! Long vectors for the minimiser, processed by all threads.

use argmin_math::{
    ArgminAdd, ArgminDot, ArgminL1Norm, ArgminL2Norm, ArgminMinMax, ArgminMul, ArgminSignum,
    ArgminSub, ArgminZeroLike,
};
use rayon::prelude::*;

/// Numbers per task.
const CHUNK: usize = 1 << 16;

/// The heights of all yarns, or a direction among them.
#[derive(Clone, Debug, Default)]
pub(super) struct Heights(pub Vec<f64>);

impl Heights {
    fn map(&self, f: impl Fn(f64) -> f64 + Sync) -> Heights {
        let own = self.0.par_iter().with_min_len(CHUNK);
        Heights(own.map(|&a| f(a)).collect())
    }

    fn zip(&self, other: &Heights, f: impl Fn(f64, f64) -> f64 + Sync) -> Heights {
        let both = self.0.par_iter().with_min_len(CHUNK).zip(&other.0);
        Heights(both.map(|(&a, &b)| f(a, b)).collect())
    }

    /// Chunks are of fixed size and added in order: the sum does not depend on
    /// the number of threads.
    fn dot(&self, other: &Heights) -> f64 {
        let chunks = self.0.par_chunks(CHUNK).zip(other.0.par_chunks(CHUNK));
        let sums: Vec<f64> = chunks
            .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a * b).sum())
            .collect();
        sums.iter().sum()
    }
}

impl ArgminDot<Heights, f64> for Heights {
    fn dot(&self, other: &Heights) -> f64 {
        self.dot(other)
    }
}

impl ArgminL2Norm<f64> for Heights {
    fn l2_norm(&self) -> f64 {
        self.dot(self).sqrt()
    }
}

impl ArgminAdd<Heights, Heights> for Heights {
    fn add(&self, other: &Heights) -> Heights {
        self.zip(other, |a, b| a + b)
    }
}

impl ArgminSub<Heights, Heights> for Heights {
    fn sub(&self, other: &Heights) -> Heights {
        self.zip(other, |a, b| a - b)
    }
}

impl ArgminMul<f64, Heights> for Heights {
    fn mul(&self, factor: &f64) -> Heights {
        self.map(|a| factor * a)
    }
}

impl ArgminMul<Heights, Heights> for f64 {
    fn mul(&self, heights: &Heights) -> Heights {
        heights.map(|a| self * a)
    }
}

// The minimiser's variant with an L1 penalty requires the rest.

impl ArgminAdd<f64, Heights> for Heights {
    fn add(&self, term: &f64) -> Heights {
        self.map(|a| a + term)
    }
}

impl ArgminSub<f64, Heights> for Heights {
    fn sub(&self, term: &f64) -> Heights {
        self.map(|a| a - term)
    }
}

impl ArgminMul<Heights, Heights> for Heights {
    fn mul(&self, other: &Heights) -> Heights {
        self.zip(other, |a, b| a * b)
    }
}

impl ArgminL1Norm<f64> for Heights {
    fn l1_norm(&self) -> f64 {
        self.0.iter().map(|a| a.abs()).sum()
    }
}

impl ArgminSignum for Heights {
    fn signum(self) -> Heights {
        self.map(f64::signum)
    }
}

impl ArgminZeroLike for Heights {
    fn zero_like(&self) -> Heights {
        Heights(vec![0.0; self.0.len()])
    }
}

impl ArgminMinMax for Heights {
    fn min(a: &Heights, b: &Heights) -> Heights {
        a.zip(b, f64::min)
    }

    fn max(a: &Heights, b: &Heights) -> Heights {
        a.zip(b, f64::max)
    }
}
