//! Coefficients of a point for the lanes: motions over a step for unit values at its start, and bounds from them.

use damprig_core::integrator::exact::series::{Series, TERMS};
use damprig_core::integrator::exact::unit_motions::{UnitMotions, mean_product};
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::Wall;
use pulp::Simd;

use crate::point::Point;
use crate::vector::Vector;

/// Most steps per cycle: the excitation at each is kept, and rotated from each to the next, which adds a rounding a step.
const MOST_STEPS: f64 = 128.0;

/// A point made ready for a lane.
pub(crate) struct Prepared {
    pub motion: Exact,
    pub step_s: f64,
    pub angle_rad: f64,
    columns: [Series; 4],
    /// Sine and cosine of the excitation at the start of each step of a cycle, times its amplitude.
    pub wave: Vec<[f64; 2]>,
    amplitude: f64,
    clearance_m: f64,
    restitution: f64,
    /// Change of the structure's velocity per approach velocity.
    kick: f64,
}

impl Prepared {
    /// `None` for a point that lanes cannot compute: they know one particle without friction between hard walls, on a
    /// structure without other dampers, under a sine.
    pub fn new(point: &Point, motion: &Exact) -> Option<Self> {
        let particle = point.set_up.particle?;
        let Wall::Restitution { coefficient } = particle.wall else { return None };
        let friction = particle.friction_coefficient * point.set_up.gravity_m_per_s2 != 0.0
            || point.set_up.friction_damper.is_some_and(|damper| damper.force_n != 0.0);
        let (amplitude, phase) = match point.excitation {
            Excitation::Sine { amplitude_m, phase_rad, .. } => (amplitude_m, phase_rad),
            Excitation::ForceSine { amplitude_n, phase_rad, .. } => (amplitude_n, phase_rad),
            _ => return None,
        };
        if friction {
            return None;
        }
        let (steps, units) = UnitMotions::dividing(&point.set_up, &point.excitation, point.cycle_s());
        if steps > MOST_STEPS {
            return None;
        }
        let wave = (0..steps as usize).map(|n| {
            let (sine, cosine) = libm::sincos(phase + std::f64::consts::TAU * (n as f64 / steps));
            [amplitude * sine, amplitude * cosine]
        });
        Some(Self {
            motion: motion.clone(),
            step_s: units.step_s,
            angle_rad: units.angle_rad,
            columns: units.columns,
            wave: wave.collect(),
            amplitude,
            clearance_m: particle.clearance_m,
            restitution: coefficient,
            kick: (1.0 + coefficient) * particle.mass_kg / (point.set_up.structure.mass_kg + particle.mass_kg),
        })
    }
}

/// The coefficients of the points in all lanes. Time counts in steps; the four unit values are displacement, velocity,
/// sine and cosine.
pub(crate) struct Table<S: Simd> {
    /// Series of the displacement.
    pub columns: [[Vector<S>; TERMS]; 4],
    /// Displacement and velocity at the end less those at the start.
    pub shift: [Vector<S>; 4],
    pub gain: [Vector<S>; 4],
    /// Acceleration.
    pub bent: [Vector<S>; 4],
    /// Largest distance of a velocity from its chord: per displacement and velocity, and of the excitation at any phase.
    pub sag: [Vector<S>; 3],
    /// Bound of the fourth derivative, likewise.
    pub fourth: [Vector<S>; 3],
    /// Mean over the step of the products of two unit motions, for pairs in the order 00 01 02 03 11 12 13 22 23 33;
    /// those of different ones are doubled.
    pub means: [Vector<S>; 10],
    /// Sine and cosine of the excitation at the start of a cycle, times its amplitude.
    pub wave: [Vector<S>; 2],
    /// Cosine less one, and sine, of the excitation's angle over a step; the angle, rad.
    pub turn: [Vector<S>; 2],
    pub angle: Vector<S>,
    pub clearance: Vector<S>,
    pub restitution: Vector<S>,
    pub kick: Vector<S>,
    /// Steps per cycle.
    pub steps: Vector<S>,
}

impl<S: Simd> Table<S> {
    #[inline(always)]
    pub fn new(simd: S) -> Self {
        let zero = Vector::splat(simd, 0.0);
        Self {
            columns: [[zero; TERMS]; 4],
            shift: [zero; 4],
            gain: [zero; 4],
            bent: [zero; 4],
            sag: [zero; 3],
            fourth: [zero; 3],
            means: [zero; 10],
            wave: [zero; 2],
            turn: [zero; 2],
            angle: zero,
            clearance: zero,
            restitution: zero,
            kick: zero,
            steps: zero,
        }
    }

    /// Puts a point into `lane`.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, point: &Prepared) {
        let sum = |c: &Series, weight: fn(f64) -> f64, first: usize| -> f64 {
            (first..TERMS).rev().map(|n| c[n] * weight(n as f64)).sum()
        };
        let bound = |c: &Series, weight: fn(f64) -> f64| -> f64 {
            (0..TERMS).rev().map(|n| c[n].abs() * weight(n as f64)).sum()
        };
        let thirds = point.columns.each_ref().map(|c| bound(c, |n| n * (n - 1.0) * (n - 2.0)) * 0.125);
        let fourths = point.columns.each_ref().map(|c| bound(c, |n| n * (n - 1.0) * (n - 2.0) * (n - 3.0)));
        for (which, column) in point.columns.iter().enumerate() {
            for (n, coefficient) in column.iter().enumerate() {
                self.columns[which][n].lanes_mut()[lane] = *coefficient;
            }
            self.shift[which].lanes_mut()[lane] = sum(column, |_| 1.0, 1);
            self.gain[which].lanes_mut()[lane] = sum(column, |n| n, 2);
            self.bent[which].lanes_mut()[lane] = 2.0 * column[2];
        }
        for (row, bounds) in [(&mut self.sag, thirds), (&mut self.fourth, fourths)] {
            row[0].lanes_mut()[lane] = bounds[0];
            row[1].lanes_mut()[lane] = bounds[1];
            row[2].lanes_mut()[lane] = point.amplitude * (bounds[2] + bounds[3]);
        }
        let mut place = 0;
        for first in 0..4 {
            for second in first..4 {
                let twice = if first == second { 1.0 } else { 2.0 };
                let mean = mean_product(&point.columns[first], &point.columns[second]);
                self.means[place].lanes_mut()[lane] = twice * mean;
                place += 1;
            }
        }
        for (value, wave) in self.wave.iter_mut().zip(point.wave[0]) {
            value.lanes_mut()[lane] = wave;
        }
        let half = libm::sin(0.5 * point.angle_rad);
        self.turn[0].lanes_mut()[lane] = -2.0 * half * half;
        self.turn[1].lanes_mut()[lane] = libm::sin(point.angle_rad);
        self.angle.lanes_mut()[lane] = point.angle_rad;
        self.clearance.lanes_mut()[lane] = point.clearance_m;
        self.restitution.lanes_mut()[lane] = point.restitution;
        self.kick.lanes_mut()[lane] = point.kick;
        self.steps.lanes_mut()[lane] = point.wave.len() as f64;
    }
}

/// `row · unit`.
#[inline(always)]
pub(crate) fn dot<S: Simd>(row: &[Vector<S>; 4], unit: &[Vector<S>; 4]) -> Vector<S> {
    (row[0] * unit[0] + row[1] * unit[1]) + (row[2] * unit[2] + row[3] * unit[3])
}
