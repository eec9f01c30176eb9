//! The 22 Imazu problems: the standard set of encounters that ship collision avoidance is tried on.
//!
//! Imazu's thesis (1987) is hard to come by; the geometry here is the table of Sawada, Sato and Majima,
//! Automatic ship collision avoidance using deep reinforcement learning with LSTM in continuous action
//! spaces, *Journal of Marine Science and Technology* 26 (2021) 509-524, as `scenarios/imazu/imazu.json`
//! holds it with what is ambiguous about it. All ships of a case would meet in one point at one time.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use serde::Deserialize;

use super::file::ScenarioFile;
use crate::angle::Nautical;
use crate::config::ConfigError;
use crate::encounter::{Encounter, EncounterConfig, Vantage, classify};
use crate::geo::{M_PER_NMI, MPS_PER_KNOT, Position, Velocity};

/// The reference that the shipped scenario files are made from.
const REFERENCE: &str = include_str!("../../scenarios/imazu/imazu.json");

/// Minutes that a case is simulated: as long as own ship takes to its goal.
const DURATION_MIN: u32 = 60;

/// How own ship is steered in every case, and how big it is: half a degree a second at most, and a knot of
/// speed in 20 s, for a coaster of 100 m.
const OWN_SHIP: &str = "\
length_m = 100
beam_m = 16

[own_ship.steering]
max_turn_deg = 5
decision_interval_s = 10
max_speed_change_kn = 0.5
";

/// All cases.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct ImazuProblems {
    notes: BTreeMap<u32, String>,
    own_ship: OwnShip,
    tcpa_s: f64,
    cases: BTreeMap<u32, Vec<TargetShip>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
struct OwnShip {
    north_nm: f64,
    east_nm: f64,
    heading_deg: f64,
    speed_kn: f64,
    goal_north_nm: f64,
    goal_east_nm: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
struct TargetShip {
    north_nm: f64,
    east_nm: f64,
    heading_deg: f64,
    speed_kn: f64,
}

fn state(place_nm: (f64, f64), heading_deg: f64, speed_kn: f64) -> (Position, Velocity) {
    let position = Position { north_m: place_nm.0 * M_PER_NMI, east_m: place_nm.1 * M_PER_NMI };
    (position, Velocity::from_course(Nautical::from_degrees(heading_deg), speed_kn * MPS_PER_KNOT))
}

impl ImazuProblems {
    /// The shipped reference.
    ///
    /// # Panics
    /// Never: a test reads it.
    #[must_use]
    pub fn shipped() -> Self {
        serde_json::from_str(REFERENCE).expect("the shipped reference is valid")
    }

    /// Numbers of the cases, 1 to 22.
    pub fn numbers(&self) -> impl Iterator<Item = u32> {
        self.cases.keys().copied()
    }

    /// Name of a case's scenario file, such as `05.toml`.
    #[must_use]
    pub fn file_name(number: u32) -> String {
        format!("{number:02}.toml")
    }

    /// What own ship meets in a case, target ship by target ship.
    #[must_use]
    pub fn encounters(&self, number: u32) -> Vec<Option<Encounter>> {
        let own = self.own_ship;
        let own = state((own.north_nm, own.east_nm), own.heading_deg, own.speed_kn);
        let target =
            |ship: &TargetShip| state((ship.north_nm, ship.east_nm), ship.heading_deg, ship.speed_kn);
        let kind = |ship| classify(&Vantage::of(own, target(ship)), &EncounterConfig::default());
        self.cases.get(&number).into_iter().flatten().map(kind).collect()
    }

    /// The text of a case's scenario file; empty where there is no such case.
    #[must_use]
    pub fn scenario_text(&self, number: u32) -> String {
        let Some(targets) = self.cases.get(&number) else { return String::new() };
        let words: Vec<_> = self
            .encounters(number)
            .into_iter()
            .map(|kind| kind.map_or("no encounter", Encounter::words))
            .collect();
        let own = self.own_ship;
        let mut text = format!(
            "# Imazu problem {number}: {}.\n#\n\
             # Made from imazu.json by `searoom benchmark imazu --write-scenarios scenarios/imazu`; change it there.\n",
            words.join(", "),
        );
        if let Some(note) = self.notes.get(&number) {
            let _ = writeln!(text, "# Ambiguous: {note}.");
        }
        let metres = |nm: f64| nm * M_PER_NMI;
        let _ = write!(
            text,
            "\ntitle = \"Imazu problem {number}: {}\"\n\
             description = \"All ships would meet in one point after {} minutes.\"\n\
             duration_min = {DURATION_MIN}\n\n\
             [own_ship]\nnorth_m = {}\neast_m = {}\ncourse_deg = {}\nspeed_kn = {}\n\
             route = [{{ north_m = {}, east_m = {} }}]\n{OWN_SHIP}",
            words.join(", "),
            self.tcpa_s / 60.0,
            metres(own.north_nm),
            metres(own.east_nm),
            own.heading_deg,
            own.speed_kn,
            metres(own.goal_north_nm),
            metres(own.goal_east_nm),
        );
        for (index, target) in targets.iter().enumerate() {
            let _ = write!(
                text,
                "\n[[target]]\nname = \"ship {}\"\nmotion = \"linear\"\ncourse_deg = {}\nspeed_kn = {}\n\
                 dcpa_m = 0\ntcpa_min = {}\n",
                index + 1,
                target.heading_deg,
                target.speed_kn,
                self.tcpa_s / 60.0,
            );
        }
        text
    }

    /// A case, ready to be set up.
    ///
    /// # Errors
    /// Where there is no such case.
    pub fn scenario(&self, number: u32) -> Result<ScenarioFile, ConfigError> {
        let file = PathBuf::from("scenarios/imazu").join(Self::file_name(number));
        ScenarioFile::parse(&self.scenario_text(number), &file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::HoldCourse;

    #[test]
    fn every_ship_starts_where_the_reference_has_it_and_all_meet() {
        let problems = ImazuProblems::shipped();
        assert_eq!(problems.numbers().collect::<Vec<_>>(), (1..=22).collect::<Vec<_>>());
        for number in problems.numbers() {
            let staged = problems.scenario(number).unwrap().set_up().unwrap();
            for (target, expected) in staged.targets.iter().zip(&problems.cases[&number]) {
                let (place, velocity) =
                    state((expected.north_nm, expected.east_nm), expected.heading_deg, expected.speed_kn);
                let placed = target.motion.state(0);
                // The reference is rounded to a thousandth of a nautical mile.
                assert!(placed.position.distance_m(place) < 2.0, "case {number}: {target:?}");
                assert!((placed.velocity - velocity).speed_mps() < 1e-9);
            }
            let held = staged.run_under(&mut HoldCourse);
            for summary in held.summaries() {
                assert!(summary.closest_centre_m < 1e-6, "case {number}: {summary:?}");
                assert!((summary.closest_centre_time_s - 1800.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_shipped_files_are_those_made_from_the_reference() {
        let problems = ImazuProblems::shipped();
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/imazu");
        for number in problems.numbers() {
            let file = folder.join(ImazuProblems::file_name(number));
            assert_eq!(std::fs::read_to_string(&file).unwrap(), problems.scenario_text(number), "{number}");
        }
    }

    #[test]
    fn the_single_ship_cases_are_the_four_kinds_of_encounter() {
        let problems = ImazuProblems::shipped();
        let kinds: Vec<_> = (1..=4).flat_map(|number| problems.encounters(number)).flatten().collect();
        let expected = [
            Encounter::HeadOn,
            Encounter::CrossingFromStarboard,
            Encounter::Overtaking,
            Encounter::CrossingFromPort,
        ];
        assert_eq!(kinds, expected);
        assert!(problems.scenario(23).is_err());
    }
}
