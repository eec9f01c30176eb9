//! A few threads that wait for small pieces of work: fork and join in about a microsecond.
//!
//! A network's products last tens of microseconds, less than it takes to wake a sleeping thread. Workers
//! therefore spin for a while after each piece of work before they park.

use std::cell::UnsafeCell;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::thread::{JoinHandle, Thread};

/// Turns of the spin loop before a worker parks: some tens of microseconds.
const SPINS_BEFORE_PARKING: u32 = 20_000;

/// Turns of the spin loop before the caller, too, offers its core to others while it waits.
const SPINS_BEFORE_YIELDING: u32 = 20_000;

type Work = *const (dyn Fn(usize) + Sync);

struct Shared {
    /// Counts pieces of work; a worker that sees a new number takes the work.
    round: AtomicU32,
    work: UnsafeCell<Option<Work>>,
    unfinished: AtomicUsize,
    panicked: AtomicBool,
    stop: AtomicBool,
    asleep: Vec<AtomicBool>,
}

// SAFETY: `work` is written only by the owner of `Threads` while no worker runs, before it raises `round`, and
// read by workers only after they saw the new `round`. The closure behind it is `Sync`.
unsafe impl Sync for Shared {}
// SAFETY: see above; the pointer is not used beyond `Threads::run`, which waits for all workers.
unsafe impl Send for Shared {}

/// A team of threads: the caller's own and `count - 1` workers that live as long as this value.
pub struct Threads {
    /// What the workers see; `None` if there are none, so that a team of one is free.
    shared: Option<Arc<Shared>>,
    workers: Vec<(Thread, Option<JoinHandle<()>>)>,
}

impl Threads {
    /// A team of `count` threads, at least one.
    pub fn new(count: usize) -> Self {
        let extra = count.max(1) - 1;
        if extra == 0 {
            return Self { shared: None, workers: Vec::new() };
        }
        let shared = Arc::new(Shared {
            round: AtomicU32::new(0),
            work: UnsafeCell::new(None),
            unfinished: AtomicUsize::new(0),
            panicked: AtomicBool::new(false),
            stop: AtomicBool::new(false),
            asleep: (0..extra).map(|_| AtomicBool::new(false)).collect(),
        });
        let workers = (0..extra)
            .map(|index| {
                let shared = Arc::clone(&shared);
                let handle = std::thread::spawn(move || serve(&shared, index));
                (handle.thread().clone(), Some(handle))
            })
            .collect();
        Self { shared: Some(shared), workers }
    }

    /// How many threads there are, the caller's included.
    pub fn count(&self) -> usize {
        self.workers.len() + 1
    }

    /// Calls `work(i)` once for every `i` below [`count`](Self::count), each on its own thread, and returns
    /// when all are done. A panic in any of them is raised again here.
    pub fn run(&mut self, work: &(dyn Fn(usize) + Sync)) {
        let Some(shared) = &self.shared else { return work(0) };
        // SAFETY: only the lifetime is erased; this function does not return, nor unwind, before every worker
        // has finished with the reference.
        let erased: Work = unsafe { std::mem::transmute::<&(dyn Fn(usize) + Sync), Work>(work) };
        // SAFETY: no worker runs: `unfinished` was zero when the last round returned, and `&mut self` keeps
        // other callers out.
        unsafe { *shared.work.get() = Some(erased) };
        shared.unfinished.store(self.workers.len(), Ordering::Relaxed);
        shared.round.fetch_add(1, Ordering::SeqCst);
        for ((thread, _), asleep) in self.workers.iter().zip(&shared.asleep) {
            if asleep.load(Ordering::SeqCst) {
                thread.unpark();
            }
        }
        let own = catch_unwind(AssertUnwindSafe(|| work(0)));
        shared.wait();
        if let Err(panic) = own {
            resume_unwind(panic);
        }
        assert!(!shared.panicked.swap(false, Ordering::Relaxed), "a worker thread panicked");
    }
}

impl Shared {
    /// Returns when every worker has finished.
    fn wait(&self) {
        let mut spins = 0;
        while self.unfinished.load(Ordering::Acquire) > 0 {
            spins += 1;
            if spins < SPINS_BEFORE_YIELDING {
                std::hint::spin_loop();
            } else {
                std::thread::yield_now();
            }
        }
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        let Some(shared) = &self.shared else { return };
        shared.stop.store(true, Ordering::Relaxed);
        shared.round.fetch_add(1, Ordering::SeqCst);
        for (thread, handle) in &mut self.workers {
            thread.unpark();
            if let Some(handle) = handle.take() {
                // A worker catches its panics, so joining cannot fail.
                let _ = handle.join();
            }
        }
    }
}

impl std::fmt::Debug for Threads {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Threads({})", self.count())
    }
}

fn serve(shared: &Shared, index: usize) {
    let mut seen = 0;
    loop {
        seen = next_round(shared, index, seen);
        if shared.stop.load(Ordering::Relaxed) {
            return;
        }
        // SAFETY: `round` was raised after `work` was written, and the owner waits for this worker before it
        // writes again or lets the closure go.
        let outcome = catch_unwind(AssertUnwindSafe(|| unsafe {
            if let Some(work) = *shared.work.get() {
                (*work)(index + 1);
            }
        }));
        if outcome.is_err() {
            shared.panicked.store(true, Ordering::Relaxed);
        }
        shared.unfinished.fetch_sub(1, Ordering::Release);
    }
}

/// Waits until `round` differs from `seen` and returns it: spinning at first, then parked.
fn next_round(shared: &Shared, index: usize, seen: u32) -> u32 {
    for _ in 0..SPINS_BEFORE_PARKING {
        let round = shared.round.load(Ordering::Acquire);
        if round != seen {
            return round;
        }
        std::hint::spin_loop();
    }
    shared.asleep[index].store(true, Ordering::SeqCst);
    let round = loop {
        let round = shared.round.load(Ordering::SeqCst);
        if round != seen {
            break round;
        }
        std::thread::park();
    };
    shared.asleep[index].store(false, Ordering::SeqCst);
    round
}

/// Part `index` of `0..total` cut into `parts` ranges of nearly equal length, cut at multiples of `grain`.
pub(crate) fn part(total: usize, grain: usize, parts: usize, index: usize) -> Range<usize> {
    let grains = total.div_ceil(grain);
    let cut = |i: usize| (grains * i / parts * grain).min(total);
    cut(index)..cut(index + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_thread_works_once_per_round() {
        for count in 1..=4 {
            let mut threads = Threads::new(count);
            assert_eq!(threads.count(), count);
            let calls: Vec<AtomicUsize> = (0..count).map(|_| AtomicUsize::new(0)).collect();
            for _ in 0..1000 {
                threads.run(&|i| {
                    calls[i].fetch_add(1, Ordering::Relaxed);
                });
            }
            assert!(calls.iter().all(|c| c.load(Ordering::Relaxed) == 1000));
        }
    }

    #[test]
    fn parked_workers_wake_up() {
        let mut threads = Threads::new(2);
        let calls = AtomicUsize::new(0);
        for _ in 0..3 {
            std::thread::sleep(std::time::Duration::from_millis(20));
            threads.run(&|_| {
                calls.fetch_add(1, Ordering::Relaxed);
            });
        }
        assert_eq!(calls.load(Ordering::Relaxed), 6);
    }

    #[test]
    fn a_panic_is_passed_on_and_the_team_survives_it() {
        let mut threads = Threads::new(2);
        for culprit in [0, 1] {
            let outcome = catch_unwind(AssertUnwindSafe(|| {
                threads.run(&|i| assert_ne!(i, culprit, "wanted"));
            }));
            assert!(outcome.is_err());
        }
        let calls = AtomicUsize::new(0);
        threads.run(&|_| {
            calls.fetch_add(1, Ordering::Relaxed);
        });
        assert_eq!(calls.load(Ordering::Relaxed), 2);
    }

    #[test]
    fn parts_cover_everything_once() {
        for (total, grain, parts) in [(32, 8, 2), (20, 8, 2), (1, 8, 3), (0, 4, 2), (33, 4, 5)] {
            let mut next = 0;
            for index in 0..parts {
                let range = part(total, grain, parts, index);
                assert_eq!(range.start, next);
                next = range.end;
            }
            assert_eq!(next, total);
        }
    }
}
