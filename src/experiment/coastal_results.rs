//! `AIS_results`: test return over training steps in coastal waters, four agents (paper, section
//! "Results" of the maritime study).

use super::curves::{Curve, Waters};
use super::learning::{COASTAL, COLUMNS, HOW, add_rows, groups, panel, ran};
use super::product::{DataTable, Drawing, Product};
use crate::report::figure::Figure;

/// Draws what there is of the four kinds of runs; `None` where there is nothing at all.
#[must_use]
pub fn make(curves: &[Curve]) -> Option<Product> {
    let groups = groups(curves, Waters::Coastal);
    if groups.is_empty() {
        return None;
    }
    let mut data = DataTable::new(&COLUMNS);
    add_rows(&mut data, Waters::Coastal, &groups);
    let mut panel = panel(Waters::Coastal, &groups);
    panel.size_px = Some((640, 420));
    let caption = format!("{HOW} {}", ran(Waters::Coastal, &groups, COASTAL));
    Some(Product { drawing: Drawing::Figure(Figure::single(panel)), data, caption })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::curves::AgentKind;
    use crate::experiment::curves::tests::run;

    #[test]
    fn coastal_runs_are_drawn_with_what_was_run() {
        let curves: Vec<_> = AgentKind::ALL
            .iter()
            .flat_map(|&agent| (1..=3).map(move |seed| run(Waters::Coastal, agent, 4, seed, -6.0, 300)))
            .collect();
        let product = make(&curves).unwrap();
        assert_eq!(product.data.rows().len(), 4 * 3);
        assert!(product.caption.contains("LSTM-TD3: 3 seeds, 300 steps"), "{}", product.caption);
        assert!(product.to_svg().unwrap().contains("test return per episode"));
        assert!(make(&[run(Waters::Periodic, AgentKind::ALL[0], 4, 1, -6.0, 300)]).is_none());
    }
}
