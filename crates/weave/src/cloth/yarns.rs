//! The yarns and materials of a cloth's threads, each listed once.

use super::Material;
use crate::Error;
use crate::blend::FibrePart;
use crate::dye::Dye;
use crate::spec::{ThreadSetSpec, YarnSpec};
use crate::yarn::Yarn;
use organza_basis::Rgb;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The yarns that threads use, each built once.
pub(super) struct Yarns<'a> {
    specs: &'a BTreeMap<String, YarnSpec>,
    pub built: Vec<Arc<Yarn>>,
}

impl<'a> Yarns<'a> {
    pub fn new(specs: &'a BTreeMap<String, YarnSpec>) -> Yarns<'a> {
        Yarns {
            specs,
            built: Vec::new(),
        }
    }

    /// Indices of the yarns of a system, in the order of its repeat. Without names, the only
    /// yarn of the fabric, otherwise cotton.
    pub fn of_system(&mut self, system: &str, spec: &ThreadSetSpec) -> Result<Vec<usize>, Error> {
        let only = match self.specs.keys().next() {
            Some(name) if self.specs.len() == 1 => name.clone(),
            _ => "cotton".to_owned(),
        };
        let names = if spec.yarn.is_empty() {
            std::slice::from_ref(&only)
        } else {
            &spec.yarn
        };
        names.iter().map(|name| self.index(system, name)).collect()
    }

    /// The index of a yarn that the key `SYSTEM.yarn` names.
    pub fn index(&mut self, system: &str, name: &str) -> Result<usize, Error> {
        self.index_of(&format!("{system}.yarn"), name)
    }

    /// The index of a yarn that a key names.
    pub fn index_of(&mut self, key: &str, name: &str) -> Result<usize, Error> {
        if let Some(i) = self.built.iter().position(|y| y.name == name) {
            return Ok(i);
        }
        self.built
            .push(Arc::new(Yarn::named(name, self.specs, key)?));
        Ok(self.built.len() - 1)
    }
}

#[derive(Default)]
pub(super) struct Materials(pub Vec<Material>);

impl Materials {
    /// The dye of a thread of some colour.
    pub fn dye(&mut self, yarn: &Yarn, colour: Option<Rgb>) -> Result<Dye, Error> {
        Dye::new(yarn, colour, &mut |colour, part| {
            self.index(yarn, colour, part)
        })
    }

    /// The index of the material of a yarn and a colour, new or known; of a part of its blend.
    fn index(
        &mut self,
        yarn: &Yarn,
        colour: Option<Rgb>,
        part: Option<&FibrePart>,
    ) -> Result<u16, Error> {
        let radius_mm = part.map_or(yarn.fibre_radius_mm, |p| p.fibre_radius_mm);
        let new = Material {
            yarn: yarn.name.clone(),
            fibre: part.and_then(|p| p.fibre.clone()),
            colour,
            fibre_radius_mm: radius_mm as f32,
        };
        let index = self
            .0
            .iter()
            .position(|m| *m == new)
            .unwrap_or(self.0.len());
        if index == self.0.len() {
            self.0.push(new);
        }
        u16::try_from(index)
            .map_err(|_| Error::spec("warp.colours", "more than 65536 yarns and colours"))
    }
}
