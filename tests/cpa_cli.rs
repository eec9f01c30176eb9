//! `searoom cpa` as a user runs it.

use std::path::Path;
use std::process::{Command, Output};

/// Own ship goes north at 8 m/s; the target ship comes down at 6 m/s, 100 m to the east, and from 100 s
/// on turns away to the east.
fn write_tracks(folder: &Path) {
    let mut own = "time_s,north_m,east_m\n".to_owned();
    let mut target = own.clone();
    for step in 0..=60 {
        let time_s = f64::from(step) * 5.0;
        own += &format!("{time_s},{},0\n", 8.0 * time_s);
        let turned_s = (time_s - 100.0).max(0.0);
        target += &format!("{time_s},{},{}\n", 2100.0 - 6.0 * (time_s - turned_s), 100.0 + 6.0 * turned_s);
    }
    std::fs::write(folder.join("own.csv"), own).expect("the folder takes files");
    std::fs::write(folder.join("target.csv"), target).expect("the folder takes files");
}

fn searoom(folder: &Path, arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_searoom");
    Command::new(program).current_dir(folder).arg("cpa").args(arguments).output().expect("it runs")
}

#[test]
fn the_three_methods_stand_side_by_side() {
    let folder = tempfile::tempdir().unwrap();
    write_tracks(folder.path());
    let output = searoom(
        folder.path(),
        &["own.csv", "target.csv", "--at", "50", "--smoothing", "0", "--json", "--plot", "cpa.svg"],
    );
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let value = |method: &str, name: &str| json[method][name].as_f64().unwrap();
    // Straight on they would pass at 100 m; that is 100 s away.
    assert!((value("closed_form", "distance_m") - 100.0).abs() < 1e-6);
    assert!((value("closed_form", "time_s") - 100.0).abs() < 1e-6);
    // With the turn: 700 m ahead and 100 m aside when it begins, then 8 m/s north against 6 m/s east.
    let refined_m = (8.0 * 100.0 + 6.0 * 700.0) / 10.0;
    let refined = json["refined"]["cpa"].clone();
    assert!((refined["distance_m"].as_f64().unwrap() - refined_m).abs() < 1e-6, "{refined}");
    assert!((refined["time_s"].as_f64().unwrap() - 100.0).abs() < 1e-6, "{refined}");
    assert!(value("sampled", "distance_m") >= refined_m - 1e-9);
    let difference = value("closed_form_less_refined", "distance_m");
    assert!((difference - (100.0 - refined_m)).abs() < 1e-6);
    let svg = std::fs::read_to_string(folder.path().join("cpa.svg")).unwrap();
    for text in ["<svg", "smoothed distance", "refined CPA: 500.00 m at 100.00 s", "distance (m)"] {
        assert!(svg.contains(text), "the figure lacks {text}");
    }
}

#[test]
fn the_table_counts_the_cone_programmes() {
    let folder = tempfile::tempdir().unwrap();
    write_tracks(folder.path());
    let output = searoom(folder.path(), &["own.csv", "target.csv", "--at", "50"]);
    let text = String::from_utf8(output.stdout).unwrap();
    for word in ["closed form", "sampled", "refined", "DCPA (m)", "fallbacks to samples: 0"] {
        assert!(text.contains(word), "{text}");
    }
}

#[test]
fn wrong_input_is_met_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    write_tracks(folder.path());
    std::fs::write(folder.path().join("late.csv"), "time_s,north_m,east_m\n900,0,0\n905,1,0\n").unwrap();
    for (arguments, expected) in [
        (&["own.csv", "gone.csv"][..], "gone.csv: cannot be read; check the path"),
        (&["own.csv", "late.csv"], "choose tracks that overlap"),
        (&["own.csv", "target.csv", "--at", "301"], "choose 0 to 300 seconds"),
        (&["own.csv", "target.csv", "--at", "NaN"], "choose 0 to 300 seconds"),
        (&["own.csv", "target.csv", "--smoothing", "40"], "choose a smaller one"),
        (&["own.csv:1", "target.csv"], "leave :1 away"),
    ] {
        let output = searoom(folder.path(), arguments);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.starts_with("error: ") && text.contains(expected), "{arguments:?}: {text}");
    }
}

#[test]
fn a_scenario_and_a_time_do_as_well_as_two_tracks() {
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/overtaking.toml");
    let folder = tempfile::tempdir().unwrap();
    let output =
        searoom(folder.path(), &["--scenario", scenario, "--at", "30", "--smoothing", "0", "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["refined"]["cpa"]["distance_m"].as_f64().unwrap() > 0.0);

    let output = searoom(folder.path(), &["--scenario", scenario, "--ship", "Flying Dutchman"]);
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.contains("there is no target ship \"Flying Dutchman\"; its target ships: "), "{text}");
    assert_eq!(searoom(folder.path(), &["--scenario", scenario, "own.csv"]).status.code(), Some(2));
    assert_eq!(searoom(folder.path(), &["own.csv"]).status.code(), Some(2));
}
