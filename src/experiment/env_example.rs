//! `env_example`: a stretch of an open-water episode (paper, section "Training environment").

use super::curves::counted;
use super::field_record::{COLUMNS, FieldRecord, along_the_path, panel};
use super::product::{DataTable, Drawing, Product};
use crate::env::ActionError;
use crate::env::open_water::OpenWater;
use crate::report::figure::{Figure, Line, colour};

/// Steps shown, and steps around its passing that an obstacle is shown.
const SHOWN: std::ops::Range<usize> = 100..300;
const AROUND: usize = 30;

/// Sails the episode of `seed` along the desired path.
///
/// # Errors
///
/// When the environment refuses an action.
pub fn make(env: &mut OpenWater, episode: u64, seed: u64) -> Result<Product, ActionError> {
    let dt_s = env.config().dt_s;
    let record = FieldRecord::sail(env, dt_s, seed, |env, _| along_the_path(env))?;
    let steps = SHOWN.start.min(record.agent.len() - 1)..SHOWN.end.min(record.agent.len());
    let mut data = DataTable::new(&COLUMNS);
    let mut lines = record.obstacle_lines(steps.clone(), AROUND, &mut data);
    let drawn = Line { width: 3, ..Line::solid("along the desired path", colour::ORANGE, Vec::new()) };
    lines.extend(record.agent_lines("agent", drawn, steps.clone(), &mut data));
    let title = format!("Open water, steps {} to {} of benchmark episode {episode}", steps.start, steps.end);
    let caption = format!(
        "Obstacles {} before to {} after they are passed (marks: where they are passed), and a course along the \
         desired path that they are placed around. The course is steered by a controller that knows this path; no \
         trained agent is shown. It breaks {} in the whole episode of {} passings, since the non-linear part of the \
         motion stays.",
        minutes(AROUND as f64 * dt_s),
        minutes(AROUND as f64 * dt_s),
        counted(record.violations.len(), "rule"),
        record.passed,
    );
    Ok(Product { drawing: Drawing::Figure(Figure::single(panel(title, lines))), data, caption })
}

fn minutes(time_s: f64) -> String {
    format!("{} min", time_s / 60.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::SeedDomain;
    use crate::env::open_water::OpenWaterConfig;

    #[test]
    fn obstacles_of_both_rules_and_the_course_are_there() {
        let mut env = OpenWater::new(OpenWaterConfig::default(), None).unwrap();
        let product = make(&mut env, 0, SeedDomain::Benchmark.seed(0)).unwrap();
        let count = |of: &str| product.data.rows().iter().filter(|row| row[2] == of.into()).count();
        assert!(count("right") > 100 && count("left") > 100);
        assert_eq!(count(""), 200);
        let svg = product.to_svg().unwrap();
        for text in ["rule right", "rule left", "along the desired path", "direction of travel (km)"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
