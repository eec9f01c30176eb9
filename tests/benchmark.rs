//! `searoom benchmark imazu` as a user runs it.

#![allow(clippy::unwrap_used)]

use serde_json::Value;

use crate::cli::searoom;

fn imazu(arguments: &[&str]) -> String {
    let output = searoom(&[&["benchmark", "imazu"], arguments].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn every_case_runs_with_every_policy_and_holding_course_always_collides() {
    let results: Value = serde_json::from_str(&imazu(&["--json"])).unwrap();
    let episodes = results["episodes"].as_array().unwrap();
    assert_eq!(episodes.len(), 22 * searoom::policy::NAMES.len());
    for episode in episodes {
        assert!(episode["closest_m"].as_f64().unwrap().is_finite(), "{episode}");
        if episode["policy"] == "hold-course" {
            assert_eq!(episode["contact"], true, "{episode}");
            assert!(episode["closest_m"].as_f64().unwrap() < 1e-6, "{episode}");
            assert_eq!(episode["compliance"], 0.0, "{episode}");
        }
    }
    let contacts = |policy: &str| {
        let policies = results["policies"].as_array().unwrap();
        policies.iter().find(|row| row["policy"] == policy).unwrap()["contacts"].as_u64().unwrap()
    };
    assert_eq!(contacts("hold-course"), 22);
    for policy in ["velocity-obstacle", "mpc"] {
        assert!(contacts(policy) <= 5, "{policy}: {}", contacts(policy));
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let run = |threads| {
        imazu(&[
            "--json",
            "--cases",
            "1,6,14,21",
            "--policies",
            "velocity-obstacle,mpc",
            "--threads",
            threads,
        ])
    };
    assert_eq!(run("1"), run("2"));
}

#[test]
fn the_page_has_a_picture_of_every_episode() {
    let folder = tempfile::tempdir().unwrap();
    let directory = folder.path().to_str().unwrap();
    let text = imazu(&["--cases", "1,2,3", "--policies", "hold-course,rule-based", "--out", directory]);
    assert!(text.contains("rule-based") && text.contains("contact"), "{text}");
    let page = std::fs::read_to_string(folder.path().join("index.html")).unwrap();
    assert_eq!(page.matches("<svg").count(), 6);
    assert!(page.contains("2: crossing from starboard"));
    let json: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("imazu.json")).unwrap()).unwrap();
    assert_eq!(json["episodes"].as_array().unwrap().len(), 6);
}

#[test]
fn settings_of_policies_come_from_a_file_and_mistakes_in_it_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("policies.toml");
    let path = file.to_str().unwrap();
    let arguments = ["--cases", "1", "--policies", "rule-based", "--json", "--policy-config", path];
    std::fs::write(&file, "[rule-based]\nmargin_m = 600\n").unwrap();
    let results: Value = serde_json::from_str(&imazu(&arguments)).unwrap();
    assert!(results["episodes"][0]["closest_m"].as_f64().unwrap() > 850.0, "{results}");
    for (text, expected) in [
        (
            "[mpc]\nheading_step = 5\n",
            "policies.toml:2: unknown key \"heading_step\": did you mean \"heading_step_deg\"?",
        ),
        (
            "[mpc]\nheading_step_deg = 0\n",
            "key \"mpc.heading_step_deg\": 0 is not possible here: write a number above 0",
        ),
        ("[mpc]\nspeed_fractions = [2.0]\n", "key \"mpc.speed_fractions\": is no list of fractions"),
    ] {
        std::fs::write(&file, text).unwrap();
        let output = searoom(&[&["benchmark", "imazu"], &arguments[..]].concat());
        assert!(!output.status.success());
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains(expected), "{message}");
    }
}
