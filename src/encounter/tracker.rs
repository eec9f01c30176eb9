//! An encounter over time: it begins with risk of collision, keeps its kind, and ends when the
//! vessels are past and clear.

use serde::{Deserialize, Serialize};

use super::classify::{Encounter, Vantage, classify};
use super::{EncounterConfig, Role};

/// Distance and time of the closest point of approach on which risk of collision is judged.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Risk {
    /// Distance at the closest point of approach, in metres.
    pub dcpa_m: f64,
    /// Time to it, in seconds; negative once passed.
    pub tcpa_s: f64,
}

/// Follows own ship's encounter with one target ship.
///
/// The kind is decided once, when risk of collision begins, and is kept until the risk has ended:
/// "any subsequent alteration of the bearing between the two vessels shall not make the overtaking
/// vessel a crossing vessel [...] or relieve her of the duty of keeping clear [...] until she is
/// finally past and clear" (rule 13d). A role therefore cannot flicker while geometry hovers at a
/// threshold; that risk itself cannot flicker is what the wider thresholds at its end are for.
#[derive(Debug, Clone, PartialEq)]
pub struct EncounterTracker {
    config: EncounterConfig,
    current: Option<Encounter>,
}

impl EncounterTracker {
    /// A tracker in which no encounter has begun.
    #[must_use]
    pub fn new(config: EncounterConfig) -> Self {
        Self { config, current: None }
    }

    /// Takes the situation of one moment and tells the encounter that own ship is in, if any.
    pub fn observe(&mut self, vantage: &Vantage, risk: Risk) -> Option<Encounter> {
        self.current = match self.current {
            Some(encounter) if !self.is_clear(risk) => Some(encounter),
            Some(_) => None,
            None if self.begins(risk) => classify(vantage, &self.config),
            None => None,
        };
        self.current
    }

    /// Own ship's role in the present encounter.
    #[must_use]
    pub fn role(&self) -> Option<Role> {
        self.current.map(Encounter::role)
    }

    fn begins(&self, risk: Risk) -> bool {
        risk.dcpa_m < self.config.risk_dcpa_m && risk.tcpa_s >= 0.0 && risk.tcpa_s < self.config.risk_tcpa_s
    }

    fn is_clear(&self, risk: Risk) -> bool {
        risk.dcpa_m > self.config.risk_dcpa_m * self.config.clear_dcpa_factor
            || risk.tcpa_s < -self.config.past_and_clear_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vantage(target_bearing_deg: f64, own_bearing_deg: f64, course_difference_deg: f64) -> Vantage {
        Vantage {
            target_bearing_rad: target_bearing_deg.to_radians(),
            own_bearing_rad: own_bearing_deg.to_radians(),
            course_difference_rad: course_difference_deg.to_radians(),
            speed_advantage_mps: 1.0,
        }
    }

    fn risk(dcpa_m: f64, tcpa_s: f64) -> Risk {
        Risk { dcpa_m, tcpa_s }
    }

    #[test]
    fn a_role_does_not_flicker_when_the_bearing_hovers_at_a_threshold() {
        let mut tracker = EncounterTracker::new(EncounterConfig::default());
        let first = tracker.observe(&vantage(12.9, -12.9, 179.0), risk(100.0, 900.0));
        assert_eq!(first, Some(Encounter::HeadOn));
        for step in 0..100 {
            let hovering = 13.0 + if step % 2 == 0 { 0.2 } else { -0.2 };
            let seen = tracker.observe(&vantage(hovering, -hovering, 179.0), risk(100.0, 890.0));
            assert_eq!(seen, Some(Encounter::HeadOn));
        }
    }

    #[test]
    fn a_role_does_not_flicker_when_the_distance_hovers_at_its_threshold() {
        let config = EncounterConfig::default();
        let mut tracker = EncounterTracker::new(config);
        let ahead = vantage(45.0, -45.0, -90.0);
        assert_eq!(tracker.observe(&ahead, risk(config.risk_dcpa_m + 1.0, 900.0)), None);
        for offset_m in [-1.0, 1.0, -1.0, 1.0, 400.0] {
            let seen = tracker.observe(&ahead, risk(config.risk_dcpa_m + offset_m, 900.0));
            assert_eq!(seen, Some(Encounter::CrossingFromStarboard));
        }
        assert_eq!(tracker.observe(&ahead, risk(config.risk_dcpa_m * 1.5 + 1.0, 900.0)), None);
    }

    #[test]
    fn an_encounter_ends_when_past_and_clear_and_not_before() {
        let mut tracker = EncounterTracker::new(EncounterConfig::default());
        let overtaking = vantage(0.0, 180.0, 0.0);
        assert_eq!(tracker.observe(&overtaking, risk(50.0, 600.0)), Some(Encounter::Overtaking));
        // Drawing ahead brings the other vessel abaft own beam; the duty stays (rule 13d).
        let drawn_ahead = vantage(170.0, 10.0, 0.0);
        assert_eq!(tracker.observe(&drawn_ahead, risk(50.0, -59.0)), Some(Encounter::Overtaking));
        assert_eq!(tracker.role(), Some(Role::GiveWay));
        assert_eq!(tracker.observe(&drawn_ahead, risk(50.0, -61.0)), None);
        assert_eq!(tracker.role(), None);
    }

    #[test]
    fn a_distant_closest_point_is_no_encounter_yet() {
        let config = EncounterConfig::default();
        let mut tracker = EncounterTracker::new(config);
        let ahead = vantage(0.0, 0.0, 180.0);
        assert_eq!(tracker.observe(&ahead, risk(0.0, config.risk_tcpa_s)), None);
        assert_eq!(tracker.observe(&ahead, risk(0.0, config.risk_tcpa_s - 1.0)), Some(Encounter::HeadOn));
    }
}
