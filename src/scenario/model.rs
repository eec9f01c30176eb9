//! What a scenario is, before anything is looked up or placed: the data a TOML file is parsed to,
//! and what a Rust program builds.

use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::encounter_starts::HeadOnKind;
use super::foresight::ForecasterChoice;
use super::placement::{Bearing, WantedCpa};
use crate::angle::Nautical;
use crate::encounter::RulesConfig;
use crate::geo::{Geodetic, LocalPlane, MPS_PER_KNOT, Position};
use crate::track::Track;
use crate::vessel::mmg::{MmgParameters, Surroundings};
use crate::vessel::{
    Dynamics, DynamicsConfig, KinematicConfig, PeriodicConfig, PilotConfig, StochasticConfig,
};
use crate::world::Bow;

/// A scripted encounter: own ship, the target ships it meets, and how it is observed and steered.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// Short name, for files and tables.
    pub name: String,
    /// One line that says what happens.
    pub title: String,
    /// What the encounter teaches.
    pub description: String,
    /// Origin of the local plane. Recorded targets bring the plane of their area instead; with
    /// neither, positions are local and no geographic position is known.
    pub origin: Option<Geodetic>,
    /// Time simulated, in seconds.
    pub duration_s: f64,
    /// Time before the start over which targets are known, in seconds: what forecasters look at.
    pub history_s: f64,
    /// Time step, in seconds.
    pub dt_s: f64,
    /// Seed of everything random: stochastic motions, sensor noise, starts that are drawn.
    pub seed: u64,
    /// Noise of the position sensors.
    pub sensor_noise: SensorNoise,
    /// Current and wind, for the ships whose dynamics feel them.
    pub surroundings: Surroundings,
    /// Name of the policy that steers own ship, one of [`crate::policy::NAMES`].
    pub policy: String,
    /// What forecasts the target ships for the policy; nothing leaves it to extrapolate their
    /// velocities.
    pub forecaster: Option<ForecasterChoice>,
    /// How far ahead target ships are forecast, in seconds; beyond, they go straight on.
    pub forecast_horizon_s: f64,
    /// Radius of the collision circle of every ship that has none of its own, in metres. Two ships
    /// are in contact where their circles touch.
    pub collision_radius_m: f64,
    /// The ship that is steered.
    pub own_ship: OwnShip,
    /// The ships it meets.
    pub targets: Vec<Target>,
    /// What counts as an encounter and as good conduct in it.
    pub rules: RulesConfig,
    /// Bounds of what is believed of a scenario.
    pub limits: Limits,
}

/// Bounds of what is believed of a scenario.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Greatest speed of a vessel, in metres per second.
    pub speed_max_mps: f64,
    /// Greatest distance of a vessel from the origin at the start, in metres; beyond some 50 km the
    /// local plane is no longer exact.
    pub extent_max_m: f64,
    /// Greatest number of time steps.
    pub steps_max: usize,
    /// Least time step, in seconds.
    pub dt_min_s: f64,
    /// Greatest time step, in seconds.
    pub dt_max_s: f64,
    /// Greatest number of integration steps of a ship with dynamics.
    pub substeps_max: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            speed_max_mps: 35.0,
            extent_max_m: 200_000.0,
            steps_max: 100_000,
            dt_min_s: 0.05,
            dt_max_s: 3600.0,
            substeps_max: 2e7,
        }
    }
}

/// Noise of the position sensors: every vessel's position is measured with an independent normal
/// error on north and on east at every time step. Course and speed are measured without error.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorNoise {
    /// Standard deviation on each axis, in metres.
    pub sigma_m: f64,
}

/// A point of a scenario, on the earth or in the local plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Point {
    /// Latitude and longitude.
    Geodetic(Geodetic),
    /// Metres north and east of the origin.
    Local(Position),
}

impl Point {
    /// A point in metres north and east of the origin.
    #[must_use]
    pub fn local(north_m: f64, east_m: f64) -> Self {
        Self::Local(Position { north_m, east_m })
    }

    /// A point in degrees of latitude and longitude.
    #[must_use]
    pub fn geodetic(latitude_deg: f64, longitude_deg: f64) -> Self {
        Self::Geodetic(Geodetic { latitude_deg, longitude_deg })
    }
}

/// Length over all, beam and bow of a ship.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShipSize {
    /// Length over all, in metres.
    pub length_m: f64,
    /// Greatest beam, in metres.
    pub beam_m: f64,
    /// Shape of its bow, seen from above.
    #[serde(default)]
    pub bow: Bow,
}

impl ShipSize {
    /// The proportions of KVLCC2.
    #[must_use]
    pub fn kvlcc2(length_m: f64) -> Self {
        let beam_m = MmgParameters::default().scaled_to(length_m).beam_m;
        Self { length_m, beam_m, bow: Bow::Full }
    }

    /// KVLCC2 as it would be built.
    #[must_use]
    pub fn full_size_kvlcc2() -> Self {
        Self::kvlcc2(MmgParameters::default().length_m)
    }
}

impl Default for ShipSize {
    /// A small coaster.
    fn default() -> Self {
        Self { length_m: 100.0, beam_m: 16.0, bow: Bow::default() }
    }
}

/// How often own ship asks its policy, and how much each answer changes. The default is that of the
/// paper's coastal environment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Steering {
    /// Largest change of heading per decision, in degrees.
    pub max_turn_deg: f64,
    /// Time between two decisions, in seconds.
    pub decision_interval_s: f64,
    /// Largest change of speed per decision, in metres per second; 0 keeps the speed constant.
    pub max_speed_change_mps: f64,
}

impl Default for Steering {
    fn default() -> Self {
        Self { max_turn_deg: 2.4, decision_interval_s: 20.0, max_speed_change_mps: 0.0 }
    }
}

impl Steering {
    /// What suits a kind of dynamics.
    #[must_use]
    pub fn suiting(dynamics: Dynamics) -> Self {
        match dynamics {
            Dynamics::Kinematic => Self::default(),
            // An order of this size is one that the ship can follow in the time.
            Dynamics::Kvlcc2 => Self { max_turn_deg: 10.0, ..Self::default() },
        }
    }

    /// What one decision changes at most.
    #[must_use]
    pub fn limits(&self) -> KinematicConfig {
        KinematicConfig { max_turn_deg: self.max_turn_deg }
    }
}

/// The ship that is steered.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnShip {
    /// Its name.
    pub name: String,
    /// Its size.
    pub size: ShipSize,
    /// Radius of its collision circle, in metres, where it differs from the scenario's.
    pub collision_radius_m: Option<f64>,
    /// Its speed at the start and the one it wants to make, in metres per second.
    pub speed_mps: f64,
    /// Where it starts and on which course.
    pub start: OwnStart,
    /// Waypoints after the start that it wants to reach; where there are none, it wants to keep its
    /// course.
    pub route: Vec<RoutePoint>,
    /// How it answers its policy.
    pub steering: Steering,
    /// How it moves. A ship of KVLCC2's form has the length of `size`.
    pub dynamics: DynamicsConfig,
}

/// A waypoint of own ship's route.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoutePoint {
    /// Where it is.
    pub point: Point,
    /// The speed planned from there on, in metres per second; as before where not given.
    pub speed_mps: Option<f64>,
}

/// Where own ship starts and on which course.
#[derive(Debug, Clone, PartialEq)]
pub enum OwnStart {
    /// At a point, on a course.
    At {
        /// Where.
        point: Point,
        /// On which course; towards the first waypoint of its route where not given.
        course: Option<Nautical>,
    },
    /// On the course reciprocal to a target's, to collide with it if both hold course and speed.
    HeadOn {
        /// Name of the target; not needed where there is one only that moves by its own rules.
        target: Option<String>,
        /// Time to that collision, in seconds.
        time_to_collision_s: f64,
    },
}

impl OwnShip {
    /// At the origin of the plane, on a course.
    #[must_use]
    pub fn heading(course_deg: f64) -> Self {
        Self::starting(OwnStart::At {
            point: Point::Local(Position::ORIGIN),
            course: Some(Nautical::from_degrees(course_deg)),
        })
    }

    /// Head-on to a target, with this time to collision by linear extrapolation.
    #[must_use]
    pub fn head_on_to(target: &str, time_to_collision_s: f64) -> Self {
        Self::starting(OwnStart::HeadOn { target: Some(target.to_owned()), time_to_collision_s })
    }

    fn starting(start: OwnStart) -> Self {
        Self {
            name: "own ship".to_owned(),
            size: ShipSize::default(),
            collision_radius_m: None,
            speed_mps: 8.0,
            start,
            route: Vec::new(),
            steering: Steering::default(),
            dynamics: DynamicsConfig::default(),
        }
    }

    /// Sets the starting point, unless own ship is placed by a target.
    #[must_use]
    pub fn from(mut self, from: Point) -> Self {
        if let OwnStart::At { point, .. } = &mut self.start {
            *point = from;
        }
        self
    }

    /// Sets the waypoints that it wants to reach.
    #[must_use]
    pub fn route(self, route: &[Point]) -> Self {
        let route = route.iter().map(|&point| RoutePoint { point, speed_mps: None }).collect();
        Self { route, ..self }
    }

    /// Sets the speed, in metres per second.
    #[must_use]
    pub fn speed_mps(self, speed_mps: f64) -> Self {
        Self { speed_mps, ..self }
    }

    /// Sets the speed, in knots.
    #[must_use]
    pub fn speed_kn(self, speed_kn: f64) -> Self {
        self.speed_mps(speed_kn * MPS_PER_KNOT)
    }

    /// Sets length and beam, in metres.
    #[must_use]
    pub fn size(self, length_m: f64, beam_m: f64) -> Self {
        Self { size: ShipSize { length_m, beam_m, ..self.size }, ..self }
    }

    /// Gives it the form and the dynamics of KVLCC2 at a length, in metres.
    #[must_use]
    pub fn kvlcc2(self, length_m: f64) -> Self {
        Self {
            size: ShipSize::kvlcc2(length_m),
            steering: Steering::suiting(Dynamics::Kvlcc2),
            dynamics: DynamicsConfig { dynamics: Dynamics::Kvlcc2, ..self.dynamics },
            ..self
        }
    }
}

/// A ship that own ship meets.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Its name.
    pub name: String,
    /// Its size; where it is not given, the recorded one or the default.
    pub size: Option<ShipSize>,
    /// Radius of its collision circle, in metres, where it differs from the scenario's.
    pub collision_radius_m: Option<f64>,
    /// How it moves, or where its pilot takes it.
    pub motion: TargetMotion,
    /// Its dynamics. Kinematic ships do what `motion` says to the letter; a ship of KVLCC2's form, with the
    /// length of `size`, is piloted along its course or its waypoints.
    pub dynamics: DynamicsConfig,
    /// How it is piloted, where it is.
    pub pilot: PilotConfig,
}

impl Target {
    /// A target of default or recorded size that does what `motion` says to the letter.
    #[must_use]
    pub fn new(name: &str, motion: TargetMotion) -> Self {
        Self {
            name: name.to_owned(),
            size: None,
            collision_radius_m: None,
            motion,
            dynamics: DynamicsConfig::default(),
            pilot: PilotConfig::default(),
        }
    }

    /// Gives it the form and the dynamics of KVLCC2 at a length, in metres.
    #[must_use]
    pub fn kvlcc2(self, length_m: f64) -> Self {
        Self {
            size: Some(ShipSize::kvlcc2(length_m)),
            dynamics: DynamicsConfig { dynamics: Dynamics::Kvlcc2, ..self.dynamics },
            ..self
        }
    }
}

/// How a target ship moves.
#[derive(Debug, Clone, PartialEq)]
pub enum TargetMotion {
    /// As a recorded vessel did.
    Recorded(RecordedVessel),
    /// On a constant course at constant speed.
    Linear(Placement),
    /// From waypoint to waypoint, and on in the direction of the last leg.
    Waypoints {
        /// The waypoints, two at least; the first is where it starts.
        waypoints: Vec<PlannedWaypoint>,
    },
    /// Linear, with an autoregressive deviation (the paper's stochastic obstacle).
    Stochastic(Placement, StochasticConfig),
    /// Linear, with a sinusoidal deviation (the paper's periodic obstacle).
    Periodic(Placement, PeriodicConfig),
}

impl TargetMotion {
    /// The word of scenario files for this kind of motion.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Recorded(_) => "recorded",
            Self::Linear(_) => "linear",
            Self::Waypoints { .. } => "waypoints",
            Self::Stochastic(..) => "stochastic",
            Self::Periodic(..) => "periodic",
        }
    }
}

/// A waypoint of a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedWaypoint {
    /// Where it is.
    pub point: Point,
    /// Speed from there on, in metres per second.
    pub speed_mps: f64,
}

/// Where a target starts and how fast it goes where: on its own, or relative to own ship.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Placement {
    /// At a point, on a course.
    At {
        /// Where.
        point: Point,
        /// On which course.
        course: Nautical,
        /// How fast, in metres per second.
        speed_mps: f64,
    },
    /// Relative to own ship.
    FromOwnShip(RelativePlacement),
}

/// Where a target starts and how fast it goes where, relative to own ship.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RelativePlacement {
    /// Seen from own ship at a bearing and range, on a course.
    Seen {
        /// Direction from own ship.
        bearing: Bearing,
        /// Distance from own ship, in metres.
        range_m: f64,
        /// On which course.
        course: Nautical,
        /// How fast, in metres per second.
        speed_mps: f64,
    },
    /// Seen from own ship at a bearing and range; course and speed follow from DCPA and TCPA.
    SeenWithCpa {
        /// Direction from own ship.
        bearing: Bearing,
        /// Distance from own ship, in metres.
        range_m: f64,
        /// DCPA and TCPA to own ship.
        cpa: WantedCpa,
    },
    /// On a course; where it starts follows from DCPA and TCPA.
    CourseWithCpa {
        /// On which course.
        course: Nautical,
        /// How fast, in metres per second.
        speed_mps: f64,
        /// DCPA and TCPA to own ship.
        cpa: WantedCpa,
    },
}

/// A recorded vessel and the moment from which it is replayed.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedVessel {
    /// Where the tracks come from.
    pub source: TrackSource,
    /// Which vessel, from when on.
    pub start: RecordedStart,
}

/// Where recorded tracks come from.
#[derive(Debug, Clone, PartialEq)]
pub enum TrackSource {
    /// AIS files, imported in memory.
    Ais {
        /// The files.
        files: Vec<PathBuf>,
        /// The area file.
        area: PathBuf,
    },
    /// A directory that `searoom ais import` wrote.
    Directory(PathBuf),
    /// Tracks a program already has.
    Given {
        /// The tracks.
        tracks: Arc<[Track]>,
        /// The plane they lie in.
        plane: LocalPlane,
    },
}

/// Which recorded vessel, from when on.
#[derive(Debug, Clone, PartialEq)]
pub enum RecordedStart {
    /// A vessel at a moment.
    Time {
        /// The vessel.
        mmsi: u32,
        /// The moment, in seconds since 1970-01-01 00:00:00 UTC.
        unix_s: f64,
    },
    /// A start of the paper's scenarios 1 and 2, found from the tracks.
    Rule {
        /// Which of them.
        kind: HeadOnKind,
        /// Of this vessel only.
        mmsi: Option<u32>,
        /// Which of the starts found, from 1 on; drawn with the scenario's seed where not given.
        pick: Option<usize>,
    },
}

impl Scenario {
    /// A scenario of five minutes at the paper's time step, without targets.
    #[must_use]
    pub fn new(name: &str, own_ship: OwnShip) -> Self {
        Self {
            name: name.to_owned(),
            title: name.to_owned(),
            description: String::new(),
            origin: None,
            duration_s: 300.0,
            history_s: 375.0,
            dt_s: 5.0,
            seed: 0,
            sensor_noise: SensorNoise::default(),
            surroundings: Surroundings::default(),
            policy: "hold-course".to_owned(),
            forecaster: None,
            forecast_horizon_s: 1000.0,
            collision_radius_m: 150.0,
            own_ship,
            targets: Vec::new(),
            rules: RulesConfig::default(),
            limits: Limits::default(),
        }
    }

    /// Adds a target of default or recorded size.
    #[must_use]
    pub fn target(self, name: &str, motion: TargetMotion) -> Self {
        self.with_target(Target::new(name, motion))
    }

    /// Adds a target.
    #[must_use]
    pub fn with_target(mut self, target: Target) -> Self {
        self.targets.push(target);
        self
    }

    /// Sets the time simulated, in seconds.
    #[must_use]
    pub fn duration_s(self, duration_s: f64) -> Self {
        Self { duration_s, ..self }
    }

    /// Sets the seed.
    #[must_use]
    pub fn seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Sets the standard deviation of the position sensors, in metres.
    #[must_use]
    pub fn sensor_noise_m(self, sigma_m: f64) -> Self {
        Self { sensor_noise: SensorNoise { sigma_m }, ..self }
    }

    /// Sets current and wind.
    #[must_use]
    pub fn surroundings(self, surroundings: Surroundings) -> Self {
        Self { surroundings, ..self }
    }

    /// Sets the policy by its name.
    #[must_use]
    pub fn policy(self, name: &str) -> Self {
        Self { policy: name.to_owned(), ..self }
    }

    /// Sets what forecasts the target ships for the policy.
    #[must_use]
    pub fn forecaster(self, forecaster: ForecasterChoice) -> Self {
        Self { forecaster: Some(forecaster), ..self }
    }

    /// Sets the origin of the local plane.
    #[must_use]
    pub fn origin(self, origin: Geodetic) -> Self {
        Self { origin: Some(origin), ..self }
    }
}
