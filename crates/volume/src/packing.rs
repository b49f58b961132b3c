//! Measured packing: how much more packed fibres block than fibres strewn at random.

/// A factor on the extinction of fibres, as measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackingFactor {
    /// The factor, above zero: fibres strewn at random have 1.
    pub mean: f32,
    /// Its standard error.
    pub standard_error: f32,
}

/// The packing factors of one material in the voxels of one level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MaterialPacking {
    /// For rays that leave a fibre of the same yarn; `None` where too few rays met the
    /// material.
    pub own_yarn: Option<PackingFactor>,
    /// For rays that leave a fibre of another yarn.
    pub other_yarn: Option<PackingFactor>,
    /// For rays that come from outside the cloth.
    pub outside: Option<PackingFactor>,
}

impl MaterialPacking {
    /// Its factors, in the order of its fields.
    pub fn factors(&self) -> [Option<PackingFactor>; 3] {
        [self.own_yarn, self.other_yarn, self.outside]
    }
}

impl From<[Option<PackingFactor>; 3]> for MaterialPacking {
    fn from([own_yarn, other_yarn, outside]: [Option<PackingFactor>; 3]) -> MaterialPacking {
        MaterialPacking {
            own_yarn,
            other_yarn,
            outside,
        }
    }
}

/// The packing factors of an octree, as measured by walks through the fibres that it
/// was made of.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredPacking {
    /// Number of walks.
    pub walks: u32,
    /// The materials of every level, the finest level first.
    pub levels: Vec<Vec<MaterialPacking>>,
}

impl MeasuredPacking {
    /// Whether it has as many levels and materials as an octree, and every factor is
    /// positive and finite, with a finite standard error.
    pub(crate) fn fits(&self, levels: u8, materials: usize) -> bool {
        let sound = |f: &PackingFactor| {
            f.mean > 0.0
                && f.mean.is_finite()
                && f.standard_error >= 0.0
                && f.standard_error.is_finite()
        };
        self.levels.len() == usize::from(levels)
            && self.levels.iter().all(|l| l.len() == materials)
            && self
                .levels
                .iter()
                .flatten()
                .flat_map(MaterialPacking::factors)
                .flatten()
                .all(|f| sound(&f))
    }
}
