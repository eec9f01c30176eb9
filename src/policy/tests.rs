use super::testing::{DT_S, Sailed, Ship, meeting, sail};
use super::*;
use crate::vessel::{KinematicConfig, Linear, Motion, Waypoint, Waypoints};

/// The policies that know the collision regulations.
const SEAMANLIKE: [&str; 3] = [velocity_obstacle::NAME, potential_field::NAME, predictive::NAME];

fn sailed(name: &str, ship: Ship, targets: &[&dyn Motion], steps: i64) -> Sailed {
    sail(by_name(name).unwrap().as_mut(), ship, targets, steps)
}

/// Five degrees every 20 s, constant speed.
fn handy() -> Ship {
    Ship { kinematic: KinematicConfig { max_turn_deg: 5.0 }, ..Ship::default() }
}

#[test]
fn every_name_gives_the_policy_of_that_name() {
    for name in NAMES {
        assert_eq!(by_name(name).expect("a policy").name(), name);
    }
    assert!(by_name("full astern").is_none());
}

#[test]
fn a_target_is_expected_on_its_forecast_and_beyond_it_straight_on() {
    let at = |north_m, east_m| Position { north_m, east_m };
    let forecast = [at(40.0, 0.0), at(40.0, 30.0)];
    let mut target = TargetShip {
        position: Position::ORIGIN,
        velocity: Velocity { north_mps: 8.0, east_mps: 0.0 },
        history: &[],
        forecast: Some(&forecast),
        collision_distance_m: 300.0,
    };
    let expected = [(0.0, (0.0, 0.0)), (2.5, (20.0, 0.0)), (5.0, (40.0, 0.0)), (7.5, (40.0, 15.0))];
    for (time_s, (north_m, east_m)) in expected.into_iter().chain([(20.0, (40.0, 90.0))]) {
        assert!(target.expected(time_s, 5.0).distance_m(at(north_m, east_m)) < 1e-9, "{time_s}");
    }
    target.forecast = None;
    assert_eq!(target.expected(20.0, 5.0), at(160.0, 0.0));
    target.forecast = Some(&[]);
    assert_eq!(target.expected(20.0, 5.0), at(160.0, 0.0));
}

#[test]
fn head_on_they_pass_clear_port_to_port_and_come_back() {
    let target = meeting(180.0, 7.0, 600.0);
    for name in SEAMANLIKE {
        let sailed = sailed(name, handy(), &[&target], 480);
        assert!(sailed.closest_m > 300.0, "{name}: {}", sailed.closest_m);
        assert!(sailed.most_to_port_m() < 50.0, "{name}: {}", sailed.most_to_port_m());
        assert!(sailed.last_cross_track_m().abs() < 100.0, "{name}: {}", sailed.last_cross_track_m());
    }
}

#[test]
fn a_crossing_ship_from_starboard_is_passed_astern() {
    let target = meeting(270.0, 7.0, 600.0);
    for name in SEAMANLIKE {
        let sailed = sailed(name, handy(), &[&target], 240);
        assert!(sailed.closest_m > 300.0, "{name}: {}", sailed.closest_m);
        assert!(sailed.most_to_port_m() < 50.0, "{name}: {}", sailed.most_to_port_m());
    }
}

#[test]
fn a_stand_on_ship_holds_until_it_has_to_act_and_then_does_not_turn_to_port() {
    let target = meeting(90.0, 7.0, 900.0);
    let configs = PolicyConfigs::default();
    let duties = [configs.velocity_obstacle.duties, configs.potential_field.duties, configs.mpc.duties];
    for (name, DutiesConfig { stand_on_until_s, .. }) in SEAMANLIKE.into_iter().zip(duties) {
        let sailed = sailed(name, handy(), &[&target], 300);
        assert!(sailed.closest_m > 300.0, "{name}: {}", sailed.closest_m);
        let held = ((900.0 - stand_on_until_s) / DT_S) as usize;
        assert!(sailed.cross_track_m[..held].iter().all(|error| error.abs() < 1e-6), "{name}");
        let before_passing = &sailed.cross_track_m[..170];
        assert!(before_passing.iter().all(|&error| error < 1e-6), "{name}");
    }
}

#[test]
fn a_slow_ship_ahead_is_overtaken_clear() {
    let target = meeting(0.0, 3.0, 600.0);
    for name in SEAMANLIKE {
        let sailed = sailed(name, handy(), &[&target], 480);
        assert!(sailed.closest_m > 300.0, "{name}: {}", sailed.closest_m);
    }
}

#[test]
fn nothing_in_the_way_calls_for_nothing() {
    let abeam = Linear::new(
        Position { north_m: 0.0, east_m: 2000.0 },
        Velocity { north_mps: 8.0, east_mps: 0.0 },
        DT_S,
    );
    let ship = Ship { max_speed_change_mps: 1.0, ..handy() };
    for name in SEAMANLIKE {
        let sailed = sailed(name, ship, &[&abeam], 200);
        assert!((sailed.closest_m - 2000.0).abs() < 1e-6, "{name}");
        assert!(sailed.cross_track_m.iter().all(|error| error.abs() < 1e-6), "{name}");
        assert!(sailed.speed_mps.iter().all(|speed_mps| (speed_mps - 8.0).abs() < 1e-9), "{name}");
    }
}

/// The coastal trap: a ship comes head-on and is about to turn to port and clear.
#[test]
fn with_a_forecast_they_hold_where_the_other_ship_turns_away_to_port() {
    let way = [(3800.0, 0.0), (3200.0, 0.0), (3000.0, 200.0), (2800.0, 5000.0)];
    let waypoints =
        way.map(|(north_m, east_m)| Waypoint { position: Position { north_m, east_m }, speed_mps: 7.0 });
    let target = Waypoints::new(&waypoints, DT_S).unwrap();
    for name in SEAMANLIKE {
        let coastal = Ship::default();
        let blind = sailed(name, coastal, &[&target], 60);
        let foreseeing = sailed(name, Ship { foresees: true, ..coastal }, &[&target], 60);
        assert!(blind.most_to_starboard_m() > 100.0, "{name}: {}", blind.most_to_starboard_m());
        assert!(foreseeing.most_to_starboard_m() < 1.0, "{name}: {}", foreseeing.most_to_starboard_m());
        assert!(foreseeing.closest_m > blind.closest_m, "{name}");
    }
}

#[test]
fn where_speed_may_change_predictive_control_and_velocity_obstacles_use_it_between_three_ships() {
    let ships = [meeting(270.0, 8.0, 600.0), meeting(330.0, 8.0, 600.0), meeting(180.0, 8.0, 600.0)];
    let targets: Vec<&dyn Motion> = ships.iter().map(|ship| ship as &dyn Motion).collect();
    let ship = Ship { max_speed_change_mps: 1.0, ..handy() };
    for name in [velocity_obstacle::NAME, predictive::NAME] {
        let sailed = sailed(name, ship, &targets, 300);
        assert!(sailed.closest_m > 300.0, "{name}: {}", sailed.closest_m);
        assert!(sailed.speed_mps.iter().all(|speed_mps| (0.0..=8.0 + 1e-9).contains(speed_mps)), "{name}");
    }
}

#[test]
fn settings_that_cannot_be_worked_with_are_named() {
    assert_eq!(PolicyConfigs::default().check(), Ok(()));
    let mut configs = PolicyConfigs::default();
    configs.mpc.heading_step_deg = f64::NAN;
    assert_eq!(configs.check().unwrap_err().key, "mpc.heading_step_deg");
    let mut configs = PolicyConfigs::default();
    configs.velocity_obstacle.speed_fractions.clear();
    assert_eq!(configs.check().unwrap_err().key, "velocity-obstacle.speed_fractions");
}

#[test]
fn settings_survive_toml() {
    let configs = PolicyConfigs::default();
    let text = toml::to_string(&configs).unwrap();
    assert!(text.contains("[velocity-obstacle.duties]"), "{text}");
    assert_eq!(toml::from_str::<PolicyConfigs>(&text).unwrap(), configs);
}
