//! Vectors of three components: along the motion, across it, upwards.

pub type Vector = [f64; 3];

pub fn plus(a: &Vector, b: &Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn minus(a: &Vector, b: &Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn times(factor: f64, a: &Vector) -> Vector {
    [factor * a[0], factor * a[1], factor * a[2]]
}

/// `a` + `factor`·`b`.
pub fn plus_times(a: &Vector, factor: f64, b: &Vector) -> Vector {
    [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]]
}

pub fn dot(a: &Vector, b: &Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: &Vector, b: &Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn length(a: &Vector) -> f64 {
    dot(a, a).sqrt()
}

/// The part of `a` across the unit vector `normal`.
pub fn across(a: &Vector, normal: &Vector) -> Vector {
    plus_times(a, -dot(a, normal), normal)
}
