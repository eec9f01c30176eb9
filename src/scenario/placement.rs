//! Placing a target ship relative to own ship: by bearing and range, by DCPA and TCPA, or by both.
//!
//! With `r` the target's position from own ship and `w` its velocity relative to own ship's, both
//! moving linearly, the closest point of approach after `T` is `c = r + T w`, with `|c| = DCPA` and
//! `c` at right angles to `w`. Two of the three vectors give the third, up to the side on which the
//! target passes: two solutions, mirrored on `r` or on `w`, which [`Passes`] tells apart.

use serde::{Deserialize, Serialize};

use super::section::either;
use crate::angle::Nautical;
use crate::config::Fault;
use crate::geo::{Displacement, Position, Velocity};

/// Which way a target passes own ship: where it crosses own ship's course line (ahead, astern), or
/// on which side of own ship it is when it comes abeam.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Passes {
    /// Across own ship's bow.
    Ahead,
    /// Across own ship's wake.
    Astern,
    /// On own ship's port side.
    Port,
    /// On own ship's starboard side.
    Starboard,
}

impl Passes {
    /// The words of a scenario file.
    pub(super) const WORDS: [(&'static str, Self); 4] = [
        ("ahead", Self::Ahead),
        ("astern", Self::Astern),
        ("port", Self::Port),
        ("starboard", Self::Starboard),
    ];

    fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, passes)| *passes == self).map_or("", |(word, _)| word)
    }

    /// Whether a closest point of approach at `cpa` from own ship is passed this way. The relative
    /// track crosses own ship's course line at `|cpa|^2 / (cpa . course)` from it, so that the sign
    /// of the component decides; likewise abeam.
    fn describes(self, cpa: Displacement, own_course: Nautical) -> bool {
        let (ahead_m, starboard_m) = (cpa.along_m(own_course), cpa.starboard_of_m(own_course));
        let least_m = 1e-6 * cpa.length_m();
        match self {
            Self::Ahead => ahead_m > least_m,
            Self::Astern => ahead_m < -least_m,
            Self::Starboard => starboard_m > least_m,
            Self::Port => starboard_m < -least_m,
        }
    }
}

/// A direction in which a target is seen from own ship.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bearing {
    /// Clockwise from north.
    True(Nautical),
    /// Radians clockwise from own ship's course.
    Relative(f64),
}

impl Bearing {
    fn direction(self, own_course: Nautical) -> Nautical {
        match self {
            Self::True(bearing) => bearing,
            Self::Relative(bearing_rad) => own_course.turned(bearing_rad),
        }
    }
}

/// The closest point of approach a target is to have with own ship, both moving linearly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WantedCpa {
    /// Distance at the closest point of approach, in metres.
    pub dcpa_m: f64,
    /// Time to it, in seconds; above zero.
    pub tcpa_s: f64,
    /// Which of the two solutions; not needed where the DCPA is zero.
    pub passes: Option<Passes>,
}

/// Position and velocity of a vessel at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics {
    /// Where it is.
    pub position: Position,
    /// Its velocity over ground.
    pub velocity: Velocity,
}

/// Where a target is that is seen from own ship at a bearing and range.
#[must_use]
pub fn seen_at(own: Kinematics, bearing: Bearing, range_m: f64) -> Position {
    own.position + Displacement::towards(bearing.direction(own.velocity.course()), range_m)
}

/// The target at a bearing and range that moves so as to have a given closest point of approach.
///
/// # Errors
/// A DCPA beyond the range, a speed above `speed_max_mps`, or no single solution.
pub fn at_range_with_cpa(
    own: Kinematics,
    bearing: Bearing,
    range_m: f64,
    cpa: WantedCpa,
    speed_max_mps: f64,
) -> Result<Kinematics, Fault> {
    if cpa.dcpa_m > range_m {
        return Err(Fault::new(
            "dcpa_m",
            format!(
                "a closest distance of {:.0} m cannot lie beyond the range of {range_m:.0} m",
                cpa.dcpa_m
            ),
            "write a smaller DCPA or a larger range",
        ));
    }
    let own_course = own.velocity.course();
    let direction = bearing.direction(own_course);
    let range = Displacement::towards(direction, range_m);
    let half_angle_rad = (cpa.dcpa_m / range_m).acos();
    let candidates = [half_angle_rad, -half_angle_rad]
        .map(|turn_rad| Displacement::towards(direction.turned(turn_rad), cpa.dcpa_m));
    let closest = single_solution(candidates, cpa, own_course)?;
    let velocity = own.velocity + (closest + -range).per_seconds(cpa.tcpa_s);
    let reachable = velocity.speed_mps() <= speed_max_mps;
    if !reachable {
        return Err(Fault::new(
            "tcpa_s",
            format!(
                "to be there in {:.0} s the target has to make {:.1} m/s, more than the {speed_max_mps:.0} m/s allowed",
                cpa.tcpa_s,
                velocity.speed_mps()
            ),
            "write a longer TCPA or a shorter range",
        ));
    }
    Ok(Kinematics { position: own.position + range, velocity })
}

/// The target of a given velocity, placed so as to have a given closest point of approach.
///
/// # Errors
/// Equal velocities, which never approach, or no single solution.
pub fn on_course_with_cpa(own: Kinematics, velocity: Velocity, cpa: WantedCpa) -> Result<Kinematics, Fault> {
    let relative = velocity - own.velocity;
    if relative.speed_mps() < 1e-6 {
        return Err(Fault::new(
            "course_deg",
            "own ship has the same course and speed, so the two never approach",
            "change course or speed, or place the target by bearing and range",
        ));
    }
    let abeam = |turn_rad: f64| Displacement::towards(relative.course().turned(turn_rad), cpa.dcpa_m);
    let quarter_turn = std::f64::consts::FRAC_PI_2;
    let closest = single_solution([abeam(quarter_turn), abeam(-quarter_turn)], cpa, own.velocity.course())?;
    Ok(Kinematics { position: own.position + closest - relative.for_seconds(cpa.tcpa_s), velocity })
}

fn single_solution(
    candidates: [Displacement; 2],
    cpa: WantedCpa,
    own_course: Nautical,
) -> Result<Displacement, Fault> {
    // Within a millimetre the two are one: a collision course, or a target abreast at its range.
    if (candidates[0] + -candidates[1]).length_m() < 1e-3 {
        return Ok(candidates[0]);
    }
    // Only words that tell the two apart are worth offering.
    let telling = Passes::WORDS
        .iter()
        .filter(|(_, passes)| candidates.iter().filter(|c| passes.describes(**c, own_course)).count() == 1)
        .map(|(word, _)| format!("passes = \"{word}\""))
        .collect::<Vec<_>>();
    let remedy = format!("write {}", either(&telling));
    let Some(passes) = cpa.passes else {
        return Err(Fault::new("passes", "is missing: the target can pass own ship in two ways", remedy));
    };
    let mut fitting = candidates.into_iter().filter(|candidate| passes.describes(*candidate, own_course));
    match (fitting.next(), fitting.next()) {
        (Some(only), None) => Ok(only),
        (None, _) => {
            Err(Fault::new("passes", format!("this geometry cannot pass {}", place(passes)), remedy))
        }
        (Some(_), Some(_)) => {
            Err(Fault::new("passes", format!("both solutions pass {}", place(passes)), remedy))
        }
    }
}

fn place(passes: Passes) -> String {
    match passes {
        Passes::Ahead | Passes::Astern => passes.word().to_owned(),
        Passes::Port | Passes::Starboard => format!("to {}", passes.word()),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn own(course_deg: f64, speed_mps: f64) -> Kinematics {
        Kinematics {
            position: Position { north_m: 100.0, east_m: -200.0 },
            velocity: Velocity::from_course(Nautical::from_degrees(course_deg), speed_mps),
        }
    }

    fn wanted(dcpa_m: f64, tcpa_s: f64, passes: Option<Passes>) -> WantedCpa {
        WantedCpa { dcpa_m, tcpa_s, passes }
    }

    /// Position of the target from own ship after `time_s`.
    fn relative_at(own: Kinematics, target: Kinematics, time_s: f64) -> Displacement {
        (target.position + target.velocity.for_seconds(time_s))
            - (own.position + own.velocity.for_seconds(time_s))
    }

    #[test]
    fn a_crossing_from_starboard_passes_ahead_or_astern_as_asked() {
        let own = own(0.0, 8.0);
        let bearing = Bearing::Relative(60_f64.to_radians());
        for (passes, ahead) in [(Passes::Ahead, true), (Passes::Astern, false)] {
            let target =
                at_range_with_cpa(own, bearing, 3000.0, wanted(400.0, 300.0, Some(passes)), 30.0).unwrap();
            let closest = relative_at(own, target, 300.0);
            assert!((closest.length_m() - 400.0).abs() < 1e-6);
            assert_eq!(closest.along_m(Nautical::NORTH) > 0.0, ahead);
        }
    }

    #[test]
    fn a_collision_course_needs_no_side() {
        let target = at_range_with_cpa(
            own(0.0, 8.0),
            Bearing::True(Nautical::NORTH),
            4800.0,
            wanted(0.0, 300.0, None),
            30.0,
        )
        .unwrap();
        assert!((target.velocity.north_mps + 8.0).abs() < 1e-9);
    }

    #[test]
    fn impossible_geometry_is_explained() {
        let bearing = Bearing::True(Nautical::NORTH);
        let fault =
            at_range_with_cpa(own(0.0, 8.0), bearing, 300.0, wanted(400.0, 300.0, None), 30.0).unwrap_err();
        assert_eq!(
            fault.to_string(),
            "dcpa_m: a closest distance of 400 m cannot lie beyond the range of 300 m; \
             write a smaller DCPA or a larger range"
        );
        let fault =
            at_range_with_cpa(own(0.0, 8.0), bearing, 9000.0, wanted(0.0, 60.0, None), 30.0).unwrap_err();
        assert_eq!(
            fault.to_string(),
            "tcpa_s: to be there in 60 s the target has to make 142.0 m/s, more than the 30 m/s allowed; \
             write a longer TCPA or a shorter range"
        );
        let same = own(45.0, 8.0);
        let fault = on_course_with_cpa(same, same.velocity, wanted(100.0, 60.0, None)).unwrap_err();
        assert_eq!(fault.key, "course_deg");
    }

    #[test]
    fn the_words_offered_are_those_that_tell_the_solutions_apart() {
        let head_on = Velocity::from_course(Nautical::from_degrees(180.0), 8.0);
        let fault = on_course_with_cpa(own(0.0, 8.0), head_on, wanted(200.0, 300.0, None)).unwrap_err();
        assert_eq!(fault.remedy, "write passes = \"port\" or passes = \"starboard\"");
        let ahead = wanted(200.0, 300.0, Some(Passes::Ahead));
        let fault = on_course_with_cpa(own(0.0, 8.0), head_on, ahead).unwrap_err();
        assert_eq!(fault.message, "this geometry cannot pass ahead");
    }

    proptest! {
        #[test]
        fn the_placed_target_has_the_cpa_that_was_asked_for(
            own_course_deg in 0.0..360.0_f64,
            bearing_deg in 0.0..360.0_f64,
            range_m in 500.0..10_000.0_f64,
            dcpa_fraction in 0.0..0.99_f64,
            tcpa_s in 60.0..3600.0_f64,
        ) {
            let own = own(own_course_deg, 7.0);
            let dcpa_m = dcpa_fraction * range_m;
            let bearing = Bearing::True(Nautical::from_degrees(bearing_deg));
            for (_, passes) in Passes::WORDS {
                let cpa = wanted(dcpa_m, tcpa_s, Some(passes));
                let Ok(target) = at_range_with_cpa(own, bearing, range_m, cpa, 1e9) else { continue };
                let closest = relative_at(own, target, tcpa_s);
                prop_assert!((closest.length_m() - dcpa_m).abs() < 1e-6 * range_m);
                prop_assert!(passes.describes(closest, own.velocity.course()) || dcpa_m < 1.0);
                // It is the minimum: a little earlier and a little later the two are no closer.
                for time_s in [0.99 * tcpa_s, 1.01 * tcpa_s] {
                    prop_assert!(relative_at(own, target, time_s).length_m() >= dcpa_m - 1e-6 * range_m);
                }
            }
        }

        #[test]
        fn the_target_of_a_given_course_is_placed_where_it_has_the_cpa(
            course_deg in 0.0..360.0_f64,
            speed_mps in 0.5..15.0_f64,
            dcpa_m in 0.0..3000.0_f64,
            tcpa_s in 1.0..3600.0_f64,
        ) {
            let own = own(20.0, 7.0);
            let velocity = Velocity::from_course(Nautical::from_degrees(course_deg), speed_mps);
            for (_, passes) in Passes::WORDS {
                let Ok(target) = on_course_with_cpa(own, velocity, wanted(dcpa_m, tcpa_s, Some(passes))) else { continue };
                prop_assert_eq!(target.velocity, velocity);
                prop_assert!((relative_at(own, target, tcpa_s).length_m() - dcpa_m).abs() < 1e-5);
                for time_s in [0.9 * tcpa_s, 1.1 * tcpa_s] {
                    prop_assert!(relative_at(own, target, time_s).length_m() >= dcpa_m - 1e-5);
                }
            }
        }
    }
}
