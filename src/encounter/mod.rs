//! Encounters as the collision regulations (COLREG) see them: what kind of encounter two vessels
//! are in, what own ship has to do in it, and how well an episode kept to that.
//!
//! Rule numbers are those of the Convention on the International Regulations for Preventing
//! Collisions at Sea, 1972. The rules name few numbers; every threshold that had to be chosen is a
//! key of [`EncounterConfig`].

mod classify;
mod compliance;
mod tracker;

pub use classify::{Encounter, Role, Vantage, classify};
pub use compliance::{ComplianceConfig, ComplianceParts, EncounterReport, PairMoment, assess};
pub use tracker::{EncounterTracker, Risk};

use serde::{Deserialize, Serialize};

use crate::config::{Fault, check_bounds};
use crate::geo::M_PER_NMI;

/// What counts as an encounter and what as good conduct in it: the tables `[encounters]` and `[compliance]`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RulesConfig {
    /// When an encounter begins, of what kind it is and when it ends.
    pub encounters: EncounterConfig,
    /// How own ship's conduct is scored.
    pub compliance: ComplianceConfig,
}

/// A key of a configuration, its value, and the least and greatest that can be worked with.
pub(crate) type BoundedKey<'c> = (&'static str, &'c mut f64, [f64; 2]);

impl RulesConfig {
    /// Checks that every value can be worked with.
    ///
    /// # Errors
    /// The first key whose value cannot be, and what to write instead.
    pub fn check(mut self) -> Result<(), Fault> {
        let plain = |(key, value, bounds): BoundedKey<'_>| (key, *value, bounds);
        check_bounds(self.encounters.keys().map(plain)).map_err(|fault| fault.within("encounters"))?;
        check_bounds(self.compliance.keys().map(plain)).map_err(|fault| fault.within("compliance"))
    }
}

/// Thresholds of the classification. Angles are half-angles, in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EncounterConfig {
    /// Head-on (rule 14): each vessel sees the other within this angle of right ahead, and their
    /// courses are reciprocal within this angle. 13 degrees after Woerner et al., *Autonomous Robots*
    /// 43 (2019) 967-991.
    pub head_on_deg: f64,
    /// Abaft the beam (rule 13b): a vessel that comes up from more than 22.5 degrees abaft another's
    /// beam overtakes it; 90 + 22.5 degrees from right ahead.
    pub abaft_deg: f64,
    /// Risk of collision (rule 7) begins when DCPA falls below this ...
    pub risk_dcpa_m: f64,
    /// ... and the closest point of approach is less than this away.
    pub risk_tcpa_s: f64,
    /// A risk that has begun ends when DCPA exceeds `risk_dcpa_m` times this factor ...
    pub clear_dcpa_factor: f64,
    /// ... or when the closest point of approach lies this long in the past (rule 13d: past and clear).
    pub past_and_clear_s: f64,
}

impl EncounterConfig {
    /// Every key, for readers and writers.
    pub(crate) fn keys(&mut self) -> [BoundedKey<'_>; 6] {
        [
            ("head_on_deg", &mut self.head_on_deg, [0.0, 90.0]),
            ("abaft_deg", &mut self.abaft_deg, [90.0, 180.0]),
            ("risk_dcpa_m", &mut self.risk_dcpa_m, [1.0, 1e5]),
            ("risk_tcpa_s", &mut self.risk_tcpa_s, [1.0, 1e5]),
            ("clear_dcpa_factor", &mut self.clear_dcpa_factor, [1.0, 100.0]),
            ("past_and_clear_s", &mut self.past_and_clear_s, [0.0, 1e5]),
        ]
    }
}

impl Default for EncounterConfig {
    fn default() -> Self {
        Self {
            head_on_deg: 13.0,
            abaft_deg: 112.5,
            risk_dcpa_m: M_PER_NMI,
            risk_tcpa_s: 1800.0,
            clear_dcpa_factor: 1.5,
            past_and_clear_s: 60.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_threshold_out_of_bounds_is_named_with_a_remedy() {
        assert_eq!(RulesConfig::default().check(), Ok(()));
        let mut rules = RulesConfig::default();
        rules.encounters.abaft_deg = 60.0;
        let expected =
            Fault::new("encounters.abaft_deg", "60 is not possible here", "write a number from 90 to 180");
        assert_eq!(rules.check(), Err(expected));
        let mut rules = RulesConfig::default();
        rules.compliance.early_s = f64::NAN;
        assert_eq!(rules.check().unwrap_err().key, "compliance.early_s");
    }

    #[test]
    fn every_key_can_be_read_and_written() {
        let count = |table: &toml::Value| table.as_table().map_or(0, toml::Table::len);
        let mut rules = RulesConfig::default();
        let written = toml::Value::try_from(rules).unwrap();
        assert_eq!(count(&written["encounters"]), rules.encounters.keys().len());
        assert_eq!(count(&written["compliance"]), rules.compliance.keys().len());
        for (table, key) in [("encounters", "risk_tcpa_s"), ("compliance", "safe_contacts")] {
            assert!(written[table].get(key).is_some(), "{key}");
        }
    }
}
