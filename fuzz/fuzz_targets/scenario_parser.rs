//! Any text is a scenario or an error, and a scenario without recorded tracks is placed or refused.

#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use searoom::scenario::{ForecasterChoice, ScenarioFile, TargetMotion};

fuzz_target!(|text: &str| {
    let Ok(file) = ScenarioFile::parse(text, Path::new("fuzz.toml")) else { return };
    // Recorded tracks and weights are read from wherever the text says: not from here.
    let recorded = file.scenario.targets.iter().any(|target| matches!(target.motion, TargetMotion::Recorded(_)));
    let learned = matches!(file.scenario.forecaster, Some(ForecasterChoice::Model(_)));
    if !recorded && !learned {
        let _ = file.set_up();
    }
});
