//! Fits all flights of a film together: parabolas of one acceleration.
//!
//! The height h of the ball is a parabola over time in each flight, with the same acceleration in all. The film shows u = h/(1 − p·h): p is the
//! perspective along the vertical, 0 for a camera that looks level. A ball that also moves towards the camera, and drag, make the acceleration
//! of a flight a line over time: a cubic. A ball that has come nearer since the last flight has another scale: an acceleration of its own in each
//! flight. These are fitted only where they explain what is no noise. The parameters of each
//! flight are eliminated first, so that the work grows with the number of frames alone.

use nalgebra::{DMatrix, DVector};

/// A flight: frame times in steps, and places on the axis towards the floor, from the floor.
#[derive(Clone, Debug, Default)]
pub(super) struct FlightFrames {
    pub(super) at: Vec<f64>,
    pub(super) down: Vec<f64>,
}

/// What is fitted besides the parabolas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct FilmShape {
    pub(super) perspective: bool,
    pub(super) cubic: bool,
    /// Each flight has its own acceleration.
    pub(super) accelerations: bool,
}

impl FilmShape {
    /// Parameters of a flight.
    pub(super) fn own(self) -> usize {
        2 + usize::from(self.accelerations) + usize::from(self.cubic)
    }

    /// Parameters of all flights together.
    pub(super) fn shared(self) -> usize {
        usize::from(!self.accelerations) + usize::from(self.perspective)
    }

    /// Powers of the scaled time of a flight's own parameters.
    fn powers(self) -> impl Iterator<Item = i32> {
        [Some(0), Some(1), self.accelerations.then_some(2), self.cubic.then_some(3)].into_iter().flatten()
    }
}

/// Middle and half length of a flight, the unit of its own parameters.
#[derive(Clone, Copy, Debug)]
struct FlightSpan {
    middle: f64,
    half: f64,
}

impl FlightSpan {
    fn of(at: &[f64]) -> Self {
        let (first, last) = (at[0], at[at.len() - 1]);
        Self { middle: 0.5 * (first + last), half: (0.5 * (last - first)).max(0.5) }
    }
}

/// The parameters of a flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flight {
    span: FlightSpan,
    /// Of the powers of the scaled time.
    powers: [f64; 4],
    perspective: f64,
}

impl Flight {
    /// Height (towards the floor) at a time.
    pub(super) fn height(&self, at: f64) -> f64 {
        let s = (at - self.span.middle) / self.span.half;
        self.powers.iter().rev().fold(0.0, |sum, coefficient| sum * s + coefficient)
    }

    /// Velocity towards the floor, per step.
    pub(super) fn velocity(&self, at: f64) -> f64 {
        let s = (at - self.span.middle) / self.span.half;
        let [_, one, two, three] = self.powers;
        (one + 2.0 * two * s + 3.0 * three * s * s) / self.span.half
    }

    /// Acceleration in the middle, per step².
    pub(super) fn acceleration(&self) -> f64 {
        2.0 * self.powers[2] / self.span.half.powi(2)
    }

    /// Height of a place on the film.
    pub(super) fn of_film(&self, down: f64) -> f64 {
        down / (1.0 + self.perspective * down)
    }

    /// Distance on the film of a reading from the fit.
    pub(super) fn left(&self, at: f64, down: f64) -> f64 {
        let stretch = (1.0 + self.perspective * down).powi(2);
        (self.of_film(down) - self.height(at)) * stretch
    }
}

/// The fit.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) shape: FilmShape,
    spans: Vec<FlightSpan>,
    /// Those of each flight in turn, then those that all share: acceleration, perspective; see [`FilmShape`].
    pub(super) parameters: DVector<f64>,
    /// Covariance of the parameters for unit noise.
    pub(super) covariance: DMatrix<f64>,
    /// What is left, on the film, flight after flight.
    pub(super) left: Vec<f64>,
    /// Frames less parameters.
    pub(super) degrees_of_freedom: f64,
}

/// Steps at most; only the perspective makes the fit curved.
const STEPS: usize = 20;

impl Fit {
    /// Fits; `None` for too few frames, or a perspective that does not settle.
    pub(super) fn of(flights: &[FlightFrames], shape: FilmShape) -> Option<Self> {
        let spans: Vec<FlightSpan> = flights.iter().map(|flight| FlightSpan::of(&flight.at)).collect();
        let frames: usize = flights.iter().map(|flight| flight.at.len()).sum();
        let (own, shared) = (shape.own(), shape.shared());
        let count = own * flights.len() + shared;
        let is_short = flights.iter().any(|flight| flight.at.len() < own + 1);
        if frames <= count || is_short {
            return None;
        }
        let mut perspective = 0.0;
        for _ in 0..STEPS {
            let step = FitStep::of(flights, &spans, shape, perspective)?;
            let next = if shape.perspective { perspective + step.parameters[count - 1] } else { 0.0 };
            let is_settled = (next - perspective).abs() <= 1e-9 * next.abs().max(1e-9);
            // Beyond 1/p the film shows nothing.
            let is_inside = |down: &f64| 1.0 + next * down > 0.1;
            if !flights.iter().flat_map(|flight| &flight.down).all(is_inside) {
                return None;
            }
            perspective = next;
            if is_settled {
                let mut parameters = step.parameters;
                if shape.perspective {
                    parameters[count - 1] = perspective;
                }
                let degrees_of_freedom = (frames - count) as f64;
                let mut fit = Self {
                    shape,
                    spans,
                    parameters,
                    covariance: step.covariance,
                    left: Vec::new(),
                    degrees_of_freedom,
                };
                let left = |(n, flight): (usize, &FlightFrames)| -> Vec<f64> {
                    let own = fit.flight(n, &fit.parameters);
                    flight.at.iter().zip(&flight.down).map(|(at, down)| own.left(*at, *down)).collect()
                };
                fit.left = flights.iter().enumerate().flat_map(left).collect();
                return Some(fit);
            }
        }
        None
    }

    /// A flight with these parameters of all.
    pub(super) fn flight(&self, n: usize, parameters: &DVector<f64>) -> Flight {
        let (own, span) = (self.shape.own(), self.spans[n]);
        let mut powers = [0.0; 4];
        for (place, power) in self.shape.powers().enumerate() {
            powers[power as usize] = parameters[own * n + place];
        }
        if !self.shape.accelerations {
            powers[2] = 0.5 * parameters[own * self.spans.len()] * span.half.powi(2);
        }
        Flight { span, powers, perspective: self.perspective(parameters) }
    }

    /// The perspective, per unit of the film.
    pub(super) fn perspective(&self, parameters: &DVector<f64>) -> f64 {
        if self.shape.perspective { parameters[parameters.len() - 1] } else { 0.0 }
    }

    /// Derivative of a function of the parameters by one of them, for readings of this variance.
    pub(super) fn slope(&self, place: usize, variance: f64, of: impl Fn(&DVector<f64>) -> f64) -> f64 {
        let step = 1e-2 * (variance * self.covariance[(place, place)]).sqrt();
        let step = step.max(1e-9 * self.parameters[place].abs()).max(1e-15);
        let at = |sign: f64| {
            let mut moved = self.parameters.clone();
            moved[place] += sign * step;
            of(&moved)
        };
        (at(1.0) - at(-1.0)) / (2.0 * step)
    }

    /// Sum of the squares of what is left.
    pub(super) fn squares(&self) -> f64 {
        self.left.iter().map(|left| left * left).sum()
    }

    /// Variance of a reading.
    pub(super) fn variance(&self) -> f64 {
        self.squares() / self.degrees_of_freedom
    }

    /// Places of the parameters that act on two neighbouring flights: their own, and the shared ones.
    pub(super) fn places(&self, pair: usize) -> impl Iterator<Item = usize> {
        let own = self.shape.own();
        (own * pair..own * (pair + 2)).chain(own * self.spans.len()..self.parameters.len())
    }
}

/// A step of the fit: the parameters (the last one is a change of the perspective), and their covariance for unit noise.
struct FitStep {
    parameters: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// What is eliminated of a flight: (AᵀA)⁻¹, its parameters without the shared ones, and how these move them.
struct Eliminated {
    inverse: DMatrix<f64>,
    alone: DVector<f64>,
    by_shared: DMatrix<f64>,
}

impl FitStep {
    fn of(flights: &[FlightFrames], spans: &[FlightSpan], shape: FilmShape, perspective: f64) -> Option<Self> {
        let (own, shared) = (shape.own(), shape.shared());
        let (mut normal, mut right) = (DMatrix::zeros(shared, shared), DVector::zeros(shared));
        let mut eliminated = Vec::with_capacity(flights.len());
        for (flight, span) in flights.iter().zip(spans) {
            let n = flight.at.len();
            let (mut a, mut b) = (DMatrix::zeros(n, own), DMatrix::zeros(n, shared));
            let mut y = DVector::zeros(n);
            for (row, (at, down)) in flight.at.iter().zip(&flight.down).enumerate() {
                let one = 1.0 + perspective * down;
                // A distance on the film is this many times one of the height.
                let stretch = one * one;
                let s = (at - span.middle) / span.half;
                for (column, power) in shape.powers().enumerate() {
                    a[(row, column)] = s.powi(power) * stretch;
                }
                let acceleration = (!shape.accelerations).then(|| 0.5 * (at - span.middle).powi(2));
                let perspective = shape.perspective.then(|| (down / one).powi(2));
                for (column, value) in acceleration.into_iter().chain(perspective).enumerate() {
                    b[(row, column)] = value * stretch;
                }
                y[row] = down / one * stretch;
            }
            let inverse = (a.transpose() * &a).cholesky()?.inverse();
            let onto = &inverse * a.transpose();
            let (by_shared, alone) = (&onto * &b, &onto * &y);
            let (b_left, y_left) = (&b - &a * &by_shared, &y - &a * &alone);
            normal += b_left.transpose() * &b_left;
            right += b_left.transpose() * &y_left;
            eliminated.push(Eliminated { inverse, alone, by_shared });
        }
        let of_shared = scaled_inverse(&normal)?;
        let values = &of_shared * right;
        let (count, from) = (own * flights.len() + shared, own * flights.len());
        let mut parameters = DVector::zeros(count);
        let mut covariance = DMatrix::zeros(count, count);
        parameters.rows_mut(from, shared).copy_from(&values);
        covariance.view_mut((from, from), (shared, shared)).copy_from(&of_shared);
        for (n, one) in eliminated.iter().enumerate() {
            parameters.rows_mut(own * n, own).copy_from(&(&one.alone - &one.by_shared * &values));
            let with_shared = -(&one.by_shared * &of_shared);
            covariance.view_mut((own * n, from), (own, shared)).copy_from(&with_shared);
            covariance.view_mut((from, own * n), (shared, own)).copy_from(&with_shared.transpose());
            for (m, other) in eliminated.iter().enumerate() {
                let mut block = -(&with_shared * other.by_shared.transpose());
                if m == n {
                    block += &one.inverse;
                }
                covariance.view_mut((own * n, own * m), (own, own)).copy_from(&block);
            }
        }
        Some(Self { parameters, covariance })
    }
}

/// The inverse of a symmetric matrix whose rows have different units.
fn scaled_inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = matrix.nrows();
    if n == 0 {
        return Some(matrix.clone());
    }
    let scale: Vec<f64> = (0..n).map(|i| matrix[(i, i)].sqrt()).collect();
    if scale.iter().any(|scale| *scale <= 0.0 || !scale.is_finite()) {
        return None;
    }
    let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] / (scale[i] * scale[j]));
    let inverse = scaled.cholesky()?.inverse();
    Some(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] / (scale[i] * scale[j])))
}
