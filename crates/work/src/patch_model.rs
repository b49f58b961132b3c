//! The names of representations, as values of requests.

use crate::keys;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use organza_scene::patches::PatchModel;
use organza_scene::representation::{REPRESENTATIONS, Representation};
use serde::Deserialize;
use serde::de::{Deserializer, Error};

/// The representation that the fabric names.
pub const OWN: &str = "auto";

/// Reads the name of a representation.
pub fn patch_model() -> impl TypedValueParser<Value = PatchModel> {
    let own = PossibleValue::new(OWN)
        .alias("volume")
        .help("What the fabric's [scattering] names, micro-flakes if nothing");
    let others = REPRESENTATIONS.map(|r| PossibleValue::new(r.name).help(r.about));
    let values = std::iter::once(own).chain(others);
    // Every other name that the parser lets through is of the list, or the alias.
    PossibleValuesParser::new(values)
        .map(|name| Representation::named(&name).map_or(PatchModel::Own, PatchModel::Is))
}

/// The representation of a name.
pub fn named<'de, D: Deserializer<'de>>(from: D) -> Result<PatchModel, D::Error> {
    of_name(&String::deserialize(from)?)
}

/// Those of several names.
pub fn list<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<PatchModel>, D::Error> {
    let names = keys::texts(from)?;
    names.iter().map(|name| of_name(name)).collect()
}

fn of_name<E: Error>(name: &str) -> Result<PatchModel, E> {
    if [OWN, "volume"].contains(&name) {
        return Ok(PatchModel::Own);
    }
    let found = Representation::named(name).map(PatchModel::Is);
    found.ok_or_else(|| {
        let others = REPRESENTATIONS.map(|r| r.name);
        keys::not_one_of(name, &[&[OWN], &others[..]].concat())
    })
}
