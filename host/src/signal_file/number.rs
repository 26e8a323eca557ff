//! Numbers in the texts of measurement programs.

/// The numbers of a line in FORTRAN's fixed columns: exponents with D, and values that a sign alone separates.
///
/// # Errors
/// The text that is no finite number, with its column from 1.
pub(super) fn fortran(line: &str, out: &mut Vec<f64>) -> Result<(), String> {
    for word in line.split_ascii_whitespace() {
        let mut rest = word;
        while !rest.is_empty() {
            let is_next = |(at, c): &(usize, char)| {
                *at > 0 && (*c == '-' || *c == '+') && !rest[..*at].ends_with(['e', 'E', 'd', 'D'])
            };
            let end = rest.char_indices().find(is_next).map_or(rest.len(), |(at, _)| at);
            let (one, after) = rest.split_at(end);
            let value = one.replace(['d', 'D'], "e").parse::<f64>().ok().filter(|value| value.is_finite());
            let Some(value) = value else {
                let column = 1 + line.find(word).unwrap_or_default() + (word.len() - rest.len());
                return Err(format!("column {column}: {one:?} is not a finite number"));
            };
            out.push(value);
            rest = after;
        }
    }
    Ok(())
}
