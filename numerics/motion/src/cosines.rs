//! Sums of many cosines at evenly spaced instants.

/// A cosine cos(φ + nψ) of sample n, and what turns it from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cosine {
    /// cos φ and sin φ.
    pub phase: [f64; 2],
    /// cos ψ and sin ψ.
    pub turn: [f64; 2],
}

/// Cosines that turn side by side.
const SIDE_BY_SIDE: usize = 8;

/// Adds the cosines to each sample, in their order, by rotation: the error of each grows by one rounding a sample.
pub fn add_cosines(samples: &mut [f64], cosines: &[Cosine]) {
    let (several, rest) = cosines.as_chunks::<SIDE_BY_SIDE>();
    several.iter().for_each(|some| add(samples, some));
    rest.iter().for_each(|one| add(samples, &[*one]));
}

fn add<const N: usize>(samples: &mut [f64], cosines: &[Cosine; N]) {
    let (mut now, turn) = (cosines.map(|of| of.phase), cosines.map(|of| of.turn));
    for sample in samples {
        for ([cosine, sine], [turn_cosine, turn_sine]) in now.iter_mut().zip(&turn) {
            *sample += *cosine;
            (*cosine, *sine) = (*cosine * turn_cosine - *sine * turn_sine, *sine * turn_cosine + *cosine * turn_sine);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sample_is_the_sum_of_the_cosines_in_their_order() {
        let angles: Vec<(f64, f64)> = (0..19).map(|k| (0.7 * f64::from(k), 0.01 * f64::from(k + 1))).collect();
        let cosines: Vec<Cosine> = angles
            .iter()
            .map(|(phase, step)| Cosine { phase: [phase.cos(), phase.sin()], turn: [step.cos(), step.sin()] })
            .collect();
        let mut samples = vec![0.0; 500];
        add_cosines(&mut samples, &cosines);
        let mut one_by_one = vec![0.0; 500];
        cosines.iter().for_each(|cosine| add_cosines(&mut one_by_one, &[*cosine]));
        assert_eq!(samples, one_by_one);
        for (n, sample) in samples.iter().enumerate() {
            let sum: f64 = angles.iter().map(|(phase, step)| (phase + step * n as f64).cos()).sum();
            // A rounding a sample of each cosine.
            assert!((sample - sum).abs() < 19.0 * 500.0 * f64::EPSILON, "{n}: {sample} {sum}");
        }
    }
}
