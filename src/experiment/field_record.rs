//! An episode in open water as it was sailed, and how it is drawn: what three figures share.

use nalgebra::Vector2;

use super::product::{DataTable, data_row};
use crate::env::open_water::{Field, OpenWater, OpenWaterConfig, PassingRule};
use crate::env::{ActionError, Env};
use crate::report::figure::{LegendPlace, Line, Panel, Stroke, colour};

/// Where one obstacle was, from when it appeared until it was replaced.
#[derive(Debug, Clone)]
pub struct ObstacleTrace {
    /// Its place among the obstacles.
    pub obstacle: usize,
    /// On which side it had to be passed.
    pub rule: PassingRule,
    /// Step at which it appeared.
    pub first_step: usize,
    /// Its position at every step from then on.
    pub positions: Vec<Vector2<f64>>,
    /// Step at which the agent passed it, where it did.
    pub passed_at: Option<usize>,
}

/// An obstacle passed on the wrong side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Violation {
    /// Step in which it was passed.
    pub step: usize,
    /// Where the agent was.
    pub agent: Vector2<f64>,
    /// The obstacle.
    pub obstacle: usize,
}

/// One episode.
#[derive(Debug, Clone)]
pub struct FieldRecord {
    /// Time step, in seconds.
    pub dt_s: f64,
    /// The agent at every step, its start first.
    pub agent: Vec<Vector2<f64>>,
    /// All obstacles that were there.
    pub traces: Vec<ObstacleTrace>,
    /// Where rules were broken.
    pub violations: Vec<Violation>,
    /// Obstacles passed.
    pub passed: usize,
}

impl FieldRecord {
    /// Sails the episode of `seed`; `act` answers every observation with an action.
    ///
    /// # Errors
    ///
    /// When the environment refuses an action.
    pub fn sail(
        env: &mut OpenWater,
        dt_s: f64,
        seed: u64,
        mut act: impl FnMut(&OpenWater, &[f32]) -> f32,
    ) -> Result<Self, ActionError> {
        let mut observation = vec![0.0; env.observation_len()];
        env.reset(seed, &mut observation);
        let mut record = Self {
            dt_s,
            agent: vec![env.field().agent().position],
            traces: Vec::new(),
            violations: Vec::new(),
            passed: 0,
        };
        let count = env.field().obstacles().len();
        let mut current: Vec<usize> = (0..count).map(|obstacle| record.appear(env, obstacle, 0)).collect();
        loop {
            let action = act(env, &observation);
            let outcome = env.step(&[action], &mut observation)?;
            let field = env.field();
            let agent = field.agent().position;
            record.agent.push(agent);
            for passing in field.passings() {
                record.passed += 1;
                record.traces[current[passing.obstacle]].passed_at = Some(field.step());
                if field.replaced().contains(&passing.obstacle) {
                    // It is elsewhere already; where it was passed follows from how far off.
                    let place = Vector2::new(agent.x, agent.y - passing.lateral_m);
                    record.traces[current[passing.obstacle]].positions.push(place);
                }
                if passing.wrong {
                    let (step, obstacle) = (field.step(), passing.obstacle);
                    record.violations.push(Violation { step, agent, obstacle });
                }
            }
            for (obstacle, trace) in current.iter_mut().enumerate() {
                if field.replaced().contains(&obstacle) {
                    *trace = record.appear(env, obstacle, field.step());
                } else {
                    record.traces[*trace].positions.push(field.obstacles()[obstacle].position());
                }
            }
            if outcome.ends_episode() {
                return Ok(record);
            }
        }
    }

    /// Begins the trace of an obstacle that has just appeared.
    fn appear(&mut self, env: &OpenWater, obstacle: usize, first_step: usize) -> usize {
        let seen = &env.field().obstacles()[obstacle];
        let positions = vec![seen.position()];
        self.traces.push(ObstacleTrace { obstacle, rule: seen.rule, first_step, positions, passed_at: None });
        self.traces.len() - 1
    }

    /// Paths of the obstacles passed within these steps, around the time at which they were, and a dot
    /// where they were then.
    pub(super) fn obstacle_lines(
        &self,
        steps: std::ops::Range<usize>,
        around: usize,
        data: &mut DataTable,
    ) -> Vec<Line> {
        let mut lines = Vec::new();
        for (rule, colour, label) in [
            (PassingRule::Right, colour::BLUE, "obstacle, rule right: pass below"),
            (PassingRule::Left, colour::GREEN, "obstacle, rule left: pass above"),
        ] {
            let mut dots = Vec::new();
            for (index, trace) in self.traces.iter().enumerate().filter(|(_, trace)| trace.rule == rule) {
                let Some(passed) = trace.passed_at.filter(|step| steps.contains(step)) else { continue };
                let at = |step: usize| trace.positions[step - trace.first_step];
                let first = passed.saturating_sub(around).max(trace.first_step);
                let last = (passed + around).min(trace.first_step + trace.positions.len() - 1);
                for step in first..=last {
                    let place = at(step);
                    let time_s = step as f64 * self.dt_s;
                    let event = if step == passed { "passed" } else { "" };
                    data.push(data_row![
                        "obstacle",
                        index,
                        rule_name(rule),
                        step,
                        time_s,
                        place.x,
                        place.y,
                        event
                    ]);
                }
                let stroke = if rule == PassingRule::Right { Stroke::Solid } else { Stroke::Dashed };
                let path = (first..=last).map(|step| on_axes(at(step))).collect();
                lines.push(Line { stroke, width: 1, ..Line::solid("", colour, path) });
                dots.push(on_axes(at(passed)));
            }
            let stroke = if rule == PassingRule::Right { Stroke::Dots } else { Stroke::Rings };
            lines.push(Line::marks(label, colour, stroke, 3, dots));
        }
        lines.retain(|line| !line.points.is_empty());
        lines
    }

    /// The agent's path within these steps, and squares where it broke a rule.
    pub(super) fn agent_lines(
        &self,
        name: &str,
        drawn: Line,
        steps: std::ops::Range<usize>,
        data: &mut DataTable,
    ) -> [Line; 2] {
        for step in steps.clone() {
            let place = self.agent[step];
            let wrong = self.violations.iter().filter(|violation| violation.step == step).count();
            let event = if wrong > 0 { "rule broken" } else { "" };
            let time_s = step as f64 * self.dt_s;
            data.push(data_row![name, 0_usize, "", step, time_s, place.x, place.y, event]);
        }
        let path = steps.clone().map(|step| on_axes(self.agent[step])).collect();
        let broken = self.violations.iter().filter(|violation| steps.contains(&violation.step));
        let squares = broken.map(|violation| on_axes(violation.agent)).collect();
        [Line { points: path, ..drawn }, Line::marks("", colour::BLACK, Stroke::Squares, 4, squares)]
    }
}

/// Columns of the data behind these figures.
pub(super) const COLUMNS: [&str; 8] = ["series", "id", "rule", "step", "time_s", "x_m", "y_m", "event"];

pub(super) fn rule_name(rule: PassingRule) -> &'static str {
    match rule {
        PassingRule::Right => "right",
        PassingRule::Left => "left",
    }
}

/// Along in kilometres, across in metres.
fn on_axes(place: Vector2<f64>) -> (f64, f64) {
    (place.x / 1000.0, place.y)
}

/// A wide panel over the field.
pub(super) fn panel(title: String, lines: Vec<Line>) -> Panel {
    Panel {
        title,
        x_label: "x, direction of travel (km)".into(),
        y_label: "y, to port (m)".into(),
        lines,
        close_up: true,
        legend: LegendPlace::Emptiest,
        size_px: Some((1000, 460)),
        ..Panel::default()
    }
}

/// Steers along the desired path, which no trained agent is told: what the course is laid out for.
pub(super) fn along_the_path(env: &OpenWater) -> f32 {
    along_the_field_path(env.field(), env.config())
}

/// As [`along_the_path`], in a field by itself.
pub(super) fn along_the_field_path(field: &Field, config: &OpenWaterConfig) -> f32 {
    /// Looks this many steps ahead, and brings the lateral speed to what that takes within some steps.
    const AHEAD_STEPS: f64 = 12.0;
    const SETTLE_STEPS: f64 = 4.0;
    let agent = field.agent();
    let wanted_m = field.path().at(field.step() as f64 + AHEAD_STEPS);
    let wanted_mps = (wanted_m - agent.position.y) / (AHEAD_STEPS * config.dt_s);
    let acceleration_mps2 = (wanted_mps - agent.velocity.y) / (SETTLE_STEPS * config.dt_s);
    (acceleration_mps2 / config.agent_acceleration_max_mps2).clamp(-1.0, 1.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(act: impl FnMut(&OpenWater, &[f32]) -> f32) -> FieldRecord {
        let mut env = OpenWater::new(OpenWaterConfig::default(), None).unwrap();
        FieldRecord::sail(&mut env, 5.0, 3, act).unwrap()
    }

    #[test]
    fn a_record_accounts_for_every_passing() {
        let record = record(|_, _| -1.0);
        assert_eq!(record.agent.len(), 501);
        let passed = record.traces.iter().filter(|trace| trace.passed_at.is_some()).count();
        assert_eq!(passed, record.passed, "each obstacle is passed at most once");
        assert!(record.passed > 20 && record.violations.len() < record.passed);
        for trace in &record.traces {
            if let Some(step) = trace.passed_at {
                let place = trace.positions[step - trace.first_step];
                let apart = place.x - record.agent[step].x;
                // Within the step obstacle and agent close by at most (5 + 5) m/s, and the obstacle wanders.
                assert!(apart.abs() < 150.0, "{apart}");
            }
        }
        let last = record.traces.last().unwrap();
        assert_eq!(last.first_step + last.positions.len(), 501);
    }

    #[test]
    fn the_path_is_a_better_course_than_none() {
        let along = record(|env, _| along_the_path(env));
        let straight = record(|_, _| 0.0);
        assert!(along.violations.len() * 4 < straight.violations.len(), "{}", along.violations.len());
    }
}
