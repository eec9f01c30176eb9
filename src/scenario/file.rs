//! Scenario files: reading, and telling where in the file something is wrong.

use std::path::{Path, PathBuf};

use super::model::Scenario;
use super::parse;
use super::section::Section;
use crate::config::{ConfigError, Fault, KeyLines, Source};

/// A scenario and the file it came from.
#[derive(Debug, Clone)]
pub struct ScenarioFile {
    /// The scenario.
    pub scenario: Scenario,
    file: PathBuf,
    lines: KeyLines,
}

impl ScenarioFile {
    /// Reads and checks a scenario file. Relative paths in it start from its directory.
    ///
    /// # Errors
    /// A file that cannot be read, is not TOML, or has a key that is missing, unknown or of a value
    /// that cannot be. Tracks are not looked up and ships not placed yet.
    pub fn load(file: &Path) -> Result<Self, ConfigError> {
        Self::of(&Source::read(file)?)
    }

    /// Checks the text of a scenario file; `file` names it and tells where relative paths start.
    ///
    /// # Errors
    /// As [`Self::load`], reading apart.
    pub fn parse(text: &str, file: &Path) -> Result<Self, ConfigError> {
        Self::of(&Source::new(file, text))
    }

    fn of(source: &Source) -> Result<Self, ConfigError> {
        let file = source.file.as_path();
        let (table, lines) = source.document()?;
        let name = file.file_stem().map_or_else(|| "scenario".into(), |stem| stem.to_string_lossy());
        let directory = file.parent().unwrap_or(Path::new(""));
        match parse::scenario(Section::root(&table), &name, directory) {
            Ok(scenario) => Ok(Self { scenario, file: file.to_owned(), lines }),
            Err(fault) => Err(lines.located(file, fault)),
        }
    }

    /// Says where in this file a fault is.
    #[must_use]
    pub fn located(&self, fault: Fault) -> ConfigError {
        self.lines.located(&self.file, fault)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::scenario::{Placement, RecordedStart, RelativePlacement, TargetMotion, TrackSource};

    const VALID: &str = r#"title = "Test"
duration_s = 300
seed = 1

[own_ship]
north_m = 0
east_m = 0
course_deg = 0
speed_kn = 12
length_m = 100
beam_m = 16

[[target]]
name = "ferry"
motion = "linear"
bearing_deg = 40
range_nmi = 2
dcpa_m = 100
tcpa_min = 8
passes = "ahead"

[[target]]
name = "recorded"
motion = "recorded"
ais_file = "ais.csv"
area_file = "area.toml"
mmsi = 219000001
time = 2020-12-03T04:05:06Z
"#;

    fn parse(text: &str) -> Result<ScenarioFile, ConfigError> {
        ScenarioFile::parse(text, Path::new("dir/test.toml"))
    }

    /// The message after `replaced` becomes `with` in the valid scenario.
    fn message(replaced: &str, with: &str) -> String {
        assert!(VALID.contains(replaced), "{replaced}");
        match parse(&VALID.replacen(replaced, with, 1)) {
            Ok(_) => format!("{with:?} is accepted"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_valid_file_is_parsed_in_si_with_paths_from_its_directory() {
        let scenario = parse(VALID).unwrap().scenario;
        assert_eq!(scenario.name, "test");
        assert!((scenario.own_ship.speed_mps - 12.0 * 1852.0 / 3600.0).abs() < 1e-12);
        let TargetMotion::Linear(Placement::FromOwnShip(RelativePlacement::SeenWithCpa {
            range_m, cpa, ..
        })) = &scenario.targets[0].motion
        else {
            panic!("{:?}", scenario.targets[0]);
        };
        assert_eq!((*range_m, cpa.tcpa_s), (3704.0, 480.0));
        let TargetMotion::Recorded(recorded) = &scenario.targets[1].motion else {
            panic!("{:?}", scenario.targets[1]);
        };
        let source = TrackSource::Ais { files: vec!["dir/ais.csv".into()], area: "dir/area.toml".into() };
        assert_eq!(recorded.source, source);
        assert_eq!(recorded.start, RecordedStart::Time { mmsi: 219_000_001, unix_s: 1_606_968_306.0 });
    }

    #[test]
    fn thresholds_of_encounters_and_compliance_are_keys_of_the_file() {
        let tables =
            "seed = 1\n[encounters]\nhead_on_deg = 6\n[compliance]\nearly_s = 900\nsafe_contacts = 3\n";
        let file = parse(&VALID.replacen("seed = 1\n", tables, 1)).unwrap();
        let rules = file.scenario.rules;
        assert_eq!((rules.encounters.head_on_deg, rules.encounters.abaft_deg), (6.0, 112.5));
        assert_eq!((rules.compliance.early_s, rules.compliance.safe_contacts), (900.0, 3.0));
        let written = file.scenario.to_toml().unwrap();
        assert_eq!(parse(&written).unwrap().scenario.rules, rules, "{written}");
        let expected =
            "5: key \"encounters.abaft_deg\": 60 is not possible here: write a number from 90 to 180";
        let told = message("seed = 1\n", "\n[encounters]\nabaft_deg = 60\n");
        assert!(told.contains(expected), "{told}");
        let told = message("seed = 1\n", "\n[compliance]\nearly = 60\n");
        assert!(told.contains("5: key \"compliance.early\": is not a known key: write early_s"), "{told}");
    }

    #[test]
    fn every_mistake_is_named_with_its_line_and_remedy() {
        let mistakes = [
            (
                "speed_kn = 12",
                "speed = 12",
                "9: key \"own_ship.speed\": is not a known key: write speed_kn or speed_mps",
            ),
            (
                "speed_kn = 12",
                "speed_kmh = 22",
                "9: key \"own_ship.speed_kmh\": is not a known key: write speed_kn or speed_mps",
            ),
            (
                "speed_kn = 12",
                "speed_kn = 12\nspeed_mps = 6",
                "10: key \"own_ship.speed_mps\": says the same as speed_kn: write speed_kn or speed_mps, not both",
            ),
            (
                "speed_kn = 12",
                "speed_kn = \"12\"",
                "9: key \"own_ship.speed_kn\": is a text, not a number: write speed_kn = 12, without quotes",
            ),
            (
                "speed_kn = 12",
                "speed_kn = -1",
                "9: key \"own_ship.speed_kn\": -1 is not possible here: write 0 or a number above it",
            ),
            (
                "speed_kn = 12",
                "speed_kn = nan",
                "9: key \"own_ship.speed_kn\": NaN is not possible here: write 0 or a number above it",
            ),
            (
                "speed_kn = 12",
                "speed_kn = 90",
                "9: key \"own_ship.speed_kn\": 46.3 m/s is more than the 35 m/s allowed: write 35 m/s (68 kn) at most",
            ),
            (
                "speed_kn = 12\n",
                "",
                "5: key \"own_ship.speed_kn\": is missing in own_ship: write speed_kn or speed_mps",
            ),
            (
                "course_deg = 0\n",
                "",
                "5: key \"own_ship.course_deg\": is missing in own_ship: write course_deg",
            ),
            (
                "course_deg = 0",
                "corse_deg = 0",
                "8: key \"own_ship.corse_deg\": is not a known key: write course_deg",
            ),
            (
                "course_deg = 0",
                "course_deg = 400",
                "8: key \"own_ship.course_deg\": 400 is not possible here: write a number from -360 to 360",
            ),
            (
                "north_m = 0\neast_m = 0\n",
                "",
                "5: key \"own_ship.north_m\": is missing in own_ship: write north_m and east_m, or latitude_deg and longitude_deg",
            ),
            (
                "east_m = 0",
                "longitude_deg = 0",
                "5: key \"own_ship.latitude_deg\": stands beside a local position: write latitude_deg and longitude_deg, or north_m and east_m",
            ),
            (
                "beam_m = 16",
                "beam_m = 116",
                "11: key \"own_ship.beam_m\": a beam of 116 m is more than the length of 100 m: exchange the two, or correct one",
            ),
            (
                "duration_s = 300\n",
                "",
                "1: key \"duration_s\": is missing in the scenario: write duration_s or duration_min",
            ),
            (
                "duration_s = 300",
                "duration_s = 0",
                "2: key \"duration_s\": 0 is not possible here: write a number above 0",
            ),
            (
                "seed = 1",
                "seed = -1",
                "3: key \"seed\": is not a whole number: write 0, 1, 2 and so on, without quotes",
            ),
            (
                "seed = 1",
                "policy = \"hope\"",
                "3: key \"policy\": \"hope\" is not known here: write \"hold-course\", \"full-starboard\", \"full-port\", \"rule-based\", \"velocity-obstacle\", \"potential-field\" or \"mpc\"",
            ),
            (
                "seed = 1",
                "sensor_noise = 10",
                "3: key \"sensor_noise\": is a number, not a table: write a table [sensor_noise]",
            ),
            ("[own_ship]", "[ownship]", "5: key \"ownship\": is not a known key: write own_ship"),
            (
                "motion = \"linear\"",
                "motion = \"liner\"",
                "15: key \"target[1].motion\": \"liner\" is not known here: write \"recorded\", \"linear\", \"waypoints\", \"stochastic\" or \"periodic\"",
            ),
            (
                "motion = \"linear\"\n",
                "",
                "13: key \"target[1].motion\": is missing in target[1]: write motion = \"recorded\", motion = \"linear\", motion = \"waypoints\", motion = \"stochastic\" or motion = \"periodic\"",
            ),
            (
                "range_nmi = 2\n",
                "",
                "13: key \"target[1].range_m\": is missing in target[1]: write range_m or range_nmi",
            ),
            (
                "range_nmi = 2",
                "range_nm = 2",
                "17: key \"target[1].range_nm\": is not a known key: write range_m or range_nmi",
            ),
            (
                "tcpa_min = 8\n",
                "",
                "13: key \"target[1].tcpa_s\": is missing in target[1]: write tcpa_s or tcpa_min",
            ),
            (
                "passes = \"ahead\"",
                "passes = \"left\"",
                "20: key \"target[1].passes\": \"left\" is not known here: write \"ahead\", \"astern\", \"port\" or \"starboard\"",
            ),
            (
                "passes = \"ahead\"",
                "north_m = 5",
                "20: key \"target[1].north_m\": stands beside another placement: place the target by its position, or by bearing, DCPA and TCPA, not both",
            ),
            (
                "passes = \"ahead\"",
                "course_deg = 5",
                "18: key \"target[1].dcpa_m\": bearing, range, course and speed already say how close the target comes: remove DCPA and TCPA, or course and speed",
            ),
            (
                "dcpa_m = 100\ntcpa_min = 8\npasses = \"ahead\"\n",
                "",
                "13: key \"target[1].course_deg\": nothing says how the target moves: write course_deg and speed_kn, or dcpa_m and tcpa_s",
            ),
            (
                "name = \"recorded\"",
                "name = \"ferry\"",
                "23: key \"target[2].name\": \"ferry\" names two targets: give each its own name",
            ),
            (
                "area_file = \"area.toml\"\n",
                "",
                "22: key \"target[2].area_file\": is missing in target[2]: write area_file",
            ),
            (
                "area_file = \"area.toml\"",
                "track_dir = \"out\"",
                "26: key \"target[2].track_dir\": stands beside an AIS file or an area file: write ais_file and area_file, or track_dir alone",
            ),
            ("mmsi = 219000001\n", "", "22: key \"target[2].mmsi\": is missing in target[2]: write mmsi"),
            (
                "time = 2020-12-03T04:05:06Z\n",
                "",
                "22: key \"target[2].time\": is missing in target[2]: write time and mmsi, or start = \"before its curve\" or \"after its curve\"",
            ),
            (
                "time = 2020-12-03T04:05:06Z",
                "time = \"noon\"",
                "28: key \"target[2].time\": \"noon\" is not a date and time: write it like 2020-12-03T04:05:06Z",
            ),
            (
                "time = 2020-12-03T04:05:06Z",
                "start = \"after its curve\"\npick = 0",
                "29: key \"target[2].pick\": starts are counted from 1: write 1 or more, or leave it out",
            ),
            (
                "time = 2020-12-03T04:05:06Z",
                "time = 2020-12-03T04:05:06Z\nspeed_kn = 5",
                "29: key \"target[2].speed_kn\": is not a known key: the keys known here are name, dynamics, kvlcc2, pilot, length_m, beam_m, bow, collision_radius_m, motion, ais_file, area_file, track_dir, mmsi, start, time",
            ),
        ];
        for (replaced, with, expected) in mistakes {
            assert_eq!(message(replaced, with), format!("dir/test.toml:{expected}"));
        }
    }

    #[test]
    fn what_is_not_toml_is_named_with_its_line() {
        assert_eq!(
            message("seed = 1", "seed = "),
            "dir/test.toml:3: string values must be quoted, expected literal string: correct the TOML here"
        );
    }

    #[test]
    fn missing_and_binary_files_are_named() {
        let missing = ScenarioFile::load(Path::new("no/such.toml")).unwrap_err().to_string();
        assert!(missing.starts_with("no/such.toml: cannot be read"), "{missing}");
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("binary.toml");
        std::fs::write(&file, b"title = \"x\"\n\xff\xfe\x00").unwrap();
        let binary = ScenarioFile::load(&file).unwrap_err().to_string();
        assert!(binary.contains("binary.toml: is not text"), "{binary}");
    }

    proptest! {
        #[test]
        fn any_text_is_parsed_or_refused(text in "\\PC{0,200}") {
            let _ = parse(&text);
        }

        /// Numbers from the edge of what a float holds, in place of any of the valid file.
        #[test]
        fn extreme_numbers_are_placed_or_refused(
            values in proptest::collection::vec(
                prop_oneof![
                    Just(0.0), Just(-0.0), Just(1e308), Just(-1e308), Just(5e-324), Just(1e-9), Just(3600.0),
                    -1e4..1e4_f64,
                ],
                10,
            ),
            passes in prop_oneof![Just("ahead"), Just("port")],
        ) {
            let keys = ["dt_s", "duration_s"].into_iter();
            let own = ["[own_ship]\nnorth_m", "east_m", "course_deg", "speed_kn"];
            let target = ["[[target]]\nmotion = \"periodic\"\nrange_m", "bearing_deg", "tcpa_s", "dcpa_m"];
            let mut text = String::new();
            for (key, value) in keys.chain(own).chain(target).zip(values) {
                text.push_str(&format!("{key} = {value:?}\n"));
            }
            text.push_str(&format!("passes = \"{passes}\"\n"));
            if let Ok(staged) = parse(&text).and_then(|file| file.set_up()) {
                prop_assert!(staged.own_start.position.is_finite());
                prop_assert!(staged.targets[0].motion.position(1).is_finite());
            }
        }

        /// One line of a valid file is dropped, doubled, or gets another value.
        #[test]
        fn a_mutated_file_is_parsed_or_refused_with_a_line(
            line in 0..VALID.lines().count(),
            value in prop_oneof![
                Just("1e308".to_owned()), Just("-0".to_owned()), Just("inf".to_owned()), Just("[]".to_owned()),
                Just("[1, {}]".to_owned()), Just("9223372036854775807".to_owned()), Just("true".to_owned()),
                Just("\"\"".to_owned()), Just("1979-05-27".to_owned()), "\\PC{0,20}",
            ],
            drop in any::<bool>(),
        ) {
            let mut lines: Vec<String> = VALID.lines().map(str::to_owned).collect();
            if drop {
                lines.remove(line);
            } else {
                let key = lines[line].split('=').next().unwrap_or_default().to_owned();
                lines[line] = format!("{key} = {value}");
            }
            match parse(&lines.join("\n")) {
                Ok(file) => prop_assert!(file.scenario.duration_s > 0.0),
                Err(error) => prop_assert!((1..=lines.len() + 1).contains(&error.line.unwrap()), "{error}"),
            }
        }
    }
}
