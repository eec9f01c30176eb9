//! The desired lateral path: what the agent has to follow roughly to keep the passing rules.

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::OpenWaterConfig;

/// `y_traj`, a smoothed AR(1) process over the steps of an episode and some before and after it
/// (paper, appendix "Environment details").
#[derive(Debug, Clone, PartialEq)]
pub struct DesiredPath {
    lateral_m: Vec<f64>,
    lead_steps: usize,
}

impl DesiredPath {
    /// Draws the path of one episode: `B_0 = 0`, `B_{k+1} = phi B_k + u_k`, smoothed with `beta`.
    #[must_use]
    pub fn draw(config: &OpenWaterConfig, rng: &mut impl Rng) -> Self {
        let steps = config.path_lead_steps + config.decisions + config.path_trail_steps;
        let innovation_sd_m = config.path_innovation_variance_m2.sqrt();
        let (mut process, mut smoothed) = (0.0, 0.0);
        let mut lateral_m = Vec::with_capacity(steps + 1);
        lateral_m.push(smoothed);
        for _ in 0..steps {
            let innovation: f64 = rng.sample(StandardNormal);
            process = config.path_phi * process + innovation_sd_m * innovation;
            smoothed += config.path_beta * (process - smoothed);
            lateral_m.push(smoothed);
        }
        Self { lateral_m, lead_steps: config.path_lead_steps }
    }

    /// `y_traj` at a time counted in steps from the start of the episode: linear between steps, held
    /// at either end.
    #[must_use]
    pub fn at(&self, step: f64) -> f64 {
        let last = self.lateral_m.len() - 1;
        let place = (step + self.lead_steps as f64).clamp(0.0, last as f64);
        let before = (place as usize).min(last.saturating_sub(1));
        let after = (before + 1).min(last);
        self.lateral_m[before] + (self.lateral_m[after] - self.lateral_m[before]) * (place - before as f64)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn the_path_is_read_linearly_and_held_at_its_ends() {
        let path = DesiredPath { lateral_m: vec![0.0, 10.0, 30.0], lead_steps: 1 };
        for (step, expected) in
            [(-2.0, 0.0), (-1.0, 0.0), (-0.5, 5.0), (0.0, 10.0), (0.25, 15.0), (9.0, 30.0)]
        {
            assert_eq!(path.at(step), expected);
        }
    }

    /// Far from its start the smoothed AR(1) is an AR(2) with roots `phi` and `1 - beta`.
    #[test]
    fn its_spread_is_that_of_the_closed_form() {
        let config = OpenWaterConfig { decisions: 600, ..OpenWaterConfig::default() };
        let (phi, gamma) = (config.path_phi, 1.0 - config.path_beta);
        let innovation = config.path_beta * config.path_innovation_variance_m2.sqrt();
        let variance = innovation.powi(2) * (1.0 + phi * gamma)
            / ((1.0 - phi * phi) * (1.0 - gamma * gamma) * (1.0 - phi * gamma));
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let draws = 4000;
        let mean_square =
            (0..draws).map(|_| DesiredPath::draw(&config, &mut rng).at(600.0).powi(2)).sum::<f64>()
                / f64::from(draws);
        assert!((mean_square / variance - 1.0).abs() < 0.08, "{mean_square} against {variance}");
    }
}
