//! `searoom forecast` from the command line: train, stop, resume, measure, draw.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use crate::cli::searoom;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    /// A configuration of a few updates, or of more than anyone waits for.
    fn config(&self, steps: u64) -> String {
        let text = format!(
            "name = \"tiny\"\nkind = \"open-water\"\n[data.synthetic.process.stochastic]\n\
             [training]\nseed = 3\n[[training.stages]]\nsteps = {steps}\nbatch = 4\n\
             [[training.stages]]\nsteps = 3\nbatch = 4\ncalls = 2\n"
        );
        let path = self.path("tiny.toml");
        fs::write(&path, text).expect("a writable folder");
        path
    }

    fn trained(&self) -> String {
        let config = self.config(5);
        succeed(&["forecast", "train", "--config", &config, "--out", &self.path("run"), "--log-every", "2"]);
        self.path("run/model.safetensors")
    }
}

fn succeed(arguments: &[&str]) -> String {
    let output = searoom(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).expect("UTF-8")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn refused(arguments: &[&str]) -> String {
    let output = searoom(arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}");
    stderr(&output)
}

#[test]
fn a_run_leaves_settings_log_events_checkpoint_and_model() {
    let folder = Folder::new();
    folder.trained();
    let log = fs::read_to_string(folder.path("run/log.csv")).unwrap();
    let steps: Vec<&str> = log.lines().map(|line| line.split(',').next().unwrap()).collect();
    assert_eq!(steps, ["step", "2", "4", "6", "8"]);
    let config = fs::read_to_string(folder.path("run/config.toml")).unwrap();
    assert!(config.contains("seed = 3") && config.contains("innovation_sd_m = 15.0"), "{config}");
    let names: Vec<String> = fs::read_dir(folder.path("run"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert!(names.iter().any(|name| name.contains("tfevents")), "{names:?}");

    let config = folder.path("tiny.toml");
    let text = refused(&["forecast", "train", "--config", &config, "--out", &folder.path("run")]);
    assert!(text.contains("--resume"), "{text}");
    let text = succeed(&["forecast", "train", "--out", &folder.path("run"), "--resume"]);
    assert!(text.contains("8 of 8 updates"), "{text}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_can_be_resumed() {
    let folder = Folder::new();
    let config = folder.config(10_000_000);
    let run = folder.path("run");
    let program = Command::new(env!("CARGO_BIN_EXE_searoom"))
        .args(["forecast", "train", "--config", &config, "--out", &run, "--log-every", "1"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let log = PathBuf::from(folder.path("run/log.csv"));
    let lines = || fs::read_to_string(&log).map_or(0, |text| text.lines().count());
    while lines() < 3 {
        std::thread::sleep(Duration::from_millis(5));
    }
    let interrupted = Command::new("kill").args(["-INT", &program.id().to_string()]).status().unwrap();
    assert!(interrupted.success());
    let output = program.wait_with_output().unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.starts_with("stopped: ") && text.contains("--resume"), "{text}");
    let done: usize = text.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert_eq!(lines(), done + 1);
    assert!(Path::new(&folder.path("run/checkpoint.safetensors")).exists());
}

#[test]
fn evaluate_prints_what_it_promises() {
    let folder = Folder::new();
    let model = folder.trained();
    let arguments = ["forecast", "evaluate", "--model", &model, "--segments", "20"];
    let json = succeed(&[&arguments[..], &["--json"]].concat());
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&report["model"], &report["segments"]), (&"tiny".into(), &20.into()));
    assert_eq!(report["horizon_steps"], 100);
    for quantiles in ["rmse_m", "linear_rmse_m", "best_linear_rmse_m"] {
        for name in ["q25", "q50", "q75", "q90"] {
            assert!(report[quantiles][name].as_f64().unwrap() > 0.0, "{quantiles} {name}");
        }
    }
    let figure = folder.path("errors.svg");
    let table = succeed(&[&arguments[..], &["--plot", &figure]].concat());
    assert!(table.contains("straight line") && table.contains("noise of 20 m"), "{table}");
    assert!(fs::read_to_string(figure).unwrap().contains("time ahead (min)"));
}

#[test]
fn figures_of_open_water_are_drawn() {
    let folder = Folder::new();
    let model = folder.trained();
    let log = folder.path("run/log.csv");
    let inputs: [(&str, &[&str], &str); 3] = [
        ("AR1_prediction", &["--model", &model], "backcast"),
        ("prediction_rmse", &["--model", &model, "--model", &model, "--segments", "10"], "error (m)"),
        ("estimator_training", &["--log", &log], "updates"),
    ];
    for (name, arguments, text) in inputs {
        let out = folder.path("figure.svg");
        succeed(&[&["forecast", "plot", name, "--out", &out], arguments].concat());
        assert!(fs::read_to_string(&out).unwrap().contains(text), "{name}");
    }
    let out = folder.path("none.svg");
    let text = refused(&["forecast", "plot", "sinus_prediction", "--out", &out]);
    assert!(text.contains("--model"), "{text}");
    let config = folder.path("tiny.toml");
    let text = refused(&["forecast", "plot", "estimator_training", "--log", &config, "--out", &out]);
    assert!(text.contains("tiny.toml"), "{text}");
}

#[test]
fn bad_input_is_named() {
    let folder = Folder::new();
    let model = folder.trained();
    let bytes = fs::read(&model).unwrap();
    let truncated = folder.path("truncated.safetensors");
    fs::write(&truncated, &bytes[..bytes.len() - 10]).unwrap();
    let missing = folder.path("missing.safetensors");
    for path in [&truncated, &missing, &folder.path("tiny.toml")] {
        let text = refused(&["forecast", "evaluate", "--model", path]);
        assert!(text.contains(path.as_str()), "{text}");
    }
    let config = folder.path("bad.toml");
    let run = folder.path("other");
    fs::write(&config, "name = \"x\"\nkind = \"coastal\"\nspeed = 3\n").unwrap();
    let text = refused(&["forecast", "train", "--config", &config, "--out", &run]);
    assert!(text.contains("bad.toml:3"), "{text}");
    let text = fs::read_to_string(folder.path("tiny.toml")).unwrap().replace("calls = 2", "calls = 0");
    fs::write(&config, text).unwrap();
    let text = refused(&["forecast", "train", "--config", &config, "--out", &run]);
    let expected = "key \"training.stages[2].calls\": 0 is not possible here: write a number from 1 to";
    assert!(text.contains("bad.toml:") && text.contains(expected), "{text}");
}
