//! Numbers in the texts of measurement programs, and what is none.

/// A finite number.
pub(crate) fn finite(text: &str) -> Option<f64> {
    text.trim().parse::<f64>().ok().filter(|value| value.is_finite())
}

/// Whether the first row's field looks like a column's name: it does not begin like a number and is not a mistyped one, as
/// `O.25` or `x0.25`. NaN is refused as a value, it is no name.
pub(crate) fn is_name(field: &str) -> bool {
    let begins_as_number = field.starts_with(|c: char| c.is_ascii_digit() || "+-−.,".contains(c));
    let as_digits = field.replace(['O', 'o'], "0").replace(['l', 'I'], "1");
    let without_letters = field.trim_matches(char::is_alphabetic);
    let is_stray = field.len() - without_letters.len() <= 2 && finite(without_letters).is_some();
    let is_mistyped = field.contains('.') && (finite(&as_digits).is_some() || is_stray);
    !begins_as_number && !is_mistyped && field.parse::<f64>().is_err()
}

/// The numbers of a piece of a line in FORTRAN's fixed columns, which begins at byte `from`: exponents with D, and values that a sign
/// alone separates.
///
/// # Errors
/// The text that is no finite number, with its column from 1.
pub(super) fn fortran(piece: &str, from: usize, out: &mut Vec<f64>) -> Result<(), String> {
    for word in piece.split_ascii_whitespace() {
        let mut rest = word;
        while !rest.is_empty() {
            let is_next = |(at, c): &(usize, char)| {
                *at > 0 && (*c == '-' || *c == '+') && !rest[..*at].ends_with(['e', 'E', 'd', 'D'])
            };
            let end = rest.char_indices().find(is_next).map_or(rest.len(), |(at, _)| at);
            let (one, after) = rest.split_at(end);
            let value = one.replace(['d', 'D'], "e").parse::<f64>().ok().filter(|value| value.is_finite());
            let Some(value) = value else {
                let column = 1 + from + piece.find(word).unwrap_or_default() + (word.len() - rest.len());
                return Err(format!("column {column}: {one:?} is not a finite number"));
            };
            out.push(value);
            rest = after;
        }
    }
    Ok(())
}
