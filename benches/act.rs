//! One decision of an actor, as while it steers: an observation and its history in, an action out.
//!
//! `cargo bench --bench act -- [td3|sac] [--history L]` prints one JSON line per subject. Rival:
//! `rivals/act_torch.py`.

mod support;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use searoom::nn::Compute;
use searoom::rl::agent::{Agent, AgentConfig, Algorithm, Memory};

const OBSERVATION: usize = 43;
const ACTION: usize = 1;

fn main() {
    let arguments = support::Arguments::parse();
    let history_len = arguments.number("history").unwrap_or(4);
    for (name, algorithm) in [("td3", Algorithm::LstmTd3), ("sac", Algorithm::LstmSac)] {
        if arguments.wants(name) {
            measure(name, AgentConfig { algorithm, history_len, ..AgentConfig::default() });
        }
    }
}

fn measure(name: &str, config: AgentConfig) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let history_len = config.history_len;
    let mut agent = Agent::new(config, OBSERVATION, ACTION, &mut rng);
    let mut memory = Memory::new(OBSERVATION, history_len);
    let mut observation = [0.0f32; OBSERVATION];
    for _ in 0..=history_len {
        memory.push(&observation);
        observation.fill_with(|| rng.random_range(-1.0..1.0));
    }
    // A decision uses one core, however many there are.
    let mut compute = Compute::new(1);
    let mut action = [0.0f32; ACTION];
    let seconds = support::median_seconds(2.0, || {
        agent.act(&mut compute, &observation, &memory, &mut action);
    });
    assert!(action[0].is_finite());
    let line = serde_json::json!({
        "subject": "act",
        "who": format!("searoom-{name}"),
        "history": history_len,
        "threads": 1,
        "seconds": seconds,
    });
    println!("{line}");
}
