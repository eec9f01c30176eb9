//! From a traffic situation to a scenario.

use std::collections::BTreeMap;
use std::path::Path;

use super::node::{Document, Node, Object};
use crate::angle::Nautical;
use crate::config::ConfigError;
use crate::geo::{Geodetic, LocalPlane, MPS_PER_KNOT, Velocity};
use crate::scenario::{
    Limits, OwnShip, OwnStart, Placement, PlannedWaypoint, Point, RoutePoint, Scenario, ShipSize, Steering,
    Target, TargetMotion,
};
use crate::vessel::mmg::{Surroundings, Wind};
use crate::vessel::{Dynamics, DynamicsConfig, Kvlcc2Config};

/// What a traffic situation does not say.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportOptions {
    /// Who steers own ship.
    pub policy: String,
    /// Time simulated, in seconds; where it is not given, what own ship needs for its route.
    pub duration_s: Option<f64>,
    /// Time simulated where own ship has no route, in seconds.
    pub default_duration_s: f64,
    /// How often own ship asks its policy, and how much each answer changes.
    pub steering: Steering,
    /// How ships under way move.
    pub dynamics: Dynamics,
    /// Waypoints nearer to each other than this are one, in metres.
    pub same_place_m: f64,
    /// An initial course this far from that of the first leg is worth a note, in degrees.
    pub course_tolerance_deg: f64,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self {
            policy: "rule-based".to_owned(),
            duration_s: None,
            default_duration_s: 1800.0,
            steering: Steering { max_turn_deg: 10.0, decision_interval_s: 10.0, ..Steering::default() },
            dynamics: Dynamics::default(),
            same_place_m: 1.0,
            course_tolerance_deg: 5.0,
        }
    }
}

/// A scenario, and what of the traffic situation is not in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// The scenario.
    pub scenario: Scenario,
    /// What was left out or changed, a line each.
    pub notes: Vec<String>,
}

/// Reads a traffic situation. `file` names it in errors and gives the scenario its name.
///
/// # Errors
/// What is not JSON, or no traffic situation; names file, line and key and says what to write.
pub fn import(text: &str, file: &Path, options: &ImportOptions) -> Result<Import, ConfigError> {
    let document = Document::parse(file, text)?;
    let mut reader = Reader { options, surroundings: Surroundings::default(), notes: Notes::default() };
    let scenario = reader.situation(&document, file)?;
    Ok(Import { scenario, notes: reader.notes.lines() })
}

/// What was left out: the places, by what is said of them.
#[derive(Default)]
struct Notes(BTreeMap<String, Vec<String>>);

impl Notes {
    fn add(&mut self, what: &str, place: impl Into<String>) {
        self.0.entry(what.to_owned()).or_default().push(place.into());
    }

    fn left_out(&mut self, why: &str, object: &Object<'_>) {
        let prefix = object.node().path();
        for key in object.unread() {
            let place = if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") };
            self.add(&format!("left out, {why}"), place);
        }
    }

    fn lines(self) -> Vec<String> {
        self.0.into_iter().map(|(what, places)| format!("{what}: {}", places.join(", "))).collect()
    }
}

/// A ship as the file has it.
struct Ship {
    name: Option<String>,
    size: Option<ShipSize>,
    /// What is known of the start.
    initial: Initial,
    /// Where it goes from its start on, and how fast from there on, in metres per second.
    legs: Vec<PlannedWaypoint>,
    geodetic: Vec<Geodetic>,
}

#[derive(Default)]
struct Initial {
    position: Option<Geodetic>,
    speed_mps: Option<f64>,
    course: Option<Nautical>,
}

/// A waypoint with what is said of the legs on either side of it, in metres per second.
struct Way {
    position: Geodetic,
    speed_to_mps: Option<f64>,
    speed_from_mps: Option<f64>,
}

struct Reader<'o> {
    options: &'o ImportOptions,
    surroundings: Surroundings,
    notes: Notes,
}

impl Reader<'_> {
    fn situation(&mut self, document: &Node<'_>, file: &Path) -> Result<Scenario, ConfigError> {
        let mut root = document.object()?;
        root.get(&["version"]);
        let name = file.file_stem().map_or_else(|| "situation".into(), |stem| stem.to_string_lossy());
        let title = root.get(&["title"]).map(|title| title.text()).transpose()?;
        let description = root.get(&["description"]).map(|text| text.text()).transpose()?;
        let own_node = root.get(&["ownShip"]).ok_or_else(|| {
            let slip = root.unread().find(|key| key.eq_ignore_ascii_case("ownship") || *key == "own_ship");
            let remedy = match slip {
                Some(key) => format!("write \"ownShip\" in place of \"{key}\""),
                None => "give a traffic situation of maritime-schema".to_owned(),
            };
            document.error("\"ownShip\" is missing: this is no traffic situation", remedy)
        })?;
        if let Some(environment) = root.get(&["environment"]) {
            self.surroundings = self.environment(&environment)?;
        }
        let own = self.ship(&own_node)?;
        let own_start = own.start(&own_node)?;
        let plane = LocalPlane::at(own_start);
        let mut scenario = Scenario::new(&name, self.own_ship(&own_node, &own, own_start)?);
        scenario.title = title.unwrap_or_else(|| name.to_string());
        scenario.description = description.unwrap_or_default();
        scenario.origin = Some(own_start);
        scenario.policy.clone_from(&self.options.policy);
        scenario.surroundings = self.surroundings;
        let targets = root.get(&["targetShips", "targetShip"]).map(|list| list.list()).transpose()?;
        for (index, node) in targets.unwrap_or_default().iter().enumerate() {
            let target = self.target(node, index, &scenario.targets)?;
            scenario.targets.push(target);
        }
        scenario.duration_s = self.duration_s(&scenario, &own, plane);
        self.notes.left_out("a scenario has no place for it", &root);
        Ok(scenario)
    }

    /// A whole number of time steps.
    fn duration_s(&self, scenario: &Scenario, own: &Ship, plane: LocalPlane) -> f64 {
        let route_s = || {
            let positions: Vec<_> = own.geodetic.iter().map(|point| plane.project(*point)).collect();
            let legs = positions.windows(2).zip(&own.legs);
            let seconds: f64 = legs.map(|(ends, leg)| ends[0].distance_m(ends[1]) / leg.speed_mps).sum();
            (seconds > 0.0 && seconds.is_finite()).then_some(seconds)
        };
        let wanted_s = self.options.duration_s.or_else(route_s).unwrap_or(self.options.default_duration_s);
        let most = Limits::default().steps_max as f64;
        (wanted_s / scenario.dt_s - 1e-9).ceil().clamp(1.0, most) * scenario.dt_s
    }

    fn own_ship(&mut self, node: &Node<'_>, ship: &Ship, start: Geodetic) -> Result<OwnShip, ConfigError> {
        let first_leg = ship.first_leg();
        let course = match (ship.initial.course, first_leg) {
            (Some(course), _) => course,
            (None, Some(leg)) => leg,
            (None, None) => {
                return Err(node.error(
                    "nothing says where own ship goes",
                    "add \"initial\" with \"cog\", or a second waypoint",
                ));
            }
        };
        let leg_mps = ship.legs.first().map(|leg| leg.speed_mps);
        let speed_mps = ship.initial.speed_mps.or(leg_mps).ok_or_else(|| no_speed(node))?;
        let blank = OwnShip::heading(0.0);
        // The speed of a leg is worth writing where it is another than before.
        let mut last_mps = speed_mps;
        let mut planned = |speed_mps: f64| {
            let changes = speed_mps != std::mem::replace(&mut last_mps, speed_mps);
            changes.then_some(speed_mps)
        };
        let first_mps = ship.legs.first().and_then(|leg| planned(leg.speed_mps));
        let beyond = ship.legs.iter().skip(1);
        let route: Vec<RoutePoint> =
            beyond.map(|leg| RoutePoint { point: leg.point, speed_mps: planned(leg.speed_mps) }).collect();
        if let Some(first_mps) = first_mps.filter(|_| !route.is_empty()) {
            let (first_kn, speed_kn) = (first_mps / MPS_PER_KNOT, speed_mps / MPS_PER_KNOT);
            let place = node.path();
            let place = format!("{place}.initial.sog, {speed_kn:.1} kn instead of {first_kn:.1} kn");
            self.notes.add("the first leg is begun at the initial speed", place);
        }
        let speeds = ship.legs.iter().map(|leg| leg.speed_mps).fold(speed_mps, f64::max);
        Ok(OwnShip {
            name: ship.name.clone().unwrap_or(blank.name.clone()),
            size: self.size(ship.size, speeds).unwrap_or_default(),
            speed_mps,
            start: OwnStart::At { point: Point::Geodetic(start), course: Some(course) },
            route,
            steering: self.options.steering,
            dynamics: self.dynamics(self.size(ship.size, speeds).unwrap_or_default(), speeds),
            ..blank
        })
    }

    fn target(&mut self, node: &Node<'_>, index: usize, others: &[Target]) -> Result<Target, ConfigError> {
        let ship = self.ship(node)?;
        let start = ship.start(node)?;
        let fastest_mps = ship.legs.iter().map(|leg| leg.speed_mps).fold(0.0, f64::max);
        let motion = if ship.legs.len() >= 2 && fastest_mps > 0.0 {
            if let Some(standing) = ship.legs.iter().position(|leg| leg.speed_mps <= 0.0) {
                return Err(node.error(
                    format!("a speed of 0 on leg {} never leads to the next waypoint", standing + 1),
                    "write a speed above 0, or end the waypoints there",
                ));
            }
            if let Some((course, leg)) = ship.initial.course.zip(ship.first_leg()) {
                let off_deg = course.turn_from(leg).to_degrees().abs();
                if off_deg > self.options.course_tolerance_deg {
                    let place = format!("{}.initial.cog, {off_deg:.0} degrees off", node.path());
                    self.notes.add("starts on the course of its first leg", place);
                }
            }
            TargetMotion::Waypoints { waypoints: ship.legs.clone() }
        } else {
            let course = ship.initial.course.or(ship.first_leg()).unwrap_or(Nautical::NORTH);
            let leg_mps = ship.legs.first().map(|leg| leg.speed_mps);
            let speed_mps = ship.initial.speed_mps.or(leg_mps).ok_or_else(|| no_speed(node))?;
            TargetMotion::Linear(Placement::At { point: Point::Geodetic(start), course, speed_mps })
        };
        let wanted = ship.name.clone().unwrap_or_else(|| format!("target {}", index + 1));
        let is_taken = |name: &str| others.iter().any(|other| other.name == name);
        let mut name = wanted.clone();
        let mut count = 1;
        while is_taken(&name) {
            count += 1;
            name = format!("{wanted} ({count})");
        }
        let speed_mps = fastest_mps.max(ship.initial.speed_mps.unwrap_or(0.0));
        let size = self.size(ship.size, speed_mps);
        let dynamics = self.dynamics(size.unwrap_or_default(), speed_mps);
        Ok(Target { size, dynamics, ..Target::new(&name, motion) })
    }

    /// What moves how in this import: a ship that lies still needs no dynamics.
    fn kind(&self, speed_mps: f64) -> Dynamics {
        if speed_mps > 0.0 { self.options.dynamics } else { Dynamics::Kinematic }
    }

    fn size(&self, size: Option<ShipSize>, speed_mps: f64) -> Option<ShipSize> {
        size.or_else(|| match self.kind(speed_mps) {
            Dynamics::Kinematic => None,
            Dynamics::Kvlcc2 => Some(ShipSize::full_size_kvlcc2()),
        })
    }

    /// With an engine that is strong enough, against the current too.
    fn dynamics(&self, size: ShipSize, speed_mps: f64) -> DynamicsConfig {
        let kvlcc2 = Kvlcc2Config { length_m: size.length_m, ..Kvlcc2Config::default() };
        let most_mps = speed_mps + self.surroundings.current.speed_mps();
        let is_too_weak = self.kind(speed_mps) == Dynamics::Kvlcc2 && kvlcc2.top_speed_mps() < most_mps;
        let service_speed_mps = is_too_weak.then_some(most_mps);
        let kvlcc2 = Kvlcc2Config { service_speed_mps, ..Kvlcc2Config::default() };
        DynamicsConfig { dynamics: self.kind(speed_mps), kvlcc2 }
    }

    fn environment(&mut self, node: &Node<'_>) -> Result<Surroundings, ConfigError> {
        let mut object = node.object()?;
        let mut pair = |speed: &'static str, direction: &'static str, most_mps: f64| {
            let speed = object.get(&[speed]);
            let direction_node = object.get(&[direction]);
            match (speed, direction_node) {
                (None, _) => Ok(None),
                (Some(speed), None) => Err(speed
                    .error(format!("\"{direction}\" is missing beside it"), format!("add \"{direction}\""))),
                (Some(speed), Some(towards)) => {
                    let speed_mps = speed.number(0.0, most_mps)?;
                    Ok(Some((speed_mps, Nautical::from_degrees(towards.number(-360.0, 360.0)?))))
                }
            }
        };
        let wind = pair("windSpeed", "windDirection", 100.0)?.filter(|(speed_mps, _)| *speed_mps > 0.0);
        let current = pair("currentSpeed", "currentDirection", Limits::default().speed_max_mps)?;
        self.notes.left_out("nothing here feels it", &object);
        let surroundings = Surroundings {
            current: current.map_or(Velocity::default(), |(speed_mps, towards)| {
                Velocity::from_course(towards, speed_mps)
            }),
            wind: wind.map(|(speed_mps, from)| Wind { from, speed_mps }),
        };
        if self.options.dynamics == Dynamics::Kinematic && surroundings != Surroundings::default() {
            self.notes.add(
                "left out, since kinematic ships do not feel them",
                format!("{}, wind and current", node.path()),
            );
            return Ok(Surroundings::default());
        }
        Ok(surroundings)
    }

    fn ship(&mut self, node: &Node<'_>) -> Result<Ship, ConfigError> {
        let mut object = node.object()?;
        let (mut name, mut size) = (None, None);
        let mut most_mps = None;
        if let Some(fixed) = object.get(&["static"]) {
            let mut fixed = fixed.object()?;
            name = fixed.get(&["name"]).map(|name| name.text()).transpose()?.filter(|name| !name.is_empty());
            size = self.ship_size(&mut fixed)?;
            most_mps = fixed.get(&["sogMax", "speedMax"]).map(|node| speed(&node)).transpose()?;
            refuse_what_is_not_done(&mut fixed)?;
            self.notes.left_out("ships have no such particulars here", &fixed);
        }
        let initial = object.get(&["initial"]).map(|node| self.initial(&node)).transpose()?;
        let initial = initial.unwrap_or_default();
        let ways = match object.get(&["waypoints"]) {
            Some(list) => {
                list.list()?.iter().map(|node| self.waypoint(node)).collect::<Result<Vec<_>, _>>()?
            }
            None => Vec::new(),
        };
        self.notes.left_out("a scenario has no place for it", &object);
        let (geodetic, legs) = self.legs(node, &initial, ways, most_mps)?;
        Ok(Ship { name, size, initial, legs, geodetic })
    }

    fn ship_size(&mut self, fixed: &mut Object<'_>) -> Result<Option<ShipSize>, ConfigError> {
        let read = |object: &mut Object<'_>| -> Result<Option<ShipSize>, ConfigError> {
            let (length, width) = (object.get(&["length"]), object.get(&["width", "beam"]));
            let (Some(length), Some(width)) = (length, width) else { return Ok(None) };
            let (length_m, beam_m) = (length.number(1.0, 600.0)?, width.number(0.5, 120.0)?);
            if beam_m > length_m {
                return Err(width.error(
                    format!("a width of {beam_m} m is more than the length of {length_m} m"),
                    "exchange the two, or correct one",
                ));
            }
            Ok(Some(ShipSize { length_m, beam_m, ..ShipSize::default() }))
        };
        let size = read(fixed)?;
        let Some(dimensions) = fixed.get(&["dimensions"]) else { return Ok(size) };
        let mut dimensions = dimensions.object()?;
        let own = read(&mut dimensions)?;
        self.notes.left_out("hulls have length and width, about their middle", &dimensions);
        Ok(own.or(size))
    }

    fn initial(&mut self, node: &Node<'_>) -> Result<Initial, ConfigError> {
        let mut object = node.object()?;
        let position = object.get(&["position"]).map(|node| self.position(&node).map(|(at, _)| at));
        let speed_mps = object.get(&["sog"]).map(|node| speed(&node)).transpose()?;
        let mut angle = |name| -> Result<Option<Nautical>, ConfigError> {
            let degrees = object.get(&[name]).map(|node| node.number(-360.0, 360.0)).transpose()?;
            Ok(degrees.map(Nautical::from_degrees))
        };
        let (course, heading) = (angle("cog")?, angle("heading")?);
        object.get(&["navStatus"]);
        self.notes.left_out("a scenario has no place for it", &object);
        if let Some((course, heading)) = course.zip(heading)
            && heading.turn_from(course).to_degrees().abs() > 1e-6
        {
            let place = format!("{}.heading", node.path());
            self.notes.add("left out, ships head the way they go, or as a current asks", place);
        }
        Ok(Initial { position: position.transpose()?, speed_mps, course: course.or(heading) })
    }

    fn waypoint(&mut self, node: &Node<'_>) -> Result<Way, ConfigError> {
        let mut object = node.object()?;
        let (position, position_data) = self.position(&object.require(&["position"])?)?;
        let data = object.get(&["data"]).map(|node| self.leg_data(&node)).transpose()?.flatten();
        let leg = object.get(&["leg"]).map(|node| self.leg(&node)).transpose()?.flatten();
        let radius = object.get(&["turnRadius"]).map(|node| node.number(0.0, f64::MAX)).transpose()?;
        if radius.is_some_and(|radius| radius > 0.0) {
            let place = format!("{}.turnRadius", node.path());
            self.notes.add("left out, ships turn as their dynamics let them", place);
        }
        self.notes.left_out("a scenario has no place for it", &object);
        Ok(Way { position, speed_to_mps: leg, speed_from_mps: data.or(position_data) })
    }

    /// The speed that a leg is sailed at.
    fn leg(&mut self, node: &Node<'_>) -> Result<Option<f64>, ConfigError> {
        let mut object = node.object()?;
        let data = object.get(&["data"]).map(|node| self.leg_data(&node)).transpose()?.flatten();
        let plain = object.get(&["sog"]).map(|node| speed(&node)).transpose()?;
        self.notes.left_out("a scenario has no place for it", &object);
        Ok(data.or(plain))
    }

    /// The speed among the data of a leg.
    fn leg_data(&mut self, node: &Node<'_>) -> Result<Option<f64>, ConfigError> {
        let mut object = node.object()?;
        let Some(sog) = object.get(&["sog"]) else {
            self.notes.left_out("a scenario has no place for it", &object);
            return Ok(None);
        };
        self.notes.left_out("a scenario has no place for it", &object);
        if sog.is_number() {
            return speed(&sog).map(Some);
        }
        let mut point = sog.object()?;
        let value = speed(&point.require(&["value"])?)?;
        for names in [["interpStart", "mBeforeLegChange"], ["interpEnd", "mAfterLegChange"]] {
            let distance = point.get(&names).map(|node| node.number(0.0, f64::MAX)).transpose()?;
            if distance.is_some_and(|distance| distance > 0.0) {
                self.notes.add("speeds change at the waypoint, or as dynamics let them", sog.path());
            }
        }
        point.get(&["interpMethod"]);
        self.notes.left_out("a scenario has no place for it", &point);
        Ok(Some(value))
    }

    /// A position, and the speed that old files misplaced into it.
    fn position(&mut self, node: &Node<'_>) -> Result<(Geodetic, Option<f64>), ConfigError> {
        let mut object = node.object()?;
        if object.get(&["north", "east"]).is_some() {
            return Err(node.error(
                "has north and east beside radians, as ship-traffic-generator wrote before its version 0.3.0",
                "write lat and lon in degrees alone, and every speed in knots",
            ));
        }
        let latitude_deg = object.require(&["lat", "latitude"])?.number(-89.9, 89.9)?;
        let longitude_deg = object.require(&["lon", "longitude"])?.number(-180.0, 180.0)?;
        let data = object.get(&["data"]).map(|node| self.leg_data(&node)).transpose()?.flatten();
        self.notes.left_out("a scenario has no place for it", &object);
        Ok((Geodetic { latitude_deg, longitude_deg }, data))
    }

    /// Where a ship goes from its start on, with a speed for every leg.
    fn legs(
        &self,
        node: &Node<'_>,
        initial: &Initial,
        ways: Vec<Way>,
        most_mps: Option<f64>,
    ) -> Result<(Vec<Geodetic>, Vec<PlannedWaypoint>), ConfigError> {
        let start =
            initial.position.map(|position| Way { position, speed_to_mps: None, speed_from_mps: None });
        let mut apart: Vec<Way> = Vec::new();
        for way in start.into_iter().chain(ways) {
            match apart.last_mut() {
                Some(last) if self.is_same(last.position, way.position) => {
                    last.speed_from_mps = way.speed_from_mps.or(last.speed_from_mps);
                }
                _ => apart.push(way),
            }
        }
        if apart.len() < 2 {
            return Ok((apart.iter().map(|way| way.position).collect(), Vec::new()));
        }
        let mut speed_mps = initial.speed_mps;
        let mut legs = Vec::with_capacity(apart.len());
        for (index, way) in apart.iter().enumerate() {
            let next = apart.get(index + 1).and_then(|next| next.speed_to_mps);
            speed_mps = next.or(way.speed_from_mps).or(speed_mps).or(most_mps);
            let speed_mps = speed_mps.ok_or_else(|| no_speed(node))?;
            legs.push(PlannedWaypoint { point: Point::Geodetic(way.position), speed_mps });
        }
        Ok((apart.iter().map(|way| way.position).collect(), legs))
    }

    fn is_same(&self, one: Geodetic, other: Geodetic) -> bool {
        let apart = LocalPlane::at(one).project(other);
        apart.distance_m(crate::geo::Position::ORIGIN) < self.options.same_place_m
    }
}

impl Ship {
    fn start(&self, node: &Node<'_>) -> Result<Geodetic, ConfigError> {
        self.geodetic.first().copied().ok_or_else(|| {
            node.error("nothing says where it starts", "add \"initial\" with \"position\", or \"waypoints\"")
        })
    }

    /// Course of the first leg.
    fn first_leg(&self) -> Option<Nautical> {
        let [first, second, ..] = self.geodetic[..] else { return None };
        let ahead = LocalPlane::at(first).project(second);
        Some((ahead - crate::geo::Position::ORIGIN).bearing())
    }
}

/// A speed in knots, in metres per second.
fn speed(node: &Node<'_>) -> Result<f64, ConfigError> {
    let most_kn = (Limits::default().speed_max_mps / MPS_PER_KNOT).floor();
    node.number(0.0, most_kn).map(|speed_kn| speed_kn * MPS_PER_KNOT)
}

fn no_speed(node: &Node<'_>) -> ConfigError {
    node.error("nothing says how fast it goes", "add \"initial\" with \"sog\", or \"sog\" to each \"leg\"")
}

/// Particulars that would change where the ship is.
fn refuse_what_is_not_done(fixed: &mut Object<'_>) -> Result<(), ConfigError> {
    if let Some(delay) = fixed.get(&["initDelay"]) {
        let delay_s = delay.number(0.0, f64::MAX)?;
        if delay_s > 0.0 {
            return Err(delay.error(
                format!("the ship appears only after {delay_s} s, but those of a scenario are there at once"),
                "write 0, and start the ship so far back on its course",
            ));
        }
    }
    if let Some(kind) = fixed.get(&["pathType"])
        && kind.text()? == "bezier"
    {
        return Err(kind.error(
            "the waypoints are control points of a curve, but those of a scenario are sailed to",
            "write \"rtz\" or \"linear\", with waypoints on the curve",
        ));
    }
    Ok(())
}
