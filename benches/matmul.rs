//! Our matrix products against the `matrixmultiply` crate, on the shapes of the networks: 32 rows.
//!
//! `cargo bench --bench matmul` prints one line per shape. A dense layer's forward pass includes
//! its bias; its weights are laid out for the product beforehand, which the crate has to do on every call.

mod support;

use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use searoom::nn::{Activation, Compute, Dense, Layout, Parameters};

fn main() {
    println!("machine: {:.1} GFLOP/s", support::machine_gflops(1));
    for (rows, inputs, outputs) in
        [(32, 256, 1024), (32, 1024, 256), (32, 128, 512), (32, 256, 128), (32, 64, 256), (1, 128, 512)]
    {
        let mut layout = Layout::new();
        let layer = Dense::new(&mut layout, "linear", inputs, outputs, Activation::Identity);
        let layout = Arc::new(layout);
        let parameters = Parameters::<f32>::initialised(&layout, &mut ChaCha8Rng::seed_from_u64(1));
        let weights = parameters.tensor("linear.weight").expect("the layer's weights");
        let input = vec![0.5f32; rows * inputs];
        let mut output = vec![0.0f32; rows * outputs];
        let mut compute = Compute::new(1);
        let operations = 2.0 * (rows * inputs * outputs) as f64;
        let ours = support::median_seconds(0.3, || {
            layer.forward(&mut compute, &parameters, &input, rows, &mut output);
        });
        let theirs = support::median_seconds(0.3, || {
            crate_product((rows, inputs, outputs), &input, &weights, &mut output);
        });
        println!(
            "{rows:>3} x {inputs:>4} x {outputs:>4}: searoom {:.1}, matrixmultiply {:.1} GFLOP/s, ratio {:.2}",
            operations / ours / 1e9,
            operations / theirs / 1e9,
            theirs / ours
        );
    }
}

/// `c[rows][outputs] = a[rows][inputs] w[outputs][inputs]^T`.
fn crate_product((rows, inputs, outputs): (usize, usize, usize), a: &[f32], w: &[f32], c: &mut [f32]) {
    assert!(a.len() >= rows * inputs && w.len() >= outputs * inputs && c.len() >= rows * outputs);
    let (inputs_stride, outputs_stride) = (inputs as isize, outputs as isize);
    // SAFETY: the slices hold what sizes and strides say.
    unsafe {
        matrixmultiply::sgemm(
            rows,
            inputs,
            outputs,
            1.0,
            a.as_ptr(),
            inputs_stride,
            1,
            w.as_ptr(),
            1,
            inputs_stride,
            0.0,
            c.as_mut_ptr(),
            outputs_stride,
            1,
        );
    }
}
