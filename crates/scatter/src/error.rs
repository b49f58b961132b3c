//! Errors of parameters.

/// A parameter outside its domain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{parameter} is {value}, expected {expected}")]
pub struct Error {
    /// Name of the parameter, with its unit.
    pub parameter: &'static str,
    /// What was given.
    pub value: f32,
    /// What would be valid.
    pub expected: &'static str,
}

/// `value`, unless it is not a number in `[least, most]`.
pub(crate) fn in_range(
    parameter: &'static str,
    value: f32,
    [least, most]: [f32; 2],
    expected: &'static str,
) -> Result<f32, Error> {
    if (least..=most).contains(&value) {
        Ok(value)
    } else {
        Err(Error {
            parameter,
            value,
            expected,
        })
    }
}
