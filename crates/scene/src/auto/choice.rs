//! What can be chosen for a cloth: a model of it, how fine, and how paths find
//! their way through it.

use serde::{Deserialize, Serialize};

/// What stands for the cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// Every fibre as it is: the truth.
    Fibres,
    /// Virtual scattering off fibres among others.
    Packed,
    /// Virtual scattering off points.
    Plain,
    /// Mirrors distributed as the normals of an ellipsoid.
    Microflake,
    /// The fabric's `[surface]`.
    Surface,
}

impl Model {
    /// All of them.
    pub const ALL: [Model; 5] = [
        Model::Fibres,
        Model::Packed,
        Model::Plain,
        Model::Microflake,
        Model::Surface,
    ];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Model::Fibres => "fibres",
            Model::Packed => "packed",
            Model::Plain => "plain",
            Model::Microflake => "microflake",
            Model::Surface => "surface",
        }
    }

    /// Its name in sentences.
    pub fn words(self) -> &'static str {
        match self {
            Model::Fibres => "explicit fibres",
            Model::Packed => "virtual scattering (packed)",
            Model::Plain => "virtual scattering (plain)",
            Model::Microflake => "micro-flakes",
            Model::Surface => "the surface model",
        }
    }

    /// Whether it has voxels.
    pub fn is_volume(self) -> bool {
        !matches!(self, Model::Fibres | Model::Surface)
    }
}

/// How paths find their way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tracker {
    /// Delta tracking, many paths at once.
    Kernel,
    /// Delta tracking.
    Woodcock,
    /// Exact stepping.
    Regular,
}

impl Tracker {
    /// All of them.
    pub const ALL: [Tracker; 3] = [Tracker::Kernel, Tracker::Woodcock, Tracker::Regular];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Tracker::Kernel => "kernel",
            Tracker::Woodcock => "woodcock",
            Tracker::Regular => "regular",
        }
    }
}

/// One of everything.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// What stands for the cloth.
    pub model: Model,
    /// Edge of the finest voxels over the fabric's own; 1 of models without.
    pub voxel_scale: f32,
    /// Level of detail; 0 of models without.
    pub level: u8,
    /// How paths find their way.
    pub tracker: Tracker,
}

impl Choice {
    /// The truth.
    pub const FIBRES: Choice = Choice::of(Model::Fibres, Tracker::Woodcock);

    /// A model as the fabric has it.
    pub const fn of(model: Model, tracker: Tracker) -> Choice {
        Choice {
            model,
            voxel_scale: 1.0,
            level: 0,
            tracker,
        }
    }

    /// Everything that is tried; only the quick part of it if asked.
    pub fn all(quick: bool, has_surface: bool) -> Vec<Choice> {
        use Model::{Microflake, Packed, Plain, Surface};
        use Tracker::{Kernel, Regular, Woodcock};
        let own = [
            (Microflake, Kernel),
            (Microflake, Woodcock),
            (Microflake, Regular),
            (Plain, Kernel),
            (Plain, Woodcock),
            (Plain, Regular),
            (Packed, Woodcock),
        ];
        let mut list: Vec<Choice> = own.iter().map(|&(m, t)| Choice::of(m, t)).collect();
        let coarser: &[(f32, u8)] = if quick {
            &[(1.0, 1)]
        } else {
            &[(1.0, 1), (1.0, 2), (2.0, 0), (0.5, 0)]
        };
        for &(voxel_scale, level) in coarser {
            for (model, tracker) in [(Microflake, Kernel), (Plain, Kernel), (Packed, Woodcock)] {
                list.push(Choice {
                    model,
                    voxel_scale,
                    level,
                    tracker,
                });
            }
        }
        if has_surface {
            list.push(Choice::of(Surface, Woodcock));
        }
        list
    }

    /// In words, for a fabric of that voxel size.
    pub fn words(&self, own_voxel_um: f32) -> String {
        if !self.model.is_volume() {
            return self.model.words().to_owned();
        }
        let tracker = match (self.model, self.tracker) {
            (Model::Microflake | Model::Plain, Tracker::Kernel)
            | (Model::Packed, Tracker::Woodcock) => "",
            (_, Tracker::Kernel) => ", kernel",
            (_, Tracker::Woodcock) => ", Woodcock tracking",
            (_, Tracker::Regular) => ", exact stepping",
        };
        format!(
            "{}, {} um, level {}{tracker}",
            self.model.words(),
            self.voxel_scale * own_voxel_um,
            self.level
        )
    }

    /// Its name in files.
    pub fn slug(&self) -> String {
        let (model, tracker) = (self.model.name(), self.tracker.name());
        if self.model.is_volume() {
            format!("{model}-x{}-l{}-{tracker}", self.voxel_scale, self.level)
        } else {
            model.to_owned()
        }
    }

    /// Values of `--set` that make the first object of a scene this.
    pub fn overrides(&self, own_voxel_um: f32) -> Vec<String> {
        let integrator = match (self.model, self.tracker) {
            (Model::Fibres, _) => "fibres",
            (_, Tracker::Regular) => "regular",
            _ => "woodcock",
        };
        let model = match self.model {
            Model::Fibres => "fibres",
            Model::Packed | Model::Plain => "virtual-scattering",
            Model::Microflake => "microflake",
            Model::Surface => "surface",
        };
        let mut list = vec![
            format!("render.integrator={integrator}"),
            format!("object.0.model={model}"),
        ];
        if matches!(self.model, Model::Packed | Model::Plain) {
            list.push(format!("object.0.event={}", self.model.name()));
        }
        if self.model.is_volume() {
            list.push(format!("object.0.lod={}", self.level));
            list.push(format!(
                "object.0.voxel_um={}",
                self.voxel_scale * own_voxel_um
            ));
        }
        list
    }

    /// The flag `--backend` for it.
    pub fn backend(&self) -> &'static str {
        match self.tracker {
            Tracker::Kernel => "auto",
            Tracker::Woodcock | Tracker::Regular => "walk",
        }
    }
}
