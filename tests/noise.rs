//! `searoom benchmark noise`: any number of threads, an interruption and another area give what they should.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use searoom::agent::{RunConfig, TrainedAgent};
use searoom::env::EnvName;
use searoom::rl::agent::Agent;
use serde_json::Value;

const METRES_PER_DEGREE: f64 = 111_132.0;

/// Four vessels go north at 10 m/s for half an hour; the second of each pair turns to port after 10 minutes. Two sail
/// early, two late.
fn recording() -> String {
    let mut csv = "MMSI,BaseDateTime,LAT,LON,SOG,COG,Heading\n".to_owned();
    for (vessel, hour) in [(0, 0), (1, 0), (2, 6), (3, 6)] {
        let (mut north_m, mut east_m) = (0.0, 3000.0 * f64::from(vessel));
        for second in (0..1800).step_by(10) {
            let turning_s = (f64::from(second) - 600.0).clamp(0.0, 120.0);
            let course_deg = if vessel % 2 == 1 { -0.6 * turning_s } else { 0.0 };
            let (latitude_deg, longitude_deg) = (
                55.0 + north_m / METRES_PER_DEGREE,
                7.0 + east_m / METRES_PER_DEGREE / 55_f64.to_radians().cos(),
            );
            writeln!(
                csv,
                "{},2020-12-01T{:02}:{:02}:{:02},{latitude_deg:.7},{longitude_deg:.7},19.44,{:.1},{:.0}",
                219_000_001 + vessel,
                hour,
                second / 60,
                second % 60,
                (course_deg + 360.0) % 360.0,
                (course_deg + 360.0) % 360.0,
            )
            .unwrap();
            north_m += 100.0 * course_deg.to_radians().cos();
            east_m += 100.0 * course_deg.to_radians().sin();
        }
    }
    csv
}

const AREA: &str =
    "name = \"Off the coast\"\n[box]\nsouth_deg = 54.5\nnorth_deg = 55.9\nwest_deg = 6.0\neast_deg = 8.5\n";

/// An agent that knows nothing yet.
fn agent(folder: &Path, name: &str, estimates: bool) {
    let mut config = RunConfig::of(EnvName::Coastal);
    config.estimates = estimates;
    config.forecaster =
        Some(Path::new(env!("CARGO_MANIFEST_DIR")).join("models/coastal-ny-lower-bay.safetensors"));
    config.trainer.agent.hidden = 8;
    let rng = &mut ChaCha8Rng::seed_from_u64(4);
    let agent = Agent::new(config.trainer.agent.clone(), config.observation_len(), 1, rng);
    let mut trained = TrainedAgent { name: name.into(), config, step: 0, mean_return: 0.0, agent };
    trained.to_file().save(&folder.join(format!("{name}.safetensors"))).unwrap();
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("area.toml"), AREA).unwrap();
    fs::write(folder.path().join("traffic.csv"), recording()).unwrap();
    agent(folder.path(), "with", true);
    agent(folder.path(), "without", false);
    folder
}

const BENCHMARK: [&str; 12] = [
    "benchmark",
    "noise",
    "--area",
    "area.toml",
    "--ais",
    "traffic.csv",
    "--train-fraction",
    "0.5",
    "--out",
    "out",
    "--json",
    "--policies",
];

fn searoom(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_searoom"));
    command.current_dir(folder).args(arguments).env("SEAROOM_CACHE", "off");
    command
}

fn output(folder: &Path, arguments: &[&str]) -> Output {
    searoom(folder, arguments).output().unwrap()
}

#[track_caller]
fn rows(output: &Output) -> Vec<Value> {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn one_thread_and_two_print_the_same() {
    let folder = folder();
    let sail = |threads: &str| {
        let options = [
            "with.safetensors",
            "without.safetensors",
            "hold-course",
            "--sigma-m",
            "0,20",
            "--episodes",
            "2",
        ];
        output(folder.path(), &[&BENCHMARK[..], &options, &["--threads", threads]].concat())
    };
    let (one, two) = (sail("1"), sail("2"));
    assert_eq!(String::from_utf8_lossy(&one.stdout), String::from_utf8_lossy(&two.stdout));
    let rows = rows(&one);
    // Two agents, one of them with the true future beside, and a policy: two scenarios, two noises.
    assert_eq!(rows.len(), 4 * 2 * 2);
    let names: Vec<&str> = rows[..4].iter().map(|row| row["policy"].as_str().unwrap()).collect();
    assert_eq!(names, ["with", "with (true future)", "without", "hold-course"]);
    assert_eq!(rows[0]["estimates"], "forecast");
    for row in &rows {
        assert_eq!((&row["tracks"], &row["episodes"]), (&"held-out".into(), &2.into()));
        assert_eq!(row["training_tracks"]["episodes"], 2);
        assert_eq!(row["unseen_vessels"]["episodes"], 2, "the late vessels are others than the early ones");
        assert_eq!(row["fallbacks"], 0);
        let compliance = row["compliance"].as_f64().unwrap();
        assert!((0.0..=1.0).contains(&compliance), "{row}");
    }
    let straight_on =
        rows.iter().filter(|row| row["policy"] == "hold-course" && row["scenario"] == "straight-on");
    assert!(straight_on.map(|row| row["rate"].as_f64().unwrap()).all(|rate| rate == 1.0));

    let out = folder.path().join("out");
    let stored: Vec<Value> = serde_json::from_slice(&fs::read(out.join("results.json")).unwrap()).unwrap();
    assert_eq!(stored, rows);
    assert_eq!(fs::read_to_string(out.join("results.csv")).unwrap().lines().count(), 1 + rows.len());
    let episodes = fs::read_to_string(out.join("episodes.csv")).unwrap();
    assert_eq!(episodes.lines().count(), 1 + 2 * 2 * rows.len(), "training tracks too");
    assert!(fs::read_to_string(out.join("noise_analysis.svg")).unwrap().contains("without"));
    assert!(fs::read_to_string(out.join("index.html")).unwrap().contains("Noise benchmark"));
    assert!(!out.join("unfinished").exists());
    let told = String::from_utf8_lossy(&one.stderr);
    assert!(told.contains("was trained in another area"), "{told}");
}

/// Killed under way, the same command goes on with what is done and prints what it would have printed.
#[test]
fn an_interrupted_benchmark_goes_on_where_it_was() {
    let (straight, killed) = (folder(), folder());
    let arguments = [
        &BENCHMARK[..],
        &["without.safetensors", "hold-course", "full-starboard", "--episodes", "150", "--threads", "1"],
    ]
    .concat();
    let expected = output(straight.path(), &arguments);
    let unfinished = killed.path().join("out/unfinished");
    let done = || {
        fs::read_dir(&unfinished).map_or(0, |entries| {
            entries
                .flatten()
                .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "json"))
                .count()
        })
    };
    let mut child = searoom(killed.path(), &arguments).stdout(std::process::Stdio::null()).spawn().unwrap();
    while done() < 3 && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(done() >= 3, "killed too late to be worth anything");
    // What is done is not done again: a mark in it comes through.
    let marked = killed.path().join("marked");
    copy(killed.path(), &marked);
    assert_eq!(rows(&output(killed.path(), &arguments)), rows(&expected));
    assert!(!unfinished.exists());
    for file in ["results.csv", "episodes.csv", "index.html"] {
        let [ours, theirs] =
            [&straight, &killed].map(|folder| fs::read(folder.path().join("out").join(file)).unwrap());
        assert!(ours == theirs, "{file} differs");
    }
    let cell = fs::read_dir(marked.join("out/unfinished"))
        .unwrap()
        .flatten()
        .map(|entry| entry.path())
        .find(|path| fs::read_to_string(path).unwrap().contains("\"hold-course\""))
        .unwrap();
    let text = fs::read_to_string(&cell).unwrap().replace("\"closest_m\":", "\"closest_m\":1");
    fs::write(&cell, text).unwrap();
    assert_ne!(rows(&output(&marked, &arguments)), rows(&expected));
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            if entry.path() != to {
                copy(&entry.path(), &target);
            }
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

#[test]
fn bad_options_are_told_with_a_remedy() {
    let folder = folder();
    let told = |options: &[&str]| {
        let output = output(folder.path(), &[&BENCHMARK[..], options].concat());
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(told(&["hold-curse"]).contains("did you mean \"hold-course\"?"));
    assert!(told(&["hold-course", "--episodes", "0"]).contains("give 1 or more"));
    assert!(told(&["hold-course", "--sigma-m=-1"]).contains("0 or more"));
    assert!(told(&["hold-course", "hold-course"]).contains("two called \"hold-course\""));
    let mut config = RunConfig::of(EnvName::OpenWater);
    config.estimates = false;
    config.trainer.agent.hidden = 8;
    let agent = Agent::new(
        config.trainer.agent.clone(),
        config.observation_len(),
        1,
        &mut ChaCha8Rng::seed_from_u64(1),
    );
    let mut open = TrainedAgent { name: "open".into(), config, step: 0, mean_return: 0.0, agent };
    open.to_file().save(&folder.path().join("open.safetensors")).unwrap();
    assert!(told(&["open.safetensors"]).contains("trained in open water"));
}
