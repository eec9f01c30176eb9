//! The replay page, looked at in a real browser.

use std::f64::consts::TAU;
use std::path::PathBuf;

use searoom::angle::Nautical;
use searoom::episode::{Episode, HullPoint, PairStep, Step, VesselInfo, VesselRole, VesselStep};
use searoom::geo::{Displacement, Position, Velocity};
use searoom::report;
use serde_json::json;

use crate::browser::{Browser, Screen};

const STEPS: i32 = 72;
const DT_S: f64 = 5.0;

/// Where vessel `index` is at a time: own ship gives way to starboard and comes back; the target ships
/// come head-on, cross from starboard, weave across, and lie at anchor.
fn place(index: usize, time_s: f64) -> Position {
    let (north_m, east_m) = match index {
        0 => (8.0 * time_s, 260.0 * (1.0 - (TAU * (time_s / 360.0)).cos()) * 0.5),
        1 => (2700.0 - 7.0 * time_s, 60.0 - 0.4 * time_s),
        2 => (1650.0 - 1.2 * time_s, 2100.0 - 8.5 * time_s),
        3 => (900.0 + 90.0 * (time_s / 16.0).sin(), -1900.0 + 6.0 * time_s),
        _ => (2450.0, 1250.0),
    };
    Position { north_m, east_m }
}

fn vessel(index: usize) -> VesselInfo {
    let names = ["Own ship", "Nordic Star", "Ever Calm", "Pilot 4", "At anchor"];
    let (length_m, beam_m, radius_m) = [
        (90.0, 16.0, 150.0),
        (180.0, 28.0, 150.0),
        (240.0, 34.0, 150.0),
        (28.0, 8.0, 100.0),
        (120.0, 20.0, 150.0),
    ][index];
    let corners =
        [(0.5, 0.0), (0.38, 0.35), (0.2, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.2, -0.5), (0.38, -0.35)];
    VesselInfo {
        name: names[index].to_owned(),
        role: if index == 0 { VesselRole::Own } else { VesselRole::Target },
        motion: ["kinematic", "recorded", "linear", "periodic", "linear"][index].to_owned(),
        length_m,
        beam_m,
        hull: corners
            .map(|(along, across)| HullPoint { forward_m: along * length_m, starboard_m: across * beam_m })
            .to_vec(),
        collision_radius_m: radius_m,
    }
}

/// Distances of own ship and a target ship, the closest searched for between the steps.
fn pair(target: usize, time_s: f64) -> PairStep {
    let distance_m = |time: f64| place(0, time).distance_m(place(target, time));
    let contact_m = vessel(0).collision_radius_m + vessel(target).collision_radius_m;
    let times: Vec<f64> =
        (0..=20).map(|part| (time_s - DT_S * f64::from(part) / 20.0).max(0.0)).rev().collect();
    let closest_s = times
        .iter()
        .copied()
        .fold(time_s, |best, time| if distance_m(time) < distance_m(best) { time } else { best });
    PairStep {
        centre_distance_m: distance_m(time_s),
        hull_distance_m: (distance_m(time_s) - 100.0).max(0.0),
        closest_centre_m: distance_m(closest_s),
        closest_centre_time_s: closest_s,
        closest_hull_m: (distance_m(closest_s) - 100.0).max(0.0),
        circle_contact_time_s: times.into_iter().find(|&time| distance_m(time) <= contact_m),
        hull_contact_time_s: None,
    }
}

fn episode() -> Episode {
    let steps = (0..=STEPS).map(|k| {
        let time_s = f64::from(k) * DT_S;
        let state = |index: usize| {
            let velocity = (place(index, time_s + 0.5) - place(index, time_s - 0.5)).per_seconds(1.0);
            let heading = if index == 4 { Nautical::from_degrees(230.0) } else { velocity.course() };
            let noise = Displacement {
                north_m: 14.0 * f64::from(k * 7 % 5 - 2),
                east_m: 11.0 * f64::from(k * 3 % 5 - 2),
            };
            VesselStep {
                position: place(index, time_s),
                velocity: if index == 4 { Velocity::default() } else { velocity },
                heading,
                observed: Some(place(index, time_s) + noise),
                ahead: if index == 1 {
                    (0..24).map(|n| place(1, time_s + DT_S * f64::from(n))).collect()
                } else {
                    vec![]
                },
            }
        };
        Step {
            vessels: (0..5).map(state).collect(),
            pairs: (1..5).map(|target| pair(target, time_s)).collect(),
        }
    });
    Episode {
        scenario: "Harbour approach, five vessels".to_owned(),
        description:
            "A vessel meets head-on while another crosses from starboard and a pilot boat weaves across."
                .to_owned(),
        seed: 20_240_229,
        policy: "rule-based".to_owned(),
        dt_s: DT_S,
        origin: None,
        vessels: (0..5).map(vessel).collect(),
        steps: steps.collect(),
    }
}

/// Writes the page of an episode where `cargo clean` takes it away.
fn page_of(episode: &Episode, name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    report::write_episode(episode, &folder).expect("the page is written").html
}

/// A canvas as the page drew it.
fn picture(browser: &mut Browser, id: &str) -> String {
    let picture = browser.eval(&format!("document.getElementById({id:?}).toDataURL()"));
    picture.as_str().expect("a picture").to_owned()
}

/// Pixels of the chart in about the colour of a vessel.
fn pixels_of(browser: &mut Browser, vessel: usize) -> u64 {
    // Read from a copy: Chromium has an opinion about pages that read from a canvas they draw on.
    let pixels = browser.eval(&format!(
        "(() => {{ const scene = document.getElementById('scene'); \
         const copy = document.createElement('canvas'); [copy.width, copy.height] = [scene.width, scene.height]; \
         const pen = copy.getContext('2d', {{ willReadFrequently: true }}); \
         pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--vessel-{vessel}').trim(); \
         pen.fillRect(0, 0, 1, 1); const want = pen.getImageData(0, 0, 1, 1).data; \
         pen.drawImage(scene, 0, 0); const data = pen.getImageData(0, 0, copy.width, copy.height).data; \
         let count = 0; for (let i = 0; i < data.length; i += 4) \
         if ([0, 1, 2].every((k) => Math.abs(data[i + k] - want[k]) < 5)) count++; return count; }})()"
    ));
    pixels.as_u64().expect("a count")
}

fn time_s(browser: &mut Browser) -> f64 {
    browser.eval("Number(document.getElementById('time').value)").as_f64().expect("a time")
}

fn clock(browser: &mut Browser) -> String {
    browser.eval("document.getElementById('clock').textContent").as_str().expect("a text").to_owned()
}

/// Everything that must hold at any width.
fn replays_at(screen: Screen, name: &str) {
    let page = page_of(&episode(), name);
    let mut browser = Browser::start();
    browser.open(&page, screen);
    browser.wait_for("document.getElementById('scene').width > 0");

    assert_eq!(
        browser.eval("document.documentElement.scrollWidth <= innerWidth"),
        json!(true),
        "it scrolls sideways"
    );
    assert_eq!(browser.eval("document.querySelectorAll('button.target').length"), json!(4));
    assert_eq!(clock(&mut browser), "00:00 / 06:00");
    for vessel in 0..5 {
        let pixels = pixels_of(&mut browser, vessel);
        assert!(pixels > 20, "vessel {vessel} covers {pixels} pixels of the chart");
    }

    // Scrubbing moves the vessels, the cursor of the distances and the clock.
    let start = (picture(&mut browser, "scene"), picture(&mut browser, "distances"), browser.screenshot());
    let (x, y) = browser.middle_of("#time");
    browser.drag((x, y), (x, y));
    assert!((time_s(&mut browser) - 180.0).abs() < 5.0, "{}", time_s(&mut browser));
    let middle = (picture(&mut browser, "scene"), picture(&mut browser, "distances"), browser.screenshot());
    assert!(start.0 != middle.0 && start.1 != middle.1 && start.2 != middle.2, "scrubbing draws nothing new");

    // Keys.
    browser.press("End");
    assert_eq!(clock(&mut browser), "06:00 / 06:00");
    browser.press("ArrowLeft");
    assert_eq!(clock(&mut browser), "05:55 / 06:00");
    browser.press("Home");
    assert_eq!((time_s(&mut browser), picture(&mut browser, "scene")), (0.0, start.0.clone()));

    // Playing moves by itself, pausing stops it.
    browser.click("#play");
    browser.wait_for("Number(document.getElementById('time').value) > 20");
    assert_ne!(picture(&mut browser, "scene"), start.0, "playing draws nothing new");
    browser.click("#play");
    let paused = time_s(&mut browser);
    browser.eval("new Promise((done) => setTimeout(done, 200))");
    assert_eq!(time_s(&mut browser), paused);
    assert!(paused < 360.0);

    // Zoom, drag, and back to the whole.
    browser.press("Home");
    browser.click("#zoom-in");
    let zoomed = picture(&mut browser, "scene");
    assert_ne!(zoomed, start.0, "zooming changes nothing");
    let (x, y) = browser.middle_of("#scene");
    browser.drag((x, y), (x + 60.0, y + 40.0));
    assert_ne!(picture(&mut browser, "scene"), zoomed, "dragging changes nothing");
    browser.press("f");
    assert_eq!(picture(&mut browser, "scene"), start.0);

    // Own ship in the middle: the pixel there has its colour.
    browser.press("o");
    assert_eq!(browser.eval("document.getElementById('follow').getAttribute('aria-pressed')"), json!("true"));
    assert_ne!(picture(&mut browser, "scene"), start.0);

    // The distances scrub too.
    let (x, y) = browser.middle_of("#distances");
    browser.drag((x, y), (x + 30.0, y));
    assert!(time_s(&mut browser) > 150.0);
    browser.assert_quiet();
}

#[test]
fn the_page_replays_at_phone_width() {
    replays_at(Screen::PHONE, "replay-phone");
}

#[test]
fn the_page_replays_at_desktop_width() {
    replays_at(Screen::DESKTOP, "replay-desktop");
}

#[test]
fn the_page_turns_dark_and_shows_hostile_names_as_text() {
    let hostile = "</script><img src=x onerror=alert(1)>";
    let mut episode = episode();
    episode.vessels[1].name = hostile.to_owned();
    episode.scenario = hostile.to_owned();
    let page = page_of(&episode, "replay-hostile");
    let mut browser = Browser::start();
    browser.open(&page, Screen { dark: true, ..Screen::DESKTOP });
    assert_eq!(browser.eval("document.querySelector('h1').textContent"), json!(hostile));
    assert_eq!(browser.eval("document.querySelector('button.target strong').textContent"), json!(hostile));
    assert_eq!(browser.eval("document.images.length"), json!(0));
    let sea = "Array.from(document.getElementById('scene').getContext('2d').getImageData(3, 300, 1, 1).data)";
    let dark = browser.eval(sea);
    assert!(dark[0].as_u64() < Some(90), "{dark}");
    browser.assert_quiet();

    browser.open(&page, Screen::DESKTOP);
    let light = browser.eval(sea);
    assert!(light[0].as_u64() > Some(160), "{light}");
}

#[test]
fn the_smallest_episodes_make_pages_without_complaints() {
    let mut browser = Browser::start();
    let page = page_of(&Episode { steps: Vec::new(), ..episode() }, "replay-empty");
    browser.open(&page, Screen::PHONE);
    assert_eq!(browser.eval("document.getElementById('outcome').textContent"), json!("No steps recorded"));
    browser.assert_quiet();

    let mut alone = episode();
    alone.vessels.truncate(1);
    alone.steps.truncate(1);
    alone.steps[0].vessels.truncate(1);
    alone.steps[0].pairs.clear();
    let page = page_of(&alone, "replay-alone");
    browser.open(&page, Screen::PHONE);
    browser.wait_for("document.getElementById('scene').width > 0");
    browser.click("#play");
    assert_eq!(clock(&mut browser), "00:00 / 00:00");
    assert!(pixels_of(&mut browser, 0) > 20);
    browser.assert_quiet();
}
