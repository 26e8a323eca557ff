//! A new case of a structure that is described by its modes.

use std::f64::consts::TAU;

/// A mode as it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenMode {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Displacement of each place for a modal mass of 1 kg, 1/√kg.
    pub shape_per_root_kg: Vec<f64>,
    /// Participation in a motion of the base, √kg, where it is known.
    pub participation_root_kg: Option<f64>,
}

/// The case: its modes (at least one, by rising frequency), a force at the first resonance where x is, for as long as a free vibration takes to decay to a hundredth, and a damper to
/// uncomment. `from` says where the modes are from.
#[must_use]
pub fn text(from: &str, places: &[String], modes: &[WrittenMode]) -> String {
    let names: Vec<String> = places.iter().map(|name| format!("{name:?}")).collect();
    let first = &modes[0];
    let decay_s = 100_f64.ln() / (first.damping_ratio.max(1e-3) * TAU * first.frequency_hz);
    let mut text = format!(
        "# The modes of {from}: mass-normalised shapes at {} places. A force at the first resonance; add dampers below.\n\nplaces = [{}]\n\
         observed_place = {}\nforce = {{ kind = \"sine\", amplitude_n = 1, frequency_hz = {:?} }}\nrun = {{ duration_s = {:?} }}\n",
        places.len(),
        names.join(", "),
        names[0],
        rounded(first.frequency_hz, 7),
        rounded(decay_s, 1)
    );
    for mode in modes {
        let shape: Vec<String> = mode.shape_per_root_kg.iter().map(|phi| format!("{:?}", rounded(*phi, 7))).collect();
        text += &format!(
            "\n[[mode]]\nfrequency_hz = {:?}\ndamping_ratio = {:?}\nshape_per_root_kg = [{}]\n",
            rounded(mode.frequency_hz, 7),
            rounded(mode.damping_ratio, 7),
            shape.join(", ")
        );
        if let Some(participation) = mode.participation_root_kg {
            text += &format!("participation_root_kg = {:?}\n", rounded(participation, 7));
        }
    }
    // Where the first mode moves most.
    let most = (0..names.len()).max_by(|a, b| {
        let [a, b] = [a, b].map(|place| first.shape_per_root_kg[*place].abs());
        a.total_cmp(&b)
    });
    let place = most.unwrap_or(0);
    text + &format!(
        "\n# [[particle]]\n# place = {}\n# mass_kg = {:?}                      # 5 % of the modal mass of the first mode there, 1/φ²\n\
         # clearance_m = 0.0002\n# wall = {{ kind = \"restitution\", coefficient = 0.5 }}\n",
        names[place],
        rounded(0.05 / first.shape_per_root_kg[place].powi(2), 2)
    )
}

/// With so many digits after the first one.
fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$e}").parse().unwrap_or(value)
}
