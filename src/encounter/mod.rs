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

use crate::geo::M_PER_NMI;

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
