use std::path::Path;

use super::*;
use crate::scenario::{ScenarioFile, StagedEncounter, TargetMotion};
use crate::vessel::Dynamics;

/// A situation with every part that is read: version 0.2.0.
const SITUATION: &str = include_str!("../../../scenarios/exchange/off_the_lightship.json");

/// The same in the form of before 0.1.0, without a version.
const OLD: &str = r#"{
  "title": "Old form",
  "startTime": null,
  "ownShip": {
    "static": { "id": "8d4cf7b5-5a61-4f73-9c0e-6a0a3b1f9c55", "length": 140.0, "width": 22.0, "mmsi": null, "speedMax": 17.0, "shipType": "Passenger" },
    "initial": { "position": { "latitude": 54.1, "longitude": 7.9 }, "sog": 12.0, "cog": 0.0, "heading": null },
    "waypoints": [
      { "position": { "latitude": 54.1, "longitude": 7.9 }, "turnRadius": null,
        "data": { "sog": { "value": 9.0, "mBeforeLegChange": 0.0, "mAfterLegChange": 0.0, "interpMethod": null } } },
      { "position": { "latitude": 54.2, "longitude": 7.9 }, "data": null }
    ]
  },
  "targetShips": [
    { "static": { "id": "x", "name": "twin" }, "initial": { "position": { "latitude": 54.2, "longitude": 7.9 }, "sog": 10.0, "cog": 180.0 }, "waypoints": null },
    { "static": { "id": "y", "name": "twin" }, "initial": { "position": { "latitude": 54.2, "longitude": 7.8 }, "sog": 10.0, "cog": 90.0 } }
  ],
  "environment": null
}"#;

fn read(text: &str) -> Result<Import, String> {
    import(text, Path::new("t.json"), &ImportOptions::default()).map_err(|error| error.to_string())
}

/// The scenario after it was written as TOML and read again.
fn through_toml(import: &Import) -> StagedEncounter {
    let text = import.scenario.to_toml().unwrap();
    ScenarioFile::parse(&text, Path::new("t.toml")).and_then(|file| file.set_up()).unwrap()
}

fn kn(speed_mps: f64) -> f64 {
    speed_mps / crate::geo::MPS_PER_KNOT
}

#[test]
fn every_leg_has_its_speed_and_its_place() {
    let import = read(SITUATION).unwrap();
    let scenario = &import.scenario;
    assert_eq!((scenario.name.as_str(), scenario.title.as_str()), ("t", "Meeting off the lightship"));
    assert_eq!(scenario.own_ship.size.length_m, 140.0);
    assert!((kn(scenario.own_ship.speed_mps) - 13.0).abs() < 1e-9);
    let speeds: Vec<_> = scenario.own_ship.route.iter().map(|waypoint| waypoint.speed_mps.map(kn)).collect();
    assert_eq!(speeds.len(), 2);
    // The speed of the leg's data counts, from the waypoint on at which the leg begins.
    assert!((speeds[0].unwrap() - 10.0).abs() < 1e-9 && speeds[1].is_none());
    let TargetMotion::Waypoints { waypoints } = &scenario.targets[0].motion else { panic!("waypoints") };
    let speeds: Vec<f64> = waypoints.iter().map(|waypoint| kn(waypoint.speed_mps).round()).collect();
    assert_eq!(speeds, [11.0, 8.0, 8.0]);
    assert!(matches!(scenario.targets[1].motion, TargetMotion::Linear(_)));
    // 6.5 km at 13 kn and 8.5 km at 10 kn.
    assert!((2600.0..2700.0).contains(&scenario.duration_s), "{}", scenario.duration_s);
    let staged = through_toml(&import);
    assert_eq!(staged.targets[1].motion.state(100).velocity.speed_mps(), 0.0);
    let notes = import.notes.join("\n");
    for left_out in [
        "startTime",
        "ownShip.static.id",
        "ownShip.static.dimensions.draught",
        "ownShip.waypoints[3].turnRadius",
        "targetShips[1].initial.heading",
        "environment.visibility",
        "environment, wind and current",
        "ownShip.waypoints[3].leg.data.sog",
    ] {
        assert!(notes.contains(left_out), "{left_out} is not in\n{notes}");
    }
}

#[test]
fn older_forms_and_quirks_are_read() {
    let import = read(OLD).unwrap();
    let scenario = &import.scenario;
    assert_eq!(scenario.own_ship.size.beam_m, 22.0);
    let names: Vec<&str> = scenario.targets.iter().map(|target| target.name.as_str()).collect();
    assert_eq!(names, ["twin", "twin (2)"]);
    // The data of a waypoint are those of the leg that begins there; own ship starts at its initial speed.
    assert!((kn(scenario.own_ship.speed_mps) - 12.0).abs() < 1e-9);
    assert!(import.notes.iter().any(|note| note.contains("12.0 kn instead of 9.0 kn")), "{:?}", import.notes);
    let staged = through_toml(&import);
    assert!((staged.targets[0].motion.state(10).heading.degrees() - 180.0).abs() < 1e-6);

    let bare = r#"{ "version": "0.8.1", "ownShip": { "static": { "id": 1 }, "waypoints": [
        { "position": { "lon": 7.9, "lat": 54.1 } }, { "position": { "lon": 8.0, "lat": 54.1 }, "leg": { "sog": 9 } } ] } }"#;
    let import = read(bare).unwrap();
    assert!(import.scenario.targets.is_empty());
    let own = through_toml(&import).own_start;
    assert!((own.heading.degrees() - 90.0).abs() < 0.1 && (kn(own.velocity.speed_mps()) - 9.0).abs() < 1e-9);
}

#[test]
fn ships_with_dynamics_feel_wind_and_current() {
    let options = ImportOptions { dynamics: Dynamics::Kvlcc2, ..ImportOptions::default() };
    let import = import(SITUATION, Path::new("t.json"), &options).unwrap();
    let wind = import.scenario.surroundings.wind.unwrap();
    assert_eq!((wind.from.degrees().round(), wind.speed_mps), (225.0, 9.0));
    assert_eq!(import.scenario.surroundings.current.course().degrees().round(), 20.0);
    let staged = through_toml(&import);
    assert_eq!((staged.targets[0].motion_word, staged.targets[1].motion_word), ("kvlcc2", "linear"));
    // 140 m of KVLCC2 make 11.3 kn with their engine to scale: this one has a stronger one.
    assert!(import.scenario.own_ship.dynamics.kvlcc2.service_speed_mps.is_some());
    let written = export(&staged).unwrap();
    let again = super::import(&written, Path::new("t.json"), &options).unwrap();
    assert_eq!(again.scenario.surroundings.wind.unwrap().from.degrees().round(), 225.0);
}

/// JSON to TOML to JSON and on: what a scenario holds stays.
#[test]
fn the_round_trip_loses_nothing_that_a_scenario_holds() {
    for text in [SITUATION, OLD] {
        let first = read(text).unwrap();
        let staged = through_toml(&first);
        let written = export(&staged).unwrap();
        let second = read(&written).unwrap();
        let staged_again = through_toml(&second);
        assert_eq!(first.scenario.title, second.scenario.title);
        assert_eq!(first.scenario.own_ship.route.len(), second.scenario.own_ship.route.len());
        for (one, other) in staged.targets.iter().zip(&staged_again.targets) {
            assert_eq!((&one.name, one.body.hull.length_m()), (&other.name, other.body.hull.length_m()));
            for step in [0, 1, 50, 100, 200] {
                let apart_m = one.motion.position(step).distance_m(other.motion.position(step));
                assert!(apart_m < 0.01, "{} is {apart_m} m off at step {step}", one.name);
            }
        }
        assert!(staged.own_start.position.distance_m(staged_again.own_start.position) < 0.01);
        // From the second time on the text is the same, to the last digit.
        assert_eq!(written, export(&staged_again).unwrap());
    }
}

#[test]
fn any_shipped_scenario_with_an_origin_is_exported() {
    for name in ["fairway", "periodic", "stochastic", "crossing_from_port"] {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenarios/{name}.toml"));
        let mut file = ScenarioFile::load(&file).unwrap();
        let nowhere = file.set_up().unwrap();
        if nowhere.plane.is_none() {
            assert_eq!(export(&nowhere), Err(ExportError::Nowhere));
        }
        file.scenario.origin = Some(crate::geo::Geodetic { latitude_deg: 54.5, longitude_deg: 10.3 });
        let staged = file.set_up().unwrap();
        let again = through_toml(&read(&export(&staged).unwrap()).unwrap());
        let (one, other) = (&staged.targets[0], &again.targets[0]);
        // Own ship's start is the origin of what was imported.
        let offset = staged.own_start.position - crate::geo::Position::ORIGIN;
        for step in [0, 7, 40] {
            let apart_m = (other.motion.position(step) + offset).distance_m(one.motion.position(step));
            assert!(apart_m < 0.2, "{name}: {apart_m} m at step {step}");
        }
    }
}

#[test]
fn what_is_no_traffic_situation_is_explained() {
    let explained = |replaced: &str, with: &str, expected: &str| {
        assert!(SITUATION.contains(replaced), "{replaced}");
        let error = read(&SITUATION.replacen(replaced, with, 1)).err().unwrap_or_default();
        assert_eq!(error, format!("t.json:{expected}"), "{with}");
    };
    explained(
        "\"ownShip\"",
        "\"ownship\"",
        "1: \"ownShip\" is missing: this is no traffic situation: write \"ownShip\" in place of \"ownship\"",
    );
    explained(
        "\"lat\": 54.2",
        "\"lat\": 154.2",
        "18: key \"targetShips[1].initial.position.lat\": 154.2 is not possible here: write a number from -89.9 to 89.9",
    );
    explained(
        "\"sog\": 11.0, \"cog\": 180.0",
        "\"sog\": \"fast\", \"cog\": 180.0",
        "18: key \"targetShips[1].initial.sog\": is a text, not a number: write a number",
    );
    explained(
        "\"width\": 15.0",
        "\"width\": 115.0",
        "17: key \"targetShips[1].static.dimensions.width\": a width of 115 m is more than the length of 90 m: exchange the two, or correct one",
    );
    explained(
        "\"leg\": { \"sog\": 8.0 }",
        "\"leg\": { \"sog\": 0 }",
        "16: key \"targetShips[1]\": a speed of 0 on leg 2 never leads to the next waypoint: write a speed above 0, or end the waypoints there",
    );
    explained(
        "\"id\": 2,",
        "\"id\": 2, \"initDelay\": 30,",
        "17: key \"targetShips[1].static.initDelay\": the ship appears only after 30 s, but those of a scenario are there at once: write 0, and start the ship so far back on its course",
    );
    explained(
        "\"id\": 2,",
        "\"id\": 2, \"pathType\": \"bezier\",",
        "17: key \"targetShips[1].static.pathType\": the waypoints are control points of a curve, but those of a scenario are sailed to: write \"rtz\" or \"linear\", with waypoints on the curve",
    );
    explained(
        "\"lon\": 7.9, \"lat\": 54.1 }, \"sog\"",
        "\"latitude\": 0.944, \"longitude\": 0.138, \"north\": 0, \"east\": 0 }, \"sog\"",
        "8: key \"ownShip.initial.position\": has north and east beside radians, as ship-traffic-generator wrote before its version 0.3.0: write lat and lon in degrees alone, and every speed in knots",
    );
    explained(
        "\"windDirection\": 225.0, ",
        "",
        "31: key \"environment.windSpeed\": \"windDirection\" is missing beside it: add \"windDirection\"",
    );
    let lost = r#"{ "ownShip": { "static": { "id": 1 } } }"#;
    assert!(read(lost).unwrap_err().contains("nothing says where it starts"));
    let slow = r#"{ "ownShip": { "initial": { "position": { "lat": 1, "lon": 1 }, "cog": 3 } } }"#;
    assert!(read(slow).unwrap_err().contains("nothing says how fast it goes"));
    assert!(read("[]").unwrap_err().contains("is a list, not an object"));
    assert!(read("").unwrap_err().starts_with("t.json:1: is not JSON"));
}

proptest::proptest! {
    /// One line of a good file is dropped, doubled or broken: read or refused, with a line.
    #[test]
    fn a_mutated_situation_is_read_or_refused(
        line in 0..SITUATION.lines().count(),
        at in 0..40_usize,
        put in proptest::prelude::prop_oneof![
            proptest::prelude::Just("null".to_owned()), proptest::prelude::Just("1e999".to_owned()),
            proptest::prelude::Just("[]".to_owned()), proptest::prelude::Just("{}".to_owned()),
            proptest::prelude::Just(String::new()), "\\PC{0,9}",
        ],
    ) {
        let mut lines: Vec<String> = SITUATION.lines().map(str::to_owned).collect();
        let cut = lines[line].char_indices().map(|(index, _)| index).nth(at).unwrap_or(0);
        lines[line].insert_str(cut, &put);
        let text = lines.join("\n");
        match read(&text) {
            Ok(import) => {
                let written = import.scenario.to_toml().unwrap();
                let file = ScenarioFile::parse(&written, Path::new("t.toml"));
                proptest::prop_assert!(file.is_ok(), "{:?}\n{written}", file.err());
            }
            Err(error) => proptest::prop_assert!(error.starts_with("t.json:"), "{error}"),
        }
    }
}
