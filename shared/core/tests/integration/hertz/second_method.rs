//! Contacts under every smooth force against an adaptive Runge–Kutta method.

use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::{Hertz, Initial, SetUp};
use differential_equations::prelude::{ExplicitRungeKutta, IVP, ODE};

use crate::draw::Draw;

/// A contact with every smooth force, in units of its own duration and depth: x, x′, δ, δ′.
struct Scaled<'a> {
    set_up: &'a SetUp,
    hertz: Hertz,
    rate_s_per_m: f64,
    base: (f64, f64, f64),
    duration_s: f64,
    depth_m: f64,
}

impl ODE<f64, [f64; 4]> for Scaled<'_> {
    fn diff(&self, t: f64, s: &[f64; 4], rate: &mut [f64; 4]) {
        let (structure, particle) = (&self.set_up.structure, self.set_up.particle.expect("it has one"));
        let (amplitude_m, turning, phase) = self.base;
        let speed = self.depth_m / self.duration_s;
        let (sine, cosine) = (turning * t * self.duration_s + phase).sin_cos();
        let stretch = s[0] * self.depth_m - amplitude_m * sine;
        let slip = s[1] * speed - amplitude_m * turning * cosine;
        let depth_m = s[2].max(0.0) * self.depth_m;
        let push =
            self.hertz.stiffness_n_per_m15 * depth_m.powf(1.5) * (1.0 + self.rate_s_per_m * s[3] * speed).max(0.0);
        let x = (push - structure.stiffness_n_per_m * stretch - structure.damping_n_s_per_m * slip) / structure.mass_kg;
        let y = -push / particle.mass_kg - self.set_up.weight_m_per_s2();
        let per = self.duration_s / speed;
        *rate = [s[1], x * per, s[3], (y - x) * per];
    }
}

#[test]
fn a_contact_under_every_smooth_force_agrees_with_a_second_method() {
    let mut draw = Draw::new(34);
    let mut worst = 0.0_f64;
    for _ in 0..60 {
        let mut set_up = draw.set_up(Draw::hertz_wall);
        set_up.friction_damper = None;
        let particle = set_up.particle.as_mut().expect("it has one");
        (particle.friction_coefficient, particle.cavity.inclination_deg) = (0.0, draw.between(-90.0, 90.0));
        // The other wall is out of reach.
        particle.clearance_m = 1.0;
        let particle = *particle;
        let hertz = particle.wall.hertz().expect("drawn");
        let (approach, x_m, v) = (draw.between(0.02, 2.0), draw.between(-5e-3, 5e-3), draw.between(-0.2, 0.2));
        let initial = Initial { x_m, v_m_per_s: v, y_m: x_m + particle.clearance_m, u_m_per_s: v + approach };
        let sine = draw.sine(&set_up);
        let Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad } = sine else { unreachable!() };
        let reduced_kg = particle.mass_kg * set_up.structure.mass_kg / (particle.mass_kg + set_up.structure.mass_kg);
        let scaled = Scaled {
            set_up: &set_up,
            hertz,
            rate_s_per_m: hertz.rate_s_per_m(approach),
            base: (amplitude_m, angular_frequency_rad_per_s, phase_rad),
            duration_s: hertz.elastic_duration_s(reduced_kg, approach),
            depth_m: hertz.peak_penetration_m(reduced_kg, approach),
        };
        let speed = scaled.depth_m / scaled.duration_s;
        // While it presses, near its end, and in most cases behind it.
        for share in [0.1, 0.4, 0.8, 1.3] {
            let mut motion = Exact::new(&set_up, &sine, &initial).expect("physical");
            motion.run(share * scaled.duration_s, &mut ());
            let method = ExplicitRungeKutta::dop853().rtol(1e-13).atol(1e-14);
            let start = [x_m / scaled.depth_m, v / speed, 0.0, approach / speed];
            let solution = IVP::ode(&scaled, 0.0, share, start).method(method).solve().expect("it ends");
            let other = *solution.last().expect("a point").1;
            let state = motion.state();
            // The largest of x and x′ is that of the motion of the structure, not of the contact.
            let offs = [
                (state.x_m / scaled.depth_m - other[0]) / (1.0 + other[0].abs()),
                (state.v_m_per_s / speed - other[1]) / (approach / speed + other[1].abs()),
                (state.offset_m - particle.clearance_m) / scaled.depth_m - other[2],
                (state.slide_m_per_s / speed - other[3]) * speed / approach,
            ];
            for off in offs {
                // y − x has a rounding of the clearance.
                let rounding = 16.0 * f64::EPSILON * particle.clearance_m / scaled.depth_m;
                assert!(off.abs() < 1e-9 + rounding, "{share}: {offs:?} {set_up:?}");
                worst = worst.max(off.abs() - rounding);
            }
        }
    }
    println!("largest difference {worst:.1e} of the contact");
}
