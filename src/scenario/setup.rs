//! From a scenario to ships in a plane: tracks are looked up, own ship and targets are placed.

use std::fmt;
use std::sync::Arc;

use super::encounter_starts::{HeadOnConfig, head_on_pose};
use super::file::ScenarioFile;
use super::foresight::Foresight;
use super::model::{
    Limits, OwnStart, Placement, Point, RelativePlacement, Scenario, ShipSize, Target, TargetMotion,
};
use super::placement::{Kinematics, at_range_with_cpa, on_course_with_cpa, seen_at};
use super::streams::{Purpose, stream};
use super::tracks::{self, TrackLibrary};
use crate::config::{ConfigError, Fault};
use crate::geo::{LocalPlane, Position, Velocity};
use crate::policy::{self, Route};
use crate::track::Track;
use crate::vessel::{self, Dynamics, Linear, Motion, Recorded, VesselState, Waypoint, Waypoints};
use crate::world::{Hull, VesselBody};

/// A scenario whose ships are placed: ready to run, as often as wanted.
#[derive(Debug, Clone)]
pub struct StagedEncounter {
    /// What was set up.
    pub scenario: Scenario,
    /// The plane of all positions; `None` where the scenario knows no geographic position.
    pub plane: Option<LocalPlane>,
    /// Own ship at the start.
    pub own_start: VesselState,
    /// Where own ship wants to go.
    pub route: Route,
    /// Own ship's shapes.
    pub own_body: VesselBody,
    /// The targets, in the order of the scenario.
    pub targets: Vec<PlacedTarget>,
    /// What forecasts the targets for the policy, where the scenario asks for it.
    pub foresight: Option<Foresight>,
}

/// A target ship with the motion it will make.
#[derive(Clone)]
pub struct PlacedTarget {
    /// Its name.
    pub name: String,
    /// Its shapes.
    pub body: VesselBody,
    /// How it moves, in a word: `recorded`, `linear`.
    pub motion_word: &'static str,
    /// MMSI of a recorded vessel.
    pub mmsi: Option<u32>,
    /// Its motion; step 0 is the start.
    pub motion: Arc<dyn Motion>,
}

impl fmt::Debug for PlacedTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PlacedTarget")
            .field("name", &self.name)
            .field("mmsi", &self.mmsi)
            .field("start", &self.motion.state(0))
            .finish()
    }
}

impl ScenarioFile {
    /// Looks up the tracks and places the ships.
    ///
    /// # Errors
    /// As [`Scenario::set_up`], with the line of whatever cannot be.
    pub fn set_up(&self) -> Result<StagedEncounter, ConfigError> {
        self.scenario.set_up().map_err(|fault| self.located(fault))
    }
}

impl Scenario {
    /// Looks up the tracks and places the ships.
    ///
    /// # Errors
    /// Tracks that are not there, geometry that cannot be, times that do not fit.
    pub fn set_up(&self) -> Result<StagedEncounter, Fault> {
        let steps = self.checked_steps()?;
        if policy::by_name(&self.policy).is_none() {
            return Err(Fault::new(
                "policy",
                format!("\"{}\" is not known here", self.policy),
                format!("write one of {}", policy::NAMES.join(", ")),
            ));
        }
        self.check_dynamics()?;
        let mut library = TrackLibrary::default();
        let frame = Frame { plane: self.plane(&mut library)? };
        let foresight = self.forecaster.as_ref().map(|choice| self.foresight(choice, frame.plane));
        let foresight = foresight.transpose()?;
        let anchors = self
            .targets
            .iter()
            .enumerate()
            .map(|(index, target)| {
                self.anchor(index, target, &frame, &mut library).map_err(|fault| fault.within(&key_of(index)))
            })
            .collect::<Result<Vec<_>, Fault>>()?;
        let route = self.own_route(&frame)?;
        let own = self.place_own(&frame, &route, &anchors)?;
        self.check_own_speed(own.velocity)?;
        self.check_extent(own.position, "own_ship")?;
        let targets = self
            .targets
            .iter()
            .zip(anchors)
            .enumerate()
            .map(|(index, (target, anchor))| {
                self.place_target(index, target, anchor, own, steps)
                    .map_err(|fault| fault.within(&key_of(index)))
            })
            .collect::<Result<Vec<_>, Fault>>()?;
        let own_ship = &self.own_ship;
        let own_body = self
            .body(own_ship.size, own_ship.collision_radius_m)
            .map_err(|fault| fault.within("own_ship"))?;
        let own_start = self.launch_own(own.position, own.velocity).state();
        let route = std::iter::once((own.position, None)).chain(route).collect::<Vec<_>>();
        let route = Route::planned(&route).unwrap_or(Route::straight(own.position, own.velocity.course()));
        Ok(StagedEncounter {
            scenario: self.clone(),
            plane: frame.plane,
            own_start,
            route,
            own_body,
            targets,
            foresight,
        })
    }

    /// Number of time steps.
    #[must_use]
    pub fn steps(&self) -> usize {
        (self.duration_s / self.dt_s).round() as usize
    }

    fn checked_steps(&self) -> Result<usize, Fault> {
        let Limits { dt_min_s: least_s, dt_max_s: most_s, .. } = self.limits;
        if !(least_s..=most_s.min(self.duration_s)).contains(&self.dt_s) {
            return Err(Fault::new(
                "dt_s",
                format!("a time step of {} s is not possible here", self.dt_s),
                format!("write {least_s} to {most_s} s, and no more than the duration"),
            ));
        }
        let steps = self.duration_s / self.dt_s;
        let in_range = (0.5..=self.limits.steps_max as f64).contains(&steps);
        if in_range && (steps - steps.round()).abs() < 1e-6 {
            return Ok(self.steps());
        }
        let (duration_s, dt_s) = (self.duration_s, self.dt_s);
        Err(Fault::new(
            "duration_s",
            format!(
                "{duration_s} s are no whole number of time steps of {dt_s} s, 1 to {}",
                self.limits.steps_max
            ),
            "change duration_s or dt_s",
        ))
    }

    /// The plane of the recorded tracks, or else of the origin, or else of own ship's start.
    fn plane(&self, library: &mut TrackLibrary) -> Result<Option<LocalPlane>, Fault> {
        let mut recorded: Option<LocalPlane> = None;
        for (index, target) in self.targets.iter().enumerate() {
            let TargetMotion::Recorded(target) = &target.motion else { continue };
            let plane = library.of(&target.source).map_err(|fault| fault.within(&key_of(index)))?.plane;
            if recorded.is_some_and(|other| other != plane) {
                return Err(Fault::new(
                    "area_file",
                    "lies in another local plane than the recorded targets before it",
                    "take all recorded targets from one area",
                )
                .within(&key_of(index)));
            }
            recorded = Some(plane);
        }
        match (recorded, self.origin, &self.own_ship.start) {
            (Some(_), Some(_), _) => Err(Fault::new(
                "origin",
                "recorded targets bring the local plane of their area",
                "remove origin, or the recorded targets",
            )),
            (Some(plane), None, _) => Ok(Some(plane)),
            (None, Some(origin), _) => Ok(Some(LocalPlane::at(origin))),
            (None, None, OwnStart::At { point: Point::Geodetic(start), .. }) => {
                Ok(Some(LocalPlane::at(*start)))
            }
            (None, None, _) => Ok(None),
        }
    }

    /// What can be said of a target before own ship is placed.
    fn anchor(
        &self,
        index: usize,
        target: &Target,
        frame: &Frame,
        library: &mut TrackLibrary,
    ) -> Result<Anchor, Fault> {
        match &target.motion {
            TargetMotion::Recorded(recorded) => {
                let mut rng = stream(self.seed, Purpose::Start, index + 1);
                let set = library.of(&recorded.source)?;
                let replay = tracks::find(set, recorded, self.duration_s, &self.head_on_config(), &mut rng)?;
                let track = Arc::new(replay.track.clone());
                let offset_s = replay.index as f64 * track.dt_s;
                let motion = Recorded::new(Arc::clone(&track), self.dt_s).from_offset(offset_s);
                Ok(Anchor::Replay { motion, track })
            }
            TargetMotion::Waypoints { waypoints } => {
                let waypoints = waypoints
                    .iter()
                    .enumerate()
                    .map(|(index, waypoint)| {
                        let place = || format!("waypoints[{}]", index + 1);
                        let position =
                            frame.position(waypoint.point).map_err(|fault| fault.within(&place()))?;
                        self.check_extent(position, &place())?;
                        Ok(Waypoint { position, speed_mps: waypoint.speed_mps })
                    })
                    .collect::<Result<Vec<_>, Fault>>()?;
                Waypoints::new(&waypoints, self.dt_s)
                    .map(|motion| Anchor::Route { motion, waypoints })
                    .map_err(|error| Fault::new("waypoints", error.to_string(), "see the list"))
            }
            TargetMotion::Linear(placement)
            | TargetMotion::Stochastic(placement, _)
            | TargetMotion::Periodic(placement, _) => match placement {
                Placement::At { point, course, speed_mps } => Ok(Anchor::Free(Kinematics {
                    position: frame.position(*point)?,
                    velocity: Velocity::from_course(*course, *speed_mps),
                })),
                Placement::FromOwnShip(placement) => Ok(Anchor::FromOwnShip(*placement)),
            },
        }
    }

    /// The head-on encounters that suit this scenario's own ship and duration.
    fn head_on_config(&self) -> HeadOnConfig {
        let default = HeadOnConfig::default();
        let time_to_collision_s = match self.own_ship.start {
            OwnStart::HeadOn { time_to_collision_s, .. } => time_to_collision_s,
            OwnStart::At { .. } => default.time_to_collision_s,
        };
        HeadOnConfig {
            own_speed_mps: self.own_ship.speed_mps,
            time_to_collision_s,
            turn_per_decision_deg: self.own_ship.steering.max_turn_deg,
            dynamics: self.own_ship.dynamics.dynamics,
            kvlcc2: self.own_dynamics().kvlcc2,
            decision_interval_s: self.own_ship.steering.decision_interval_s,
            history_s: self.history_s,
            future_s: self.duration_s,
            ..default
        }
    }

    /// Own ship's waypoints with the speed that is planned from each on.
    fn own_route(&self, frame: &Frame) -> Result<Vec<(Position, Option<f64>)>, Fault> {
        let waypoints = self.own_ship.route.iter().enumerate();
        waypoints
            .map(|(index, waypoint)| {
                let place = format!("own_ship.route[{}]", index + 1);
                let position = frame.position(waypoint.point).map_err(|fault| fault.within(&place))?;
                self.check_extent(position, &place).map(|()| (position, waypoint.speed_mps))
            })
            .collect()
    }

    fn place_own(
        &self,
        frame: &Frame,
        route: &[(Position, Option<f64>)],
        anchors: &[Anchor],
    ) -> Result<Kinematics, Fault> {
        let speed_mps = self.own_ship.speed_mps;
        match &self.own_ship.start {
            OwnStart::At { point, course } => {
                let position = frame.position(*point).map_err(|fault| fault.within("own_ship"))?;
                let course = match (course, route.first()) {
                    (Some(course), _) => *course,
                    (None, Some((waypoint, _))) => (*waypoint - position).bearing(),
                    (None, None) => {
                        return Err(Fault::new(
                            "own_ship.course_deg",
                            "is missing",
                            "write course_deg, or a route",
                        ));
                    }
                };
                Ok(Kinematics { position, velocity: Velocity::from_course(course, speed_mps) })
            }
            OwnStart::HeadOn { target, time_to_collision_s } => {
                let met = self
                    .met_head_on(target.as_deref(), anchors)
                    .map_err(|fault| fault.within("own_ship.head_on"))?;
                let pose = head_on_pose(met.position, met.velocity, speed_mps, *time_to_collision_s);
                let velocity = Velocity::from_course(pose.course, speed_mps);
                Ok(Kinematics { position: pose.position, velocity })
            }
        }
    }

    /// The target that own ship is placed head-on to.
    fn met_head_on(&self, name: Option<&str>, anchors: &[Anchor]) -> Result<Kinematics, Fault> {
        let names = || self.targets.iter().map(|target| format!("\"{}\"", target.name)).collect::<Vec<_>>();
        let index = match name {
            Some(name) => self.targets.iter().position(|target| target.name == name).ok_or_else(|| {
                Fault::new(
                    "target",
                    format!("no target is named \"{name}\""),
                    format!("write one of {}", names().join(", ")),
                )
            })?,
            None if self.targets.len() == 1 => 0,
            None if self.targets.is_empty() => {
                return Err(Fault::new("target", "there is no target to meet", "write a [[target]]"));
            }
            None => {
                return Err(Fault::new(
                    "target",
                    format!("which of the {} targets is met head-on is not said", self.targets.len()),
                    format!("write target = one of {}", names().join(", ")),
                ));
            }
        };
        let met = anchors[index].kinematics().ok_or_else(|| {
            Fault::new(
                "target",
                format!("\"{}\" is itself placed relative to own ship", self.targets[index].name),
                "place that target by its position, or own ship by its own",
            )
        })?;
        if met.velocity.speed_mps() < 1e-3 {
            return Err(Fault::new(
                "target",
                format!(
                    "\"{}\" lies still at the start, so it has no course to meet",
                    self.targets[index].name
                ),
                "take a target or a time at which it is under way",
            ));
        }
        Ok(met)
    }

    fn place_target(
        &self,
        index: usize,
        target: &Target,
        anchor: Anchor,
        own: Kinematics,
        steps: usize,
    ) -> Result<PlacedTarget, Fault> {
        let recorded_size = match &anchor {
            Anchor::Replay { track, .. } => recorded_size(track),
            _ => None,
        };
        let size = target.size.or(recorded_size).unwrap_or_default();
        let body = self.body(size, target.collision_radius_m)?;
        let is_piloted = target.dynamics.dynamics != Dynamics::Kinematic;
        let (motion, mmsi): (Arc<dyn Motion>, _) = match anchor {
            Anchor::Replay { motion, track } => (Arc::new(motion), Some(track.mmsi)),
            Anchor::Route { waypoints, .. } if is_piloted => {
                (Arc::new(self.piloted(target, waypoints, size, steps)?), None)
            }
            Anchor::Route { motion, .. } => (Arc::new(motion), None),
            Anchor::Free(start) => (self.straight_motion(index, target, start, size, steps)?, None),
            Anchor::FromOwnShip(placement) => {
                let start = self.relative_to(own, placement)?;
                (self.straight_motion(index, target, start, size, steps)?, None)
            }
        };
        let motion_word = if is_piloted { target.dynamics.dynamics.word() } else { target.motion.word() };
        Ok(PlacedTarget { name: target.name.clone(), body, motion_word, mmsi, motion })
    }

    fn body(&self, size: ShipSize, collision_radius_m: Option<f64>) -> Result<VesselBody, Fault> {
        let hull = Hull::new(size.length_m, size.beam_m, size.bow)
            .map_err(|error| Fault::new("length_m", error.to_string(), "write length_m and beam_m"))?;
        Ok(VesselBody { hull, collision_radius_m: collision_radius_m.unwrap_or(self.collision_radius_m) })
    }

    fn relative_to(&self, own: Kinematics, placement: RelativePlacement) -> Result<Kinematics, Fault> {
        match placement {
            RelativePlacement::Seen { bearing, range_m, course, speed_mps } => Ok(Kinematics {
                position: seen_at(own, bearing, range_m),
                velocity: Velocity::from_course(course, speed_mps),
            }),
            RelativePlacement::SeenWithCpa { bearing, range_m, cpa } => {
                at_range_with_cpa(own, bearing, range_m, cpa, self.limits.speed_max_mps)
            }
            RelativePlacement::CourseWithCpa { course, speed_mps, cpa } => {
                on_course_with_cpa(own, Velocity::from_course(course, speed_mps), cpa)
            }
        }
    }

    /// A linear motion, with what a stochastic or periodic one adds to it.
    fn straight_motion(
        &self,
        index: usize,
        target: &Target,
        start: Kinematics,
        size: ShipSize,
        steps: usize,
    ) -> Result<Arc<dyn Motion>, Fault> {
        self.check_extent(start.position, "")?;
        if target.dynamics.dynamics != Dynamics::Kinematic {
            return Ok(Arc::new(self.piloted_straight(target, start, size, steps)?));
        }
        let linear = Linear::new(start.position, start.velocity, self.dt_s);
        let history = (self.history_s / self.dt_s).ceil() as usize;
        let mut rng = stream(self.seed, Purpose::Motion, index + 1);
        Ok(match &target.motion {
            TargetMotion::Stochastic(_, config) => {
                Arc::new(vessel::stochastic::motion(*config, linear, history, steps, &mut rng))
            }
            TargetMotion::Periodic(_, config) => {
                Arc::new(vessel::periodic::motion(*config, linear, history, steps, &mut rng))
            }
            _ => Arc::new(linear),
        })
    }

    fn check_extent(&self, position: Position, key: &str) -> Result<(), Fault> {
        let (distance_m, most_m) = (position.distance_m(Position::ORIGIN), self.limits.extent_max_m);
        if distance_m <= most_m {
            return Ok(());
        }
        Err(Fault::new(
            key,
            format!("starts {:.0} km from the origin, further than {:.0} km", distance_m / 1e3, most_m / 1e3),
            "check its position, or move the origin",
        ))
    }
}

/// A target as far as it is known before own ship is placed.
enum Anchor {
    Replay { motion: Recorded, track: Arc<Track> },
    Route { motion: Waypoints, waypoints: Vec<Waypoint> },
    Free(Kinematics),
    FromOwnShip(RelativePlacement),
}

impl Anchor {
    fn kinematics(&self) -> Option<Kinematics> {
        let of = |motion: &dyn Motion| {
            let VesselState { position, velocity, .. } = motion.state(0);
            Kinematics { position, velocity }
        };
        match self {
            Self::Replay { motion, .. } => Some(of(motion)),
            Self::Route { motion, .. } => Some(of(motion)),
            Self::Free(kinematics) => Some(*kinematics),
            Self::FromOwnShip(_) => None,
        }
    }
}

/// Brings the points of a scenario to its plane.
struct Frame {
    plane: Option<LocalPlane>,
}

impl Frame {
    fn position(&self, point: Point) -> Result<Position, Fault> {
        match (point, self.plane) {
            (Point::Local(position), _) => Ok(position),
            (Point::Geodetic(point), Some(plane)) => Ok(plane.project(point)),
            (Point::Geodetic(_), None) => Err(Fault::new(
                "latitude_deg",
                "the scenario has no origin on the earth",
                "write [origin] with latitude_deg and longitude_deg, or place own ship by latitude and longitude",
            )),
        }
    }
}

/// The size that AIS reports, where it can be one: some vessels report nonsense.
fn recorded_size(track: &Track) -> Option<ShipSize> {
    let (length_m, beam_m) = track.particulars.length_m.zip(track.particulars.beam_m)?;
    let size = ShipSize { length_m, beam_m, ..ShipSize::default() };
    Hull::new(length_m, beam_m, size.bow).is_ok().then_some(size)
}

fn key_of(index: usize) -> String {
    format!("target[{}]", index + 1)
}

#[cfg(test)]
mod tests;
