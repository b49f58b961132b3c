//! Scenes that are wrong on purpose: known-bad twins, which tests must reject.

use crate::fibres::FibreMatter;
use crate::voxels::fibre_tables::FibreTables;
use crate::voxels::flat_scene::FlatScene;
use organza_film::Brightness;
use organza_scatter::Fibre;

/// What is wrong with a scene.
pub enum Fault<'a> {
    /// Tables of light hold one depth everywhere: exact rays set that right.
    OpticalDepths,
    /// No exact rays are traced.
    NoExactRays,
    /// Walks find the lamps of pictures once more.
    LampsTwice,
    /// Nothing finds the lamps of pictures.
    NoLamps,
    /// Light scatters as from these fibres.
    Fibres(&'a [Fibre]),
    /// Samples are summed as if lights were this bright: no fault, but samples are then
    /// counted one by one.
    Dim(f32),
    /// The scale of far fields, a factor of every event, is rounded to nine bits.
    RoundedScale,
}

impl FlatScene {
    /// The same scene with a fault.
    pub fn with_fault(mut self, fault: Fault<'_>) -> FlatScene {
        /// Four times the code of half a unit of depth.
        const WRONG: u32 = 0x0e0e_0e0e;
        match fault {
            Fault::OpticalDepths => {
                self.depths.fill(WRONG);
                let lamps = self.skies.iter_mut().flat_map(|sky| &mut sky.lamps);
                lamps.for_each(|lamp| lamp.table.depths.fill(WRONG));
            }
            Fault::NoExactRays => self.residual_scale = 0.0,
            Fault::LampsTwice => self
                .skies
                .iter_mut()
                .for_each(|sky| sky.show_lamps_to_all()),
            Fault::NoLamps => self.skies.iter_mut().for_each(|sky| sky.lamps.clear()),
            Fault::Dim(light) => self.brightness = Brightness::of(light),
            Fault::RoundedScale => self.fibres.round_scales(),
            Fault::Fibres(fibres) => self.fibres = FibreTables::new(fibres.iter()),
        }
        self
    }
}

/// What is wrong with packed fibres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PackedFault {
    /// Extinctions are multiplied by this, at most one.
    Extinction(f32),
    /// Paths go on from where they came in, not from where light leaves the fibre.
    StartAtEntry,
}

impl FibreMatter {
    /// The same fibres with a fault in packed ones.
    pub fn with_fault(mut self, fault: PackedFault) -> FibreMatter {
        if let Some(part) = &mut self.packed {
            match fault {
                PackedFault::Extinction(factor) => part.volume.thin(factor),
                PackedFault::StartAtEntry => part.starts_at_entry = true,
            }
        }
        self
    }
}
