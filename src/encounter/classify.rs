//! What kind of encounter two vessels are in, from their positions and velocities at one moment.

use serde::{Deserialize, Serialize};

use super::EncounterConfig;
use crate::geo::{Position, Velocity};

/// The kind of encounter, seen from own ship.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Encounter {
    /// Reciprocal or nearly reciprocal courses, each right ahead of the other (rule 14).
    HeadOn,
    /// The target ship crosses from own starboard side (rule 15).
    CrossingFromStarboard,
    /// The target ship crosses from own port side (rule 15).
    CrossingFromPort,
    /// Own ship comes up from abaft the target ship's beam (rule 13).
    Overtaking,
    /// The target ship comes up from abaft own beam (rule 13).
    Overtaken,
}

/// What the rules ask of own ship.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Keep out of the way, early and substantially (rule 16; head-on: alter to starboard, rule 14a).
    GiveWay,
    /// Keep course and speed (rule 17).
    StandOn,
}

impl Encounter {
    /// As tables and pages write it.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::HeadOn => "head-on",
            Self::CrossingFromStarboard => "crossing from starboard",
            Self::CrossingFromPort => "crossing from port",
            Self::Overtaking => "overtaking",
            Self::Overtaken => "overtaken",
        }
    }

    /// Own ship's role. In a head-on encounter both vessels give way.
    #[must_use]
    pub fn role(self) -> Role {
        match self {
            Self::HeadOn | Self::CrossingFromStarboard | Self::Overtaking => Role::GiveWay,
            Self::CrossingFromPort | Self::Overtaken => Role::StandOn,
        }
    }
}

impl Role {
    /// As tables and pages write it.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::GiveWay => "give way",
            Self::StandOn => "stand on",
        }
    }
}

/// How each vessel sees the other. Bearings are relative to the observer's course: radians in
/// `(-pi, pi]`, positive to starboard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vantage {
    /// Relative bearing of the target ship from own ship.
    pub target_bearing_rad: f64,
    /// Relative bearing of own ship from the target ship (the target's aspect).
    pub own_bearing_rad: f64,
    /// Target ship's course less own course.
    pub course_difference_rad: f64,
    /// Own speed less the target ship's, in metres per second.
    pub speed_advantage_mps: f64,
}

impl Vantage {
    /// From positions and velocities over ground.
    #[must_use]
    pub fn of(own: (Position, Velocity), target: (Position, Velocity)) -> Self {
        let line_of_sight = (target.0 - own.0).bearing();
        let (own_course, target_course) = (own.1.course(), target.1.course());
        Self {
            target_bearing_rad: line_of_sight.turn_from(own_course),
            own_bearing_rad: line_of_sight.reciprocal().turn_from(target_course),
            course_difference_rad: target_course.turn_from(own_course),
            speed_advantage_mps: own.1.speed_mps() - target.1.speed_mps(),
        }
    }
}

/// Classifies an encounter; nothing where neither vessel can be said to approach the other under
/// one of the rules 13 to 15 (each abaft the other's beam).
///
/// Rule 13 comes first, as "notwithstanding anything contained in the rules" it does in the text:
/// the faster vessel that comes up from abaft the other's beam overtakes. Then rule 14, then rule 15.
#[must_use]
pub fn classify(vantage: &Vantage, config: &EncounterConfig) -> Option<Encounter> {
    let head_on = config.head_on_deg.to_radians();
    let abaft = config.abaft_deg.to_radians();
    let own_abaft_target = vantage.own_bearing_rad.abs() > abaft;
    let target_abaft_own = vantage.target_bearing_rad.abs() > abaft;
    let reciprocal = std::f64::consts::PI - vantage.course_difference_rad.abs() <= head_on;
    if own_abaft_target && target_abaft_own {
        None
    } else if own_abaft_target && vantage.speed_advantage_mps > 0.0 {
        Some(Encounter::Overtaking)
    } else if target_abaft_own && vantage.speed_advantage_mps < 0.0 {
        Some(Encounter::Overtaken)
    } else if reciprocal
        && vantage.target_bearing_rad.abs() <= head_on
        && vantage.own_bearing_rad.abs() <= head_on
    {
        Some(Encounter::HeadOn)
    } else if vantage.target_bearing_rad >= 0.0 {
        Some(Encounter::CrossingFromStarboard)
    } else {
        Some(Encounter::CrossingFromPort)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Nautical;
    use crate::geo::Displacement;

    /// Own ship goes north at 6 m/s from the origin.
    fn seen(bearing_deg: f64, course_deg: f64, speed_mps: f64) -> Option<Encounter> {
        let own = (Position::ORIGIN, Velocity::from_course(Nautical::NORTH, 6.0));
        let place = Position::ORIGIN + Displacement::towards(Nautical::from_degrees(bearing_deg), 5000.0);
        let target = (place, Velocity::from_course(Nautical::from_degrees(course_deg), speed_mps));
        classify(&Vantage::of(own, target), &EncounterConfig::default())
    }

    #[test]
    fn both_sides_of_the_head_on_sector() {
        assert_eq!(seen(0.0, 180.0, 6.0), Some(Encounter::HeadOn));
        assert_eq!(seen(12.9, 192.9, 6.0), Some(Encounter::HeadOn));
        assert_eq!(seen(13.1, 193.1, 6.0), Some(Encounter::CrossingFromStarboard));
        assert_eq!(seen(-13.1, 166.9, 6.0), Some(Encounter::CrossingFromPort));
        // Right ahead, but no longer on a reciprocal course.
        assert_eq!(seen(0.0, 192.9, 6.0), Some(Encounter::HeadOn));
        assert_eq!(seen(0.0, 193.1, 6.0), Some(Encounter::CrossingFromStarboard));
    }

    #[test]
    fn both_sides_of_abaft_the_beam_decide_overtaking() {
        // A slower target ship 5 km ahead: own ship bears 180 degrees less its course difference.
        assert_eq!(seen(0.0, 67.4, 3.0), Some(Encounter::Overtaking));
        assert_eq!(seen(0.0, 67.6, 3.0), Some(Encounter::CrossingFromStarboard));
        assert_eq!(seen(112.6, 0.0, 9.0), Some(Encounter::Overtaken));
        assert_eq!(seen(112.4, 0.0, 9.0), Some(Encounter::CrossingFromStarboard));
        assert_eq!(seen(-112.6, 0.0, 9.0), Some(Encounter::Overtaken));
    }

    #[test]
    fn only_the_faster_vessel_overtakes() {
        assert_eq!(seen(0.0, 0.0, 5.9), Some(Encounter::Overtaking));
        assert_ne!(seen(0.0, 0.0, 6.1), Some(Encounter::Overtaking));
        assert_ne!(seen(180.0, 0.0, 5.9), Some(Encounter::Overtaken));
        assert_eq!(seen(180.0, 0.0, 6.1), Some(Encounter::Overtaken));
    }

    #[test]
    fn the_side_decides_who_gives_way() {
        assert_eq!(seen(45.0, 270.0, 6.0).map(Encounter::role), Some(Role::GiveWay));
        assert_eq!(seen(-45.0, 90.0, 6.0).map(Encounter::role), Some(Role::StandOn));
        assert_eq!(seen(0.1, 300.0, 6.0), Some(Encounter::CrossingFromStarboard));
        assert_eq!(seen(-0.1, 60.0, 6.0).map(Encounter::role), Some(Role::StandOn));
    }

    #[test]
    fn vessels_that_leave_each_other_astern_are_in_no_encounter() {
        assert_eq!(seen(180.0, 180.0, 6.0), None);
    }
}
