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

/// A message of a type, at random.
#[must_use]
pub fn any<T: Schema>(random: &mut StdRng) -> Vec<u8> {
    let mut message = Message { random, body: Vec::new(), choices: BTreeSet::new() };
    message.value(T::SCHEMA);
    message.body
}

/// `body`, a message of type `T`, with one of its values replaced by another of its type: a number by a neighbour, an extreme
/// or any other, a variant by any, a list by a shorter or longer one.
#[must_use]
pub fn altered<T: Schema>(body: &[u8], random: &mut StdRng) -> Vec<u8> {
    let mut count = Copy { rest: body, body: Vec::new(), values: 0, altered: None, random };
    count.value(T::SCHEMA);
    let altered = Some(count.random.random_range(0..count.values.max(1)));
    let mut copy = Copy { rest: body, body: Vec::new(), values: 0, altered, random: count.random };
    copy.value(T::SCHEMA);
    copy.body
}

/// Copies a message value by value; a message that does not fit its type is copied as far as it goes.
struct Copy<'r> {
    rest: &'r [u8],
    body: Vec<u8>,
    /// Values copied so far.
    values: usize,
    /// The value to replace.
    altered: Option<usize>,
    random: &'r mut StdRng,
}

impl Copy<'_> {
    /// Whether the next value is the one to replace.
    fn is_altered(&mut self) -> bool {
        self.values += 1;
        self.altered == Some(self.values - 1)
    }

    fn take(&mut self, length: usize) -> &[u8] {
        let (taken, rest) = self.rest.split_at(length.min(self.rest.len()));
        self.rest = rest;
        taken
    }

    fn bytes(&mut self, length: usize) {
        let taken = self.take(length).to_vec();
        self.body.extend(taken);
    }

    fn take_number(&mut self) -> u64 {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.take(1).first().copied().unwrap_or(0);
            number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                break;
            }
        }
        number
    }

    fn put_number(&mut self, number: u64) {
        let mut rest = number;
        while rest > 127 {
            self.body.push(rest as u8 | 0x80);
            rest >>= 7;
        }
        self.body.push(rest as u8);
    }

    fn other(&mut self, number: u64, most: u64) -> u64 {
        match self.random.random_range(0..6) {
            0 => number.wrapping_add(1) & most,
            1 => number.wrapping_sub(1) & most,
            2 => most - self.random.random_range(0..2),
            3 => 0,
            4 => self.random.random_range(0..300) & most,
            _ => self.random.random::<u64>() & most,
        }
    }

    fn number(&mut self, most: u64) {
        let mut number = self.take_number();
        if self.is_altered() {
            number = self.other(number, most);
        }
        self.put_number(number);
    }

    fn real(&mut self, length: usize) {
        const SPECIAL: [f64; 8] =
            [0.0, -0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, f64::MIN_POSITIVE, f64::MAX];
        if !self.is_altered() {
            return self.bytes(length);
        }
        self.take(length);
        let value = match self.random.random_range(0..3) {
            0 => 10.0_f64.powi(self.random.random_range(-9..9)),
            _ => SPECIAL[self.random.random_range(0..SPECIAL.len())],
        };
        if length == 4 { self.body.extend((value as f32).to_le_bytes()) } else { self.body.extend(value.to_le_bytes()) }
    }

    /// Puts any value of a type in place of the next one.
    fn replace(&mut self, named: &'static NamedType) {
        let kept = std::mem::take(&mut self.body);
        let altered = self.altered.take();
        self.plain(named);
        self.altered = altered;
        self.body = kept;
        let mut message = Message { random: self.random, body: Vec::new(), choices: BTreeSet::new() };
        message.value(named);
        self.body.extend(message.body);
    }

    fn value(&mut self, named: &'static NamedType) {
        let has_variants = matches!(named.ty, DataModelType::Enum(_) | DataModelType::Option(_));
        if has_variants && self.is_altered() { self.replace(named) } else { self.plain(named) }
    }

    fn plain(&mut self, named: &'static NamedType) {
        match named.ty {
            DataModelType::Bool | DataModelType::I8 | DataModelType::U8 => {
                let mut byte = self.take(1).first().copied().unwrap_or(0);
                if self.is_altered() {
                    let most = if matches!(named.ty, DataModelType::Bool) { 1 } else { 255 };
                    byte = self.other(u64::from(byte), most) as u8;
                }
                self.body.push(byte);
            }
            DataModelType::I16 | DataModelType::U16 => self.number(u64::from(u16::MAX)),
            DataModelType::I32 | DataModelType::U32 => self.number(u64::from(u32::MAX)),
            DataModelType::F32 => self.real(4),
            DataModelType::F64 => self.real(8),
            DataModelType::String | DataModelType::ByteArray => {
                let length = self.take_number();
                let mut text = self.take(length as usize).to_vec();
                if self.is_altered() {
                    const OTHER: [&[u8]; 5] = [b"", b"\x1b[31m", b"../x", b"\0", b"\xff"];
                    text = OTHER[self.random.random_range(0..OTHER.len())].to_vec();
                }
                self.put_number(text.len() as u64);
                self.body.extend(text);
            }
            DataModelType::Option(inner) => {
                let tag = self.take(1).first().copied().unwrap_or(0);
                self.body.push(tag);
                if tag == 1 {
                    self.value(inner);
                }
            }
            DataModelType::Seq(inner) => {
                let length = self.take_number().min(self.rest.len() as u64);
                let change = if self.is_altered() { self.random.random_range(0..3) } else { 3 };
                let kept = if change == 0 { length.saturating_sub(1) } else { length };
                let more = if change == 1 { self.random.random_range(1..4) } else { 0 };
                // A length that lies is the third change.
                self.put_number(kept + more + u64::from(change == 2));
                for n in 0..length {
                    let end = self.body.len();
                    self.value(inner);
                    if n >= kept {
                        self.body.truncate(end);
                    }
                }
                for _ in 0..more {
                    let mut message = Message { random: self.random, body: Vec::new(), choices: BTreeSet::new() };
                    message.value(inner);
                    self.body.extend(message.body);
                }
            }
            DataModelType::NewtypeStruct(inner) => self.value(inner),
            DataModelType::Tuple(list) | DataModelType::TupleStruct(list) => list.iter().for_each(|t| self.value(t)),
            DataModelType::Struct(fields) => fields.iter().for_each(|field| self.value(field.ty)),
            DataModelType::Enum(variants) => {
                let place = self.take_number();
                self.put_number(place);
                match variants.get(place as usize).map(|variant| variant.ty) {
                    None | Some(DataModelVariant::UnitVariant) => {}
                    Some(DataModelVariant::NewtypeVariant(inner)) => self.value(inner),
                    Some(DataModelVariant::TupleVariant(list)) => list.iter().for_each(|t| self.value(t)),
                    Some(DataModelVariant::StructVariant(fields)) => fields.iter().for_each(|f| self.value(f.ty)),
                }
            }
            DataModelType::Unit | DataModelType::UnitStruct => {}
            _ => self.number(u64::MAX),
        }
    }
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
    fn an_altered_message_differs_and_most_are_messages_again() {
        let mut random = StdRng::seed_from_u64(3);
        let bodies = every_choice::<FromDevice>();
        let (mut altered_ones, mut messages) = (0, 0);
        for n in 0..4000 {
            let body = &bodies[n % bodies.len()];
            let other = altered::<FromDevice>(body, &mut random);
            altered_ones += usize::from(other != *body);
            messages += usize::from(matches!(postcard::take_from_bytes::<FromDevice>(&other), Ok((_, []))));
        }
        assert!(altered_ones > 3000 && messages > 3000, "{altered_ones} altered, {messages} messages");
    }

    #[test]
    fn the_bodies_make_every_choice_of_the_protocol_and_decode() {
        check::<ToDevice>();
        check::<FromDevice>();
    }
}
