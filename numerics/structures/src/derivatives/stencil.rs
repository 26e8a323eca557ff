//! Derivatives of coefficients from their values at six values of a quantity.

use std::ops::{Add, Mul, Sub};

/// Distance of the values, relative to that of the quantity, as in [`super::Varied::AT`].
const STEP: f64 = 1e-3;

/// The derivative per relative change of a quantity of what is `at` [`super::Varied::AT`] times its value: the central difference of sixth order.
pub(super) fn relative<T>(at: [T; 6]) -> T
where
    for<'a> &'a T: Sub<&'a T, Output = T>,
    T: Mul<f64, Output = T> + Sub<Output = T> + Add<Output = T>,
{
    let [far_low, low, near_low, near, high, far] = &at;
    let (first, second, third) = (near - near_low, high - low, far - far_low);
    (first * 45.0 - second * 9.0 + third) * (1.0 / (60.0 * STEP))
}

/// Whether a number has a kink between these values of a quantity: differences over less of them give another derivative than [`relative`], by far
/// more than the third derivative of a smooth law allows (10⁻⁶ of it).
pub(super) fn has_kink(at: [f64; 6]) -> bool {
    const APART: f64 = 1e-5;
    let [far_low, low, near_low, near, high, far] = at;
    let all = relative(at);
    let over = [(near_low, near, 1.0), (low, high, 2.0), (far_low, far, 3.0)];
    over.into_iter()
        .any(|(below, above, steps)| ((above - below) / (2.0 * steps * STEP) - all).abs() > APART * steps * steps)
}
