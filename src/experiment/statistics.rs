//! Estimates with intervals: means (Student's t), proportions (Wilson), ratios of means (bootstrap).
//!
//! Quantiles of the distributions come from `statrs`; the tests compare with published tables and
//! worked examples.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// The confidence that figures and tables state unless told otherwise.
pub const CONFIDENCE: f64 = 0.95;

/// A two-sided interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
}

impl Interval {
    /// Whether no value lies in both.
    #[must_use]
    pub fn is_disjoint_from(self, other: Self) -> bool {
        self.high < other.low || other.high < self.low
    }
}

/// A value and how well the data determine it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its interval; nothing where the data do not determine one, such as a single value.
    pub interval: Option<Interval>,
}

/// The mean of independent values with Student's t-interval: `mean ± t s / sqrt(n)`, `s` the sample
/// standard deviation and `t` the quantile with `n - 1` degrees of freedom.
///
/// `None` without values. A single value has no interval.
#[must_use]
pub fn mean(values: &[f64], confidence: f64) -> Option<Estimate> {
    let value = mean_of(values)?;
    Some(Estimate { value, interval: mean_interval(values, value, confidence) })
}

fn mean_interval(values: &[f64], mean: f64, confidence: f64) -> Option<Interval> {
    let count = values.len() as f64;
    let half_width =
        student_t(confidence, values.len().checked_sub(1)?)? * standard_deviation(values)? / count.sqrt();
    Some(Interval { low: mean - half_width, high: mean + half_width })
}

/// The sample standard deviation (divisor `n - 1`); `None` for fewer than two values.
#[must_use]
pub fn standard_deviation(values: &[f64]) -> Option<f64> {
    let mean = mean_of(values)?;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (values.len() > 1).then(|| (squares / (values.len() - 1) as f64).sqrt())
}

/// A proportion with Wilson's score interval (Wilson 1927, Journal of the American Statistical
/// Association 22, 209-212), without continuity correction. It stays within 0 and 1 and has a width
/// even where nothing, or everything, was a success.
///
/// `None` without trials, or with more successes than trials.
#[must_use]
pub fn proportion(successes: u64, trials: u64, confidence: f64) -> Option<Estimate> {
    if trials == 0 || successes > trials {
        return None;
    }
    let (count, value) = (trials as f64, successes as f64 / trials as f64);
    let interval = normal_z(confidence).map(|z| {
        let shrunk = z * z / count;
        let centre = (value + shrunk / 2.0) / (1.0 + shrunk);
        let half_width = z * (value * (1.0 - value) / count + shrunk / (4.0 * count)).sqrt() / (1.0 + shrunk);
        // Rounding must not carry the ends past what a proportion can be.
        let low = if successes == 0 { 0.0 } else { (centre - half_width).max(0.0) };
        let high = if successes == trials { 1.0 } else { (centre + half_width).min(1.0) };
        Interval { low, high }
    });
    Some(Estimate { value, interval })
}

/// How a bootstrap resamples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BootstrapConfig {
    /// Resamples.
    pub resamples: usize,
    /// Confidence of the interval.
    pub confidence: f64,
    /// Seed of the resampling.
    pub seed: u64,
}

impl Default for BootstrapConfig {
    fn default() -> Self {
        Self { resamples: 10_000, confidence: CONFIDENCE, seed: 1 }
    }
}

/// The ratio of two means over the same units, such as the wrong passings of two agents in the same
/// episodes, with the bootstrap's percentile interval (Efron & Tibshirani 1993, An Introduction to the
/// Bootstrap, chapter 13): units are drawn with replacement, each with both its values, numerator
/// first.
///
/// `None` without units or where the denominator's mean is 0. No interval where that can happen in a
/// resample too often for the quantiles to exist, or with a single unit.
#[must_use]
pub fn ratio_of_paired_means(units: &[(f64, f64)], config: &BootstrapConfig) -> Option<Estimate> {
    let ratio = |sums: (f64, f64)| sums.0 / sums.1;
    let add = |sums: (f64, f64), unit: (f64, f64)| (sums.0 + unit.0, sums.1 + unit.1);
    let value = ratio(units.iter().copied().fold((0.0, 0.0), add));
    let interval = (units.len() > 1).then(|| {
        percentile_interval(config, |rng| {
            let drawn = (0..units.len()).map(|_| units[rng.random_range(0..units.len())]);
            ratio(drawn.fold((0.0, 0.0), add))
        })
    });
    value.is_finite().then_some(Estimate { value, interval: interval.flatten() })
}

/// The ratio of the means of two independent samples, as [`ratio_of_paired_means`] but each sample
/// resampled by itself.
#[must_use]
pub fn ratio_of_means(numerator: &[f64], denominator: &[f64], config: &BootstrapConfig) -> Option<Estimate> {
    let value = mean_of(numerator)? / mean_of(denominator)?;
    let interval = (numerator.len() > 1 && denominator.len() > 1).then(|| {
        percentile_interval(config, |rng| {
            let mut resampled = |values: &[f64]| {
                let drawn = (0..values.len()).map(|_| values[rng.random_range(0..values.len())]);
                drawn.sum::<f64>() / values.len() as f64
            };
            resampled(numerator) / resampled(denominator)
        })
    });
    value.is_finite().then_some(Estimate { value, interval: interval.flatten() })
}

/// Quantiles of a statistic over resamples. A resample without a value (0 over 0) says nothing and is
/// left out; `None` where an end of the interval would lie at infinity.
fn percentile_interval(
    config: &BootstrapConfig,
    mut statistic: impl FnMut(&mut ChaCha8Rng) -> f64,
) -> Option<Interval> {
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut values: Vec<f64> = (0..config.resamples).map(|_| statistic(&mut rng)).collect();
    values.retain(|value| !value.is_nan());
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)? as f64;
    let quantile = |probability: f64| values[(probability * last).round() as usize];
    let tail = 0.5 * (1.0 - config.confidence.clamp(0.0, 1.0));
    let interval = Interval { low: quantile(tail), high: quantile(1.0 - tail) };
    (interval.low.is_finite() && interval.high.is_finite()).then_some(interval)
}

fn mean_of(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The two-sided quantile of Student's t; `None` for no degrees of freedom or a confidence that is
/// none.
fn student_t(confidence: f64, degrees_of_freedom: usize) -> Option<f64> {
    let distribution = StudentsT::new(0.0, 1.0, degrees_of_freedom as f64).ok()?;
    Some(distribution.inverse_cdf(upper_probability(confidence)?))
}

/// The two-sided quantile of the standard normal distribution.
fn normal_z(confidence: f64) -> Option<f64> {
    let distribution = Normal::new(0.0, 1.0).ok()?;
    Some(distribution.inverse_cdf(upper_probability(confidence)?))
}

fn upper_probability(confidence: f64) -> Option<f64> {
    (confidence > 0.0 && confidence < 1.0).then_some(0.5 + 0.5 * confidence)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(value: f64, expected: f64, tolerance: f64) {
        assert!((value - expected).abs() <= tolerance, "{value} is not {expected}");
    }

    /// NIST/SEMATECH e-Handbook of Statistical Methods, section 1.3.6.7.2, upper critical values.
    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (degrees, confidence, t) in [
            (1, 0.95, 12.706),
            (2, 0.95, 4.303),
            (9, 0.95, 2.262),
            (14, 0.95, 2.145),
            (14, 0.90, 1.761),
            (99, 0.95, 1.984),
            (10, 0.99, 3.169),
        ] {
            assert_near(student_t(confidence, degrees).unwrap(), t, 5e-4);
        }
        assert_near(normal_z(0.95).unwrap(), 1.959_963_985, 1e-8);
        assert_eq!((normal_z(1.0), student_t(0.95, 0)), (None, None));
    }

    /// Student (1908), Biometrika 6, table of additional hours of sleep, second drug less first: mean
    /// 1.58; 95 % interval 0.70 to 2.46 (as R's `t.test` on its data set `sleep` prints).
    #[test]
    fn a_mean_has_students_interval() {
        let extra_h = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4];
        let estimate = mean(&extra_h, 0.95).unwrap();
        assert_near(estimate.value, 1.58, 1e-12);
        assert_near(estimate.interval.unwrap().low, 0.700_114_2, 1e-6);
        assert_near(estimate.interval.unwrap().high, 2.459_885_8, 1e-6);
        assert_eq!(mean(&[3.0], 0.95), Some(Estimate { value: 3.0, interval: None }));
        assert_eq!(mean(&[], 0.95), None);
    }

    /// Newcombe (1998), Statistics in Medicine 17, 857-872, table I, method 3 (score, no continuity
    /// correction).
    #[test]
    fn proportions_have_wilsons_interval() {
        for (successes, trials, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let interval = proportion(successes, trials, 0.95).unwrap().interval.unwrap();
            assert_near(interval.low, low, 5e-5);
            assert_near(interval.high, high, 5e-5);
        }
        assert_eq!(proportion(20, 20, 0.95).unwrap().interval.unwrap().high, 1.0);
        assert_eq!((proportion(0, 0, 0.95), proportion(3, 2, 0.95)), (None, None));
    }

    /// Efron & Tibshirani (1993), table 10.1: the patch data, whose ratio is -0.0713.
    const PATCH: [(f64, f64); 8] = [
        (-1200.0, 8406.0),
        (2601.0, 2342.0),
        (-2705.0, 8187.0),
        (1982.0, 8459.0),
        (-1290.0, 4795.0),
        (351.0, 3516.0),
        (-638.0, 4796.0),
        (-2719.0, 10238.0),
    ];

    /// The same chapter's data; the interval agrees with a million resamples by other code, -0.212 to
    /// 0.122 at 90 %.
    #[test]
    fn a_ratio_has_the_bootstrap_interval() {
        let config = BootstrapConfig { resamples: 40_000, confidence: 0.9, ..BootstrapConfig::default() };
        let estimate = ratio_of_paired_means(&PATCH, &config).unwrap();
        assert_near(estimate.value, -0.0713, 5e-5);
        assert_near(estimate.interval.unwrap().low, -0.212, 4e-3);
        assert_near(estimate.interval.unwrap().high, 0.122, 4e-3);
        assert_eq!(ratio_of_paired_means(&PATCH, &config), Some(estimate), "equal seeds, equal intervals");
    }

    /// With many units the interval is that of the delta method, `r ± z sqrt(var(x - r y) / n) / mean(y)`,
    /// and, without pairing, of the sum of both relative variances.
    #[test]
    fn ratios_of_many_units_agree_with_the_delta_method() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let units: Vec<(f64, f64)> = (0..4000)
            .map(|_| {
                let common = rng.random_range(0.0..2.0);
                (common + rng.random_range(0.0..1.0), 2.0 * common + rng.random_range(1.0..3.0))
            })
            .collect();
        let config = BootstrapConfig { resamples: 4000, ..BootstrapConfig::default() };
        let (x, y): (Vec<f64>, Vec<f64>) = units.iter().copied().unzip();
        let (mean_x, mean_y) = (mean_of(&x).unwrap(), mean_of(&y).unwrap());
        let ratio = mean_x / mean_y;
        let residuals: Vec<f64> = units.iter().map(|(x, y)| x - ratio * y).collect();
        let error = |deviation: f64| normal_z(0.95).unwrap() * deviation / 4000_f64.sqrt();
        let paired = error(standard_deviation(&residuals).unwrap()) / mean_y;
        let relative =
            (standard_deviation(&x).unwrap() / mean_x).hypot(standard_deviation(&y).unwrap() / mean_y);
        let apart = error(relative) * ratio;
        for (estimate, half_width) in [
            (ratio_of_paired_means(&units, &config).unwrap(), paired),
            (ratio_of_means(&x, &y, &config).unwrap(), apart),
        ] {
            let Interval { low, high } = estimate.interval.unwrap();
            assert_near((high - low) / 2.0, half_width, 0.06 * half_width);
            assert_near((high + low) / 2.0, ratio, 0.1 * half_width);
        }
    }

    #[test]
    fn ratios_that_do_not_exist_are_told() {
        let config = BootstrapConfig { resamples: 500, ..BootstrapConfig::default() };
        assert_eq!(ratio_of_paired_means(&[], &config), None);
        assert_eq!(ratio_of_paired_means(&[(1.0, 0.0), (2.0, 0.0)], &config), None);
        assert_eq!(ratio_of_means(&[1.0], &[], &config), None);
        // A third of all resamples have a denominator of 0.
        let rare = ratio_of_paired_means(&[(1.0, 0.0), (2.0, 0.0), (1.0, 1.0)], &config).unwrap();
        assert_eq!((rare.value, rare.interval), (4.0, None));
    }
}
