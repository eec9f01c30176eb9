//! Where on recorded tracks a head-on encounter can start (section 3.3.2 of the paper, "Reinforcement
//! learning environment").
//!
//! The paper starts its recorded vessel before a curve to port that takes it clear (scenario 1), or
//! after it, where it goes straight on (scenario 2), at fixed times around the one turning point of
//! its area. Here the starts of any area are found from the tracks, by what comes of them: own ship
//! is placed on the reciprocal course, a given time to collision ahead by linear extrapolation, and
//! is sailed twice, holding its course and turning to starboard at every decision. How close the
//! two vessels come is exact between samples, both moving in straight lines within a step.

use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;

use rand::Rng;
use rand::seq::IndexedRandom;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::angle::Nautical;
use crate::config::Fault;
use crate::geo::{Displacement, Position, Velocity};
use crate::track::Track;
use crate::vessel::mmg::Surroundings;
use crate::vessel::{Command, Dynamics, DynamicsConfig, KinematicConfig, Kvlcc2Config, Launch, Steered};

/// Which of the two head-on scenarios of the paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeadOnKind {
    /// Scenario 1: the target is about to turn to port and clear; holding course is safe, turning
    /// to starboard meets it.
    BeforeCurve,
    /// Scenario 2: the target goes straight on; holding course collides, turning to starboard
    /// keeps clear.
    StraightOn,
}

/// What makes a point of a track the start of a head-on encounter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeadOnConfig {
    /// Own ship's speed, in metres per second.
    pub own_speed_mps: f64,
    /// Time to collision at the start, both vessels extrapolated linearly, in seconds.
    pub time_to_collision_s: f64,
    /// Own ship's largest change of heading per decision, in degrees.
    pub turn_per_decision_deg: f64,
    /// Time between two decisions, in seconds.
    pub decision_interval_s: f64,
    /// Own ship's dynamics.
    pub dynamics: Dynamics,
    /// Settings of [`Dynamics::Kvlcc2`].
    pub kvlcc2: Kvlcc2Config,
    /// Track wanted before the start, in seconds.
    pub history_s: f64,
    /// Track wanted after the start, over which distances are judged, in seconds.
    pub future_s: f64,
    /// Time between two candidates on a track, in seconds.
    pub spacing_s: f64,
    /// Least speed of the target at the start, in metres per second.
    pub speed_min_mps: f64,
    /// Greatest speed of the target at the start, in metres per second.
    pub speed_max_mps: f64,
    /// Scenario 1: the target's course changes by more than this to port, in degrees.
    pub curve_deg: f64,
    /// Scenario 1: within this time, in seconds.
    pub curve_within_s: f64,
    /// Scenario 1: an own ship that turns to starboard comes at least this close, in metres.
    pub curve_contact_m: f64,
    /// Scenario 2: the target's course stays within this of the first, in degrees.
    pub straight_deg: f64,
    /// Scenario 2: an own ship that holds its course comes at least this close, in metres.
    pub straight_contact_m: f64,
    /// Scenario 2: and then has the target no further to starboard than this, in metres.
    pub straight_starboard_offset_m: f64,
    /// Closest distance of the own ship that does right, in metres: holding its course in scenario
    /// 1, turning to starboard in scenario 2.
    pub clear_m: f64,
}

impl Default for HeadOnConfig {
    fn default() -> Self {
        Self {
            own_speed_mps: 8.0,
            time_to_collision_s: 240.0,
            turn_per_decision_deg: 2.4,
            decision_interval_s: 20.0,
            dynamics: Dynamics::default(),
            kvlcc2: Kvlcc2Config::default(),
            history_s: 375.0,
            future_s: 300.0,
            spacing_s: 30.0,
            speed_min_mps: 3.0,
            speed_max_mps: 16.0,
            curve_deg: 15.0,
            curve_within_s: 240.0,
            curve_contact_m: 300.0,
            straight_deg: 10.0,
            straight_contact_m: 150.0,
            straight_starboard_offset_m: 50.0,
            clear_m: 350.0,
        }
    }
}

impl HeadOnConfig {
    /// Checks own ship's dynamics.
    ///
    /// # Errors
    /// Names the key at fault and says what to write.
    pub fn check_dynamics(&self) -> Result<(), Fault> {
        match self.dynamics {
            Dynamics::Kinematic => Ok(()),
            Dynamics::Kvlcc2 => self.kvlcc2.check(self.own_speed_mps),
        }
    }

    /// Own ship on a course at its speed, in still water, as it is steered in these encounters.
    #[must_use]
    pub fn launch_own(&self, position: Position, course: Nautical) -> Box<dyn Steered> {
        let dynamics = DynamicsConfig { dynamics: self.dynamics, kvlcc2: self.kvlcc2 };
        let limits = KinematicConfig { max_turn_deg: self.turn_per_decision_deg };
        let velocity = Velocity::from_course(course, self.own_speed_mps);
        dynamics.launch(&Launch { position, velocity, limits }, Surroundings::default())
    }
}

/// Own ship's state at the start of a head-on encounter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadOnPose {
    /// Where own ship is.
    pub position: Position,
    /// Its course, reciprocal to the target's.
    pub course: Nautical,
}

/// Own ship on the course reciprocal to a target's, such that both meet after
/// `time_to_collision_s` if both hold course and speed.
#[must_use]
pub fn head_on_pose(
    target: Position,
    target_velocity: Velocity,
    own_speed_mps: f64,
    time_to_collision_s: f64,
) -> HeadOnPose {
    let course = target_velocity.course().reciprocal();
    let meeting_point = target + target_velocity.for_seconds(time_to_collision_s);
    let way = Displacement::towards(course, own_speed_mps * time_to_collision_s);
    HeadOnPose { position: meeting_point - way, course }
}

/// A point of a track at which a head-on encounter can start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct HeadOnStart {
    /// Index of the track among those searched.
    pub track: usize,
    /// MMSI of its vessel.
    pub mmsi: u32,
    /// Index of the position on the track.
    pub index: usize,
}

/// The starts found on a set of tracks, in the order of tracks and time.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct HeadOnStarts {
    /// Scenario 1: before a curve to port.
    pub before_curve: Vec<HeadOnStart>,
    /// Scenario 2: straight on.
    pub straight_on: Vec<HeadOnStart>,
    /// Indices of the tracks that offer neither.
    pub tracks_without: Vec<usize>,
}

impl HeadOnStarts {
    /// Searches every track, in parallel; the result depends on the tracks and `config` alone.
    #[must_use]
    pub fn find(tracks: &[Track], config: &HeadOnConfig) -> Self {
        let per_track: Vec<_> = tracks.par_iter().map(|track| search(track, config)).collect();
        let mut starts = Self::default();
        for (track, found) in per_track.into_iter().enumerate() {
            if found.is_empty() {
                starts.tracks_without.push(track);
            }
            for (kind, index) in found {
                starts.of_mut(kind).push(HeadOnStart { track, mmsi: tracks[track].mmsi, index });
            }
        }
        starts
    }

    /// Whether every start lies on one of these tracks, and is of its vessel.
    #[must_use]
    pub fn are_on(&self, tracks: &[Track]) -> bool {
        let is_on = |start: &HeadOnStart| {
            tracks
                .get(start.track)
                .is_some_and(|track| track.mmsi == start.mmsi && start.index < track.positions.len())
        };
        self.before_curve.iter().chain(&self.straight_on).all(is_on)
            && self.tracks_without.iter().all(|&track| track < tracks.len())
    }

    /// The starts of one scenario.
    #[must_use]
    pub fn of(&self, kind: HeadOnKind) -> &[HeadOnStart] {
        match kind {
            HeadOnKind::BeforeCurve => &self.before_curve,
            HeadOnKind::StraightOn => &self.straight_on,
        }
    }

    /// Draws a start of one scenario: the vessel, then one of its tracks, then a start on it, each
    /// uniformly. `None` where the tracks offer no such start.
    pub fn draw(&self, kind: HeadOnKind, rng: &mut impl Rng) -> Option<HeadOnStart> {
        let starts = self.of(kind);
        let mmsi = *distinct(starts.iter().map(|start| start.mmsi)).choose(rng)?;
        let of_vessel = || starts.iter().filter(|start| start.mmsi == mmsi);
        let track = *distinct(of_vessel().map(|start| start.track)).choose(rng)?;
        let on_track: Vec<_> = of_vessel().filter(|start| start.track == track).collect();
        on_track.choose(rng).map(|start| **start)
    }

    /// Leaves out the starts of all vessels but one.
    pub fn keep_vessel(&mut self, mmsi: u32) {
        for kind in [HeadOnKind::BeforeCurve, HeadOnKind::StraightOn] {
            self.of_mut(kind).retain(|start| start.mmsi == mmsi);
        }
    }

    fn of_mut(&mut self, kind: HeadOnKind) -> &mut Vec<HeadOnStart> {
        match kind {
            HeadOnKind::BeforeCurve => &mut self.before_curve,
            HeadOnKind::StraightOn => &mut self.straight_on,
        }
    }
}

fn distinct<T: Ord>(items: impl Iterator<Item = T>) -> Vec<T> {
    items.collect::<BTreeSet<_>>().into_iter().collect()
}

fn search(track: &Track, config: &HeadOnConfig) -> Vec<(HeadOnKind, usize)> {
    let steps = |duration_s: f64| (duration_s / track.dt_s).round().max(0.0) as usize;
    let (history, future) = (steps(config.history_s), steps(config.future_s));
    let own = OwnWays {
        hold: sail(0.0, track.dt_s, future, config),
        turn: sail(config.turn_per_decision_deg, track.dt_s, future, config),
    };
    let candidates =
        (history..track.positions.len().saturating_sub(future)).step_by(steps(config.spacing_s).max(1));
    candidates
        .filter_map(|index| {
            let window = Track {
                positions: track.positions[index..=index + future].to_vec(),
                particulars: Default::default(),
                ..*track
            };
            classify(&window, &own, config).map(|kind| (kind, index))
        })
        .collect()
}

/// What own ship can do from any start: ways made at the target's samples, as from the origin towards
/// north. In still water they are the same on every course.
struct OwnWays {
    /// Holding its course.
    hold: Vec<Position>,
    /// Turning to starboard at every decision.
    turn: Vec<Position>,
}

/// A way made towards north, from another start.
fn from_start(way: &[Position], start: HeadOnPose) -> Vec<Position> {
    let abeam = start.course.turned(FRAC_PI_2);
    way.iter()
        .map(|made| {
            start.position
                + Displacement::towards(start.course, made.north_m)
                + Displacement::towards(abeam, made.east_m)
        })
        .collect()
}

/// Which scenario starts at the first position of `target`, judged over its whole length.
fn classify(target: &Track, own: &OwnWays, config: &HeadOnConfig) -> Option<HeadOnKind> {
    let velocity = target.velocity(0);
    if !(config.speed_min_mps..=config.speed_max_mps).contains(&velocity.speed_mps()) {
        return None;
    }
    let turn_deg = |index: usize| target.course(index).turn_from(velocity.course()).to_degrees();
    let steps = 0..target.positions.len() - 1;
    let within_curve = (config.curve_within_s / target.dt_s).round() as usize;
    let curves = steps.clone().take(within_curve + 1).any(|index| turn_deg(index) < -config.curve_deg);
    let straight = !curves && steps.clone().all(|index| turn_deg(index).abs() <= config.straight_deg);
    if !curves && !straight {
        return None;
    }

    let start = head_on_pose(target.positions[0], velocity, config.own_speed_mps, config.time_to_collision_s);
    let hold = closest_approach(&from_start(&own.hold, start), &target.positions);
    let turn = closest_approach(&from_start(&own.turn, start), &target.positions);
    if curves {
        let fits = hold.length_m() >= config.clear_m && turn.length_m() <= config.curve_contact_m;
        return fits.then_some(HeadOnKind::BeforeCurve);
    }
    let fits = hold.length_m() <= config.straight_contact_m
        && hold.starboard_of_m(start.course) <= config.straight_starboard_offset_m
        && turn.length_m() >= config.clear_m;
    fits.then_some(HeadOnKind::StraightOn)
}

/// Own ship's positions over `steps` time steps from the origin towards north, its ordered heading
/// changed by `turn_deg` to starboard at every decision, the first one included.
fn sail(turn_deg: f64, dt_s: f64, steps: usize, config: &HeadOnConfig) -> Vec<Position> {
    let interval = (config.decision_interval_s / dt_s).round().max(1.0) as usize;
    let turn = Command { turn_rad: turn_deg.to_radians(), speed_mps: None };
    let mut ship = config.launch_own(Position::ORIGIN, Nautical::NORTH);
    let mut positions = vec![Position::ORIGIN];
    for step in 0..steps {
        if step % interval == 0 {
            ship.order(turn);
        }
        ship.advance(dt_s);
        positions.push(ship.state().position);
    }
    positions
}

/// Where the target lies from own ship when they are closest, both moving in a straight line
/// between samples of equal index.
fn closest_approach(own: &[Position], target: &[Position]) -> Displacement {
    let relative: Vec<Displacement> = own.iter().zip(target).map(|(own, target)| *target - *own).collect();
    relative
        .windows(2)
        .map(|step| closest_on_step(step[0], step[1]))
        .min_by(|a, b| a.length_m().total_cmp(&b.length_m()))
        .unwrap_or_default()
}

fn closest_on_step(from: Displacement, to: Displacement) -> Displacement {
    let way = to + -from;
    let squared_m2 = way.north_m.powi(2) + way.east_m.powi(2);
    let towards_m2 = -(from.north_m * way.north_m + from.east_m * way.east_m);
    let fraction = if squared_m2 > 0.0 { (towards_m2 / squared_m2).clamp(0.0, 1.0) } else { 0.0 };
    from + way * fraction
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A vessel that goes north at `speed_mps` and, `turn_after_s` after its start, turns by
    /// `rate_deg_per_s` until it has turned by `turn_deg` (positive to starboard).
    fn track(speed_mps: f64, turn_after_s: f64, rate_deg_per_s: f64, turn_deg: f64) -> Track {
        let mut positions = vec![Position::ORIGIN];
        for step in 0..240 {
            let turning_s = (step as f64 * 5.0 - turn_after_s).max(0.0);
            let turned_deg = (turning_s * rate_deg_per_s).min(turn_deg.abs()) * turn_deg.signum();
            let course = Nautical::from_degrees(turned_deg);
            positions.push(positions[step] + Displacement::towards(course, speed_mps * 5.0));
        }
        Track { mmsi: 219_000_001, start_unix_s: 0, dt_s: 5.0, positions, particulars: Default::default() }
    }

    fn find(tracks: &[Track]) -> HeadOnStarts {
        HeadOnStarts::find(tracks, &HeadOnConfig::default())
    }

    #[test]
    fn head_on_vessels_meet_after_the_time_to_collision() {
        let target = Position { north_m: 100.0, east_m: -50.0 };
        let velocity = Velocity::from_course(Nautical::from_degrees(30.0), 5.0);
        let own = head_on_pose(target, velocity, 8.0, 240.0);
        let own_velocity = Velocity::from_course(own.course, 8.0);
        let meeting = own.position + own_velocity.for_seconds(240.0);
        assert!(meeting.distance_m(target + velocity.for_seconds(240.0)) < 1e-6);
        assert!((own.course.degrees() - 210.0).abs() < 1e-9);
        assert!((own.position.distance_m(target) - 13.0 * 240.0).abs() < 1e-6);
    }

    #[test]
    fn a_straight_track_offers_straight_starts_only() {
        let starts = find(&[track(8.0, 1e9, 0.0, 0.0)]);
        // 375 s of history and 300 s of future out of 1200 s, every 30 s.
        assert_eq!(starts.straight_on.len(), 18);
        assert_eq!(starts.straight_on[0].index, 75);
        assert_eq!(starts.straight_on[1].index, 81);
        assert!(starts.before_curve.is_empty());
        assert!(starts.tracks_without.is_empty());
    }

    #[test]
    fn a_curve_to_port_is_a_trap_and_one_to_starboard_is_none() {
        let starts = find(&[track(8.0, 450.0, 0.5, -45.0), track(8.0, 450.0, 0.5, 45.0)]);
        assert!(!starts.before_curve.is_empty());
        assert!(starts.before_curve.iter().all(|start| start.track == 0));
        for start in &starts.before_curve {
            assert!((75..=102).contains(&start.index), "{start:?}");
        }
    }

    #[test]
    fn slow_fast_and_short_tracks_offer_nothing() {
        let mut short = track(8.0, 1e9, 0.0, 0.0);
        short.positions.truncate(75 + 60);
        let starts = find(&[track(2.9, 1e9, 0.0, 0.0), track(16.1, 1e9, 0.0, 0.0), short]);
        assert!(starts.before_curve.is_empty() && starts.straight_on.is_empty());
        assert_eq!(starts.tracks_without, [0, 1, 2]);
    }

    #[test]
    fn one_more_sample_makes_a_short_track_long_enough() {
        let mut track = track(8.0, 1e9, 0.0, 0.0);
        track.positions.truncate(75 + 60 + 1);
        assert_eq!(find(&[track]).straight_on.len(), 1);
    }

    #[test]
    fn the_closest_approach_is_found_between_samples() {
        let own = [Position::ORIGIN; 2];
        let target = [(30.0, -100.0), (30.0, 100.0)].map(|(north_m, east_m)| Position { north_m, east_m });
        let closest = closest_approach(&own, &target);
        assert!((closest.north_m - 30.0).abs() < 1e-12 && closest.east_m.abs() < 1e-12);
    }

    #[test]
    fn vessels_are_drawn_evenly_however_many_starts_they_have() {
        let start = |mmsi, track, index| HeadOnStart { track, mmsi, index };
        let mut starts = HeadOnStarts { before_curve: vec![start(1, 0, 0)], ..Default::default() };
        starts.before_curve.extend((0..99).map(|index| start(2, 1, index)));
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let firsts =
            (0..1000).filter(|_| starts.draw(HeadOnKind::BeforeCurve, &mut rng).unwrap().mmsi == 1).count();
        assert!((400..600).contains(&firsts), "{firsts}");
        assert_eq!(starts.draw(HeadOnKind::StraightOn, &mut rng), None);
    }
}
