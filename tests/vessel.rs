//! `searoom vessel`: what the program prints and writes of the standard manoeuvres.

use std::fs;

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
fn an_angle_that_no_rudder_has_is_refused_with_a_remedy() {
    for arguments in [["vessel", "turn", "--rudder-deg", "90"], ["vessel", "zigzag", "--angle-deg", "NaN"]] {
        let output = searoom(&arguments);
        assert_eq!(output.status.code(), Some(1));
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(message.contains(arguments[2]) && message.contains("give a number from"), "{message}");
    }
}
