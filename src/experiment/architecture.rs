//! `architecture`: the two steps with the sizes actually used (paper, figure "Architecture").

use std::fmt::Write as _;

use super::product::{DataTable, Drawing, Product, data_row};
use crate::env::coastal::CoastalConfig;
use crate::env::open_water::OpenWaterConfig;
use crate::forecast::ModelKind;
use crate::forecast::network::{COORDINATES, NetworkConfig};
use crate::nn::Activation;
use crate::report::xml_escaped;
use crate::rl::agent::{AgentConfig, Algorithm};

/// What a lane of the drawing is about.
struct Lane {
    title: String,
    kind: ModelKind,
    network: NetworkConfig,
    horizon: usize,
    backcast: bool,
    smoothing: usize,
    observation_len: usize,
    obstacles: usize,
}

/// A layer with its sizes.
struct Layer {
    part: &'static str,
    name: &'static str,
    inputs: usize,
    outputs: usize,
    then: &'static str,
    /// Weights and biases.
    parameters: usize,
}

impl Layer {
    fn linear(part: &'static str, inputs: usize, outputs: usize, then: &'static str) -> Self {
        Self { part, name: "Linear", inputs, outputs, then, parameters: (inputs + 1) * outputs }
    }

    /// Four gates, each on input and state, with two biases as PyTorch has them.
    fn lstm(part: &'static str, inputs: usize, outputs: usize) -> Self {
        let parameters = 4 * outputs * (inputs + outputs + 2);
        Self { part, name: "LSTM", inputs, outputs, then: "", parameters }
    }

    fn text(&self) -> String {
        let then = if self.then.is_empty() { String::new() } else { format!(", {}", self.then) };
        format!("{} {} \u{2192} {}{then}", self.name, self.inputs, self.outputs)
    }
}

/// The architecture with networks of these kinds and agents of this configuration.
#[must_use]
pub fn make(agent: &AgentConfig, open_water: &OpenWaterConfig, coastal: &CoastalConfig) -> Product {
    let lanes = [
        Lane {
            title: "Open water".into(),
            kind: ModelKind::OpenWater,
            network: ModelKind::OpenWater.network(),
            horizon: open_water.forecast_steps,
            backcast: true,
            smoothing: open_water.smoothing_half_width,
            observation_len: open_water.observation_len(true),
            obstacles: 2 * open_water.obstacles_per_rule,
        },
        Lane {
            title: "Coastal waters".into(),
            kind: ModelKind::Coastal,
            network: ModelKind::Coastal.network(),
            horizon: coastal.forecast_steps,
            backcast: false,
            smoothing: 0,
            observation_len: coastal.observation_len(true),
            obstacles: 1 + coastal.linear_obstacles,
        },
    ];
    let mut data = DataTable::new(&["waters", "part", "layer", "inputs", "outputs", "then", "parameters"]);
    let mut svg = String::new();
    let height_px = TOP_PX + LANE_PX * lanes.len() as f64;
    let _ = write!(
        svg,
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH_PX}" height="{height_px}" viewBox="0 0 {WIDTH_PX} {height_px}" font-family="sans-serif" font-size="13" fill="#24323f">
<rect width="100%" height="100%" fill="#ffffff"/>
<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8Z" fill="#24323f"/></marker></defs>
"##
    );
    for (index, lane) in lanes.iter().enumerate() {
        draw_lane(&mut svg, TOP_PX + LANE_PX * index as f64, lane, agent, &mut data);
    }
    svg.push_str("</svg>\n");
    let algorithm = match agent.algorithm {
        Algorithm::LstmTd3 => "LSTM-TD3",
        Algorithm::LstmSac => "LSTM-SAC",
    };
    let caption = format!(
        "Step 1 forecasts each obstacle and takes its closest point of approach (CPA); step 2 is the agent that sees it. \
         Sizes are those of the networks and settings in use. The actor is shown, of LSTM-TD3; that of LSTM-SAC ends in two \
         outputs per action, mean and logarithm of the standard deviation. Critics also take the action beside the present \
         observation and end in one value. Settings here: {algorithm}, history l = {}.",
        agent.history_len
    );
    Product { drawing: Drawing::Svg(svg), data, caption }
}

const WIDTH_PX: f64 = 1180.0;
const TOP_PX: f64 = 12.0;
const LANE_PX: f64 = 346.0;
const BOX_PX: f64 = 232.0;
const ROW_PX: f64 = 19.0;

fn forecaster_layers(network: &NetworkConfig) -> Vec<Layer> {
    let part = "forecaster";
    let anchor = if network.anchored { COORDINATES } else { 0 };
    let then = match network.activation {
        Activation::LeakyRelu { .. } => "leaky ReLU",
        _ => "ReLU",
    };
    let mut layers = vec![Layer::lstm(part, COORDINATES, network.hidden)];
    let mut inputs = network.hidden + anchor;
    for &units in &network.layers {
        layers.push(Layer::linear(part, inputs, units, then));
        inputs = units;
    }
    layers.push(Layer::linear(part, inputs, network.outputs(), ""));
    layers
}

fn actor_layers(observation_len: usize, hidden: usize) -> [Vec<Layer>; 3] {
    [
        vec![
            Layer::linear("actor, current features", observation_len, hidden, "ReLU"),
            Layer::linear("actor, current features", hidden, hidden, "ReLU"),
        ],
        vec![
            Layer::linear("actor, memory", observation_len, hidden, "ReLU"),
            Layer::lstm("actor, memory", hidden, hidden),
        ],
        vec![
            Layer::linear("actor, integration", 2 * hidden, hidden, "ReLU"),
            Layer::linear("actor, integration", hidden, 1, "tanh"),
        ],
    ]
}

fn draw_lane(svg: &mut String, top_px: f64, lane: &Lane, agent: &AgentConfig, data: &mut DataTable) {
    let forecaster = forecaster_layers(&lane.network);
    let [current, memory, integration] = actor_layers(lane.observation_len, agent.hidden);
    for layer in forecaster.iter().chain(&current).chain(&memory).chain(&integration) {
        let (name, title) = (layer.name, lane.title.as_str());
        data.push(data_row![
            title,
            layer.part,
            name,
            layer.inputs,
            layer.outputs,
            layer.then,
            layer.parameters
        ]);
    }
    let texts = |layers: &[Layer]| layers.iter().map(Layer::text).collect::<Vec<_>>();
    let _ = writeln!(
        svg,
        r#"<text x="20" y="{:.0}" font-size="17" font-weight="600">{}</text>"#,
        top_px + 20.0,
        xml_escaped(&lane.title)
    );
    let columns = [20.0, 324.0, 628.0, 932.0];
    let (upper_px, lower_px) = (top_px + 48.0, top_px + 206.0);
    let (length, step) = (lane.kind.history_len(), lane.network.steps);
    let seen = vec![
        format!("{length} positions of each obstacle"),
        format!("{step} differences of {COORDINATES} numbers"),
    ];
    let mut network = texts(&forecaster);
    if lane.network.anchored {
        network.insert(1, format!("joined by the position ({COORDINATES})"));
    }
    let both = if lane.backcast { "forecast and backcast" } else { "forecast" };
    let forecast = vec![
        format!("{} step(s) per call", lane.network.predicted),
        format!("{} steps in all:", lane.horizon),
        both.to_owned(),
    ];
    let smoothing = match lane.smoothing {
        0 => "distances not smoothed".to_owned(),
        n => format!("distances smoothed, n = {n}"),
    };
    let risk = vec![smoothing, "minimum over all times".into(), "DCPA, TCPA of each obstacle".into()];
    let step_1 =
        [("Observed motion", seen), ("Forecaster", network), ("Paths", forecast), ("Collision risk", risk)];
    for ((title, rows), x) in step_1.into_iter().zip(columns) {
        draw_box(svg, x, upper_px, title, &rows, "#e7f1fa", "#0072b2");
    }
    let observed = vec![
        format!("{} values: own ship,", lane.observation_len),
        format!("{} obstacles with DCPA, TCPA", lane.obstacles),
        format!("and the {} observations before", agent.history_len),
    ];
    let features = [texts(&current), vec!["beside, over the history:".into()], texts(&memory)].concat();
    let step_2 = [
        ("Observation", observed),
        ("Features and memory", features),
        ("Integration", texts(&integration)),
        ("Action", vec!["1 number in [-1, 1]".into()]),
    ];
    for ((title, rows), x) in step_2.into_iter().zip(columns) {
        draw_box(svg, x, lower_px, title, &rows, "#fdeee3", "#e66100");
    }
    for row_px in [upper_px, lower_px] {
        for pair in columns.windows(2) {
            arrow(svg, &[(pair[0] + BOX_PX, row_px + 44.0), (pair[1], row_px + 44.0)]);
        }
    }
    let (from, to) = (columns[3] + BOX_PX / 2.0, columns[0] + BOX_PX / 2.0);
    let bottom = |rows: f64| upper_px + 30.0 + ROW_PX * rows;
    let between = lower_px - 15.0;
    arrow(svg, &[(from, bottom(3.0)), (from, between), (to, between), (to, lower_px)]);
    for (row_px, text) in [(upper_px, "step 1"), (lower_px, "step 2")] {
        let _ = writeln!(svg, r##"<text x="20" y="{:.0}" fill="#5b6b79">{text}</text>"##, row_px - 4.0);
    }
}

fn draw_box(svg: &mut String, x: f64, y: f64, title: &str, rows: &[String], fill: &str, stroke: &str) {
    let height_px = 30.0 + ROW_PX * rows.len() as f64;
    let _ = writeln!(
        svg,
        r#"<rect x="{x}" y="{y}" width="{BOX_PX}" height="{height_px}" rx="6" fill="{fill}" stroke="{stroke}" stroke-width="1.5"/>
<text x="{:.0}" y="{:.0}" font-weight="600">{}</text>"#,
        x + 12.0,
        y + 19.0,
        xml_escaped(title)
    );
    for (index, row) in rows.iter().enumerate() {
        let y_px = y + 19.0 + ROW_PX * (index + 1) as f64;
        let _ = writeln!(svg, r#"<text x="{:.0}" y="{y_px:.0}">{}</text>"#, x + 12.0, xml_escaped(row));
    }
}

fn arrow(svg: &mut String, points: &[(f64, f64)]) {
    let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.0},{y:.0}")).collect();
    let _ = writeln!(
        svg,
        r##"<polyline points="{}" fill="none" stroke="#24323f" stroke-width="1.4" marker-end="url(#tip)"/>"##,
        points.join(" ")
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forecast::network::ForecastNetwork;
    use crate::nn::Parameters;
    use crate::rl::agent::Agent;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn total(layers: &[Layer]) -> usize {
        layers.iter().map(|layer| layer.parameters).sum()
    }

    fn size(parameters: &Parameters<f32>) -> usize {
        parameters.layout().tensors().iter().map(|tensor| tensor.positions().count()).sum()
    }

    /// The sizes shown make the networks in use, weight for weight.
    #[test]
    fn the_sizes_are_those_in_use() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for kind in [ModelKind::OpenWater, ModelKind::Coastal] {
            let network = ForecastNetwork::<f32>::new(kind.network(), &mut rng);
            assert_eq!(total(&forecaster_layers(&kind.network())), size(&network.parameters));
        }
        let config = AgentConfig { algorithm: Algorithm::LstmTd3, ..AgentConfig::default() };
        let hidden = config.hidden;
        let mut agent = Agent::new(config, 43, 1, &mut rng);
        let [actor, ..] = agent.networks();
        let shown: usize = actor_layers(43, hidden).iter().map(|layers| total(layers)).sum();
        assert_eq!(shown, size(actor.online));
    }

    #[test]
    fn both_lanes_state_their_sizes() {
        let product = make(&AgentConfig::default(), &OpenWaterConfig::default(), &CoastalConfig::default());
        assert_eq!(product.data.rows().len(), 3 + 6 + 4 + 6);
        let svg = product.to_svg().unwrap();
        for text in
            ["LSTM 2 \u{2192} 64", "Linear 258 \u{2192} 256, leaky ReLU", "43 values", "26 values", "n = 10"]
        {
            assert!(svg.contains(text), "{text}");
        }
    }
}
