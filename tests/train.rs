//! `searoom train` and `searoom evaluate`: a run can be killed and resumed, and bad input is told.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

fn searoom(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_searoom"));
    command.current_dir(folder).env("SEAROOM_CACHE", "off").args(arguments);
    command
}

fn output(folder: &Path, arguments: &[&str]) -> Output {
    searoom(folder, arguments).output().unwrap()
}

/// Small networks, short episodes, an update from step 50 on.
const CONFIG: &str = "\
env = \"open-water\"
estimates = false

[open_water]
decisions = 40

[trainer]
random_steps = 50
evaluate_every = 100
evaluation_episodes = 2

[trainer.agent]
hidden = 16
";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("run.toml"), CONFIG).unwrap();
    folder
}

const TRAIN: [&str; 7] = ["train", "--config", "run.toml", "--out", "run", "--checkpoint-every", "20"];

fn text(output: &Output) -> (String, String) {
    let read = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (read(&output.stdout), read(&output.stderr))
}

/// What no network or environment can work with is refused before anything is written.
#[test]
fn settings_that_cannot_be_worked_with_are_refused_by_line() {
    let folder = folder();
    for (text, expected) in [
        (
            "env = \"open-water\"\n\n[trainer.agent]\nbatch_size = 0\n",
            "run.toml:4: key \"trainer.agent.batch_size\": 0 is not possible here: write a number from 1 to",
        ),
        ("[trainer.agent.sac]\ndiscount = nan\n", "run.toml:2: key \"trainer.agent.sac.discount\": NaN is"),
        ("[open_water]\ndecisions = 0\n", "run.toml:2: key \"open_water.decisions\": 0 is not possible here"),
        (
            "[open_water]\nsmoothing_half_width = 101\n",
            "run.toml:2: key \"open_water.smoothing_half_width\": 101 is above forecast_steps, which is 100",
        ),
        ("[coastal.head_on]\nspeed_min_mps = 17\n", "17 is above speed_max_mps, which is 16"),
    ] {
        fs::write(folder.path().join("run.toml"), text).unwrap();
        let refused = output(folder.path(), &TRAIN);
        assert!(!refused.status.success());
        assert!(text_of_error(&refused).contains(expected), "{}", text_of_error(&refused));
        assert!(!folder.path().join("run").exists());
    }
    fs::write(folder.path().join("run.toml"), CONFIG).unwrap();
    let refused = output(folder.path(), &[&TRAIN[..], &["--steps", "0"]].concat());
    assert!(text_of_error(&refused).contains("steps: 0 is not possible here"), "{refused:?}");
}

fn text_of_error(output: &Output) -> String {
    text(output).1
}

#[test]
fn a_run_trains_is_evaluated_and_is_not_overwritten() {
    let folder = folder();
    let trained = output(folder.path(), &[&TRAIN[..], &["--steps", "200"]].concat());
    assert!(trained.status.success(), "{:?}", text(&trained));
    assert!(text(&trained).0.starts_with("finished at 200 of 200 decisions"), "{:?}", text(&trained));
    let evaluations = fs::read_to_string(folder.path().join("run/evaluations.csv")).unwrap();
    assert_eq!(evaluations.lines().count(), 3, "{evaluations}");

    let evaluated = output(folder.path(), &["evaluate", "run", "--episodes", "3", "--json"]);
    let outcome: serde_json::Value = serde_json::from_str(&text(&evaluated).0).unwrap();
    assert_eq!(outcome["episodes"], 3);
    let rows = outcome["rows"].as_array().unwrap();
    let policies: Vec<_> = rows.iter().map(|row| row["policy"].as_str().unwrap()).collect();
    assert_eq!(policies, ["run", "hold-course", "random"]);
    for row in rows {
        let [mean, wrong] =
            ["mean_return", "wrong_passings_per_episode"].map(|key| row[key].as_f64().unwrap());
        assert!(mean <= 0.0 && wrong == -mean, "wrong passings are minus the return");
    }
    let single = ["evaluate", "run", "--episodes", "3", "--json", "--threads", "1"];
    assert_eq!(
        text(&evaluated).0,
        text(&output(folder.path(), &single)).0,
        "the same on any number of threads"
    );
    let noisy = output(folder.path(), &["evaluate", "run", "--noise-m", "5"]);
    assert!(text(&noisy).1.contains("no coastal run"), "{:?}", text(&noisy));

    let again = output(folder.path(), &[&TRAIN[..], &["--steps", "200"]].concat());
    assert!(!again.status.success());
    assert!(text(&again).1.contains("has a run already"), "{:?}", text(&again));
}

/// Killed at any moment, a run goes on from its last checkpoint to the very weights of a run that was
/// never stopped.
#[test]
fn a_killed_run_resumes_to_the_same_weights() {
    let (straight, killed) = (folder(), folder());
    let arguments = [&TRAIN[..], &["--steps", "400", "--log-every", "30"]].concat();
    assert!(output(straight.path(), &arguments).status.success());

    let checkpoint = killed.path().join("run/checkpoint.safetensors");
    let mut child = searoom(killed.path(), &arguments).spawn().unwrap();
    while !checkpoint.exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();

    let resume = ["train", "--resume", "run", "--checkpoint-every", "20", "--log-every", "30"];
    let resumed = output(killed.path(), &resume);
    assert!(resumed.status.success(), "{:?}", text(&resumed));
    for file in ["checkpoint.safetensors", "policy.safetensors", "evaluations.csv", "progress.csv"] {
        let file = &format!("run/{file}");
        let [ours, theirs] = [&straight, &killed].map(|folder| fs::read(folder.path().join(file)).unwrap());
        assert!(ours == theirs, "{file} differs");
    }
}

/// Before its first checkpoint a run has nothing to go on from but its configuration.
#[test]
fn a_run_without_a_checkpoint_begins_again() {
    let (straight, killed) = (folder(), folder());
    let arguments = [&TRAIN[..], &["--steps", "130"]].concat();
    assert!(output(straight.path(), &arguments).status.success());
    fs::create_dir(killed.path().join("run")).unwrap();
    let [from, to] = [&straight, &killed].map(|folder| folder.path().join("run/config.toml"));
    fs::copy(from, to).unwrap();
    fs::write(killed.path().join("run/evaluations.csv"), "step,mean_return\n100,5.0\n").unwrap();
    assert!(output(killed.path(), &["train", "--resume", "run"]).status.success());
    for file in ["run/checkpoint.safetensors", "run/policy.safetensors", "run/evaluations.csv"] {
        let [ours, theirs] = [&straight, &killed].map(|folder| fs::read(folder.path().join(file)).unwrap());
        assert!(ours == theirs, "{file} differs");
    }
}

/// One process at a time trains in a folder.
#[test]
fn a_folder_in_use_is_refused() {
    let folder = folder();
    let arguments = [&TRAIN[..], &["--steps", "100000"]].concat();
    let mut child = searoom(folder.path(), &arguments).spawn().unwrap();
    while !folder.path().join("run/checkpoint.safetensors").exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let second = output(folder.path(), &["train", "--resume", "run"]);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!second.status.success() && text(&second).1.contains("another process"), "{:?}", text(&second));
}

/// With a checkpoint after every decision the process is killed while it writes one, again and again.
#[test]
fn a_run_killed_while_it_writes_checkpoints_loses_nothing_else() {
    let (straight, killed) = (folder(), folder());
    let begin =
        ["train", "--config", "run.toml", "--steps", "160", "--out", "run", "--checkpoint-every", "1"];
    assert!(output(straight.path(), &begin).status.success());
    let checkpoint = killed.path().join("run/checkpoint.safetensors");
    for attempt in 0..6 {
        let arguments: &[&str] =
            if attempt == 0 { &begin } else { &["train", "--resume", "run", "--checkpoint-every", "1"] };
        let before = fs::read(&checkpoint).ok();
        let mut child = searoom(killed.path(), arguments).spawn().unwrap();
        while fs::read(&checkpoint).ok() == before && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(Duration::from_micros(700 * attempt));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    // What such a process may leave behind goes.
    fs::write(killed.path().join("run/.abc.partial"), "half").unwrap();
    let resumed = output(killed.path(), &["train", "--resume", "run", "--checkpoint-every", "1"]);
    assert!(resumed.status.success(), "{:?}", text(&resumed));
    let left = fs::read_dir(killed.path().join("run")).unwrap().flatten().map(|entry| entry.file_name());
    assert!(left.into_iter().all(|name| !name.to_string_lossy().ends_with(".partial")));
    for file in ["run/checkpoint.safetensors", "run/policy.safetensors", "run/evaluations.csv"] {
        let [ours, theirs] = [&straight, &killed].map(|folder| fs::read(folder.path().join(file)).unwrap());
        assert!(ours == theirs, "{file} differs");
    }
}

/// What is in a run's folder is never overwritten by what does not belong to it.
#[test]
fn another_configuration_and_damage_are_told_and_nothing_is_overwritten() {
    let folder = folder();
    assert!(output(folder.path(), &[&TRAIN[..], &["--steps", "120"]].concat()).status.success());
    let [config, checkpoint] =
        ["config.toml", "checkpoint.safetensors"].map(|file| folder.path().join("run").join(file));
    let (settings, whole) = (fs::read_to_string(&config).unwrap(), fs::read(&checkpoint).unwrap());
    let refused = |expected: &str| {
        let resumed = output(folder.path(), &["train", "--resume", "run", "--steps", "200"]);
        assert!(!resumed.status.success() && text(&resumed).1.contains(expected), "{:?}", text(&resumed));
    };

    fs::write(&config, settings.replace("hidden = 16", "hidden = 17")).unwrap();
    refused("`agent.hidden` was 16 and is 17");
    assert!(fs::read(&checkpoint).unwrap() == whole);

    fs::write(&config, &settings).unwrap();
    fs::write(&checkpoint, &whole[..whole.len() / 2]).unwrap();
    refused("checkpoint.safetensors: not a safetensors file, or a truncated one");
    assert_eq!(fs::read(&checkpoint).unwrap().len(), whole.len() / 2);

    fs::write(&checkpoint, &whole).unwrap();
    let begun = output(folder.path(), &[&TRAIN[..], &["--steps", "200"]].concat());
    assert!(!begun.status.success());
    assert!(fs::read(&checkpoint).unwrap() == whole && fs::read_to_string(&config).unwrap() == settings);
}

#[test]
fn what_is_no_run_is_told_with_a_remedy() {
    let folder = folder();
    let evaluated = output(folder.path(), &["evaluate", "nowhere"]);
    assert!(!evaluated.status.success());
    assert!(
        text(&evaluated).1.contains("give the folder that `searoom train` wrote"),
        "{:?}",
        text(&evaluated)
    );

    fs::write(folder.path().join("run.toml"), "stepps = 3\n").unwrap();
    let trained = output(folder.path(), &TRAIN);
    assert!(text(&trained).1.contains("run.toml:1"), "{:?}", text(&trained));
}

/// An agent learns from the recorded tracks of an area and is measured on its held-out time.
#[test]
fn an_agent_trains_in_coastal_waters() {
    let folder = folder();
    let project = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = format!(
        "env = \"coastal\"\nestimates = false\nsteps = 90\n\n[tracks]\narea = {:?}\nfiles = [{:?}]\n\n[trainer]\n\
         random_steps = 50\nevaluation_episodes = 2\n\n[trainer.agent]\nhidden = 16\n",
        project.join("ais/ny-lower-bay.toml"),
        project.join("ais/ny-harbor-2020-12.csv.gz"),
    );
    fs::write(folder.path().join("coastal.toml"), config).unwrap();
    let trained = output(folder.path(), &["train", "--config", "coastal.toml", "--out", "coastal"]);
    assert!(trained.status.success(), "{:?}", text(&trained));
    let resolved = fs::read_to_string(folder.path().join("coastal/config.toml")).unwrap();
    // What the file leaves out is the paper's value for this environment.
    assert!(resolved.contains("steps = 90") && resolved.contains("evaluate_every = 5000"), "{resolved}");
    assert!(folder.path().join("coastal/checkpoint.safetensors").exists());
}

#[test]
fn a_forecaster_of_another_area_is_refused() {
    let folder = folder();
    let project = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = format!(
        "env = \"coastal\"\nforecaster = {:?}\n\n[tracks]\narea = {:?}\nfiles = [{:?}]\n",
        project.join("models/coastal-ny-lower-bay.safetensors"),
        project.join("ais/hampton-roads.toml"),
        project.join("ais/hampton-roads-2020-06.csv.gz"),
    );
    fs::write(folder.path().join("coastal.toml"), config).unwrap();
    let refused = output(folder.path(), &["train", "--config", "coastal.toml", "--out", "coastal"]);
    assert!(!refused.status.success());
    let error = text(&refused).1;
    assert!(error.contains("was trained in a plane about 40.5"), "{error}");
    assert!(!folder.path().join("coastal").exists());
}
