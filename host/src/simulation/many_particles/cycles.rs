//! Figures of the cycles of a motion with a many-particle damper: energy lost, loss factor, collective motion.

use std::f64::consts::TAU;

use damprig_particles::{Excitation, Motion, State};
use serde::Serialize;

/// Sums over one or several cycles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpheresFigures {
    /// Cycles; a part of one does not count.
    pub cycles: u64,
    /// Energy lost in contacts, J.
    pub lost_j: f64,
    /// Sum over the cycles of the structure's largest kinetic energy, J.
    pub kinetic_j: f64,
    /// Way in the box that the spheres have in common, m.
    common_m: f64,
    /// Mean way of the spheres in the box, m.
    way_m: f64,
}

impl SpheresFigures {
    /// Energy lost in contacts in a cycle, J; not a number without a cycle.
    #[must_use]
    pub fn lost_per_cycle_j(&self) -> f64 {
        self.lost_j / self.cycles as f64
    }

    /// Energy lost in contacts over 2π times the structure's largest kinetic energy; not a number at rest.
    #[must_use]
    pub fn loss_factor(&self) -> f64 {
        self.lost_j / (TAU * self.kinetic_j)
    }

    /// ∫|Σ m v| dt over ∫Σ m|v| dt, v the velocities in the box: 1 if all spheres move as one, 0 if their momenta cancel; not a
    /// number while all rest in the box.
    #[must_use]
    pub fn collective_motion(&self) -> f64 {
        self.common_m / self.way_m
    }

    /// Adds cycles.
    pub fn add(&mut self, other: &Self) {
        self.cycles += other.cycles;
        self.lost_j += other.lost_j;
        self.kinetic_j += other.kinetic_j;
        self.common_m += other.common_m;
        self.way_m += other.way_m;
    }
}

/// A cycle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpheresCycle {
    /// Its end, s.
    pub end_s: f64,
    /// Largest |x| at a step, m.
    pub max_abs_x_m: f64,
    /// Energy lost in contacts, J.
    pub lost_in_contacts_j: f64,
    /// That over 2π times the structure's largest kinetic energy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loss_factor: Option<f64>,
    /// Share of the spheres' momentum in the box that they have in common.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub collective_motion: Option<f64>,
}

/// Most cycles kept in a list.
const MAX_CYCLES: usize = 100_000;

/// Cycles at the end of a run whose mean is given, as in the last cycles of every run.
pub const LAST_CYCLES: usize = 10;

/// Divides a motion into cycles.
#[derive(Clone, Debug)]
pub(super) struct CycleMeter {
    cycle_s: f64,
    mass_kg: f64,
    /// Number of the present cycle.
    number: u64,
    /// Whether it was followed from its start.
    is_whole: bool,
    lost_j: f64,
    largest_m: f64,
    present: SpheresFigures,
    /// All whole cycles.
    pub all: SpheresFigures,
    /// The last of them, oldest first.
    pub last: Vec<SpheresFigures>,
    pub cycles: Vec<SpheresCycle>,
}

impl CycleMeter {
    /// For cycles of `cycle_s`, s, and a structure of `mass_kg`, kg, from the present state of a motion.
    pub fn new<E: Excitation>(cycle_s: f64, mass_kg: f64, motion: &Motion<E>) -> Self {
        let cycles = motion.state().t_s / cycle_s;
        let number = (cycles + 1e-6).floor();
        Self {
            cycle_s,
            mass_kg,
            number: number as u64,
            // A run starts a cycle to a step.
            is_whole: (cycles - number) * cycle_s < 2.0 * motion.step_s(),
            lost_j: motion.lost_in_contacts_j().iter().sum(),
            largest_m: 0.0,
            present: SpheresFigures::default(),
            all: SpheresFigures::default(),
            last: Vec::new(),
            cycles: Vec::new(),
        }
    }

    /// Takes a step of the motion that has ended in its present state.
    pub fn step<E: Excitation>(&mut self, motion: &Motion<E>) {
        let state: &State = motion.state();
        let step_s = motion.step_s();
        self.present.common_m += step_s * state.common_speed_m_per_s();
        self.present.way_m += step_s * state.mean_speed_m_per_s;
        let kinetic_j = 0.5 * self.mass_kg * state.v_m_per_s * state.v_m_per_s;
        self.present.kinetic_j = self.present.kinetic_j.max(kinetic_j);
        self.largest_m = self.largest_m.max(state.x_m.abs());
        if state.t_s >= (self.number + 1) as f64 * self.cycle_s * (1.0 - 1e-12) {
            self.close(motion);
        }
    }

    fn close<E: Excitation>(&mut self, motion: &Motion<E>) {
        let lost_j = motion.lost_in_contacts_j().iter().sum();
        let mut closed = std::mem::take(&mut self.present);
        closed.lost_j = lost_j - self.lost_j;
        closed.cycles = 1;
        if self.is_whole {
            self.all.add(&closed);
            if self.last.len() == LAST_CYCLES {
                self.last.remove(0);
            }
            self.last.push(closed);
            if self.cycles.len() < MAX_CYCLES {
                let number = |value: f64| value.is_finite().then_some(value);
                self.cycles.push(SpheresCycle {
                    end_s: (self.number + 1) as f64 * self.cycle_s,
                    max_abs_x_m: self.largest_m,
                    lost_in_contacts_j: closed.lost_j,
                    loss_factor: number(closed.loss_factor()),
                    collective_motion: number(closed.collective_motion()),
                });
            }
        }
        self.number += 1;
        self.is_whole = true;
        self.lost_j = lost_j;
        self.largest_m = 0.0;
    }
}
