//! Errors in the description of a surface.

use thiserror::Error;

/// Why a surface model was refused.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Error {
    /// A number outside its range.
    #[error("{key} = {}: expected {expected}", short(*value))]
    Range {
        /// Key of the parameter, as files write it.
        key: String,
        /// The value given.
        value: f64,
        /// The valid range in words.
        expected: String,
    },
    /// A yarn that is too thick for its visible length at its steepest inclination.
    #[error(
        "{key} = {u_max_deg}: a yarn {width_mm} mm wide does not fit a segment {length_mm} mm long: \
         width * sin(u_max) must be below the length; lower u_max_deg to under \
         {largest_deg:.1}, or set fit = \"narrow\" to thin the tube"
    )]
    DoesNotFit {
        /// Key of the inclination, as files write it.
        key: String,
        /// Width of the segment's rectangle.
        width_mm: f64,
        /// Length of the segment's rectangle.
        length_mm: f64,
        /// Inclination at its ends, degrees.
        u_max_deg: f64,
        /// The largest inclination that fits, degrees.
        largest_deg: f64,
    },
    /// A hyperbola that is nowhere as steep as its ends must be.
    #[error("{key} = {kappa}: expected more than {smallest}")]
    Curvature {
        /// Key of the curvature, as files write it.
        key: String,
        /// The value given.
        kappa: f64,
        /// The exclusive lower limit.
        smallest: f64,
    },
    /// A draft that is not a matrix, or is too large.
    #[error("draft: {0}")]
    Draft(String),
    /// An unknown name.
    #[error("{key} = \"{name}\": expected one of {expected}{}", hint(.nearest))]
    Name {
        /// Key that has the name as its value.
        key: &'static str,
        /// The name given.
        name: String,
        /// The valid names, comma separated.
        expected: String,
        /// The valid name nearest to it.
        nearest: Option<String>,
    },
    /// A key that is required when no preset supplies it.
    #[error("{key} is missing: give it, or start from a preset")]
    Missing {
        /// The key.
        key: String,
    },
    /// More light leaves than arrives, in the mean over directions.
    #[error(
        "the cloth would send back {albedo:.3} of the light that it gets: lower diffuse, specular \
         or transmission"
    )]
    Energy {
        /// Reflected and transmitted share, largest channel.
        albedo: f64,
    },
    /// Shares of one channel that leave more light than arrives.
    #[error(
        "reflectance, transmittance and openness add up to {total:.3}: expected at most 1 in every \
         channel"
    )]
    Shares {
        /// Their sum, largest channel.
        total: f64,
    },
    /// Text that is not a valid TOML description of a surface.
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
