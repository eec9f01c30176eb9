//! Element-wise functions between layers, and their derivatives in terms of their own values.

use serde::{Deserialize, Serialize};

use super::Real;
use super::simd::Simd;

/// What a dense layer does to each of its outputs.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// `y = x`.
    #[default]
    Identity,
    /// `y = max(0, x)`; derivative 0 at 0.
    Relu,
    /// `y = x` above zero, `slope x` elsewhere, `0 < slope < 1`. PyTorch's default slope is 0.01.
    LeakyRelu {
        /// Derivative below zero.
        slope: f64,
    },
    /// `y = tanh(x)`.
    Tanh,
}

impl Activation {
    /// `y(x)`.
    #[inline(always)]
    pub(crate) fn apply<S: Simd>(self, simd: S, x: S::Vector) -> S::Vector {
        match self {
            Activation::Identity => x,
            Activation::Relu => simd.max(simd.splat(S::Scalar::ZERO), x),
            Activation::LeakyRelu { slope } => {
                simd.max(simd.mul(simd.splat(S::Scalar::from_f64(slope)), x), x)
            }
            Activation::Tanh => simd.tanh(x),
        }
    }

    /// Gradient with respect to `x`, from `y` and the gradient with respect to `y`.
    #[inline(always)]
    pub(crate) fn pull_back<S: Simd>(self, simd: S, y: S::Vector, gradient: S::Vector) -> S::Vector {
        let zero = simd.splat(S::Scalar::ZERO);
        match self {
            Activation::Identity => gradient,
            Activation::Relu => simd.if_positive(y, gradient, zero),
            Activation::LeakyRelu { slope } => {
                let below = simd.mul(gradient, simd.splat(S::Scalar::from_f64(slope)));
                simd.if_positive(y, gradient, below)
            }
            Activation::Tanh => {
                let derivative = simd.sub(simd.splat(S::Scalar::ONE), simd.mul(y, y));
                simd.mul(gradient, derivative)
            }
        }
    }
}
