//! What the figures of forecasts share: how a model is introduced, maps, and the error over the horizon.

use std::path::Path;

use super::curves::{counted, thousands};
use super::product::{DataTable, data_row};
use crate::forecast::{DataConfig, Evaluation, Model, Quantiles};
use crate::geo::Position;
use crate::report::figure::{LegendPlace, Line, Panel, Stroke, colour};

/// A model as captions name it: updates and seed are those that made its weights.
#[must_use]
pub fn introduced(model: &Model) -> String {
    let config = &model.config;
    let start = if config.training.start_from.is_some() { " after earlier stages" } else { "" };
    format!("{}: {} updates{start}, seed {}", config.name, thousands(model.steps), config.training.seed)
}

/// A map with the same scale on both axes.
pub(super) fn map(title: String, lines: Vec<Line>) -> Panel {
    Panel {
        title,
        x_label: "east (km)".into(),
        y_label: "north (km)".into(),
        lines,
        equal_scales: true,
        legend: LegendPlace::Emptiest,
        ..Panel::default()
    }
}

/// Positions on a map in kilometres.
pub(super) fn on_map(positions: &[Position]) -> Vec<(f64, f64)> {
    positions.iter().map(|position| (position.east_m / 1000.0, position.north_m / 1000.0)).collect()
}

/// Columns of the positions behind a map.
pub(super) const MAP_COLUMNS: [&str; 5] = ["panel", "series", "step", "north_m", "east_m"];

/// Rows for positions; `first` is the step of the first of them, 0 is now.
pub(super) fn add_positions(
    data: &mut DataTable,
    panel: &str,
    series: &str,
    first: i64,
    positions: &[Position],
) {
    for (step, position) in (first..).zip(positions) {
        data.push(data_row![panel, series, step as f64, position.north_m, position.east_m]);
    }
}

/// A model with its errors on held-out segments.
#[derive(Debug, Clone)]
pub struct Measured {
    /// What captions say of the model.
    pub introduction: String,
    /// Its errors.
    pub evaluation: Evaluation,
    /// Time step, in seconds.
    pub dt_s: f64,
    /// Where the segments are from.
    pub segments: String,
    is_recorded: bool,
}

impl Measured {
    /// Of a model measured on its own held-out data, or on all tracks of another area.
    #[must_use]
    pub fn new(model: &Model, evaluation: Evaluation, other_area: Option<&Path>) -> Self {
        let segments = match (other_area, &model.config.data) {
            (Some(area), _) => format!("of all tracks of {}, where it was not trained", area.display()),
            (None, DataConfig::Synthetic { .. }) => {
                "drawn fresh from the process it was trained on".to_owned()
            }
            (None, DataConfig::Recorded { area, .. }) => {
                format!("of the time span of {area} that training leaves out")
            }
        };
        let is_recorded = matches!(model.config.data, DataConfig::Recorded { .. });
        Self { introduction: introduced(model), dt_s: model.config.dt_s(), evaluation, segments, is_recorded }
    }

    /// Whether the model was trained on recorded tracks.
    #[must_use]
    pub fn is_recorded(&self) -> bool {
        self.is_recorded
    }
}

/// Columns of the data behind error figures.
pub(super) const ERROR_COLUMNS: [&str; 8] =
    ["model", "forecaster", "step", "time_s", "q25_m", "q50_m", "q75_m", "q90_m"];

/// Quantiles of the error at every step of the horizon.
#[must_use]
pub fn error_panel(measured: &Measured) -> Panel {
    let Evaluation { model: name, segments, steps, .. } = &measured.evaluation;
    let series = |quantiles: &[Quantiles], of: fn(&Quantiles) -> f64| -> Vec<(f64, f64)> {
        let points = quantiles.iter().enumerate();
        points.map(|(k, quantiles)| (minutes_ahead(k, measured.dt_s), of(quantiles))).collect()
    };
    let model = |of| series(&steps.model, of);
    let line = |label: &str, colour, stroke, points| Line { stroke, ..Line::solid(label, colour, points) };
    Panel {
        title: format!("{name}, {segments} segments"),
        x_label: "time ahead (min)".into(),
        y_label: "error (m)".into(),
        lines: vec![
            line("straight line, 50 %", colour::GREY, Stroke::Dashed, series(&steps.linear, |q| q.q50)),
            line("90 %", colour::PURPLE, Stroke::Dashed, model(|q| q.q90)),
            line("75 %", colour::ORANGE, Stroke::Solid, model(|q| q.q75)),
            Line { width: 3, ..line("50 %", colour::BLUE, Stroke::Solid, model(|q| q.q50)) },
            line("25 %", colour::GREEN, Stroke::Dashed, model(|q| q.q25)),
        ],
        ..Panel::default()
    }
}

/// The numbers of an error panel.
pub(super) fn add_errors(data: &mut DataTable, measured: &Measured) {
    let Evaluation { model: name, steps, .. } = &measured.evaluation;
    for (forecaster, quantiles) in [("model", &steps.model), ("straight line", &steps.linear)] {
        for (k, q) in quantiles.iter().enumerate() {
            let time_s = (k + 1) as f64 * measured.dt_s;
            data.push(data_row![name.as_str(), forecaster, k + 1, time_s, q.q25, q.q50, q.q75, q.q90]);
        }
    }
}

fn minutes_ahead(k: usize, dt_s: f64) -> f64 {
    (k + 1) as f64 * dt_s / 60.0
}

/// What an error figure shows of each model.
pub(super) fn error_caption(measured: &[Measured]) -> String {
    let each = measured.iter().map(|measured| {
        let Evaluation { rmse_m, linear_rmse_m, segments, .. } = &measured.evaluation;
        format!(
            "{}; {} {}; median over them of the root mean square error along the path {:.0} m, of the straight line {:.0} m.",
            measured.introduction,
            counted(*segments, "segment"),
            measured.segments,
            rmse_m.q50,
            linear_rmse_m.q50,
        )
    });
    let how =
        "Quantiles over held-out segments of the distance between forecast and truth at each time ahead.";
    std::iter::once(how.to_owned()).chain(each).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
pub(super) mod tests {
    use crate::forecast::dataset::{Process, SegmentSource, SyntheticConfig, SyntheticSegments};
    use crate::forecast::{
        DataConfig, LstmForecaster, Model, ModelConfig, ModelKind, Trainer, TrainingConfig,
    };
    use crate::geo::Position;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// A network of full size with a handful of updates, and what it is trained on.
    pub(in crate::experiment) fn tiny(kind: ModelKind) -> LstmForecaster {
        let text = "name = \"tiny\"\nkind = \"open-water\"\n[data.synthetic.process.stochastic]\n[training]\nseed = 3\n\
                    [[training.stages]]\nsteps = 3\nbatch = 4\n";
        let mut config: ModelConfig = toml::from_str(text).unwrap();
        config.kind = kind;
        let source = segments(&config, kind.outputs());
        let training: TrainingConfig = config.training.clone();
        let mut trainer = Trainer::new(kind, training, Box::new(source), 1).unwrap();
        while trainer.update().is_some() {}
        LstmForecaster::new(Model::of(&trainer, &config, None), 1)
    }

    pub(in crate::experiment) fn segments(config: &ModelConfig, horizon: usize) -> SyntheticSegments {
        let DataConfig::Synthetic { process, segments } = &config.data else { panic!("synthetic data") };
        let (process, segments): (Process, SyntheticConfig) = (*process, *segments);
        SyntheticSegments { process, config: segments, history_len: config.kind.history_len(), horizon }
    }

    /// A path of the model's own process.
    pub(in crate::experiment) fn path(config: &ModelConfig, length: usize) -> Vec<Position> {
        let source = SyntheticSegments { history_len: length, ..segments(config, 0) };
        source.draw(&mut ChaCha8Rng::seed_from_u64(5)).history
    }
}
