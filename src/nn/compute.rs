//! With which instructions and on how many threads a network computes.

use std::ops::Range;
use std::sync::Mutex;

use super::simd::Isa;
use super::threads::{Threads, part};

/// Passed to everything that computes. Results are the same bits for any number of threads.
#[derive(Debug)]
pub struct Compute {
    isa: Isa,
    threads: Threads,
}

impl Compute {
    /// The widest instructions of this machine, on `threads` threads (one at least).
    pub fn new(threads: usize) -> Self {
        let isa = Isa::available().next().unwrap_or(Isa::Portable);
        Self { isa, threads: Threads::new(threads) }
    }

    /// Chosen instructions; `None` if this machine lacks them.
    pub fn with_isa(isa: Isa, threads: usize) -> Option<Self> {
        isa.is_available().then(|| Self { isa, threads: Threads::new(threads) })
    }

    /// The instructions in use.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// The threads in use.
    pub fn threads(&mut self) -> &mut Threads {
        &mut self.threads
    }

    /// Does two independent things, at the same time if there are two threads; each gets a `Compute` of one
    /// thread. Meant for work of some size, such as twin critics.
    pub fn join<A: Send, B: Send>(
        &mut self,
        a: impl FnOnce(&mut Compute) -> A + Send,
        b: impl FnOnce(&mut Compute) -> B + Send,
    ) -> (A, B) {
        let isa = self.isa;
        let single = || Compute { isa, threads: Threads::new(1) };
        if self.threads.count() == 1 {
            return (a(&mut single()), b(&mut single()));
        }
        let (first, second) = (Slot::new(a), Slot::new(b));
        self.threads.run(&|index| match index {
            0 => first.fill(|work| work(&mut single())),
            1 => second.fill(|work| work(&mut single())),
            _ => {}
        });
        (first.into_result(), second.into_result())
    }

    /// Calls `work` with ranges that together cover `0..total`, cut at multiples of `grain`, at the same time
    /// if there are several threads and `operations` of arithmetic make it worth their while.
    pub(crate) fn split(
        &mut self,
        total: usize,
        grain: usize,
        operations: usize,
        work: &(dyn Fn(Range<usize>) + Sync),
    ) {
        let parts = self.threads.count();
        if parts == 1 || operations < WORTH_SPLITTING || total <= grain {
            return work(0..total);
        }
        self.threads.run(&|index| {
            let range = part(total, grain, parts, index);
            if !range.is_empty() {
                work(range);
            }
        });
    }
}

/// Multiply-adds below which a fork costs more than it saves: a few microseconds of one core.
const WORTH_SPLITTING: usize = 100_000;

/// A closure to be run once on another thread, then its result.
struct Slot<F, R>(Mutex<(Option<F>, Option<R>)>);

impl<F, R> Slot<F, R> {
    fn new(work: F) -> Self {
        Self(Mutex::new((Some(work), None)))
    }

    fn fill(&self, run: impl FnOnce(F) -> R) {
        let work = self.0.lock().expect("locked once only").0.take();
        if let Some(work) = work {
            let result = run(work);
            self.0.lock().expect("locked once only").1 = Some(result);
        }
    }

    fn into_result(self) -> R {
        self.0.into_inner().expect("not poisoned: a panic was passed on before").1.expect("filled by `run`")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn join_returns_both_results() {
        for threads in 1..=3 {
            let mut compute = Compute::new(threads);
            let (a, b) = compute.join(|c| c.threads().count(), |_| "two");
            assert_eq!((a, b), (1, "two"));
        }
    }

    #[test]
    fn small_work_is_not_split() {
        let mut compute = Compute::new(2);
        let calls = Mutex::new(Vec::new());
        compute.split(32, 8, 10, &|range| calls.lock().unwrap().push(range));
        compute.split(32, 8, 10_000_000, &|range| calls.lock().unwrap().push(range));
        let mut calls = calls.into_inner().unwrap();
        calls[1..].sort_by_key(|range| range.start);
        assert_eq!(calls, [0..32, 0..16, 16..32]);
    }
}
