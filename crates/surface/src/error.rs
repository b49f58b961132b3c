//! Errors in the description of a surface.

use thiserror::Error;

/// Why a surface model was refused.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs)] // the messages say what is wrong
pub enum Error {
    #[error("{key} = {}: expected {expected}", short(*value))]
    Range {
        key: String,
        value: f64,
        expected: String,
    },
    #[error(
        "{key} = {u_max_deg}: a yarn {width_mm} mm wide does not fit a segment {length_mm} mm long: \
         width * sin(u_max) must be below the length; lower u_max_deg to under \
         {largest_deg:.1}, or set fit = \"narrow\" to thin the tube"
    )]
    DoesNotFit {
        key: String,
        width_mm: f64,
        length_mm: f64,
        u_max_deg: f64,
        largest_deg: f64,
    },
    #[error("{key} = {kappa}: expected more than {smallest}")]
    Curvature {
        key: String,
        kappa: f64,
        smallest: f64,
    },
    #[error("draft: {0}")]
    Draft(String),
    #[error("{key} = \"{name}\": expected one of {expected}{}", hint(.nearest))]
    Name {
        key: &'static str,
        name: String,
        expected: String,
        nearest: Option<String>,
    },
    #[error("{key} is missing: give it, or start from a preset")]
    Missing { key: String },
    #[error(
        "the cloth would send back {albedo:.3} of the light that it gets: lower diffuse, specular \
         or transmission"
    )]
    Energy { albedo: f64 },
    #[error(
        "reflectance, transmittance and openness add up to {total:.3}: expected at most 1 in every \
         channel"
    )]
    Shares { total: f64 },
    #[error("surface: {0}")]
    Syntax(String),
}

fn hint(nearest: &Option<String>) -> String {
    match nearest {
        Some(n) => format!("; did you mean \"{n}\"?"),
        None => String::new(),
    }
}

/// A number without rows of zeros.
fn short(value: f64) -> String {
    if value.abs() < 1e16 {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

impl Error {
    /// Refuses a value that is not finite or not in `[low, high]`.
    pub(crate) fn check(key: &str, value: f64, low: f64, high: f64) -> Result<(), Error> {
        if value.is_finite() && value >= low && value <= high {
            return Ok(());
        }
        let expected = if high.is_finite() {
            format!("a number from {low} to {high}")
        } else {
            format!("a number of at least {low}")
        };
        Err(Error::Range {
            key: key.into(),
            value,
            expected,
        })
    }

    /// The same error for a key in a table of the file. The code that checks the values of a
    /// table does not know the name of the table.
    pub(crate) fn in_table(mut self, table: &str) -> Error {
        if let Error::Range { key, .. }
        | Error::DoesNotFit { key, .. }
        | Error::Curvature { key, .. } = &mut self
        {
            *key = format!("{table}.{key}");
        }
        self
    }
}
