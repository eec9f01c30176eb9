//! From a scenario to a traffic situation.

use serde::Serialize;
use thiserror::Error;

use super::{AT_ANCHOR, UNDER_WAY, VERSION};
use crate::geo::{Geodetic, LocalPlane, MPS_PER_KNOT, Position};
use crate::scenario::{OwnShip, PlacedTarget, Point, StagedEncounter, TargetMotion};
use crate::vessel::{VesselState, Waypoint};
use crate::world::{Hull, VesselBody};

/// Why a scenario is no traffic situation.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ExportError {
    /// It lies in a plane that is nowhere on the earth.
    #[error("the scenario has no place on the earth: write [origin] with latitude_deg and longitude_deg")]
    Nowhere,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Situation {
    version: &'static str,
    title: String,
    description: String,
    own_ship: Ship,
    target_ships: Vec<Ship>,
    #[serde(skip_serializing_if = "Option::is_none")]
    environment: Option<Environment>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Ship {
    #[serde(rename = "static")]
    fixed: Fixed,
    initial: Initial,
    waypoints: Vec<WrittenWaypoint>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Fixed {
    id: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    mmsi: Option<u32>,
    name: String,
    dimensions: Dimensions,
    path_type: &'static str,
}

/// Length and width about the reference point: metres to bow, stern, port and starboard.
#[derive(Serialize)]
struct Dimensions {
    length: f64,
    width: f64,
    a: f64,
    b: f64,
    c: f64,
    d: f64,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Initial {
    position: WrittenPosition,
    sog: f64,
    cog: f64,
    heading: f64,
    nav_status: &'static str,
}

#[derive(Serialize)]
struct WrittenPosition {
    lon: f64,
    lat: f64,
}

#[derive(Serialize)]
struct WrittenWaypoint {
    position: WrittenPosition,
    #[serde(skip_serializing_if = "Option::is_none")]
    leg: Option<Leg>,
}

/// The leg that ends at a waypoint.
#[derive(Serialize)]
struct Leg {
    sog: f64,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Environment {
    wind_speed: f64,
    wind_direction: f64,
    current_speed: f64,
    current_direction: f64,
}

/// The traffic situation of a scenario, as JSON.
///
/// Ships on a course get a second waypoint where they are at the end; ships whose motion is recorded or
/// random get one for each time step, which is exact, since they move in straight lines in between.
/// Ships with dynamics are written as planned, not as sailed.
///
/// # Errors
/// A scenario without an origin on the earth.
pub fn export(staged: &StagedEncounter) -> Result<String, ExportError> {
    let scenario = &staged.scenario;
    let frame = Frame { plane: staged.plane.ok_or(ExportError::Nowhere)? };
    let targets = staged.targets.iter().zip(&scenario.targets).enumerate();
    let target_ships = targets
        .map(|(index, (placed, target))| {
            let waypoints = frame.target_way(staged, placed, &target.motion);
            frame.ship(index + 2, &placed.name, placed.mmsi, &placed.body, placed.motion.state(0), waypoints)
        })
        .collect();
    let own_way = frame.own_way(staged, &scenario.own_ship);
    let situation = Situation {
        version: VERSION,
        title: scenario.title.clone(),
        description: scenario.description.clone(),
        own_ship: frame.ship(1, &scenario.own_ship.name, None, &staged.own_body, staged.own_start, own_way),
        target_ships,
        environment: environment(staged),
    };
    // Numbers, texts and lists alone: there is nothing in it that JSON cannot say.
    Ok(serde_json::to_string_pretty(&situation).unwrap_or_default() + "\n")
}

fn environment(staged: &StagedEncounter) -> Option<Environment> {
    let surroundings = &staged.scenario.surroundings;
    if *surroundings == Default::default() {
        return None;
    }
    let wind = surroundings.wind;
    Some(Environment {
        wind_speed: wind.map_or(0.0, |wind| rounded(wind.speed_mps)),
        wind_direction: wind.map_or(0.0, |wind| direction(wind.from.degrees())),
        current_speed: rounded(surroundings.current.speed_mps()),
        current_direction: direction(surroundings.current.course().degrees()),
    })
}

/// Nine decimals: a tenth of a millimetre in degrees of latitude.
fn rounded(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

/// Four decimals of a degree: a course that was computed from positions settles.
fn direction(degrees: f64) -> f64 {
    (degrees * 1e4).round() / 1e4
}

fn knots(speed_mps: f64) -> f64 {
    rounded(speed_mps / MPS_PER_KNOT)
}

struct Frame {
    plane: LocalPlane,
}

impl Frame {
    fn written(&self, position: Position) -> WrittenPosition {
        let Geodetic { latitude_deg, longitude_deg } = self.plane.unproject(position);
        WrittenPosition { lon: rounded(longitude_deg), lat: rounded(latitude_deg) }
    }

    fn position(&self, point: Point) -> Position {
        match point {
            Point::Local(position) => position,
            Point::Geodetic(point) => self.plane.project(point),
        }
    }

    fn ship(
        &self,
        id: usize,
        name: &str,
        mmsi: Option<u32>,
        body: &VesselBody,
        start: VesselState,
        way: Vec<Waypoint>,
    ) -> Ship {
        let dimensions = dimensions(&body.hull);
        let is_moving = start.velocity.speed_mps() > 0.0;
        let legs = std::iter::once(None).chain(way.iter().map(|waypoint| Some(waypoint.speed_mps)));
        let waypoints = way.iter().zip(legs).map(|(waypoint, leg_mps)| WrittenWaypoint {
            position: self.written(waypoint.position),
            leg: leg_mps.map(|speed_mps| Leg { sog: knots(speed_mps) }),
        });
        Ship {
            fixed: Fixed { id, mmsi, name: name.to_owned(), dimensions, path_type: "linear" },
            initial: Initial {
                position: self.written(start.position),
                sog: knots(start.velocity.speed_mps()),
                cog: direction(start.velocity.course().degrees()),
                heading: direction(start.heading.degrees()),
                nav_status: if is_moving { UNDER_WAY } else { AT_ANCHOR },
            },
            waypoints: waypoints.collect(),
        }
    }

    fn own_way(&self, staged: &StagedEncounter, own: &OwnShip) -> Vec<Waypoint> {
        let start = staged.own_start;
        let mut speed_mps = own.speed_mps;
        let mut way = vec![Waypoint { position: start.position, speed_mps }];
        for waypoint in &own.route {
            speed_mps = waypoint.speed_mps.unwrap_or(speed_mps);
            way.push(Waypoint { position: self.position(waypoint.point), speed_mps });
        }
        if own.route.is_empty() {
            return straight(start, staged.scenario.duration_s);
        }
        way
    }

    fn target_way(
        &self,
        staged: &StagedEncounter,
        placed: &PlacedTarget,
        motion: &TargetMotion,
    ) -> Vec<Waypoint> {
        match motion {
            TargetMotion::Linear(_) => straight(placed.motion.state(0), staged.scenario.duration_s),
            TargetMotion::Waypoints { waypoints } => waypoints
                .iter()
                .map(|waypoint| Waypoint {
                    position: self.position(waypoint.point),
                    speed_mps: waypoint.speed_mps,
                })
                .collect(),
            TargetMotion::Recorded(_) | TargetMotion::Stochastic(..) | TargetMotion::Periodic(..) => {
                sampled(placed, staged.scenario.steps() as i64, staged.scenario.dt_s)
            }
        }
    }
}

fn dimensions(hull: &Hull) -> Dimensions {
    let (length, width) = (hull.length_m(), hull.beam_m());
    Dimensions { length, width, a: length / 2.0, b: length / 2.0, c: width / 2.0, d: width / 2.0 }
}

/// From a start to where the ship is at the end; the start alone where it lies still.
fn straight(start: VesselState, duration_s: f64) -> Vec<Waypoint> {
    let speed_mps = start.velocity.speed_mps();
    let end = start.position + start.velocity.for_seconds(duration_s);
    let positions = if speed_mps > 0.0 { vec![start.position, end] } else { vec![start.position] };
    positions.into_iter().map(|position| Waypoint { position, speed_mps }).collect()
}

/// A waypoint for each time step at which the ship has moved on.
fn sampled(placed: &PlacedTarget, steps: i64, dt_s: f64) -> Vec<Waypoint> {
    // Waypoints nearer than this are read as one.
    const APART_M: f64 = 1.0;
    let mut way = vec![Waypoint { position: placed.motion.position(0), speed_mps: 0.0 }];
    let mut since = 0;
    for step in 1..=steps {
        let position = placed.motion.position(step);
        let Some(last) = way.last_mut() else { break };
        let distance_m = position.distance_m(last.position);
        if distance_m > APART_M {
            last.speed_mps = distance_m / ((step - since) as f64 * dt_s);
            let speed_mps = last.speed_mps;
            way.push(Waypoint { position, speed_mps });
            since = step;
        }
    }
    way
}
