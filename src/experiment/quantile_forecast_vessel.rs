//! `quantile_forecast_vessel`: error quantiles over 200 steps in coastal waters (paper, section
//! "Supervised learning" of the maritime study).

use super::forecasts::{ERROR_COLUMNS, Measured, add_errors, error_caption, error_panel};
use super::product::{DataTable, Drawing, Product};
use crate::report::figure::Figure;

/// All segments; those with a curve and those of vessels that training has not seen are in the caption.
#[must_use]
pub fn make(measured: &Measured) -> Product {
    let mut data = DataTable::new(&ERROR_COLUMNS);
    add_errors(&mut data, measured);
    let mut panel = error_panel(measured);
    panel.size_px = Some((640, 420));
    let subsets = [
        ("with a curve", &measured.evaluation.curve),
        ("of vessels that training has not seen", &measured.evaluation.unseen_vessels),
    ];
    let told = subsets.into_iter().filter_map(|(which, errors)| {
        let errors = errors.as_ref()?;
        let (model_m, linear_m) = (errors.rmse_m.q50, errors.linear_rmse_m.q50);
        Some(format!(" {} segments {which}: {model_m:.0} m, straight line {linear_m:.0} m.", errors.segments))
    });
    let caption = error_caption(std::slice::from_ref(measured)) + &told.collect::<String>();
    Product { drawing: Drawing::Figure(Figure::single(panel)), data, caption }
}
