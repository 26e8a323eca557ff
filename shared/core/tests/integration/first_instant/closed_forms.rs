//! Drawn set-ups and excitations, and the closed forms of the motion after the first instant.

use super::*;

pub(super) struct Draw(pub(super) Xoshiro256PlusPlus);

impl Draw {
    pub(super) fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(super) fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.0.next_u64() as usize % choices.len()]
    }

    /// A random value that is zero in half the cases.
    pub(super) fn maybe(&mut self, low: f64, high: f64) -> f64 {
        let value = self.between(low, high);
        self.one_of(&[0.0, value])
    }

    pub(super) fn side(&mut self) -> f64 {
        self.one_of(&[-1.0, 1.0])
    }

    pub(super) fn structure(&mut self) -> Structure {
        Structure::from_modal(self.between(0.5, 4.0), self.between(1.0, 6.0), self.maybe(0.0, 0.08))
    }

    pub(super) fn hard(&mut self, restitution: f64) -> SetUp {
        let structure = self.structure();
        let particle = Particle {
            mass_kg: structure.mass_kg * self.between(0.02, 0.4),
            clearance_m: self.between(2e-3, 40e-3),
            friction_coefficient: self.maybe(0.01, 0.2),
            wall: Wall::Restitution { coefficient: restitution },
            cavity: Cavity::default(),
        };
        SetUp { particle: Some(particle), ..SetUp::bare(structure) }
    }

    /// No damper, one without force, or one that slips.
    pub(super) fn damper(&mut self) -> Option<FrictionDamper> {
        let force_n = self.between(0.05, 2.0);
        self.one_of(&[None, Some(0.0), Some(force_n)]).map(|force_n| FrictionDamper { force_n })
    }

    pub(super) fn soft(&mut self) -> Wall {
        Wall::Voigt {
            stiffness_n_per_m: self.between(500.0, 20_000.0),
            damping_n_s_per_m: self.maybe(0.1, 10.0),
            release: self.one_of(&[Release::ZeroForce, Release::ZeroPenetration]),
        }
    }

    pub(super) fn tmd(&mut self, structure: &Structure) -> Tmd {
        let mass_kg = structure.mass_kg * self.between(0.02, 0.3);
        Tmd {
            mass_kg,
            stiffness_n_per_m: mass_kg * self.between(30.0, 900.0),
            damping_n_s_per_m: mass_kg * self.maybe(0.1, 6.0),
        }
    }

    pub(super) fn excitation(&mut self, structure: &Structure) -> Excitation {
        let turning = structure.angular_frequency_rad_per_s() * self.between(0.5, 1.6);
        let (amplitude_m, duration_s) = (self.between(0.5e-3, 30e-3), self.between(0.1, 0.4));
        let any = self.between(-3.0, 3.0);
        let phase_rad = self.one_of(&[0.0, FRAC_PI_2, any]);
        let sine = Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: turning, phase_rad };
        let force =
            Excitation::ForceSine { amplitude_n: 100.0 * amplitude_m, angular_frequency_rad_per_s: turning, phase_rad };
        self.one_of(&[
            Excitation::Fixed,
            sine,
            force,
            Excitation::HalfSine { amplitude_m, duration_s },
            Excitation::Versine { amplitude_m, duration_s },
        ])
    }
}

/// Excitation: offset + amplitude sin(Ωt + φ), of the base (m) or of a force (N).
#[derive(Clone, Copy)]
pub(super) struct Drive {
    pub(super) is_force: bool,
    pub(super) offset: f64,
    pub(super) amplitude: f64,
    pub(super) turning: f64,
    pub(super) phase: f64,
    /// Time until which the closed form is valid, s.
    pub(super) until_s: f64,
}

impl Drive {
    pub(super) fn of(excitation: &Excitation) -> Self {
        let drive = |is_force, offset, amplitude, turning, phase, until_s| Self {
            is_force,
            offset,
            amplitude,
            turning,
            phase,
            until_s,
        };
        match *excitation {
            Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad } => {
                drive(false, 0.0, amplitude_m, angular_frequency_rad_per_s, phase_rad, f64::INFINITY)
            }
            Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s, phase_rad } => {
                drive(true, 0.0, amplitude_n, angular_frequency_rad_per_s, phase_rad, f64::INFINITY)
            }
            Excitation::HalfSine { amplitude_m, duration_s } => {
                drive(false, 0.0, amplitude_m, PI / duration_s, 0.0, duration_s)
            }
            Excitation::Versine { amplitude_m: a, duration_s } => {
                drive(false, 0.5 * a, 0.5 * a, TAU / duration_s, -FRAC_PI_2, duration_s)
            }
            _ => drive(false, 0.0, 0.0, 1.0, 0.0, f64::INFINITY),
        }
    }

    /// z and z′.
    pub(super) fn base(&self, t: f64) -> (f64, f64) {
        if self.is_force {
            return (0.0, 0.0);
        }
        let angle = self.turning * t + self.phase;
        (self.offset + self.amplitude * angle.sin(), self.amplitude * self.turning * angle.cos())
    }

    pub(super) fn force(&self, t: f64) -> f64 {
        if self.is_force { self.amplitude * (self.turning * t + self.phase).sin() } else { 0.0 }
    }
}

/// x and x′ at `t` of `mass x″ + c (x′ − z′) + k (x − z) = force + drive`, from x0 and v0.
pub(super) fn oscillator(
    structure: &Structure,
    mass: f64,
    drive: &Drive,
    force: f64,
    (x0, v0): (f64, f64),
    t: f64,
) -> (f64, f64) {
    let (c, k, w) = (structure.damping_n_s_per_m, structure.stiffness_n_per_m, drive.turning);
    // Steady response: Im(X e^{iwt}), X = numerator/(k − m w² + i c w).
    let (re, im) = if drive.is_force { (1.0, 0.0) } else { (k, c * w) };
    let (cos, sin) = (drive.phase.cos(), drive.phase.sin());
    let (top_re, top_im) = (drive.amplitude * (re * cos - im * sin), drive.amplitude * (re * sin + im * cos));
    let (low_re, low_im) = (k - mass * w * w, c * w);
    let square = low_re * low_re + low_im * low_im;
    let (a, b) = ((top_re * low_re + top_im * low_im) / square, (top_im * low_re - top_re * low_im) / square);
    let steady = |t: f64| {
        let (s, c) = (w * t).sin_cos();
        (a * s + b * c, w * (a * c - b * s))
    };
    let level = force / k + if drive.is_force { 0.0 } else { drive.offset };
    let decay = 0.5 * c / mass;
    let ringing = (k / mass - decay * decay).sqrt();
    let (start, start_rate) = steady(0.0);
    let (p, q0) = (x0 - level - start, v0 - start_rate);
    let q = (q0 + decay * p) / ringing;
    let (s, c) = (ringing * t).sin_cos();
    let (now, rate) = steady(t);
    let fade = (-decay * t).exp();
    let free = fade * (p * c + q * s);
    (level + now + free, rate - decay * free + fade * ringing * (q * c - p * s))
}

/// x, x′, y, y′.
pub(super) type Phase = [f64; 4];

pub(super) fn phase(state: &ExactState) -> Phase {
    [state.x_m, state.v_m_per_s, state.y_m(), state.u_m_per_s()]
}

#[derive(Default)]
pub(super) struct Seen {
    pub(super) impacts: usize,
    pub(super) first: Option<Impact>,
    pub(super) least_m_per_s: f64,
}

impl Seen {
    pub(super) fn new() -> Self {
        Self { least_m_per_s: f64::INFINITY, ..Self::default() }
    }
}

impl Observer for Seen {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        self.impacts += 1;
        self.first.get_or_insert(*impact);
        self.least_m_per_s = self.least_m_per_s.min(impact.approach_speed_m_per_s);
    }
}

/// A start at a hard wall with an approaching particle, and the velocities after the impact.
pub(super) struct FirstImpact {
    pub(super) initial: Initial,
    pub(super) side: f64,
    pub(super) after: (f64, f64),
}

impl FirstImpact {
    pub(super) fn draw(draw: &mut Draw, set_up: &SetUp, drive: &Drive) -> Self {
        let particle = set_up.particle.expect("a particle is mounted");
        let Wall::Restitution { coefficient } = particle.wall else { panic!("the wall is hard") };
        let side = draw.side();
        let x_m = draw.maybe(-20e-3, 20e-3);
        // Includes rest, and exactly the speed of the base.
        let any = draw.between(-0.3, 0.3);
        let v = draw.one_of(&[0.0, drive.base(0.0).1, any, any]);
        let approach = draw.between(1e-3, 1.5);
        let u = v + side * approach;
        let (mass, light) = (set_up.structure.mass_kg, particle.mass_kg);
        let common = (mass * v + light * u) / (mass + light);
        let relative = -coefficient * (u - v);
        Self {
            initial: Initial { x_m, v_m_per_s: v, y_m: x_m + side * particle.clearance_m, u_m_per_s: u },
            side,
            after: (common - light / (mass + light) * relative, common + mass / (mass + light) * relative),
        }
    }
}

/// The motion after the impact in closed form until the next event: the state at `t`, and whether an event has
/// occurred.
pub(super) fn after_impact(set_up: &SetUp, drive: &Drive, first: &FirstImpact, t: f64) -> (Phase, bool) {
    let particle = set_up.particle.expect("a particle is mounted");
    let structure = &set_up.structure;
    let (v, u) = first.after;
    let pull = particle.friction_coefficient * set_up.gravity_m_per_s2;
    let along = (u - v).signum();
    let slip = v - drive.base(0.0).1;
    let resistance = set_up.friction_damper.map_or(0.0, |damper| damper.force_n) * slip.signum();
    let drag = along * particle.mass_kg * pull;
    let (x, vx) = oscillator(structure, structure.mass_kg, drive, drag - resistance, (first.initial.x_m, v), t);
    let y = first.initial.y_m + u * t - 0.5 * along * pull * t * t;
    let uy = u - along * pull * t;
    let slips_on = resistance == 0.0 || (vx - drive.base(t).1) * slip > 0.0;
    let slides_on = pull == 0.0 || (uy - vx) * along > 0.0;
    let apart = t == 0.0 || (y - x).abs() < particle.clearance_m;
    ([x, vx, y, uy], slips_on && slides_on && apart && t < drive.until_s)
}

/// The latest of several times up to `longest_s` until which `holds` is true at a thousand instants.
pub(super) fn undisturbed_s(longest_s: f64, holds: impl Fn(f64) -> bool) -> Option<f64> {
    let share = |n: u32| longest_s * f64::from(n) / 1000.0;
    let first = (1..=1000).find(|n| !holds(share(*n))).unwrap_or(1001);
    (first > 20).then(|| share(first - 10))
}

pub(super) fn close(found: &Phase, expected: &Phase, allowed: f64, turning: f64) -> bool {
    let scale = [1.0, turning, 1.0, turning];
    (0..4).all(|n| (found[n] - expected[n]).abs() <= allowed * scale[n])
}
