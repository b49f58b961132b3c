//! What can be chosen for a cloth: its representation, how fine, and how paths find
//! their way through it.

use crate::representation::{Build, EXPLICIT_FIBRES, REPRESENTATIONS, Representation, Tracker};
use serde::{Deserialize, Serialize};

/// One of everything.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// Its representation.
    pub model: &'static Representation,
    /// Edge of the finest voxels over the fabric's own; 1 of models without.
    pub voxel_scale: f32,
    /// Level of detail; 0 of models without.
    pub level: u8,
    /// How paths find their way.
    pub tracker: Tracker,
}

impl Choice {
    /// The truth: explicit fibres by the general walk, which is the reference of the
    /// kernel.
    pub const EXPLICIT_FIBRES: Choice = Choice::of(&EXPLICIT_FIBRES, Tracker::Woodcock);

    /// A model as the fabric has it.
    pub const fn of(model: &'static Representation, tracker: Tracker) -> Choice {
        Choice {
            model,
            voxel_scale: 1.0,
            level: 0,
            tracker,
        }
    }

    /// A representation as the fabric has it, with its usual tracker.
    pub fn usual(model: &'static Representation) -> Choice {
        let tracker = model.trackers.first().copied();
        Choice::of(model, tracker.unwrap_or(Tracker::Woodcock))
    }

    /// Everything that is tried beside the reference `truth`: only the quick part of it if
    /// asked, and every tracker or only the usual one of each representation. Plies, which
    /// neither keep all light nor are reciprocal, are left out.
    pub fn all(
        truth: Choice,
        quick: bool,
        every_tracker: bool,
        is_ready: &dyn Fn(&Representation) -> bool,
    ) -> Vec<Choice> {
        // The quickest to build come first.
        let built = || REPRESENTATIONS.into_iter().rev();
        let voxels: Vec<_> = built().filter(|r| r.voxels().is_some()).collect();
        let own = |model: &&'static Representation| {
            let model = *model;
            let trackers = model
                .trackers
                .len()
                .min(if every_tracker { usize::MAX } else { 1 });
            let taken = model.trackers.iter().take(trackers);
            taken.map(move |t| Choice::of(model, *t))
        };
        let mut list: Vec<Choice> = voxels.iter().flat_map(own).collect();
        let coarser: &[(f32, u8)] = if quick {
            &[(1.0, 1)]
        } else {
            &[(1.0, 1), (1.0, 2), (2.0, 0), (0.5, 0)]
        };
        for &(voxel_scale, level) in coarser {
            list.extend(voxels.iter().map(|model| Choice {
                voxel_scale,
                level,
                ..Choice::usual(model)
            }));
        }
        let surfaces = built().filter(|r| matches!(r.build, Build::Surface(_)) && is_ready(r));
        list.extend(surfaces.map(Choice::usual));
        // Pictures are rendered with a cache of radiance, whose error is known by trying.
        let fibres = EXPLICIT_FIBRES.trackers.iter();
        let fibres = fibres.filter(|t| every_tracker || **t == Tracker::Cached);
        let fibres = fibres.map(|t| Choice::of(&EXPLICIT_FIBRES, *t));
        list.extend(fibres.filter(|choice| *choice != truth));
        list
    }

    /// In words, for a fabric of that voxel size.
    pub fn description(&self, own_voxel_um: f32) -> String {
        if self.model.voxels().is_none() {
            let how = match self.tracker {
                Tracker::Kernel => ", kernel",
                Tracker::Cached => " with a cache of radiance",
                Tracker::Woodcock | Tracker::Regular => "",
            };
            return format!("{}{how}", self.model.title);
        }
        let tracker = match self.tracker {
            usual if self.model.trackers.first() == Some(&usual) => "",
            Tracker::Kernel | Tracker::Cached => ", kernel",
            Tracker::Woodcock => ", Woodcock tracking",
            Tracker::Regular => ", exact stepping",
        };
        format!(
            "{}, {} um, level {}{tracker}",
            self.model.title,
            self.voxel_scale * own_voxel_um,
            self.level
        )
    }

    /// Its name in files.
    pub fn slug(&self) -> String {
        let (model, tracker) = (self.model.name, self.tracker.name());
        if self.model.voxels().is_some() {
            format!("{model}-x{}-l{}-{tracker}", self.voxel_scale, self.level)
        } else {
            match self.tracker {
                Tracker::Kernel | Tracker::Cached => format!("{model}-{tracker}"),
                Tracker::Woodcock | Tracker::Regular => model.to_owned(),
            }
        }
    }

    /// Values of `--set` that make the first object of a scene this.
    pub fn overrides(&self, own_voxel_um: f32) -> Vec<String> {
        let integrator = match (&self.model.build, self.tracker) {
            (Build::ExplicitFibres(_), _) => "fibres",
            (_, Tracker::Regular) => "regular",
            _ => "woodcock",
        };
        let mut list = vec![
            format!("render.integrator={integrator}"),
            format!("object.0.model={}", self.model.name),
            match self.tracker {
                Tracker::Cached => "render.cache=second-fibre".into(),
                _ => "render.cache=off".into(),
            },
        ];
        if self.model.voxels().is_some() {
            list.push(format!("object.0.lod={}", self.level));
            list.push(format!(
                "object.0.voxel_um={}",
                self.voxel_scale * own_voxel_um
            ));
        } else if self.keeps_its_model() {
            list.push("object.0.lod=volume".into());
        }
        list
    }

    /// Whether `lod = "auto"` would show another model from afar, which was not measured.
    pub(super) fn keeps_its_model(&self) -> bool {
        matches!(self.model.build, Build::ExplicitFibres(_) | Build::Plies(_))
    }

    /// The flag `--engine` for it.
    pub fn backend(&self) -> &'static str {
        match self.tracker {
            // By the processor: a bench counts its seconds.
            Tracker::Kernel | Tracker::Cached => "cpu",
            Tracker::Woodcock | Tracker::Regular => "walk",
        }
    }
}
