//! Forces on a ship, and the accelerations they make: equations 4 to 24 of Yasukawa & Yoshimura
//! (2015).
//!
//! Forces are divided by the density of water, since it cancels.

use std::f64::consts::PI;

use super::parameters::{MmgParameters, Windage};
use crate::angle::Nautical;
use crate::geo::Velocity;

/// Where a ship is and how it moves through the water; its derivative by time has the same shape.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MmgMotion {
    /// Midship, metres north of the origin.
    pub north_m: f64,
    /// Midship, metres east of the origin.
    pub east_m: f64,
    /// Heading `psi` in radians clockwise from north, full turns counted.
    pub heading_rad: f64,
    /// Surge `u` through the water, in metres per second, positive ahead.
    pub surge_mps: f64,
    /// Sway `v` of midship through the water, in metres per second, positive to starboard.
    pub sway_mps: f64,
    /// Yaw rate `r`, in radians per second, positive to starboard.
    pub yaw_rate_rad_per_s: f64,
}

impl MmgMotion {
    /// `self + rate * duration_s`.
    #[must_use]
    pub fn plus(&self, rate: &Self, duration_s: f64) -> Self {
        Self {
            north_m: self.north_m + rate.north_m * duration_s,
            east_m: self.east_m + rate.east_m * duration_s,
            heading_rad: self.heading_rad + rate.heading_rad * duration_s,
            surge_mps: self.surge_mps + rate.surge_mps * duration_s,
            sway_mps: self.sway_mps + rate.sway_mps * duration_s,
            yaw_rate_rad_per_s: self.yaw_rate_rad_per_s + rate.yaw_rate_rad_per_s * duration_s,
        }
    }

    /// Speed through the water, in metres per second.
    #[must_use]
    pub fn speed_mps(&self) -> f64 {
        self.surge_mps.hypot(self.sway_mps)
    }
}

/// What rudder and propeller are doing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuators {
    /// Rudder angle `delta`, in radians, positive turns to starboard.
    pub rudder_rad: f64,
    /// Propeller revolutions `n` per second.
    pub revolutions_per_s: f64,
}

/// A steady wind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wind {
    /// The direction it blows **from**.
    pub from: Nautical,
    /// Speed over ground, in metres per second.
    pub speed_mps: f64,
}

/// Water and air around a ship: still, unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Surroundings {
    /// Velocity of the water over ground: where the current sets **towards**.
    pub current: Velocity,
    /// The wind, if any.
    pub wind: Option<Wind>,
}

/// A force in the ship's axes and a moment about midship, each over the density of water.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Force {
    /// Surge force `X`, positive ahead, in m^4/s^2.
    pub x: f64,
    /// Sway force `Y`, positive to starboard, in m^4/s^2.
    pub y: f64,
    /// Yaw moment `N`, positive to starboard, in m^5/s^2.
    pub n: f64,
}

impl std::ops::Add for Force {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, n: self.n + other.n }
    }
}

/// A ship's parameters with what follows from them once and for all: masses and moments of inertia
/// over the density of water.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hydrodynamics {
    parameters: MmgParameters,
    mass: f64,
    surge_mass: f64,
    sway_mass: f64,
    yaw_inertia: f64,
    /// `x_G m`, which couples sway and yaw.
    coupling: f64,
    max_rudder_rad: f64,
    rudder_rate_rad_per_s: f64,
}

/// How the water meets hull, propeller and rudder.
#[derive(Debug, Clone, Copy)]
struct Inflow {
    u: f64,
    /// Speed `U`, at least the lowest that hull forces are known for.
    speed: f64,
    /// `v' = v / U`.
    v: f64,
    /// `r' = r L / U`.
    r: f64,
    /// Drift angle `beta`.
    drift_rad: f64,
    /// Surge through the wake, `u (1 - w_P)`.
    at_propeller: f64,
}

impl Hydrodynamics {
    /// Of a ship with these parameters.
    #[must_use]
    pub fn new(parameters: MmgParameters) -> Self {
        let p = &parameters;
        let mass_unit = 0.5 * p.length_m * p.length_m * p.draught_m;
        let inertia_unit = mass_unit * p.length_m * p.length_m;
        let mass = p.displacement_m3;
        let gyration_m = p.gyration_over_length * p.length_m;
        Self {
            mass,
            surge_mass: mass + p.added_mass_x * mass_unit,
            sway_mass: mass + p.added_mass_y * mass_unit,
            yaw_inertia: mass * (gyration_m * gyration_m + p.centre_of_gravity_m * p.centre_of_gravity_m)
                + p.added_inertia_z * inertia_unit,
            coupling: p.centre_of_gravity_m * mass,
            max_rudder_rad: p.max_rudder_deg.to_radians(),
            rudder_rate_rad_per_s: p.rudder_rate_deg_per_s.to_radians(),
            parameters,
        }
    }

    /// The parameters.
    #[must_use]
    pub fn parameters(&self) -> &MmgParameters {
        &self.parameters
    }

    /// Largest rudder angle, in radians.
    #[must_use]
    pub fn max_rudder_rad(&self) -> f64 {
        self.max_rudder_rad
    }

    /// Rate at which the rudder moves, in radians per second.
    #[must_use]
    pub fn rudder_rate_rad_per_s(&self) -> f64 {
        self.rudder_rate_rad_per_s
    }

    /// Revolutions per second at which thrust meets resistance on a straight course: the
    /// self-propulsion point for a speed. Zero where no thrust is wanted.
    #[must_use]
    pub fn self_propulsion_per_s(&self, speed_mps: f64) -> f64 {
        let p = &self.parameters;
        if speed_mps <= 0.0 {
            return 0.0;
        }
        // (1 - t_P) D^2 (k_0 (n D)^2 + k_1 n D w + k_2 w^2) = 1/2 L d U^2 R_0', solved for n D.
        let w = speed_mps * (1.0 - p.wake_fraction);
        let resistance = 0.5 * p.length_m * p.draught_m * speed_mps * speed_mps * p.resistance;
        let wanted =
            resistance / ((1.0 - p.thrust_deduction) * p.propeller_diameter_m * p.propeller_diameter_m);
        let half = p.thrust_k1 * w / (2.0 * p.thrust_k0);
        let rest = (p.thrust_k2 * w * w - wanted) / p.thrust_k0;
        ((half * half - rest).sqrt() - half) / p.propeller_diameter_m
    }

    fn inflow(&self, motion: &MmgMotion) -> Inflow {
        let p = &self.parameters;
        let (u, v) = (motion.surge_mps, motion.sway_mps);
        let speed = (u * u + v * v).sqrt().max(p.low_speed_mps);
        let r = motion.yaw_rate_rad_per_s * p.length_m / speed;
        let drift_rad = (-v).atan2(u);
        // Equations 12 to 16: the wake fades with the drift angle at the propeller.
        let drift_at_propeller = drift_rad - p.propeller_over_length * r;
        let limit = if drift_at_propeller >= 0.0 { p.wake_limit_positive } else { p.wake_limit_negative };
        let fading = 1.0 + (1.0 - (-p.wake_decay * drift_at_propeller.abs()).exp()) * (limit - 1.0);
        let at_propeller = u * (1.0 - p.wake_fraction) * fading;
        Inflow { u, speed, v: v / speed, r, drift_rad, at_propeller }
    }

    /// Forces on the hull, equations 6 to 8.
    fn hull(&self, inflow: &Inflow) -> Force {
        let p = &self.parameters;
        let Inflow { u, speed, v, r, .. } = *inflow;
        let (vv, rr) = (v * v, r * r);
        // Resistance turns round with the ship's way.
        let resistance = p.resistance * (u / p.low_speed_mps).clamp(-1.0, 1.0);
        let x = -resistance + p.x_vv * vv + p.x_vr * v * r + p.x_rr * rr + p.x_vvvv * vv * vv;
        let y = v * (p.y_v + p.y_vvv * vv + p.y_vrr * rr) + r * (p.y_r + p.y_vvr * vv + p.y_rrr * rr);
        let n = v * (p.n_v + p.n_vvv * vv + p.n_vrr * rr) + r * (p.n_r + p.n_vvr * vv + p.n_rrr * rr);
        let unit = 0.5 * p.length_m * p.draught_m * speed * speed;
        Force { x: unit * x, y: unit * y, n: unit * p.length_m * n }
    }

    /// `K_T (n D)^2`: the thrust over `D^2`, equations 10 and 11 without the division by `n`.
    fn thrust_unit(&self, inflow: &Inflow, revolutions_per_s: f64) -> f64 {
        let p = &self.parameters;
        let (n_d, w) = (revolutions_per_s * p.propeller_diameter_m, inflow.at_propeller);
        p.thrust_k0 * n_d * n_d + p.thrust_k1 * n_d * w + p.thrust_k2 * w * w
    }

    /// Force on the rudder and what it induces on the hull, equations 17 to 24.
    fn rudder(&self, inflow: &Inflow, thrust_unit: f64, rudder_rad: f64) -> Force {
        let p = &self.parameters;
        let drift_at_rudder = inflow.drift_rad - p.inflow_over_length * inflow.r;
        let straightening =
            if drift_at_rudder >= 0.0 { p.straightening_positive } else { p.straightening_negative };
        let v_r = inflow.speed * straightening * drift_at_rudder;
        // Equation 23 times (1 - w_P)^2, which takes the division by J out of it.
        let w = inflow.at_propeller;
        let eta = p.propeller_diameter_m / p.rudder_height_m;
        let race = w + p.race_factor * ((w * w + 8.0 * thrust_unit / PI).max(0.0).sqrt() - w);
        let u_r = p.wake_ratio * (eta * race * race + (1.0 - eta) * w * w).sqrt();

        let angle_of_attack = rudder_rad - v_r.atan2(u_r);
        let normal =
            0.5 * p.rudder_area_m2 * (u_r * u_r + v_r * v_r) * p.rudder_lift_gradient * angle_of_attack.sin();
        let (sin, cos) = rudder_rad.sin_cos();
        let lever_m = (p.rudder_over_length + p.hull_force_factor * p.hull_force_over_length) * p.length_m;
        Force {
            x: -(1.0 - p.steering_deduction) * normal * sin,
            y: -(1.0 + p.hull_force_factor) * normal * cos,
            n: -lever_m * normal * cos,
        }
    }

    /// All forces on the ship.
    fn force(&self, motion: &MmgMotion, actuators: &Actuators) -> Force {
        let p = &self.parameters;
        let inflow = self.inflow(motion);
        let thrust_unit = self.thrust_unit(&inflow, actuators.revolutions_per_s);
        let thrust = p.propeller_diameter_m * p.propeller_diameter_m * thrust_unit;
        let propeller = Force { x: (1.0 - p.thrust_deduction) * thrust, ..Force::default() };
        self.hull(&inflow) + propeller + self.rudder(&inflow, thrust_unit, actuators.rudder_rad)
    }
}

/// The derivative of a ship's motion by time (equation 4 and the kinematics).
///
/// The current is steady and uniform, so that the equations hold as they stand for the motion
/// through the water (Fossen 2011, property 8.1).
#[must_use]
pub fn derivative(
    ship: &Hydrodynamics,
    motion: &MmgMotion,
    actuators: &Actuators,
    surroundings: &Surroundings,
) -> MmgMotion {
    let (u, v, r) = (motion.surge_mps, motion.sway_mps, motion.yaw_rate_rad_per_s);
    let (sin, cos) = motion.heading_rad.sin_cos();
    let over_ground = Velocity {
        north_mps: u * cos - v * sin + surroundings.current.north_mps,
        east_mps: u * sin + v * cos + surroundings.current.east_mps,
    };
    let mut force = ship.force(motion, actuators);
    if let Some(wind) = &surroundings.wind {
        force = force + wind_force(&ship.parameters, over_ground, (sin, cos), wind);
    }

    let surge = force.x + ship.sway_mass * v * r + ship.coupling * r * r;
    let sway = force.y - ship.surge_mass * u * r;
    let yaw = force.n - ship.coupling * u * r;
    let determinant = ship.sway_mass * ship.yaw_inertia - ship.coupling * ship.coupling;
    MmgMotion {
        north_m: over_ground.north_mps,
        east_m: over_ground.east_mps,
        heading_rad: r,
        surge_mps: surge / ship.surge_mass,
        sway_mps: (ship.yaw_inertia * sway - ship.coupling * yaw) / determinant,
        yaw_rate_rad_per_s: (ship.sway_mass * yaw - ship.coupling * sway) / determinant,
    }
}

/// Fossen (2011), equations 8.22 to 8.35: the force of the wind relative to the ship.
fn wind_force(
    parameters: &MmgParameters,
    over_ground: Velocity,
    (sin, cos): (f64, f64),
    wind: &Wind,
) -> Force {
    let Windage { frontal_area_m2, lateral_area_m2, c_x, c_y, c_n, density_ratio } = parameters.windage;
    let air = Velocity::from_course(wind.from.reciprocal(), wind.speed_mps) - over_ground;
    // The air's velocity in the ship's axes; `gamma` is the angle it comes from, off the bow.
    let ahead = air.north_mps * cos + air.east_mps * sin;
    let starboard = air.east_mps * cos - air.north_mps * sin;
    let pressure = 0.5 * density_ratio * (ahead * ahead + starboard * starboard);
    let gamma = (-starboard).atan2(-ahead);
    Force {
        x: -pressure * frontal_area_m2 * c_x * gamma.cos(),
        y: -pressure * lateral_area_m2 * c_y * gamma.sin(),
        n: -pressure * lateral_area_m2 * parameters.length_m * c_n * (2.0 * gamma).sin(),
    }
}

/// Moves a ship on by `step_s` with the classical Runge-Kutta method of fourth order, given its
/// actuators at the beginning, in the middle and at the end.
#[must_use]
pub fn runge_kutta(
    ship: &Hydrodynamics,
    motion: &MmgMotion,
    [begin, middle, end]: &[Actuators; 3],
    surroundings: &Surroundings,
    step_s: f64,
) -> MmgMotion {
    let k1 = derivative(ship, motion, begin, surroundings);
    let k2 = derivative(ship, &motion.plus(&k1, step_s / 2.0), middle, surroundings);
    let k3 = derivative(ship, &motion.plus(&k2, step_s / 2.0), middle, surroundings);
    let k4 = derivative(ship, &motion.plus(&k3, step_s), end, surroundings);
    let sixth_s = step_s / 6.0;
    motion.plus(&k1, sixth_s).plus(&k2, 2.0 * sixth_s).plus(&k3, 2.0 * sixth_s).plus(&k4, sixth_s)
}

impl Hydrodynamics {
    /// Where the rudder is `duration_s` after it was at `rudder_rad`, moving at its rate towards an
    /// ordered angle and no further than it can.
    #[must_use]
    pub fn rudder_after(&self, rudder_rad: f64, ordered_rad: f64, duration_s: f64) -> f64 {
        let ordered_rad = ordered_rad.clamp(-self.max_rudder_rad, self.max_rudder_rad);
        let reach_rad = self.rudder_rate_rad_per_s * duration_s;
        rudder_rad + (ordered_rad - rudder_rad).clamp(-reach_rad, reach_rad)
    }

    /// Moves a ship on by `step_s` while its rudder goes towards an ordered angle; returns the motion
    /// and the actuators at the end.
    #[must_use]
    pub fn advance(
        &self,
        motion: &MmgMotion,
        actuators: &Actuators,
        ordered_rudder_rad: f64,
        surroundings: &Surroundings,
        step_s: f64,
    ) -> (MmgMotion, Actuators) {
        let after = |duration_s: f64| Actuators {
            rudder_rad: self.rudder_after(actuators.rudder_rad, ordered_rudder_rad, duration_s),
            ..*actuators
        };
        let stages = [*actuators, after(step_s / 2.0), after(step_s)];
        (runge_kutta(self, motion, &stages, surroundings, step_s), stages[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ship() -> Hydrodynamics {
        Hydrodynamics::new(MmgParameters::default())
    }

    /// Midships at the design speed and its self-propulsion revolutions.
    fn approach(ship: &Hydrodynamics) -> (MmgMotion, Actuators) {
        let speed_mps = ship.parameters().design_speed_mps;
        let motion = MmgMotion { surge_mps: speed_mps, ..MmgMotion::default() };
        let revolutions_per_s = ship.self_propulsion_per_s(speed_mps);
        (motion, Actuators { rudder_rad: 0.0, revolutions_per_s })
    }

    fn accelerations(motion: &MmgMotion, actuators: &Actuators, surroundings: &Surroundings) -> MmgMotion {
        derivative(&ship(), motion, actuators, surroundings)
    }

    #[test]
    fn self_propulsion_is_where_the_source_has_it() {
        let ship = ship();
        assert!((ship.self_propulsion_per_s(15.5 * crate::geo::MPS_PER_KNOT) - 1.561).abs() < 0.001);
        assert_eq!(ship.self_propulsion_per_s(0.0), 0.0);
    }

    /// 0 % change of the approach speed at once, and less than 1 % over ten minutes.
    #[test]
    fn the_approach_speed_is_held() {
        let ship = ship();
        let (mut motion, mut actuators) = approach(&ship);
        let speed_mps = motion.surge_mps;
        for _ in 0..1200 {
            (motion, actuators) = ship.advance(&motion, &actuators, 0.0, &Surroundings::default(), 0.5);
        }
        assert!((motion.surge_mps / speed_mps - 1.0).abs() < 0.01, "{}", motion.surge_mps);
        assert!(motion.east_m.abs() < 1e-6 && motion.heading_rad.abs() < 1e-9);
    }

    #[test]
    fn positive_rudder_turns_to_starboard() {
        let (motion, actuators) = approach(&ship());
        let rate =
            accelerations(&motion, &Actuators { rudder_rad: 0.1, ..actuators }, &Surroundings::default());
        assert!(rate.yaw_rate_rad_per_s > 0.0 && rate.sway_mps < 0.0 && rate.surge_mps < 0.0);
        let rate =
            accelerations(&motion, &Actuators { rudder_rad: -0.1, ..actuators }, &Surroundings::default());
        assert!(rate.yaw_rate_rad_per_s < 0.0 && rate.sway_mps > 0.0);
    }

    #[test]
    fn current_sets_towards_its_direction_and_leaves_the_motion_through_the_water_alone() {
        let (motion, actuators) = approach(&ship());
        let current = Velocity::from_course(Nautical::from_degrees(90.0), 1.5);
        let still = accelerations(&motion, &actuators, &Surroundings::default());
        let drifting = accelerations(&motion, &actuators, &Surroundings { current, wind: None });
        assert!((drifting.east_m - still.east_m - 1.5).abs() < 1e-12);
        assert_eq!(drifting.surge_mps, still.surge_mps);
    }

    #[test]
    fn wind_blows_from_its_direction() {
        let (motion, actuators) = approach(&ship());
        let in_wind = |from_deg: f64| {
            let wind = Some(Wind { from: Nautical::from_degrees(from_deg), speed_mps: 20.0 });
            accelerations(&motion, &actuators, &Surroundings { wind, ..Surroundings::default() })
        };
        let calm = accelerations(&motion, &actuators, &Surroundings::default());
        // Head wind brakes, wind from astern pushes, wind from starboard sets the ship to port and, from
        // ahead of the beam, its bow too.
        assert!(in_wind(0.0).surge_mps < calm.surge_mps - 1e-4);
        assert!(in_wind(180.0).surge_mps > calm.surge_mps);
        assert!(in_wind(90.0).sway_mps < -1e-4);
        assert!(in_wind(270.0).sway_mps > 1e-4);
        assert!(in_wind(45.0).yaw_rate_rad_per_s < 0.0);
    }

    #[test]
    fn only_flow_straightening_and_wake_tell_port_from_starboard() {
        let parameters = MmgParameters {
            straightening_negative: 0.64,
            wake_limit_negative: 1.6,
            ..MmgParameters::default()
        };
        let ship = Hydrodynamics::new(parameters);
        let (motion, actuators) = approach(&ship);
        let turning = |side: f64| {
            let motion = MmgMotion { sway_mps: -0.8 * side, yaw_rate_rad_per_s: 0.005 * side, ..motion };
            let actuators = Actuators { rudder_rad: 0.3 * side, ..actuators };
            derivative(&ship, &motion, &actuators, &Surroundings::default())
        };
        let (starboard, port) = (turning(1.0), turning(-1.0));
        assert!((starboard.surge_mps - port.surge_mps).abs() < 1e-12);
        assert!((starboard.sway_mps + port.sway_mps).abs() < 1e-12);
        assert!((starboard.yaw_rate_rad_per_s + port.yaw_rate_rad_per_s).abs() < 1e-12);
    }

    #[test]
    fn a_ship_at_rest_stays_there_and_a_spinning_one_comes_to_rest() {
        let ship = ship();
        let still = Actuators { rudder_rad: 0.3, revolutions_per_s: 0.0 };
        let rate = derivative(&ship, &MmgMotion::default(), &still, &Surroundings::default());
        assert_eq!(rate, MmgMotion::default());
        let mut motion = MmgMotion { yaw_rate_rad_per_s: 0.01, ..MmgMotion::default() };
        for _ in 0..7200 {
            motion = runge_kutta(&ship, &motion, &[still; 3], &Surroundings::default(), 0.5);
        }
        assert!(motion.yaw_rate_rad_per_s.abs() < 1e-3 && motion.speed_mps() < 1.0, "{motion:?}");
    }

    #[test]
    fn the_rudder_moves_at_its_rate_and_stops_where_it_was_sent() {
        let ship = ship();
        let rate = 1.76_f64.to_radians();
        assert!((ship.rudder_after(0.0, 0.3, 2.0) - 2.0 * rate).abs() < 1e-12);
        assert!((ship.rudder_after(0.0, 0.3, 60.0) - 0.3).abs() < 1e-12);
        assert!((ship.rudder_after(0.0, -2.0, 60.0) + 35_f64.to_radians()).abs() < 1e-12);
    }
}
