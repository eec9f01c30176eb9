use std::f64::consts::PI;

use super::*;
use crate::angle::Nautical;
use crate::forecast::LinearForecaster;
use crate::forecast::sample_table::SampleTable;
use crate::geo::{Displacement, Velocity};
use crate::policy::{Policy, Situation};
use crate::track::VesselParticulars;
use crate::vessel::Kvlcc2Config;

/// A vessel at 10 m/s towards north for `straight_s`, then turning to port for a while.
fn track(mmsi: u32, straight_s: f64, total_s: f64) -> Track {
    let mut position = Position::ORIGIN;
    let mut positions = vec![position];
    for step in 0..(total_s / 5.0) as usize {
        let turning_s = (step as f64 * 5.0 - straight_s).clamp(0.0, 120.0);
        let course = Nautical::from_degrees(-turning_s * 0.6);
        position += Displacement::towards(course, 50.0);
        positions.push(position);
    }
    Track { mmsi, start_unix_s: 0, dt_s: 5.0, positions, particulars: VesselParticulars::default() }
}

fn traffic(config: &CoastalConfig) -> Arc<RecordedTraffic> {
    let tracks = vec![track(1, 9000.0, 3000.0), track(2, 480.0, 1500.0), track(3, 600.0, 1500.0)];
    Arc::new(RecordedTraffic::new(tracks, config).unwrap())
}

fn env(config: CoastalConfig, estimates: bool) -> Coastal {
    let forecaster: Option<Box<dyn Forecaster>> =
        if estimates { Some(Box::new(LinearForecaster::over(75))) } else { None };
    let traffic = traffic(&config);
    Coastal::new(config, traffic, forecaster).unwrap()
}

fn only(scenario: ScenarioChoice) -> CoastalConfig {
    CoastalConfig { scenario, ..CoastalConfig::default() }
}

/// Runs an episode with one action all along; the observations of all decisions.
fn episode(env: &mut Coastal, seed: u64, action: f32) -> Vec<Vec<f32>> {
    episode_with_rewards(env, seed, action).0
}

/// The same, and the reward terms of every decision.
fn episode_with_rewards(env: &mut Coastal, seed: u64, action: f32) -> (Vec<Vec<f32>>, Vec<[f64; 2]>) {
    let mut observation = vec![0.0; env.observation_len()];
    env.reset(seed, &mut observation);
    let mut seen = vec![observation.clone()];
    let mut rewards = Vec::new();
    loop {
        let step = env.step(&[action], &mut observation).unwrap();
        seen.push(observation.clone());
        let terms = [0, 1].map(|term| env.reward_terms()[term].value);
        assert_eq!(step.reward, terms[0] + terms[1]);
        rewards.push(terms);
        if step.ends_episode() {
            assert!(step.truncated && !step.terminated);
            return (seen, rewards);
        }
    }
}

#[test]
fn observations_have_the_documented_lengths_and_episodes_fifteen_decisions() {
    for (estimates, length) in [(true, 26), (false, 18)] {
        let mut env = env(CoastalConfig::default(), estimates);
        assert_eq!(env.observation_len(), length);
        assert_eq!(episode(&mut env, 1, 0.0).len(), 16);
        assert_eq!(env.step(&[0.0], &mut vec![0.0; length]), Err(ActionError::EpisodeOver));
    }
}

/// Each scenario punishes the other's right answer.
#[test]
fn holding_course_collides_in_one_scenario_and_full_starboard_in_the_other() {
    for (scenario, colliding, clear) in
        [(ScenarioChoice::StraightOn, 0.0, 1.0), (ScenarioChoice::BeforeCurve, 1.0, 0.0)]
    {
        // No further traffic and no disturbance: what is left is the scenario itself.
        let config = CoastalConfig {
            linear_obstacles: 0,
            start_position_sd_m: 0.0,
            start_heading_port_deg: 0.0,
            ..only(scenario)
        };
        let mut env = env(config, false);
        for seed in 0..20 {
            episode(&mut env, seed, colliding);
            assert!(env.outcome().unwrap().contact, "{scenario:?}, seed {seed}");
            episode(&mut env, seed, clear);
            let outcome = env.outcome().unwrap();
            assert!(!outcome.contact && outcome.closest_m >= 350.0 - 1e-6, "{scenario:?}, seed {seed}");
        }
    }
}

#[test]
fn own_ship_moves_as_computed_by_hand() {
    let config = CoastalConfig { start_heading_port_deg: 0.0, ..only(ScenarioChoice::StraightOn) };
    let mut env = env(config, false);
    let mut observation = vec![0.0; 18];
    env.reset(3, &mut observation);
    let start = env.states()[0];
    env.step(&[0.5], &mut observation).unwrap();
    let after = env.states()[0];
    assert!((after.heading.turn_from(start.heading).to_degrees() - 1.2).abs() < 1e-5);
    assert!((after.position.distance_m(start.position) - 160.0).abs() < 1e-9);
    // The target ship has sailed for 20 s at 10 m/s as well; both were 240 s from collision.
    let apart_m = env.states()[1].position.distance_m(after.position);
    assert!((apart_m - (220.0 * 18.0)).abs() < 10.0, "{apart_m}");
}

/// The recorded ships turn and go straight for the default own ship; with dynamics the starts are judged
/// by what that ship can do.
fn coaster() -> CoastalConfig {
    let kvlcc2 = Kvlcc2Config { length_m: 100.0, service_speed_mps: Some(8.0), ..Kvlcc2Config::default() };
    let mut config = CoastalConfig {
        linear_obstacles: 0,
        start_position_sd_m: 0.0,
        start_heading_port_deg: 0.0,
        ..CoastalConfig::default()
    };
    config.head_on.dynamics = Dynamics::Kvlcc2;
    config.head_on.kvlcc2 = kvlcc2;
    config
}

#[test]
fn an_agent_with_dynamics_meets_what_each_scenario_promises() {
    for (scenario, colliding, clear) in
        [(ScenarioChoice::StraightOn, 0.0, 1.0), (ScenarioChoice::BeforeCurve, 1.0, 0.0)]
    {
        let mut env = env(CoastalConfig { scenario, ..coaster() }, false);
        for seed in 0..5 {
            episode(&mut env, seed, colliding);
            assert!(env.outcome().unwrap().contact, "{scenario:?}, seed {seed}");
            episode(&mut env, seed, clear);
            let outcome = env.outcome().unwrap();
            assert!(!outcome.contact && outcome.closest_m >= 350.0 - 1e-3, "{scenario:?}, seed {seed}");
        }
    }
}

#[test]
fn the_agents_body_is_the_ship_and_follows_its_dynamics() {
    let config = CoastalConfig { scenario: ScenarioChoice::StraightOn, ..coaster() };
    let launch = config.head_on.clone();
    let mut env = env(config, false);
    let mut observation = vec![0.0; env.observation_len()];
    env.reset(2, &mut observation);
    let start = env.states()[0];
    let hull = &env.world.body(VesselId(0)).hull;
    assert_eq!((hull.length_m(), hull.beam_m()), (100.0, 18.125));
    let mut ship = launch.launch_own(start.position, start.heading);
    let mut drift_deg = 0.0_f64;
    for _ in 0..15 {
        env.step(&[1.0], &mut observation).unwrap();
        ship.order(Command { turn_rad: 2.4_f64.to_radians(), speed_mps: None });
        for _ in 0..4 {
            ship.advance(5.0);
        }
        let (state, body) = (env.states()[0], *env.world.state(VesselId(0)));
        assert_eq!(state, body);
        assert!(state.position.distance_m(ship.state().position) < 1e-6);
        drift_deg = drift_deg.max(state.heading.turn_from(state.velocity.course()).to_degrees());
    }
    let turned_deg = env.states()[0].heading.turn_from(start.heading).to_degrees();
    assert!((30.0..37.0).contains(&turned_deg), "{turned_deg}");
    assert!(drift_deg > 0.5, "{drift_deg}");
}

#[test]
fn an_engine_too_weak_for_the_agents_speed_is_named() {
    let mut config = coaster();
    config.head_on.kvlcc2.service_speed_mps = None;
    let error = RecordedTraffic::new(vec![track(1, 9000.0, 3000.0)], &config).unwrap_err();
    assert!(error.to_string().starts_with("head_on.kvlcc2.service_speed_mps: the engine"), "{error}");
}

#[test]
fn wrong_side_is_to_port_and_costs_one_per_decision() {
    let config = CoastalConfig { linear_obstacles: 0, ..only(ScenarioChoice::BeforeCurve) };
    let mut env = env(config, false);
    let seen = episode(&mut env, 5, -1.0);
    assert!(env.outcome().unwrap().wrong_side);
    assert_eq!(env.reward_terms()[0].value, -1.0);
    assert!(seen.last().unwrap()[1] >= 1.0, "the cross-track error is positive to port");
    episode(&mut env, 5, 1.0);
    assert!(!env.outcome().unwrap().wrong_side);
}

#[test]
fn observations_hold_what_the_table_says() {
    let mut env = env(CoastalConfig::default(), true);
    for seed in 0..10 {
        let observation = episode(&mut env, seed, 0.3).pop().unwrap();
        let own = env.states()[0];
        assert!((observation[0] - 8.0 / 5.0).abs() < 1e-6);
        let rows: Vec<&[f32]> = observation[2..].chunks(6).collect();
        assert!(rows.windows(2).all(|pair| pair[0][4] <= pair[1][4]), "sorted by estimated DCPA");
        for row in rows {
            let matches = env.states()[1..].iter().any(|state| {
                let apart = state.position - own.position;
                let expected = [
                    (apart.length_m() - 300.0) / 3000.0,
                    apart.bearing().turn_from(own.heading) / PI,
                    state.velocity.course().turn_from(own.heading) / PI,
                    state.velocity.speed_mps() / 5.0,
                ];
                expected.iter().zip(row).all(|(expected, value)| (expected - f64::from(*value)).abs() < 1e-5)
            });
            assert!(matches, "{row:?}");
            assert!(row[1].abs() <= 1.0 && row[2].abs() <= 1.0);
        }
    }
}

/// Forecast at decisions 0, 2, 4, ...; in between DCPA is held and TCPA counts down by 20 s.
#[test]
fn the_recorded_vessel_is_estimated_every_second_decision() {
    let mut env = env(CoastalConfig { linear_obstacles: 0, ..CoastalConfig::default() }, true);
    let seen = episode(&mut env, 7, 1.0);
    for (decision, pair) in seen.windows(2).enumerate() {
        let held = pair[0][6] == pair[1][6] && (pair[0][7] - pair[1][7] - 0.2).abs() < 1e-5;
        assert_eq!(held, decision % 2 == 0, "decision {decision}");
    }
}

#[test]
fn noise_touches_features_and_never_rewards_or_the_episode() {
    let noisy = CoastalConfig { noise_m: 20.0, ..CoastalConfig::default() };
    let (mut calm_env, mut noisy_env) = (env(CoastalConfig::default(), true), env(noisy, true));
    // Full port: the wrong side all along, and contact in one scenario or another.
    for seed in 0..20 {
        let [calm, noisy] =
            [&mut calm_env, &mut noisy_env].map(|env| episode_with_rewards(env, seed, -1.0).1);
        assert_eq!(calm, noisy);
        assert!(calm.iter().flatten().any(|&term| term < 0.0));
    }
    let (calm, noisy) = (episode(&mut calm_env, 11, 0.2), episode(&mut noisy_env, 11, 0.2));
    assert_eq!(calm_env.states(), noisy_env.states());
    assert_eq!(calm_env.outcome(), noisy_env.outcome());
    assert!(calm.iter().zip(&noisy).all(|(calm, noisy)| calm != noisy));
    // Course and speed come from other sensors and stay true: own speed, and the multiset of obstacle speeds.
    let speeds = |row: &[f32]| {
        let mut speeds: Vec<f32> = row[2..].chunks(6).map(|obstacle| obstacle[3]).collect();
        speeds.sort_by(f32::total_cmp);
        speeds
    };
    assert!(
        calm.iter().zip(&noisy).all(|(calm, noisy)| calm[0] == noisy[0] && speeds(calm) == speeds(noisy))
    );
    assert_eq!(noisy, episode(&mut noisy_env, 11, 0.2), "the same noise every time");
    let other = episode(&mut noisy_env, 11, -0.2);
    assert_eq!(other[0], noisy[0], "noise does not depend on the policy");
}

/// Forecasts that were made beforehand, in one batch, are those made at the moment.
#[test]
fn known_paths_give_the_observations_of_live_ones() {
    let config = CoastalConfig { noise_m: 10.0, ..CoastalConfig::default() };
    let mut live = env(config.clone(), true);
    let moments: Vec<_> = (0..3).flat_map(|seed| live.forecast_moments(seed)).collect();
    assert_eq!(moments.len(), 3 * 8);
    let mut forecaster = LinearForecaster::over(75);
    let paths = KnownPaths::forecast(&mut forecaster, &moments, config.forecast_steps).unwrap();
    let paths: KnownPaths = paths.into_iter().collect();
    let traffic = traffic(&config);
    let mut shared = Coastal::with_paths(config, traffic, Some(Box::new(paths))).unwrap();
    for seed in 0..3 {
        assert_eq!(episode(&mut live, seed, 0.4), episode(&mut shared, seed, 0.4));
    }
    assert_eq!(shared.fallbacks(), 0);
    // Of an episode that nobody forecast nothing is known.
    episode(&mut shared, 3, 0.4);
    assert_eq!(shared.fallbacks(), 8);
}

/// A table of the samples has every forecast that an episode without noise can ask for.
#[test]
fn a_table_of_samples_gives_the_observations_of_live_paths() {
    let config = CoastalConfig::default();
    let traffic = traffic(&config);
    let samples = traffic.forecast_samples(&config);
    let tracks: Vec<&Track> = traffic.tracks().collect();
    let forecaster = &mut LinearForecaster::over(75);
    let table = SampleTable::forecast(forecaster, &tracks, &samples, config.forecast_steps, &mut |_| ());
    let paths = TablePaths::new(Arc::new(table.unwrap()));
    let mut live = env(config.clone(), true);
    let mut shared = Coastal::with_paths(config, Arc::clone(&traffic), Some(Box::new(paths))).unwrap();
    for seed in 0..6 {
        assert_eq!(episode(&mut live, seed, 0.4), episode(&mut shared, seed, 0.4));
    }
    assert_eq!(shared.fallbacks(), 0);
}

/// Keeps what it was shown, and turns to starboard at every decision.
#[derive(Debug, Default)]
struct Recorder {
    own: Vec<Vec<Position>>,
    target: Vec<Vec<Position>>,
    forecast: Vec<Option<Vec<Position>>>,
}

impl Policy for Recorder {
    fn name(&self) -> &str {
        "recorder"
    }

    fn reset(&mut self, _seed: u64) {}

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        assert_eq!((situation.dt_s, situation.decision_s), (5.0, 20.0));
        assert_eq!(situation.time_s, 20.0 * self.own.len() as f64);
        assert_eq!(situation.targets.len(), 4);
        assert!(situation.targets[1..].iter().all(|target| target.forecast.is_none()));
        let target = situation.targets[0];
        assert_eq!(target.history.last(), Some(&target.position));
        assert_eq!(situation.own.history.last(), Some(&situation.own.position));
        self.own.push(situation.own.history.to_vec());
        self.target.push(target.history.to_vec());
        self.forecast.push(target.forecast.map(<[Position]>::to_vec));
        Command { turn_rad: situation.own.max_turn_rad, speed_mps: None }
    }
}

/// Sails an episode under a policy.
fn sail(env: &mut Coastal, seed: u64, policy: &mut dyn Policy) {
    let mut observation = vec![0.0; env.observation_len()];
    env.reset(seed, &mut observation);
    while let Ok(step) = env.step(&[env.ask(policy).unwrap()], &mut observation) {
        if step.ends_episode() {
            return;
        }
    }
}

#[test]
fn policies_see_the_vessels_as_sensed_and_are_obeyed() {
    let mut env = env(CoastalConfig { noise_m: 5.0, ..CoastalConfig::default() }, true);
    let mut recorder = Recorder::default();
    sail(&mut env, 4, &mut recorder);
    let turned = env.states()[0].heading.turn_from(env.opening().unwrap().own_heading);
    assert!((turned.to_degrees() - 36.0).abs() < 1e-4, "{turned}");
    let moments = env.forecast_moments(4);
    for (decision, (own, target)) in recorder.own.iter().zip(&recorder.target).enumerate() {
        assert_eq!((own.len(), target.len()), (75, 75));
        if decision % 2 == 0 {
            assert_eq!(*target, moments[decision / 2].1);
        } else {
            assert_eq!(target[..71], recorder.target[decision - 1][4..], "the past stays as it was sensed");
        }
        // Forecast every second decision; in between what is left of it.
        let ahead = recorder.forecast[decision].as_ref().unwrap();
        assert_eq!(ahead.len(), if decision % 2 == 0 { 200 } else { 196 });
        let step = ahead[1] - ahead[0];
        assert!((step.length_m() - 50.0).abs() < 10.0, "{step:?}");
    }
    // Own ship is sensed with noise too, and came straight on at 8 m/s.
    let gone_m = recorder.own[0][74].distance_m(recorder.own[0][0]);
    assert!((gone_m - 8.0 * 5.0 * 74.0).abs() < 30.0 && gone_m.fract() != 0.0, "{gone_m}");
}

#[test]
fn what_policies_see_of_others_does_not_depend_on_what_they_do() {
    let mut env = env(CoastalConfig { noise_m: 20.0, ..CoastalConfig::default() }, false);
    let mut recorder = Recorder::default();
    sail(&mut env, 9, &mut recorder);
    let mut observation = vec![0.0; env.observation_len()];
    env.reset(9, &mut observation);
    let mut held = Recorder::default();
    for _ in 0..15 {
        env.ask(&mut held).unwrap();
        env.step(&[0.0], &mut observation).unwrap();
    }
    assert_eq!(held.target, recorder.target);
    assert_ne!(held.own, recorder.own);
    assert!(held.forecast.iter().all(Option::is_none), "the baseline environment forecasts nothing");
}

#[test]
fn a_record_holds_every_time_step_and_agrees_with_the_outcome() {
    let mut env = env(CoastalConfig { noise_m: 5.0, ..CoastalConfig::default() }, true);
    env.keep_steps();
    for seed in 0..4 {
        episode(&mut env, seed, 0.5);
        let record = env.record("someone").unwrap();
        let outcome = env.outcome().unwrap();
        assert_eq!((record.steps.len(), record.vessels.len(), record.seed), (61, 5, seed));
        assert_eq!(record.has_contact(), outcome.contact);
        let closest_m =
            record.summaries().iter().map(|target| target.closest_centre_m).fold(f64::INFINITY, f64::min);
        assert_eq!(closest_m, outcome.closest_m);
        let last = record.steps.last().unwrap();
        assert_eq!(last.vessels[3].position, env.states()[3].position);
        assert!(last.vessels.iter().all(|vessel| vessel.observed != Some(vessel.position)));
        // Forecast at every second decision; what is left of it in between.
        let left = |step: usize| record.steps[step].vessels[1].ahead.len();
        assert_eq!([left(0), left(1), left(7), left(8)], [200, 199, 193, 200]);
        assert!(record.steps[5].vessels[2].ahead.is_empty());
    }
}

#[test]
fn the_true_future_tells_the_scenarios_apart_at_once() {
    let config = CoastalConfig {
        estimates: EstimateSource::Truth,
        linear_obstacles: 0,
        start_position_sd_m: 0.0,
        start_heading_port_deg: 0.0,
        ..CoastalConfig::default()
    };
    let mut env = env(config, true);
    let mut observation = vec![0.0; 8];
    for seed in 0..30 {
        env.reset(seed, &mut observation);
        let dcpa_m = f64::from(observation[6]) * 100.0 + 300.0;
        match env.outcome().unwrap().kind {
            HeadOnKind::BeforeCurve => assert!(dcpa_m >= 349.0, "{dcpa_m}"),
            HeadOnKind::StraightOn => assert!(dcpa_m <= 151.0, "{dcpa_m}"),
        }
    }
}

/// Traffic by its rules, over many episodes.
#[test]
fn traffic_is_placed_by_its_distributions() {
    let config = CoastalConfig::default();
    let traffic = traffic(&config);
    let state_of = |start: HeadOnStart| {
        let track = traffic.replays[start.track].track();
        (track.positions[start.index], track.velocity(start.index))
    };
    let (mut following, mut before_curve, mut heading_deg, episodes) = (0, 0, 0.0, 2000);
    for seed in 0..episodes {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let opening = Opening::draw(&config, &traffic.starts, 5.0, state_of, &mut rng).unwrap();
        before_curve += u32::from(opening.kind == HeadOnKind::BeforeCurve);
        heading_deg += opening.own_heading.turn_from(opening.path.course).to_degrees();
        let own_velocity = Velocity::from_course(opening.own_heading, 8.0);
        for linear in &opening.linear {
            let apart = linear.position(0) - opening.own_position;
            let course = linear.velocity().course();
            let astern = apart.bearing().turn_from(course.reciprocal()).abs() < 1e-9;
            if astern && apart.length_m() <= 1000.0 {
                following += 1;
                assert!(apart.length_m() >= 500.0);
                assert!(course.turn_from(opening.own_heading).abs() <= 30_f64.to_radians() + 1e-9);
            } else {
                assert!((1500.0..=3000.0).contains(&apart.north_m.abs()));
                assert!((1500.0..=3000.0).contains(&apart.east_m.abs()));
                let cpa = closest_approach(
                    opening.own_position.xy(),
                    own_velocity.xy(),
                    linear.position(0).xy(),
                    linear.velocity().xy(),
                );
                assert!(cpa.distance_m >= 800.0, "{cpa:?}");
            }
        }
    }
    let share = |count: u32, of: u64| f64::from(count) / of as f64;
    assert!((share(following, 3 * episodes) - 0.5).abs() < 0.03);
    assert!((share(before_curve, episodes) - 0.5).abs() < 0.04);
    assert!((heading_deg / episodes as f64 + 1.5).abs() < 0.1);
}

#[test]
fn tracks_without_a_start_are_refused_with_a_remedy() {
    let error = RecordedTraffic::new(vec![track(1, 9000.0, 3000.0)], &CoastalConfig::default()).unwrap_err();
    assert!(error.to_string().contains("BeforeCurve"), "{error}");
}

#[test]
fn actions_that_cannot_be_taken_are_refused_and_change_nothing() {
    let mut env = env(CoastalConfig::default(), false);
    let mut observation = vec![0.0; 18];
    assert_eq!(env.step(&[0.0], &mut observation), Err(ActionError::EpisodeOver), "no episode has begun");
    env.reset(1, &mut observation);
    let states = env.states().to_vec();
    let refused = env.step(&[f32::NAN], &mut observation);
    assert!(matches!(refused, Err(ActionError::NotFinite { index: 0, .. })), "{refused:?}");
    assert_eq!(env.step(&[], &mut observation), Err(ActionError::Length { given: 0, expected: 1 }));
    assert_eq!(env.states(), states);
    assert!(env.step(&[0.0], &mut observation).is_ok());
}

/// `too_close` counts true distances at the decision, one per obstacle within 300 m.
#[test]
fn rewards_are_counted_by_hand() {
    let mut env = env(CoastalConfig { noise_m: 20.0, ..CoastalConfig::default() }, false);
    let mut observation = vec![0.0; 18];
    let mut contacts = 0;
    for seed in 0..30 {
        env.reset(seed, &mut observation);
        let path = env.opening().unwrap().path;
        for _ in 0..15 {
            env.step(&[0.1], &mut observation).unwrap();
            let own = env.states()[0].position;
            let within =
                env.states()[1..].iter().filter(|state| own.distance_m(state.position) <= 300.0).count();
            let to_port_m = -(own - path.position).starboard_of_m(path.course);
            assert_eq!(env.reward_terms()[1].value, -(within as f64));
            assert_eq!(env.reward_terms()[0].value, if to_port_m >= 200.0 { -1.0 } else { 0.0 });
            contacts += within;
        }
    }
    assert!(contacts > 0);
}
