//! Walls with Hertz contact.

mod cavities;
mod free_impacts;
mod second_method;

use damprig_core::integrator::sampled::{Joined, Sampled};
use damprig_core::integrator::units::Units;
use damprig_core::model::{Cavity, Dissipation, Hertz, Particle, Release, SetUp, Structure, Wall};

use crate::draw::Draw;

pub fn hunt_crossley(stiffness_n_per_m15: f64, coefficient_s_per_m: f64) -> Hertz {
    Hertz { stiffness_n_per_m15, dissipation: Dissipation::HuntCrossley { coefficient_s_per_m } }
}

pub fn lankarani_nikravesh(stiffness_n_per_m15: f64, coefficient: f64) -> Hertz {
    Hertz { stiffness_n_per_m15, dissipation: Dissipation::LankaraniNikravesh { coefficient } }
}

/// Two free bodies: the structure's spring does nothing within a contact.
pub fn free(hertz: Hertz, mass_kg: f64, clearance_m: f64) -> SetUp {
    let structure = Structure { mass_kg: 1.0, stiffness_n_per_m: 1e-12, damping_n_s_per_m: 0.0 };
    let wall = Wall::Hertz(hertz);
    let particle = Particle { mass_kg, clearance_m, friction_coefficient: 0.0, wall, cavity: Cavity::default() };
    SetUp { particle: Some(particle), ..SetUp::bare(structure) }
}

impl Draw {
    pub fn hertz_wall(&mut self) -> Wall {
        let stiffness_n_per_m15 = 10.0_f64.powf(self.between(4.0, 9.5));
        Wall::Hertz(if self.coin() {
            hunt_crossley(stiffness_n_per_m15, if self.coin() { self.between(0.0, 5.0) } else { 0.0 })
        } else {
            lankarani_nikravesh(stiffness_n_per_m15, self.between(0.0, 1.0))
        })
    }

    /// A cavity with a Hertz wall at one side at least, off its centre and inclined.
    pub fn hertz_cavity(&mut self) -> SetUp {
        let mut set_up = self.set_up(Self::hertz_wall);
        let particle = set_up.particle.as_mut().expect("it has one");
        let positive_wall = match self.one_of(4) {
            0 => Some(Wall::Restitution { coefficient: self.between(0.0, 0.95) }),
            1 => Some(Wall::Voigt {
                stiffness_n_per_m: self.between(500.0, 60_000.0),
                damping_n_s_per_m: self.between(0.0, 20.0),
                release: Release::ZeroForce,
            }),
            2 => Some(self.hertz_wall()),
            _ => None,
        };
        particle.cavity = Cavity {
            positive_wall,
            offset_m: particle.clearance_m * self.between(-2.0, 2.0),
            inclination_deg: if self.one_of(4) == 0 { 90.0 } else { self.between(-90.0, 90.0) },
        };
        if self.coin() {
            particle.cavity.inclination_deg = 0.0;
        }
        set_up
    }
}

#[test]
fn the_sampled_integrator_refuses_a_hertz_wall() {
    let set_up = free(hunt_crossley(1e9, 0.0), 0.1, 0.01);
    let name = "particle.wall.stiffness_n_per_m15";
    let units = Units::metres(1e-3);
    assert_eq!(Joined::<f64>::joined(&set_up, units, &set_up.neutral()).expect_err("Hertz").parameter, name);
    let other = Sampled::<f64>::new(&set_up, units, &set_up.neutral()).expect_err("Hertz");
    assert_eq!(other.parameter, name);
    let mut negative = set_up;
    negative.particle.as_mut().expect("it has one").wall = Wall::Hertz(hunt_crossley(-1.0, 0.0));
    assert_eq!(negative.validate().expect_err("below 0").parameter, name);
    negative.particle.as_mut().expect("it has one").wall = Wall::Hertz(lankarani_nikravesh(1.0, 1.1));
    assert_eq!(negative.validate().expect_err("above 1").parameter, "particle.wall.coefficient");
}
