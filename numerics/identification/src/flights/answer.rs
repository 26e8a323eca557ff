//! The estimates of the flights, and what a person has to know about them.

use super::estimate::Flights;
use crate::Estimate;

const METHOD: &str = "flights of the particle and jumps of x'";

impl Flights {
    /// The estimates: those of set-up keys first. Gravity makes a coefficient of the friction.
    #[must_use]
    pub fn estimates(&self, gravity_m_per_s2: f64) -> Vec<Estimate> {
        let mut all = vec![
            Estimate::new("coefficient of restitution", "", METHOD, &self.restitution)
                .of_key("particle.wall.coefficient"),
        ];
        all.extend(
            self.clearance_m
                .as_ref()
                .map(|clearance| Estimate::new("clearance", "m", METHOD, clearance).of_key("particle.clearance_m")),
        );
        if let Some(friction) = self.friction_m_per_s2.filter(|_| gravity_m_per_s2 > 0.0) {
            let coefficient = friction.mapped(friction.value / gravity_m_per_s2, 1.0 / gravity_m_per_s2);
            let key = Some("particle.friction_coefficient");
            all.push(Estimate::not_negative("friction coefficient of the particle", "", METHOD, &coefficient, key));
        }
        all.extend(
            self.contact_s
                .as_ref()
                .map(|contact| Estimate::new("contact time", "s", "half sines of the pulses", contact)),
        );
        all
    }

    /// What a person has to know about them. `stated_m` is the clearance of the set-up.
    #[must_use]
    pub fn remarks(&self, stated_m: f64, was_held: bool) -> Vec<String> {
        let left_out: usize = self.left_out.values().sum();
        let mut remarks = vec![format!(
            "{} of {} impacts are used, with approach velocities of {:.3} m/s to {:.3} m/s: restitution depends on them",
            self.used,
            self.used + left_out,
            self.approach_m_per_s[0],
            self.approach_m_per_s[1]
        )];
        remarks.extend(self.left_out.iter().map(|(reason, count)| format!("left out: {count} {}", reason.words())));
        match &self.clearance_m {
            Some(clearance) => remarks.push(format!(
                "the set-up states a clearance of {:.3} mm; the fitted one is {:+.2} % from it. A mass ratio that is 1 % higher changes d \
                 by {:+.2} % and e by {:+.2} %",
                stated_m * 1e3,
                100.0 * (clearance.value / stated_m - 1.0),
                self.by_mass_ratio[1],
                self.by_mass_ratio[0]
            )),
            None if was_held => remarks.push(format!("the clearance is held at {:.3} mm", self.used_clearance_m * 1e3)),
            None => remarks.push(format!(
                "the clearance cannot be told from this record; that of the set-up, {:.3} mm, is used. Its error changes e: measure \
                 more impacts",
                self.used_clearance_m * 1e3
            )),
        }
        remarks.push(format!(
            "the kinks of x are {:.3} ms after the centres of the pulses, and the fit leaves {:.2} µm RMS",
            self.late_s.value * 1e3,
            self.residual_rms_m * 1e6
        ));
        remarks
    }
}
