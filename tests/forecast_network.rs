//! The forecasters' networks against PyTorch (`tests/golden/make_nn.py`) and against finite differences.

#![allow(clippy::unwrap_used)]

use std::collections::HashMap;
use std::path::PathBuf;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use safetensors::SafeTensors;
use searoom::forecast::network::{Batch, ForecastNetwork, NetworkConfig};
use searoom::nn::weights::{WeightsError, WeightsFile};
use searoom::nn::{Activation, Adam, AdamConfig, Compute, Dense, Gradients, Layout, Lstm, Parameters, Real};

const LEARNING_RATE: f64 = 1e-3;

struct Golden(HashMap<String, Vec<f64>>);

impl Golden {
    fn load(name: &str) -> Self {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
        let bytes = std::fs::read(&path).unwrap();
        let numbers = |data: &[u8]| data.as_chunks().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        Self(tensors.iter().map(|(name, view)| (name.to_owned(), numbers(view.data()))).collect())
    }

    fn get(&self, name: &str) -> &[f64] {
        &self.0[name]
    }

    fn cast<T: Real>(&self, name: &str) -> Vec<T> {
        self.get(name).iter().map(|&x| T::from_f64(x)).collect()
    }

    /// The weights saved under a prefix.
    fn parameters<T: Real>(&self, prefix: &str, layout: &std::sync::Arc<Layout>) -> Parameters<T> {
        let mut parameters = Parameters::zeros(layout, true);
        parameters.update(|values| {
            for tensor in layout.tensors() {
                layout.scatter(tensor, &self.cast(&format!("{prefix}{}", tensor.name())), values);
            }
        });
        parameters
    }
}

/// Allowed distance from PyTorch: per element in f64, by the norm of the tensor in f32.
fn assert_same<T: Real>(what: &str, ours: &[T], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    let errors = ours.iter().zip(theirs).map(|(a, b)| (a.to_f64() - b).abs());
    if size_of::<T>() == 8 {
        let worst = errors.fold(0.0, f64::max);
        assert!(worst <= 1e-9, "{what}: an element differs by {worst:e}");
    } else {
        let error = errors.map(|e| e * e).sum::<f64>().sqrt();
        let norm = theirs.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!(error <= 1e-5 * norm, "{what}: differs by {:e} of its norm", error / norm);
    }
}

fn change<T: Real>(after: &[T], before: &[T]) -> Vec<f64> {
    after.iter().zip(before).map(|(a, b)| a.to_f64() - b.to_f64()).collect()
}

fn open_water(hidden: usize) -> NetworkConfig {
    NetworkConfig { hidden, layers: vec![hidden], ..NetworkConfig::open_water() }
}

fn coastal() -> NetworkConfig {
    NetworkConfig { steps: 20, hidden: 20, layers: vec![20, 18], ..NetworkConfig::coastal() }
}

/// Forward pass, loss, gradients and ten Adam steps against a golden file.
fn follows_pytorch<T: Real>(name: &str, config: NetworkConfig, rows: usize, threads: usize) {
    let golden = Golden::load(name);
    let mut compute = Compute::new(threads);
    let mut network = ForecastNetwork::<T>::new(config, &mut ChaCha8Rng::seed_from_u64(0));
    let layout = std::sync::Arc::clone(network.parameters.layout());
    network.parameters = golden.parameters("before.", &layout);
    let before = network.parameters.clone();
    let (histories, anchors) = (golden.cast("histories"), golden.cast("anchors"));
    let targets: Vec<T> = golden.cast("targets");
    let batch = Batch { histories: &histories, anchors: &anchors, rows };
    let mut state = network.state(rows);
    assert_same("predictions", network.forward(&mut compute, batch, &mut state), golden.get("predictions"));

    let mut gradients = Gradients::zeros(&layout);
    let mut adam = Adam::new(&layout, AdamConfig::default());
    for step in 1..=10 {
        gradients.clear();
        let loss = network.accumulate_gradients(&mut compute, batch, &targets, &mut state, &mut gradients);
        assert_same("loss", &[T::from_f64(loss)], golden.get(&format!("loss.{step}")));
        adam.step(&mut compute, &mut network.parameters, &gradients, LEARNING_RATE);
        for tensor in layout.tensors() {
            let name = tensor.name();
            if step == 1 {
                let ours = gradients.tensor(name).unwrap();
                assert_same(&format!("gradient of {name}"), &ours, golden.get(&format!("gradient.{name}")));
            }
            let Some(theirs) = golden.0.get(&format!("after.{step}.{name}")) else { continue };
            let ours = network.parameters.tensor(name).unwrap();
            assert_same(&format!("{name} after step {step}"), &ours, theirs);
            let what = format!("change of {name} by step {step}");
            let our_change = change(&ours, &before.tensor(name).unwrap());
            let their_change = change(theirs, golden.get(&format!("before.{name}")));
            if size_of::<T>() == 4 {
                let as_f32: Vec<f32> = our_change.iter().map(|&x| x as f32).collect();
                assert_same(&what, &as_f32, &their_change);
            } else {
                assert_same(&what, &our_change, &their_change);
            }
        }
    }
}

#[test]
fn open_water_network_follows_pytorch() {
    follows_pytorch::<f64>("nn_open_water.safetensors", open_water(12), 8, 1);
    follows_pytorch::<f32>("nn_open_water.safetensors", open_water(12), 8, 1);
}

#[test]
fn coastal_network_follows_pytorch() {
    follows_pytorch::<f64>("nn_coastal.safetensors", coastal(), 6, 1);
    follows_pytorch::<f32>("nn_coastal.safetensors", coastal(), 6, 2);
}

#[test]
fn open_water_network_of_full_size_follows_pytorch() {
    follows_pytorch::<f64>("nn_open_water_full.safetensors", NetworkConfig::open_water(), 32, 2);
    follows_pytorch::<f32>("nn_open_water_full.safetensors", NetworkConfig::open_water(), 32, 2);
}

fn ragged_histories_follow_pytorch<T: Real>() {
    let (steps, rows, inputs, hidden) = (5, 7, 11, 24);
    let golden = Golden::load("nn_ragged.safetensors");
    let mut layout = Layout::new();
    let dense = Dense::new(&mut layout, "dense", inputs, hidden, Activation::Relu);
    let lstm = Lstm::new(&mut layout, "lstm", hidden, hidden);
    let layout = std::sync::Arc::new(layout);
    let parameters: Parameters<T> = golden.parameters("before.", &layout);
    let x: Vec<T> = golden.cast("x");
    let lengths: Vec<usize> = golden.get("lengths").iter().map(|&n| n as usize).collect();
    let lengths = Some(&lengths[..]);

    let mut compute = Compute::new(2);
    let mut between = vec![T::ZERO; steps * rows * hidden];
    let mut state = lstm.state(steps, rows);
    let mut last = vec![T::ZERO; rows * hidden];
    dense.forward(&mut compute, &parameters, &x, steps * rows, &mut between);
    lstm.forward(&mut compute, &parameters, &between, steps, rows, lengths, &mut state);
    state.read_last(lengths, &mut last, hidden);
    assert_same("last valid state", &last, golden.get("last"));

    let mut gradients = Gradients::zeros(&layout);
    let mut d_between = vec![T::ZERO; between.len()];
    let mut d_x = vec![T::ZERO; x.len()];
    let d_last: Vec<T> = golden.cast("d_last");
    let (d_last, d_in) = ((&d_last[..], hidden), Some(&mut d_between[..]));
    lstm.backward(
        &mut compute,
        &parameters,
        &between,
        lengths,
        &mut state,
        d_last,
        d_in,
        Some(&mut gradients),
    );
    let (d_in, grads) = (Some(&mut d_x[..]), Some(&mut gradients));
    dense.backward(&mut compute, &parameters, &x, &between, steps * rows, &mut d_between, d_in, grads);
    assert_same("gradient of x", &d_x, golden.get("d_x"));
    for tensor in layout.tensors() {
        let ours = gradients.tensor(tensor.name()).unwrap();
        assert_same(tensor.name(), &ours, golden.get(&format!("gradient.{}", tensor.name())));
    }
}

#[test]
fn histories_of_different_lengths_follow_pytorch() {
    ragged_histories_follow_pytorch::<f64>();
    ragged_histories_follow_pytorch::<f32>();
}

#[test]
fn gradients_of_whole_forecasters_are_central_differences() {
    let anchored = NetworkConfig { steps: 3, hidden: 5, layers: vec![4, 3], predicted: 2, ..coastal() };
    let plain = NetworkConfig { steps: 3, hidden: 4, layers: vec![5], predicted: 1, ..open_water(4) };
    for config in [anchored, plain] {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let rows = 3;
        let mut random =
            |count: usize| -> Vec<f64> { (0..count).map(|_| rng.random_range(-1.0..1.0)).collect() };
        let (histories, anchors) = (random(config.steps * rows * 2), random(rows * 2));
        let targets = random(rows * config.outputs());
        let mut network = ForecastNetwork::<f64>::new(config, &mut ChaCha8Rng::seed_from_u64(6));
        let batch = Batch { histories: &histories, anchors: &anchors, rows };
        let (mut compute, mut state) = (Compute::new(1), network.state(rows));
        let layout = std::sync::Arc::clone(network.parameters.layout());
        let mut gradients = Gradients::zeros(&layout);
        network.accumulate_gradients(&mut compute, batch, &targets, &mut state, &mut gradients);
        let mut scratch = Gradients::zeros(&layout);
        for position in layout.tensors().iter().flat_map(|tensor| tensor.positions()) {
            let value = network.parameters.values()[position];
            let mut at = |offset: f64| {
                network.parameters.update(|values| values[position] = value + offset);
                network.accumulate_gradients(&mut compute, batch, &targets, &mut state, &mut scratch)
            };
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            at(0.0);
            let analytic = gradients.values()[position];
            assert!((analytic - difference).abs() <= 1e-8 + 1e-7 * difference.abs());
        }
    }
}

#[test]
fn a_full_size_open_water_network_learns_a_toy_motion() {
    // Points on circles of different rates: the next displacement follows from the last ones.
    let config = NetworkConfig::open_water();
    let (steps, rows) = (config.steps, 32);
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut network = ForecastNetwork::<f32>::new(config, &mut rng);
    let mut compute = Compute::new(2);
    let mut state = network.state(rows);
    let layout = std::sync::Arc::clone(network.parameters.layout());
    let mut gradients = Gradients::zeros(&layout);
    let mut adam = Adam::new(&layout, AdamConfig::default());
    let (mut histories, mut targets) = (vec![0.0; steps * rows * 2], vec![0.0; rows * 2]);
    let mut losses = Vec::new();
    for _ in 0..400 {
        for row in 0..rows {
            let (phase, rate): (f32, f32) = (rng.random_range(0.0..6.3), rng.random_range(-0.5..0.5));
            let point = |step: usize| (phase + rate * step as f32).sin_cos();
            for step in 0..steps {
                let at = (step * rows + row) * 2;
                (histories[at], histories[at + 1]) = point(step);
            }
            (targets[row * 2], targets[row * 2 + 1]) = point(steps);
        }
        gradients.clear();
        let batch = Batch { histories: &histories, anchors: &[], rows };
        losses.push(network.accumulate_gradients(&mut compute, batch, &targets, &mut state, &mut gradients));
        adam.step(&mut compute, &mut network.parameters, &gradients, 3e-3);
    }
    let (first, last) = (losses[..20].iter().sum::<f64>(), losses[380..].iter().sum::<f64>());
    assert!(last < 0.02 * first, "the loss fell from {} to {} only", first / 20.0, last / 20.0);
}

#[test]
fn a_saved_network_predicts_the_same_bits() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let network = ForecastNetwork::<f32>::new(coastal(), &mut rng);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("coastal.safetensors");
    network.writer().fact("scale_m", 25.0).save(&path).unwrap();
    let file = WeightsFile::open(&path).unwrap();
    let loaded = ForecastNetwork::<f32>::read(&file).unwrap();
    assert_eq!(file.fact::<f64>("scale_m").unwrap(), 25.0);
    file.finish().unwrap();
    assert_eq!(loaded.config(), network.config());

    let histories: Vec<f32> = (0..20 * 3 * 2).map(|_| rng.random_range(-1.0..1.0)).collect();
    let batch = Batch { histories: &histories, anchors: &[0.5; 6], rows: 3 };
    let predict = |network: &ForecastNetwork<f32>| {
        network.forward(&mut Compute::new(1), batch, &mut network.state(3)).to_vec()
    };
    assert_eq!(predict(&loaded), predict(&network));
}

#[test]
fn sizes_that_do_not_fit_the_weights_are_refused() {
    let network = ForecastNetwork::<f32>::new(open_water(8), &mut ChaCha8Rng::seed_from_u64(9));
    let path = std::path::Path::new("a.safetensors");
    let mut other = open_water(8);
    for (hidden, text) in [(9, "linear.0"), (0, "size of 0"), (1 << 20, "size of 1048576")] {
        other.layers = vec![hidden];
        let writer = network.writer().fact("network", serde_json::to_string(&other).unwrap());
        let file = WeightsFile::from_bytes(path, writer.to_bytes()).unwrap();
        let error = ForecastNetwork::<f32>::read(&file).unwrap_err();
        assert!(error.to_string().contains(text), "{error}");
    }
    let writer = network.writer().fact("network", "{}");
    let file = WeightsFile::from_bytes(path, writer.to_bytes()).unwrap();
    let error = ForecastNetwork::<f32>::read(&file).unwrap_err();
    assert!(matches!(error, WeightsError::Metadata { .. }), "{error}");
}
