//! `searoom sweep`: interrupted and resumed it brings the same results, and it goes on with what is there.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

/// Two agents with two seeds, small networks, an update from step 50 on.
const SWEEP: &str = "\
steps = 300
seeds = [1, 2]
motion = [\"periodic\"]
algorithm = [\"lstm-td3\", \"lstm-sac\"]
estimates = [false]

[settings.open_water]
decisions = 40

[settings.trainer]
random_steps = 50
evaluate_every = 100
evaluation_episodes = 2

[settings.trainer.agent]
hidden = 16
";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("small.toml"), SWEEP).unwrap();
    folder
}

fn searoom(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_searoom"));
    command.current_dir(folder).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    searoom(folder, arguments).output().unwrap()
}

fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn error(output: &Output) -> String {
    assert!(!output.status.success(), "{output:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

const SWEEP_COMMAND: [&str; 6] = ["sweep", "small.toml", "--checkpoint-every", "20", "--log-every", "50"];

fn csv(folder: &Path) -> String {
    fs::read_to_string(folder.join("runs/small.csv")).unwrap()
}

#[test]
fn an_interrupted_sweep_goes_on_to_the_same_results() {
    let (straight, stopped) = (folder(), folder());
    let whole = run(straight.path(), &SWEEP_COMMAND);
    assert!(whole.status.success(), "{whole:?}");
    let lines = csv(straight.path());
    assert_eq!(lines.lines().count(), 5, "{lines}");
    assert!(
        lines.lines().nth(1).unwrap().starts_with("open-water-periodic-lstm-td3-baseline-seed-1,"),
        "{lines}"
    );
    assert!(lines.lines().skip(1).all(|line| line.contains(",300,3,")), "three evaluations each: {lines}");

    // Begun by hand, then one process at a time, stopped by Ctrl-C and by SIGKILL.
    let by_hand = "runs/open-water-periodic-lstm-td3-baseline-seed-1";
    let settings = SWEEP.split_once("\n\n").unwrap().1.replace("settings.", "");
    fs::write(stopped.path().join("run.toml"), format!("estimates = false\n{settings}")).unwrap();
    let begin = ["train", "--config", "run.toml", "--motion", "periodic", "--algorithm", "lstm-td3"];
    let begun = run(stopped.path(), &[&begin[..], &["--steps", "130", "--out", by_hand]].concat());
    assert!(begun.status.success(), "{begun:?}");
    for signal in ["INT", "KILL"] {
        let one = [&SWEEP_COMMAND[..], &["--jobs", "1"]].concat();
        let mut child = searoom(stopped.path(), &one).spawn().unwrap();
        let checkpoints = || {
            let runs = fs::read_dir(stopped.path().join("runs")).unwrap().flatten();
            runs.filter_map(|run| fs::read(run.path().join("checkpoint.safetensors")).ok())
                .collect::<Vec<_>>()
        };
        let before = checkpoints();
        while checkpoints() == before && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
        let ended = child.wait_with_output().unwrap();
        if signal == "INT" && out(&ended).contains("not finished") {
            assert!(ended.status.success() && out(&ended).contains("the same command goes on"), "{ended:?}");
        }
    }
    let resumed = run(stopped.path(), &SWEEP_COMMAND);
    assert!(resumed.status.success(), "{resumed:?}");
    assert_eq!(csv(stopped.path()), lines);
    for name in lines.lines().skip(1).map(|line| line.split(',').next().unwrap()) {
        for file in ["checkpoint.safetensors", "policy.safetensors", "evaluations.csv", "config.toml"] {
            let [ours, theirs] = [&straight, &stopped]
                .map(|folder| fs::read(folder.path().join("runs").join(name).join(file)).unwrap());
            // A policy that was kept before the end was raised says so.
            assert!(
                ours == theirs || (file == "policy.safetensors" && name.ends_with("td3-baseline-seed-1")),
                "{name}/{file}"
            );
        }
    }

    let again = run(stopped.path(), &["sweep", "small.toml", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&out(&again)).unwrap();
    assert_eq!(summary["finished"], true);
    assert_eq!(summary["agents"][1]["agent"], "open-water-periodic-lstm-sac-baseline");
    assert_eq!(summary["agents"][1]["seeds"], 2);
    assert!(summary["agents"][1]["best"]["interval"]["low"].is_number());
    assert_eq!(csv(stopped.path()), lines, "nothing left to do changes nothing");
}

#[test]
fn a_run_of_another_configuration_is_not_touched() {
    let folder = folder();
    let name = "runs/open-water-periodic-lstm-sac-baseline-seed-2";
    let begin =
        ["train", "--motion", "periodic", "--no-estimates", "--seed", "2", "--steps", "5", "--out", name];
    assert!(run(folder.path(), &begin).status.success());
    let before = fs::read(folder.path().join(name).join("checkpoint.safetensors")).unwrap();
    let told = error(&run(folder.path(), &SWEEP_COMMAND));
    assert!(
        told.contains(name) && told.contains("`open_water.decisions` is 500 there and 40 in the sweep"),
        "{told}"
    );
    assert_eq!(before, fs::read(folder.path().join(name).join("checkpoint.safetensors")).unwrap());
}

#[test]
fn a_sweep_is_listed_before_it_is_trained() {
    let folder = folder();
    let listed = run(folder.path(), &["sweep", "small.toml", "--list"]);
    assert_eq!(out(&listed).matches("open-water-periodic").count(), 4, "{listed:?}");
    assert!(!folder.path().join("runs").exists());
    fs::write(folder.path().join("small.toml"), "steps = 10\nseeds = [1]\nalgorithms = []\n").unwrap();
    let told = error(&run(folder.path(), &["sweep", "small.toml"]));
    assert!(told.contains("small.toml:3") && told.contains("algorithm"), "{told}");
}

/// The sweeps that the project ships are what they say.
#[test]
fn shipped_sweeps_are_those_of_the_experiments() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (file, count, last) in [
        ("sweep-coastal.toml", 12, "coastal-lstm-sac-baseline-seed-3"),
        ("sweep-open-water.toml", 12, "open-water-periodic-lstm-sac-baseline-seed-3"),
        ("sweep-open-water-td3.toml", 12, "open-water-periodic-lstm-td3-baseline-seed-3"),
        ("sweep-history.toml", 16, "open-water-stochastic-lstm-sac-h10-baseline-seed-2"),
    ] {
        let path = root.join("models/training").join(file);
        let folder = tempfile::tempdir().unwrap();
        let listed = run(folder.path(), &["sweep", path.to_str().unwrap(), "--list", "--json"]);
        let runs: Vec<serde_json::Value> = serde_json::from_str(&out(&listed)).unwrap();
        assert_eq!((runs.len(), runs[count - 1]["run"].as_str().unwrap()), (count, last));
    }
}
