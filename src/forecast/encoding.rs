//! Between positions and what a network sees: displacements and an anchor, scaled, in f32.

use serde::{Deserialize, Serialize};

use crate::geo::{Displacement, Position};

/// Fixed constants that bring inputs and outputs of a network near one; they stay with the weights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scaling {
    /// Metres that one unit of a displacement from step to step stands for, in and out.
    pub step_m: f64,
    /// Metres that one unit of the absolute position stands for.
    pub anchor_m: f64,
}

impl Default for Scaling {
    fn default() -> Self {
        Self { step_m: 20.0, anchor_m: 2000.0 }
    }
}

/// How a network reads and continues paths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Encoding {
    /// Positions read, one more than displacements.
    pub history_len: usize,
    /// Displacements that one call gives.
    pub outputs: usize,
    pub scaling: Scaling,
}

/// Paths of a batch that a network extends call by call, `[rows][history + horizon]`.
///
/// Positions stay in f64; only what the network is shown and says is f32.
#[derive(Debug, Clone, Default)]
pub(super) struct Paths {
    positions: Vec<Position>,
    rows: usize,
    stride: usize,
    len: usize,
}

impl Paths {
    /// Starts from the last positions of each history, with room for `calls`.
    pub fn start<'a>(
        &mut self,
        encoding: &Encoding,
        histories: impl ExactSizeIterator<Item = &'a [Position]>,
        calls: usize,
    ) {
        self.rows = histories.len();
        self.len = encoding.history_len;
        self.stride = encoding.history_len + calls * encoding.outputs;
        self.positions.clear();
        self.positions.resize(self.rows * self.stride, Position::ORIGIN);
        for (row, history) in self.positions.chunks_mut(self.stride).zip(histories) {
            row[..encoding.history_len].copy_from_slice(&history[history.len() - encoding.history_len..]);
        }
    }

    /// Writes what the network is shown of the last `steps + 1` positions: `input[steps][rows][2]` and
    /// `anchor[rows][2]`, north before east.
    pub fn encode(&self, scaling: Scaling, steps: usize, input: &mut [f32], anchor: &mut [f32]) {
        let first = self.len - 1 - steps;
        for (step, input) in input.chunks_mut(2 * self.rows.max(1)).take(steps).enumerate() {
            self.encode_displacement(scaling, first + step, input);
        }
        self.encode_anchor(scaling, anchor);
    }

    /// Writes the displacements from position `step` to the next: `input[rows][2]`.
    pub fn encode_displacement(&self, scaling: Scaling, step: usize, input: &mut [f32]) {
        for (row, input) in self.positions.chunks(self.stride).zip(input.as_chunks_mut().0) {
            let way = (row[step + 1] - row[step]) * (1.0 / scaling.step_m);
            *input = [way.north_m as f32, way.east_m as f32];
        }
    }

    /// Writes the present positions: `anchor[rows][2]`.
    pub fn encode_anchor(&self, scaling: Scaling, anchor: &mut [f32]) {
        for (row, anchor) in self.positions.chunks(self.stride).zip(anchor.as_chunks_mut().0) {
            let here = row[self.len - 1];
            *anchor = [(here.north_m / scaling.anchor_m) as f32, (here.east_m / scaling.anchor_m) as f32];
        }
    }

    /// Appends the displacements that the network gave, `output[rows][outputs][2]`.
    pub fn extend(&mut self, encoding: &Encoding, output: &[f32]) {
        let rows = self.positions.chunks_mut(self.stride);
        for (row, given) in rows.zip(output.chunks(2 * encoding.outputs)) {
            for (step, way) in given.chunks_exact(2).enumerate() {
                let way = Displacement { north_m: f64::from(way[0]), east_m: f64::from(way[1]) };
                row[self.len + step] = row[self.len + step - 1] + way * encoding.scaling.step_m;
            }
        }
        self.len += encoding.outputs;
    }

    /// The positions of one row after its history.
    pub fn future(&self, encoding: &Encoding, row: usize) -> &[Position] {
        &self.positions[row * self.stride + encoding.history_len..row * self.stride + self.len]
    }
}
