//! Tuning of the classical policies, in the open: a random search by successive halving over the settings of one
//! policy, on encounters of the training seeds alone.
//!
//! Each round runs the settings that are left on more encounters, the same for all of them, and keeps the best
//! quarter (Jamieson and Talwalkar, Non-stochastic best arm identification and hyperparameter optimization,
//! AISTATS 2016). The settings in force are among them from the first round to the last. What the search came to
//! is then compared with them on encounters of the evaluation seeds, which it has not seen.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::encounter::RulesConfig;
use crate::env::SeedDomain;
use crate::policy::PolicyConfigs;
use crate::scenario::StagedEncounter;
use crate::scenario::drawn::DrawnEncounters;

/// A key of a policy's settings, its least and its greatest value.
pub type Searched = (&'static str, f64, f64);

/// Settings that are searched, per policy.
pub const SPACES: [(&str, &[Searched]); 4] = [
    (
        "rule-based",
        &[("margin_m", 50.0, 600.0), ("horizon_s", 300.0, 1500.0), ("lookahead_m", 500.0, 3000.0)],
    ),
    (
        "velocity-obstacle",
        &[
            ("margin_m", 50.0, 600.0),
            ("horizon_s", 300.0, 1500.0),
            ("port_cost", 0.0, 1.0),
            ("speed_cost", 0.5, 5.0),
            ("lookahead_m", 500.0, 3000.0),
            ("duties.stand_on_until_s", 200.0, 700.0),
            ("duties.clear_factor", 1.0, 1.6),
            ("duties.apparent_turn_deg", 0.0, 45.0),
        ],
    ),
    (
        "potential-field",
        &[
            ("margin_m", 50.0, 900.0),
            ("horizon_s", 300.0, 1800.0),
            ("passing_gain", 0.5, 10.0),
            ("near_margin_m", 0.0, 600.0),
            ("near_gain", 0.0, 10.0),
            ("lookahead_m", 500.0, 3000.0),
            ("duties.stand_on_until_s", 200.0, 700.0),
            ("duties.clear_factor", 1.0, 1.6),
            ("duties.apparent_turn_deg", 0.0, 45.0),
        ],
    ),
    (
        "mpc",
        &[
            ("margin_m", 50.0, 600.0),
            ("horizon_s", 300.0, 1500.0),
            ("collision_cost", 1.0, 100.0),
            ("near_time_s", 20.0, 300.0),
            ("time_exponent", 0.0, 1.0),
            ("rule_cost", 0.5, 20.0),
            ("speed_cost", 0.5, 5.0),
            ("port_cost", 0.0, 2.0),
            ("change_cost", 0.0, 1.0),
            ("lookahead_m", 500.0, 3000.0),
            ("duties.stand_on_until_s", 200.0, 700.0),
            ("duties.clear_factor", 1.0, 1.6),
            ("duties.apparent_turn_deg", 0.0, 45.0),
        ],
    ),
];

/// How settings are searched and judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TuningConfig {
    /// Settings drawn for the first round, those in force included.
    pub candidates: usize,
    /// Encounters of the first round; four times as many in each round after it.
    pub encounters: usize,
    /// Rounds.
    pub rounds: usize,
    /// Encounters of the final comparison.
    pub evaluation_encounters: usize,
    /// Loss of a contact.
    pub contact_loss: f64,
    /// Loss of a compliance score of 0.
    pub compliance_loss: f64,
    /// Loss of a largest cross-track error of a nautical mile.
    pub cross_track_loss: f64,
    /// Seed of the settings that are drawn.
    pub seed: u64,
    /// What counts as an encounter and as good conduct in it.
    pub rules: RulesConfig,
    /// What encounters are drawn.
    pub drawn: DrawnEncounters,
}

impl Default for TuningConfig {
    fn default() -> Self {
        Self {
            candidates: 64,
            encounters: 24,
            rounds: 3,
            evaluation_encounters: 500,
            contact_loss: 1.0,
            compliance_loss: 0.5,
            cross_track_loss: 0.2,
            seed: 1,
            rules: RulesConfig::default(),
            drawn: DrawnEncounters::default(),
        }
    }
}

/// How a policy did with some settings.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Score {
    /// Mean loss.
    pub loss: f64,
    /// Episodes with contact, as a fraction.
    pub contact_rate: f64,
    /// Mean compliance of the episodes with an encounter.
    pub compliance: f64,
    /// Mean largest cross-track error, in metres.
    pub cross_track_m: f64,
}

/// What a search came to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tuned {
    /// The policy.
    pub policy: String,
    /// The best settings found; those in force where none is better.
    pub best: PolicyConfigs,
    /// How they did in the last round.
    pub training: Score,
    /// How they do on encounters that the search has not seen.
    pub evaluation: Score,
    /// How the settings in force do on those.
    pub in_force: Score,
}

/// One episode, as the loss sees it.
#[derive(Debug, Clone, Copy)]
struct Trial {
    contact: bool,
    compliance: Option<f64>,
    cross_track_m: f64,
}

/// Searches better settings of a policy; nothing where [`SPACES`] has none of that name. `done` hears of every
/// episode that was run. The result does not depend on the number of threads.
#[must_use]
pub fn tune(
    policy: &str,
    in_force: &PolicyConfigs,
    config: &TuningConfig,
    done: &(dyn Fn() + Sync),
) -> Option<Tuned> {
    let (_, space) = SPACES.iter().find(|(name, _)| *name == policy)?;
    let rng = &mut ChaCha8Rng::seed_from_u64(config.seed);
    let drawn = (1..config.candidates).filter_map(|_| {
        let values = space.iter().map(|&(key, least, most)| (key, rng.random_range(least..=most)));
        with(in_force, policy, &values.collect::<Vec<_>>())
    });
    let mut ranked: Vec<(Score, PolicyConfigs)> =
        std::iter::once(in_force.clone()).chain(drawn).map(|settings| (Score::default(), settings)).collect();
    let mut encounters = config.encounters;
    for _ in 0..config.rounds {
        let staged = draw(config, SeedDomain::Training, encounters);
        for (score, settings) in &mut ranked {
            *score = judge(policy, settings, &staged, config, done);
        }
        // A stable sort: of equal ones the settings in force come first.
        ranked.sort_by(|a, b| a.0.loss.total_cmp(&b.0.loss));
        let kept = ranked.len().div_ceil(4);
        let place = ranked.iter().position(|(_, settings)| settings == in_force);
        if let Some(own) = place.filter(|&place| place >= kept).map(|place| ranked[place].clone()) {
            ranked[kept] = own;
            ranked.truncate(kept + 1);
        } else {
            ranked.truncate(kept);
        }
        encounters *= 4;
    }
    let (training, best) = ranked.swap_remove(0);
    let unseen = draw(config, SeedDomain::Evaluation, config.evaluation_encounters);
    Some(Tuned {
        policy: policy.to_owned(),
        training,
        evaluation: judge(policy, &best, &unseen, config, done),
        in_force: judge(policy, in_force, &unseen, config, done),
        best,
    })
}

/// Episodes that [`tune`] runs at most.
#[must_use]
pub fn episodes(config: &TuningConfig) -> usize {
    let mut candidates = config.candidates.max(1);
    let mut sum = 2 * config.evaluation_encounters;
    for round in 0..config.rounds {
        sum += candidates * config.encounters * 4_usize.pow(round as u32);
        candidates = (candidates.div_ceil(4) + 1).min(candidates);
    }
    sum
}

fn draw(config: &TuningConfig, domain: SeedDomain, count: usize) -> Vec<StagedEncounter> {
    (0..count as u64).map(|index| config.drawn.draw(domain.seed(index))).collect()
}

/// The settings with some values of one policy replaced, to three digits; nothing where a key is not one.
fn with(settings: &PolicyConfigs, policy: &str, values: &[(&str, f64)]) -> Option<PolicyConfigs> {
    let mut root = toml::Table::try_from(settings).ok()?;
    for (key, value) in values {
        let mut table = root.get_mut(policy)?.as_table_mut()?;
        let mut path = key.split('.').peekable();
        while let Some(part) = path.next() {
            if path.peek().is_some() {
                table = table.get_mut(part)?.as_table_mut()?;
            } else {
                *table.get_mut(part)? = toml::Value::Float(rounded(*value));
            }
        }
    }
    root.try_into().ok()
}

/// To three significant digits.
fn rounded(value: f64) -> f64 {
    // By way of text, so that it is the number that a person would write.
    format!("{value:.2e}").parse().unwrap_or(value)
}

fn judge(
    policy: &str,
    settings: &PolicyConfigs,
    staged: &[StagedEncounter],
    config: &TuningConfig,
    done: &(dyn Fn() + Sync),
) -> Score {
    let run = |encounter: &StagedEncounter| -> Option<Trial> {
        let mut policy = settings.policy(policy)?;
        let episode = encounter.run_under(policy.as_mut());
        done();
        let own = episode.steps.iter().map(|step| step.vessels[0].position);
        let compliance = episode.compliance(&config.rules.encounters, &config.rules.compliance);
        Some(Trial {
            contact: episode.has_contact(),
            compliance: compliance.score,
            cross_track_m: own
                .map(|position| encounter.route.cross_track_error_m(position).abs())
                .fold(0.0, f64::max),
        })
    };
    let results: Vec<Trial> = staged.par_iter().filter_map(run).collect();
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let contact_rate = mean(results.iter().map(|result| f64::from(u8::from(result.contact))).collect());
    let compliance = mean(results.iter().filter_map(|result| result.compliance).collect());
    let cross_track_m = mean(results.iter().map(|result| result.cross_track_m).collect());
    let loss = config.contact_loss * contact_rate
        + config.compliance_loss * (1.0 - compliance)
        + config.cross_track_loss * cross_track_m / crate::geo::M_PER_NMI;
    Score { loss, contact_rate, compliance, cross_track_m }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> TuningConfig {
        TuningConfig {
            candidates: 6,
            encounters: 3,
            rounds: 2,
            evaluation_encounters: 4,
            ..TuningConfig::default()
        }
    }

    #[test]
    fn every_key_that_is_searched_is_one_of_its_policy() {
        let settings = PolicyConfigs::default();
        for (policy, space) in SPACES {
            assert!(crate::policy::by_name(policy).is_some());
            for &(key, least, most) in space {
                assert!(least < most, "{policy}.{key}");
                let changed = with(&settings, policy, &[(key, least)]);
                assert!(changed.is_some_and(|changed| changed != settings), "{policy}.{key}");
            }
        }
    }

    #[test]
    fn the_search_repeats_itself_and_never_ends_worse_than_it_began_in_training() {
        let poor =
            with(&PolicyConfigs::default(), "rule-based", &[("margin_m", 0.0), ("horizon_s", 30.0)]).unwrap();
        let count = std::sync::atomic::AtomicUsize::new(0);
        let done = || {
            count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        };
        let tuned = tune("rule-based", &poor, &small(), &done).unwrap();
        assert_eq!(count.into_inner(), episodes(&small()));
        assert_eq!(tune("rule-based", &poor, &small(), &|| ()), Some(tuned.clone()));
        assert!(tuned.best != poor && tuned.evaluation.loss < tuned.in_force.loss, "{tuned:?}");
        assert_eq!(tune("hold-course", &poor, &small(), &|| ()), None);
    }

    #[test]
    fn values_are_rounded_to_three_digits() {
        assert_eq!((rounded(1234.5), rounded(0.0), rounded(-0.045_67)), (1230.0, 0.0, -0.0457));
        assert_eq!(rounded(18.4 * (1.0 + f64::EPSILON)), 18.4);
    }
}
