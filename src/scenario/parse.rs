//! From a TOML table to a [`Scenario`]: every key, its unit and its bounds.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::dynamics;
use super::encounter_starts::HeadOnKind;
use super::foresight::ForecasterChoice;
use super::model::{
    Limits, OwnShip, OwnStart, Placement, PlannedWaypoint, Point, RecordedStart, RecordedVessel,
    RelativePlacement, RoutePoint, Scenario, SensorNoise, ShipSize, Steering, Target, TargetMotion,
    TrackSource,
};
use super::moment;
use super::placement::{Bearing, Passes, WantedCpa};
use super::section::{Quantity, Section, Takes};
use crate::angle::Nautical;
use crate::config::Fault;
use crate::encounter::{BoundedKey, RulesConfig};
use crate::geo::{Geodetic, Position};
use crate::policy;
use crate::vessel::{Dynamics, PeriodicConfig, StochasticConfig};
use crate::world::Bow;

pub(super) const SPEED: Quantity = Quantity::speed("speed");
const RANGE: Quantity = Quantity::length("range");
const DCPA: Quantity = Quantity::length("dcpa");
const TCPA: Quantity = Quantity::time("tcpa");
const DURATION: Quantity = Quantity::time("duration");
const FORECAST_HORIZON: Quantity = Quantity::time("forecast_horizon");
const SPEED_CHANGE: Quantity = Quantity::speed("max_speed_change");
const TIME_TO_COLLISION: Quantity = Quantity::time("time_to_collision");
const POINT_KEYS: [&str; 4] = ["north_m", "east_m", "latitude_deg", "longitude_deg"];
const BEARING_KEYS: [&str; 2] = ["bearing_deg", "relative_bearing_deg"];
const SPREAD: Takes = Takes::Between(0.0, 10_000.0);
pub(super) const FULL_TURN: Takes = Takes::Between(-360.0, 360.0);

/// Reads the whole document; relative paths in it start from `directory`.
pub(super) fn scenario(root: Section<'_>, name: &str, directory: &Path) -> Result<Scenario, Fault> {
    let mut root = root;
    let limits = Limits::default();
    let title = root.text("title")?.unwrap_or_else(|| name.to_owned());
    let description = root.text("description")?.unwrap_or_default();
    let duration_s = root.required_quantity(&DURATION, Takes::Positive)?;
    let dt_s = root.number("dt_s", Takes::Positive)?;
    let seed = root.integer("seed")?;
    let policy = root.choice("policy", &policy::NAMES.map(|name| (name, name)))?;
    let forecaster = root.text("forecaster")?.map(|word| ForecasterChoice::of(&word, directory));
    let forecast_horizon_s = root.quantity(&FORECAST_HORIZON, Takes::Positive)?;
    let collision_radius_m = collision_radius(&mut root)?;
    let origin = root.section("origin")?.map(geodetic_section).transpose()?;
    let sensor_noise = root.section("sensor_noise")?.map(sensor_noise).transpose()?;
    let surroundings = dynamics::surroundings(&mut root, limits)?;
    let rules = rules(&mut root)?;
    let own_section = root.section("own_ship")?.ok_or_else(|| root.missing(&["own_ship".to_owned()]))?;
    let own_ship = own_ship(own_section, limits)?;
    let targets = targets(root.sections("target")?, directory, limits)?;
    root.finish()?;

    let blank = Scenario::new(name, own_ship);
    Ok(Scenario {
        title,
        description,
        origin,
        duration_s,
        dt_s: dt_s.unwrap_or(blank.dt_s),
        seed: seed.unwrap_or(blank.seed),
        sensor_noise: sensor_noise.unwrap_or_default(),
        surroundings,
        policy: policy.map_or(blank.policy.clone(), str::to_owned),
        forecaster,
        forecast_horizon_s: forecast_horizon_s.unwrap_or(blank.forecast_horizon_s),
        collision_radius_m: collision_radius_m.unwrap_or(blank.collision_radius_m),
        targets,
        rules,
        limits,
        ..blank
    })
}

fn geodetic_section(mut section: Section<'_>) -> Result<Geodetic, Fault> {
    let point = geodetic(&mut section)?;
    section.finish()?;
    Ok(point)
}

fn geodetic(section: &mut Section<'_>) -> Result<Geodetic, Fault> {
    Ok(Geodetic {
        latitude_deg: section.required_number("latitude_deg", Takes::Between(-89.9, 89.9))?,
        longitude_deg: section.required_number("longitude_deg", Takes::Between(-180.0, 180.0))?,
    })
}

fn sensor_noise(mut section: Section<'_>) -> Result<SensorNoise, Fault> {
    let sigma_m = section.required_number("sigma_m", SPREAD)?;
    section.finish()?;
    Ok(SensorNoise { sigma_m })
}

/// The tables `[encounters]` and `[compliance]`.
fn rules(root: &mut Section<'_>) -> Result<RulesConfig, Fault> {
    let mut rules = RulesConfig::default();
    if let Some(section) = root.section("encounters")? {
        bounded_numbers(section, rules.encounters.keys())?;
    }
    if let Some(section) = root.section("compliance")? {
        bounded_numbers(section, rules.compliance.keys())?;
    }
    Ok(rules)
}

fn bounded_numbers<const N: usize>(mut section: Section<'_>, keys: [BoundedKey<'_>; N]) -> Result<(), Fault> {
    for (key, value, [least, most]) in keys {
        if let Some(number) = section.number(key, Takes::Between(least, most))? {
            *value = number;
        }
    }
    section.finish()
}

fn own_ship(mut section: Section<'_>, limits: Limits) -> Result<OwnShip, Fault> {
    let name = section.text("name")?;
    let dynamics = dynamics::dynamics(&mut section)?;
    let size = ship_size(&mut section, dynamics.dynamics)?;
    let collision_radius_m = collision_radius(&mut section)?;
    let speed_mps = speed(&mut section, limits)?;
    let steering = match section.section("steering")? {
        Some(written) => steering(written, Steering::suiting(dynamics.dynamics))?,
        None => Steering::suiting(dynamics.dynamics),
    };
    let route = section.sections("route")?.into_iter();
    let route = route.map(|section| route_point(section, limits)).collect::<Result<Vec<_>, Fault>>()?;
    let start = match section.section("head_on")? {
        Some(mut head_on) => {
            let start = OwnStart::HeadOn {
                target: head_on.text("target")?,
                time_to_collision_s: head_on.required_quantity(&TIME_TO_COLLISION, Takes::Positive)?,
            };
            head_on.finish()?;
            start
        }
        None if !route.is_empty() && !section.has_any(&["course_deg"]) => {
            OwnStart::At { point: point(&mut section)?, course: None }
        }
        None => OwnStart::At { point: point(&mut section)?, course: Some(course(&mut section)?) },
    };
    section.finish()?;
    let blank = OwnShip::heading(0.0);
    Ok(OwnShip {
        name: name.unwrap_or(blank.name),
        size: size.unwrap_or_default(),
        collision_radius_m,
        speed_mps,
        start,
        route,
        steering,
        dynamics,
    })
}

fn route_point(mut section: Section<'_>, limits: Limits) -> Result<RoutePoint, Fault> {
    let point = point(&mut section)?;
    let speed_mps = if section.has(&SPEED) { Some(speed(&mut section, limits)?) } else { None };
    section.finish()?;
    Ok(RoutePoint { point, speed_mps })
}

fn steering(mut section: Section<'_>, default: Steering) -> Result<Steering, Fault> {
    let steering = Steering {
        max_turn_deg: section
            .number("max_turn_deg", Takes::Between(0.0, 180.0))?
            .unwrap_or(default.max_turn_deg),
        decision_interval_s: section
            .number("decision_interval_s", Takes::Positive)?
            .unwrap_or(default.decision_interval_s),
        max_speed_change_mps: section
            .quantity(&SPEED_CHANGE, Takes::NotNegative)?
            .unwrap_or(default.max_speed_change_mps),
    };
    section.finish()?;
    Ok(steering)
}

/// Length, beam and bow. A ship of KVLCC2's form has its proportions where they are not written.
fn ship_size(section: &mut Section<'_>, dynamics: Dynamics) -> Result<Option<ShipSize>, Fault> {
    let length = section.number("length_m", Takes::Between(1.0, 600.0))?;
    let beam = section.number("beam_m", Takes::Between(0.5, 120.0))?;
    let bows = [("fine", Bow::Fine), ("normal", Bow::Normal), ("full", Bow::Full)];
    let bow = section.choice("bow", &bows)?;
    let default = match dynamics {
        Dynamics::Kinematic => None,
        Dynamics::Kvlcc2 => Some(length.map_or_else(ShipSize::full_size_kvlcc2, ShipSize::kvlcc2)),
    };
    match (length, beam) {
        (_, None) if default.is_some() => {
            Ok(default.map(|size| ShipSize { bow: bow.unwrap_or(size.bow), ..size }))
        }
        (None, None) if bow.is_none() => Ok(None),
        (Some(length_m), Some(beam_m)) if beam_m <= length_m => {
            let bow = bow.or(default.map(|size| size.bow)).unwrap_or_default();
            Ok(Some(ShipSize { length_m, beam_m, bow }))
        }
        (Some(length_m), Some(beam_m)) => Err(section.fault(
            "beam_m",
            format!("a beam of {beam_m} m is more than the length of {length_m} m"),
            "exchange the two, or correct one",
        )),
        (Some(_), None) => Err(section.missing(&["beam_m".to_owned()])),
        (None, _) => Err(section.missing(&["length_m".to_owned()])),
    }
}

fn collision_radius(section: &mut Section<'_>) -> Result<Option<f64>, Fault> {
    section.number("collision_radius_m", Takes::Between(1.0, 10_000.0))
}

fn targets(sections: Vec<Section<'_>>, directory: &Path, limits: Limits) -> Result<Vec<Target>, Fault> {
    let mut names = BTreeSet::new();
    let mut targets = Vec::with_capacity(sections.len());
    for (index, mut section) in sections.into_iter().enumerate() {
        let name = section.text("name")?.unwrap_or_else(|| format!("target {}", index + 1));
        if !names.insert(name.clone()) {
            return Err(section.fault(
                "name",
                format!("\"{name}\" names two targets"),
                "give each its own name",
            ));
        }
        let dynamics = dynamics::dynamics(&mut section)?;
        let pilot = dynamics::pilot(&mut section, dynamics.dynamics)?;
        let size = ship_size(&mut section, dynamics.dynamics)?;
        let collision_radius_m = collision_radius(&mut section)?;
        let motion = target_motion(&mut section, directory, limits)?;
        section.finish()?;
        targets.push(Target { name, size, collision_radius_m, motion, dynamics, pilot });
    }
    Ok(targets)
}

#[derive(Clone, Copy)]
enum MotionWord {
    Recorded,
    Linear,
    Waypoints,
    Stochastic,
    Periodic,
}

const MOTION_WORDS: [(&str, MotionWord); 5] = [
    ("recorded", MotionWord::Recorded),
    ("linear", MotionWord::Linear),
    ("waypoints", MotionWord::Waypoints),
    ("stochastic", MotionWord::Stochastic),
    ("periodic", MotionWord::Periodic),
];

fn target_motion(section: &mut Section<'_>, directory: &Path, limits: Limits) -> Result<TargetMotion, Fault> {
    let Some(word) = section.choice("motion", &MOTION_WORDS)? else {
        let words = MOTION_WORDS.map(|(word, _)| format!("motion = \"{word}\""));
        return Err(Fault {
            remedy: format!("write {}", super::section::either(&words)),
            ..section.missing(&["motion".to_owned()])
        });
    };
    Ok(match word {
        MotionWord::Recorded => TargetMotion::Recorded(recorded(section, directory)?),
        MotionWord::Linear => TargetMotion::Linear(placement(section, limits)?),
        MotionWord::Waypoints => waypoints(section, limits)?,
        MotionWord::Stochastic => TargetMotion::Stochastic(placement(section, limits)?, stochastic(section)?),
        MotionWord::Periodic => TargetMotion::Periodic(placement(section, limits)?, periodic(section)?),
    })
}

fn recorded(section: &mut Section<'_>, directory: &Path) -> Result<RecordedVessel, Fault> {
    let path = |text: String| directory.join(text);
    let files = section.texts("ais_file")?;
    let area = section.text("area_file")?;
    let tracks = section.text("track_dir")?;
    let source = match (files, area, tracks) {
        (Some(files), Some(area), None) => TrackSource::Ais {
            files: files.into_iter().map(path).collect::<Vec<PathBuf>>(),
            area: path(area),
        },
        (Some(_), None, None) => return Err(section.missing(&["area_file".to_owned()])),
        (None, None, Some(tracks)) => TrackSource::Directory(path(tracks)),
        (None, Some(_), None) => return Err(section.missing(&["ais_file".to_owned()])),
        (None, None, None) => {
            return Err(Fault {
                remedy: "write ais_file and area_file, or track_dir".to_owned(),
                ..section.missing(&["ais_file".to_owned(), "track_dir".to_owned()])
            });
        }
        (_, _, Some(_)) => {
            return Err(section.fault(
                "track_dir",
                "stands beside an AIS file or an area file",
                "write ais_file and area_file, or track_dir alone",
            ));
        }
    };
    Ok(RecordedVessel { source, start: recorded_start(section)? })
}

fn recorded_start(section: &mut Section<'_>) -> Result<RecordedStart, Fault> {
    let mmsi =
        section.integer("mmsi")?.map(u32::try_from).transpose().map_err(|_| {
            section.fault("mmsi", "is too long for an MMSI", "write the nine digits of a vessel")
        })?;
    let rules = [("before its curve", HeadOnKind::BeforeCurve), ("after its curve", HeadOnKind::StraightOn)];
    let rule = section.choice("start", &rules)?;
    let time = section.moment("time")?;
    match (rule, time) {
        (Some(_), Some(_)) => {
            Err(section.fault("time", "stands beside start", "write time or start, not both"))
        }
        (Some(kind), None) => {
            let pick = section.integer("pick")?.map(|pick| usize::try_from(pick).unwrap_or(usize::MAX));
            if pick == Some(0) {
                return Err(section.fault(
                    "pick",
                    "starts are counted from 1",
                    "write 1 or more, or leave it out",
                ));
            }
            Ok(RecordedStart::Rule { kind, mmsi, pick })
        }
        (None, Some(time)) => {
            let unix_s = moment::unix_seconds(&time).ok_or_else(|| {
                section.fault(
                    "time",
                    format!("\"{time}\" is not a date and time"),
                    "write it like 2020-12-03T04:05:06Z",
                )
            })?;
            let mmsi = mmsi.ok_or_else(|| section.missing(&["mmsi".to_owned()]))?;
            Ok(RecordedStart::Time { mmsi, unix_s })
        }
        (None, None) => Err(Fault {
            remedy: "write time and mmsi, or start = \"before its curve\" or \"after its curve\"".to_owned(),
            ..section.missing(&["time".to_owned(), "start".to_owned()])
        }),
    }
}

fn waypoints(section: &mut Section<'_>, limits: Limits) -> Result<TargetMotion, Fault> {
    let sections = section.sections("waypoints")?;
    if sections.len() < 2 {
        return Err(section.fault(
            "waypoints",
            format!("{} waypoints make no route", sections.len()),
            "write two at least: waypoints = [{ north_m = 0, east_m = 0 }, { north_m = 2000, east_m = 0 }]",
        ));
    }
    let common_mps = speed(section, limits)?;
    let mut waypoints: Vec<PlannedWaypoint> = Vec::with_capacity(sections.len());
    for mut waypoint in sections {
        let point = point(&mut waypoint)?;
        let speed_mps = if waypoint.has(&SPEED) { speed(&mut waypoint, limits)? } else { common_mps };
        if speed_mps == 0.0 {
            return Err(waypoint.fault(
                "speed_kn",
                "the ship never gets to the next waypoint",
                "write a speed above 0",
            ));
        }
        waypoint.finish()?;
        waypoints.push(PlannedWaypoint { point, speed_mps });
    }
    Ok(TargetMotion::Waypoints { waypoints })
}

fn stochastic(section: &mut Section<'_>) -> Result<StochasticConfig, Fault> {
    let default = StochasticConfig::default();
    Ok(StochasticConfig {
        phi: section.number("phi", Takes::Between(0.0, 0.9999))?.unwrap_or(default.phi),
        beta: section.number("beta", Takes::Between(0.0001, 1.0))?.unwrap_or(default.beta),
        innovation_sd_m: section.number("innovation_sd_m", SPREAD)?.unwrap_or(default.innovation_sd_m),
        v_max_mps: section.number("v_max_mps", Takes::Between(0.1, 100.0))?.unwrap_or(default.v_max_mps),
        ..default
    })
}

fn periodic(section: &mut Section<'_>) -> Result<PeriodicConfig, Fault> {
    let default = PeriodicConfig::default();
    Ok(PeriodicConfig {
        amplitude_s: section.number("amplitude_s", SPREAD)?.unwrap_or(default.amplitude_s),
        period_steps: section
            .number("period_steps", Takes::Between(2.0, 100_000.0))?
            .unwrap_or(default.period_steps),
        noise_sd_m: section.number("noise_sd_m", SPREAD)?.unwrap_or(default.noise_sd_m),
        ..default
    })
}

fn placement(section: &mut Section<'_>, limits: Limits) -> Result<Placement, Fault> {
    let by_point = section.has_any(&POINT_KEYS);
    let by_bearing = section.has_any(&BEARING_KEYS);
    let by_cpa = section.has(&DCPA) | section.has(&TCPA);
    if by_point && !by_bearing && !by_cpa {
        let (point, course) = (point(section)?, course(section)?);
        return Ok(Placement::At { point, course, speed_mps: speed(section, limits)? });
    }
    if by_point {
        let key = POINT_KEYS.into_iter().find(|key| section.value(key).is_some()).unwrap_or("north_m");
        return Err(section.fault(
            key,
            "stands beside another placement",
            "place the target by its position, or by bearing, DCPA and TCPA, not both",
        ));
    }
    relative_placement(section, by_bearing, by_cpa, limits).map(Placement::FromOwnShip)
}

fn relative_placement(
    section: &mut Section<'_>,
    by_bearing: bool,
    by_cpa: bool,
    limits: Limits,
) -> Result<RelativePlacement, Fault> {
    let by_course = section.has_any(&["course_deg"]) | section.has(&SPEED);
    match (by_bearing, by_cpa) {
        (true, true) if by_course => Err(section.fault(
            "dcpa_m",
            "bearing, range, course and speed already say how close the target comes",
            "remove DCPA and TCPA, or course and speed",
        )),
        (true, false) if !by_course => Err(section.fault(
            "course_deg",
            "nothing says how the target moves",
            "write course_deg and speed_kn, or dcpa_m and tcpa_s",
        )),
        (true, true) => Ok(RelativePlacement::SeenWithCpa {
            bearing: bearing(section)?,
            range_m: section.required_quantity(&RANGE, Takes::Positive)?,
            cpa: wanted_cpa(section)?,
        }),
        (true, false) => Ok(RelativePlacement::Seen {
            bearing: bearing(section)?,
            range_m: section.required_quantity(&RANGE, Takes::Positive)?,
            course: course(section)?,
            speed_mps: speed(section, limits)?,
        }),
        (false, true) => Ok(RelativePlacement::CourseWithCpa {
            course: course(section)?,
            speed_mps: speed(section, limits)?,
            cpa: wanted_cpa(section)?,
        }),
        (false, false) => Err(Fault {
            remedy: "write north_m and east_m, latitude_deg and longitude_deg, bearing_deg and range_m, \
                     or dcpa_m and tcpa_s"
                .to_owned(),
            ..section.missing(&POINT_KEYS.map(str::to_owned))
        }),
    }
}

fn wanted_cpa(section: &mut Section<'_>) -> Result<WantedCpa, Fault> {
    Ok(WantedCpa {
        dcpa_m: section.required_quantity(&DCPA, Takes::NotNegative)?,
        tcpa_s: section.required_quantity(&TCPA, Takes::Positive)?,
        passes: section.choice("passes", &Passes::WORDS)?,
    })
}

fn bearing(section: &mut Section<'_>) -> Result<Bearing, Fault> {
    let from_north = section.number("bearing_deg", FULL_TURN)?;
    let relative = section.number("relative_bearing_deg", FULL_TURN)?;
    match (from_north, relative) {
        (Some(bearing_deg), None) => Ok(Bearing::True(Nautical::from_degrees(bearing_deg))),
        (None, Some(bearing_deg)) => Ok(Bearing::Relative(bearing_deg.to_radians())),
        (None, None) => Err(section.missing(&BEARING_KEYS.map(str::to_owned))),
        (Some(_), Some(_)) => Err(section.fault(
            "relative_bearing_deg",
            "says the same as bearing_deg",
            "write bearing_deg (from north) or relative_bearing_deg (from own ship's course), not both",
        )),
    }
}

fn point(section: &mut Section<'_>) -> Result<Point, Fault> {
    let local = section.has_any(&["north_m", "east_m"]);
    let on_earth = section.has_any(&["latitude_deg", "longitude_deg"]);
    match (local, on_earth) {
        (true, true) => Err(section.fault(
            "latitude_deg",
            "stands beside a local position",
            "write latitude_deg and longitude_deg, or north_m and east_m",
        )),
        (false, true) => Ok(Point::Geodetic(geodetic(section)?)),
        (true, false) => Ok(Point::Local(Position {
            north_m: section.required_number("north_m", Takes::Any)?,
            east_m: section.required_number("east_m", Takes::Any)?,
        })),
        (false, false) => Err(Fault {
            remedy: "write north_m and east_m, or latitude_deg and longitude_deg".to_owned(),
            ..section.missing(&POINT_KEYS.map(str::to_owned))
        }),
    }
}

fn course(section: &mut Section<'_>) -> Result<Nautical, Fault> {
    section.required_number("course_deg", FULL_TURN).map(Nautical::from_degrees)
}

pub(super) fn speed(section: &mut Section<'_>, limits: Limits) -> Result<f64, Fault> {
    section.required_quantity(&SPEED, Takes::NotNegative).and_then(|speed_mps| {
        if speed_mps <= limits.speed_max_mps {
            return Ok(speed_mps);
        }
        let key = if section.has_any(&["speed_kn"]) { "speed_kn" } else { "speed_mps" };
        let most_mps = limits.speed_max_mps;
        Err(section.fault(
            key,
            format!("{speed_mps:.1} m/s is more than the {most_mps:.0} m/s allowed"),
            format!(
                "write {most_mps:.0} m/s ({:.0} kn) at most",
                (most_mps / crate::geo::MPS_PER_KNOT).floor()
            ),
        ))
    })
}
