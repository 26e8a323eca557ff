//! Floating-point numbers in the journal: they read back to the same bits; NaN and the infinities, which JSON lacks, are
//! strings.

use serde::{Deserialize, Deserializer, Serializer};

/// A floating-point type of the journal.
pub(super) trait Real: Copy {
    /// Exactly, in double precision.
    fn wide(self) -> f64;
    /// The inverse of [`Real::wide`].
    fn narrow(wide: f64) -> Self;
}

impl Real for f64 {
    fn wide(self) -> f64 {
        self
    }

    fn narrow(wide: f64) -> Self {
        wide
    }
}

impl Real for f32 {
    // The shortest text of the `f32` would be rounded twice when read in double precision.
    fn wide(self) -> f64 {
        f64::from(self)
    }

    fn narrow(wide: f64) -> Self {
        wide as f32
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Written {
    Number(f64),
    Word(String),
}

pub(super) fn serialize<N: Real, S: Serializer>(value: &N, serializer: S) -> Result<S::Ok, S::Error> {
    let wide = value.wide();
    if wide.is_finite() { serializer.serialize_f64(wide) } else { serializer.serialize_str(&wide.to_string()) }
}

pub(super) fn deserialize<'de, N: Real, D: Deserializer<'de>>(deserializer: D) -> Result<N, D::Error> {
    match Written::deserialize(deserializer)? {
        Written::Number(wide) => Ok(N::narrow(wide)),
        Written::Word(word) => word.parse().map(N::narrow).map_err(serde::de::Error::custom),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Serialize;

    #[derive(Serialize, Deserialize)]
    struct Single(#[serde(with = "super")] f32);

    #[test]
    fn every_kind_of_number_reads_back_to_the_same_bits() {
        let mut bits = 1_u32;
        let random = std::iter::repeat_with(|| {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f32::from_bits(bits)
        });
        let special = [0.0, -0.0, f32::MIN_POSITIVE / 2.0, f32::MAX, f32::INFINITY, f32::NEG_INFINITY];
        for value in special.into_iter().chain(random.take(20_000)) {
            let text = serde_json::to_string(&Single(value)).unwrap();
            let back: Single = serde_json::from_str(&text).unwrap();
            let same = back.0.to_bits() == value.to_bits() || (back.0.is_nan() && value.is_nan());
            assert!(same, "{value:e} became {text}");
        }
    }
}
