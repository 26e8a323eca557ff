//! Natural motions of coordinates η: motions `z′ = λ z` of which the coordinates are sums.

use nalgebra::{DMatrix, DVector};

use crate::Refused;
use crate::circuits::Circuits;
use crate::linear::C64;
use crate::sum::Sum;

/// Largest relative coupling by damping that counts as rounding.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Largest loss of digits by the coordinates of the natural motions: ten digits are left.
const MAX_CONDITION: f64 = 1e5;

/// Largest growth of a natural motion, relative to the fastest rate, that counts as rounding.
const GROWTH: f64 = 1e-12;

/// Imaginary part of a rate, relative to the fastest one, up to which it is real.
const REAL: f64 = 1e-12;

/// The natural motions, and among them the excitation, by the magnitude of their rates.
#[derive(Clone, Debug)]
pub(crate) struct NaturalMotions {
    /// λ of each natural motion, 1/s, and iΩ of the excitation.
    pub rates: Vec<C64>,
    /// Which of them is the excitation.
    pub wave: usize,
    kind: Kind,
}

/// How natural motions and coordinates follow from each other.
#[derive(Clone, Debug)]
enum Kind {
    /// Every natural motion is part of one coordinate; `None`: the excitation.
    Uncoupled(Vec<Option<Part>>),
    /// η = Re(right · z); z = left · η + left_rate · η′.
    Coupled { right: DMatrix<C64>, left: DMatrix<Share>, left_rate: DMatrix<Share> },
}

/// A natural motion `z = of · η + of_rate · η′` of one coordinate, which contains Re z.
#[derive(Clone, Copy, Debug)]
struct Part {
    coordinate: usize,
    of: Share,
    of_rate: Share,
}

/// What a natural motion takes of a coordinate or its rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Share {
    share: C64,
    size: f64,
}

impl From<C64> for Share {
    fn from(share: C64) -> Self {
        Self { share, size: share.norm() }
    }
}

impl NaturalMotions {
    /// Solves `η″ + C η′ + ω² η + Hᵀ τ = 0` with `τ′ + Γ τ = H η′` of the circuits; `square` is ω², `turning` Ω of the excitation, rad/s. The coordinates τ
    /// come after η.
    pub fn new(square: &[f64], damping: &DMatrix<f64>, circuits: &Circuits, turning: f64) -> Result<Self, Refused> {
        if square.iter().any(|square| *square <= 0.0) {
            return Err(Refused::Unsupported);
        }
        let (mut rates, mut kind) = if is_diagonal(damping) && circuits.are_alone() {
            uncoupled(square, damping.diagonal().as_slice(), circuits)?
        } else {
            coupled(square, damping, circuits)?
        };
        let wave = rates.iter().filter(|rate| rate.norm() <= turning).count();
        rates.insert(wave, C64::new(0.0, turning));
        match &mut kind {
            Kind::Uncoupled(parts) => parts.insert(wave, None),
            Kind::Coupled { right, left, left_rate } => {
                *right = right.clone().insert_column(wave, C64::ZERO);
                *left = left.clone().insert_row(wave, Share::default());
                *left_rate = left_rate.clone().insert_row(wave, Share::default());
            }
        }
        Ok(Self { rates, wave, kind })
    }

    /// z of coordinates and their rates, which `of` gives by number, with the excitation `wave`; and the rounding of each z.
    pub fn enter(
        &self,
        count: usize,
        of: impl Fn(usize) -> (Sum, Sum),
        wave: C64,
        (z, roundings): (&mut Vec<C64>, &mut Vec<f64>),
    ) {
        z.clear();
        z.resize(self.rates.len(), C64::ZERO);
        roundings.clear();
        roundings.resize(self.rates.len(), 0.0);
        let mut add = |n: usize, (of, eta): (Share, Sum), (of_rate, rate): (Share, Sum)| {
            z[n] += of.share * eta.value() + of_rate.share * rate.value();
            roundings[n] += f64::EPSILON * (of.size * eta.size + of_rate.size * rate.size);
        };
        match &self.kind {
            Kind::Uncoupled(parts) => {
                for (n, part) in parts.iter().enumerate() {
                    if let Some(Part { coordinate, of: share, of_rate }) = *part {
                        let (eta, rate) = of(coordinate);
                        add(n, (share, eta), (of_rate, rate));
                    }
                }
            }
            Kind::Coupled { left, left_rate, .. } => {
                for i in 0..count {
                    let (eta, rate) = of(i);
                    for n in 0..self.rates.len() {
                        add(n, (left[(n, i)], eta), (left_rate[(n, i)], rate));
                    }
                }
            }
        }
        z[self.wave] = wave;
        roundings[self.wave] = f64::EPSILON * wave.norm_sqr().sqrt();
    }

    /// Adds the natural motions to the coordinates and their rates.
    pub fn leave(&self, z: &[C64], eta: &mut [f64], rate: &mut [f64]) {
        match &self.kind {
            Kind::Uncoupled(parts) => {
                for (part, (z, faster)) in parts.iter().zip(z.iter().zip(&self.rates)) {
                    if let Some(Part { coordinate, .. }) = *part {
                        eta[coordinate] += z.re;
                        rate[coordinate] += (faster * z).re;
                    }
                }
            }
            Kind::Coupled { right, .. } => {
                for (column, (z, faster)) in right.column_iter().zip(z.iter().zip(&self.rates)) {
                    let faster = faster * z;
                    for (i, right) in column.iter().enumerate() {
                        eta[i] += (right * z).re;
                        rate[i] += (right * faster).re;
                    }
                }
            }
        }
    }

    /// z′ by a load on the coordinates, of which those of circuits have none.
    pub fn loaded(&self, load: &[f64]) -> Vec<C64> {
        match &self.kind {
            Kind::Uncoupled(parts) => {
                let of = |part: &Part| part.of_rate.share * load[part.coordinate];
                parts.iter().map(|part| part.as_ref().map_or(C64::ZERO, of)).collect()
            }
            Kind::Coupled { left_rate, .. } => {
                left_rate.row_iter().map(|row| row.iter().zip(load).map(|(of, load)| of.share * *load).sum()).collect()
            }
        }
    }

    /// Adds what the natural motions are of the coordinates.
    pub fn add(&self, z: impl Fn(usize) -> C64, eta: &mut [f64]) {
        match &self.kind {
            Kind::Uncoupled(parts) => {
                for (n, part) in parts.iter().enumerate() {
                    if let Some(Part { coordinate, .. }) = *part {
                        eta[coordinate] += z(n).re;
                    }
                }
            }
            Kind::Coupled { right, .. } => {
                for (n, column) in right.column_iter().enumerate() {
                    let z = z(n);
                    eta.iter_mut().zip(column.iter()).for_each(|(eta, right)| *eta += (right * z).re);
                }
            }
        }
    }

    /// Coefficients of the natural motions in `on · η`; 0 for the excitation.
    pub fn coefficients(&self, on: &[f64]) -> Vec<C64> {
        match &self.kind {
            Kind::Uncoupled(parts) => {
                parts.iter().map(|part| part.map_or(C64::ZERO, |part| C64::from(on[part.coordinate]))).collect()
            }
            Kind::Coupled { right, .. } => {
                right.column_iter().map(|column| column.iter().zip(on).map(|(right, on)| right * *on).sum()).collect()
            }
        }
    }
}

/// Whether a damping matrix couples no coordinates, to within rounding.
fn is_diagonal(damping: &DMatrix<f64>) -> bool {
    let largest = damping.diagonal().amax();
    (0..damping.nrows()).all(|i| (0..i).all(|j| damping[(i, j)].abs() <= ROUNDING * largest))
}

/// The natural motions of uncoupled coordinates, by the magnitude of their rates.
fn uncoupled(square: &[f64], damping: &[f64], circuits: &Circuits) -> Result<(Vec<C64>, Kind), Refused> {
    let mut list = Vec::new();
    for (i, (&square, &damping)) in square.iter().zip(damping).enumerate() {
        let decay = -0.5 * damping;
        let left = square - decay * decay;
        if left.abs() <= 1e-10 * square {
            return Err(Refused::Critical);
        } else if left > 0.0 {
            let turning = left.sqrt();
            let (of, of_rate) = (C64::new(1.0, decay / turning).into(), C64::new(0.0, -1.0 / turning).into());
            list.push((C64::new(decay, turning), Some(Part { coordinate: i, of, of_rate })));
        } else {
            let split = (-left).sqrt();
            // The slow rate from the product of both, without cancellation.
            let fast = decay - split;
            let slow = square / fast;
            for (rate, other) in [(fast, slow), (slow, fast)] {
                let of_rate = C64::from(1.0 / (rate - other));
                let part = Part { coordinate: i, of: (-other * of_rate).into(), of_rate: of_rate.into() };
                list.push((C64::from(rate), Some(part)));
            }
        }
    }
    for (i, decay) in (square.len()..).zip(&circuits.decay) {
        let part = Part { coordinate: i, of: C64::ONE.into(), of_rate: Share::default() };
        list.push((C64::from(-decay), Some(part)));
    }
    list.sort_by(|a, b| a.0.norm().total_cmp(&b.0.norm()));
    let (rates, motions) = list.into_iter().unzip();
    Ok((rates, Kind::Uncoupled(motions)))
}

/// The natural motions of coordinates with ω² = `square` that the damping couples: eigenvalues and eigenvectors of
/// `(ωη, η′, τ)′ = [0 ω 0; −ω −C −Hᵀ; 0 H −Γ] (ωη, η′, τ)`, which is normal but for C and Γ.
fn coupled(square: &[f64], damping: &DMatrix<f64>, circuits: &Circuits) -> Result<(Vec<C64>, Kind), Refused> {
    let (n, more) = (square.len(), circuits.len());
    let omega: Vec<f64> = square.iter().map(|square| square.sqrt()).collect();
    let mut matrix = DMatrix::from_fn(2 * n + more, 2 * n + more, |i, j| {
        C64::from(match (i < n, j < n) {
            (true, false) if i == j - n => omega[i],
            (false, true) if i - n == j => -omega[j],
            (false, false) if i < 2 * n && j < 2 * n => -damping[(i - n, j - n)],
            _ => 0.0,
        })
    });
    for (k, decay) in circuits.decay.iter().enumerate() {
        let own = 2 * n + k;
        for (i, feed) in circuits.feed.row(k).iter().enumerate() {
            (matrix[(own, n + i)], matrix[(n + i, own)]) = (C64::from(*feed), C64::from(-feed));
        }
        matrix[(own, own)] = C64::from(-decay);
    }
    let (unitary, triangle) = matrix.schur().unpack();
    let vectors = unitary * eigenvectors(&triangle);
    let inverse = vectors.clone().try_inverse().ok_or(Refused::Critical)?;
    if vectors.norm() * inverse.norm() > MAX_CONDITION * (n + more) as f64 {
        return Err(Refused::Critical);
    }
    let size = triangle.diagonal().iter().fold(0.0, |most: f64, rate| most.max(rate.norm()));
    let mut kept: Vec<(usize, C64, f64)> = triangle
        .diagonal()
        .iter()
        .enumerate()
        .filter(|(_, rate)| rate.im > -REAL * size)
        .map(|(j, rate)| if rate.im > REAL * size { (j, *rate, 2.0) } else { (j, C64::from(rate.re), 1.0) })
        .collect();
    if kept.iter().any(|(_, rate, _)| rate.re > GROWTH * size) {
        return Err(Refused::NegativeDamping);
    }
    kept.sort_by(|a, b| a.1.norm().total_cmp(&b.1.norm()));
    let count = kept.len();
    Ok((
        // A growth within rounding is none.
        kept.iter().map(|(_, rate, _)| C64::new(rate.re.min(0.0), rate.im)).collect(),
        Kind::Coupled {
            right: DMatrix::from_fn(n + more, count, |i, j| {
                if i < n {
                    vectors[(i, kept[j].0)] * (kept[j].2 / omega[i])
                } else {
                    vectors[(n + i, kept[j].0)] * kept[j].2
                }
            }),
            left: DMatrix::from_fn(count, n + more, |j, i| {
                if i < n { inverse[(kept[j].0, i)] * omega[i] } else { inverse[(kept[j].0, n + i)] }.into()
            }),
            left_rate: DMatrix::from_fn(count, n + more, |j, i| {
                if i < n { inverse[(kept[j].0, n + i)].into() } else { Share::default() }
            }),
        },
    ))
}

/// The eigenvectors of an upper triangular matrix, as columns of length 1.
fn eigenvectors(triangle: &DMatrix<C64>) -> DMatrix<C64> {
    let n = triangle.nrows();
    let least = f64::EPSILON * triangle.norm();
    let mut vectors = DMatrix::from_element(n, n, C64::ZERO);
    for k in 0..n {
        let mut vector = DVector::from_element(n, C64::ZERO);
        vector[k] = C64::ONE;
        for i in (0..k).rev() {
            let sum: C64 = (i + 1..=k).map(|j| triangle[(i, j)] * vector[j]).sum();
            let mut gap = triangle[(k, k)] - triangle[(i, i)];
            if gap.norm() < least {
                gap = C64::from(least);
            }
            vector[i] = sum / gap;
        }
        let norm = vector.norm();
        vectors.set_column(k, &(vector / C64::from(norm)));
    }
    vectors
}
