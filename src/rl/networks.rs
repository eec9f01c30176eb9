//! The recurrent network that actors and critics share (paper, section "Recurrent reinforcement
//! learning" and figure "Architecture").
//!
//! ```text
//! observation [+ action] ─ current_1 ─ current_2 ─┐
//!                                                 ├─ integrate_1 ─ integrate_2 ─ output
//! history ─ memory_in ─ LSTM, last valid step ────┘
//! ```
//!
//! The current branch is the paper's CFE, the memory branch MEM, their integration PI. MEM comes first
//! in the concatenation, as in `MEM(h) ⋈ CFE(o, a)`. An empty history gives zero memory.

use std::sync::Arc;

use crate::nn::{Activation, Buffer, Compute, Dense, Gradients, Layout, Lstm, LstmState, Parameters, Real};

/// Sizes of a [`RecurrentNet`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecurrentShape {
    /// Length of an observation.
    pub observation_len: usize,
    /// Length of an action that enters beside the observation; 0 for an actor.
    pub action_len: usize,
    /// Units of every hidden layer.
    pub hidden: usize,
    /// Length of the output.
    pub outputs: usize,
    /// What is done to the output.
    pub output_activation: Activation,
}

/// The layers of one network, as handles into a [`Layout`].
#[derive(Debug, Clone)]
pub struct RecurrentNet {
    shape: RecurrentShape,
    layout: Arc<Layout>,
    current: [Dense; 2],
    memory_in: Dense,
    lstm: Lstm,
    integrate: [Dense; 2],
}

/// Past observations of a batch: `[steps][rows][observation_len]`, a row's valid steps first.
#[derive(Debug, Clone, Copy)]
pub struct History<'a, T> {
    /// The observations.
    pub observations: &'a [T],
    /// Valid steps of each row.
    pub lengths: &'a [usize],
}

/// Activations of one pass and their gradients.
#[derive(Debug, Clone)]
pub struct RecurrentBuffers<T> {
    rows: usize,
    input: Buffer<T>,
    current: [Buffer<T>; 2],
    memory: Buffer<T>,
    lstm: LstmState<T>,
    joined: Buffer<T>,
    integrated: Buffer<T>,
    output: Buffer<T>,
    d_input: Buffer<T>,
    d_current: [Buffer<T>; 2],
    d_memory: Buffer<T>,
    d_joined: Buffer<T>,
    d_integrated: Buffer<T>,
    d_output: Buffer<T>,
}

impl<T: Real> RecurrentBuffers<T> {
    /// `[rows][outputs]` of the last forward pass.
    #[must_use]
    pub fn output(&self) -> &[T] {
        &self.output
    }

    /// Gradient of the loss with respect to the output, to be filled before a backward pass, which
    /// uses it up.
    pub fn d_output(&mut self) -> &mut [T] {
        &mut self.d_output
    }

    /// Output and its gradient at once.
    pub fn output_and_gradient(&mut self) -> (&[T], &mut [T]) {
        (&self.output, &mut self.d_output)
    }
}

impl RecurrentNet {
    /// A network of the given sizes.
    #[must_use]
    pub fn new(shape: RecurrentShape) -> Self {
        let RecurrentShape { observation_len, action_len, hidden, outputs, output_activation } = shape;
        let mut layout = Layout::new();
        let relu = Activation::Relu;
        let current = [
            Dense::new(&mut layout, "current_1", observation_len + action_len, hidden, relu),
            Dense::new(&mut layout, "current_2", hidden, hidden, relu),
        ];
        let memory_in = Dense::new(&mut layout, "memory_in", observation_len, hidden, relu);
        let lstm = Lstm::new(&mut layout, "memory", hidden, hidden);
        let integrate = [
            Dense::new(&mut layout, "integrate_1", 2 * hidden, hidden, relu),
            Dense::new(&mut layout, "integrate_2", hidden, outputs, output_activation),
        ];
        Self { shape, layout: Arc::new(layout), current, memory_in, lstm, integrate }
    }

    /// Its sizes.
    #[must_use]
    pub fn shape(&self) -> &RecurrentShape {
        &self.shape
    }

    /// The table of its tensors.
    #[must_use]
    pub fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }

    /// Multiply-adds of one forward pass over `rows` rows with full histories of `steps`.
    #[must_use]
    pub fn operations(&self, steps: usize, rows: usize) -> usize {
        let dense = [&self.current[0], &self.current[1], &self.integrate[0], &self.integrate[1]];
        dense.iter().map(|layer| layer.operations(rows)).sum::<usize>()
            + self.memory_in.operations(steps * rows)
            + self.lstm.operations(steps, rows)
    }

    /// Multiply-adds of [`Self::backward`]: each product of the forward pass twice, except that no gradient
    /// with respect to observations is wanted.
    #[must_use]
    pub fn backward_operations(&self, steps: usize, rows: usize) -> usize {
        let unwanted = self.current[0].operations(rows) + self.memory_in.operations(steps * rows);
        2 * self.operations(steps, rows) - unwanted
    }

    /// Multiply-adds of [`Self::backward_to_action`].
    #[must_use]
    pub fn backward_to_action_operations(&self, rows: usize) -> usize {
        let layers = [&self.current[0], &self.current[1], &self.integrate[0], &self.integrate[1]];
        layers.iter().map(|layer| layer.operations(rows)).sum()
    }

    /// Buffers for batches of `rows` rows with histories of up to `steps` observations.
    #[must_use]
    pub fn buffers<T: Real>(&self, steps: usize, rows: usize) -> RecurrentBuffers<T> {
        let RecurrentShape { observation_len, action_len, hidden, outputs, .. } = self.shape;
        let zeros = |width: usize| Buffer::zeros(rows * width);
        RecurrentBuffers {
            rows,
            input: zeros(observation_len + action_len),
            current: [zeros(hidden), zeros(hidden)],
            memory: zeros(steps * hidden),
            lstm: self.lstm.state(steps, rows),
            joined: zeros(2 * hidden),
            integrated: zeros(hidden),
            output: zeros(outputs),
            d_input: zeros(observation_len + action_len),
            d_current: [zeros(hidden), zeros(hidden)],
            d_memory: zeros(steps * hidden),
            d_joined: zeros(2 * hidden),
            d_integrated: zeros(hidden),
            d_output: zeros(outputs),
        }
    }

    /// Computes the output of a batch: `observation[rows][observation_len]`,
    /// `action[rows][action_len]` (empty for an actor).
    pub fn forward<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        observation: &[T],
        action: &[T],
        history: History<'_, T>,
        buffers: &mut RecurrentBuffers<T>,
    ) {
        let rows = buffers.rows;
        self.join_input(observation, action, buffers);
        self.current[0].forward(compute, parameters, &buffers.input, rows, &mut buffers.current[0]);
        let [first, second] = &mut buffers.current;
        self.current[1].forward(compute, parameters, first, rows, second);

        let steps = longest(&history, rows);
        let hidden = self.shape.hidden;
        self.memory_in.forward(compute, parameters, history.observations, steps * rows, &mut buffers.memory);
        let lengths = Some(history.lengths);
        self.lstm.forward(compute, parameters, &buffers.memory, steps, rows, lengths, &mut buffers.lstm);
        buffers.lstm.read_last(lengths, &mut buffers.joined, 2 * hidden);
        for (joined, current) in buffers.joined.chunks_mut(2 * hidden).zip(buffers.current[1].chunks(hidden))
        {
            joined[hidden..].copy_from_slice(current);
        }

        self.integrate[0].forward(compute, parameters, &buffers.joined, rows, &mut buffers.integrated);
        self.integrate[1].forward(compute, parameters, &buffers.integrated, rows, &mut buffers.output);
    }

    /// Adds the gradients of the weights, after [`Self::forward`] on the same history; the gradient
    /// of the output lies in `buffers`.
    pub fn backward<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        history: History<'_, T>,
        buffers: &mut RecurrentBuffers<T>,
        gradients: &mut Gradients<T>,
    ) {
        let rows = buffers.rows;
        let hidden = self.shape.hidden;
        self.integration_backward(compute, parameters, buffers, Some(gradients));
        self.current_backward(compute, parameters, buffers, Some(gradients), false);
        let steps = longest(&history, rows);
        if steps == 0 {
            return;
        }
        self.lstm.backward(
            compute,
            parameters,
            &buffers.memory,
            Some(history.lengths),
            &mut buffers.lstm,
            (&buffers.d_joined, 2 * hidden),
            Some(&mut buffers.d_memory),
            Some(gradients),
        );
        self.memory_in.backward(
            compute,
            parameters,
            history.observations,
            &buffers.memory,
            steps * rows,
            &mut buffers.d_memory,
            None,
            Some(gradients),
        );
    }

    /// The gradient with respect to the action, `d_action[rows][action_len]`, and nothing else; the
    /// memory branch does not see the action and is left out.
    pub fn backward_to_action<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        buffers: &mut RecurrentBuffers<T>,
        d_action: &mut [T],
    ) {
        self.integration_backward(compute, parameters, buffers, None);
        self.current_backward(compute, parameters, buffers, None, true);
        let (n, m) = (self.shape.observation_len, self.shape.action_len);
        for (d_action, d_input) in d_action.chunks_mut(m).zip(buffers.d_input.chunks(n + m)) {
            d_action.copy_from_slice(&d_input[n..]);
        }
    }

    /// From the output back to the joined branches; the current branch's share is laid out for it.
    fn integration_backward<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        buffers: &mut RecurrentBuffers<T>,
        mut gradients: Option<&mut Gradients<T>>,
    ) {
        let rows = buffers.rows;
        let hidden = self.shape.hidden;
        self.integrate[1].backward(
            compute,
            parameters,
            &buffers.integrated,
            &buffers.output,
            rows,
            &mut buffers.d_output,
            Some(&mut buffers.d_integrated),
            gradients.as_deref_mut(),
        );
        self.integrate[0].backward(
            compute,
            parameters,
            &buffers.joined,
            &buffers.integrated,
            rows,
            &mut buffers.d_integrated,
            Some(&mut buffers.d_joined),
            gradients,
        );
        let joined = buffers.d_joined.chunks(2 * hidden);
        for (current, joined) in buffers.d_current[1].chunks_mut(hidden).zip(joined) {
            current.copy_from_slice(&joined[hidden..]);
        }
    }

    /// From the current branch's output back to its input: gradients of the weights, and of the input, each
    /// where it is wanted.
    fn current_backward<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        buffers: &mut RecurrentBuffers<T>,
        mut gradients: Option<&mut Gradients<T>>,
        wants_input: bool,
    ) {
        let RecurrentBuffers { rows, input, current, d_input, d_current, .. } = buffers;
        let [d_first, d_second] = d_current;
        self.current[1].backward(
            compute,
            parameters,
            &current[0],
            &current[1],
            *rows,
            d_second,
            Some(d_first),
            gradients.as_deref_mut(),
        );
        let d_input = wants_input.then_some(&mut **d_input);
        self.current[0].backward(compute, parameters, input, &current[0], *rows, d_first, d_input, gradients);
    }

    fn join_input<T: Real>(&self, observation: &[T], action: &[T], buffers: &mut RecurrentBuffers<T>) {
        let (n, m) = (self.shape.observation_len, self.shape.action_len);
        assert!(observation.len() == buffers.rows * n && action.len() == buffers.rows * m);
        for (row, input) in buffers.input.chunks_mut(n + m).enumerate() {
            input[..n].copy_from_slice(&observation[row * n..][..n]);
            input[n..].copy_from_slice(&action[row * m..][..m]);
        }
    }
}

/// Steps of the longest history of a batch: those beyond are padding in every row.
fn longest<T>(history: &History<'_, T>, rows: usize) -> usize {
    assert_eq!(history.lengths.len(), rows);
    history.lengths.iter().copied().max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const ROWS: usize = 3;
    const STEPS: usize = 4;

    fn random(count: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
        (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
    }

    struct Case {
        net: RecurrentNet,
        parameters: Parameters<f64>,
        observation: Vec<f64>,
        action: Vec<f64>,
        history: Vec<f64>,
        weight_of_output: Vec<f64>,
    }

    const LENGTHS: [usize; ROWS] = [4, 0, 2];

    impl Case {
        fn new() -> Self {
            let mut rng = ChaCha8Rng::seed_from_u64(11);
            let shape = RecurrentShape {
                observation_len: 3,
                action_len: 2,
                hidden: 5,
                outputs: 2,
                output_activation: Activation::Tanh,
            };
            let net = RecurrentNet::new(shape);
            let parameters = Parameters::initialised(net.layout(), &mut rng);
            Self {
                net,
                parameters,
                observation: random(ROWS * 3, &mut rng),
                action: random(ROWS * 2, &mut rng),
                history: random(STEPS * ROWS * 3, &mut rng),
                weight_of_output: random(ROWS * 2, &mut rng),
            }
        }

        fn history(&self) -> History<'_, f64> {
            History { observations: &self.history, lengths: &LENGTHS }
        }

        fn forward(&self, compute: &mut Compute) -> RecurrentBuffers<f64> {
            let mut buffers = self.net.buffers(STEPS, ROWS);
            let Self { net, parameters, observation, action, .. } = self;
            net.forward(compute, parameters, observation, action, self.history(), &mut buffers);
            buffers
        }

        fn loss(&self, compute: &mut Compute) -> f64 {
            let buffers = self.forward(compute);
            buffers.output().iter().zip(&self.weight_of_output).map(|(y, w)| y * w).sum()
        }
    }

    #[test]
    fn weight_gradients_match_central_differences() {
        let mut case = Case::new();
        let compute = &mut Compute::new(1);
        let mut buffers = case.forward(compute);
        let mut gradients = Gradients::zeros(case.net.layout());
        buffers.d_output().copy_from_slice(&case.weight_of_output);
        case.net.backward(compute, &case.parameters, case.history(), &mut buffers, &mut gradients);
        let layout = Arc::clone(case.net.layout());
        for tensor in layout.tensors() {
            for position in tensor.positions() {
                let mut shifted = |by: f64| {
                    case.parameters.update(|values| values[position] += by);
                    let loss = case.loss(compute);
                    case.parameters.update(|values| values[position] -= by);
                    loss
                };
                let numeric = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
                let analytic = gradients.values()[position];
                assert!((numeric - analytic).abs() < 1e-8, "{}: {numeric} {analytic}", tensor.name());
            }
        }
    }

    #[test]
    fn action_gradients_match_central_differences() {
        let mut case = Case::new();
        let compute = &mut Compute::new(1);
        let mut buffers = case.forward(compute);
        buffers.d_output().copy_from_slice(&case.weight_of_output);
        let mut d_action = vec![0.0; ROWS * 2];
        case.net.backward_to_action(compute, &case.parameters, &mut buffers, &mut d_action);
        for (index, analytic) in d_action.into_iter().enumerate() {
            let mut shifted = |by: f64| {
                case.action[index] += by;
                let loss = case.loss(compute);
                case.action[index] -= by;
                loss
            };
            let numeric = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
            assert!((numeric - analytic).abs() < 1e-9, "{numeric} {analytic}");
        }
    }

    #[test]
    fn padding_after_the_valid_steps_changes_nothing() {
        let mut case = Case::new();
        let compute = &mut Compute::new(1);
        let before = case.forward(compute).output().to_vec();
        for (row, length) in LENGTHS.into_iter().enumerate() {
            for step in length..STEPS {
                case.history[(step * ROWS + row) * 3..][..3].fill(7.0);
            }
        }
        assert_eq!(case.forward(compute).output(), &before);
    }
}
