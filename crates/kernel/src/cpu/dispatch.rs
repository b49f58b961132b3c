//! Entering the code of a back end.

use super::Backend;
use super::lanes::{Floats, one};
use crate::voxels::fibres::Fibres;
use crate::voxels::flakes::Mirrors;
use crate::voxels::walk;
use crate::{Block, Kernel};
use organza_film::Stats;

/// Walks through what there is.
#[inline(always)]
fn by_matter<F: Floats>(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
    if kernel.medium.is_of_fibres {
        walk::walk::<F, Fibres<F>>(kernel, block)
    } else {
        walk::walk::<F, Mirrors<F>>(kernel, block)
    }
}

/// Walks with the kernel's back end: the one place where code for instructions
/// that a processor may lack is entered, after [`Kernel::new`] has asked it.
#[allow(unsafe_code)]
pub fn dispatch(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
    #[cfg(target_arch = "x86_64")]
    {
        use super::lanes::Two;
        use super::vector;

        #[target_feature(
            enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi1,bmi2,popcnt,lzcnt"
        )]
        fn avx512(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
            by_matter::<Two<vector::avx512::F>>(kernel, block)
        }

        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        fn avx2(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
            by_matter::<Two<vector::avx2::F>>(kernel, block)
        }

        /// One lane, where fused products need no function call.
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        fn fused(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
            by_matter::<one::F>(kernel, block)
        }

        match kernel.backend {
            Backend::Avx512 => return unsafe { avx512(kernel, block) },
            Backend::Avx2 => return unsafe { avx2(kernel, block) },
            Backend::Scalar if Backend::Avx2.is_available() => {
                return unsafe { fused(kernel, block) };
            }
            Backend::Scalar => {}
        }
    }
    by_matter::<one::F>(kernel, block)
}

/// Something to do with the lanes of a back end.
pub trait Job {
    /// What comes of it.
    type Output;
    /// Does it.
    fn run<F: Floats>(self) -> Self::Output;
}

/// Does a job with one vector of sixteen lanes, or two of eight, or one lane. The
/// processor must have been asked for the back end.
#[allow(unsafe_code)]
pub fn dispatch_sixteen<J: Job>(backend: Backend, job: J) -> J::Output {
    assert!(backend.is_available(), "{backend:?} is not available");
    #[cfg(target_arch = "x86_64")]
    {
        use super::lanes::Two;
        use super::vector;

        #[target_feature(
            enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi1,bmi2,popcnt,lzcnt"
        )]
        fn avx512<J: Job>(job: J) -> J::Output {
            job.run::<vector::avx512::F>()
        }

        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        fn avx2<J: Job>(job: J) -> J::Output {
            job.run::<Two<vector::avx2::F>>()
        }

        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        fn fused<J: Job>(job: J) -> J::Output {
            job.run::<one::F>()
        }

        match backend {
            Backend::Avx512 => return unsafe { avx512(job) },
            Backend::Avx2 => return unsafe { avx2(job) },
            Backend::Scalar if Backend::Avx2.is_available() => {
                return unsafe { fused(job) };
            }
            Backend::Scalar => {}
        }
    }
    job.run::<one::F>()
}
