//! From a [`Scenario`] to the text of a scenario file: every key that differs from its default.

use std::fmt::Write;
use std::path::Path;

use super::encounter_starts::HeadOnKind;
use super::model::{
    OwnStart, Placement, Point, RecordedStart, RelativePlacement, Scenario, ShipSize, Steering, Target,
    TargetMotion, TrackSource,
};
use super::placement::{Bearing, Passes, WantedCpa};
use crate::ais::iso_utc;
use crate::config::Fault;
use crate::encounter::BoundedKey;
use crate::geo::MPS_PER_KNOT;
use crate::vessel::mmg::ParameterSet;
use crate::vessel::{Dynamics, DynamicsConfig, PeriodicConfig, PilotConfig, StochasticConfig};
use crate::world::Bow;

/// Lines of TOML under way.
#[derive(Default)]
struct Lines(String);

impl Lines {
    fn line(&mut self, text: &str) {
        self.0.push_str(text);
        self.0.push('\n');
    }

    fn table(&mut self, header: &str) {
        self.0.push('\n');
        self.line(header);
    }

    fn number(&mut self, key: &str, value: f64) {
        self.line(&format!("{key} = {}", number(value)));
    }

    fn speed(&mut self, key: &str, speed_mps: f64) {
        self.number(&format!("{key}_kn"), speed_mps / MPS_PER_KNOT);
    }

    fn text(&mut self, key: &str, value: &str) {
        self.line(&format!("{key} = {}", text(value)));
    }

    /// The keys whose values are not the default ones.
    fn others<const N: usize>(&mut self, keys: [BoundedKey<'_>; N], usual: [BoundedKey<'_>; N]) {
        for ((key, value, _), (_, default, _)) in keys.into_iter().zip(usual) {
            self.other(key, *value, *default);
        }
    }

    /// A number where it is not the default.
    fn other(&mut self, key: &str, value: f64, default: f64) {
        if value != default {
            self.number(key, value);
        }
    }
}

/// Nine decimals, without the zeros that end them; more where that would lose something.
fn number(value: f64) -> String {
    let short = format!("{value:.9}");
    let short = short.trim_end_matches('0').trim_end_matches('.');
    match short.parse::<f64>() {
        Ok(0.0) if value.abs() < 1e-12 => "0".to_owned(),
        Ok(read) if (read - value).abs() <= 1e-10 * value.abs() => short.to_owned(),
        _ => format!("{value:?}"),
    }
}

fn text(value: &str) -> String {
    toml::Value::String(value.to_owned()).to_string()
}

fn point(point: Point) -> String {
    match point {
        Point::Geodetic(at) => {
            let (latitude, longitude) = (number(at.latitude_deg), number(at.longitude_deg));
            format!("latitude_deg = {latitude}, longitude_deg = {longitude}")
        }
        Point::Local(at) => format!("north_m = {}, east_m = {}", number(at.north_m), number(at.east_m)),
    }
}

impl Scenario {
    /// The text of a scenario file that says the same. Paths are written as they are: relative ones start
    /// from the directory of the file.
    ///
    /// # Errors
    /// Recorded tracks that a program has given: no file says where they are.
    pub fn to_toml(&self) -> Result<String, Fault> {
        let blank = Self::new(&self.name, self.own_ship.clone());
        let mut out = Lines::default();
        out.text("title", &self.title);
        if !self.description.is_empty() {
            out.text("description", &self.description);
        }
        out.number("duration_s", self.duration_s);
        out.other("dt_s", self.dt_s, blank.dt_s);
        if self.seed != blank.seed {
            out.line(&format!("seed = {}", self.seed));
        }
        out.text("policy", &self.policy);
        if let Some(forecaster) = &self.forecaster {
            out.text("forecaster", &forecaster.to_string());
            out.number("forecast_horizon_s", self.forecast_horizon_s);
        }
        out.other("collision_radius_m", self.collision_radius_m, blank.collision_radius_m);
        if let Some(origin) = self.origin {
            out.table("[origin]");
            out.number("latitude_deg", origin.latitude_deg);
            out.number("longitude_deg", origin.longitude_deg);
        }
        let current = self.surroundings.current;
        if current.speed_mps() > 0.0 {
            out.table("[current]");
            out.number("towards_deg", current.course().degrees());
            out.speed("speed", current.speed_mps());
        }
        if let Some(wind) = self.surroundings.wind {
            out.table("[wind]");
            out.number("from_deg", wind.from.degrees());
            out.number("speed_mps", wind.speed_mps);
        }
        if self.sensor_noise != blank.sensor_noise {
            out.table("[sensor_noise]");
            out.number("sigma_m", self.sensor_noise.sigma_m);
        }
        let (mut rules, mut usual) = (self.rules, blank.rules);
        if rules.encounters != usual.encounters {
            out.table("[encounters]");
            out.others(rules.encounters.keys(), usual.encounters.keys());
        }
        if rules.compliance != usual.compliance {
            out.table("[compliance]");
            out.others(rules.compliance.keys(), usual.compliance.keys());
        }
        self.write_own_ship(&mut out);
        for (index, target) in self.targets.iter().enumerate() {
            write_target(&mut out, target)
                .map_err(|fault| fault.within(&format!("target[{}]", index + 1)))?;
        }
        Ok(out.0)
    }

    fn write_own_ship(&self, out: &mut Lines) {
        let own = &self.own_ship;
        out.table("[own_ship]");
        out.text("name", &own.name);
        write_ship(out, own.dynamics, Some(own.size), own.collision_radius_m);
        out.speed("speed", own.speed_mps);
        if let OwnStart::At { point: start, course } = &own.start {
            out.line(&point(*start).replace(", ", "\n"));
            if let Some(course) = course {
                out.number("course_deg", course.degrees());
            }
        }
        if !own.route.is_empty() {
            out.line("route = [");
            for waypoint in &own.route {
                let speed = waypoint.speed_mps.map_or_else(String::new, |speed_mps| {
                    format!(", speed_kn = {}", number(speed_mps / MPS_PER_KNOT))
                });
                out.line(&format!("    {{ {}{speed} }},", point(waypoint.point)));
            }
            out.line("]");
        }
        if let OwnStart::HeadOn { target, time_to_collision_s } = &own.start {
            out.table("[own_ship.head_on]");
            if let Some(target) = target {
                out.text("target", target);
            }
            out.number("time_to_collision_s", *time_to_collision_s);
        }
        let Steering { max_turn_deg, decision_interval_s, max_speed_change_mps } = own.steering;
        if own.steering != Steering::suiting(own.dynamics.dynamics) {
            out.table("[own_ship.steering]");
            out.number("max_turn_deg", max_turn_deg);
            out.number("decision_interval_s", decision_interval_s);
            out.number("max_speed_change_mps", max_speed_change_mps);
        }
    }
}

/// Dynamics, size and collision circle.
fn write_ship(
    out: &mut Lines,
    dynamics: DynamicsConfig,
    size: Option<ShipSize>,
    collision_radius_m: Option<f64>,
) {
    if dynamics.dynamics != Dynamics::Kinematic {
        out.text("dynamics", dynamics.dynamics.word());
        write_kvlcc2(out, dynamics);
    }
    if let Some(ShipSize { length_m, beam_m, bow }) = size {
        out.number("length_m", length_m);
        out.number("beam_m", beam_m);
        let word = match bow {
            Bow::Fine => "fine",
            Bow::Normal => "normal",
            Bow::Full => "full",
        };
        out.text("bow", word);
    }
    if let Some(radius_m) = collision_radius_m {
        out.number("collision_radius_m", radius_m);
    }
}

fn write_kvlcc2(out: &mut Lines, dynamics: DynamicsConfig) {
    let (ship, default) = (dynamics.kvlcc2, DynamicsConfig::default().kvlcc2);
    let parameters = match ship.parameters {
        ParameterSet::Benchmark => None,
        ParameterSet::AsPrinted => Some("as-printed"),
        ParameterSet::TrueFullScale => Some("true-full-scale"),
    };
    if let Some(parameters) = parameters {
        out.text("kvlcc2.parameters", parameters);
    }
    if let Some(speed_mps) = ship.service_speed_mps {
        out.speed("kvlcc2.service_speed", speed_mps);
    }
    out.other("kvlcc2.max_rudder_deg", ship.max_rudder_deg, default.max_rudder_deg);
    if let Some(rate) = ship.rudder_rate_deg_per_s {
        out.number("kvlcc2.rudder_rate_deg_per_s", rate);
    }
    let (gains, usual) = (ship.autopilot, default.autopilot);
    out.other("kvlcc2.heading_gain", gains.heading_gain, usual.heading_gain);
    out.other("kvlcc2.yaw_gain", gains.yaw_gain, usual.yaw_gain);
    out.other("kvlcc2.speed_gain", gains.speed_gain, usual.speed_gain);
}

fn write_target(out: &mut Lines, target: &Target) -> Result<(), Fault> {
    out.table("[[target]]");
    out.text("name", &target.name);
    write_ship(out, target.dynamics, target.size, target.collision_radius_m);
    let (pilot, usual) = (target.pilot, PilotConfig::default());
    if target.dynamics.dynamics != Dynamics::Kinematic {
        out.other("pilot.lookahead_over_length", pilot.lookahead_over_length, usual.lookahead_over_length);
        out.other("pilot.acceptance_over_length", pilot.acceptance_over_length, usual.acceptance_over_length);
    }
    out.text("motion", target.motion.word());
    match &target.motion {
        TargetMotion::Linear(placement) => write_placement(out, placement),
        TargetMotion::Stochastic(placement, config) => {
            write_placement(out, placement);
            let usual = StochasticConfig::default();
            out.other("phi", config.phi, usual.phi);
            out.other("beta", config.beta, usual.beta);
            out.other("innovation_sd_m", config.innovation_sd_m, usual.innovation_sd_m);
            out.other("v_max_mps", config.v_max_mps, usual.v_max_mps);
        }
        TargetMotion::Periodic(placement, config) => {
            write_placement(out, placement);
            let usual = PeriodicConfig::default();
            out.other("amplitude_s", config.amplitude_s, usual.amplitude_s);
            out.other("period_steps", config.period_steps, usual.period_steps);
            out.other("noise_sd_m", config.noise_sd_m, usual.noise_sd_m);
        }
        TargetMotion::Waypoints { waypoints } => {
            let common_mps = waypoints.first().map_or(0.0, |first| first.speed_mps);
            out.speed("speed", common_mps);
            out.line("waypoints = [");
            for waypoint in waypoints {
                let mut line = format!("    {{ {}", point(waypoint.point));
                if waypoint.speed_mps != common_mps {
                    let speed_kn = number(waypoint.speed_mps / MPS_PER_KNOT);
                    // Writing to a String cannot fail.
                    let _ = write!(line, ", speed_kn = {speed_kn}");
                }
                out.line(&format!("{line} }},"));
            }
            out.line("]");
        }
        TargetMotion::Recorded(recorded) => {
            write_source(out, &recorded.source)?;
            write_recorded_start(out, &recorded.start);
        }
    }
    Ok(())
}

fn write_source(out: &mut Lines, source: &TrackSource) -> Result<(), Fault> {
    let path = |path: &Path| text(&path.to_string_lossy());
    match source {
        TrackSource::Ais { files, area } => {
            let files: Vec<String> = files.iter().map(|file| path(file)).collect();
            out.line(&format!("ais_file = [{}]", files.join(", ")));
            out.line(&format!("area_file = {}", path(area)));
        }
        TrackSource::Directory(directory) => out.line(&format!("track_dir = {}", path(directory))),
        TrackSource::Given { .. } => {
            return Err(Fault::new(
                "track_dir",
                "the tracks of this ship are in no file",
                "import them with `searoom ais import` and name their directory",
            ));
        }
    }
    Ok(())
}

fn write_recorded_start(out: &mut Lines, start: &RecordedStart) {
    match start {
        RecordedStart::Time { mmsi, unix_s } => {
            out.line(&format!("mmsi = {mmsi}"));
            let (whole, fraction) = (unix_s.floor(), unix_s - unix_s.floor());
            let moment = iso_utc(whole as i64);
            let decimals = if fraction > 0.0 {
                format!("{fraction:.6}").trim_start_matches('0').to_owned()
            } else {
                String::new()
            };
            out.line(&format!("time = {}{decimals}Z", moment.trim_end_matches('Z')));
        }
        RecordedStart::Rule { kind, mmsi, pick } => {
            let word = match kind {
                HeadOnKind::BeforeCurve => "before its curve",
                HeadOnKind::StraightOn => "after its curve",
            };
            out.text("start", word);
            if let Some(mmsi) = mmsi {
                out.line(&format!("mmsi = {mmsi}"));
            }
            if let Some(pick) = pick {
                out.line(&format!("pick = {pick}"));
            }
        }
    }
}

fn write_placement(out: &mut Lines, placement: &Placement) {
    let relative = match placement {
        Placement::At { point: at, course, speed_mps } => {
            out.line(&point(*at).replace(", ", "\n"));
            out.number("course_deg", course.degrees());
            out.speed("speed", *speed_mps);
            return;
        }
        Placement::FromOwnShip(relative) => *relative,
    };
    match relative {
        RelativePlacement::Seen { bearing, range_m, course, speed_mps } => {
            write_bearing(out, bearing, range_m);
            out.number("course_deg", course.degrees());
            out.speed("speed", speed_mps);
        }
        RelativePlacement::SeenWithCpa { bearing, range_m, cpa } => {
            write_bearing(out, bearing, range_m);
            write_cpa(out, cpa);
        }
        RelativePlacement::CourseWithCpa { course, speed_mps, cpa } => {
            out.number("course_deg", course.degrees());
            out.speed("speed", speed_mps);
            write_cpa(out, cpa);
        }
    }
}

fn write_bearing(out: &mut Lines, bearing: Bearing, range_m: f64) {
    match bearing {
        Bearing::True(bearing) => out.number("bearing_deg", bearing.degrees()),
        Bearing::Relative(bearing_rad) => out.number("relative_bearing_deg", bearing_rad.to_degrees()),
    }
    out.number("range_m", range_m);
}

fn write_cpa(out: &mut Lines, cpa: WantedCpa) {
    out.number("dcpa_m", cpa.dcpa_m);
    out.number("tcpa_s", cpa.tcpa_s);
    let passes = Passes::WORDS.iter().find(|(_, passes)| Some(*passes) == cpa.passes);
    if let Some((word, _)) = passes {
        out.text("passes", word);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::ScenarioFile;

    /// Whether two debug texts differ in nothing but the last digits of numbers.
    fn alike(one: &str, other: &str) -> bool {
        let words = |text: &str| {
            text.split(|c: char| c.is_whitespace() || "(){}[],".contains(c)).map(str::to_owned).collect()
        };
        let (one, other): (Vec<String>, Vec<String>) = (words(one), words(other));
        one.len() == other.len()
            && one.iter().zip(&other).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
                (Ok(a), Ok(b)) => (a - b).abs() <= 1e-8 * (1.0 + a.abs()),
                _ => a == b,
            })
    }

    #[test]
    fn every_shipped_scenario_says_the_same_when_written_and_read_again() {
        let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
        let mut count = 0;
        for entry in std::fs::read_dir(directory).unwrap() {
            let file = entry.unwrap().path();
            if file.extension().is_none_or(|extension| extension != "toml") {
                continue;
            }
            let scenario = ScenarioFile::load(&file).unwrap().scenario;
            let written = scenario.to_toml().unwrap();
            let again =
                ScenarioFile::parse(&written, &file).unwrap_or_else(|error| panic!("{error}\n{written}"));
            assert!(
                alike(&format!("{scenario:?}"), &format!("{:?}", again.scenario)),
                "{scenario:?}\n{:?}",
                again.scenario
            );
            assert_eq!(written, again.scenario.to_toml().unwrap(), "writing settles at once");
            count += 1;
        }
        assert!(count >= 10);
    }

    #[test]
    fn numbers_are_short_and_lose_nothing() {
        for (value, written) in [
            (12.0, "12"),
            (10.0 * MPS_PER_KNOT / MPS_PER_KNOT, "10"),
            (0.1 + 0.2, "0.3"),
            (-1e-20, "0"),
            (1e-10, "1e-10"),
            (-73.123456789, "-73.123456789"),
        ] {
            assert_eq!(number(value), written);
        }
    }
}
