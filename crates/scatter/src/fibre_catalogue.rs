//! The models of fibres that files name by the key `kind` of a table of their own.
//!
//! A model is one file, with a [`FibreModel`](crate::FibreModel) and the type of its table, which
//! implements [`FibreKind`], and one line in the list at the end of this file.

use crate::fibre::Fibre;
use crate::fitted::FittedTable;
use crate::measured::MeasuredTable;
use serde::Deserialize;
use std::fmt::Debug;

/// The table of a model of fibres. The type's own keys are those of the table.
pub trait FibreKind: Debug {
    /// The fibre.
    ///
    /// # Errors
    /// `.key: what was expected`, or `: what was expected`.
    fn build(&self) -> Result<Fibre, String>;
}

macro_rules! fibres {
    ($($variant:ident($table:ty) = $name:literal,)*) => {
        /// A table with the key `kind` and the keys of that kind.
        #[derive(Clone, Debug, Deserialize)]
        #[serde(tag = "kind")]
        pub enum FibreTable {
            $(
                #[doc = concat!("`kind = \"", $name, "\"`.")]
                #[serde(rename = $name)]
                $variant($table),
            )*
        }

        impl FibreKind for FibreTable {
            fn build(&self) -> Result<Fibre, String> {
                match self { $(FibreTable::$variant(table) => table.build(),)* }
            }
        }
    };
}

fibres! {
    Fitted(FittedTable) = "fitted",
    Measured(MeasuredTable) = "measured",
}
