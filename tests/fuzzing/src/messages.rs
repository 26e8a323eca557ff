//! Generates message bodies from the protocol's schema: every message and every variant within one, including later
//! additions to the protocol.

use std::collections::BTreeSet;

use postcard_schema::Schema;
use postcard_schema::schema::{DataModelType, DataModelVariant, NamedType, NamedValue};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Messages tried to find one that makes a choice not made before.
const TRIES: u32 = 20_000;

/// A choice: the name of the type, its number of variants, and the index of one of them.
type Choice = (&'static str, usize, usize);

/// Bodies of messages of a type that together make every choice of the type and of the types in it.
#[must_use]
pub fn every_choice<T: Schema>() -> Vec<Vec<u8>> {
    gather::<T>().0
}

fn gather<T: Schema>() -> (Vec<Vec<u8>>, BTreeSet<Choice>) {
    let mut seen = BTreeSet::new();
    let mut bodies = Vec::new();
    let mut random = StdRng::seed_from_u64(1);
    for _ in 0..TRIES {
        let mut message = Message { random: &mut random, body: Vec::new(), choices: BTreeSet::new() };
        message.value(T::SCHEMA);
        let Message { body, choices, .. } = message;
        if !choices.is_subset(&seen) {
            seen.extend(choices);
            bodies.push(body);
        }
    }
    (bodies, seen)
}

struct Message<'r> {
    random: &'r mut StdRng,
    body: Vec<u8>,
    choices: BTreeSet<Choice>,
}

impl Message<'_> {
    fn value(&mut self, named: &'static NamedType) {
        match named.ty {
            DataModelType::Bool => {
                let yes = self.random.random_range(0..2);
                self.body.push(yes);
            }
            DataModelType::I8 | DataModelType::U8 => {
                let byte = self.number() as u8;
                self.body.push(byte);
            }
            DataModelType::I16 | DataModelType::U16 => self.varint(u64::from(u16::MAX)),
            DataModelType::I32 | DataModelType::U32 => self.varint(u64::from(u32::MAX)),
            DataModelType::F32 => {
                let value = self.real() as f32;
                self.body.extend(value.to_le_bytes());
            }
            DataModelType::F64 => {
                let value = self.real();
                self.body.extend(value.to_le_bytes());
            }
            DataModelType::String | DataModelType::ByteArray => {
                let length = self.random.random_range(0..4);
                self.body.push(length);
                self.body.extend(std::iter::repeat_n(b'a', usize::from(length)));
            }
            DataModelType::Option(inner) => {
                let some = self.random.random_range(0..2);
                self.choices.insert((inner.name, 0, some));
                self.body.push(some as u8);
                if some == 1 {
                    self.value(inner);
                }
            }
            DataModelType::Seq(inner) => {
                let length = self.random.random_range(0..4);
                self.body.push(length);
                (0..length).for_each(|_| self.value(inner));
            }
            DataModelType::NewtypeStruct(inner) => self.value(inner),
            DataModelType::Tuple(list) | DataModelType::TupleStruct(list) => list.iter().for_each(|t| self.value(t)),
            DataModelType::Struct(fields) => self.fields(fields),
            DataModelType::Enum(variants) => {
                let place = self.random.random_range(0..variants.len());
                self.choices.insert((named.name, variants.len(), place));
                // Fewer than 128 variants: one byte.
                self.body.push(place as u8);
                match variants[place].ty {
                    DataModelVariant::UnitVariant => {}
                    DataModelVariant::NewtypeVariant(inner) => self.value(inner),
                    DataModelVariant::TupleVariant(list) => list.iter().for_each(|t| self.value(t)),
                    DataModelVariant::StructVariant(fields) => self.fields(fields),
                }
            }
            DataModelType::Unit | DataModelType::UnitStruct => {}
            // Wider integers, maps and schemas do not occur on the link. A test fails if they are added.
            _ => self.varint(u64::MAX),
        }
    }

    fn fields(&mut self, fields: &'static [&'static NamedValue]) {
        fields.iter().for_each(|field| self.value(field.ty));
    }

    /// Mostly small numbers: indices, counts and ends of ranges are where the code branches.
    fn number(&mut self) -> u64 {
        match self.random.random_range(0..4) {
            0 => 0,
            1 => self.random.random_range(1..20),
            2 => self.random.random_range(0..2000),
            _ => self.random.random(),
        }
    }

    fn varint(&mut self, most: u64) {
        let mut rest = self.number() & most;
        while rest > 127 {
            self.body.push(rest as u8 | 0x80);
            rest >>= 7;
        }
        self.body.push(rest as u8);
    }

    fn real(&mut self) -> f64 {
        const SPECIAL: [f64; 6] = [0.0, -0.0, f64::NAN, f64::INFINITY, -1.0, f64::MIN_POSITIVE];
        match self.random.random_range(0..4) {
            0 => SPECIAL[self.random.random_range(0..SPECIAL.len())],
            1 => 10.0_f64.powi(self.random.random_range(-6..4)),
            _ => self.random.random_range(0.0..10.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use damprig_protocol::{FromDevice, ToDevice};
    use serde::de::DeserializeOwned;

    /// Adds all choices within a type.
    fn all(named: &'static NamedType, choices: &mut BTreeSet<Choice>) {
        match named.ty {
            DataModelType::Option(inner) => {
                choices.extend([(inner.name, 0, 0), (inner.name, 0, 1)]);
                all(inner, choices);
            }
            DataModelType::NewtypeStruct(inner) | DataModelType::Seq(inner) => all(inner, choices),
            DataModelType::Tuple(list) | DataModelType::TupleStruct(list) => {
                list.iter().for_each(|t| all(t, choices));
            }
            DataModelType::Struct(fields) => fields.iter().for_each(|f| all(f.ty, choices)),
            DataModelType::Enum(variants) => {
                for (place, variant) in variants.iter().enumerate() {
                    choices.insert((named.name, variants.len(), place));
                    match variant.ty {
                        DataModelVariant::UnitVariant => {}
                        DataModelVariant::NewtypeVariant(inner) => all(inner, choices),
                        DataModelVariant::TupleVariant(list) => list.iter().for_each(|t| all(t, choices)),
                        DataModelVariant::StructVariant(fields) => fields.iter().for_each(|f| all(f.ty, choices)),
                    }
                }
            }
            _ => {}
        }
    }

    fn check<T: Schema + DeserializeOwned>() {
        let (bodies, made) = gather::<T>();
        for body in &bodies {
            assert!(matches!(postcard::take_from_bytes::<T>(body), Ok((_, []))), "{body:?}");
        }
        let mut choices = BTreeSet::new();
        all(T::SCHEMA, &mut choices);
        let left: Vec<&Choice> = choices.difference(&made).collect();
        assert!(choices.len() > 20 && left.is_empty(), "of {} choices, these were not made: {left:?}", choices.len());
    }

    #[test]
    fn the_bodies_make_every_choice_of_the_protocol_and_decode() {
        check::<ToDevice>();
        check::<FromDevice>();
    }
}
