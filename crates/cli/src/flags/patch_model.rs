//! The models that a patch of cloth can be measured as.

/// What stands for the cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PatchModel {
    /// Its fibres as the fabric's [scattering] says, micro-flakes if nothing
    Volume,
    /// Every fibre of the fabric, as it is: the ground truth of the others
    Fibres,
    /// Virtual scattering off fibres among others
    Packed,
    /// Virtual scattering off points, in the far field
    Plain,
    /// The reflectance model of the fabric's [surface] section
    Surface,
}

impl PatchModel {
    /// Its name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            PatchModel::Volume => "volume",
            PatchModel::Fibres => "fibres",
            PatchModel::Packed => "packed",
            PatchModel::Plain => "plain",
            PatchModel::Surface => "surface",
        }
    }
}
