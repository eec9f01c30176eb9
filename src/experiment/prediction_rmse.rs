//! `prediction_rmse`: error quantiles over the horizon in open water, both motions (paper, section
//! "Trajectory prediction").

use super::forecasts::{ERROR_COLUMNS, Measured, add_errors, error_caption, error_panel};
use super::product::{DataTable, Drawing, Product};
use crate::report::figure::Figure;

/// One panel for each model.
#[must_use]
pub fn make(measured: &[Measured]) -> Product {
    let mut data = DataTable::new(&ERROR_COLUMNS);
    measured.iter().for_each(|measured| add_errors(&mut data, measured));
    let panels: Vec<_> = measured.iter().map(error_panel).collect();
    let columns = panels.len().min(2);
    Product { drawing: Drawing::Figure(Figure { panels, columns }), data, caption: error_caption(measured) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::forecasts::tests::{segments, tiny};
    use crate::forecast::{EvaluationConfig, ModelKind, evaluate};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn every_step_of_the_horizon_has_its_quantiles() {
        let mut forecaster = tiny(ModelKind::OpenWater);
        let source = segments(&forecaster.model().config, 100);
        let held_out = source.take(10, &mut ChaCha8Rng::seed_from_u64(2));
        let config = EvaluationConfig { noise_m: Vec::new(), ..EvaluationConfig::default() };
        let evaluation = evaluate(&mut forecaster, &held_out, &|_| false, &config).unwrap();
        let measured = Measured::new(forecaster.model(), evaluation, None);
        let product = make(&[measured.clone(), measured]);
        assert_eq!(product.data.rows().len(), 2 * 2 * 100);
        assert!(product.caption.contains("10 segments drawn fresh"), "{}", product.caption);
        assert_eq!(product.to_svg().unwrap().matches("error (m)").count(), 2);
    }
}
