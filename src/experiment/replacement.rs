//! `replacement`: how an obstacle that was passed is replaced (paper, appendix "Environment details", the
//! two figures of the placement).

use super::field_record::{along_the_field_path, rule_name};
use super::product::{DataTable, Drawing, Product, data_row};
use crate::env::open_water::{Field, Obstacle, OpenWaterConfig, PassingRule};
use crate::report::figure::{Band, Figure, LegendPlace, Line, Panel, Stroke, colour};

/// Steps sailed before the first replacement that is shown.
const SAILED: usize = 60;
/// Seconds of the desired path shown before and after all obstacles.
const MARGIN_S: f64 = 60.0;

/// The first replacement after some steps of the episode of `seed`; `None` where the episode has none.
#[must_use]
pub fn make(config: &OpenWaterConfig, episode: u64, seed: u64) -> Option<Product> {
    let mut field = Field::new(config, seed);
    let (before, replaced) = loop {
        if field.step() >= config.decisions {
            return None;
        }
        field.advance(f64::from(along_the_field_path(&field, config)));
        let before = field.clone();
        field.replace_passed();
        match field.replaced() {
            [first, ..] if field.step() > SAILED => break (before, *first),
            _ => {}
        }
    };
    let after = field;
    let rule = after.obstacles()[replaced].rule;
    let latest_s = before
        .obstacles()
        .iter()
        .filter(|obstacle| obstacle.rule == rule)
        .map(|obstacle| obstacle.ttc_s)
        .fold(f64::NEG_INFINITY, f64::max);
    let interval = (latest_s, latest_s + config.ttc_spacing_max_s);

    let mut data = DataTable::new(&[
        "moment",
        "obstacle",
        "rule",
        "ttc_s",
        "y_m",
        "y_when_passed_m",
        "path_when_passed_m",
        "velocity_x_mps",
        "velocity_y_mps",
        "replaced",
    ]);
    let titles = [
        format!("Before: two of rule {} are past", rule_name(rule)),
        "After: one has a new place".to_owned(),
    ];
    let views = [("before", &before), ("after", &after)];
    let mut panels: Vec<Panel> = views
        .into_iter()
        .zip(titles)
        .map(|((moment, field), title)| panel(title, moment, field, config, replaced, &mut data))
        .collect();
    let reach = |panel: &Panel| -> Vec<f64> {
        panel.lines.iter().flat_map(|line| line.points.iter().map(|point| point.1)).collect()
    };
    let heights: Vec<f64> = panels.iter().flat_map(reach).collect();
    let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let shaded = vec![(interval.0, low, high), (interval.1, low, high)];
    panels[1].bands.push(Band { colour: colour::ORANGE, points: shaded });

    let placed = &after.obstacles()[replaced];
    let beside_m = (when_passed_m(placed) - path_m(&after, config, placed.ttc_s)).abs();
    let caption = format!(
        "Step {} of benchmark episode {episode}, over the time to collision (TTC) in the direction of travel. A bar leads \
         from where an obstacle is across the field to where its straight motion has it when it is passed. The ring is the \
         obstacle of rule {} that was passed first and gets a new TTC, here {:.0} s, within the shaded {:.0} to {:.0} s, \
         and a place {beside_m:.0} m from the desired path (before its non-linear part sets in).",
        after.step(),
        rule_name(rule),
        placed.ttc_s,
        interval.0,
        interval.1,
    );
    Some(Product { drawing: Drawing::Figure(Figure { panels, columns: 2 }), data, caption })
}

/// Across the field when the obstacle is passed, by its straight motion.
fn when_passed_m(obstacle: &Obstacle) -> f64 {
    obstacle.position().y + obstacle.velocity.y * obstacle.ttc_s
}

fn path_m(field: &Field, config: &OpenWaterConfig, ttc_s: f64) -> f64 {
    field.path().at(field.step() as f64 + ttc_s / config.dt_s)
}

fn panel(
    title: String,
    moment: &str,
    field: &Field,
    config: &OpenWaterConfig,
    replaced: usize,
    data: &mut DataTable,
) -> Panel {
    let times = || field.obstacles().iter().map(|obstacle| obstacle.ttc_s);
    let first_s = times().fold(f64::INFINITY, f64::min) - MARGIN_S;
    let last_s = times().fold(f64::NEG_INFINITY, f64::max) + MARGIN_S;
    let steps = ((last_s - first_s) / config.dt_s) as usize;
    let path = (0..=steps).map(|step| first_s + step as f64 * config.dt_s);
    let path = path.map(|ttc_s| (ttc_s, path_m(field, config, ttc_s))).collect();
    let mut lines = vec![Line::dashed("desired path", colour::GREY, path)];
    for (rule, colour) in [(PassingRule::Right, colour::BLUE), (PassingRule::Left, colour::GREEN)] {
        let mut dots = Vec::new();
        for (index, obstacle) in field.obstacles().iter().enumerate() {
            if obstacle.rule != rule {
                continue;
            }
            let (now_m, then_m) = (obstacle.position().y, when_passed_m(obstacle));
            let bar = vec![(obstacle.ttc_s, now_m), (obstacle.ttc_s, then_m)];
            lines.push(Line { width: 1, ..Line::solid("", colour, bar) });
            dots.push((obstacle.ttc_s, then_m));
            data.push(data_row![
                moment,
                index,
                rule_name(rule),
                obstacle.ttc_s,
                now_m,
                then_m,
                path_m(field, config, obstacle.ttc_s),
                obstacle.velocity.x,
                obstacle.velocity.y,
                if index == replaced { "yes" } else { "" },
            ]);
        }
        let stroke = if rule == PassingRule::Right { Stroke::Dots } else { Stroke::Squares };
        lines.push(Line::marks(format!("rule {}", rule_name(rule)), colour, stroke, 4, dots));
    }
    let chosen = &field.obstacles()[replaced];
    let ring = vec![(chosen.ttc_s, when_passed_m(chosen))];
    lines.push(Line::marks("the one replaced", colour::BLACK, Stroke::Rings, 8, ring));
    lines.push(Line::marks("agent", colour::ORANGE, Stroke::Dots, 5, vec![(0.0, field.agent().position.y)]));
    Panel {
        title,
        x_label: "time to collision, TTC (s)".into(),
        y_label: "y, to port (m)".into(),
        lines,
        close_up: true,
        legend: LegendPlace::Emptiest,
        size_px: Some((560, 420)),
        ..Panel::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Cell;

    #[test]
    fn the_one_replaced_moves_into_the_interval_and_beside_the_path() {
        let config = OpenWaterConfig::default();
        for seed in 0..5 {
            let product = make(&config, seed, seed).unwrap();
            let rows = product.data.rows();
            assert_eq!(rows.len(), 20);
            let number = |cell: &Cell| match cell {
                Cell::Number(value) => *value,
                other => panic!("{other:?} is no number"),
            };
            let chosen: Vec<_> = rows.iter().filter(|row| row[9] == "yes".into()).collect();
            assert_eq!(chosen.len(), 2);
            assert!(number(&chosen[0][3]) < 0.0);
            let new_s = number(&chosen[1][3]);
            let others = rows.iter().filter(|row| row[0] == "after".into() && row[2] == chosen[1][2]);
            let latest_s =
                others.map(|row| number(&row[3])).filter(|&ttc_s| ttc_s != new_s).fold(0.0, f64::max);
            assert!(new_s > latest_s && new_s < latest_s + 300.0);
            assert!(product.to_svg().unwrap().contains("the one replaced"));
        }
    }
}
