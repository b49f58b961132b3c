//! A request together with the context that it runs in.

use crate::context::Context;
use crate::error::Error;
use std::ops::Deref;

/// What the parts of a request's work pass on; its fields are those of the request.
#[derive(Clone, Debug)]
pub struct Job<R> {
    /// The request.
    pub request: R,
    /// The context.
    pub context: Context,
}

impl<R: Clone + Send + Sync> Job<R> {
    /// Runs work on a request, on the threads of the context.
    ///
    /// # Errors
    /// Those of the work.
    pub fn run<T: Send>(
        request: &R,
        context: &Context,
        work: impl FnOnce(&Job<R>) -> anyhow::Result<T> + Send,
    ) -> Result<T, Error> {
        let job = Job {
            request: request.clone(),
            context: context.clone(),
        };
        context.run(|| work(&job))
    }
}

impl<R> Deref for Job<R> {
    type Target = R;

    fn deref(&self) -> &R {
        &self.request
    }
}
