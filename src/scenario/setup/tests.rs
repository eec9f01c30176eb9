use std::path::Path;

use super::*;
use crate::angle::Nautical;
use crate::geo::{Displacement, Geodetic};
use crate::scenario::encounter_starts::HeadOnKind;
use crate::scenario::{OwnShip, RecordedStart, RecordedVessel, TrackSource};

const MMSI: u32 = 219_000_001;

/// A vessel going north-east at 7 m/s for half an hour.
fn recorded(start: RecordedStart) -> TargetMotion {
    let course = Nautical::from_degrees(45.0);
    let positions =
        (0..=360).map(|k| Position::ORIGIN + Displacement::towards(course, 35.0 * f64::from(k))).collect();
    let track =
        Track { mmsi: MMSI, start_unix_s: 1000, dt_s: 5.0, positions, particulars: Default::default() };
    let plane = LocalPlane::at(Geodetic { latitude_deg: 40.0, longitude_deg: -74.0 });
    let source = TrackSource::Given { tracks: Arc::new([track]), plane };
    TargetMotion::Recorded(RecordedVessel { source, start })
}

fn at(unix_s: f64) -> RecordedStart {
    RecordedStart::Time { mmsi: MMSI, unix_s }
}

fn head_on(start: RecordedStart) -> Scenario {
    Scenario::new("test", OwnShip::head_on_to("ship", 240.0)).target("ship", recorded(start))
}

fn linear(placement: Placement) -> TargetMotion {
    TargetMotion::Linear(placement)
}

#[test]
fn own_ship_is_placed_to_collide_with_the_target_it_meets() {
    let staged = head_on(at(1500.0)).set_up().unwrap();
    let target = staged.targets[0].motion.state(0);
    assert_eq!(target.position.distance_m(Position::ORIGIN).round(), 3500.0);
    assert!((staged.own_start.heading.degrees() - 225.0).abs() < 1e-9);
    let own_then = staged.own_start.position + staged.own_start.velocity.for_seconds(240.0);
    assert!(own_then.distance_m(staged.targets[0].motion.position(48)) < 1e-6);
    assert_eq!(staged.plane.unwrap().origin.latitude_deg, 40.0);
    assert_eq!(staged.targets[0].mmsi, Some(MMSI));
}

#[test]
fn a_track_that_is_not_there_is_explained() {
    let fault = |scenario: Scenario| scenario.set_up().unwrap_err().to_string();
    assert_eq!(
        fault(head_on(RecordedStart::Time { mmsi: 1, unix_s: 1000.0 })),
        "target[1].mmsi: no track of vessel 1 among the 1 found; write one of 219000001"
    );
    assert_eq!(
        fault(head_on(at(999.0))),
        "target[1].time: vessel 219000001 has no track at that time; \
         write a time within 1970-01-01T00:16:40Z to 1970-01-01T00:46:40Z"
    );
    assert_eq!(
        fault(head_on(at(2600.0))),
        "target[1].time: the track of vessel 219000001 ends 200 s later, before the 300 s simulated; \
         write an earlier time or a shorter duration_s"
    );
    let rule = |kind, pick| head_on(RecordedStart::Rule { kind, mmsi: None, pick });
    assert_eq!(
        fault(rule(HeadOnKind::BeforeCurve, None)),
        "target[1].start: none of the 1 tracks offers such a start; \
         take another vessel or area, or name a vessel and a time"
    );
    assert_eq!(
        fault(rule(HeadOnKind::StraightOn, Some(99))),
        "target[1].pick: 38 such starts are found; \
         write a number from 1 to 38, or leave pick out to draw one with the seed"
    );
}

#[test]
fn a_start_by_rule_is_picked_or_drawn_with_the_seed() {
    let start = |pick, seed| {
        let rule = RecordedStart::Rule { kind: HeadOnKind::StraightOn, mmsi: Some(MMSI), pick };
        head_on(rule).seed(seed).set_up().unwrap().targets[0].motion.position(0)
    };
    assert_eq!(start(Some(1), 0).distance_m(Position::ORIGIN).round(), 7.0 * 375.0);
    assert_eq!(start(None, 5), start(None, 5));
    assert!((0..20).any(|seed| start(None, seed) != start(None, 0)));
}

#[test]
fn placements_that_go_in_circles_or_nowhere_are_refused() {
    let seen = linear(Placement::FromOwnShip(RelativePlacement::Seen {
        bearing: crate::scenario::placement::Bearing::Relative(0.0),
        range_m: 1000.0,
        course: Nautical::NORTH,
        speed_mps: 5.0,
    }));
    let circular = Scenario::new("test", OwnShip::head_on_to("ship", 240.0)).target("ship", seen);
    assert_eq!(
        circular.set_up().unwrap_err().to_string(),
        "own_ship.head_on.target: \"ship\" is itself placed relative to own ship; \
         place that target by its position, or own ship by its own"
    );
    let still = Placement::At { point: Point::local(0.0, 0.0), course: Nautical::NORTH, speed_mps: 0.0 };
    let anchored = Scenario::new("test", OwnShip::head_on_to("ship", 240.0)).target("ship", linear(still));
    assert_eq!(anchored.set_up().unwrap_err().key, "own_ship.head_on.target");
    let far = Placement::At { point: Point::local(1e7, 0.0), course: Nautical::NORTH, speed_mps: 5.0 };
    let far = Scenario::new("test", OwnShip::heading(0.0)).target("ship", linear(far));
    assert_eq!(
        far.set_up().unwrap_err().to_string(),
        "target[1]: starts 10000 km from the origin, further than 200 km; \
         check its position, or move the origin"
    );
    let lost = OwnShip::heading(0.0).from(Point::local(0.0, 0.0));
    let on_earth =
        Placement::At { point: Point::geodetic(40.0, 10.0), course: Nautical::NORTH, speed_mps: 5.0 };
    let fault = Scenario::new("test", lost).target("ship", linear(on_earth)).set_up().unwrap_err();
    assert_eq!(fault.key, "target[1].latitude_deg");
}

#[test]
fn a_time_step_beyond_its_limits_is_refused() {
    for dt_s in ["0.01", "1e308"] {
        let text = format!(
            "duration_s = 1e308\ndt_s = {dt_s}\n[own_ship]\nnorth_m = 0\neast_m = 0\ncourse_deg = 0\nspeed_kn = 12\n"
        );
        let told =
            ScenarioFile::parse(&text, Path::new("test.toml")).unwrap().set_up().unwrap_err().to_string();
        assert!(told.starts_with("test.toml:2: key \"dt_s\": a time step of"), "{told}");
        assert!(told.ends_with("write 0.05 to 3600 s, and no more than the duration"), "{told}");
    }
}

#[test]
fn an_impossible_geometry_is_located_in_the_file() {
    let text = "duration_s = 300\n[own_ship]\nnorth_m = 0\neast_m = 0\ncourse_deg = 0\nspeed_kn = 12\n\
                [[target]]\nmotion = \"linear\"\nbearing_deg = 30\nrange_m = 500\ntcpa_s = 200\ndcpa_m = 900\n";
    let file = ScenarioFile::parse(text, Path::new("test.toml")).unwrap();
    assert_eq!(
        file.set_up().unwrap_err().to_string(),
        "test.toml:12: key \"target[1].dcpa_m\": a closest distance of 900 m cannot lie beyond the range of 500 m: \
         write a smaller DCPA or a larger range"
    );
    let text = text.replace("dcpa_m = 900", "dcpa_nmi = 0.5").replace("duration_s = 300", "duration_s = 301");
    let file = ScenarioFile::parse(&text, Path::new("test.toml")).unwrap();
    assert_eq!(
        file.set_up().unwrap_err().to_string(),
        "test.toml:1: key \"duration_s\": 301 s are no whole number of time steps of 5 s, 1 to 100000: \
         change duration_s or dt_s"
    );
    let file = ScenarioFile::parse(&text.replace("= 301", "= 300"), Path::new("test.toml")).unwrap();
    assert!(
        file.set_up()
            .unwrap_err()
            .to_string()
            .starts_with("test.toml:12: key \"target[1].dcpa_nmi\": a closest")
    );
}

#[test]
fn random_motions_follow_the_seed() {
    let weaving = || {
        let start = Placement::At { point: Point::local(0.0, 0.0), course: Nautical::NORTH, speed_mps: 5.0 };
        Scenario::new("test", OwnShip::heading(0.0).from(Point::local(-900.0, 0.0)))
            .target("a", TargetMotion::Stochastic(start, Default::default()))
            .target("b", TargetMotion::Periodic(start, Default::default()))
    };
    let paths = |seed| {
        let staged = weaving().seed(seed).set_up().unwrap();
        staged.targets.iter().map(|target| target.motion.position(30)).collect::<Vec<_>>()
    };
    assert_eq!(paths(1), paths(1));
    assert_ne!(paths(1)[0], paths(2)[0]);
    assert_ne!(paths(1)[1], paths(2)[1]);
}
