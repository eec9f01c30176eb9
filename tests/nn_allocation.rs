//! Training allocates nothing once its buffers exist.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use searoom::forecast::network::{Batch, ForecastNetwork, NetworkConfig};
use searoom::nn::{Adam, AdamConfig, Compute, Gradients};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting for each thread.
struct Counting;

// SAFETY: everything is passed on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that is ending has no counter any more.
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: by the caller's contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: by the caller's contract.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Allocations so far on each thread of a team.
fn allocations(compute: &mut Compute) -> [u64; 2] {
    let counts = [AtomicU64::new(0), AtomicU64::new(0)];
    compute.threads().run(&|thread| counts[thread].store(ALLOCATIONS.get(), Ordering::Relaxed));
    counts.map(AtomicU64::into_inner)
}

#[test]
fn training_a_forecaster_allocates_nothing() {
    let rows = 32;
    for config in [NetworkConfig::open_water(), NetworkConfig { steps: 6, ..NetworkConfig::coastal() }] {
        let histories = vec![0.3f32; config.steps * rows * 2];
        let (anchors, targets) = (vec![0.1; rows * 2], vec![0.2; rows * config.outputs()]);
        let batch = Batch { histories: &histories, anchors: &anchors, rows };
        let mut network = ForecastNetwork::<f32>::new(config, &mut ChaCha8Rng::seed_from_u64(1));
        let mut compute = Compute::new(2);
        let mut state = network.state(rows);
        let layout = Arc::clone(network.parameters.layout());
        let mut gradients = Gradients::zeros(&layout);
        let mut adam = Adam::new(&layout, AdamConfig::default());

        let before = allocations(&mut compute);
        for _ in 0..5 {
            gradients.clear();
            network.accumulate_gradients(&mut compute, batch, &targets, &mut state, &mut gradients);
            adam.step(&mut compute, &mut network.parameters, &gradients, 1e-3);
        }
        assert_eq!(allocations(&mut compute), before);
    }
}

#[test]
fn the_counter_counts_on_every_thread() {
    let mut compute = Compute::new(2);
    let before = allocations(&mut compute);
    compute.threads().run(&|_| drop(std::hint::black_box(vec![1u8; 100])));
    assert_eq!(allocations(&mut compute), before.map(|count| count + 1));
}
