//! Reads a matrix from a file of comma-separated numbers.

use std::path::Path;

use crate::input::{Section, Text, resolve};

/// A square matrix by rows from a file of comma-separated numbers; `None` after a problem has been reported.
pub fn matrix_of(s: &Section, key: &str, name: &Text, count: usize) -> Option<Vec<f64>> {
    let refuse = |allowed: String| {
        s.refuse(key, &name.span, allowed, None);
        None
    };
    let path = resolve(Path::new(s.source().name()), &name.value);
    let text = match s.source().read_named(&path) {
        Ok(file) => file.text().to_string(),
        Err(refusal) => return refuse(refusal.to_string().replace('\n', ";")),
    };
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).from_reader(text.as_bytes());
    let mut rows = Vec::new();
    let mut lines = 0;
    for (line, record) in (1..).zip(reader.records()) {
        let Ok(record) = record else { return refuse(format!("line {line} of the file is no list of numbers")) };
        lines = line;
        if record.len() != count {
            return refuse(format!(
                "line {line} of the file must have {count} numbers, one for each of `places`; it has {}",
                record.len()
            ));
        }
        for (column, field) in (1..).zip(&record) {
            match field.parse::<f64>() {
                Ok(number) if number.is_finite() => rows.push(number),
                _ => {
                    return refuse(format!(
                        "line {line}, column {column} of the file is {field:?}, which is no finite number"
                    ));
                }
            }
        }
    }
    if lines != count {
        return refuse(format!("the file must have {count} lines, one for each of `places`; it has {lines}"));
    }
    Some(rows)
}
