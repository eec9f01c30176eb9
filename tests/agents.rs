//! A coastal agent from training to the helm: trained, evaluated, exported, and steering own ship in a scenario.

use std::path::Path;
use std::process::{Command, Output};

use searoom::agent::TrainedAgent;

fn searoom(arguments: &[&str]) -> Output {
    searoom_with_cache(Path::new("off"), arguments)
}

fn searoom_with_cache(cache: &Path, arguments: &[&str]) -> Output {
    let root = env!("CARGO_MANIFEST_DIR");
    let mut command = Command::new(env!("CARGO_BIN_EXE_searoom"));
    command.current_dir(root).env("SEAROOM_CACHE", cache).args(arguments).output().unwrap()
}

#[track_caller]
fn printed(arguments: &[&str]) -> String {
    let output = searoom(arguments);
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

#[track_caller]
fn json(arguments: &[&str]) -> serde_json::Value {
    serde_json::from_str(&printed(arguments)).unwrap()
}

#[track_caller]
fn refused(arguments: &[&str]) -> String {
    let output = searoom(arguments);
    assert!(!output.status.success(), "{output:?}");
    String::from_utf8(output.stderr).unwrap()
}

/// A small network, one evaluation.
const CONFIG: &str = "\
env = \"coastal\"
steps = 45

[trainer]
random_steps = 30
evaluate_every = 45
evaluation_episodes = 2

[trainer.agent]
hidden = 8
batch_size = 4
";

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn a_coastal_agent_is_trained_evaluated_exported_and_steers_own_ship() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("run.toml"), CONFIG).unwrap();
    let trained = searoom_with_cache(
        &path("cache"),
        &["train", "--config", text(&path("run.toml")), "--out", text(&path("run"))],
    );
    let account = String::from_utf8(trained.stderr).unwrap();
    assert!(trained.status.success() && account.contains("starts before a curve"), "{account}");
    assert_eq!(std::fs::read_dir(path("cache")).unwrap().count(), 1, "the starts are kept");

    let file = path("agent.safetensors");
    printed(&["export", text(&path("run")), "--out", text(&file)]);
    let evaluate =
        ["evaluate", text(&file), "--episodes", "8", "--noise-m", "10", "--tracks", "training", "--json"];
    let report = json(&evaluate);
    assert_eq!((report["noise_m"].as_f64(), report["tracks"].as_str()), (Some(10.0), Some("training")));
    let row = |policy: &str, scenario: &str| {
        let rows = report["rows"].as_array().unwrap();
        rows.iter().find(|row| row["policy"] == policy && row["scenario"] == scenario).unwrap().clone()
    };
    // Holding course collides where the target ship goes straight on, and by that alone.
    assert_eq!(row("hold-course", "straight-on")["contact_rate"], 1.0);
    assert!(row("hold-course", "before-curve")["contact_rate"].as_f64().unwrap() < 0.5);
    for policy in ["agent", "random"] {
        let [all, one, two] = ["both", "before-curve", "straight-on"]
            .map(|scenario| row(policy, scenario)["episodes"].as_u64().unwrap());
        assert_eq!((all, one + two), (8, 8));
    }
    assert!(report["comparison"]["ratio"].is_number());

    let out = path("out");
    let sailed = json(&[
        "scenario",
        "run",
        "scenarios/head_on.toml",
        "--policy",
        text(&file),
        "--out",
        text(&out),
        "--json",
    ]);
    assert_eq!((sailed["policy"].as_str(), sailed["targets"].as_array().unwrap().len()), (Some("agent"), 1));
    let elsewhere = searoom(&[
        "scenario",
        "run",
        "scenarios/overtaken.toml",
        "--policy",
        text(&file),
        "--out",
        text(&path("out")),
    ]);
    assert!(elsewhere.status.success(), "{elsewhere:?}");
    let note = String::from_utf8(elsewhere.stderr).unwrap();
    assert!(note.contains("trained in another area"), "{note}");
}

#[test]
fn policies_that_there_are_not_and_that_do_not_fit_are_told() {
    let run = ["scenario", "run", "scenarios/head_on.toml", "--policy"];
    let unknown = refused(&[&run[..], &["full-astern"]].concat());
    assert!(unknown.contains("\"full-astern\" is no policy") && unknown.contains("rule-based"), "{unknown}");
    let foreign = refused(&[&run[..], &["models/open-water-periodic.safetensors"]].concat());
    assert!(foreign.contains("open-water-periodic.safetensors"), "{foreign}");

    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("open-water");
    let settings = folder.path().join("run.toml");
    let small =
        CONFIG.replace("coastal", "open-water").replace("steps = 45\n", "steps = 45\nestimates = false\n");
    std::fs::write(&settings, small + "\n[open_water]\ndecisions = 20\n").unwrap();
    printed(&["train", "--config", text(&settings), "--out", text(&out)]);
    let unfit = refused(&[&run[..], &[text(&out)]].concat());
    assert!(unfit.contains("trained in open water with passing rules"), "{unfit}");
}

#[test]
fn environments_are_tabled() {
    let listed = printed(&["env"]);
    assert!(listed.contains("open-water") && listed.contains("43") && listed.contains("26"), "{listed}");
    let coastal = printed(&["env", "coastal", "--no-estimates"]);
    assert!(
        coastal.contains("2 + 4 j") && coastal.contains("wrong_side") && !coastal.contains("DCPA"),
        "{coastal}"
    );
    assert_eq!(json(&["env", "open-water", "--json"])["observation_len"], 43);
}

/// A shipped agent opens, has its card, its forecaster, and a learning curve whose best evaluation chose its weights.
#[test]
fn shipped_agents_have_cards_and_curves() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let card = std::fs::read_to_string(root.join("models/agents/README.md")).unwrap();
    let mut agents = 0;
    for entry in std::fs::read_dir(root.join("models/agents")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "safetensors") {
            continue;
        }
        agents += 1;
        let agent = TrainedAgent::open(&path).unwrap();
        let name = path.file_stem().unwrap().to_str().unwrap();
        assert!(card.contains(&format!("`{name}`")), "{name} has no card");
        assert!(!agent.config.estimates || root.join(agent.config.forecaster_file()).exists(), "{name}");
        let curve = csv::Reader::from_path(root.join("results").join(name).join("evaluations.csv"));
        let points: Vec<(u64, f64)> = curve
            .unwrap()
            .records()
            .map(|record| record.unwrap())
            .map(|record| (record[0].parse().unwrap(), record[1].parse().unwrap()))
            .collect();
        assert!(points.len() >= 15 && points.last().unwrap().0 >= 150_000, "{name}");
        let best = points.iter().map(|point| point.1).fold(f64::NEG_INFINITY, f64::max);
        let chosen = points.iter().find(|point| point.1 == best).unwrap();
        assert_eq!((agent.step, agent.mean_return), *chosen, "{name}");
    }
    assert!(agents >= 4);
}
