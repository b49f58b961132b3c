//! The options of a fit to photographs that no other fit has.

use organza_photograph::Vignetting;
use organza_work::keys;
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};

/// `"fit"`, or two coefficients.
pub fn vignetting<'de, D: Deserializer<'de>>(from: D) -> Result<Option<VignettingFlag>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Written {
        Numbers([f64; 2]),
        Text(String),
    }
    let text = match Option::<Written>::deserialize(from)? {
        Some(Written::Numbers(list)) => keys::listed(&list),
        Some(Written::Text(text)) => text,
        None => return Ok(None),
    };
    parse_vignetting(&text).map(Some).map_err(D::Error::custom)
}

/// Vignetting as the flag states it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VignettingFlag {
    /// It is known.
    Known(Vignetting),
    /// It is to be found.
    Fit,
}

/// Reads the flag.
pub fn parse_vignetting(text: &str) -> Result<VignettingFlag, String> {
    if text.trim() == "fit" {
        return Ok(VignettingFlag::Fit);
    }
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let known = match numbers.as_deref() {
        Some(&[a, b]) => Some(Vignetting { a, b }),
        _ => None,
    };
    // Light is left everywhere, to the corners.
    let is_light = |v: &Vignetting| (0..=20).all(|i| v.factor(f64::from(i) / 20.0) > 0.05);
    known
        .filter(is_light)
        .map(VignettingFlag::Known)
        .ok_or_else(|| {
            "expected \"fit\", or two numbers A,B with 1 + A r^2 + B r^4 above 0.05 for r from 0 to 1"
                .into()
        })
}
