//! Running a situation: own ship under its policy, the targets on their way, everything recorded.

use super::foresight::{Foresight, TargetForecasts};
use super::model::Scenario;
use super::setup::StagedEncounter;
use super::streams::PositionSensor;
use crate::episode::{Episode, PairStep, Step, VesselInfo, VesselRole, VesselStep};
use crate::geo::Position;
use crate::policy::{self, HoldCourse, OwnShip, Policy, Situation, TargetShip};
use crate::vessel::{Command, Linear, Motion, Steered, VesselState};
use crate::world::{VesselId, World, WorldConfig};

impl StagedEncounter {
    /// Runs the encounter under the scenario's own policy.
    #[must_use]
    pub fn run(&self) -> Episode {
        // The name was checked when the scenario was set up.
        let mut policy = policy::by_name(&self.scenario.policy).unwrap_or_else(|| Box::new(HoldCourse));
        self.run_under(policy.as_mut())
    }

    /// Runs the encounter under any policy; the same policy gives the same episode. One with a pace of its own is asked
    /// at the nearest whole number of decisions; in between own ship keeps what was ordered.
    pub fn run_under(&self, policy: &mut dyn Policy) -> Episode {
        policy.reset(self.scenario.seed);
        let pace = policy.decision_interval_s().map_or(1.0, |interval_s| interval_s / self.decision_s());
        let decisions_per_answer = pace.round().max(1.0) as usize;
        let mut voyage = Voyage::new(self);
        let mut steps = vec![voyage.record()];
        for step in 0..self.scenario.steps() {
            if step % (self.steps_per_decision() * decisions_per_answer) == 0 {
                voyage.ask(policy, decisions_per_answer);
            }
            if step % self.steps_per_decision() == 0 {
                voyage.order();
            }
            voyage.advance();
            steps.push(voyage.record());
        }
        self.episode(policy.name(), steps)
    }

    /// Time between two decisions, in seconds: whole time steps.
    #[must_use]
    pub fn decision_s(&self) -> f64 {
        self.steps_per_decision() as f64 * self.scenario.dt_s
    }

    fn steps_per_decision(&self) -> usize {
        let interval_s = self.scenario.own_ship.steering.decision_interval_s;
        (interval_s / self.scenario.dt_s).round().max(1.0) as usize
    }

    fn description(&self) -> &str {
        let Scenario { title, description, .. } = &self.scenario;
        if description.is_empty() { title } else { description }
    }

    fn episode(&self, policy: &str, steps: Vec<Step>) -> Episode {
        let own_ship = &self.scenario.own_ship;
        let word = own_ship.dynamics.dynamics.word();
        let own = VesselInfo::new(&own_ship.name, VesselRole::Own, word, &self.own_body);
        let targets = self.targets.iter().map(|target| {
            VesselInfo::new(&target.name, VesselRole::Target, target.motion_word, &target.body)
        });
        Episode {
            scenario: self.scenario.name.clone(),
            description: self.description().to_owned(),
            seed: self.scenario.seed,
            policy: policy.to_owned(),
            dt_s: self.scenario.dt_s,
            origin: self.plane.map(|plane| plane.origin),
            vessels: std::iter::once(own).chain(targets).collect(),
            steps,
        }
    }
}

/// An encounter under way. Own ship is vessel 0, the targets follow.
struct Voyage<'s> {
    staged: &'s StagedEncounter,
    own: Box<dyn Steered>,
    world: World,
    step: i64,
    /// Where each vessel truly is.
    states: Vec<VesselState>,
    sensors: Vec<PositionSensor>,
    /// Where its sensor placed each vessel, up to this step.
    observed: Vec<Vec<Position>>,
    forecasts: Option<TargetForecasts>,
    /// What the policy answered last.
    command: Command,
}

impl<'s> Voyage<'s> {
    fn new(staged: &'s StagedEncounter) -> Self {
        let scenario = &staged.scenario;
        let own = scenario.launch_own(staged.own_start.position, staged.own_start.velocity);
        let targets = || staged.targets.iter();
        let states: Vec<_> =
            std::iter::once(own.state()).chain(targets().map(|target| target.motion.state(0))).collect();
        let bodies = std::iter::once(&staged.own_body).chain(targets().map(|target| &target.body));
        let mut world = World::new(WorldConfig { dt_s: scenario.dt_s, ..WorldConfig::default() });
        for (body, state) in bodies.zip(&states) {
            world.add_vessel(body.clone(), *state);
        }
        for target in 1..states.len() {
            world.watch(VesselId(0), VesselId(target));
        }
        let mut sensors: Vec<_> = (0..states.len())
            .map(|vessel| PositionSensor::new(scenario.seed, vessel, scenario.sensor_noise))
            .collect();
        let observed = past(staged)
            .into_iter()
            .zip(&mut sensors)
            .map(|(past, sensor)| past.into_iter().map(|position| sensor.measure(position)).collect())
            .collect();
        let forecasts = staged.foresight.as_ref().map(Foresight::begin);
        let command = Command::default();
        let mut voyage = Self { staged, own, world, step: 0, states, sensors, observed, forecasts, command };
        voyage.look_ahead();
        voyage
    }

    /// Asks the policy what to do until it is asked again, after so many decisions.
    fn ask(&mut self, policy: &mut dyn Policy, decisions: usize) {
        let scenario = &self.staged.scenario;
        let targets: Vec<_> = (1..self.states.len())
            .map(|vessel| TargetShip {
                position: self.sensed(vessel),
                velocity: self.states[vessel].velocity,
                history: &self.observed[vessel],
                forecast: self.forecast(vessel),
                collision_distance_m: self.staged.own_body.collision_radius_m
                    + self.staged.targets[vessel - 1].body.collision_radius_m,
            })
            .collect();
        let own = OwnShip {
            position: self.sensed(0),
            velocity: self.states[0].velocity,
            heading: self.states[0].heading,
            ordered_heading: self.own.ordered_heading(),
            max_turn_rad: self.own.max_turn_rad(),
            planned_speed_mps: scenario.own_ship.speed_mps,
            max_speed_change_mps: scenario.own_ship.steering.max_speed_change_mps,
            history: &self.observed[0],
        };
        self.command = policy.decide(&Situation {
            time_s: self.step as f64 * scenario.dt_s,
            dt_s: scenario.dt_s,
            decision_s: self.staged.decision_s() * decisions as f64,
            own,
            route: &self.staged.route,
            targets: &targets,
        });
    }

    /// Carries out what the policy answered: the turn once, the speed until the next answer.
    fn order(&mut self) {
        let scenario = &self.staged.scenario;
        let command = Command { turn_rad: std::mem::take(&mut self.command.turn_rad), ..self.command };
        // A policy that leaves the speed alone leaves it to the plan.
        let planned_mps = self.staged.route.speed_mps(self.states[0].position);
        let present_mps = self.states[0].velocity.speed_mps();
        let change_mps = scenario.own_ship.steering.max_speed_change_mps;
        let within_reach =
            |speed_mps: f64| speed_mps.clamp(present_mps - change_mps, present_mps + change_mps);
        let speed_mps = command.speed_mps.filter(|_| change_mps > 0.0).map(within_reach).or(planned_mps);
        self.own.order(Command { speed_mps, ..command });
    }

    /// Forecasts the target ships at every time of a decision.
    fn look_ahead(&mut self) {
        let is_decision = self.step % self.staged.steps_per_decision() as i64 == 0;
        if let Some(forecasts) = self.forecasts.as_mut().filter(|_| is_decision) {
            forecasts.update(self.step, &self.observed[1..]);
        }
    }

    /// Where a target ship is forecast from now on, the next position first; nothing for own ship and where
    /// nothing is forecast.
    fn forecast(&self, vessel: usize) -> Option<&[Position]> {
        self.forecasts.as_ref()?.path(vessel.checked_sub(1)?, self.step)
    }

    /// Where its sensor places a vessel now.
    fn sensed(&self, vessel: usize) -> Position {
        self.observed[vessel].last().copied().unwrap_or(self.states[vessel].position)
    }

    fn advance(&mut self) {
        self.step += 1;
        self.own.advance(self.staged.scenario.dt_s);
        self.states[0] = self.own.state();
        for (state, target) in self.states[1..].iter_mut().zip(&self.staged.targets) {
            *state = target.motion.state(self.step);
        }
        self.world.step(&self.states);
        for ((sensor, state), observed) in self.sensors.iter_mut().zip(&self.states).zip(&mut self.observed) {
            observed.push(sensor.measure(state.position));
        }
        self.look_ahead();
    }

    fn record(&self) -> Step {
        let noisy = self.staged.scenario.sensor_noise.sigma_m > 0.0;
        let vessels = self.states.iter().enumerate().map(|(vessel, state)| VesselStep {
            position: state.position,
            velocity: state.velocity,
            heading: state.heading,
            observed: noisy.then(|| self.sensed(vessel)),
            ahead: self.forecast(vessel).map_or_else(Vec::new, <[Position]>::to_vec),
        });
        Step { vessels: vessels.collect(), pairs: self.world.reports().iter().map(PairStep::from).collect() }
    }
}

/// Where each vessel was before the start, oldest first, the start last. Own ship came straight on.
fn past(staged: &StagedEncounter) -> Vec<Vec<Position>> {
    let scenario = &staged.scenario;
    let count = (scenario.history_s / scenario.dt_s).ceil().max(0.0) as usize + 1;
    let own = Linear::new(staged.own_start.position, staged.own_start.velocity, scenario.dt_s);
    let motions = std::iter::once(&own as &dyn Motion)
        .chain(staged.targets.iter().map(|target| target.motion.as_ref() as &dyn Motion));
    motions
        .map(|motion| {
            let mut positions = vec![Position::ORIGIN; count];
            motion.history(0, &mut positions);
            positions
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Nautical;
    use crate::scenario::{OwnShip as Own, Placement, Point, TargetMotion};

    fn head_on() -> Scenario {
        let south = Placement::At {
            point: Point::local(4000.0, 0.0),
            course: Nautical::from_degrees(180.0),
            speed_mps: 6.0,
        };
        Scenario::new("head_on", Own::head_on_to("ship", 240.0)).target("ship", TargetMotion::Linear(south))
    }

    /// Keeps what it was shown, and turns to starboard at every decision.
    #[derive(Debug, Default)]
    struct Recorder {
        seeds: Vec<u64>,
        times_s: Vec<f64>,
        target_history: Vec<Position>,
    }

    impl Policy for Recorder {
        fn name(&self) -> &str {
            "recorder"
        }

        fn reset(&mut self, seed: u64) {
            self.seeds.push(seed);
        }

        fn decide(&mut self, situation: &Situation<'_>) -> Command {
            self.times_s.push(situation.time_s);
            self.target_history = situation.targets[0].history.to_vec();
            assert_eq!(situation.own.history.last(), Some(&situation.own.position));
            assert_eq!(situation.targets[0].collision_distance_m, 300.0);
            Command { turn_rad: situation.own.max_turn_rad, speed_mps: None }
        }
    }

    #[test]
    fn holding_course_meets_the_target_at_the_time_to_collision() {
        let episode = head_on().set_up().unwrap().run();
        let summary = &episode.summaries()[0];
        assert!(summary.closest_centre_m < 1e-6);
        assert!((summary.closest_centre_time_s - 240.0).abs() < 1e-6);
        // The circles touch when the centres are 300 m apart, at a closing speed of 14 m/s.
        assert!((summary.first_circle_contact_s.unwrap() - (240.0 - 300.0 / 14.0)).abs() < 1e-6);
        assert!(summary.first_hull_contact_s.is_some());
        assert_eq!(episode.steps.len(), 61);
    }

    #[test]
    fn a_policy_is_asked_once_per_decision_and_obeyed() {
        let mut recorder = Recorder::default();
        let episode = head_on().seed(9).set_up().unwrap().run_under(&mut recorder);
        assert_eq!(recorder.seeds, [9]);
        assert_eq!(recorder.times_s, (0..15).map(|k| f64::from(k) * 20.0).collect::<Vec<_>>());
        assert_eq!(episode.policy, "recorder");
        let turned = episode.steps[60].vessels[0].heading.turn_from(episode.steps[0].vessels[0].heading);
        assert!((turned.to_degrees() - 36.0).abs() < 1e-9);
        // 375 s before the start, the start, and 280 s up to the last decision.
        assert_eq!(recorder.target_history.len(), 75 + 1 + 56);
        assert_eq!(recorder.target_history[75], Position { north_m: 4000.0, east_m: 0.0 });
    }

    /// Turns as far as it may, every 40 s.
    #[derive(Debug, Default)]
    struct Unhurried(Recorder);

    impl Policy for Unhurried {
        fn name(&self) -> &str {
            "unhurried"
        }

        fn decision_interval_s(&self) -> Option<f64> {
            Some(40.0)
        }

        fn reset(&mut self, seed: u64) {
            self.0.reset(seed);
        }

        fn decide(&mut self, situation: &Situation<'_>) -> Command {
            assert_eq!(situation.decision_s, 40.0);
            self.0.decide(situation)
        }
    }

    #[test]
    fn a_policy_with_a_pace_of_its_own_is_asked_at_that_and_turns_once_for_each_answer() {
        let mut unhurried = Unhurried::default();
        let episode = head_on().set_up().unwrap().run_under(&mut unhurried);
        assert_eq!(unhurried.0.times_s, (0..8).map(|k| f64::from(k) * 40.0).collect::<Vec<_>>());
        let turned = episode.steps[60].vessels[0].heading.turn_from(episode.steps[0].vessels[0].heading);
        assert!((turned.to_degrees() - 8.0 * 2.4).abs() < 1e-9);
    }

    #[test]
    fn sensors_err_alike_whatever_the_policy_does() {
        let errors = |policy: &mut dyn Policy| {
            let episode = head_on().sensor_noise_m(10.0).seed(3).set_up().unwrap().run_under(policy);
            let vessels = episode.steps.iter().flat_map(|step| step.vessels.clone());
            vessels.map(|vessel| vessel.observed.unwrap() - vessel.position).collect::<Vec<_>>()
        };
        let held = errors(&mut HoldCourse);
        let turned = errors(&mut Recorder::default());
        assert!(held.iter().any(|error| error.length_m() > 10.0));
        for (held, turned) in held.iter().zip(&turned) {
            assert!((*held + -*turned).length_m() < 1e-6);
        }
    }

    #[test]
    fn without_noise_nothing_is_said_of_sensors() {
        let episode = head_on().set_up().unwrap().run();
        assert!(episode.steps.iter().flat_map(|step| &step.vessels).all(|vessel| vessel.observed.is_none()));
    }

    #[test]
    fn each_leg_of_the_route_is_sailed_at_its_speed() {
        let mut own =
            Own::heading(0.0).speed_mps(8.0).route(&[Point::local(800.0, 0.0), Point::local(5e3, 0.0)]);
        own.route[0].speed_mps = Some(5.0);
        let episode = Scenario::new("legs", own).set_up().unwrap().run();
        let speeds_mps = [10, 19, 30, 60].map(|step| episode.steps[step].vessels[0].velocity.speed_mps());
        assert_eq!(speeds_mps.map(f64::round), [8.0, 8.0, 5.0, 5.0]);
    }

    #[test]
    fn a_route_leads_own_ship_where_no_course_is_given() {
        let own = Own::heading(0.0).route(&[Point::local(1000.0, 1000.0), Point::local(1000.0, 5000.0)]);
        let mut scenario = Scenario::new("route", own).duration_s(900.0).policy("rule-based");
        scenario.own_ship.start =
            crate::scenario::OwnStart::At { point: Point::local(0.0, 0.0), course: None };
        scenario.own_ship.steering.max_turn_deg = 20.0;
        let episode = scenario.set_up().unwrap().run();
        assert!((episode.steps[0].vessels[0].heading.degrees() - 45.0).abs() < 1e-9);
        let last = &episode.steps[180].vessels[0];
        assert!((last.heading.degrees() - 90.0).abs() < 2.0 && (last.position.north_m - 1000.0).abs() < 50.0);
    }
}
