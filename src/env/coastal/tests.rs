use super::*;
use crate::angle::Nautical;
use crate::forecast::LinearForecaster;
use crate::geo::{Displacement, Velocity};
use crate::track::VesselParticulars;

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
    let mut observation = vec![0.0; env.observation_len()];
    env.reset(seed, &mut observation);
    let mut seen = vec![observation.clone()];
    loop {
        let step = env.step(&[action], &mut observation).unwrap();
        seen.push(observation.clone());
        if step.ends_episode() {
            assert!(step.truncated && !step.terminated);
            return seen;
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
