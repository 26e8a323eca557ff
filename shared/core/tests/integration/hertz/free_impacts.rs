//! Contacts against the closed forms of free impacts.

use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Arc, ContactEnd, Exact, Excitation, Impact, Observer};
use damprig_core::model::{Hertz, Initial, SetUp};

use super::{free, hunt_crossley, lankarani_nikravesh};

/// What a contact was.
#[derive(Clone, Copy, Debug, Default)]
struct Contact {
    touch_s: f64,
    approach_m_per_s: f64,
    duration_s: f64,
    force_n: f64,
    separation_m_per_s: f64,
    depth_m: f64,
    pieces: u32,
}

/// The first contact of a run.
#[derive(Default)]
pub struct First {
    contact: Contact,
    touched: bool,
    pub ended: bool,
    end_m: f64,
}

impl Observer for First {
    fn arc(&mut self, arc: &Arc<'_>) {
        if self.touched && !self.ended {
            self.contact.pieces += 1;
            let deepest = (0..=50).map(|n| arc.state(arc.length_s * f64::from(n) / 50.0));
            let deepest = deepest.map(|s| s.offset_m.abs() - self.end_m).fold(0.0, f64::max);
            self.contact.depth_m = self.contact.depth_m.max(deepest);
            // Where it turns, the deepest point is the root of the speed.
            if arc.start.slide_m_per_s * arc.end.slide_m_per_s < 0.0 {
                let (mut low, mut high) = (0.0, arc.length_s);
                for _ in 0..80 {
                    let middle = 0.5 * (low + high);
                    let same = arc.state(middle).slide_m_per_s * arc.start.slide_m_per_s > 0.0;
                    (low, high) = if same { (middle, high) } else { (low, middle) };
                }
                self.contact.depth_m = self.contact.depth_m.max(arc.state(low).offset_m.abs() - self.end_m);
            }
        }
    }

    fn impact(&mut self, impact: &Impact) {
        if !self.touched {
            (self.touched, self.end_m) = (true, impact.before.offset_m.abs());
            self.contact.touch_s = impact.time_s;
            self.contact.approach_m_per_s = impact.approach_speed_m_per_s;
        }
    }

    fn contact_end(&mut self, end: &ContactEnd) {
        if !self.ended {
            self.ended = true;
            let hertz = end.hertz.expect("a Hertz wall");
            self.contact.duration_s = hertz.duration_s;
            self.contact.force_n = hertz.peak_force_n;
            assert_eq!(
                (hertz.touch_s, hertz.approach_speed_m_per_s),
                (self.contact.touch_s, self.contact.approach_m_per_s)
            );
            self.contact.separation_m_per_s = end.separation_speed_m_per_s;
        }
    }

    fn goes_on(&mut self, _: f64) -> bool {
        !self.ended
    }
}

/// The first contact of a free particle of that speed, and its largest force, N.
fn impact(set_up: &SetUp, speed_m_per_s: f64) -> (Contact, f64) {
    // From the wall itself: the touch is at t = 0, so that the duration has no rounding of a late time.
    let initial = Initial {
        y_m: set_up.particle.expect("it has one").clearance_m,
        u_m_per_s: speed_m_per_s,
        ..Initial::default()
    };
    let mut motion = Exact::new(set_up, &Excitation::Fixed, &initial).expect("physical");
    let mut first = First::default();
    let mut response = Response::new(Wanted { whole_run: true, ..Wanted::default() });
    motion.run(1e3, &mut (&mut first, &mut response));
    assert!(first.ended, "{set_up:?}");
    assert_eq!(motion.unresolved(), 0);
    let force_n = response.peak_contact_force_n().expect("a contact");
    assert_eq!(first.contact.force_n, force_n);
    (first.contact, force_n)
}

/// ∫ dt of a free impact over δ′ = u from v to −e v, by tanh-sinh quadrature: dt = −(m/k) du/((1 + βu) δ^1.5).
fn duration_s(hertz: &Hertz, reduced_kg: f64, v: f64) -> f64 {
    let (k, b) = (hertz.stiffness_n_per_m15, hertz.rate_s_per_m(v));
    let separation = v * hertz.restitution(v);
    // G(u + c) − G(u) without cancellation: (x b u + x − ln(1 + x))/b² with x = b c/(1 + b u).
    let gained = |u: f64, c: f64| {
        if b == 0.0 {
            return c * u + 0.5 * c * c;
        }
        let x = b * c / (1.0 + b * u);
        let rest = if x.abs() > 0.05 {
            x - x.ln_1p()
        } else {
            (2..20).rev().fold(0.0, |sum, n| 1.0 / f64::from(n) - x * sum) * x * x
        };
        (x * b * u + rest) / (b * b)
    };
    let half = |from: f64, to: f64| {
        // Singular at `from`, where δ = 0; regular at 0.
        let length = to - from;
        let mut sum = 0.0;
        let step = 1.0 / 64.0;
        for n in -400..400 {
            let t = f64::from(n) * step;
            let s = core::f64::consts::FRAC_PI_2 * t.sinh();
            // Distance from `from` as a share: 1/(1 + exp(−2s)).
            let share = 1.0 / (1.0 + (-2.0 * s).exp());
            let weight = core::f64::consts::FRAC_PI_2 * t.cosh() / (2.0 * s.cosh().powi(2));
            let a = length * share;
            let u = from + a;
            if share == 0.0 || !weight.is_finite() || weight == 0.0 {
                continue;
            }
            let work = gained(u, -a);
            let depth15 = (2.5 * reduced_kg / k * work).powf(0.6);
            sum += step * weight * length.abs() * (reduced_kg / k) / ((1.0 + b * u) * depth15);
        }
        sum
    };
    half(v, 0.0) + half(-separation, 0.0)
}

#[test]
fn a_free_impact_has_duration_force_depth_and_restitution_of_the_closed_forms_over_five_decades() {
    let mut worst = [0.0_f64; 4];
    for decade in 0..=10 {
        let speed = 1e-3 * 10.0_f64.powf(0.5 * f64::from(decade));
        for (hertz, mass_kg) in [
            (hunt_crossley(1e9, 0.0), 0.16),
            (hunt_crossley(1e6, 0.3), 0.02),
            (hunt_crossley(1e10, 0.02), 0.4),
            (lankarani_nikravesh(1e9, 0.6), 0.16),
            (lankarani_nikravesh(1e7, 0.95), 0.3),
            (lankarani_nikravesh(1e8, 0.0), 0.1),
        ] {
            let set_up = free(hertz, mass_kg, 0.01);
            let (contact, force_n) = impact(&set_up, speed);
            let reduced_kg = mass_kg / (1.0 + mass_kg);
            let e = contact.separation_m_per_s / contact.approach_m_per_s;
            let offs = [
                // Where β v is large, 1 − β e v is below the rounding of its terms in the quadrature.
                if hertz.rate_s_per_m(speed) * speed > 15.0 {
                    0.0
                } else {
                    contact.duration_s / duration_s(&hertz, reduced_kg, speed) - 1.0
                },
                force_n / hertz.peak_force_n(reduced_kg, speed) - 1.0,
                contact.depth_m / hertz.peak_penetration_m(reduced_kg, speed) - 1.0,
                e - hertz.restitution(speed),
            ];
            println!(
                "{speed:.1e} {:?}: {:.1e} {:.1e} {:.1e} {:.1e} {} pieces e {e}",
                hertz.dissipation, offs[0], offs[1], offs[2], offs[3], contact.pieces
            );
            for (worst, off) in worst.iter_mut().zip(offs) {
                assert!(off.is_finite());
                *worst = worst.max(off.abs());
            }
        }
    }
    println!("at most: duration {:.1e}, force {:.1e}, depth {:.1e}, e {:.1e}", worst[0], worst[1], worst[2], worst[3]);
    assert!(worst.iter().all(|off| *off < 1e-9), "{worst:?}");
    let hertz = hunt_crossley(1e9, 0.0);
    let off = duration_s(&hertz, 0.1, 0.3) / hertz.elastic_duration_s(0.1, 0.3) - 1.0;
    assert!(off.abs() < 1e-12, "the quadrature itself: {off:e}");
}
