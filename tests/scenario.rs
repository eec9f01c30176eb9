//! Scenarios: the shipped ones through the program, and the example through the library.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use searoom::ais::{self, Area, ImportConfig};
use searoom::scenario::ScenarioFile;
use serde_json::Value;

use crate::cli::searoom;

#[path = "../examples/head_on.rs"]
#[allow(dead_code)]
mod head_on;

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Runs a shipped scenario and returns what `--json` prints.
fn outcome(scenario: &str, arguments: &[&str]) -> Value {
    let out = tempfile::tempdir().unwrap();
    let directory = out.path().to_str().unwrap();
    let output = searoom(&[&["scenario", "run", scenario, "--json", "--out", directory], arguments].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let outcome: Value = serde_json::from_slice(&output.stdout).unwrap();
    for file in ["csv", "jsonl", "html"] {
        let path = outcome["files"][file].as_str().unwrap();
        assert!(std::fs::metadata(path).unwrap().len() > 1000, "{path}");
    }
    outcome
}

fn shipped() -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(root("scenarios"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    files.sort();
    files
}

#[test]
fn holding_course_head_on_ends_in_contact_and_the_rules_prevent_it() {
    let held = outcome("scenarios/head_on.toml", &["--policy", "hold-course"]);
    assert_eq!(held["contact"], true);
    assert!(held["targets"][0]["closest_m"].as_f64().unwrap() <= 150.0);
    assert!((held["targets"][0]["tcpa_at_start_s"].as_f64().unwrap() - 240.0).abs() < 1e-6);
    let ruled = outcome("scenarios/head_on.toml", &["--policy", "rule-based"]);
    assert_eq!(ruled["contact"], false);
    assert_eq!(ruled["policy"], "rule-based");
}

#[test]
fn holding_course_stays_clear_of_a_ship_that_turns_away() {
    let held = outcome("scenarios/head_on_curve.toml", &["--policy", "hold-course"]);
    assert_eq!(held["contact"], false);
    assert!(held["targets"][0]["closest_m"].as_f64().unwrap() >= 350.0);
    assert!(held["targets"][0]["dcpa_at_start_m"].as_f64().unwrap() < 1e-6);
    let ruled = outcome("scenarios/head_on_curve.toml", &["--policy", "rule-based"]);
    assert_eq!(ruled["contact"], true, "the turn to starboard is the trap");
}

#[test]
fn every_shipped_scenario_runs_under_every_policy() {
    let files = shipped();
    assert!(files.len() >= 7, "{files:?}");
    for file in files {
        let scenario = ScenarioFile::load(&file).unwrap();
        assert!(!scenario.scenario.title.is_empty());
        let staged = scenario.set_up().unwrap();
        assert_eq!(staged.run(), scenario.set_up().unwrap().run(), "{}", file.display());
        for name in searoom::policy::NAMES {
            let mut policy = searoom::policy::by_name(name).unwrap();
            let episode = staged.run_under(policy.as_mut());
            assert_eq!(episode.steps.len(), scenario.scenario.steps() + 1, "{}", file.display());
            assert_eq!(episode, staged.run_under(policy.as_mut()), "{} {name}", file.display());
        }
    }
}

#[test]
fn the_rules_keep_clear_where_own_ship_gives_way() {
    for name in ["crossing_from_starboard", "overtaking"] {
        let mut file = ScenarioFile::load(&root(&format!("scenarios/{name}.toml"))).unwrap();
        file.scenario.policy = "hold-course".to_owned();
        assert!(file.set_up().unwrap().run().has_contact(), "{name} is no danger");
        file.scenario.policy = "rule-based".to_owned();
        assert!(!file.set_up().unwrap().run().has_contact(), "{name} ends in contact");
    }
}

#[test]
fn the_scenarios_are_listed_and_checked() {
    let list = searoom(&["scenario", "list"]);
    let text = String::from_utf8(list.stdout).unwrap();
    assert!(list.status.success());
    for file in shipped() {
        assert!(text.contains(file.file_name().unwrap().to_str().unwrap()), "{text}");
    }
    let check = searoom(&["scenario", "check", "scenarios/overtaking.toml", "scenarios/periodic.toml"]);
    assert!(check.status.success());
    assert!(
        String::from_utf8(check.stdout)
            .unwrap()
            .contains("overtaking.toml: fits, 180 steps, coaster 1.20 nmi off")
    );
}

#[test]
fn a_faulty_scenario_fails_with_file_line_key_and_remedy() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("faulty.toml");
    let text = std::fs::read_to_string(root("scenarios/overtaking.toml")).unwrap();
    std::fs::write(&file, text.replacen("speed_kn", "speed", 1)).unwrap();
    let path = file.to_str().unwrap();
    let expected =
        format!("{path}:12: key \"own_ship.speed\": is not a known key: write speed_kn or speed_mps");
    let run = searoom(&["scenario", "run", path]);
    assert!(!run.status.success());
    assert_eq!(String::from_utf8(run.stderr).unwrap(), format!("error: {expected}\n"));
    let check = searoom(&["scenario", "check", path, "scenarios/overtaken.toml"]);
    assert!(!check.status.success());
    let report = String::from_utf8(check.stdout).unwrap();
    assert!(report.contains(&expected) && report.contains("overtaken.toml: fits"), "{report}");
}

#[test]
fn a_recorded_track_that_is_not_there_is_an_error_with_a_line() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("missing.toml");
    let text = std::fs::read_to_string(root("scenarios/head_on.toml")).unwrap();
    let area = root("ais/ny-lower-bay.toml");
    let text = text.replace("../ais/ny-lower-bay.toml", area.to_str().unwrap());
    let missing = text.replace("../ais/ny-harbor-2020-12.csv.gz", "no-such-file.csv.gz");
    std::fs::write(&file, missing).unwrap();
    let line = text.lines().position(|line| line.starts_with("ais_file")).unwrap() + 1;
    let run = searoom(&["scenario", "run", file.to_str().unwrap()]);
    let message = String::from_utf8(run.stderr).unwrap();
    assert!(!run.status.success());
    assert!(message.contains(&format!("missing.toml:{line}: key \"target[1].ais_file\"")), "{message}");
    assert!(message.contains("no-such-file.csv.gz"), "{message}");
}

#[test]
fn another_seed_draws_another_ship_that_turns_away() {
    let drawn = |seed: u64| {
        let mut file = ScenarioFile::load(&root("scenarios/head_on_drawn.toml")).unwrap();
        file.scenario.seed = seed;
        let staged = file.set_up().unwrap();
        assert!(!staged.run().has_contact(), "seed {seed}");
        staged.targets[0].mmsi.unwrap()
    };
    let ships: std::collections::BTreeSet<u32> = (0..5).map(drawn).collect();
    assert!(ships.len() > 1, "{ships:?}");
}

#[test]
fn tracks_of_a_directory_serve_as_well_as_the_ais_file() {
    let directory = tempfile::tempdir().unwrap();
    let files = [root("ais/ny-harbor-2020-12.csv.gz")];
    let area = Area::load(&root("ais/ny-lower-bay.toml")).unwrap();
    let config = ImportConfig::default();
    let import = ais::import(&files, &area, &config, None, &|_| ()).unwrap();
    ais::write_import(&directory.path().join("tracks"), &import, &files, &area, &config, None).unwrap();

    let text = std::fs::read_to_string(root("scenarios/head_on.toml")).unwrap();
    let line = |key: &str| text.lines().find(|line| line.starts_with(key)).unwrap();
    let text = text.replace(line("ais_file"), "track_dir = \"tracks\"").replace(line("area_file"), "");
    let from_directory = ScenarioFile::parse(&text, &directory.path().join("head_on.toml")).unwrap();
    let from_file = ScenarioFile::load(&root("scenarios/head_on.toml")).unwrap();
    let closest = |file: ScenarioFile| file.set_up().unwrap().run().summaries()[0].closest_centre_m;
    // The written tracks are rounded to a tenth of a millimetre; extrapolating over 240 s magnifies that.
    assert!((closest(from_directory) - closest(from_file)).abs() < 0.1);
}

#[test]
fn the_example_collides_under_one_policy_and_not_under_the_other() {
    assert!(head_on::encounter("hold-course").unwrap().has_contact());
    assert!(!head_on::encounter("rule-based").unwrap().has_contact());
}

#[test]
fn a_traffic_situation_becomes_a_scenario_and_comes_back() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let (toml, json, again) = (path("lightship.toml"), path("lightship.json"), path("again.toml"));
    let run = |arguments: &[&str]| {
        let output = searoom(arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let situation = "scenarios/exchange/off_the_lightship.json";
    let said = run(&["scenario", "import", situation, "--out", &toml]);
    assert!(said.contains("lightship.toml: fits") && said.contains("startTime"), "{said}");
    let ran = outcome(&toml, &["--policy", "hold-course"]);
    assert_eq!(ran["targets"][0]["name"], "CROSSER");
    let said = run(&["scenario", "export", &toml, "--out", &json]);
    assert!(said.contains("maritime-schema 0.2.0, own ship and 2 target ships"), "{said}");
    run(&["scenario", "import", &json, "--out", &again]);
    let closest =
        |file: &str| outcome(file, &["--policy", "hold-course"])["targets"][0]["closest_m"].as_f64().unwrap();
    assert!((closest(&toml) - closest(&again)).abs() < 0.1);

    let nowhere = searoom(&["scenario", "export", "scenarios/overtaking.toml", "--out", &json]);
    assert!(!nowhere.status.success());
    let message = String::from_utf8(nowhere.stderr).unwrap();
    assert!(message.contains("--origin-latitude-deg"), "{message}");
    let faulty = path("faulty.json");
    std::fs::write(&faulty, "{\n\"ownShip\": 3}").unwrap();
    let refused = searoom(&["scenario", "import", &faulty, "--out", &again]);
    let message = String::from_utf8(refused.stderr).unwrap();
    assert!(message.contains("faulty.json:2: key \"ownShip\": is a number, not an object"), "{message}");
}

/// The shipped encounter of ships with dynamics: holding course ends in contact, its own policy clears, and the bow does not point
/// where the ship goes.
#[test]
fn tankers_in_a_current_are_sailed_by_their_dynamics() {
    let mut file = ScenarioFile::load(&root("scenarios/tankers.toml")).unwrap();
    let ruled = file.set_up().unwrap().run();
    assert!(ruled.vessels.iter().all(|vessel| vessel.motion == "kvlcc2"));
    let drift_deg = ruled.steps.iter().map(|step| {
        let own = &step.vessels[0];
        own.heading.turn_from(own.velocity.course()).to_degrees().abs()
    });
    assert!(drift_deg.fold(0.0, f64::max) > 3.0);
    assert_eq!(ruled.policy, "rule-based");
    assert!(!ruled.has_contact());
    file.scenario.policy = "hold-course".to_owned();
    assert!(file.set_up().unwrap().run().has_contact());
}
