//! `env_example_AR1` and `env_example_sinus`: an agent with estimates and its baseline in the same
//! episode (paper, section "Experiments", "Analysis").

use super::curves::{Waters, counted, thousands};
use super::field_record::{COLUMNS, panel};
use super::learning::style;
use super::product::{DataTable, Drawing, Product};
use super::sailors::Sailor;
use crate::env::ActionError;
use crate::report::figure::{Figure, LegendPlace, Line, Stroke};

/// Steps around its passing that an obstacle is shown.
const AROUND: usize = 20;

/// Sails the episode of `seed` with each agent. All meet the same obstacles: what they do depends on
/// the seed alone.
///
/// # Errors
///
/// When an environment refuses an action.
pub fn make(waters: Waters, sailors: &mut [Sailor], episode: u64, seed: u64) -> Result<Product, ActionError> {
    let mut data = DataTable::new(&COLUMNS);
    let (mut lines, mut ran) = (Vec::new(), Vec::new());
    for (index, sailor) in sailors.iter_mut().enumerate() {
        let record = sailor.sail(seed)?;
        let steps = 0..record.agent.len();
        if index == 0 {
            lines.extend(record.obstacle_lines(steps.clone(), AROUND, &mut data));
        }
        let broken = counted(record.violations.len(), "violation");
        let name = sailor.agent.label();
        let (colour, stroke) = style(sailor.agent);
        let label = format!("{name}: {broken} in {} passings", record.passed);
        let drawn = Line { stroke, width: 3, ..Line::solid(label, colour, Vec::new()) };
        lines.extend(record.agent_lines(name, drawn, steps, &mut data));
        ran.push(format!(
            "{name}: {}, seed {}, best weights at step {}",
            sailor.name,
            sailor.seed,
            thousands(sailor.step)
        ));
    }
    // One entry in the legend for the squares of all agents, where there are any.
    let is_square = |line: &&mut Line| line.stroke == Stroke::Squares && !line.points.is_empty();
    if let Some(squares) = lines.iter_mut().find(is_square) {
        squares.label = "passing rule broken".into();
    }
    let mut panel = panel(format!("{}, benchmark episode {episode}", waters.title()), lines);
    panel.legend = LegendPlace::Emptiest;
    panel.size_px = Some((1100, 560));
    let caption = format!(
        "Deterministic paths through the same episode, which no training has seen. Obstacles are shown {AROUND} steps \
         either side of where the first agent passes them (mark). Squares: obstacles passed on the wrong side. {}.",
        ran.join("; ")
    );
    Ok(Product { drawing: Drawing::Figure(Figure::single(panel)), data, caption })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::curves::AgentKind;
    use crate::experiment::sailors::tests::untrained;

    #[test]
    fn both_agents_meet_the_same_obstacles() {
        let mut sailors = [untrained(AgentKind::ALL[1]), untrained(AgentKind::ALL[3])];
        let product = make(Waters::Stochastic, &mut sailors, 2, 5).unwrap();
        let rows = product.data.rows();
        let count = |of: &str| rows.iter().filter(|row| row[0] == of.into()).count();
        assert_eq!((count("SL-LSTM-SAC"), count("LSTM-SAC")), (61, 61));
        assert!(count("obstacle") > 50);
        assert!(product.caption.contains("seed 7, best weights at step 1,200"), "{}", product.caption);
        let svg = product.to_svg().unwrap();
        assert!(svg.contains("SL-LSTM-SAC:") && svg.contains("benchmark episode 2"));
        assert_eq!(make(Waters::Stochastic, &mut sailors, 2, 5).unwrap().data, product.data);
    }
}
