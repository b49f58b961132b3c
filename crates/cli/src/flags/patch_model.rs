//! The names of what can stand for a cloth, as values of flags.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use organza_scene::patches::PatchModel;

/// A reader of the names of models.
pub fn patch_model() -> impl TypedValueParser<Value = PatchModel> {
    let values = PatchModel::ALL.map(|m| PossibleValue::new(m.name()).help(m.help()));
    PossibleValuesParser::new(values)
        .try_map(|name| PatchModel::named(&name).ok_or("expected the name of a model"))
}
