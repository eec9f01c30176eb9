//! Any text is a traffic situation or an error; what is read makes a scenario file that is read again, and
//! what can be set up is exported and imported once more.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use searoom::scenario::ScenarioFile;
use searoom::scenario::maritime_schema::{ImportOptions, export, import};

fuzz_target!(|text: &str| {
    let (json, toml) = (Path::new("fuzz.json"), Path::new("fuzz.toml"));
    let options = ImportOptions::default();
    let Ok(read) = import(text, json, &options) else { return };
    let written = read.scenario.to_toml().expect("nothing recorded is imported");
    let file = ScenarioFile::parse(&written, toml).expect("a scenario that was written is read");
    if let Ok(staged) = file.set_up() {
        let situation = export(&staged).expect("it has a place on the earth");
        import(&situation, json, &options).expect("a situation that was written is read");
    }
});
