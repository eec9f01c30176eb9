//! The numbers that make a ship: KVLCC2, with the sets of them that are in use.

use serde::{Deserialize, Serialize};

/// Which of the two values that the literature leaves open go with the published coefficients of
/// KVLCC2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ParameterSet {
    /// `w_P0 = 0.40` and `R_0' = 0.0165`. The resistance is *fitted* so that advance and tactical
    /// diameter come out as in the published calculation; it is not read from the paper.
    #[default]
    Benchmark,
    /// `w_P0 = 0.35` and `R_0' = 0.022`, as printed. At self-propulsion revolutions the turning circle
    /// comes out 6 to 11 % smaller than the published calculation.
    AsPrinted,
    /// `w_P0 = 0.35` and `R_0' = 0.0076`: an estimate for the ship itself instead of its model, whose
    /// results cannot be compared with those of the model.
    TrueFullScale,
}

impl ParameterSet {
    /// The coefficients with this set's values.
    #[must_use]
    pub fn parameters(self) -> MmgParameters {
        let (wake_fraction, resistance) = match self {
            Self::Benchmark => (0.40, 0.0165),
            Self::AsPrinted => (0.35, 0.022),
            Self::TrueFullScale => (0.35, 0.0076),
        };
        MmgParameters { wake_fraction, resistance, ..MmgParameters::default() }
    }
}

/// Windage of a ship, with coefficients after Fossen, *Handbook of Marine Craft Hydrodynamics and
/// Motion Control* (2011), section 8.1, for hulls symmetric fore and aft.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Windage {
    /// Frontal area above water, in square metres.
    pub frontal_area_m2: f64,
    /// Lateral area above water, in square metres.
    pub lateral_area_m2: f64,
    /// Longitudinal force coefficient `c_x`: `C_X = -c_x cos(gamma)`.
    pub c_x: f64,
    /// Lateral force coefficient `c_y`: `C_Y = c_y sin(gamma)`.
    pub c_y: f64,
    /// Yaw moment coefficient `c_n`: `C_N = c_n sin(2 gamma)`.
    pub c_n: f64,
    /// Density of air over density of water.
    pub density_ratio: f64,
}

impl Default for Windage {
    /// Areas estimated from the main dimensions of KVLCC2 (freeboard of 9.2 m and a deckhouse); they
    /// are not published. Coefficients from the middle of the ranges that Fossen gives.
    fn default() -> Self {
        Self {
            frontal_area_m2: 1100.0,
            lateral_area_m2: 3800.0,
            c_x: 0.7,
            c_y: 0.825,
            c_n: 0.125,
            density_ratio: 1.225 / 1025.0,
        }
    }
}

/// Dimensions and coefficients of a ship. Lengths along the hull whose name ends in `_over_length`
/// are fractions of `L_pp`, positive forward of midship. Hull derivatives are made non-dimensional by
/// `1/2 rho L d U^2` (moments: `1/2 rho L^2 d U^2`), masses by `1/2 rho L^2 d`, moments of inertia by
/// `1/2 rho L^4 d`; the density of water cancels.
///
/// The default is KVLCC2 at full scale in deep water (tables 1 and 3) with the values of
/// [`ParameterSet::Benchmark`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)] // The names of the hull derivatives say all there is to say of them.
pub struct MmgParameters {
    /// Length between perpendiculars `L_pp`, in metres.
    pub length_m: f64,
    /// Beam, in metres.
    pub beam_m: f64,
    /// Draught `d`, in metres.
    pub draught_m: f64,
    /// Displacement volume, in cubic metres.
    pub displacement_m3: f64,
    /// Centre of gravity forward of midship `x_G`, in metres.
    pub centre_of_gravity_m: f64,
    /// Radius of gyration in yaw about the centre of gravity, over length.
    pub gyration_over_length: f64,
    /// Design speed, in metres per second.
    pub design_speed_mps: f64,

    /// Added mass in surge `m_x'`.
    pub added_mass_x: f64,
    /// Added mass in sway `m_y'`.
    pub added_mass_y: f64,
    /// Added moment of inertia in yaw `J_z'`.
    pub added_inertia_z: f64,

    /// Resistance `R_0'`.
    pub resistance: f64,
    pub x_vv: f64,
    pub x_vr: f64,
    pub x_rr: f64,
    pub x_vvvv: f64,
    pub y_v: f64,
    pub y_r: f64,
    pub y_vvv: f64,
    pub y_vvr: f64,
    pub y_vrr: f64,
    pub y_rrr: f64,
    pub n_v: f64,
    pub n_r: f64,
    pub n_vvv: f64,
    pub n_vvr: f64,
    pub n_vrr: f64,
    pub n_rrr: f64,

    /// Diameter of the propeller `D_P`, in metres.
    pub propeller_diameter_m: f64,
    /// Where the propeller sits, `x_P'`.
    pub propeller_over_length: f64,
    /// Thrust deduction `t_P`.
    pub thrust_deduction: f64,
    /// Wake fraction at the propeller on a straight course `w_P0`.
    pub wake_fraction: f64,
    /// How fast the wake fades with the drift at the propeller, `C_1`.
    pub wake_decay: f64,
    /// Where the wake tends to at drift from starboard (`beta_P > 0`), `C_2`.
    pub wake_limit_positive: f64,
    /// Where the wake tends to at drift from port (`beta_P < 0`), `C_2`.
    pub wake_limit_negative: f64,
    /// Thrust coefficient `K_T = k_0 + k_1 J + k_2 J^2`.
    pub thrust_k0: f64,
    pub thrust_k1: f64,
    pub thrust_k2: f64,

    /// Rudder area `A_R`, in square metres.
    pub rudder_area_m2: f64,
    /// Rudder height `H_R`, in metres.
    pub rudder_height_m: f64,
    /// Where the rudder sits, `x_R'`.
    pub rudder_over_length: f64,
    /// Lift gradient `f_alpha`: that of the whole rudder's aspect ratio.
    pub rudder_lift_gradient: f64,
    /// Steering resistance deduction `t_R`.
    pub steering_deduction: f64,
    /// Increase of the lateral force by the hull `a_H`.
    pub hull_force_factor: f64,
    /// Where that increase acts, `x_H'`.
    pub hull_force_over_length: f64,
    /// Wake at the rudder over wake at the propeller, `epsilon`.
    pub wake_ratio: f64,
    /// Share of the propeller's race that the rudder feels, `kappa`.
    pub race_factor: f64,
    /// Effective position of the rudder in its inflow `l_R'`.
    pub inflow_over_length: f64,
    /// Flow straightening `gamma_R` at `beta_R > 0`.
    pub straightening_positive: f64,
    /// Flow straightening `gamma_R` at `beta_R < 0`.
    pub straightening_negative: f64,

    /// Largest rudder angle, in degrees.
    pub max_rudder_deg: f64,
    /// Rate at which the rudder moves, in degrees per second.
    pub rudder_rate_deg_per_s: f64,
    /// Speed under which hull forces are taken at this speed, in metres per second: the polynomials
    /// are in `r L / U` and know no ship at rest.
    pub low_speed_mps: f64,
    /// What the wind takes hold of.
    pub windage: Windage,
}

impl MmgParameters {
    /// A ship of the same form with another length, after Froude's law of similarity: lengths go with
    /// the scale, areas with its square, volumes with its cube, times and speeds with its root. All
    /// coefficients stay, as if friction followed the same law: at equal Froude numbers the ship makes
    /// the same track, over its length.
    #[must_use]
    pub fn scaled_to(self, length_m: f64) -> Self {
        let scale = length_m / self.length_m;
        let (square, root) = (scale * scale, scale.sqrt());
        Self {
            length_m,
            beam_m: self.beam_m * scale,
            draught_m: self.draught_m * scale,
            displacement_m3: self.displacement_m3 * square * scale,
            centre_of_gravity_m: self.centre_of_gravity_m * scale,
            design_speed_mps: self.design_speed_mps * root,
            propeller_diameter_m: self.propeller_diameter_m * scale,
            rudder_area_m2: self.rudder_area_m2 * square,
            rudder_height_m: self.rudder_height_m * scale,
            rudder_rate_deg_per_s: self.rudder_rate_deg_per_s / root,
            low_speed_mps: self.low_speed_mps * root,
            windage: Windage {
                frontal_area_m2: self.windage.frontal_area_m2 * square,
                lateral_area_m2: self.windage.lateral_area_m2 * square,
                ..self.windage
            },
            ..self
        }
    }

    /// The time in which the ship makes its length at its design speed, in seconds: the unit that
    /// manoeuvres are measured in.
    #[must_use]
    pub fn time_unit_s(&self) -> f64 {
        self.length_m / self.design_speed_mps
    }
}

impl Default for MmgParameters {
    fn default() -> Self {
        Self {
            length_m: 320.0,
            beam_m: 58.0,
            draught_m: 20.8,
            displacement_m3: 312_600.0,
            centre_of_gravity_m: 11.2,
            gyration_over_length: 0.25,
            design_speed_mps: 15.5 * crate::geo::MPS_PER_KNOT,
            added_mass_x: 0.022,
            added_mass_y: 0.223,
            added_inertia_z: 0.011,
            resistance: 0.0165,
            x_vv: -0.040,
            x_vr: 0.002,
            x_rr: 0.011,
            x_vvvv: 0.771,
            y_v: -0.315,
            y_r: 0.083,
            y_vvv: -1.607,
            y_vvr: 0.379,
            y_vrr: -0.391,
            y_rrr: 0.008,
            n_v: -0.137,
            n_r: -0.049,
            n_vvv: -0.030,
            n_vvr: -0.294,
            n_vrr: 0.055,
            n_rrr: -0.013,
            propeller_diameter_m: 9.86,
            propeller_over_length: -0.48,
            thrust_deduction: 0.22,
            wake_fraction: 0.40,
            wake_decay: 2.0,
            wake_limit_positive: 1.6,
            wake_limit_negative: 1.1,
            thrust_k0: 0.2931,
            thrust_k1: -0.2753,
            thrust_k2: -0.1385,
            rudder_area_m2: 112.5,
            rudder_height_m: 15.8,
            rudder_over_length: -0.5,
            rudder_lift_gradient: 2.747,
            steering_deduction: 0.387,
            hull_force_factor: 0.312,
            hull_force_over_length: -0.464,
            wake_ratio: 1.09,
            race_factor: 0.50,
            inflow_over_length: -0.710,
            straightening_positive: 0.640,
            straightening_negative: 0.395,
            max_rudder_deg: 35.0,
            rudder_rate_deg_per_s: 1.76,
            low_speed_mps: 0.5,
            windage: Windage::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_the_benchmark_set() {
        assert_eq!(MmgParameters::default(), ParameterSet::Benchmark.parameters());
        assert_eq!(ParameterSet::AsPrinted.parameters().resistance, 0.022);
    }
}
