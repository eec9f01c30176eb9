//! The invariants of `ARCHITECTURE.md` that reading the sources can keep.

use std::fs;
use std::path::{Path, PathBuf};

/// A source file below `src/`, without its comments and without its test module.
struct Source {
    /// Path below `src/`, with forward slashes.
    path: String,
    code: String,
}

fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    collect(&root, &mut files);
    assert!(files.len() > 3, "no sources found below {}", root.display());
    files
        .iter()
        .map(|file| {
            let text = fs::read_to_string(file).expect("sources are readable");
            let path = file.strip_prefix(&root).expect("below the root");
            Source { path: path.to_string_lossy().replace('\\', "/"), code: code_of(&text) }
        })
        .collect()
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("folder is readable") {
        let path = entry.expect("entry is readable").path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}

/// What the compiler sees outside tests: comment lines go, and so does everything from the test
/// module on, which by convention ends a file.
fn code_of(text: &str) -> String {
    let before_tests = text.split("#[cfg(test)]\nmod ").next().unwrap_or(text);
    let lines = before_tests.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.collect::<Vec<_>>().join("\n")
}

/// Files outside `allowed` (path prefixes below `src/`) in which any of `words` stands.
fn offenders(words: &[&str], allowed: &[&str]) -> Vec<String> {
    sources()
        .into_iter()
        .filter(|source| !allowed.iter().any(|prefix| source.path.starts_with(prefix)))
        .filter_map(|source| {
            let word = words.iter().find(|word| source.code.contains(**word))?;
            Some(format!("src/{} says `{word}`", source.path))
        })
        .collect()
}

#[track_caller]
fn assert_none(offenders: &[String]) {
    assert!(offenders.is_empty(), "{}", offenders.join("\n"));
}

#[test]
fn only_world_names_the_physics_engine() {
    assert_none(&offenders(&["rapier2d", "parry2d"], &["world/"]));
}

#[test]
fn only_the_refined_cpa_names_the_cone_solver() {
    assert_none(&offenders(&["clarabel"], &["cpa/refined"]));
}

#[test]
fn networks_and_learning_know_no_ships() {
    let ships =
        ["track", "ais", "vessel", "world", "cpa", "forecast", "scenario", "policy", "episode", "geo"];
    for source in sources()
        .into_iter()
        .filter(|source| source.path.starts_with("nn/") || source.path.starts_with("rl/"))
    {
        for module in ships {
            let path = format!("crate::{module}");
            assert!(!source.code.contains(&path), "src/{} uses {path}", source.path);
        }
    }
}

#[test]
fn files_are_touched_only_where_the_outside_world_is() {
    let outside = [
        "agent/",
        "ais",
        "scenario",
        "forecast/",
        "nn/weights",
        "rl/checkpoint",
        "report",
        "atomic_file",
        "config",
        "cli",
        "main",
    ];
    assert_none(&offenders(&["std::fs", "File::open", "File::create"], &outside));
}

#[test]
fn only_the_program_uses_anyhow() {
    assert_none(&offenders(&["anyhow"], &["cli", "main"]));
}

#[test]
fn results_know_neither_clock_nor_global_randomness() {
    let clocks = ["SystemTime", "Instant::now", "rand::rng()", "thread_rng", "from_os_rng"];
    assert_none(&offenders(&clocks, &["cli", "main"]));
}
