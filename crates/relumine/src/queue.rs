//! Positions waiting to be done, a batch side by side at a time, handed out in their order.

use std::collections::VecDeque;

use rayon::prelude::*;

use crate::{Error, PositionOutcome};

/// What is waiting and what is ready.
#[derive(Default)]
pub(crate) struct Queue {
    together: usize,
    waiting: VecDeque<usize>,
    ready: VecDeque<PositionOutcome>,
    failed: bool,
}

impl Queue {
    /// Positions to be done, at most `together` of them at once.
    pub(crate) fn new(waiting: VecDeque<usize>, together: usize) -> Self {
        Self { together, waiting, ..Self::default() }
    }

    /// Whether nothing waits and nothing is ready.
    pub(crate) fn is_empty(&self) -> bool {
        self.waiting.is_empty() && self.ready.is_empty()
    }

    /// The next position that is done; after a failure nothing more is begun.
    pub(crate) fn next(
        &mut self,
        job: impl Fn(usize) -> Result<PositionOutcome, Error> + Send + Sync,
    ) -> Option<Result<PositionOutcome, Error>> {
        if self.ready.is_empty() && !self.failed {
            let batch: Vec<usize> = self.waiting.drain(..self.together.min(self.waiting.len())).collect();
            let done: Vec<_> = batch.into_par_iter().map(job).collect();
            for outcome in done {
                match outcome {
                    Ok(outcome) => self.ready.push_back(outcome),
                    Err(error) => {
                        self.failed = true;
                        return Some(Err(error));
                    }
                }
            }
        }
        self.ready.pop_front().map(Ok)
    }
}
