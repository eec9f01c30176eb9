//! `trainResults`: test return over training steps in open water, four agents, two motions (paper,
//! section "Experiments").

use super::curves::{Curve, Waters};
use super::learning::{COLUMNS, HOW, OPEN_WATER, add_rows, groups, panel, ran};
use super::product::{DataTable, Drawing, Product};
use crate::report::figure::Figure;

/// Draws what there is of the eight kinds of runs; `None` where there is nothing at all.
#[must_use]
pub fn make(curves: &[Curve]) -> Option<Product> {
    make_of(curves, &[Waters::Stochastic, Waters::Periodic])
}

fn make_of(curves: &[Curve], waters: &[Waters]) -> Option<Product> {
    let mut data = DataTable::new(&COLUMNS);
    let (mut panels, mut caption) = (Vec::new(), vec![HOW.to_owned()]);
    for &waters in waters {
        let groups = groups(curves, waters);
        if groups.is_empty() {
            caption.push(format!("{}: not run.", waters.title()));
            continue;
        }
        panels.push(panel(waters, &groups));
        add_rows(&mut data, waters, &groups);
        caption.push(ran(waters, &groups, OPEN_WATER));
    }
    let columns = panels.len();
    let drawing = Drawing::Figure(Figure { panels, columns });
    (columns > 0).then(|| Product { drawing, data, caption: caption.join(" ") })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::curves::AgentKind;
    use crate::experiment::curves::tests::run;

    #[test]
    fn every_agent_and_motion_that_was_run_is_there_and_nothing_else() {
        let mut curves = Vec::new();
        for waters in [Waters::Stochastic, Waters::Periodic] {
            for agent in AgentKind::ALL {
                for seed in 1..=2 {
                    curves.push(run(waters, agent, 4, seed, -30.0, 500));
                }
            }
        }
        curves.push(run(Waters::Coastal, AgentKind::ALL[0], 4, 1, -30.0, 500));
        let product = make(&curves).unwrap();
        assert_eq!(product.data.rows().len(), 2 * 4 * 5);
        let svg = product.to_svg().unwrap();
        for text in
            ["SL-LSTM-TD3", "LSTM-SAC", "Stochastic obstacle", "2 seeds, 500 steps", "commit 0123456789"]
        {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.matches("<polygon").count(), 8, "an interval around every line");

        let some: Vec<_> = curves.iter().take(2).cloned().collect();
        let product = make(&some).unwrap();
        assert!(product.caption.contains("not run: SL-LSTM-SAC, LSTM-TD3, LSTM-SAC"), "{}", product.caption);
        assert!(product.caption.contains("Periodic obstacle movement: not run."), "{}", product.caption);
        assert!(make(&[]).is_none());
    }
}
