use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::nn::Isa;
use crate::nn::testing::{check_inputs, check_weights, random, weighted_sum};

struct Case {
    layer: Lstm,
    steps: usize,
    rows: usize,
    lengths: Option<Vec<usize>>,
}

impl Case {
    fn new(inputs: usize, hidden: usize, steps: usize, rows: usize) -> (Self, Arc<Layout>) {
        let mut layout = Layout::new();
        let layer = Lstm::new(&mut layout, "lstm", inputs, hidden);
        (Self { layer, steps, rows, lengths: None }, Arc::new(layout))
    }

    fn last<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        input: &[T],
        state: &mut LstmState<T>,
    ) -> Vec<T> {
        let lengths = self.lengths.as_deref();
        self.layer.forward(compute, parameters, input, self.steps, self.rows, lengths, state);
        let mut last = vec![T::from_f64(f64::NAN); self.rows * self.layer.hidden];
        state.read_last(lengths, &mut last, self.layer.hidden);
        last
    }

    /// Last states, gradients of inputs and of weights, for `sum d_last last`.
    fn everything<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        input: &[T],
        d_last: &[T],
    ) -> (Vec<T>, Vec<T>, Gradients<T>) {
        let mut state = self.layer.state(self.steps, self.rows);
        let last = self.last(compute, parameters, input, &mut state);
        let mut d_input = vec![T::from_f64(f64::NAN); input.len()];
        let mut gradients = Gradients::zeros(parameters.layout());
        self.layer.backward(
            compute,
            parameters,
            input,
            self.lengths.as_deref(),
            &mut state,
            (d_last, self.layer.hidden),
            Some(&mut d_input),
            Some(&mut gradients),
        );
        (last, d_input, gradients)
    }
}

#[test]
fn gradients_are_central_differences() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for (inputs, hidden, steps, rows) in [(1, 1, 1, 1), (2, 5, 4, 3), (3, 33, 3, 2), (34, 4, 2, 9)] {
        let (mut case, layout) = Case::new(inputs, hidden, steps, rows);
        let parameters = Parameters::initialised(&layout, &mut rng);
        for ragged in [false, true] {
            case.lengths = ragged.then(|| (0..rows).map(|row| row * 2 % (steps + 1)).collect());
            let input = random(&mut rng, steps * rows * inputs);
            let d_last: Vec<f64> = random(&mut rng, rows * hidden);
            let mut compute = Compute::new(1);
            let (_, d_input, gradients) = case.everything(&mut compute, &parameters, &input, &d_last);
            let mut state = case.layer.state(steps, rows);
            check_inputs(&input, &d_input, |input| {
                weighted_sum(&d_last, &case.last(&mut compute, &parameters, input, &mut state))
            });
            check_weights(&parameters, &gradients, |parameters| {
                weighted_sum(&d_last, &case.last(&mut compute, parameters, &input, &mut state))
            });
        }
    }
}

#[test]
fn one_step_of_one_unit_is_the_textbook_formula() {
    let (case, layout) = Case::new(1, 1, 2, 1);
    let mut parameters = Parameters::zeros(&layout, false);
    let (weight_x, weight_h) = ([0.1, 0.2, 0.3, 0.4], [0.5, 0.6, 0.7, 0.8]);
    let (bias_x, bias_h) = ([0.01, 0.02, 0.03, 0.04], [0.05, 0.06, 0.07, 0.08]);
    parameters.update(|values| {
        for (tensor, elements) in layout.tensors().iter().zip([weight_x, weight_h, bias_x, bias_h]) {
            layout.scatter(tensor, &elements, values);
        }
    });
    let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
    let (mut h, mut c) = (0.0, 0.0);
    for x in [1.5, -0.5] {
        let sum = |k: usize| weight_x[k] * x + weight_h[k] * h + bias_x[k] + bias_h[k];
        c = sigmoid(sum(1)) * c + sigmoid(sum(0)) * sum(2).tanh();
        h = sigmoid(sum(3)) * c.tanh();
    }
    let mut state = case.layer.state(2, 1);
    let last = case.last(&mut Compute::new(1), &parameters, &[1.5, -0.5], &mut state);
    assert!((last[0] - h).abs() < 1e-15);
    assert_eq!(state.hidden(1, 0).collect::<Vec<_>>(), last);
}

#[test]
fn what_follows_a_history_and_who_shares_its_batch_do_not_matter() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let (mut case, layout) = Case::new(3, 40, 5, 4);
    let parameters = Parameters::<f32>::initialised(&layout, &mut rng);
    case.lengths = Some(vec![2, 0, 5, 3]);
    let input: Vec<f32> = random(&mut rng, 5 * 4 * 3);
    let mut compute = Compute::new(1);
    let last = case.last(&mut compute, &parameters, &input, &mut case.layer.state(5, 4));
    assert!(last[40..80].iter().all(|&h| h == 0.0), "an empty history leaves zero memory");

    for (row, &length) in [2, 0, 5, 3].iter().enumerate() {
        let (alone, _) = Case::new(3, 40, length, 1);
        let own: Vec<f32> = (0..length)
            .flat_map(|step| input[(step * 4 + row) * 3..(step * 4 + row) * 3 + 3].iter().copied())
            .collect();
        let expected = alone.last(&mut compute, &parameters, &own, &mut alone.layer.state(length, 1));
        assert_eq!(last[row * 40..row * 40 + 40], expected);
    }
}

#[test]
fn instruction_sets_agree_and_threads_do_not_change_a_bit() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for (inputs, hidden, steps, rows) in [(2, 64, 9, 32), (20, 40, 4, 21)] {
        let (mut case, layout) = Case::new(inputs, hidden, steps, rows);
        let parameters = Parameters::<f32>::initialised(&layout, &mut rng);
        let input: Vec<f32> = random(&mut rng, steps * rows * inputs);
        let d_last: Vec<f32> = random(&mut rng, rows * hidden);
        for ragged in [false, true] {
            case.lengths = ragged.then(|| (0..rows).map(|row| row % (steps + 1)).collect());
            let everything = |isa, threads| {
                let mut compute = Compute::with_isa(isa, threads).unwrap();
                let (last, d_input, gradients) = case.everything(&mut compute, &parameters, &input, &d_last);
                [&last, &d_input, gradients.values()].concat()
            };
            let expected = everything(Isa::Portable, 1);
            for isa in Isa::available() {
                let one = everything(isa, 1);
                for (a, b) in one.iter().zip(&expected) {
                    assert!((a - b).abs() <= 2e-5, "{isa:?}: {a} against {b}");
                }
                for threads in [2, 3] {
                    assert_eq!(everything(isa, threads), one, "{isa:?} on {threads} threads");
                }
            }
        }
    }
}
