//! What the numbers of a forecaster's settings can be.

use super::dataset::Process;
use super::{DataConfig, ModelConfig, ModelKind, StageConfig, TrainingConfig};
use crate::config::bounds::{COUNT, FRACTION, HELD, POSITIVE, SIZE, STEP_S};
use crate::config::{BoundedNumber, Fault, check_bounds};

/// From 0 up to, not including, 1.
const BELOW_ONE: [f64; 2] = [0.0, 1.0 - 1e-9];

impl ModelConfig {
    /// Checks that every number can be worked with.
    ///
    /// # Errors
    ///
    /// The first that cannot, and what to write instead.
    pub fn check(&self) -> Result<(), Fault> {
        match &self.data {
            DataConfig::Synthetic { process, segments } => {
                let (name, numbers) = match process {
                    Process::Stochastic(process) => ("stochastic", process.numbers()),
                    Process::Periodic(process) => ("periodic", process.numbers()),
                };
                check(&format!("data.synthetic.process.{name}"), numbers)?;
                let earliest = segments.earliest_step as f64;
                let numbers = vec![
                    ("component_mps", segments.component_mps, POSITIVE),
                    ("earliest_step", earliest, SIZE),
                    ("latest_step", segments.latest_step as f64, [earliest, 1e6]),
                    ("dt_s", segments.dt_s, STEP_S),
                ];
                check("data.synthetic.segments", numbers)?;
            }
            DataConfig::Recorded { dt_s, split, segments, .. } => {
                check("data.recorded", vec![("dt_s", *dt_s, STEP_S)])?;
                check("data.recorded.split", split.numbers())?;
                let least_noise_m = segments.least_noise_m;
                let numbers = vec![
                    ("curve_share", segments.curve_share, FRACTION),
                    ("curve_deg", segments.curve_deg, [0.0, 180.0]),
                    // Uniform in its logarithm.
                    ("least_noise_m", least_noise_m, POSITIVE),
                    ("most_noise_m", segments.most_noise_m, [least_noise_m, 1e6]),
                    ("shift_m", segments.shift_m, SIZE),
                ];
                check("data.recorded.segments", numbers)?;
            }
        }
        self.training.check(self.kind).map_err(|fault| fault.within("training"))
    }
}

impl TrainingConfig {
    /// Checks that a network of this kind can be trained so.
    ///
    /// # Errors
    ///
    /// The first value that does not allow it, and what to write instead.
    pub fn check(&self, kind: ModelKind) -> Result<(), Fault> {
        let scaling =
            vec![("step_m", self.scaling.step_m, POSITIVE), ("anchor_m", self.scaling.anchor_m, POSITIVE)];
        check("scaling", scaling)?;
        let means = vec![
            ("weight_average", self.weight_average, BELOW_ONE),
            ("max_gradient_norm", self.max_gradient_norm, [1e-9, 1e12]),
        ];
        check("", means)?;
        let adam = vec![
            ("beta_1", self.adam.beta_1, BELOW_ONE),
            ("beta_2", self.adam.beta_2, BELOW_ONE),
            ("epsilon", self.adam.epsilon, [1e-30, 1.0]),
        ];
        check("adam", adam)?;
        if self.total_steps() == 0 {
            let remedy = "give at least one [[training.stages]] with steps above 0";
            return Err(Fault::new("stages", "no stage has steps", remedy));
        }
        for (stage, number) in self.stages.iter().zip(1..) {
            check(&format!("stages[{number}]"), stage.numbers(kind))?;
        }
        Ok(())
    }
}

impl StageConfig {
    fn numbers(&self, kind: ModelKind) -> Vec<BoundedNumber> {
        let displacements = kind.history_len() - 1;
        vec![
            ("steps", self.steps as f64, COUNT),
            ("batch", self.batch as f64, HELD),
            ("calls", self.calls as f64, HELD),
            ("history_steps", self.history_steps as f64, [0.0, displacements as f64]),
            ("learning_rate", self.learning_rate, [1e-12, 1.0]),
            ("warmup", self.warmup, BELOW_ONE),
            ("initial_fraction", self.initial_fraction, FRACTION),
        ]
    }
}

fn check(table: &str, numbers: Vec<BoundedNumber>) -> Result<(), Fault> {
    check_bounds(numbers).map_err(|fault| fault.within(table))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forecast::SplitConfig;
    use crate::forecast::dataset::{RecordedConfig, SyntheticConfig};
    use crate::vessel::StochasticConfig;

    fn recorded(segments: RecordedConfig) -> ModelConfig {
        let split = SplitConfig::default();
        let data =
            DataConfig::Recorded { area: "area.toml".into(), files: vec![], dt_s: 5.0, split, segments };
        let training = TrainingConfig::default();
        ModelConfig { name: "some".into(), kind: ModelKind::Coastal, data, training }
    }

    fn synthetic(phi: f64, segments: SyntheticConfig) -> ModelConfig {
        let process = Process::Stochastic(StochasticConfig { phi, ..StochasticConfig::default() });
        let data = DataConfig::Synthetic { process, segments };
        ModelConfig { kind: ModelKind::OpenWater, data, ..recorded(RecordedConfig::default()) }
    }

    #[test]
    fn defaults_are_within_their_bounds() {
        assert_eq!(recorded(RecordedConfig::default()).check(), Ok(()));
        assert_eq!(synthetic(0.9, SyntheticConfig::default()).check(), Ok(()));
    }

    #[test]
    fn what_segments_cannot_be_drawn_with_is_named() {
        let key = |config: ModelConfig| config.check().unwrap_err().key;
        let noise = RecordedConfig { least_noise_m: 30.0, ..RecordedConfig::default() };
        assert_eq!(key(recorded(noise)), "data.recorded.segments.most_noise_m");
        let phi = synthetic(f64::NAN, SyntheticConfig::default());
        assert_eq!(key(phi), "data.synthetic.process.stochastic.phi");
        let late = SyntheticConfig { earliest_step: 400, ..SyntheticConfig::default() };
        assert_eq!(key(synthetic(0.9, late)), "data.synthetic.segments.latest_step");
    }
}
