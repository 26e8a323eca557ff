//! A particle between two piezoelectric walls on a structure, by a Runge–Kutta method of order 4 in small steps whose contacts begin and end at steps. It
//! shares no code with the crate.

use damprig_structures::{ImpactDamper, SetUp};

/// Sine of the base.
#[derive(Clone, Copy, Debug)]
pub struct Sine {
    pub amplitude_m: f64,
    pub turning: f64,
    pub phase_rad: f64,
}

/// Time, two modal coordinates and their rates, y and y′ of the particle, and of each wall its charge and the energy that its load has taken.
pub type Point = [f64; 11];

const MODAL: usize = 1;
const MODAL_RATE: usize = 3;
pub const Y: usize = 5;
const U: usize = 6;
pub const CHARGE: usize = 7;
pub const ENERGY: usize = 9;

fn moved(from: &Point, h: f64, by: &Point) -> Point {
    let mut to = *from;
    for (to, by) in to.iter_mut().zip(by) {
        *to += h * by;
    }
    to
}

/// The motion with what it has reached.
pub struct Reference<'a> {
    pub set_up: &'a SetUp,
    pub sine: Sine,
    pub point: Point,
    pub largest_v: [f64; 2],
    /// Contacts so far.
    pub contacts: u32,
    pressed: [bool; 2],
}

impl<'a> Reference<'a> {
    /// Of a set-up whose damper has two piezoelectric walls, no friction and no weight.
    pub fn new(set_up: &'a SetUp, sine: Sine, point: Point) -> Self {
        Self { set_up, sine, point, largest_v: [0.0; 2], contacts: 0, pressed: [false; 2] }
    }

    fn damper(&self) -> &ImpactDamper {
        &self.set_up.impact_dampers[0]
    }

    /// z, and z″.
    fn base(&self, t: f64) -> (f64, f64) {
        let Sine { amplitude_m, turning, phase_rad } = self.sine;
        let z = amplitude_m * (turning * t + phase_rad).sin();
        (z, -turning * turning * z)
    }

    /// Penetration of each wall at rest, and how far the particle is beyond the surface.
    fn depths(&self, at: &Point) -> [(f64, f64); 2] {
        let (damper, modes) = (self.damper(), &self.set_up.structure.modes);
        let place: f64 = modes.iter().zip(&at[MODAL..]).map(|(mode, q)| mode.shape[damper.place] * q).sum();
        let x = place + self.set_up.structure.influence[damper.place] * self.base(at[0]).0;
        let cavity = damper.particle.cavity;
        [0, 1].map(|n| {
            let side = if n == 0 { -1.0 } else { 1.0 };
            let depth = side * (at[Y] - x - cavity.offset_m) - damper.particle.clearance_m;
            let wall = damper.piezoelectric[n].expect("piezoelectric");
            let theta = wall.coupling_n_per_v;
            let stands = theta * at[CHARGE + n] / (wall.stiffness_n_per_m * wall.capacitance_f + theta * theta);
            (depth, depth - stands)
        })
    }

    fn rates(&self, at: &Point) -> Point {
        let damper = self.damper();
        let depths = self.depths(at);
        // Force on the particle, and the voltages.
        let mut force = 0.0;
        let voltage = [0, 1].map(|n| {
            let wall = damper.piezoelectric[n].expect("piezoelectric");
            let (k, c, theta) = (wall.stiffness_n_per_m, wall.capacitance_f, wall.coupling_n_per_v);
            let (depth, charge) = (depths[n].0, at[CHARGE + n]);
            if self.pressed[n] {
                let voltage = (theta * depth - charge) / c;
                force -= if n == 0 { -1.0 } else { 1.0 } * (k * depth + theta * voltage);
                voltage
            } else {
                -charge / (c + theta * theta / k)
            }
        });
        let mut rates = [0.0; 11];
        (rates[0], rates[Y], rates[U]) = (1.0, at[U], force / damper.particle.mass_kg);
        let base = self.base(at[0]).1;
        for (i, mode) in self.set_up.structure.modes.iter().enumerate() {
            let (omega, q, v) = (mode.angular_frequency_rad_per_s, at[MODAL + i], at[MODAL_RATE + i]);
            let driven = -mode.participation * base - mode.shape[damper.place] * force;
            rates[MODAL + i] = v;
            rates[MODAL_RATE + i] = driven - 2.0 * mode.damping_ratio * omega * v - omega * omega * q;
        }
        for (n, voltage) in voltage.iter().enumerate() {
            let load = damper.piezoelectric[n].expect("piezoelectric").load_ohm;
            rates[CHARGE + n] = voltage / load;
            rates[ENERGY + n] = voltage * voltage / load;
        }
        rates
    }

    fn stepped(&self, h: f64) -> Point {
        let start = &self.point;
        let a = self.rates(start);
        let b = self.rates(&moved(start, 0.5 * h, &a));
        let c = self.rates(&moved(start, 0.5 * h, &b));
        let d = self.rates(&moved(start, h, &c));
        let mut after = *start;
        for i in 1..after.len() {
            after[i] += h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
        }
        after[0] += h;
        after
    }

    /// Whether contacts at a point are others than now.
    fn changes(&self, at: &Point) -> [bool; 2] {
        let depths = self.depths(at);
        [0, 1].map(|n| (depths[n].1 > 0.0) != self.pressed[n])
    }

    /// Goes on to `until_s` in so many steps and those to contacts.
    pub fn run(&mut self, until_s: f64, steps: u32) {
        let (from_s, h) = (self.point[0], (until_s - self.point[0]) / f64::from(steps));
        for n in 1..=steps {
            let end = from_s + h * f64::from(n);
            while self.point[0] < end {
                let mut length = end - self.point[0];
                let mut next = self.stepped(length);
                if self.changes(&next) != [false; 2] {
                    // The shortest step after which a contact has changed.
                    let mut low = 0.0;
                    for _ in 0..60 {
                        let middle = 0.5 * (low + length);
                        let tried = self.stepped(middle);
                        if self.changes(&tried) == [false; 2] {
                            low = middle;
                        } else {
                            (length, next) = (middle, tried);
                        }
                    }
                    let changes = self.changes(&next);
                    for (pressed, changes) in self.pressed.iter_mut().zip(changes) {
                        self.contacts += u32::from(changes && !*pressed);
                        *pressed ^= changes;
                    }
                }
                self.point = next;
                let rates = self.rates(&self.point);
                for n in 0..2 {
                    let load = self.damper().piezoelectric[n].expect("piezoelectric").load_ohm;
                    self.largest_v[n] = self.largest_v[n].max((load * rates[CHARGE + n]).abs());
                }
            }
        }
    }
}
