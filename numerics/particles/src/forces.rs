//! Forces of all contacts: between spheres, and between spheres and the six walls of the box.

use crate::cavity::Cavity;
use crate::contact::{ContactEnergy, ContactLaw, History};
use crate::neighbours::Neighbours;
use crate::vector::{Vector, cross, dot, minus, plus, plus_times, times};

/// A sphere has touched a wall across the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallImpact {
    /// Time, s, to a step.
    pub t_s: f64,
    /// +1 at the wall at the far end of the box, −1 at the other.
    pub side: i8,
    /// Approach speed, m/s.
    pub approach_speed_m_per_s: f64,
    /// Centre of the sphere along the motion, m.
    pub centre_m: f64,
}

/// The spheres: centres and velocities along the motion are in the fixed frame; the box's middle and floor are the origin across.
#[derive(Clone, Debug)]
pub struct Spheres {
    pub centres_m: Vec<Vector>,
    pub velocities: Vec<Vector>,
    /// Angular velocities, rad/s; empty without friction.
    pub spins: Vec<Vector>,
    pub accelerations: Vec<Vector>,
    pub spin_accelerations: Vec<Vector>,
}

/// Place and velocity of the box along the motion.
#[derive(Clone, Copy, Debug)]
pub struct BoxMotion {
    pub x_m: f64,
    pub v_m_per_s: f64,
    pub t_s: f64,
}

/// The contacts of a damper with their histories.
#[derive(Clone, Debug)]
pub struct Contacts {
    pub law: ContactLaw,
    pub cavity: Cavity,
    pub radius_m: f64,
    pub sphere_kg: f64,
    pub gravity_m_per_s2: f64,
    pub step_s: f64,
    pub neighbours: Neighbours,
    /// Walls in the order of [`WALLS`].
    pub walls: Vec<[History; 6]>,
    pub energy: ContactEnergy,
    /// Largest overlap so far, m.
    pub largest_overlap_m: f64,
    /// Collisions between spheres so far.
    pub collisions: u64,
}

/// Side of the box and direction of the inward normal: both ends along the motion first, floor and ceiling last.
const WALLS: [(usize, f64); 6] = [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)];

impl Contacts {
    /// Sets the accelerations of the spheres; gives the force on the structure, N.
    pub fn act(&mut self, spheres: &mut Spheres, at: &BoxMotion, on_impact: &mut impl FnMut(WallImpact)) -> f64 {
        self.neighbours.update(&spheres.centres_m, at.x_m);
        self.energy = ContactEnergy::default();
        // Forces and torques until the end, where they are divided.
        spheres.accelerations.fill([0.0; 3]);
        spheres.spin_accelerations.fill([0.0; 3]);
        self.act_between(spheres);
        let on_box_n = self.act_at_walls(spheres, at, on_impact);
        for force in &mut spheres.accelerations {
            *force = times(1.0 / self.sphere_kg, force);
            force[2] -= self.gravity_m_per_s2;
        }
        let inertia_kg_m2 = 0.4 * self.sphere_kg * self.radius_m * self.radius_m;
        for torque in &mut spheres.spin_accelerations {
            *torque = times(1.0 / inertia_kg_m2, torque);
        }
        on_box_n
    }

    fn act_between(&mut self, spheres: &mut Spheres) {
        let diameter_m = 2.0 * self.radius_m;
        let has_spin = !spheres.spins.is_empty();
        for (pair, history) in self.neighbours.pairs.iter().zip(&mut self.neighbours.histories) {
            let [i, j] = pair.map(|sphere| sphere as usize);
            let apart = minus(&spheres.centres_m[i], &spheres.centres_m[j]);
            let square = dot(&apart, &apart);
            // Centres in one point have no line of centres.
            if square >= diameter_m * diameter_m || square == 0.0 {
                history.touches = false;
                continue;
            }
            let distance_m = square.sqrt();
            let normal = times(1.0 / distance_m, &apart);
            let mut velocity = minus(&spheres.velocities[i], &spheres.velocities[j]);
            if has_spin {
                let spin = plus(&spheres.spins[i], &spheres.spins[j]);
                velocity = plus_times(&velocity, self.radius_m, &cross(&normal, &spin));
            }
            let overlap_m = diameter_m - distance_m;
            self.largest_overlap_m = self.largest_overlap_m.max(overlap_m);
            self.collisions += u64::from(!history.touches);
            let contact = (overlap_m, &normal, &velocity);
            let force = self.law.force(&self.law.pair, contact, self.step_s, history, &mut self.energy);
            spheres.accelerations[i] = plus(&spheres.accelerations[i], &force);
            spheres.accelerations[j] = minus(&spheres.accelerations[j], &force);
            if has_spin {
                let torque = times(-self.radius_m, &cross(&normal, &force));
                spheres.spin_accelerations[i] = plus(&spheres.spin_accelerations[i], &torque);
                spheres.spin_accelerations[j] = plus(&spheres.spin_accelerations[j], &torque);
            }
        }
    }

    fn act_at_walls(&mut self, spheres: &mut Spheres, at: &BoxMotion, on_impact: &mut impl FnMut(WallImpact)) -> f64 {
        let mut on_box_n = 0.0;
        let [half_length_m, half_width_m] = [0.5 * self.cavity.length_m, 0.5 * self.cavity.width_m];
        let has_spin = !spheres.spins.is_empty();
        for (sphere, histories) in self.walls.iter_mut().enumerate() {
            let centre = spheres.centres_m[sphere];
            let along_m = centre[0] - at.x_m;
            let distances_m = [
                along_m + half_length_m,
                half_length_m - along_m,
                centre[1] + half_width_m,
                half_width_m - centre[1],
                centre[2],
                self.cavity.height_m - centre[2],
            ];
            for (wall, (side, direction)) in WALLS.into_iter().enumerate() {
                let overlap_m = self.radius_m - distances_m[wall];
                let history = &mut histories[wall];
                if overlap_m <= 0.0 {
                    history.touches = false;
                    continue;
                }
                let mut normal = [0.0; 3];
                normal[side] = direction;
                let mut velocity = spheres.velocities[sphere];
                velocity[0] -= at.v_m_per_s;
                if has_spin {
                    velocity = plus_times(&velocity, self.radius_m, &cross(&normal, &spheres.spins[sphere]));
                }
                self.largest_overlap_m = self.largest_overlap_m.max(overlap_m);
                let is_end = side == 0;
                if is_end && !history.touches {
                    on_impact(WallImpact {
                        t_s: at.t_s,
                        side: if direction < 0.0 { 1 } else { -1 },
                        approach_speed_m_per_s: -dot(&velocity, &normal),
                        centre_m: centre[0],
                    });
                }
                let law = if is_end { &self.law.end } else { &self.law.side };
                let contact = (overlap_m, &normal, &velocity);
                let force = self.law.force(law, contact, self.step_s, history, &mut self.energy);
                spheres.accelerations[sphere] = plus(&spheres.accelerations[sphere], &force);
                on_box_n -= force[0];
                if has_spin {
                    let torque = times(-self.radius_m, &cross(&normal, &force));
                    spheres.spin_accelerations[sphere] = plus(&spheres.spin_accelerations[sphere], &torque);
                }
            }
        }
        on_box_n
    }
}
