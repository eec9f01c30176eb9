//! One update of LSTM-TD3 or LSTM-SAC on a batch of 32: losses, gradients, Adam, targets.
//!
//! `cargo bench --bench agent_update -- [td3|sac] [--history L] [--threads N]` prints one JSON line per subject.
//! Rivals: `rivals/agent_update_torch.py` and `rivals/agent_update_jax.py`.

mod support;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use searoom::nn::Compute;
use searoom::rl::networks::RecurrentNet;
use searoom::rl::replay::{Batch, ReplayShape};
use searoom::rl::sac::{Sac, SacConfig};
use searoom::rl::td3::{Td3, Td3Config};

const OBSERVATION: usize = 43;
const ACTION: usize = 1;
const HIDDEN: usize = 128;
const ROWS: usize = 32;

fn main() {
    let arguments = support::Arguments::parse();
    let steps = arguments.number("history").unwrap_or(4);
    if arguments.wants("td3") {
        td3(steps, arguments.threads());
    }
    if arguments.wants("sac") {
        sac(steps, arguments.threads());
    }
}

fn td3(steps: usize, threads: usize) {
    let config = Td3Config::default();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut agent = Td3::<f32>::new(config, OBSERVATION, ACTION, HIDDEN, (steps, ROWS), &mut rng);
    let (batch, noise) = (batch(steps, &mut rng), random(ROWS * ACTION, &mut rng));
    let mut compute = Compute::new(threads);
    // The actor is updated every second time: both kinds of update are in the mean.
    let delay = config.policy_delay;
    let seconds = support::median_seconds(2.0, || {
        for _ in 0..delay {
            agent.update(&mut compute, &batch, &noise);
        }
    }) / delay as f64;
    let (actor, critic) = (agent.actor.net(), agent.critics.critics[0].net());
    let forward = |net: &RecurrentNet| net.operations(steps, ROWS);
    let actor_update = forward(actor)
        + actor.backward_operations(steps, ROWS)
        + forward(critic)
        + critic.backward_to_action_operations(ROWS);
    let operations = forward(actor)
        + 2 * forward(critic)
        + 2 * (forward(critic) + critic.backward_operations(steps, ROWS))
        + actor_update / delay as usize;
    report("td3-update", steps, threads, seconds, operations);
}

fn sac(steps: usize, threads: usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut agent =
        Sac::<f32>::new(SacConfig::default(), OBSERVATION, ACTION, HIDDEN, (steps, ROWS), &mut rng);
    let batch = batch(steps, &mut rng);
    let (next_noise, noise) = (random(ROWS * ACTION, &mut rng), random(ROWS * ACTION, &mut rng));
    let mut compute = Compute::new(threads);
    let seconds = support::median_seconds(2.0, || {
        agent.update(&mut compute, &batch, &next_noise, &noise);
    });
    let (actor, critic) = (agent.actor.net(), agent.critics.critics[0].net());
    let forward = |net: &RecurrentNet| net.operations(steps, ROWS);
    let operations = 2 * forward(actor)
        + actor.backward_operations(steps, ROWS)
        + 2 * forward(critic)
        + 2 * (forward(critic) + critic.backward_operations(steps, ROWS))
        + 2 * (forward(critic) + critic.backward_to_action_operations(ROWS));
    report("sac-update", steps, threads, seconds, operations);
}

fn random(count: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
}

fn batch(steps: usize, rng: &mut ChaCha8Rng) -> Batch {
    let shape = ReplayShape { observation_len: OBSERVATION, action_len: ACTION, capacity: 2 };
    support::random_batch(Batch::new(&shape, ROWS, steps), rng)
}

fn report(subject: &str, steps: usize, threads: usize, seconds: f64, operations: usize) {
    // An operation is a multiply or an add.
    let flop = 2.0 * operations as f64;
    let machine = support::machine_gflops(threads);
    let line = serde_json::json!({
        "subject": subject,
        "who": "searoom",
        "history": steps,
        "threads": threads,
        "seconds": seconds,
        "mflop": flop / 1e6,
        "gflops": flop / seconds / 1e9,
        "machine_gflops": machine,
        "share": flop / seconds / 1e9 / machine,
    });
    println!("{line}");
}
