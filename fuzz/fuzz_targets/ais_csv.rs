//! Any file: imported, or refused with an error, and every row accounted for.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use searoom::ais::{self, Area, GeoBox, ImportConfig};

static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().expect("a temporary folder"));

fuzz_target!(|bytes: &[u8]| {
    let file = FOLDER.path().join("input");
    std::fs::write(&file, bytes).expect("room for the input");
    let bounds = GeoBox { south_deg: 40.0, north_deg: 58.0, west_deg: -75.0, east_deg: 13.0 };
    let config = ImportConfig { max_line_bytes: 4096, min_fixes: 2, min_duration_s: 0.0, ..ImportConfig::default() };
    if let Ok(import) = ais::import(&[file], &Area::of_box("fuzz", bounds), &config, None, &|_| {}) {
        assert!(import.report.adds_up());
        assert!(import.tracks.iter().all(|track| track.positions.iter().all(|position| position.is_finite())));
    }
});
