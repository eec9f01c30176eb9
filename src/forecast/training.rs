//! Learning to forecast: batches of segments, stage after stage, with Adam on a one-cycle schedule.
//!
//! A stage of one call on true histories is the paper's training. Later stages extend the paths of a batch
//! call by call, as in use, and learn from where that leads (see [`super::unrolled`]).

use std::f64::consts::PI;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::Segment;
use super::dataset::SegmentSource;
use super::encoding::{Encoding, Scaling};
use super::model::ModelKind;
use super::network::ForecastNetwork;
use super::unrolled::{Loss, Unrolled};
use crate::config::Fault;
use crate::nn::{Adam, AdamConfig, Compute, Gradients, Parameters};

/// A part of the training with settings of its own.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StageConfig {
    /// Updates.
    pub steps: u64,
    /// Segments in an update.
    pub batch: usize,
    /// Calls of the network that a path is unrolled over.
    pub calls: usize,
    /// Displacements of the history shown; all that the network is made for if 0. Fewer are faster.
    pub history_steps: usize,
    /// What is made small.
    pub loss: Loss,
    /// Peak of the one-cycle schedule.
    pub learning_rate: f64,
    /// Part of the stage over which the rate rises from `initial_fraction` of its peak; then it falls to
    /// nothing, both along a cosine.
    pub warmup: f64,
    /// Where the rate starts, as a fraction of its peak.
    pub initial_fraction: f64,
}

impl Default for StageConfig {
    fn default() -> Self {
        Self {
            steps: 5000,
            batch: 32,
            calls: 1,
            history_steps: 0,
            loss: Loss::default(),
            learning_rate: 2e-3,
            warmup: 0.25,
            initial_fraction: 0.04,
        }
    }
}

impl StageConfig {
    /// The learning rate of update `step` of this stage.
    #[must_use]
    pub fn learning_rate_at(&self, step: u64) -> f64 {
        let done = step as f64 / self.steps.max(1) as f64;
        if done < self.warmup {
            let risen = 0.5 * (1.0 - (PI * done / self.warmup).cos());
            self.learning_rate * (self.initial_fraction + (1.0 - self.initial_fraction) * risen)
        } else {
            self.learning_rate * 0.5 * (1.0 + (PI * (done - self.warmup) / (1.0 - self.warmup)).cos())
        }
    }
}

/// How a network is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainingConfig {
    /// Seed of the initial weights and of the stream of segments.
    pub seed: u64,
    /// A model whose weights the run begins with, instead of random ones.
    pub start_from: Option<String>,
    /// Scales of inputs and outputs.
    pub scaling: Scaling,
    /// The weights used are a running mean of the trained ones; this is how much of it stays at each update.
    pub weight_average: f64,
    /// Gradients longer than this are shortened to it.
    pub max_gradient_norm: f64,
    /// The optimiser's settings.
    pub adam: AdamConfig,
    /// One after the other.
    pub stages: Vec<StageConfig>,
}

impl Default for TrainingConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            start_from: None,
            scaling: Scaling::default(),
            weight_average: 0.998,
            max_gradient_norm: 10.0,
            adam: AdamConfig::default(),
            stages: vec![StageConfig::default()],
        }
    }
}

impl TrainingConfig {
    /// Updates of all stages.
    #[must_use]
    pub fn total_steps(&self) -> u64 {
        self.stages.iter().map(|stage| stage.steps).sum()
    }

    /// The most calls of any stage: a segment's horizon is that many times the network's outputs.
    #[must_use]
    pub fn most_calls(&self) -> usize {
        self.stages.iter().map(|stage| stage.calls).max().unwrap_or(1)
    }
}

/// What one update did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Update {
    /// Updates done, this one included.
    pub step: u64,
    /// The loss in metres: root mean square error of a displacement, or mean error of a path.
    pub loss_m: f64,
    /// The learning rate used.
    pub learning_rate: f64,
    /// Length of the gradient before it was shortened.
    pub gradient_norm: f64,
}

/// A training run: everything that changes from update to update, and nothing else.
pub struct Trainer {
    pub(super) config: TrainingConfig,
    pub(super) network: ForecastNetwork<f32>,
    pub(super) average: Parameters<f32>,
    pub(super) adam: Adam<f32>,
    pub(super) rng: ChaCha8Rng,
    pub(super) step: u64,
    gradients: Gradients<f32>,
    source: Box<dyn SegmentSource>,
    compute: Compute,
    unrolled: Unrolled,
}

/// Stream of the segments' random numbers; the initial weights come from stream 0.
const SEGMENT_STREAM: u64 = 1;

impl Trainer {
    /// A run that has not begun.
    ///
    /// # Errors
    ///
    /// When a setting is out of range.
    pub fn new(
        kind: ModelKind,
        config: TrainingConfig,
        source: Box<dyn SegmentSource>,
        threads: usize,
    ) -> Result<Self, Fault> {
        config.check(kind).map_err(|fault| fault.within("training"))?;
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
        let network = ForecastNetwork::new(kind.network(), &mut rng);
        rng.set_stream(SEGMENT_STREAM);
        let encoding =
            Encoding { history_len: kind.history_len(), outputs: kind.outputs(), scaling: config.scaling };
        Ok(Self {
            average: network.parameters.frozen(),
            adam: Adam::new(network.parameters.layout(), config.adam.clone()),
            gradients: Gradients::zeros(network.parameters.layout()),
            unrolled: Unrolled::new(encoding),
            compute: Compute::new(threads),
            config,
            network,
            rng,
            step: 0,
            source,
        })
    }

    /// Updates done.
    #[must_use]
    pub fn step(&self) -> u64 {
        self.step
    }

    /// The settings.
    #[must_use]
    pub fn config(&self) -> &TrainingConfig {
        &self.config
    }

    /// The weights to use: the running mean.
    #[must_use]
    pub fn weights(&self) -> &Parameters<f32> {
        &self.average
    }

    /// The stage of the next update and how many updates of it are done; nothing at the end.
    fn stage(&self) -> Option<(StageConfig, u64)> {
        let mut before = 0;
        for stage in &self.config.stages {
            if self.step < before + stage.steps {
                return Some((*stage, self.step - before));
            }
            before += stage.steps;
        }
        None
    }

    /// Does one update; nothing once all stages are done.
    pub fn update(&mut self) -> Option<Update> {
        let (stage, done) = self.stage()?;
        let segments: Vec<Segment> = (0..stage.batch).map(|_| self.source.draw(&mut self.rng)).collect();
        let loss_m = self.unrolled.loss_and_gradients(
            &mut self.compute,
            &self.network,
            &stage,
            &segments,
            &mut self.gradients,
        );
        let gradient_norm = shorten(&mut self.gradients, self.config.max_gradient_norm);
        let learning_rate = stage.learning_rate_at(done);
        self.adam.step(&mut self.compute, &mut self.network.parameters, &self.gradients, learning_rate);
        self.step += 1;
        // The mean forgets the initial weights sooner than its length would allow.
        let kept = self.config.weight_average.min(self.step as f64 / (9.0 + self.step as f64));
        self.average.follow(&mut self.compute, &self.network.parameters, 1.0 - kept);
        Some(Update { step: self.step, loss_m, learning_rate, gradient_norm })
    }
}

/// Scales gradients down to a length; gives the length they had. A gradient that is not finite is dropped.
fn shorten(gradients: &mut Gradients<f32>, longest: f64) -> f64 {
    let square: f64 = gradients.values().iter().map(|&g| f64::from(g) * f64::from(g)).sum();
    let norm = square.sqrt();
    if !norm.is_finite() {
        gradients.clear();
    } else if norm > longest {
        let scale = (longest / norm) as f32;
        gradients.values_mut().iter_mut().for_each(|g| *g *= scale);
    }
    norm
}

#[cfg(test)]
mod tests {
    use super::super::dataset::{Process, SyntheticConfig, SyntheticSegments};
    use super::super::{
        DataConfig, EvaluationConfig, LstmForecaster, Model, ModelConfig, ModelError, evaluate, quantiles_of,
    };
    use super::*;
    use crate::nn::weights::WeightsFile;
    use crate::vessel::PeriodicConfig;

    fn config(seed: u64, stages: Vec<StageConfig>) -> ModelConfig {
        ModelConfig {
            name: "test".into(),
            kind: ModelKind::OpenWater,
            data: DataConfig::Synthetic {
                process: Process::Periodic(PeriodicConfig::default()),
                segments: SyntheticConfig::default(),
            },
            training: TrainingConfig { seed, stages, ..Default::default() },
        }
    }

    fn source(horizon: usize) -> SyntheticSegments {
        SyntheticSegments {
            process: Process::Periodic(PeriodicConfig::default()),
            config: SyntheticConfig { earliest_step: 60, latest_step: 60, ..Default::default() },
            history_len: 10,
            horizon,
        }
    }

    fn trainer(config: &ModelConfig) -> Trainer {
        let source = source(config.training.most_calls());
        Trainer::new(config.kind, config.training.clone(), Box::new(source), 1).unwrap()
    }

    fn two_stages() -> Vec<StageConfig> {
        let first = StageConfig { steps: 4, batch: 8, ..Default::default() };
        vec![first, StageConfig { steps: 4, calls: 3, history_steps: 5, loss: Loss::Path, ..first }]
    }

    fn file(bytes: Vec<u8>) -> WeightsFile {
        WeightsFile::from_bytes(std::path::Path::new("run/checkpoint.safetensors"), bytes).unwrap()
    }

    #[test]
    fn the_rate_rises_and_falls_once() {
        let stage = StageConfig { steps: 100, learning_rate: 1.0, ..Default::default() };
        let rates: Vec<f64> = (0..100).map(|step| stage.learning_rate_at(step)).collect();
        assert!((rates[0] - 0.04).abs() < 1e-12 && (rates[25] - 1.0).abs() < 1e-12 && rates[99] < 1e-3);
        assert!(rates[..26].is_sorted() && rates[25..].iter().rev().is_sorted());
    }

    #[test]
    fn a_run_stopped_and_resumed_is_the_same_run() {
        let config = config(7, two_stages());
        let mut whole = trainer(&config);
        let mut updates = Vec::new();
        while let Some(update) = whole.update() {
            updates.push(update);
        }
        assert_eq!(updates.len(), 8);
        for stop in [3, 6] {
            let mut first = trainer(&config);
            (0..stop).for_each(|_| assert!(first.update().is_some()));
            let bytes = first.checkpoint(&config, None).to_bytes();
            let mut second = trainer(&config);
            second.resume(&config, file(bytes)).unwrap();
            for expected in &updates[stop..] {
                assert_eq!(second.update().as_ref(), Some(expected));
            }
            assert_eq!(second.update(), None);
            assert_eq!(
                second.checkpoint(&config, None).to_bytes(),
                whole.checkpoint(&config, None).to_bytes()
            );
        }
    }

    #[test]
    fn a_checkpoint_of_another_run_is_refused() {
        let (mine, other) = (config(1, two_stages()), config(2, two_stages()));
        let bytes = trainer(&other).checkpoint(&other, None).to_bytes();
        let error = trainer(&mine).resume(&mine, file(bytes)).unwrap_err();
        assert!(matches!(error, ModelError::OtherRun { .. }), "{error}");
        let model = Model::of(&trainer(&mine), &mine, None).to_file().to_bytes();
        assert!(trainer(&mine).resume(&mine, file(model)).is_err());
    }

    #[test]
    fn a_model_survives_its_file() {
        let config = config(3, two_stages());
        let model = Model::of(&trainer(&config), &config, None);
        let back = Model::from_file(file(model.to_file().to_bytes())).unwrap();
        assert_eq!((&back.config, back.steps), (&config, 0));
        let segments = source(30).take(5, &mut ChaCha8Rng::seed_from_u64(1));
        let errors = |model| {
            quantiles_of(&mut LstmForecaster::new(model, 1), &segments, &EvaluationConfig::default()).unwrap()
        };
        assert_eq!(errors(model), errors(back));
    }

    #[test]
    fn a_run_can_begin_with_the_weights_of_a_model() {
        let config = config(3, two_stages());
        let mut first = trainer(&config);
        while first.update().is_some() {}
        let model = Model::of(&first, &config, None);
        let mut second = trainer(&config);
        second.start_from("model", &model).unwrap();
        assert_eq!((second.step(), second.weights().values()), (0, first.weights().values()));
        assert!(second.update().is_some());
        let mut scaled = config.clone();
        scaled.training.scaling.step_m = 7.0;
        let error = trainer(&scaled).start_from("model", &model).unwrap_err();
        assert!(matches!(error, ModelError::OtherStart { .. }), "{error}");
    }

    #[test]
    fn a_damaged_model_is_refused() {
        let config = config(3, two_stages());
        let mut trained = trainer(&config);
        let model = Model::of(&trained, &config, None);
        let coastal = ModelConfig { kind: ModelKind::Coastal, ..config.clone() };
        let lies = Model { config: coastal, ..model }.to_file().to_bytes();
        let error = Model::from_file(file(lies)).unwrap_err();
        assert!(matches!(error, ModelError::OtherNetwork { .. }), "{error}");
        trained.average.update(|weights| weights[0] = f32::NAN);
        let diverged = Model::of(&trained, &config, None).to_file().to_bytes();
        assert!(Model::from_file(file(diverged)).is_err());
        let mut short = Model::of(&trainer(&config), &config, None).to_file().to_bytes();
        short.truncate(short.len() - 4);
        assert!(WeightsFile::from_bytes(std::path::Path::new("short"), short).is_err());
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let refused =
            |training: TrainingConfig| training.check(ModelKind::OpenWater).unwrap_err().to_string();
        let stage = StageConfig { history_steps: 10, ..Default::default() };
        let stages = vec![StageConfig::default(), stage];
        let text = refused(TrainingConfig { stages, ..Default::default() });
        assert!(text.contains("stages[2].history_steps"), "{text}");
        assert!(refused(TrainingConfig { stages: vec![], ..Default::default() }).contains("stages"));
        assert!(
            refused(TrainingConfig { weight_average: 1.0, ..Default::default() }).contains("weight_average")
        );
    }

    /// A few seconds of training already beat the straight line on fresh segments.
    #[test]
    fn training_learns_the_weave() {
        let stage = StageConfig { steps: 300, batch: 32, learning_rate: 5e-3, ..Default::default() };
        let rollout = StageConfig { steps: 100, calls: 3, loss: Loss::Path, learning_rate: 2e-3, ..stage };
        let mut config = config(1, vec![stage, rollout]);
        config.training.weight_average = 0.95;
        let mut trainer = trainer(&config);
        while trainer.update().is_some() {}
        let segments = source(4).take(200, &mut ChaCha8Rng::seed_from_u64(99));
        let mut forecaster = LstmForecaster::new(Model::of(&trainer, &config, None), 1);
        let evaluation =
            evaluate(&mut forecaster, &segments, &|_| false, &EvaluationConfig::default()).unwrap();
        assert!(evaluation.median_ratio < 0.7, "{}", evaluation.median_ratio);
    }
}
