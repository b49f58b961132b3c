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
