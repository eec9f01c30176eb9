//! `searoom vessel`: what the program prints and writes of the standard manoeuvres; and ships with real
//! dynamics in the world.

use std::fs;

use searoom::angle::Nautical;
use searoom::geo::{Position, Velocity};
use searoom::policy::{
    HoldCourse, OwnShip, Policy, Route, RuleBased, RuleBasedConfig, Situation, TargetShip,
};
use searoom::vessel::mmg::Surroundings;
use searoom::vessel::{Dynamics, DynamicsConfig, KinematicConfig, Launch, Steered};
use searoom::world::{Bow, Hull, VesselBody, World, WorldConfig};
use serde_json::Value;

use crate::cli::searoom;

fn json(arguments: &[&str], out: &std::path::Path) -> Value {
    let out = out.to_str().expect("a path in UTF-8");
    let output = searoom(&[arguments, &["--json", "--out", out]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON on standard output")
}

#[test]
fn turn_prints_indices_beside_the_published_ones_and_draws_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let results = json(&["vessel", "turn"], folder.path());
    for (side, tolerance) in [("starboard", 0.03), ("port", 0.04)] {
        for index in ["advance", "tactical_diameter"] {
            let ours = results[side][format!("{index}_over_length")].as_f64().expect("an index");
            let published = results[side]["published"][format!("{index}_calculated")]
                .as_f64()
                .expect("a published index");
            assert!((ours / published - 1.0).abs() < tolerance, "{side} {index}: {ours} against {published}");
        }
        let series = fs::read_to_string(folder.path().join(format!("{side}.csv"))).expect("a time series");
        assert!(
            series.starts_with("time_s,advance_m,transfer_m,heading_deg,rudder_deg,speed_mps,"),
            "{series:.80}"
        );
        assert!(series.lines().count() > 500);
    }
    let picture = fs::read_to_string(folder.path().join("turn.svg")).expect("a picture");
    assert!(picture.contains("advance / L") && picture.len() > 20_000);
}

#[test]
fn zigzag_prints_overshoots_beside_the_measured_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let results = json(&["vessel", "zigzag", "--angle-deg", "20"], folder.path());
    let tests = results["tests"].as_array().expect("tests");
    assert_eq!(tests.len(), 2);
    assert_eq!(tests[0]["measured_overshoots_deg"][0], 13.7);
    assert!(tests[0]["overshoots_deg"][0].as_f64().is_some_and(|degrees| degrees > 5.0));
    assert!(folder.path().join("20_port_first.csv").exists() && folder.path().join("zigzag.svg").exists());
}

#[test]
fn current_and_wind_are_stated_and_nothing_published_stands_beside_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let still = json(&["vessel", "turn"], folder.path());
    assert!(still.get("surroundings").is_none());
    let arguments = ["vessel", "turn", "--current-towards-deg", "90", "--current-kn", "2"];
    let results = json(&arguments, folder.path());
    assert_eq!(results["surroundings"]["current_towards_deg"], 90.0);
    assert!(results["starboard"].get("published").is_none());
    let diameter = |results: &Value, side: &str| {
        results[side]["tactical_diameter_over_length"].as_f64().expect("an index")
    };
    assert!(diameter(&results, "starboard") > diameter(&still, "starboard") + 1.0);
    assert!(diameter(&results, "port") < diameter(&still, "port") - 1.0);
    let output = searoom(&["vessel", "turn", "--wind-kn", "20"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--wind-from-deg"));
}

#[test]
fn an_angle_that_no_rudder_has_is_refused_with_a_remedy() {
    for arguments in [["vessel", "turn", "--rudder-deg", "90"], ["vessel", "zigzag", "--angle-deg", "NaN"]] {
        let output = searoom(&arguments);
        assert_eq!(output.status.code(), Some(1));
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(message.contains(arguments[2]) && message.contains("give a number from"), "{message}");
    }
}

/// KVLCC2 under way in still water.
fn tanker(position: Position, course: Nautical, speed_mps: f64) -> Box<dyn Steered> {
    let config = DynamicsConfig { dynamics: Dynamics::Kvlcc2, ..DynamicsConfig::default() };
    let velocity = Velocity::from_course(course, speed_mps);
    let limits = KinematicConfig { max_turn_deg: 10.0 };
    config.launch(&Launch { position, velocity, limits }, Surroundings::default())
}

/// Two KVLCC2 meet head-on, the other holding its course; the least distances of centres and hulls.
fn tankers_head_on(policy: &mut dyn Policy) -> (f64, f64) {
    const RANGE_M: f64 = 12_000.0;
    const DT_S: f64 = 5.0;
    let mut own = tanker(Position::ORIGIN, Nautical::NORTH, 7.0);
    let start = Position { north_m: RANGE_M, east_m: 0.0 };
    let mut other = tanker(start, Nautical::from_degrees(180.0), 7.0);

    let mut world = World::new(WorldConfig { dt_s: DT_S, ..WorldConfig::default() });
    let hull = Hull::new(320.0, 58.0, Bow::Full).expect("a hull");
    let body = VesselBody { hull, collision_radius_m: 500.0 };
    let a = world.add_vessel(body.clone(), own.state());
    let b = world.add_vessel(body, other.state());
    let pair = world.watch(a, b);

    let route = Route::straight(Position::ORIGIN, Nautical::NORTH);
    let (mut centres_m, mut hulls_m) = (f64::INFINITY, f64::INFINITY);
    for step in 0..240 {
        if step % 4 == 0 {
            let (state, target) = (own.state(), other.state());
            let targets = [TargetShip {
                position: target.position,
                velocity: target.velocity,
                history: &[],
                forecast: None,
                collision_distance_m: 1000.0,
            }];
            own.order(policy.decide(&Situation {
                time_s: world.time_s(),
                dt_s: DT_S,
                decision_s: 4.0 * DT_S,
                own: OwnShip {
                    position: state.position,
                    velocity: state.velocity,
                    heading: state.heading,
                    ordered_heading: own.ordered_heading(),
                    max_turn_rad: own.max_turn_rad(),
                    planned_speed_mps: 7.0,
                    max_speed_change_mps: 0.0,
                    history: &[],
                },
                route: &route,
                targets: &targets,
            }));
        }
        own.advance(DT_S);
        other.advance(DT_S);
        let report = world.step(&[own.state(), other.state()])[pair];
        centres_m = centres_m.min(report.min_centre_distance_m);
        hulls_m = hulls_m.min(report.min_hull_distance_m);
    }
    (centres_m, hulls_m)
}

#[test]
fn a_tanker_keeps_clear_of_another_in_the_world_if_its_policy_does() {
    assert_eq!(tankers_head_on(&mut HoldCourse).1, 0.0);
    let (centres_m, hulls_m) = tankers_head_on(&mut RuleBased::new(RuleBasedConfig::default()));
    assert!(centres_m > 1000.0 && hulls_m > 600.0, "{centres_m} {hulls_m}");
}
