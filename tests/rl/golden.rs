//! LSTM-TD3 and LSTM-SAC against PyTorch: losses, every gradient, weights and targets after each of
//! three updates. `tests/golden/make_rl.py` made the files.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use safetensors::{SafeTensors, tensor::TensorView};
use searoom::nn::{Compute, Gradients, Parameters, Real};
use searoom::rl::networks::History;
use searoom::rl::replay::{Batch, ReplayShape};
use searoom::rl::sac::{Sac, SacConfig};
use searoom::rl::td3::{Td3, Td3Config};

const OBSERVATION: usize = 5;
const ACTION: usize = 2;
const HIDDEN: usize = 8;
const STEPS: usize = 3;
const ROWS: usize = 6;
const UPDATES: usize = 3;

struct Golden {
    bytes: Vec<u8>,
}

impl Golden {
    fn open(name: &str) -> Self {
        let path = format!("{}/tests/golden/{name}.safetensors", env!("CARGO_MANIFEST_DIR"));
        Self { bytes: std::fs::read(path).expect("golden file") }
    }

    fn view<R>(&self, name: &str, read: impl FnOnce(&TensorView<'_>) -> R) -> R {
        let tensors = SafeTensors::deserialize(&self.bytes).expect("safetensors");
        read(&tensors.tensor(name).unwrap_or_else(|_| panic!("no tensor {name}")))
    }

    fn numbers(&self, name: &str) -> Vec<f64> {
        self.view(name, |view| {
            view.data()
                .chunks_exact(8)
                .map(|bytes| f64::from_le_bytes(bytes.try_into().expect("8 bytes")))
                .collect()
        })
    }

    fn counts(&self, name: &str) -> Vec<usize> {
        self.view(name, |view| {
            let bytes = view.data().chunks_exact(8);
            bytes.map(|bytes| i64::from_le_bytes(bytes.try_into().expect("8 bytes")) as usize).collect()
        })
    }

    fn reals<T: Real>(&self, name: &str) -> Vec<T> {
        self.numbers(name).into_iter().map(T::from_f64).collect()
    }

    fn batch<T: Real>(&self) -> Batch<T> {
        let shape = ReplayShape { observation_len: OBSERVATION, action_len: ACTION, capacity: 2 };
        Batch {
            observation: self.reals("batch.observation"),
            action: self.reals("batch.action"),
            reward: self.reals("batch.reward"),
            continues: self.reals("batch.continues"),
            next_observation: self.reals("batch.next_observation"),
            history: self.reals("batch.history"),
            history_lengths: self.counts("batch.history_lengths"),
            next_history: self.reals("batch.next_history"),
            next_history_lengths: self.counts("batch.next_history_lengths"),
            ..Batch::new(&shape, ROWS, STEPS)
        }
    }

    fn load<T: Real>(&self, prefix: &str, parameters: &mut Parameters<T>) {
        let layout = parameters.layout().clone();
        parameters.update(|values| {
            for tensor in layout.tensors() {
                layout.scatter(tensor, &self.reals::<T>(&format!("{prefix}{}", tensor.name())), values);
            }
        });
    }
}

/// How far numbers may lie apart: in f64 element by element, in f32 by the norm of a tensor and of its
/// change.
#[derive(Clone, Copy)]
enum Tolerance {
    Element(f64),
    Norm(f64),
}

impl Tolerance {
    #[track_caller]
    fn check(self, what: &str, ours: &[f64], theirs: &[f64]) {
        assert_eq!(ours.len(), theirs.len(), "{what}");
        let differences = || ours.iter().zip(theirs).map(|(a, b)| a - b);
        match self {
            Self::Element(bound) => {
                let worst = differences().fold(0.0, |worst: f64, d| worst.max(d.abs()));
                assert!(worst <= bound, "{what}: {worst:e}");
            }
            Self::Norm(bound) => {
                let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
                let (distance, size) = (norm(&mut differences()), norm(&mut theirs.iter().copied()));
                assert!(distance <= bound * size, "{what}: {distance:e} of {size:e}");
            }
        }
    }

    #[track_caller]
    fn check_weights<T: Real>(self, golden: &Golden, update: usize, name: &str, parameters: &Parameters<T>) {
        for tensor in parameters.layout().tensors() {
            let ours = to_f64(&parameters.tensor(tensor.name()).expect("own tensor"));
            let theirs = golden.numbers(&format!("{update}.after.{name}.{}", tensor.name()));
            self.check(&format!("update {update}: {name}.{}", tensor.name()), &ours, &theirs);
            // f64 weights are held to an absolute bound already; in f32 their change is the finer measure.
            if matches!(self, Self::Norm(_)) {
                let before = golden.numbers(&format!("before.{name}.{}", tensor.name()));
                let change: Vec<f64> = ours
                    .iter()
                    .zip(&before)
                    .map(|(after, &before)| after - T::from_f64(before).to_f64())
                    .collect();
                let expected: Vec<f64> =
                    theirs.iter().zip(&before).map(|(after, before)| after - before).collect();
                self.check(
                    &format!("update {update}: change of {name}.{}", tensor.name()),
                    &change,
                    &expected,
                );
            }
        }
    }

    #[track_caller]
    fn check_gradients<T: Real>(self, golden: &Golden, update: usize, name: &str, gradients: &Gradients<T>) {
        for tensor in gradients.layout().tensors() {
            let ours = to_f64(&gradients.tensor(tensor.name()).expect("own tensor"));
            let theirs = golden.numbers(&format!("{update}.gradient.{name}.{}", tensor.name()));
            self.check(&format!("update {update}: gradient of {name}.{}", tensor.name()), &ours, &theirs);
        }
    }
}

fn to_f64<T: Real>(values: &[T]) -> Vec<f64> {
    values.iter().map(|value| value.to_f64()).collect()
}

/// Rates at which a step changes f32 weights by far more than their rounding.
const LEARNING_RATE: f64 = 1e-3;
const TARGET_RATE: f64 = 0.5;

fn td3_config() -> Td3Config {
    Td3Config {
        actor_learning_rate: LEARNING_RATE,
        critic_learning_rate: LEARNING_RATE,
        target_rate: TARGET_RATE,
        ..Td3Config::default()
    }
}

fn sac_config() -> SacConfig {
    SacConfig {
        actor_learning_rate: LEARNING_RATE,
        critic_learning_rate: LEARNING_RATE,
        temperature_learning_rate: LEARNING_RATE,
        target_rate: TARGET_RATE,
        ..SacConfig::default()
    }
}

/// The agent before the first golden update, and the batch of that.
fn td3_agent<T: Real>(config: Td3Config) -> (Golden, Td3<T>, Batch<T>) {
    let golden = Golden::open("rl_td3");
    let rng = &mut ChaCha8Rng::seed_from_u64(0);
    let mut td3 = Td3::new(config, OBSERVATION, ACTION, HIDDEN, (STEPS, ROWS), rng);
    golden.load("before.actor.", &mut td3.actor.online);
    golden.load("before.actor_target.", &mut td3.actor.target);
    for (critic, name) in td3.critics.critics.iter_mut().zip(["critic_1", "critic_2"]) {
        golden.load(&format!("before.{name}."), &mut critic.online);
        golden.load(&format!("before.{name}_target."), &mut critic.target);
    }
    let batch = golden.batch();
    (golden, td3, batch)
}

fn check_td3<T: Real>(tolerance: Tolerance, threads: usize) {
    let (golden, mut td3, batch) = td3_agent::<T>(td3_config());
    let compute = &mut Compute::new(threads);
    for update in 1..=UPDATES {
        let losses = td3.update(compute, &batch, &golden.reals::<T>(&format!("{update}.noise")));
        for (critic, (name, loss)) in
            td3.critics.critics.iter().zip(["critic_1", "critic_2"].iter().zip(losses.critics))
        {
            tolerance.check(name, &[loss], &golden.numbers(&format!("{update}.loss.{name}")));
            tolerance.check_gradients(&golden, update, name, critic.gradients());
            tolerance.check_weights(&golden, update, name, &critic.online);
            tolerance.check_weights(&golden, update, &format!("{name}_target"), &critic.target);
        }
        assert_eq!(losses.actor.is_some(), update % 2 == 1, "the first update and every second after it");
        if let Some(loss) = losses.actor {
            tolerance.check("actor", &[loss], &golden.numbers(&format!("{update}.loss.actor")));
            tolerance.check_gradients(&golden, update, "actor", td3.actor.gradients());
        }
        tolerance.check_weights(&golden, update, "actor", &td3.actor.online);
        tolerance.check_weights(&golden, update, "actor_target", &td3.actor.target);
    }
}

fn check_sac<T: Real>(tolerance: Tolerance, threads: usize) {
    let golden = Golden::open("rl_sac");
    let compute = &mut Compute::new(threads);
    let rng = &mut ChaCha8Rng::seed_from_u64(0);
    let mut sac = Sac::<T>::new(sac_config(), OBSERVATION, ACTION, HIDDEN, (STEPS, ROWS), rng);
    golden.load("before.actor.", &mut sac.actor.online);
    for (critic, name) in sac.critics.critics.iter_mut().zip(["critic_1", "critic_2"]) {
        golden.load(&format!("before.{name}."), &mut critic.online);
        golden.load(&format!("before.{name}_target."), &mut critic.target);
    }
    let batch = golden.batch::<T>();
    for update in 1..=UPDATES {
        let next_noise = golden.reals::<T>(&format!("{update}.next_noise"));
        let noise = golden.reals::<T>(&format!("{update}.noise"));
        let losses = sac.update(compute, &batch, &next_noise, &noise);
        for (critic, (name, loss)) in
            sac.critics.critics.iter().zip(["critic_1", "critic_2"].iter().zip(losses.critics))
        {
            tolerance.check(name, &[loss], &golden.numbers(&format!("{update}.loss.{name}")));
            tolerance.check_gradients(&golden, update, name, critic.gradients());
            tolerance.check_weights(&golden, update, name, &critic.online);
            tolerance.check_weights(&golden, update, &format!("{name}_target"), &critic.target);
        }
        for (name, ours) in [
            ("loss.actor", losses.actor),
            ("loss.temperature", losses.temperature_loss),
            ("temperature", losses.temperature),
        ] {
            tolerance.check(name, &[ours], &golden.numbers(&format!("{update}.{name}")));
        }
        tolerance.check_gradients(&golden, update, "actor", sac.actor.gradients());
        tolerance.check_weights(&golden, update, "actor", &sac.actor.online);
    }
}

#[test]
fn td3_updates_equal_pytorch_in_f64() {
    check_td3::<f64>(Tolerance::Element(1e-9), 1);
}

#[test]
fn td3_updates_equal_pytorch_in_f32() {
    check_td3::<f32>(Tolerance::Norm(1e-4), 2);
}

#[test]
fn sac_updates_equal_pytorch_in_f64() {
    check_sac::<f64>(Tolerance::Element(1e-9), 2);
}

#[test]
fn sac_updates_equal_pytorch_in_f32() {
    check_sac::<f32>(Tolerance::Norm(1e-4), 1);
}

#[test]
fn the_action_penalty_adds_the_gradient_of_the_mean_squared_action() {
    let compute = &mut Compute::new(1);
    let gradient = |action_penalty: f64, compute: &mut Compute| {
        let (golden, mut td3, batch) = td3_agent::<f64>(Td3Config { action_penalty, ..Td3Config::default() });
        td3.update(compute, &batch, &golden.reals("1.noise"));
        td3.actor.gradients().values().to_vec()
    };
    let (without, with) = (gradient(0.0, compute), gradient(0.3, compute));

    let (_, mut td3, batch) = td3_agent::<f64>(Td3Config::default());
    let layout = td3.actor.online.layout().clone();
    for tensor in layout.tensors() {
        for position in tensor.positions() {
            let mut shifted = |by: f64| {
                td3.actor.online.update(|values| values[position] += by);
                let past = History { observations: &batch.history, lengths: &batch.history_lengths };
                let action = td3.actor.forward(compute, &batch.observation, past);
                let squares: f64 = action.iter().map(|a| a * a).sum();
                td3.actor.online.update(|values| values[position] -= by);
                0.3 * squares / ROWS as f64
            };
            let numeric = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
            let ours = with[position] - without[position];
            assert!((numeric - ours).abs() < 1e-8, "{}: {numeric} {ours}", tensor.name());
        }
    }
}

#[test]
fn the_actor_waits_for_its_critics_where_it_is_told_to() {
    let config = Td3Config { critic_only_updates: 3, ..td3_config() };
    let (golden, mut td3, batch) = td3_agent(config);
    let compute = &mut Compute::new(1);
    let weights = |td3: &Td3<f64>| td3.actor.online.values().to_vec();
    let (actor, critic) = (weights(&td3), td3.critics.critics[0].target.values().to_vec());
    for _ in 0..4 {
        assert_eq!(td3.update(compute, &batch, &golden.reals("1.noise")).actor, None);
    }
    assert_eq!(weights(&td3), actor);
    assert_ne!(td3.critics.critics[0].target.values(), critic, "their targets follow all the same");
    assert!(td3.update(compute, &batch, &golden.reals("1.noise")).actor.is_some());
    assert_ne!(weights(&td3), actor);
}
