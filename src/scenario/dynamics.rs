//! Ships with real dynamics in a scenario, and the water and air around them: what is written of them,
//! what cannot be, and how they get under way.

use super::model::{Limits, Scenario, ShipSize, Target, TargetMotion};
use super::parse::{FULL_TURN, SPEED, speed};
use super::placement::Kinematics;
use super::section::{Quantity, Section, Takes};
use crate::angle::Nautical;
use crate::config::Fault;
use crate::geo::{Position, Velocity};
use crate::vessel::mmg::{AutopilotConfig, ParameterSet, Surroundings, Wind};
use crate::vessel::{
    Dynamics, DynamicsConfig, KinematicConfig, Kvlcc2Config, Launch, Pilot, PilotConfig, Piloted, Steered,
    Waypoint,
};

const SERVICE_SPEED: Quantity = Quantity::speed("service_speed");
const PARAMETER_SETS: [(&str, ParameterSet); 3] = [
    ("benchmark", ParameterSet::Benchmark),
    ("as-printed", ParameterSet::AsPrinted),
    ("true-full-scale", ParameterSet::TrueFullScale),
];
const GAIN: Takes = Takes::Between(0.0, 100.0);
const LENGTHS: Takes = Takes::Between(0.1, 1000.0);

/// `[current]` and `[wind]`.
pub(super) fn surroundings(root: &mut Section<'_>, limits: Limits) -> Result<Surroundings, Fault> {
    let current = root.section("current")?.map(|section| current(section, limits)).transpose()?;
    let wind = root.section("wind")?.map(wind).transpose()?;
    Ok(Surroundings { current: current.unwrap_or_default(), wind })
}

fn current(mut section: Section<'_>, limits: Limits) -> Result<Velocity, Fault> {
    let towards_deg = section.required_number("towards_deg", FULL_TURN)?;
    let speed_mps = speed(&mut section, limits)?;
    section.finish()?;
    Ok(Velocity::from_course(Nautical::from_degrees(towards_deg), speed_mps))
}

fn wind(mut section: Section<'_>) -> Result<Wind, Fault> {
    let from = Nautical::from_degrees(section.required_number("from_deg", FULL_TURN)?);
    // Winds of a hundred metres per second are beyond any ship and any force that is known here.
    let speed_mps = section.required_quantity(&SPEED, Takes::Between(0.0, 100.0))?;
    section.finish()?;
    Ok(Wind { from, speed_mps })
}

/// `dynamics`, and the table of its settings.
pub(super) fn dynamics(section: &mut Section<'_>) -> Result<DynamicsConfig, Fault> {
    let dynamics = section.choice("dynamics", &Dynamics::WORDS)?.unwrap_or_default();
    let kvlcc2 = match (section.section("kvlcc2")?, dynamics) {
        (Some(settings), Dynamics::Kvlcc2) => kvlcc2(settings)?,
        (Some(_), Dynamics::Kinematic) => {
            return Err(section.fault(
                "kvlcc2",
                "is not what this ship moves by",
                "write dynamics = \"kvlcc2\", or remove these settings",
            ));
        }
        (None, _) => Kvlcc2Config::default(),
    };
    Ok(DynamicsConfig { dynamics, kvlcc2 })
}

fn kvlcc2(mut section: Section<'_>) -> Result<Kvlcc2Config, Fault> {
    let default = Kvlcc2Config::default();
    let gains = default.autopilot;
    let config = Kvlcc2Config {
        parameters: section.choice("parameters", &PARAMETER_SETS)?.unwrap_or_default(),
        service_speed_mps: section.quantity(&SERVICE_SPEED, Takes::Positive)?,
        max_rudder_deg: section
            .number("max_rudder_deg", Takes::Between(1.0, 45.0))?
            .unwrap_or(default.max_rudder_deg),
        rudder_rate_deg_per_s: section.number("rudder_rate_deg_per_s", Takes::Between(0.1, 100.0))?,
        autopilot: AutopilotConfig {
            heading_gain: section.number("heading_gain", GAIN)?.unwrap_or(gains.heading_gain),
            yaw_gain: section.number("yaw_gain", GAIN)?.unwrap_or(gains.yaw_gain),
            speed_gain: section.number("speed_gain", GAIN)?.unwrap_or(gains.speed_gain),
            ..gains
        },
        ..default
    };
    section.finish()?;
    Ok(config)
}

/// `[target.pilot]`, for a target ship that has one.
pub(super) fn pilot(section: &mut Section<'_>, dynamics: Dynamics) -> Result<PilotConfig, Fault> {
    let default = PilotConfig::default();
    let Some(mut pilot) = section.section("pilot")? else { return Ok(default) };
    if dynamics == Dynamics::Kinematic {
        return Err(section.fault(
            "pilot",
            "has nothing to do: the ship does what motion says",
            "write dynamics = \"kvlcc2\", or remove the pilot",
        ));
    }
    let config = PilotConfig {
        lookahead_over_length: pilot
            .number("lookahead_over_length", LENGTHS)?
            .unwrap_or(default.lookahead_over_length),
        acceptance_over_length: pilot
            .number("acceptance_over_length", LENGTHS)?
            .unwrap_or(default.acceptance_over_length),
        ..default
    };
    pilot.finish()?;
    Ok(config)
}

/// A ship's dynamics, the form of KVLCC2 at its length.
fn of_size(dynamics: DynamicsConfig, size: ShipSize) -> DynamicsConfig {
    DynamicsConfig { kvlcc2: Kvlcc2Config { length_m: size.length_m, ..dynamics.kvlcc2 }, ..dynamics }
}

impl Scenario {
    /// Current and wind need a ship that feels them; a ship with dynamics has to be one, and computed in
    /// reasonable time.
    pub(super) fn check_dynamics(&self) -> Result<(), Fault> {
        let is_ship = |dynamics: &DynamicsConfig| dynamics.dynamics == Dynamics::Kvlcc2;
        let mut all = std::iter::once(&self.own_ship.dynamics)
            .chain(self.targets.iter().map(|target| &target.dynamics));
        if self.surroundings != Surroundings::default() && !all.any(is_ship) {
            let key = if self.surroundings.wind.is_some() { "wind" } else { "current" };
            return Err(Fault::new(
                key,
                "no ship of this scenario feels it: all move over ground as they are told",
                format!("give a ship dynamics = \"kvlcc2\", or remove [{key}]"),
            ));
        }
        self.check_ship(&self.own_dynamics()).map_err(|fault| fault.within("own_ship"))?;
        for (index, target) in self.targets.iter().enumerate() {
            let dynamics = of_size(target.dynamics, target.size.unwrap_or_default());
            let place = format!("target[{}]", index + 1);
            check_motion(target).and_then(|()| self.check_ship(&dynamics)).map_err(|f| f.within(&place))?;
        }
        Ok(())
    }

    fn check_ship(&self, dynamics: &DynamicsConfig) -> Result<(), Fault> {
        if dynamics.dynamics == Dynamics::Kinematic {
            return Ok(());
        }
        dynamics.kvlcc2.check(0.0).map_err(in_ship)?;
        let lengths = self.duration_s / dynamics.kvlcc2.ship().time_unit_s();
        let substeps = lengths * dynamics.kvlcc2.steps_per_length;
        let most = self.limits.substeps_max;
        if substeps <= most {
            return Ok(());
        }
        Err(Fault::new(
            "dynamics",
            format!(
                "a ship this small takes {substeps:.1e} integration steps over the scenario, {most:.0e} are allowed"
            ),
            "write a shorter duration or a greater length_m",
        ))
    }

    /// The dynamics of own ship.
    #[must_use]
    pub fn own_dynamics(&self) -> DynamicsConfig {
        of_size(self.own_ship.dynamics, self.own_ship.size)
    }

    /// Own ship, under way over ground.
    pub(super) fn launch_own(&self, position: Position, velocity: Velocity) -> Box<dyn Steered> {
        let limits = self.own_ship.steering.limits();
        self.own_dynamics().launch(&Launch { position, velocity, limits }, self.surroundings)
    }

    /// That own ship's engine keeps its velocity over ground.
    pub(super) fn check_own_speed(&self, velocity: Velocity) -> Result<(), Fault> {
        self.check_speed(&self.own_dynamics(), velocity).map_err(|fault| fault.within("own_ship"))
    }

    fn check_speed(&self, dynamics: &DynamicsConfig, velocity: Velocity) -> Result<(), Fault> {
        if dynamics.dynamics == Dynamics::Kinematic {
            return Ok(());
        }
        let through_water = velocity - self.surroundings.current;
        dynamics.kvlcc2.check(through_water.speed_mps()).map_err(in_ship)
    }

    /// A target ship with dynamics, piloted on a straight course.
    pub(super) fn piloted_straight(
        &self,
        target: &Target,
        start: Kinematics,
        size: ShipSize,
        steps: usize,
    ) -> Result<Piloted, Fault> {
        let speed_mps = start.velocity.speed_mps();
        if speed_mps <= 0.0 {
            return Err(Fault::new(
                "dynamics",
                "a ship that lies still is not sailed",
                "write a speed above 0, or remove dynamics",
            ));
        }
        let ahead = start.position + start.velocity.for_seconds(self.duration_s);
        let waypoints = [start.position, ahead].map(|position| Waypoint { position, speed_mps });
        self.piloted(target, waypoints.to_vec(), size, steps)
    }

    /// A target ship with dynamics, piloted along its waypoints.
    pub(super) fn piloted(
        &self,
        target: &Target,
        waypoints: Vec<Waypoint>,
        size: ShipSize,
        steps: usize,
    ) -> Result<Piloted, Fault> {
        let dynamics = of_size(target.dynamics, size);
        let legs: Vec<Velocity> = waypoints
            .windows(2)
            .map(|ends| {
                let course = (ends[1].position - ends[0].position).bearing();
                Velocity::from_course(course, ends[0].speed_mps)
            })
            .collect();
        let beyond = waypoints
            .last()
            .zip(legs.last())
            .map(|(last, leg)| Velocity::from_course(leg.course(), last.speed_mps));
        for velocity in legs.iter().copied().chain(beyond) {
            self.check_speed(&dynamics, velocity)?;
        }
        let launch = Launch {
            position: waypoints[0].position,
            velocity: legs[0],
            limits: KinematicConfig { max_turn_deg: target.pilot.max_turn_deg },
        };
        let ship = dynamics.launch(&launch, self.surroundings);
        let mut pilot = Pilot::new(waypoints, size.length_m, self.surroundings.current, &target.pilot);
        Ok(Piloted::new(ship, self.dt_s, steps, |ship| pilot.command(ship)))
    }
}

/// That a target with dynamics has a course or waypoints that a pilot can sail.
fn check_motion(target: &Target) -> Result<(), Fault> {
    let sails = matches!(target.motion, TargetMotion::Linear(_) | TargetMotion::Waypoints { .. });
    if sails || target.dynamics.dynamics == Dynamics::Kinematic {
        return Ok(());
    }
    Err(Fault::new(
        "dynamics",
        format!("a ship that moves by motion = \"{}\" cannot be sailed otherwise", target.motion.word()),
        "write motion = \"linear\" or \"waypoints\", or remove dynamics",
    ))
}

/// A fault of the dynamics, seen from the ship.
fn in_ship(fault: Fault) -> Fault {
    // The length is that of the ship, beside its other dimensions.
    if fault.key == "length_m" { fault } else { fault.within("kvlcc2") }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::episode::Episode;
    use crate::policy::{Policy, Situation};
    use crate::scenario::{OwnShip, Placement, PlannedWaypoint, Point, ScenarioFile, StagedEncounter};
    use crate::vessel::{Command, MmgShip};

    const TANKER: &str = r#"duration_min = 20
policy = "hold-course"

[current]
towards_deg = 90
speed_kn = 2

[wind]
from_deg = 200
speed_mps = 8

[own_ship]
dynamics = "kvlcc2"
north_m = 0
east_m = 0
course_deg = 0
speed_kn = 14

[[target]]
name = "coaster"
dynamics = "kvlcc2"
length_m = 100
kvlcc2 = { service_speed_kn = 12, parameters = "as-printed" }
motion = "linear"
north_m = 9000
east_m = 500
course_deg = 180
speed_kn = 11
"#;

    fn set_up(text: &str) -> Result<StagedEncounter, String> {
        let file = ScenarioFile::parse(text, Path::new("t.toml")).map_err(|error| error.to_string())?;
        file.set_up().map_err(|error| error.to_string())
    }

    #[test]
    fn ships_with_dynamics_have_the_form_of_kvlcc2_at_their_length() {
        let staged = set_up(TANKER).unwrap();
        let own = &staged.own_body.hull;
        assert_eq!((own.length_m(), own.beam_m()), (320.0, 58.0));
        let coaster = &staged.targets[0].body.hull;
        assert_eq!((coaster.length_m(), coaster.beam_m()), (100.0, 18.125));
        assert_eq!(staged.targets[0].motion_word, "kvlcc2");
        assert_eq!(staged.scenario.own_ship.steering.max_turn_deg, 10.0);
        let coaster = staged.scenario.targets[0].dynamics.kvlcc2;
        assert_eq!(coaster.parameters, ParameterSet::AsPrinted);
        assert!((coaster.service_speed_mps.unwrap() - 12.0 * 1852.0 / 3600.0).abs() < 1e-12);
        let longer = set_up(&TANKER.replace("length_m = 100", "length_m = 100\nbeam_m = 20")).unwrap();
        assert_eq!(longer.targets[0].body.hull.beam_m(), 20.0);
    }

    /// Current towards, wind from: where ships go tells which is which.
    #[test]
    fn the_current_sets_towards_and_the_wind_blows_from_what_is_written() {
        let own = |text: &str| {
            let episode = set_up(text).unwrap().run();
            let end = episode.steps.len() - 1;
            (episode.steps[0].vessels[0].clone(), episode.steps[end].vessels[0].clone())
        };
        let no_wind = TANKER.replace("[wind]\nfrom_deg = 200\nspeed_mps = 8\n", "");
        let (start, end) = own(&no_wind);
        // It heads up to the west, against a current towards east, and makes its course over ground.
        let crab_deg = (2.0_f64 / 14.0).atan().to_degrees();
        assert!((start.heading.degrees() - (360.0 - crab_deg)).abs() < 1e-9);
        assert!(end.position.east_m.abs() < 10.0 && (end.velocity.east_mps).abs() < 0.01, "{end:?}");
        assert!((end.position.north_m - 20.0 * 14.0 * 1852.0 / 60.0).abs() < 50.0);
        // A wind from ahead holds it up, one from astern brings it on.
        let north_m = |from_deg: &str| {
            let windy = TANKER.replace("from_deg = 200\nspeed_mps = 8", from_deg);
            own(&windy).1.position.north_m
        };
        let still_m = end.position.north_m;
        let (ahead_m, astern_m) =
            (north_m("from_deg = 0\nspeed_kn = 40"), north_m("from_deg = 180\nspeed_kn = 40"));
        assert!(ahead_m < still_m - 50.0 && astern_m > still_m + 5.0, "{ahead_m} {still_m} {astern_m}");
    }

    /// Turns by a fixed angle at every decision.
    #[derive(Debug)]
    struct Turn(f64);

    impl Policy for Turn {
        fn name(&self) -> &str {
            "turn"
        }

        fn reset(&mut self, _seed: u64) {}

        fn decide(&mut self, _situation: &Situation<'_>) -> Command {
            Command { turn_rad: self.0.to_radians(), speed_mps: None }
        }
    }

    fn alone() -> Scenario {
        let own = OwnShip::heading(30.0).speed_mps(7.0).kvlcc2(320.0);
        Scenario::new("alone", own).duration_s(300.0)
    }

    fn run(scenario: &Scenario, turn_deg: f64) -> Episode {
        scenario.set_up().unwrap().run_under(&mut Turn(turn_deg))
    }

    #[test]
    fn the_body_follows_the_dynamics() {
        let episode = run(&alone(), 6.0);
        let mut ship = MmgShip::new(
            Kvlcc2Config::default().mmg(10.0),
            Surroundings::default(),
            Position::ORIGIN,
            Nautical::from_degrees(30.0),
            7.0,
        );
        let mut drift_deg = 0.0_f64;
        for (step, recorded) in episode.steps.iter().enumerate() {
            let (state, body) = (ship.state(), &recorded.vessels[0]);
            assert!(state.position.distance_m(body.position) < 1e-6, "step {step}");
            assert!(state.heading.turn_from(body.heading).abs() < 1e-9, "step {step}");
            drift_deg = drift_deg.max(body.heading.turn_from(body.velocity.course()).to_degrees());
            if step % 4 == 0 {
                ship.order(Command { turn_rad: 6_f64.to_radians(), speed_mps: None });
            }
            ship.advance(5.0);
        }
        // In a turn to starboard the bow points inside the track.
        assert!((3.0..25.0).contains(&drift_deg), "{drift_deg}");
        assert_eq!(episode.vessels[0].motion, "kvlcc2");
    }

    #[test]
    fn targets_are_sailed_along_their_waypoints() {
        let waypoints = [(2000.0, 4000.0, 6.0), (2000.0, 0.0, 4.0), (6000.0, 0.0, 4.0)]
            .map(|(north_m, east_m, speed_mps)| PlannedWaypoint {
                point: Point::local(north_m, east_m),
                speed_mps,
            })
            .to_vec();
        let motion = TargetMotion::Waypoints { waypoints };
        let exact = Target::new("exact", motion.clone());
        let sailed = Target::new("sailed", motion).kvlcc2(200.0);
        let scenario = alone().duration_s(1200.0).with_target(exact).with_target(sailed);
        let staged = scenario.set_up().unwrap();
        let [exact, sailed] = [0, 1].map(|target| staged.targets[target].motion.as_ref());
        assert_eq!(exact.position(0), sailed.position(0));
        assert!(exact.position(-75).distance_m(sailed.position(-75)) < 1e-6, "they came the same way");
        assert!(sailed.position(60).distance_m(exact.position(60)) < 10.0);
        let end = sailed.state(240);
        assert!(end.position.east_m.abs() < 150.0 && end.position.north_m > 2500.0, "{end:?}");
        assert!((3.4..5.5).contains(&end.velocity.speed_mps()), "it slows down in its own time: {end:?}");
        let widest = (120..200).map(|step| sailed.position(step).distance_m(exact.position(step)));
        assert!(widest.fold(0.0, f64::max) > 20.0, "a ship does not turn on the spot");
    }

    #[test]
    fn what_no_ship_can_do_is_explained() {
        let explained = |replaced: &str, with: &str, expected: &str| {
            assert!(TANKER.contains(replaced));
            let error = set_up(&TANKER.replacen(replaced, with, 1)).expect_err(with);
            assert_eq!(error, format!("t.toml:{expected}"));
        };
        explained(
            "speed_kn = 14",
            "speed_kn = 30",
            "12: key \"own_ship.kvlcc2.service_speed_mps\": the engine of KVLCC2 at a length of 320 m keeps \
             8.8 m/s, less than the 15.5 m/s wanted: write a lower speed, a greater length_m, or \
             service_speed_mps = 15.5",
        );
        explained(
            "dynamics = \"kvlcc2\"\nlength_m = 100\n",
            "length_m = 100\nbeam_m = 16\n",
            "23: key \"target[1].kvlcc2\": is not what this ship moves by: write dynamics = \"kvlcc2\", or \
             remove these settings",
        );
        explained(
            "motion = \"linear\"",
            "motion = \"periodic\"",
            "21: key \"target[1].dynamics\": a ship that moves by motion = \"periodic\" cannot be sailed \
             otherwise: write motion = \"linear\" or \"waypoints\", or remove dynamics",
        );
        explained(
            "from_deg = 200",
            "towards_deg = 20",
            "8: key \"wind.from_deg\": is missing in wind: write from_deg",
        );
        explained(
            "speed_kn = 11",
            "speed_kn = 0",
            "21: key \"target[1].dynamics\": a ship that lies still is not sailed: write a speed above 0, or \
             remove dynamics",
        );
        let calm = "duration_s = 300\n[current]\ntowards_deg = 0\nspeed_kn = 1\n[own_ship]\nnorth_m = 0\n\
                    east_m = 0\ncourse_deg = 0\nspeed_kn = 9\n";
        assert_eq!(
            set_up(calm).unwrap_err(),
            "t.toml:2: key \"current\": no ship of this scenario feels it: all move over ground as they are \
             told: give a ship dynamics = \"kvlcc2\", or remove [current]"
        );
        let tiny = TANKER.replace("length_m = 100", "length_m = 1\nbeam_m = 1");
        let tiny = tiny.replace("duration_min = 20", "duration_min = 500000\ndt_s = 1000");
        assert!(set_up(&tiny).unwrap_err().contains("integration steps over the scenario"));
    }

    #[test]
    fn a_target_of_given_cpa_has_it_by_the_velocities_at_the_start() {
        use crate::scenario::RelativePlacement;
        use crate::scenario::placement::{Bearing, WantedCpa};
        let current = Velocity { north_mps: 0.3, east_mps: -0.8 };
        let placement = Placement::FromOwnShip(RelativePlacement::SeenWithCpa {
            bearing: Bearing::Relative(0.7),
            range_m: 6000.0,
            cpa: WantedCpa { dcpa_m: 0.0, tcpa_s: 600.0, passes: None },
        });
        let target = Target::new("met", TargetMotion::Linear(placement)).kvlcc2(320.0);
        let scenario =
            alone().with_target(target).surroundings(Surroundings { current, wind: None }).duration_s(600.0);
        let episode = scenario.set_up().unwrap().run();
        let summary = &episode.summaries()[0];
        assert!(summary.start_cpa.distance_m < 1e-6 && (summary.start_cpa.time_s - 600.0).abs() < 1e-6);
        assert!(summary.closest_centre_m < 60.0, "{summary:?}");
    }
}
