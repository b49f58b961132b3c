//! Entering the code of a back end: the one place where code for instructions that a
//! processor may lack is entered.

use super::backend::Backend;
use super::lanes::Floats;
#[cfg(target_arch = "x86_64")]
use super::lanes::Two;
use super::one;
#[cfg(target_arch = "x86_64")]
use super::vector;

/// Something to do with the lanes of a back end.
pub trait Job {
    /// What comes of it.
    type Output;
    /// Does it.
    fn run<F: Floats>(self) -> Self::Output;
}

/// A function that does a job in the code of a back end, with vectors made from its own.
macro_rules! dispatch {
    ($(#[$doc:meta])* $name:ident, $avx512:ty, $avx2:ty) => {
        $(#[$doc])*
        #[allow(unsafe_code)]
        pub fn $name<J: Job>(backend: Backend, job: J) -> J::Output {
            assert!(backend.is_available(), "{backend:?} is not available");
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(
                    enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi1,bmi2,popcnt,lzcnt"
                )]
                fn avx512<J: Job>(job: J) -> J::Output {
                    job.run::<$avx512>()
                }

                #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
                fn avx2<J: Job>(job: J) -> J::Output {
                    job.run::<$avx2>()
                }

                match backend {
                    Backend::Avx512 => return unsafe { avx512(job) },
                    Backend::Avx2 => return unsafe { avx2(job) },
                    Backend::Scalar => {}
                }
            }
            dispatch_one(job)
        }
    };
}

dispatch! {
    /// Does a job with two vectors of the back end, or one lane: the most paths at once.
    /// The processor must have been asked for the back end.
    dispatch_widest, Two<vector::avx512::F>, Two<vector::avx2::F>
}

dispatch! {
    /// Does a job with one vector of sixteen lanes, or two of eight, or one lane. The
    /// processor must have been asked for the back end.
    dispatch_sixteen, vector::avx512::F, Two<vector::avx2::F>
}

/// Does a job with one lane.
#[allow(unsafe_code)]
fn dispatch_one<J: Job>(job: J) -> J::Output {
    #[cfg(target_arch = "x86_64")]
    {
        /// One lane, where fused products need no function call.
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        fn fused<J: Job>(job: J) -> J::Output {
            job.run::<one::F>()
        }

        if Backend::Avx2.is_available() {
            return unsafe { fused(job) };
        }
    }
    job.run::<one::F>()
}
