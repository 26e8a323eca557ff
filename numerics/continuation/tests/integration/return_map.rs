//! The derivative of the Poincaré map against central differences of the simulated motion.

use std::f64::consts::TAU;

use damprig_continuation::ReturnMap;
use damprig_core::integrator::exact::{Accumulation, Impact, Observer};
use damprig_core::model::{
    Cavity, FrictionDamper, Particle, Release, Restitution, SetUp, SpeedTable, Structure, Tmd, Wall,
};
use nalgebra::DMatrix;

use crate::common::{NATURAL, impact_damper, initial, settled, sine, vector};

/// Steps of the differences, relative to the motion: each half the one before.
const STEPS: [f64; 3] = [4e-5, 2e-5, 1e-5];

/// Rounding of the map over many events, relative to the motion.
const ROUNDING: f64 = 1e-13;

/// The derivative by central differences without the error of the second order, and the error that is left; displacements per
/// metre (the amplitude), velocities per Ω.
fn differences(map: &ReturnMap, at: [f64; 4], size: usize, turning: f64) -> (DMatrix<f64>, f64) {
    let unit = [1.0, turning, 1.0, turning];
    let length = (0..4).map(|n| at[n].abs() / unit[n]).fold(1.0, f64::max);
    let central = STEPS.map(|step| {
        let mut matrix = DMatrix::zeros(size, size);
        for k in 0..size {
            let image = |sign: f64| {
                let mut from = at;
                from[k] += sign * step * length * unit[k];
                vector(&map.image(&initial(from)))
            };
            let (above, below) = (image(1.0), image(-1.0));
            for row in 0..size {
                matrix[(row, k)] = (above[row] - below[row]) / (2.0 * step * length * unit[row]);
            }
        }
        matrix
    });
    let [coarse, fine] = [0, 1].map(|n| (4.0 * &central[n + 1] - &central[n]) / 3.0);
    let error = (&fine - coarse).norm() + ROUNDING * (1.0 + fine.norm()) / STEPS[2];
    (fine, error)
}

/// Differences with a larger error are left out: a disturbance of the size of the steps changes the sequence of events.
const LARGEST_ERROR: f64 = 1e-5;

/// Compares random set-ups; the numbers compared and with chatter.
fn compare(name: &str, seed: u64, mut draw: impl FnMut(&mut dyn FnMut(f64, f64) -> f64) -> (SetUp, f64)) -> (u32, u32) {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
    let (mut compared, mut with_chatter, mut worst) = (0, 0, 0.0_f64);
    for n in 0..40 {
        let (set_up, ratio) = draw(&mut between);
        let Some((at, map)) = settled(&set_up, ratio, 1 + n % 3, between(0.0, TAU)) else { continue };
        let size = if set_up.particle.is_some() || set_up.tmd.is_some() { 4 } else { 2 };
        let (expected, error) = differences(&map, at, size, ratio * NATURAL);
        let found = map.variation(&initial(at)).expect("resolved");
        if error > LARGEST_ERROR * (1.0 + expected.norm()) {
            continue;
        }
        compared += 1;
        with_chatter += u32::from(rests(&map, at));
        let off = (&found.matrix - &expected).norm();
        worst = worst.max(off / error);
        assert!(
            off <= 3.0 * error + found.error,
            "{name} {n}: off by {off:e}, {error:e} and {:e} allowed\n{set_up:?}{}{expected}",
            found.error,
            found.matrix
        );
    }
    println!(
        "{name}: {compared} compared, {with_chatter} with chatter, worst {worst:.2} of the error of the differences"
    );
    (compared, with_chatter)
}

#[derive(Default)]
struct Chatter(u32);

impl Observer for Chatter {
    const ARCS: bool = false;

    fn accumulation(&mut self, _: &Accumulation) {
        self.0 += 1;
    }
}

fn rests(map: &ReturnMap, at: [f64; 4]) -> bool {
    let mut chatter = Chatter::default();
    map.watch(&initial(at), &mut chatter);
    chatter.0 > 0
}

fn particle(clearance_m: f64, friction_coefficient: f64, wall: Wall) -> Option<Particle> {
    Some(Particle { mass_kg: 0.1, clearance_m, friction_coefficient, wall, cavity: Cavity::default() })
}

fn structure(damping_ratio: f64) -> SetUp {
    SetUp::bare(Structure::from_modal(1.0, 2.5, damping_ratio))
}

type Draw<'a> = &'a mut dyn FnMut(f64, f64) -> f64;

fn hard(draw: Draw<'_>) -> Wall {
    Wall::Restitution { coefficient: draw(0.1, 0.9) }
}

/// Restitution that falls with the speed of the impact, whose speeds are tens of m/s here.
fn falling(draw: Draw<'_>, maximum: f64) -> Wall {
    let (coefficient, reference_speed_m_per_s) = (draw(0.3, 1.0) * maximum, draw(5.0, 60.0));
    Wall::SpeedRestitution(Restitution { coefficient, reference_speed_m_per_s, exponent: draw(0.05, 1.0), maximum })
}

/// A table of restitution over such speeds; it rises too.
fn table(draw: Draw<'_>, most: f64) -> Wall {
    let mut points = [[draw(2.0, 20.0), draw(0.0, most)]; 4];
    for n in 1..points.len() {
        let speed = points[n - 1][0] * draw(1.3, 3.0);
        points[n] = [speed, draw(SpeedTable::least_at(points[n - 1], speed), most)];
    }
    Wall::TableRestitution(SpeedTable::new(&points).expect("four points"))
}

fn soft(draw: Draw<'_>, release: Release) -> Wall {
    Wall::Voigt { stiffness_n_per_m: draw(500.0, 2e4), damping_n_s_per_m: draw(0.5, 10.0), release }
}

#[test]
fn the_derivative_is_that_of_the_differences_for_every_damper() {
    let k = structure(0.01).structure.stiffness_n_per_m;
    let damper = |force: f64| Some(FrictionDamper { force_n: force * k });
    let free = |draw: Draw<'_>| {
        let wall = hard(draw);
        (SetUp { particle: particle(draw(1.0, 15.0), 0.0, wall), ..structure(draw(0.01, 0.1)) }, draw(0.7, 1.3))
    };
    let slower = |draw: Draw<'_>| {
        let wall = falling(draw, 0.9);
        (SetUp { particle: particle(draw(1.0, 15.0), 0.0, wall), ..structure(draw(0.01, 0.1)) }, draw(0.7, 1.3))
    };
    let tabulated = |draw: Draw<'_>| {
        let wall = table(draw, 0.9);
        (SetUp { particle: particle(draw(1.0, 15.0), 0.0, wall), ..structure(draw(0.01, 0.1)) }, draw(0.7, 1.3))
    };
    // Two walls of any kinds, off the centre and inclined, under a weight as large as the structure's acceleration.
    let lopsided = |draw: Draw<'_>| {
        let wall = |draw: Draw<'_>| match draw(0.0, 4.0) {
            ..1.0 => hard(draw),
            ..2.0 => falling(draw, 0.9),
            ..3.0 => soft(draw, Release::ZeroForce),
            _ => soft(draw, Release::ZeroPenetration),
        };
        let (negative, positive_wall) = (wall(draw), Some(wall(draw)));
        let (clearance_m, friction) = (draw(1.0, 10.0), draw(-0.2, 0.2).max(0.0));
        let cavity = Cavity { positive_wall, offset_m: draw(-5.0, 5.0), inclination_deg: draw(-90.0, 90.0) };
        let particle = particle(clearance_m, friction, negative).map(|p| Particle { cavity, ..p });
        let friction_damper = damper(draw(-0.3, 0.3).max(0.0));
        (SetUp { particle, friction_damper, gravity_m_per_s2: 200.0, ..structure(draw(0.01, 0.1)) }, draw(0.7, 1.3))
    };
    let slides = |draw: Draw<'_>| {
        let wall = hard(draw);
        let friction = draw(0.1, 10.0);
        (SetUp { particle: particle(draw(1.0, 15.0), friction, wall), ..structure(draw(0.01, 0.1)) }, draw(0.7, 1.3))
    };
    let zero_force = |draw: Draw<'_>| {
        let wall = soft(draw, Release::ZeroForce);
        (SetUp { particle: particle(draw(1.0, 10.0), 0.0, wall), ..structure(draw(0.01, 0.1)) }, draw(0.7, 1.3))
    };
    let zero_penetration = |draw: Draw<'_>| {
        let wall = soft(draw, Release::ZeroPenetration);
        let friction = draw(0.1, 3.0);
        (SetUp { particle: particle(draw(1.0, 10.0), friction, wall), ..structure(draw(0.01, 0.1)) }, draw(0.7, 1.3))
    };
    let grips = |draw: Draw<'_>| {
        (SetUp { friction_damper: damper(draw(0.05, 0.9)), ..structure(draw(0.01, 0.1)) }, draw(0.5, 1.5))
    };
    let hybrid = |draw: Draw<'_>| {
        let wall = hard(draw);
        let particle = particle(draw(1.0, 10.0), draw(-2.0, 2.0).max(0.0), wall);
        let friction_damper = damper(draw(0.05, 0.5));
        (SetUp { particle, friction_damper, ..structure(draw(0.01, 0.1)) }, draw(0.7, 1.3))
    };
    let tuned = |draw: Draw<'_>| {
        let (stiffness_n_per_m, damping_n_s_per_m) = (draw(0.04, 0.2) * k, draw(0.0, 1.0));
        let tmd = Some(Tmd { mass_kg: 0.1, stiffness_n_per_m, damping_n_s_per_m });
        (SetUp { tmd, friction_damper: damper(draw(-0.2, 0.2).max(0.0)), ..structure(draw(0.01, 0.1)) }, draw(0.7, 1.3))
    };
    for (name, least, (compared, _)) in [
        ("particle", 20, compare("particle", 1, free)),
        ("falling restitution", 20, compare("falling restitution", 11, slower)),
        ("table of restitution", 20, compare("table of restitution", 14, tabulated)),
        ("lopsided", 15, compare("lopsided", 13, lopsided)),
        ("particle with friction", 20, compare("particle with friction", 2, slides)),
        ("soft walls, zero force", 20, compare("soft walls, zero force", 3, zero_force)),
        ("soft walls, zero penetration", 20, compare("soft walls, zero penetration", 4, zero_penetration)),
        ("friction damper", 20, compare("friction damper", 5, grips)),
        ("hybrid", 15, compare("hybrid", 6, hybrid)),
        ("tuned mass", 20, compare("tuned mass", 7, tuned)),
    ] {
        assert!(compared >= least, "{name}: {compared}");
    }
}

/// At the end of a chatter the disturbance of the particle against the structure is gone, and that of the joint motion is kept.
#[test]
fn the_derivative_is_that_of_the_differences_where_impacts_accumulate() {
    let (_, alone) = compare("chatter", 8, |draw| {
        let wall = Wall::Restitution { coefficient: draw(0.05, 0.5) };
        (SetUp { particle: particle(draw(0.1, 0.8), 0.0, wall), ..structure(draw(0.02, 0.1)) }, draw(0.5, 1.5))
    });
    let (_, falls) = compare("chatter of falling restitution", 12, |draw| {
        let wall = falling(draw, 0.5);
        (SetUp { particle: particle(draw(0.1, 0.8), 0.0, wall), ..structure(draw(0.02, 0.1)) }, draw(0.5, 1.5))
    });
    let (_, varies) = compare("chatter of a table", 15, |draw| {
        let wall = table(draw, 0.5);
        (SetUp { particle: particle(draw(0.1, 0.8), 0.0, wall), ..structure(draw(0.02, 0.1)) }, draw(0.5, 1.5))
    });
    let (_, with_friction) = compare("chatter with friction", 9, |draw| {
        let wall = Wall::Restitution { coefficient: draw(0.05, 0.5) };
        let friction = draw(0.05, 1.0);
        (SetUp { particle: particle(draw(0.1, 0.8), friction, wall), ..structure(draw(0.02, 0.1)) }, draw(0.5, 1.5))
    });
    let k = structure(0.01).structure.stiffness_n_per_m;
    let (_, with_damper) = compare("chatter with a friction damper", 10, |draw| {
        let wall = Wall::Restitution { coefficient: draw(0.05, 0.5) };
        let friction_damper = Some(FrictionDamper { force_n: draw(0.05, 0.4) * k });
        let particle = particle(draw(0.1, 0.8), 0.0, wall);
        (SetUp { particle, friction_damper, ..structure(draw(0.02, 0.1)) }, draw(0.5, 1.5))
    });
    assert!(falls >= 10 && varies >= 10, "{falls} {varies}");
    assert!(alone >= 10 && with_friction >= 10 && with_damper >= 10, "{alone} {with_friction} {with_damper}");
}

#[derive(Default)]
struct Count(u32);

impl Observer for Count {
    const ARCS: bool = false;

    fn impact(&mut self, _: &Impact) {
        self.0 += 1;
    }
}

/// Near a grazing: disturbances of half the stated size keep the number of impacts, some of twice that size do not.
#[test]
fn the_smallest_disturbance_that_removes_an_impact_does_so_in_the_simulation() {
    let map = ReturnMap::new(&impact_damper(10.0, 0.5), &sine(1.0), 1).expect("physical");
    let mut random = fastrand::Rng::with_seed(3);
    let mut tested = 0;
    while tested < 5 {
        let at = [0.0, 0.0, 0.0, NATURAL * 60.0 * random.f64()];
        let size = map.variation(&initial(at)).expect("resolved").smallest_grazing;
        if !(1e-7..1e-3).contains(&size) {
            continue;
        }
        tested += 1;
        let impacts = |at: [f64; 4]| {
            let mut impacts = Count::default();
            map.watch(&initial(at), &mut impacts);
            impacts.0
        };
        let mut changes = |share: f64| {
            (0..400).any(|_| {
                let direction: [f64; 4] = std::array::from_fn(|_| random.f64() - 0.5);
                let norm = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
                let unit = [1.0, NATURAL, 1.0, NATURAL];
                impacts(std::array::from_fn(|n| at[n] + share * size * direction[n] / norm * unit[n])) != impacts(at)
            })
        };
        assert!(!changes(0.5), "{at:?}: {size:e} is too large");
        assert!(changes(2.0), "{at:?}: {size:e} is too small");
    }
}
