//! `searoom benchmark imazu` as a user runs it.

#![allow(clippy::unwrap_used)]

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use searoom::agent::{RunConfig, TrainedAgent};
use searoom::env::EnvName;
use searoom::rl::agent::Agent;
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
    for policy in ["velocity-obstacle", "potential-field", "mpc"] {
        assert_eq!(contacts(policy), 0, "{policy}");
    }
}

/// An agent of the coastal environment decides every 20 s, own ship of the problems takes orders every 10 s.
#[test]
fn an_agent_takes_part_at_its_own_pace_and_thresholds_come_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = RunConfig::of(EnvName::Coastal);
    config.estimates = false;
    config.trainer.agent.hidden = 8;
    let save = |name: &str, config: &RunConfig| {
        let rng = &mut ChaCha8Rng::seed_from_u64(4);
        let agent = Agent::new(config.trainer.agent.clone(), config.observation_len(), 1, rng);
        let config = config.clone();
        let mut trained = TrainedAgent { name: name.into(), config, step: 0, mean_return: 0.0, agent };
        let path = folder.path().join(format!("{name}.safetensors"));
        trained.to_file().save(&path).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let some = save("some", &config);
    let rules = folder.path().join("rules.toml");
    let rules = rules.to_str().unwrap();
    std::fs::write(rules, "[encounters]\nrisk_dcpa_m = 1\n").unwrap();
    let options =
        ["--json", "--cases", "1,2", "--policies", &format!("rule-based,{some}"), "--rules-config", rules];
    let results: Value = serde_json::from_str(&imazu(&options)).unwrap();
    let names: Vec<_> = results["episodes"].as_array().unwrap().iter().map(|row| &row["policy"]).collect();
    assert_eq!(names, ["rule-based", "some", "rule-based", "some"]);

    let refused = |options: &[&str]| {
        let output = searoom(&[&["benchmark", "imazu", "--cases", "1"], options].concat());
        assert!(!output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    config.coastal.head_on.decision_interval_s = 15.0;
    config.coastal.decisions = 20;
    let odd = save("odd", &config);
    let told = refused(&["--policies", &odd]);
    assert!(told.contains("decide every 15 s, which is no multiple of the 10 s"), "{told}");
    let told = refused(&["--policies", "mpc,mpc"]);
    assert!(told.contains("two called \"mpc\""), "{told}");
    let told = refused(&["--policies", "hold-curse"]);
    assert!(told.contains("\"hold-curse\" is no policy: write one of hold-course"), "{told}");
    std::fs::write(rules, "[compliance]\nearly_s = 0\n").unwrap();
    let told = refused(&["--rules-config", rules]);
    assert!(told.contains("rules.toml:2: key \"compliance.early_s\": 0 is not possible here"), "{told}");
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
    let text = imazu(&["--cases", "1,2,3", "--policies", "hold-course", "rule-based", "--out", directory]);
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
            "policies.toml:2: key \"mpc.heading_step_deg\": 0 is not possible here: write a number from 0.001 to 1000000",
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
