//! Access errors and write checks shared by all register models.

/// Reason why an access fails the run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Refused(pub String);

/// Result of an access.
pub type Access<T> = Result<T, Refused>;

/// Returns an error with a formatted reason.
macro_rules! refuse {
    ($($text:tt)*) => { Err($crate::register::Refused(format!($($text)*))) };
}
pub(crate) use refuse;

/// Returns an error with a formatted reason unless a condition holds.
macro_rules! ensure {
    ($holds:expr, $($text:tt)*) => {
        if !$holds {
            return $crate::register::refuse!($($text)*);
        }
    };
}
pub(crate) use ensure;

/// `width` bits of `value` from bit `low`.
#[must_use]
pub const fn field(value: u32, low: u32, width: u32) -> u32 {
    value >> low & ((1 << width) - 1)
}

/// Whether bit `n` is set.
#[must_use]
pub const fn bit(value: u32, n: u32) -> bool {
    value >> n & 1 == 1
}

/// Error for a register at an offset that is not modelled.
pub fn unknown<T>(peripheral: &str, offset: u32) -> Access<T> {
    refuse!("{peripheral} has no modelled register at offset {offset:#05x}")
}

/// Fails if `value` sets bits outside `modelled`.
pub fn only(register: &str, value: u32, modelled: u32) -> Access<()> {
    let others = value & !modelled;
    if others != 0 {
        return refuse!("{register}: bits {others:#010x} of {value:#010x} are not modelled");
    }
    Ok(())
}

/// Fails if a write changes bits of `protected`, which `rule` forbids at present.
pub fn unchanged(register: &str, before: u32, after: u32, protected: u32, rule: &str) -> Access<()> {
    let changed = (before ^ after) & protected;
    if changed != 0 {
        return refuse!("{register}: {before:#010x} to {after:#010x} changes bits {changed:#010x}, {rule}");
    }
    Ok(())
}

/// Fails unless `holds`.
pub fn rule(holds: bool, text: &str) -> Access<()> {
    if holds { Ok(()) } else { refuse!("{text}") }
}
