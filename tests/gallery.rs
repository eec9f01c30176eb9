//! The page of many episodes, looked at in a real browser.

use std::path::PathBuf;

use searoom::angle::Nautical;
use searoom::episode::{Episode, PairStep, Step, VesselInfo, VesselRole, VesselStep};
use searoom::geo::{Position, Velocity};
use searoom::report;
use searoom::report::gallery::{Gallery, RunFacts};
use searoom::world::{Bow, Hull, VesselBody};
use serde_json::{Value, json};

use crate::browser::{Browser, Screen};

const DT_S: f64 = 5.0;

/// Own ship turns by `turn_deg` every step; a target ship comes head-on and weaves.
fn episode(policy: &str, sigma_m: f64, turn_deg: f64) -> Episode {
    let body =
        VesselBody { hull: Hull::new(100.0, 18.0, Bow::default()).unwrap(), collision_radius_m: 150.0 };
    let mut own = Position { north_m: -1234.5, east_m: 321.0 };
    let mut steps = Vec::new();
    for k in 0..=60 {
        let heading = Nautical::from_degrees(-3.0 + turn_deg * f64::from(k));
        let velocity = Velocity::from_course(heading, 8.0);
        let target = Position {
            north_m: 1500.0 - 37.3 * f64::from(k),
            east_m: 300.0 + 60.0 * (f64::from(k) / 9.0).sin(),
        };
        let state = |position: Position, velocity: Velocity, draw: f64| VesselStep {
            position,
            velocity,
            heading: velocity.course(),
            observed: (sigma_m > 0.0).then_some(Position {
                north_m: position.north_m + draw * sigma_m,
                east_m: position.east_m - 0.5 * draw * sigma_m,
            }),
            ahead: Vec::new(),
        };
        let target_velocity = Velocity { north_mps: -7.46, east_mps: 1.2 };
        let distance_m = own.distance_m(target);
        steps.push(Step {
            vessels: vec![
                state(own, velocity, f64::from(k % 7) * 0.31 - 1.0),
                state(target, target_velocity, 1.5 - f64::from(k % 5) * 0.62),
            ],
            pairs: vec![PairStep {
                centre_distance_m: distance_m,
                hull_distance_m: (distance_m - 50.0).max(0.0),
                closest_centre_m: distance_m,
                closest_centre_time_s: f64::from(k) * DT_S,
                closest_hull_m: (distance_m - 50.0).max(0.0),
                circle_contact_time_s: (distance_m < 300.0).then_some(f64::from(k) * DT_S),
                hull_contact_time_s: None,
            }],
        });
        own += velocity.for_seconds(DT_S);
    }
    Episode {
        scenario: "Straight on".into(),
        description: "Head-on </script> & more.".into(),
        seed: u64::MAX - 2,
        policy: policy.to_owned(),
        dt_s: DT_S,
        origin: None,
        vessels: vec![
            VesselInfo::new("own ship", VesselRole::Own, "kinematic", &body),
            VesselInfo::new("MMSI 1", VesselRole::Target, "recorded", &body),
        ],
        steps,
    }
}

/// Three runs of two scenes; the worst is the second, on noise of 10 m.
fn gallery() -> (Gallery, Episode) {
    let worst = episode("hold-course", 10.0, 0.05);
    let runs = [
        ("clear", episode("clear", 0.0, 2.0)),
        ("hold-course", worst.clone()),
        ("far", episode("far", 10.0, 3.0)),
    ];
    let mut gallery = Gallery::new("Noise benchmark", "Three runs.");
    let first = gallery.add_scene("held-out", "straight-on", 0, &runs[0].1);
    let other = gallery.add_scene("training", "straight-on", 0, &runs[0].1);
    gallery.add_forecast(first, 10.0, 8, &[[100, 200], [150, 260]]);
    for (scene, (policy, episode)) in [first, first, other].into_iter().zip(&runs) {
        let facts = RunFacts {
            policy: (*policy).to_owned(),
            sigma_m: if *policy == "clear" { 0.0 } else { 10.0 },
            contact: episode.has_contact(),
            wrong_side: false,
            total_reward: -1.0,
        };
        gallery.add_run(scene, &facts, episode);
    }
    (gallery, worst)
}

fn folder(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// The data of the replay that stands beside.
fn replayed(browser: &mut Browser) -> Value {
    browser.wait_for("document.getElementById('replay').contentDocument?.getElementById('scene')?.width > 0");
    let text = browser
        .eval("document.getElementById('replay').contentDocument.getElementById('episode').textContent");
    serde_json::from_str(text.as_str().unwrap()).unwrap()
}

/// Every number of one within a tolerance of the other's, everything else equal.
fn assert_alike(ours: &Value, theirs: &Value, path: &str) {
    match (ours, theirs) {
        (Value::Number(ours), Value::Number(theirs)) => {
            let apart = (ours.as_f64().unwrap() - theirs.as_f64().unwrap()).abs();
            assert!(apart < 0.16, "{path}: {ours} and {theirs}");
        }
        (Value::Array(ours), Value::Array(theirs)) => {
            assert_eq!(ours.len(), theirs.len(), "{path}");
            for (index, pair) in ours.iter().zip(theirs).enumerate() {
                assert_alike(pair.0, pair.1, &format!("{path}[{index}]"));
            }
        }
        (Value::Object(ours), Value::Object(theirs)) => {
            assert!(ours.keys().all(|key| theirs.contains_key(key)) && ours.len() == theirs.len(), "{path}");
            for (key, value) in ours {
                assert_alike(value, &theirs[key], &format!("{path}.{key}"));
            }
        }
        _ => assert_eq!(ours, theirs, "{path}"),
    }
}

/// The episode that the page unpacks is the one that went in.
#[test]
fn the_worst_episode_comes_first_and_is_replayed_as_it_was() {
    let (gallery, worst) = gallery();
    let page = gallery.write(&folder("gallery").join("index.html")).unwrap();
    let alone = report::write_episode(&worst, &folder("gallery-alone")).unwrap().html;
    let mut browser = Browser::start();
    browser.open(&alone, Screen::DESKTOP);
    let text = browser.eval("document.getElementById('episode').textContent");
    let mut expected: Value = serde_json::from_str(text.as_str().unwrap()).unwrap();

    browser.open(&page, Screen::DESKTOP);
    browser.wait_for("document.querySelectorAll('#episodes li').length === 2");
    let shown = replayed(&mut browser);
    // The forecast of the scene is in force from the eighth step on.
    let ahead = &shown["vessels"][1]["ahead"];
    assert_eq!((&ahead[7], &ahead[8], &ahead[60]), (&json!([]), &json!([[100, 200], [150, 260]]), &ahead[8]));
    expected["vessels"][1]["ahead"] = ahead.clone();
    assert_alike(&shown, &expected, "episode");
    browser.assert_quiet();
}

#[test]
fn cells_outcomes_and_tracks_choose_the_episodes() {
    let (gallery, _) = gallery();
    let page = gallery.write(&folder("gallery-choose").join("index.html")).unwrap();
    for screen in [Screen::PHONE, Screen::DESKTOP] {
        let mut browser = Browser::start();
        browser.open(&page, screen);
        browser.wait_for("document.querySelectorAll('#episodes li').length === 2");
        assert_eq!(
            browser.eval("document.documentElement.scrollWidth <= innerWidth"),
            json!(true),
            "it scrolls sideways"
        );
        let cells = "Array.from(document.querySelectorAll('td button'), (cell) => cell.textContent)";
        assert_eq!(browser.eval(cells), json!(["0", "100"]));
        browser.eval("document.querySelector('td button').click()");
        assert_eq!(browser.eval("document.querySelector('#episodes b').textContent"), json!("clear"));
        assert_eq!(replayed(&mut browser)["policy"], "clear");
        browser.eval("document.querySelector('#outcomes button:nth-child(2)').click()");
        assert_eq!(browser.eval("document.querySelectorAll('#episodes li').length"), json!(0));
        browser.eval("document.querySelector('#tracks button:nth-child(2)').click()");
        browser.eval("document.querySelector('#outcomes button').click()");
        browser.eval("document.querySelector('tbody tr:nth-child(3) th button').click()");
        assert_eq!(browser.eval("document.querySelector('#episodes b').textContent"), json!("far"));
        browser.assert_quiet();
    }
}
