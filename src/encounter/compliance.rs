//! How well own ship kept to the collision regulations in its encounters with a target ship.
//!
//! Each encounter begins as [`EncounterTracker`] says, ends when the vessels are past and clear, and is scored by what a judge could see on a
//! chart: where the vessels were and how they moved. Every part is a number from 0 to 1. The parts follow the
//! ideas of Woerner, Benjamin, Novitzky and Leonard, Quantifying protocol evaluation for autonomous collision
//! avoidance, *Autonomous Robots* 43 (2019) 967-991: a score of safety, reduced by what is late, too small to
//! be apparent or to the wrong side. The formulas are stated in `docs/encounters.md`.

use serde::{Deserialize, Serialize};

use super::classify::{Encounter, Role, Vantage};
use super::tracker::{EncounterTracker, Risk};
use super::{BoundedKey, EncounterConfig};
use crate::angle::Nautical;
use crate::cpa::linear;
use crate::geo::{Position, Velocity};
use crate::world::Approach;

/// What counts as good. The regulations name no numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ComplianceConfig {
    /// A passing at this many times the contact distance is as safe as any (rule 8d).
    pub safe_contacts: f64,
    /// An alteration of course that is readily apparent (rule 8b), in degrees.
    pub apparent_turn_deg: f64,
    /// A reduction of speed that is readily apparent, as a fraction of the speed.
    pub apparent_slowing: f64,
    /// An alteration of course that counts as action at all, in degrees.
    pub action_turn_deg: f64,
    /// A change of speed that counts as action at all, as a fraction of the speed.
    pub action_slowing: f64,
    /// Action this long before the closest point of approach is early (rules 8a, 16), in seconds; where the
    /// encounter begins later, action at its beginning is.
    pub early_s: f64,
    /// A stand-on vessel may act for itself once the closest point of approach is this near (rule 17a ii),
    /// in seconds.
    pub stand_on_until_s: f64,
}

impl ComplianceConfig {
    /// Every key, for readers and writers.
    pub(crate) fn keys(&mut self) -> [BoundedKey<'_>; 7] {
        [
            ("safe_contacts", &mut self.safe_contacts, [1.01, 100.0]),
            ("apparent_turn_deg", &mut self.apparent_turn_deg, [1.0, 180.0]),
            ("apparent_slowing", &mut self.apparent_slowing, [0.01, 1.0]),
            ("action_turn_deg", &mut self.action_turn_deg, [0.1, 180.0]),
            ("action_slowing", &mut self.action_slowing, [0.01, 1.0]),
            ("early_s", &mut self.early_s, [1.0, 1e5]),
            ("stand_on_until_s", &mut self.stand_on_until_s, [0.0, 1e5]),
        ]
    }
}

impl Default for ComplianceConfig {
    fn default() -> Self {
        Self {
            safe_contacts: 2.0,
            apparent_turn_deg: 30.0,
            apparent_slowing: 0.5,
            action_turn_deg: 5.0,
            action_slowing: 0.1,
            early_s: 600.0,
            stand_on_until_s: 480.0,
        }
    }
}

/// Own ship and one target ship at one time: where they are and how they move over ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairMoment {
    /// Own ship.
    pub own: (Position, Velocity),
    /// The target ship.
    pub target: (Position, Velocity),
}

impl PairMoment {
    fn vantage(&self) -> Vantage {
        Vantage::of(self.own, self.target)
    }

    fn risk(&self) -> Risk {
        let ((p, v), (q, w)) = (self.own, self.target);
        let cpa = linear::closest_approach(p.xy(), v.xy(), q.xy(), w.xy());
        Risk { dcpa_m: cpa.distance_m, tcpa_s: cpa.time_s }
    }
}

/// Parts of a score, each from 0 (bad) to 1 (good); nothing where a part does not apply.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ComplianceParts {
    /// Passing at a safe distance (rule 8d).
    pub passing_distance: f64,
    /// Turning to the side that rules 14a, 15 and 17c ask for.
    pub turn_side: Option<f64>,
    /// Leaving the target ship on the side that these rules ask for.
    pub passing_side: Option<f64>,
    /// Acting in ample time (rules 8a, 16).
    pub early: Option<f64>,
    /// Acting so that it is readily apparent (rules 8b, 16).
    pub substantial: Option<f64>,
    /// Keeping course and speed as the stand-on vessel (rule 17a i).
    pub stand_on: Option<f64>,
}

impl ComplianceParts {
    /// The score: passing distance times the mean of the other parts that apply.
    #[must_use]
    pub fn score(&self) -> f64 {
        let others = [self.turn_side, self.passing_side, self.early, self.substantial, self.stand_on];
        let (sum, count) =
            others.into_iter().flatten().fold((0.0, 0), |(sum, count), part| (sum + part, count + 1));
        self.passing_distance * if count > 0 { sum / f64::from(count) } else { 1.0 }
    }
}

/// One encounter of an episode, and how well own ship kept to the regulations in it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EncounterReport {
    /// Its kind, as decided when it began.
    pub encounter: Encounter,
    /// Own ship's role from beginning to end.
    pub role: Role,
    /// When it began, in seconds after the start of the episode.
    pub begin_s: f64,
    /// When it was past and clear, or the episode ended, in seconds after the start.
    pub end_s: f64,
    /// The smallest distance of the reference points in it, in metres.
    pub passing_distance_m: f64,
    /// When that was, in seconds after the start.
    pub passing_s: f64,
    /// When own ship first acted before that, in seconds after the start.
    pub action_s: Option<f64>,
    /// Parts of the score.
    pub parts: ComplianceParts,
    /// The score, 0 to 1.
    pub score: f64,
}

/// Every encounter of own ship with one target ship, in the order of time. `moments` are `dt_s` apart, the
/// start first; `contact_distance_m` is the distance of reference points that counts as contact.
#[must_use]
pub fn assess(
    moments: &[PairMoment],
    dt_s: f64,
    contact_distance_m: f64,
    encounters: &EncounterConfig,
    config: &ComplianceConfig,
) -> Vec<EncounterReport> {
    // A wide turn opens the distance at once, but the encounter lasts until past and clear (rule 8d).
    let lasting = EncounterConfig { clear_dcpa_factor: f64::INFINITY, ..*encounters };
    let mut tracker = EncounterTracker::new(lasting);
    let mut spans: Vec<Span> = Vec::new();
    let mut current = None;
    for (step, moment) in moments.iter().enumerate() {
        let seen = tracker.observe(&moment.vantage(), moment.risk());
        match (seen, spans.last_mut()) {
            (Some(_), Some(span)) if current == seen => span.last = step,
            (Some(encounter), _) => spans.push(Span { encounter, first: step, last: step }),
            (None, _) => {}
        }
        current = seen;
    }
    let judge = Judge { moments, dt_s, contact_distance_m, config };
    spans.into_iter().map(|span| judge.report(span)).collect()
}

/// Steps over which one encounter lasted.
#[derive(Debug, Clone, Copy)]
struct Span {
    encounter: Encounter,
    first: usize,
    last: usize,
}

struct Judge<'a> {
    moments: &'a [PairMoment],
    dt_s: f64,
    contact_distance_m: f64,
    config: &'a ComplianceConfig,
}

/// Own ship's deviations from its course and speed at the beginning of an encounter, over some of its steps.
#[derive(Debug, Clone, Copy, Default)]
struct Deviation {
    /// Largest to starboard, in degrees.
    starboard_deg: f64,
    /// Largest to port, in degrees.
    port_deg: f64,
    /// Largest change of speed either way, as a fraction.
    speed: f64,
}

impl Judge<'_> {
    fn report(&self, span: Span) -> EncounterReport {
        let (closest_step, passing_distance_m, passing_s) = self.closest(span);
        let action = (span.first..=closest_step).find(|&step| {
            let deviation = self.deviation(span, step..=step);
            deviation.starboard_deg.max(deviation.port_deg) >= self.config.action_turn_deg
                || deviation.speed >= self.config.action_slowing
        });
        let parts = self.parts(span, closest_step, passing_distance_m, action);
        EncounterReport {
            encounter: span.encounter,
            role: span.encounter.role(),
            begin_s: self.time_s(span.first),
            end_s: self.time_s(span.last),
            passing_distance_m,
            passing_s,
            action_s: action.map(|step| self.time_s(step)),
            parts,
            score: parts.score(),
        }
    }

    fn parts(&self, span: Span, closest: usize, distance_m: f64, action: Option<usize>) -> ComplianceParts {
        let config = self.config;
        let reserve_m = (config.safe_contacts - 1.0).max(f64::EPSILON) * self.contact_distance_m;
        let passing_distance = ((distance_m - self.contact_distance_m) / reserve_m).clamp(0.0, 1.0);
        let nothing = ComplianceParts {
            passing_distance,
            turn_side: None,
            passing_side: None,
            early: None,
            substantial: None,
            stand_on: None,
        };
        let whole = self.deviation(span, span.first..=closest);
        let to_starboard = action.map(|_| share(whole.starboard_deg, whole.port_deg));
        if span.encounter.role() == Role::StandOn {
            let crosses = span.encounter == Encounter::CrossingFromPort;
            return ComplianceParts {
                stand_on: self.stand_on(span, closest),
                turn_side: to_starboard.flatten().filter(|_| crosses),
                ..nothing
            };
        }
        let passing_side = self.passing_side(span.encounter, closest);
        if action.is_none() && passing_distance == 1.0 {
            // The target ship or the geometry kept them apart: no action was called for.
            return ComplianceParts { passing_side, ..nothing };
        }
        ComplianceParts {
            turn_side: (span.encounter != Encounter::Overtaking)
                .then(|| to_starboard.map_or(Some(0.0), |share| share))
                .flatten(),
            passing_side,
            early: Some(action.map_or(0.0, |step| self.early(span, step))),
            substantial: Some(self.apparent(whole)),
            ..nothing
        }
    }

    fn time_s(&self, step: usize) -> f64 {
        step as f64 * self.dt_s
    }

    /// The step of an encounter that begins or ends nearest to its smallest distance, and that distance with
    /// its time, both vessels moving straight between steps.
    fn closest(&self, span: Span) -> (usize, f64, f64) {
        let between = |step: usize| self.moments[step].target.0.xy() - self.moments[step].own.0.xy();
        let mut best = (span.first, between(span.first).norm(), self.time_s(span.first));
        for step in span.first..span.last {
            let within = Approach::new(between(step), between(step + 1)).closest();
            if within.distance_m < best.1 {
                let nearest = if within.fraction < 0.5 { step } else { step + 1 };
                best = (nearest, within.distance_m, self.time_s(step) + within.fraction * self.dt_s);
            }
        }
        best
    }

    fn deviation(&self, span: Span, steps: impl Iterator<Item = usize>) -> Deviation {
        let course = |step: usize| -> Nautical { self.moments[step].own.1.course() };
        let speed_mps = |step: usize| self.moments[step].own.1.speed_mps();
        let (course_before, speed_before_mps) = (course(span.first), speed_mps(span.first));
        steps.fold(Deviation::default(), |most, step| {
            // A ship that has stopped has no course to speak of.
            let turned = if speed_mps(step) > 0.0 { course(step).turn_from(course_before) } else { 0.0 };
            let turned_deg = turned.to_degrees();
            let speed = (speed_mps(step) - speed_before_mps).abs() / speed_before_mps.max(f64::EPSILON);
            Deviation {
                starboard_deg: most.starboard_deg.max(turned_deg),
                port_deg: most.port_deg.max(-turned_deg),
                speed: most.speed.max(speed),
            }
        })
    }

    /// How apparent a deviation is: 1 where course or speed changes as much as is readily apparent.
    fn apparent(&self, deviation: Deviation) -> f64 {
        let turn = deviation.starboard_deg.max(deviation.port_deg) / self.config.apparent_turn_deg;
        turn.max(deviation.speed / self.config.apparent_slowing).min(1.0)
    }

    /// Time left at the first action, of what there was.
    fn early(&self, span: Span, action: usize) -> f64 {
        let available_s = self.moments[span.first].risk().tcpa_s.max(self.dt_s);
        let left_s = available_s - self.time_s(action - span.first);
        (left_s / available_s.min(self.config.early_s)).clamp(0.0, 1.0)
    }

    /// Whether the target ship was left on the side that the rules ask for.
    fn passing_side(&self, encounter: Encounter, closest: usize) -> Option<f64> {
        let vantage = self.moments[closest].vantage();
        let right = match encounter {
            Encounter::HeadOn => vantage.target_bearing_rad < 0.0,
            // Not ahead of the other vessel.
            Encounter::CrossingFromStarboard => vantage.own_bearing_rad.abs() > std::f64::consts::FRAC_PI_2,
            _ => return None,
        };
        Some(if right { 1.0 } else { 0.0 })
    }

    /// How far course and speed were kept as long as the other vessel could still be expected to act.
    fn stand_on(&self, span: Span, closest: usize) -> Option<f64> {
        let bound = |step: &usize| self.moments[*step].risk().tcpa_s > self.config.stand_on_until_s;
        let first = span.first;
        // Own action changes the TCPA; once own ship was free to act it stays so.
        let kept: Vec<usize> = (first..=closest).take_while(bound).collect();
        (!kept.is_empty()).then(|| 1.0 - self.apparent(self.deviation(span, kept.into_iter())))
    }
}

/// The first of two amounts as a share of both; nothing where both are none.
fn share(of: f64, other: f64) -> Option<f64> {
    (of + other > 0.0).then(|| of / (of + other))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 5.0;
    const CONTACT_M: f64 = 300.0;

    fn at(north_m: f64, east_m: f64) -> Position {
        Position { north_m, east_m }
    }

    fn course(degrees: f64, speed_mps: f64) -> Velocity {
        Velocity::from_course(Nautical::from_degrees(degrees), speed_mps)
    }

    /// Own ship from the origin to the north at 6 m/s, with turns of course and factors of speed from some
    /// times on; the target ship keeps its velocity.
    fn run(target: (Position, Velocity), orders: &[(f64, f64, f64)], duration_s: f64) -> Vec<PairMoment> {
        let mut position = Position::ORIGIN;
        (0..=(duration_s / DT_S) as usize)
            .map(|step| {
                let time_s = step as f64 * DT_S;
                let order = orders.iter().rev().find(|order| order.0 <= time_s);
                let own = order.map_or(course(0.0, 6.0), |order| course(order.1, 6.0 * order.2));
                let moment = PairMoment {
                    own: (position, own),
                    target: (target.0 + target.1.for_seconds(time_s), target.1),
                };
                position += own.for_seconds(DT_S);
                moment
            })
            .collect()
    }

    fn only(moments: &[PairMoment]) -> EncounterReport {
        let (encounters, config) = (EncounterConfig::default(), ComplianceConfig::default());
        let reports = assess(moments, DT_S, CONTACT_M, &encounters, &config);
        let [report] = reports[..] else { panic!("{reports:?}") };
        report
    }

    /// A target ship that would meet own ship after `tcpa_s`, if it held its course.
    fn meeting(course_deg: f64, speed_mps: f64, tcpa_s: f64) -> (Position, Velocity) {
        let velocity = course(course_deg, speed_mps);
        (at(6.0 * tcpa_s, 0.0) - velocity.for_seconds(tcpa_s), velocity)
    }

    #[test]
    fn an_early_wide_turn_to_starboard_head_on_is_all_that_is_asked() {
        let orders = [(60.0, 40.0, 1.0), (400.0, 0.0, 1.0)];
        let report = only(&run(meeting(180.0, 6.0, 900.0), &orders, 1200.0));
        assert_eq!((report.encounter, report.role), (Encounter::HeadOn, Role::GiveWay));
        assert_eq!((report.begin_s, report.action_s), (0.0, Some(60.0)));
        assert!(report.passing_distance_m > 1000.0 && report.end_s < 1100.0, "{report:?}");
        assert_eq!(report.score, 1.0, "{report:?}");
    }

    #[test]
    fn each_mistake_head_on_costs_its_part() {
        let good = only(&run(meeting(180.0, 6.0, 900.0), &[(60.0, 40.0, 1.0), (400.0, 0.0, 1.0)], 1200.0));
        let port = only(&run(meeting(180.0, 6.0, 900.0), &[(60.0, -40.0, 1.0), (400.0, 0.0, 1.0)], 1200.0));
        assert_eq!((port.parts.turn_side, port.parts.passing_side), (Some(0.0), Some(0.0)));
        assert_eq!(port.parts.early, good.parts.early);
        let late = only(&run(meeting(180.0, 6.0, 900.0), &[(600.0, 40.0, 1.0), (800.0, 0.0, 1.0)], 1200.0));
        // 300 of the 600 seconds that count as early are left.
        assert_eq!(late.parts.early, Some(0.5));
        let small = only(&run(meeting(180.0, 6.0, 900.0), &[(60.0, 10.0, 1.0)], 1200.0));
        assert!((small.parts.substantial.unwrap() - 1.0 / 3.0).abs() < 1e-9, "{small:?}");
        let none = only(&run(meeting(180.0, 6.0, 900.0), &[], 1200.0));
        assert_eq!((none.parts.passing_distance, none.score, none.action_s), (0.0, 0.0, None));
        assert_eq!((none.parts.early, none.parts.substantial), (Some(0.0), Some(0.0)));
        for worse in [port, late, small, none] {
            assert!(worse.score < good.score, "{worse:?}");
        }
    }

    #[test]
    fn the_passing_distance_counts_from_contact_to_twice_that() {
        for (offset_m, expected) in [(300.0, 0.0), (450.0, 0.5), (600.0, 1.0), (900.0, 1.0)] {
            let (position, velocity) = meeting(180.0, 6.0, 900.0);
            let aside = (at(position.north_m, -offset_m), velocity);
            let report = only(&run(aside, &[], 1200.0));
            assert!((report.parts.passing_distance - expected).abs() < 1e-9, "{offset_m}: {report:?}");
        }
    }

    #[test]
    fn a_crossing_vessel_from_starboard_is_not_passed_ahead() {
        let target = meeting(270.0, 6.0, 900.0);
        let astern = only(&run(target, &[(60.0, 40.0, 1.0), (500.0, 0.0, 1.0)], 1500.0));
        assert_eq!(astern.encounter, Encounter::CrossingFromStarboard);
        assert_eq!((astern.parts.passing_side, astern.parts.turn_side), (Some(1.0), Some(1.0)));
        let ahead = only(&run(target, &[(60.0, -40.0, 1.0)], 1500.0));
        assert_eq!(ahead.parts.turn_side, Some(0.0), "{ahead:?}");
        let slower = only(&run(target, &[(60.0, 0.0, 0.5)], 1500.0));
        assert_eq!((slower.parts.substantial, slower.parts.passing_side), (Some(1.0), Some(1.0)));
        assert_eq!(slower.parts.turn_side, None, "{slower:?}");
    }

    #[test]
    fn a_stand_on_vessel_holds_until_it_may_act() {
        let target = meeting(90.0, 6.0, 900.0);
        let steady = only(&run(target, &[(600.0, 60.0, 1.0)], 1500.0));
        assert_eq!((steady.encounter, steady.role), (Encounter::CrossingFromPort, Role::StandOn));
        assert_eq!((steady.parts.stand_on, steady.parts.turn_side), (Some(1.0), Some(1.0)));
        let hasty = only(&run(target, &[(60.0, 15.0, 1.0)], 1500.0));
        assert_eq!(hasty.parts.stand_on, Some(0.5), "{hasty:?}");
        let to_port = only(&run(target, &[(600.0, -60.0, 1.0)], 1500.0));
        assert_eq!(to_port.parts.turn_side, Some(0.0));
        // From 300 s before the closest point on, nothing has to be held.
        assert_eq!(only(&run(meeting(90.0, 6.0, 300.0), &[], 600.0)).parts.stand_on, None);
    }

    #[test]
    fn an_overtaking_vessel_may_pass_on_either_side() {
        let target = (at(1800.0, 0.0), course(0.0, 3.0));
        for turn_deg in [35.0, -35.0] {
            let report = only(&run(target, &[(30.0, turn_deg, 1.0), (300.0, 0.0, 1.0)], 1500.0));
            assert_eq!(report.encounter, Encounter::Overtaking);
            assert_eq!((report.parts.turn_side, report.parts.passing_side), (None, None));
            // Half a minute of the ten that there were went by before it acted.
            assert!((report.score - 0.975).abs() < 1e-9, "{report:?}");
        }
    }

    #[test]
    fn where_the_other_vessel_keeps_clear_no_action_is_called_for() {
        let mut moments = run(meeting(180.0, 6.0, 900.0), &[], 1200.0);
        for (step, moment) in moments.iter_mut().enumerate() {
            // It turns to its starboard after 100 s and passes 1 km off to port.
            let aside_m = (step as f64 * DT_S - 100.0).clamp(0.0, 200.0) * 5.0;
            moment.target.0.east_m -= aside_m;
        }
        let report = only(&moments);
        assert_eq!((report.parts.early, report.parts.substantial), (None, None));
        assert_eq!(report.score, 1.0, "{report:?}");
    }

    #[test]
    fn without_risk_there_is_nothing_to_score() {
        let far = run((at(0.0, 10_000.0), course(0.0, 6.0)), &[], 600.0);
        let config = ComplianceConfig::default();
        assert!(assess(&far, DT_S, CONTACT_M, &EncounterConfig::default(), &config).is_empty());
    }
}
