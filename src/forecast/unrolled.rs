//! Loss and gradients of a batch of paths, extended call by call as in use.
//!
//! Gradients run through the calls: what a call gives is what the calls after it are shown, as displacements
//! and, where the network is anchored, as the place it stands at. The error that is made small is therefore
//! that of the whole path, drift included, which no training on true histories sees.

use serde::{Deserialize, Serialize};

use super::Segment;
use super::encoding::{Encoding, Paths};
use super::network::{Batch, ForecastNetwork, InputGradients, NetworkState};
use super::training::StageConfig;
use crate::geo::{Displacement, Position};
use crate::nn::{Compute, Gradients};

/// What is made small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loss {
    /// The mean squared error of displacements from step to step, as in the paper.
    #[default]
    Displacements,
    /// The mean over segments of what a forecast is measured by: the root mean square distance of a path from
    /// the truth. A vessel that does what nobody could know weighs no more than any other.
    Path,
}

/// Distances below this, in metres, no longer count in [`Loss::Path`]: it keeps the root smooth at zero.
const SOFTENING_M: f64 = 1.0;

/// The buffers of an unrolled batch, kept from update to update.
pub(super) struct Unrolled {
    encoding: Encoding,
    paths: Paths,
    calls: Vec<Call>,
    /// Derivative of the loss with respect to every displacement of the paths, `[rows][horizon]`, in units of
    /// the network's output.
    d_steps: Vec<Displacement>,
    d_histories: Vec<f32>,
    d_anchors: Vec<f32>,
    rows: usize,
}

/// What one call was shown, and what the network keeps of it for the way back.
struct Call {
    histories: Vec<f32>,
    anchors: Vec<f32>,
    state: NetworkState<f32>,
}

impl Unrolled {
    pub fn new(encoding: Encoding) -> Self {
        Self {
            encoding,
            paths: Paths::default(),
            calls: Vec::new(),
            d_steps: Vec::new(),
            d_histories: Vec::new(),
            d_anchors: Vec::new(),
            rows: 0,
        }
    }

    /// Fits the buffers to a batch.
    fn fit(&mut self, network: &ForecastNetwork<f32>, rows: usize, steps: usize, calls: usize) {
        if self.rows != rows {
            self.calls.clear();
            self.rows = rows;
        }
        self.calls.resize_with(calls, || Call {
            histories: Vec::new(),
            anchors: vec![0.0; rows * 2],
            state: network.state(rows),
        });
        for call in &mut self.calls {
            call.histories.resize(steps * rows * 2, 0.0);
        }
        self.d_histories.resize(steps * rows * 2, 0.0);
        self.d_anchors.resize(rows * 2, 0.0);
        self.d_steps.clear();
        self.d_steps.resize(rows * calls * self.encoding.outputs, Displacement::default());
    }

    /// Loss of a batch in metres, and its gradients: the root of the mean squared error of displacements, or the
    /// mean error of paths.
    pub fn loss_and_gradients(
        &mut self,
        compute: &mut Compute,
        network: &ForecastNetwork<f32>,
        stage: &StageConfig,
        segments: &[Segment],
        gradients: &mut Gradients<f32>,
    ) -> f64 {
        let (encoding, rows) = (self.encoding, segments.len());
        let steps = match stage.history_steps {
            0 => encoding.history_len - 1,
            steps => steps,
        };
        self.fit(network, rows, steps, stage.calls);
        gradients.clear();
        self.paths.start(&encoding, segments.iter().map(|segment| segment.history.as_slice()), stage.calls);
        for call in &mut self.calls {
            self.paths.encode(encoding.scaling, steps, &mut call.histories, &mut call.anchors);
            let batch = Batch { histories: &call.histories, anchors: &call.anchors, rows };
            let output = network.forward(compute, batch, &mut call.state);
            self.paths.extend(&encoding, output);
        }
        let loss_m = self.differentiate(stage.loss, segments);
        for call in (0..self.calls.len()).rev() {
            self.backward(compute, network, call, gradients);
        }
        loss_m
    }

    /// The loss and its derivative with respect to every displacement, those that later calls make of it
    /// left out.
    fn differentiate(&mut self, loss: Loss, segments: &[Segment]) -> f64 {
        let horizon = self.calls.len() * self.encoding.outputs;
        let step_m = self.encoding.scaling.step_m;
        let rows = segments.len() as f64;
        let mut sum = 0.0;
        for (row, (segment, gradient)) in segments.iter().zip(self.d_steps.chunks_mut(horizon)).enumerate() {
            let path = self.paths.future(&self.encoding, row);
            match loss {
                Loss::Displacements => {
                    let seen = segment.history.last().copied().unwrap_or_default();
                    let weight = 1.0 / (rows * horizon as f64);
                    sum += squared_displacements((seen, path), (segment.present, &segment.future), gradient);
                    gradient.iter_mut().for_each(|d| *d = *d * (2.0 * weight * step_m));
                }
                Loss::Path => {
                    let error_m = path_error(path, &segment.future, gradient);
                    sum += error_m;
                    let weight = step_m / (rows * horizon as f64 * error_m);
                    gradient.iter_mut().for_each(|d| *d = *d * weight);
                }
            }
        }
        match loss {
            Loss::Displacements => (sum / (rows * horizon as f64)).sqrt(),
            Loss::Path => sum / rows,
        }
    }

    /// Carries the gradients of one call back: to the weights, and to the calls before it.
    fn backward(
        &mut self,
        compute: &mut Compute,
        network: &ForecastNetwork<f32>,
        index: usize,
        gradients: &mut Gradients<f32>,
    ) {
        let Encoding { outputs, scaling, .. } = self.encoding;
        let (rows, horizon, first) = (self.rows, self.calls.len() * outputs, index * outputs);
        let call = &mut self.calls[index];
        let (_, d_output) = network.loss_buffers(rows, &mut call.state);
        for (d_steps, d_output) in self.d_steps.chunks(horizon).zip(d_output.chunks_mut(2 * outputs)) {
            for (d_step, d_output) in d_steps[first..].iter().zip(d_output.chunks_exact_mut(2)) {
                (d_output[0], d_output[1]) = (d_step.north_m as f32, d_step.east_m as f32);
            }
        }
        let batch = Batch { histories: &call.histories, anchors: &call.anchors, rows };
        let inputs = (index > 0)
            .then_some(InputGradients { histories: &mut self.d_histories, anchors: &mut self.d_anchors });
        network.backward(compute, batch, &mut call.state, inputs, gradients);
        if index == 0 {
            return;
        }
        let steps = self.d_histories.len() / (rows * 2);
        let per_step = scaling.step_m / scaling.anchor_m;
        for (row, d_steps) in self.d_steps.chunks_mut(horizon).enumerate() {
            let pair = |values: &[f32], at: usize| Displacement {
                north_m: f64::from(values[2 * at]),
                east_m: f64::from(values[2 * at + 1]),
            };
            // Every displacement so far has brought the path to where this call stands.
            let d_anchor = pair(&self.d_anchors, row) * per_step;
            d_steps[..first].iter_mut().for_each(|d| *d = *d + d_anchor);
            // The latest of them are what it was shown, after what is left of the history.
            for back in 1..=steps.min(first) {
                let shown = pair(&self.d_histories, (steps - back) * rows + row);
                d_steps[first - back] = d_steps[first - back] + shown;
            }
        }
    }
}

/// Sum of squared differences between the displacements of a path and of the truth, each with the position
/// before its first; `difference` gets the differences.
fn squared_displacements(
    (mut given, path): (Position, &[Position]),
    (mut true_before, truth): (Position, &[Position]),
    difference: &mut [Displacement],
) -> f64 {
    let mut sum = 0.0;
    for ((&next, &true_next), difference) in path.iter().zip(truth).zip(difference) {
        *difference = (next - given) + -(true_next - true_before);
        sum += difference.north_m.powi(2) + difference.east_m.powi(2);
        (given, true_before) = (next, true_next);
    }
    sum
}

/// Root mean square distance of a path from the truth in metres, softened; `gradient` gets the sum of the
/// differences from each step on, which is the derivative with respect to that displacement but for a factor.
fn path_error(path: &[Position], truth: &[Position], gradient: &mut [Displacement]) -> f64 {
    let mut sum = 0.0;
    let mut from_here_on = Displacement::default();
    for ((&at, &there), gradient) in path.iter().zip(truth).zip(gradient).rev() {
        let off = at - there;
        sum += off.north_m.powi(2) + off.east_m.powi(2);
        from_here_on = from_here_on + off;
        *gradient = from_here_on;
    }
    (sum / path.len() as f64 + SOFTENING_M.powi(2)).sqrt()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::encoding::Scaling;
    use super::super::network::NetworkConfig;
    use super::*;
    use crate::nn::Activation;

    const OUTPUTS: usize = 2;
    const HISTORY: usize = 5;

    /// A small anchored network without kinks, whose paths depend smoothly on its weights.
    fn network(rng: &mut ChaCha8Rng) -> ForecastNetwork<f32> {
        let config = NetworkConfig {
            steps: HISTORY - 1,
            hidden: 8,
            anchored: true,
            layers: vec![8],
            activation: Activation::Tanh,
            predicted: OUTPUTS,
        };
        ForecastNetwork::new(config, rng)
    }

    fn encoding() -> Encoding {
        let scaling = Scaling { step_m: 10.0, anchor_m: 40.0 };
        Encoding { history_len: HISTORY, outputs: OUTPUTS, scaling }
    }

    fn segments(rng: &mut ChaCha8Rng, horizon: usize) -> Vec<Segment> {
        let mut walk = |count: usize, from: Position| {
            let mut at = from;
            let mut next = || {
                let step = Displacement {
                    north_m: rng.random_range(-10.0..10.0),
                    east_m: rng.random_range(-10.0..10.0),
                };
                at += step;
                at
            };
            (0..count).map(|_| next()).collect::<Vec<Position>>()
        };
        (0..3)
            .map(|_| {
                let history = walk(HISTORY, Position::ORIGIN);
                let present = history[HISTORY - 1];
                Segment { future: walk(horizon, present), history, present, mmsi: None, start_unix_s: None }
            })
            .collect()
    }

    /// Through four calls, displacements and anchors included, and with a history shown only in part.
    #[test]
    fn gradients_run_through_the_calls() {
        for (loss, history_steps) in [(Loss::Path, 0), (Loss::Path, 3), (Loss::Displacements, 0)] {
            let rng = &mut ChaCha8Rng::seed_from_u64(5);
            let mut network = network(rng);
            let segments = segments(rng, 4 * OUTPUTS);
            let stage = StageConfig { calls: 4, history_steps, loss, ..StageConfig::default() };
            let compute = &mut Compute::new(1);
            let mut unrolled = Unrolled::new(encoding());
            let mut gradients = Gradients::zeros(network.parameters.layout());
            let loss_m = unrolled.loss_and_gradients(compute, &network, &stage, &segments, &mut gradients);
            // The loss of displacements is told as a root, and differentiated as a square.
            let scale = if loss == Loss::Displacements { 2.0 * loss_m } else { 1.0 };
            let analytic: Vec<f64> = gradients.values().iter().map(|&g| f64::from(g)).collect();
            let largest = analytic.iter().fold(0.0_f64, |most, g| most.max(g.abs()));
            assert!(largest > 0.1);
            // Along random directions, since one weight alone moves an f32 loss too little.
            for _ in 0..8 {
                let direction: Vec<f32> = analytic.iter().map(|_| rng.random_range(-1.0..1.0)).collect();
                let mut at = |step: f32| {
                    let moved = |weights: &mut [f32], by: f32| {
                        weights.iter_mut().zip(&direction).for_each(|(w, d)| *w += by * d);
                    };
                    network.parameters.update(|weights| moved(weights, step));
                    let loss_m = unrolled.loss_and_gradients(
                        compute,
                        &network,
                        &stage,
                        &segments,
                        &mut Gradients::zeros(network.parameters.layout()),
                    );
                    network.parameters.update(|weights| moved(weights, -step));
                    loss_m
                };
                let numeric = scale * (at(2e-3) - at(-2e-3)) / 4e-3;
                let expected: f64 = analytic.iter().zip(&direction).map(|(g, &d)| g * f64::from(d)).sum();
                assert!(
                    (numeric - expected).abs() < 0.01 * (expected.abs() + largest),
                    "{numeric} {expected}"
                );
            }
        }
    }

    #[test]
    fn losses_are_in_metres() {
        let at = |north_m: f64| Position { north_m, east_m: 0.0 };
        let mut d = [Displacement::default(); 2];
        let truth = (at(1.0), &[at(2.0), at(5.0)][..]);
        let sum = squared_displacements((at(0.0), &[at(2.0), at(6.0)]), truth, &mut d);
        assert_eq!((sum, d[0].north_m, d[1].north_m), (2.0, 1.0, 1.0));
        let error_m = path_error(&[at(2.0), at(6.0)], &[at(-2.0), at(2.0)], &mut d);
        assert!((error_m - 17.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!((d[0].north_m, d[1].north_m), (8.0, 4.0));
    }
}
