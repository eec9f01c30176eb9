//! `searoom experiment`: every figure in a small version, and what is said where something is missing.

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::cli::searoom;

fn stdout(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

fn refused(arguments: &[&str]) -> String {
    let output = searoom(arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Makes a figure and checks that drawing and data hold something; gives the data and the caption.
#[track_caller]
fn made(name: &str, folder: &Path, more: &[&str]) -> (Vec<csv::StringRecord>, String) {
    let out = folder.display().to_string();
    let arguments = [&["experiment", "run", name, "--out", &out, "--json"], more].concat();
    let figures: serde_json::Value = serde_json::from_str(&stdout(&searoom(&arguments))).unwrap();
    let svg = fs::read_to_string(folder.join(format!("{name}.svg"))).unwrap();
    let shapes = ["<polyline", "<circle", "<path", "<rect"].map(|shape| svg.matches(shape).count());
    assert!(shapes.iter().sum::<usize>() > 10, "{name}: {shapes:?}");
    let mut data = csv::Reader::from_path(folder.join(format!("{name}.csv"))).unwrap();
    let rows: Vec<_> = data.records().map(Result::unwrap).collect();
    assert!(!rows.is_empty(), "{name}");
    (rows, figures[0]["caption"].as_str().unwrap().to_owned())
}

/// A run as `searoom train` leaves it, with evaluations made up here.
fn run_folder(folder: &Path, name: &str, config: &str, evaluations: &[(u64, f64)]) -> String {
    let run = folder.join(name);
    fs::create_dir_all(&run).unwrap();
    fs::write(run.join("config.toml"), config).unwrap();
    let mut text = "step,mean_return,sd_return,mean_decisions,episodes\n".to_owned();
    for (step, mean_return) in evaluations {
        text += &format!("{step},{mean_return},1.5,15,10\n");
    }
    fs::write(run.join("evaluations.csv"), text).unwrap();
    run.display().to_string()
}

fn settings(
    env: &str,
    motion: &str,
    algorithm: &str,
    estimates: bool,
    history_len: usize,
    seed: u64,
) -> String {
    format!(
        "env = \"{env}\"\nsteps = 300\nestimates = {estimates}\n[open_water]\nmotion = \"{motion}\"\n[trainer]\n\
         seed = {seed}\nevaluate_every = 100\n[trainer.agent]\nalgorithm = \"{algorithm}\"\nhistory_len = {history_len}\n"
    )
}

#[test]
fn all_figures_are_listed() {
    let text = stdout(&searoom(&["experiment", "list"]));
    let list = stdout(&searoom(&["experiment", "list", "--json"]));
    let list: Vec<serde_json::Value> = serde_json::from_str(&list).unwrap();
    assert_eq!(list.len(), 18);
    for entry in list {
        assert!(text.contains(entry["name"].as_str().unwrap()), "{entry}");
    }
}

#[test]
fn figures_that_need_nothing_are_made() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, caption) = made("architecture", folder.path(), &[]);
    assert!(rows.iter().any(|row| &row[2] == "LSTM" && &row[4] == "256"), "{rows:?}");
    assert!(caption.contains("step 2 is the agent"), "{caption}");
    let (rows, _) = made("env_example", folder.path(), &[]);
    assert_eq!(rows.iter().filter(|row| &row[0] == "agent").count(), 200);
    let (rows, caption) = made("replacement", folder.path(), &["--episode", "3"]);
    assert_eq!(rows.len(), 20);
    assert!(caption.contains("benchmark episode 3"), "{caption}");
}

#[test]
fn figures_of_open_water_forecasts_are_made_of_the_shipped_models() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["AR1_prediction", "sinus_prediction"] {
        let (rows, caption) = made(name, folder.path(), &[]);
        assert_eq!(rows.iter().filter(|row| &row[1] == "forecast").count(), 100);
        assert!(caption.contains("updates") && caption.contains("seed"), "{caption}");
    }
    let (rows, caption) = made("prediction_rmse", folder.path(), &["--segments", "20"]);
    assert_eq!(rows.len(), 2 * 2 * 100);
    assert!(caption.contains("20 segments"), "{caption}");
    let (rows, _) = made("smoothing_distance", folder.path(), &[]);
    assert!(rows.iter().any(|row| &row[0] == "refined CPA"));
}

#[test]
fn figures_of_coastal_waters_are_made_of_the_shipped_tracks() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, caption) = made("Ebeltoft_trajs", folder.path(), &[]);
    assert!(rows.len() > 10_000 && caption.contains("tracks"), "{caption}");
    let (rows, caption) = made("quantile_forecast_vessel", folder.path(), &["--segments", "12"]);
    assert_eq!(rows.len(), 2 * 200);
    assert!(caption.contains("12 segments"), "{caption}");
    let (rows, _) = made("traj_AIS_single_estimates", folder.path(), &["--segments", "40"]);
    assert_eq!(rows.iter().filter(|row| &row[1] == "forecast").count(), 4 * 200);
    let (rows, caption) = made("AIS_env_situations", folder.path(), &[]);
    for scenario in ["Scenario 1: before a curve to port", "Scenario 2: straight on"] {
        assert!(
            rows.iter().any(|row| &row[0] == scenario && &row[1] == "obstacle 1, forecast"),
            "{scenario}"
        );
    }
    assert!(caption.contains("if course is held"), "{caption}");
}

#[test]
fn learning_curves_are_collected_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let (runs, results) = (folder.path().join("runs"), folder.path().join("results"));
    let results_text = results.display().to_string();
    let mut folders = Vec::new();
    for (env, motion) in [("open-water", "stochastic"), ("open-water", "periodic"), ("coastal", "stochastic")]
    {
        for algorithm in ["lstm-td3", "lstm-sac"] {
            for estimates in [true, false] {
                for (history_len, seed) in [(4, 1), (4, 2), (7, 1)] {
                    let name = format!("{}", folders.len());
                    let config = settings(env, motion, algorithm, estimates, history_len, seed);
                    let level = if estimates { -5.0 } else { -10.0 } - seed as f64;
                    let points = [(100, level), (200, level + 1.0), (300, level + 2.0)];
                    folders.push(run_folder(&runs, &name, &config, &points));
                }
            }
        }
    }
    let folders: Vec<&str> = folders.iter().map(String::as_str).collect();
    let collect = [&["experiment", "collect", "--out", &results_text], &folders[..]].concat();
    let text = refused(&collect);
    assert!(text.contains("--commit"), "{text}");
    assert!(!results.exists(), "nothing is written before all is right");
    let kept = stdout(&searoom(&[&collect[..], &["--commit", "0123456789abcdef"]].concat()));
    assert!(kept.contains("open-water-stochastic-lstm-td3-h7-baseline-seed-1"), "{kept}");
    let origin = fs::read_to_string(results.join("coastal-lstm-sac-seed-2/origin.toml")).unwrap();
    assert!(origin.contains("0123456789abcdef"), "{origin}");

    let from = ["--results", results_text.as_str()];
    let (rows, caption) = made("trainResults", folder.path(), &from);
    assert_eq!(rows.len(), 2 * 4 * 3);
    assert!(caption.contains("2 seeds, 300 steps") && caption.contains("commit 0123456789"), "{caption}");
    let (rows, caption) = made("AIS_results", folder.path(), &from);
    assert_eq!(rows.len(), 4 * 3);
    assert!(caption.contains("The paper: 15 seeds, 1,000,000 steps."), "{caption}");
    let (rows, caption) = made("h_ablate", folder.path(), &from);
    assert_eq!(rows.len(), 2 * 2 * 4);
    assert!(caption.contains("after 300 training steps"), "{caption}");

    // The user's own runs serve without being collected.
    let (rows, caption) = made("AIS_results", folder.path(), &["--runs", &runs.display().to_string()]);
    assert_eq!(rows.len(), 4 * 3);
    assert!(caption.contains("commit not recorded"), "{caption}");
}

#[test]
fn unfinished_runs_are_not_kept() {
    let folder = tempfile::tempdir().unwrap();
    let config = settings("coastal", "stochastic", "lstm-sac", true, 4, 1);
    let unfinished = run_folder(folder.path(), "unfinished", &config, &[(100, -3.0), (200, -2.0)]);
    let results = folder.path().join("results").display().to_string();
    let commit = ["--commit", "0123456789"];
    let collect =
        |run: &str| refused(&[&["experiment", "collect", run, "--out", &results], &commit[..]].concat());
    let text = collect(&unfinished);
    assert!(text.contains("200 of 300 steps") && text.contains("train --resume"), "{text}");
    let text = collect(&folder.path().display().to_string());
    assert!(text.contains("is no run"), "{text}");
    let finished = run_folder(folder.path(), "finished", &config, &[(100, -3.0), (300, -2.0)]);
    let text = refused(&[
        "experiment",
        "collect",
        &finished,
        &finished,
        "--out",
        &results,
        "--commit",
        "0123456789",
    ]);
    assert!(text.contains("keep one of them"), "{text}");
    let text = refused(&["experiment", "collect", &finished, "--out", &results, "--commit", "main"]);
    assert!(text.contains("hexadecimal"), "{text}");
}

#[test]
fn logs_of_forecasters_are_collected_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let results = folder.path().join("results").display().to_string();
    let mut runs = Vec::new();
    for motion in ["stochastic", "periodic"] {
        let config = folder.path().join(format!("{motion}.toml"));
        let text = format!(
            "name = \"open-water-{motion}\"\nkind = \"open-water\"\n[data.synthetic.process.{motion}]\n[training]\nseed = 3\n\
             [[training.stages]]\nsteps = 6\nbatch = 4\n"
        );
        fs::write(&config, text).unwrap();
        let run = folder.path().join(format!("open-water-{motion}")).display().to_string();
        let config = config.display().to_string();
        stdout(&searoom(&["forecast", "train", "--config", &config, "--out", &run, "--log-every", "2"]));
        runs.push(run);
    }
    let collect = ["experiment", "collect", &runs[0], &runs[1], "--out", &results, "--commit", "0123456789"];
    stdout(&searoom(&collect));
    let (rows, caption) = made("estimator_training", folder.path(), &["--results", &results]);
    assert_eq!(rows.len(), 2 * 3);
    assert!(caption.contains("open-water-periodic: 6 updates, seed 3, commit 0123456789"), "{caption}");

    // A figure of forecasts takes the user's own model where there is one.
    let own = folder.path().display().to_string();
    let (_, caption) = made("AR1_prediction", folder.path(), &["--runs", &own]);
    assert!(caption.contains("open-water-stochastic: 6 updates, seed 3"), "{caption}");
}

#[test]
fn the_noise_benchmark_is_drawn_from_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("noise.json");
    let row = |policy: &str, scenario: &str, sigma_m: f64| {
        serde_json::json!({
            "policy": policy, "scenario": scenario, "sigma_m": sigma_m, "episodes": 100, "collisions": 4,
            "rate": 0.04, "ci95": [0.016, 0.098], "mean_return": -1.25,
        })
    };
    let rows: Vec<_> = ["coastal-lstm-sac", "hold-course"]
        .into_iter()
        .flat_map(|policy| [0.0, 20.0].map(|sigma_m| row(policy, "before-curve", sigma_m)))
        .collect();
    fs::write(&table, serde_json::to_string(&rows).unwrap()).unwrap();
    let table = table.display().to_string();
    let (rows, caption) = made("noise_analysis", folder.path(), &["--noise", &table]);
    assert_eq!(rows.len(), 4);
    assert!(caption.contains("Wilson 95 %"), "{caption}");
    fs::write(&table, "{}").unwrap();
    let text = refused(&["experiment", "run", "noise_analysis", "--noise", &table]);
    assert!(text.contains("noise.json") && text.contains("benchmark noise --json"), "{text}");
}

#[test]
fn what_is_missing_is_named_with_the_command_that_makes_it() {
    let folder = tempfile::tempdir().unwrap();
    let none = folder.path().display().to_string();
    for (name, command) in [
        ("trainResults", "searoom experiment run trainResults --from-scratch"),
        ("h_ablate", "--from-scratch"),
        ("AIS_results", "--from-scratch"),
        ("estimator_training", "searoom forecast train"),
        ("noise_analysis", "searoom benchmark noise --json"),
        ("env_example_AR1", "--from-scratch"),
    ] {
        let text =
            refused(&["experiment", "run", name, "--results", &none, "--models", &none, "--out", &none]);
        assert!(text.contains(command) && text.contains(&none), "{name}: {text}");
    }
    let text = refused(&["experiment", "run", "AR1_prediction", "--models", &none, "--out", &none]);
    assert!(text.contains("searoom forecast train"), "{text}");
    let text = refused(&["experiment", "run", "train_result"]);
    assert!(text.contains("did you mean trainResults?"), "{text}");
    assert!(fs::read_dir(folder.path()).unwrap().next().is_none(), "nothing was drawn");
}

/// Small networks, short episodes, an update from step 50 on.
const TINY: &str = "\
[open_water]
decisions = 40
[trainer]
random_steps = 50
evaluate_every = 50
evaluation_episodes = 2
[trainer.agent]
hidden = 8
";

/// Trained in one go or gone on with: the same figures.
#[test]
fn agents_are_trained_from_scratch_and_gone_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let settings = folder.path().join("tiny.toml");
    fs::write(&settings, TINY).unwrap();
    let settings = settings.display().to_string();
    let train = |name: &str, runs: &str, steps: &str| {
        let out = folder.path().join(runs);
        let runs = out.join("runs").display().to_string();
        let scratch =
            ["--from-scratch", "--steps", steps, "--seeds", "1", "--settings", &settings, "--runs", &runs];
        (made(name, &out, &scratch), runs)
    };
    let ((straight, caption), runs) = train("env_example_AR1", "straight", "150");
    assert!(caption.contains("open-water-stochastic-lstm-sac-baseline-seed-1, seed 1"), "{caption}");
    for agent in ["SL-LSTM-SAC", "LSTM-SAC"] {
        assert_eq!(straight.iter().filter(|row| &row[0] == agent).count(), 41);
    }
    train("env_example_AR1", "resumed", "100");
    let ((resumed, _), _) = train("env_example_AR1", "resumed", "150");
    assert_eq!(straight, resumed);

    let (rows, caption) = made("trainResults", folder.path(), &["--runs", &runs]);
    assert_eq!(rows.len(), 2 * 3);
    assert!(caption.contains("SL-LSTM-SAC: 1 seed, 150 steps; LSTM-SAC: 1 seed, 150 steps"), "{caption}");
    assert!(caption.contains("not run: SL-LSTM-TD3, LSTM-TD3"), "{caption}");
}

#[test]
fn forecasters_are_trained_from_scratch() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs").display().to_string();
    let scratch = ["--from-scratch", "--steps", "4", "--runs", &runs];
    let (_, caption) = made("sinus_prediction", folder.path(), &scratch);
    assert!(caption.contains("open-water-periodic: 4 updates, seed 1"), "{caption}");
    // What is there is gone on with; another length is another training.
    made("sinus_prediction", folder.path(), &scratch);
    let text = refused(&[
        "experiment",
        "run",
        "sinus_prediction",
        "--from-scratch",
        "--steps",
        "5",
        "--runs",
        &runs,
    ]);
    assert!(text.contains("4 updates"), "{text}");
}
