//! `docs/PROTOCOL.md`: the layout of every message, and vectors for a client in another language. Layout and vectors are written
//! here from the schema of the messages alone, by a second encoder; the shipped decoder must agree with them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use damprig_protocol::{FromDevice, ToDevice, frame};
use postcard_schema::Schema;
use postcard_schema::schema::{DataModelType, DataModelVariant, NamedType, NamedValue, NamedVariant};
use serde::Serialize;
use serde::de::DeserializeOwned;
use syn::{Attribute, Expr, Fields, Item, Lit, Meta};

const PAGE: &str = "docs/PROTOCOL.md";

/// The generated part of the page begins after this line.
const GENERATED: &str = "<!-- From here on the page is written by tests/protocol_page.rs. -->\n";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn page() -> String {
    std::fs::read_to_string(root().join(PAGE)).expect("the page of the protocol")
}

#[test]
fn the_page_of_the_protocol_has_every_message_as_it_is() {
    let page = page();
    let (by_hand, _) = page.split_once(GENERATED).expect("the line after which the page is generated");
    let expected = format!("{by_hand}{GENERATED}{}", generated());
    if page != expected {
        let path = root().join("target/PROTOCOL.md");
        std::fs::write(&path, expected).unwrap();
        panic!("{PAGE} is out of date; the present one was written: cp target/PROTOCOL.md {PAGE}");
    }
}

#[test]
fn every_vector_of_the_page_is_decoded_and_encoded_to_the_same_bytes() {
    let page = page();
    let mut vectors = 0;
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        let Some(name) = line.strip_prefix("message ") else { continue };
        let mut bytes = |label: &str| {
            let line = lines.next().unwrap_or_default();
            let hex = line.strip_prefix(label).unwrap_or_else(|| panic!("{name}: no line `{label}`"));
            hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect::<Vec<u8>>()
        };
        let (body, frame) = (bytes("body "), bytes("frame "));
        match name.split_once(' ').map(|(kind, _)| kind) {
            Some("ToDevice") => check::<ToDevice>(name, &body, &frame),
            Some("FromDevice") => check::<FromDevice>(name, &body, &frame),
            _ => panic!("{name}: neither to nor from the device"),
        }
        vectors += 1;
    }
    assert!(vectors > 60, "only {vectors} vectors");
}

fn check<T: Serialize + DeserializeOwned + Schema>(name: &str, body: &[u8], expected: &[u8]) {
    let mut reader = frame::Reader::default();
    let read: Vec<_> = expected.iter().filter_map(|byte| reader.push::<T>(*byte)).collect();
    let [Ok(message)] = read.as_slice() else { panic!("{name}: the frame holds no single message") };
    let mut out = [0; frame::LONGEST];
    let length = frame::encode(message, &mut out).unwrap();
    assert_eq!(out[..length], *expected, "{name}");
    let length = frame::wrap(body, &mut out).unwrap();
    assert_eq!(out[..length], *expected, "{name}: the body is not in the frame");
}

// --- The generated part.

fn generated() -> String {
    let docs = Docs::read();
    let mut types = Vec::new();
    for top in [ToDevice::SCHEMA, FromDevice::SCHEMA] {
        collect(top, &mut types);
    }
    let mut text = String::from("\n## Layouts\n");
    for named in &types {
        layout(named, &docs, &mut text);
    }
    text.push_str("\n## Vectors\n```text\n");
    for top in [ToDevice::SCHEMA, FromDevice::SCHEMA] {
        vectors(top, &mut text);
    }
    text.push_str("```\n");
    text
}

/// Structs and enums in the order in which they are met, each once.
fn collect<'a>(named: &'a NamedType, types: &mut Vec<&'a NamedType>) {
    let fields: Vec<&NamedType> = match named.ty {
        DataModelType::Struct(fields) => fields.iter().map(|field| field.ty).collect(),
        DataModelType::Enum(variants) => variants.iter().flat_map(|variant| payload(variant)).collect(),
        DataModelType::NewtypeStruct(inner) | DataModelType::Option(inner) | DataModelType::Seq(inner) => vec![inner],
        DataModelType::Tuple(items) | DataModelType::TupleStruct(items) => items.to_vec(),
        _ => Vec::new(),
    };
    let is_own = matches!(named.ty, DataModelType::Struct(_) | DataModelType::Enum(_)) && !is_result(named);
    if is_own {
        if let Some(known) = types.iter().find(|known| known.name == named.name) {
            assert_eq!(*known, named, "two types have one name");
            return;
        }
        types.push(named);
    }
    fields.into_iter().for_each(|field| collect(field, types));
}

/// Rust's own enum has no section: `Ok` and `Err` are a rule of the encoding.
fn is_result(named: &NamedType) -> bool {
    named.name.starts_with("Result<")
}

fn payload(variant: &NamedVariant) -> Vec<&NamedType> {
    match variant.ty {
        DataModelVariant::UnitVariant => Vec::new(),
        DataModelVariant::NewtypeVariant(inner) => vec![inner],
        DataModelVariant::TupleVariant(items) => items.to_vec(),
        DataModelVariant::StructVariant(fields) => fields.iter().map(|field| field.ty).collect(),
    }
}

fn layout(named: &NamedType, docs: &Docs, text: &mut String) {
    let name = named.name;
    write!(text, "\n### {name}\n{}\n\n", docs.of(name, None, None)).unwrap();
    match named.ty {
        DataModelType::Struct(fields) => {
            text.push_str("| field | type | meaning |\n|---|---|---|\n");
            for field in *fields {
                let meaning = docs.of(name, None, Some(field.name));
                writeln!(text, "| `{}` | {} | {meaning} |", field.name, type_text(field.ty)).unwrap();
            }
        }
        DataModelType::Enum(variants) => {
            text.push_str("| number | variant | fields | meaning |\n|---|---|---|---|\n");
            for (number, variant) in variants.iter().enumerate() {
                let meaning = docs.of(name, Some(variant.name), None);
                let fields = fields_text(name, variant, docs);
                writeln!(text, "| {number} | `{}` | {fields} | {meaning} |", variant.name).unwrap();
            }
        }
        _ => unreachable!("only structs and enums are collected"),
    }
}

fn fields_text(name: &str, variant: &NamedVariant, docs: &Docs) -> String {
    let DataModelVariant::StructVariant(fields) = variant.ty else {
        return payload(variant).into_iter().map(type_text).collect::<Vec<_>>().join(", ");
    };
    let one = |field: &&NamedValue| {
        let meaning = docs.of(name, Some(variant.name), Some(field.name));
        format!("`{}` {}: {meaning}", field.name, type_text(field.ty))
    };
    fields.iter().map(one).collect::<Vec<_>>().join("<br>")
}

fn type_text(named: &NamedType) -> String {
    match named.ty {
        DataModelType::Struct(_) => format!("[{0}](#{1})", named.name, named.name.to_lowercase()),
        DataModelType::Enum(variants) if is_result(named) => {
            let both: Vec<String> = variants.iter().flat_map(|v| payload(v)).map(type_text).collect();
            format!("result of {}", both.join(" or "))
        }
        DataModelType::Enum(_) => format!("[{0}](#{1})", named.name, named.name.to_lowercase()),
        DataModelType::NewtypeStruct(inner) => type_text(inner),
        DataModelType::Option(inner) => format!("option of {}", type_text(inner)),
        DataModelType::Seq(inner) => format!("list of {}", type_text(inner)),
        DataModelType::ByteArray => "list of u8".into(),
        DataModelType::Tuple(items) | DataModelType::TupleStruct(items) => match items {
            [first, rest @ ..] if rest.iter().all(|item| item == first) => {
                format!("{} × {}", items.len(), type_text(first))
            }
            _ => items.iter().map(|item| type_text(item)).collect::<Vec<_>>().join(" then "),
        },
        other => format!("{other:?}").to_lowercase(),
    }
}

// --- Meanings, from the sources' doc comments.

/// What core's macro of calibration records writes, which no reader of sources finds.
const RECORDS: [(&str, &str, &str); 3] = [
    ("LengthRecord", "The calibration of a displacement.", "residual_m"),
    ("ForceRecord", "The calibration of a force.", "residual_n"),
    ("ImpulseRecord", "The calibration of impulses.", "residual_n_s"),
];

/// Doc comments by type, variant and field.
struct Docs(BTreeMap<(String, String, String), String>);

impl Docs {
    fn read() -> Self {
        let mut docs = Self(BTreeMap::new());
        for folder in ["shared/protocol/src", "shared/core/src"] {
            docs.read_folder(&root().join(folder));
        }
        for (name, meaning, residual) in RECORDS {
            let own = [
                ("", meaning),
                ("date_days", "Day of the calibration, whole days since 1970-01-01; 0 for never."),
                ("valid_days", "Days for which it is valid; 0 for ever."),
                (residual, "RMS residual of the fit."),
            ];
            for (field, meaning) in own {
                docs.0.insert((name.into(), String::new(), field.into()), meaning.into());
            }
        }
        docs
    }

    fn read_folder(&mut self, folder: &Path) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                self.read_folder(&path);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                let file = syn::parse_file(&std::fs::read_to_string(&path).unwrap()).unwrap();
                file.items.iter().for_each(|item| self.read_item(item));
            }
        }
    }

    fn read_item(&mut self, item: &Item) {
        match item {
            Item::Struct(item) => {
                self.add(&item.ident.to_string(), "", "", &item.attrs);
                self.read_fields(&item.ident.to_string(), "", &item.fields);
            }
            Item::Enum(item) => {
                let name = item.ident.to_string();
                self.add(&name, "", "", &item.attrs);
                for variant in &item.variants {
                    self.add(&name, &variant.ident.to_string(), "", &variant.attrs);
                    self.read_fields(&name, &variant.ident.to_string(), &variant.fields);
                }
            }
            _ => {}
        }
    }

    fn read_fields(&mut self, name: &str, variant: &str, fields: &Fields) {
        for field in fields {
            let own = field.ident.as_ref().map(ToString::to_string).unwrap_or_default();
            if !own.is_empty() {
                self.add(name, variant, &own, &field.attrs);
            }
        }
    }

    fn add(&mut self, name: &str, variant: &str, field: &str, attributes: &[Attribute]) {
        let line = |attribute: &Attribute| match &attribute.meta {
            Meta::NameValue(pair) if pair.path.is_ident("doc") => match &pair.value {
                Expr::Lit(text) => match &text.lit {
                    Lit::Str(text) => Some(text.value().trim().to_string()),
                    _ => None,
                },
                _ => None,
            },
            _ => None,
        };
        let lines: Vec<String> = attributes.iter().filter_map(line).collect();
        if !lines.is_empty() {
            let key = (name.to_string(), variant.to_string(), field.to_string());
            self.0.entry(key).or_insert_with(|| plain(&lines.join(" ")));
        }
    }

    fn of(&self, name: &str, variant: Option<&str>, field: Option<&str>) -> &str {
        let key = (name.to_string(), variant.unwrap_or_default().to_string(), field.unwrap_or_default().to_string());
        self.0.get(&key).map_or_else(|| panic!("{key:?} has no doc comment"), String::as_str)
    }
}

/// A doc comment without its links to the sources, fit for a cell of a table.
fn plain(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, link)) = rest.split_once('[') {
        out.push_str(before);
        let Some((label, after)) = link.split_once(']') else { break };
        out.push_str(label);
        rest = match after.strip_prefix('(').and_then(|target| target.split_once(')')) {
            Some((_, after)) => after,
            None => after,
        };
    }
    out.push_str(rest);
    out.replace('|', "\\|")
}

// --- Vectors, from the schema alone.

/// Writes vectors until every variant within each of the message's own has been written once.
fn vectors(top: &NamedType, text: &mut String) {
    let DataModelType::Enum(variants) = top.ty else { unreachable!("a message is an enum") };
    let mut encoder = Encoder::default();
    for number in 0..variants.len() {
        loop {
            let known = encoder.written.len();
            let (mut body, mut value) = (Vec::new(), String::new());
            encoder.variant(top, number, &mut body, &mut value);
            if encoder.written.len() == known {
                break;
            }
            let mut out = [0; frame::LONGEST];
            let length = frame::wrap(&body, &mut out).expect("a message that fits");
            let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ");
            writeln!(text, "message {} {value}\nbody {}\nframe {}\n", top.name, hex(&body), hex(&out[..length]))
                .unwrap();
        }
    }
}

/// An encoder of sample values that knows only the schema and the rules on the page.
#[derive(Default)]
struct Encoder {
    written: BTreeSet<(String, usize)>,
    count: u8,
}

impl Encoder {
    fn value(&mut self, named: &NamedType, body: &mut Vec<u8>, text: &mut String) {
        match named.ty {
            DataModelType::Enum(variants) => {
                let is_new = |number: &usize| {
                    let is_written = self.written.contains(&(named.name.to_string(), *number));
                    !is_written || payload(variants[*number]).into_iter().any(|inner| self.is_new(inner))
                };
                let number = (0..variants.len()).find(is_new).unwrap_or(0);
                self.variant(named, number, body, text);
            }
            DataModelType::Struct(fields) => self.fields(fields, body, text),
            DataModelType::NewtypeStruct(inner) => self.value(inner, body, text),
            DataModelType::Option(inner) => {
                self.count = self.count.wrapping_add(1);
                if self.is_new(inner) || self.count.is_multiple_of(2) {
                    body.push(1);
                    self.value(inner, body, text);
                } else {
                    body.push(0);
                    text.push_str("none");
                }
            }
            DataModelType::Seq(inner) => self.list(&[*inner, *inner], true, body, text),
            DataModelType::Tuple(items) | DataModelType::TupleStruct(items) => self.list(items, false, body, text),
            DataModelType::ByteArray => {
                body.extend([2, 0x12, 0x34]);
                text.push_str("[18, 52]");
            }
            DataModelType::String => {
                body.extend([2, b'a', b'b']);
                text.push_str("\"ab\"");
            }
            DataModelType::Bool => {
                body.push(1);
                text.push_str("true");
            }
            _ => self.number(named, body, text),
        }
    }

    fn number(&mut self, named: &NamedType, body: &mut Vec<u8>, text: &mut String) {
        self.count = self.count.wrapping_add(1);
        let small = self.count % 100;
        let written = match named.ty {
            DataModelType::U8 => {
                body.push(small);
                small.to_string()
            }
            DataModelType::I8 => {
                let value = -i16::from(small) as i8;
                body.push(value as u8);
                value.to_string()
            }
            DataModelType::U16 | DataModelType::U32 | DataModelType::U64 => {
                let value = 300 + u64::from(small);
                varint(value, body);
                value.to_string()
            }
            DataModelType::I16 | DataModelType::I32 | DataModelType::I64 => {
                let value = -300 - i64::from(small);
                varint(((value << 1) ^ (value >> 63)) as u64, body);
                value.to_string()
            }
            DataModelType::F32 => {
                let value = f32::from(small) + 0.5;
                body.extend(value.to_le_bytes());
                value.to_string()
            }
            DataModelType::F64 => {
                let value = f64::from(small) + 0.25;
                body.extend(value.to_le_bytes());
                value.to_string()
            }
            other => panic!("{other:?} of {} has no rule on the page", named.name),
        };
        text.push_str(&written);
    }

    fn list(&mut self, items: &[&NamedType], has_length: bool, body: &mut Vec<u8>, text: &mut String) {
        if has_length {
            varint(items.len() as u64, body);
        }
        text.push('[');
        for (n, item) in items.iter().enumerate() {
            text.push_str(if n == 0 { "" } else { ", " });
            self.value(item, body, text);
        }
        text.push(']');
    }

    fn fields(&mut self, fields: &[&NamedValue], body: &mut Vec<u8>, text: &mut String) {
        text.push('{');
        for (n, field) in fields.iter().enumerate() {
            write!(text, "{}{}: ", if n == 0 { "" } else { ", " }, field.name).unwrap();
            self.value(field.ty, body, text);
        }
        text.push('}');
    }

    fn variant(&mut self, named: &NamedType, number: usize, body: &mut Vec<u8>, text: &mut String) {
        let DataModelType::Enum(variants) = named.ty else { unreachable!("an enum") };
        let variant = variants[number];
        self.written.insert((named.name.to_string(), number));
        varint(number as u64, body);
        text.push_str(variant.name);
        match variant.ty {
            DataModelVariant::UnitVariant => {}
            DataModelVariant::NewtypeVariant(inner) | DataModelVariant::TupleVariant([inner]) => {
                text.push(' ');
                self.value(inner, body, text);
            }
            DataModelVariant::TupleVariant(items) => {
                text.push(' ');
                self.list(items, false, body, text);
            }
            DataModelVariant::StructVariant(fields) => {
                text.push(' ');
                self.fields(fields, body, text);
            }
        }
    }

    /// Whether a value of this type would write a variant for the first time.
    fn is_new(&self, named: &NamedType) -> bool {
        let mut types = Vec::new();
        collect(named, &mut types);
        types.iter().any(|inner| match inner.ty {
            DataModelType::Enum(variants) => {
                (0..variants.len()).any(|number| !self.written.contains(&(inner.name.to_string(), number)))
            }
            _ => false,
        })
    }
}

/// A number in groups of seven bits, least significant first; a further group follows where the highest bit is set.
fn varint(mut value: u64, body: &mut Vec<u8>) {
    while value >= 0x80 {
        body.push(value as u8 | 0x80);
        value >>= 7;
    }
    body.push(value as u8);
}
