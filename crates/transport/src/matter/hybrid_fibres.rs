//! A cloth whose paths meet explicit fibres first and packed ones later.
//!
//! The events that shape a picture are exact, and the many faint ones after them need no
//! fibres: a path changes where it leaves a fibre, and never back. Light at an event
//! arrives through what the event is with.

use crate::matter::collision::Met;
use crate::matter::level_choice::Tracking;
use crate::matter::ray_target::{Query, RayTarget};
use crate::{ExplicitFibres, Stats, VirtualFibreEvent, VirtualFibreMedium};
use glam::Vec2;
use organza_basis::{CellGrid, PathRng};
use organza_kernel::Refusal;
use organza_kernel::fibres::FibreMatter;
use organza_kernel::packed::Switch;

/// Explicit fibres, and the same cloth as packed ones.
pub struct HybridFibres {
    explicit: ExplicitFibres,
    packed: VirtualFibreMedium,
    switch: Switch,
}

impl HybridFibres {
    /// `None` unless both are of one cloth: of one period if they repeat, and the volume
    /// with packed events and no tables of local visibility.
    pub fn new(
        explicit: ExplicitFibres,
        packed: VirtualFibreMedium,
        switch: Switch,
    ) -> Option<HybridFibres> {
        let (a, b) = (explicit.cell_grid(), crate::Medium::cell_grid(&packed));
        let corners = |g: &CellGrid| [g.bounds_mm().min, g.bounds_mm().max].map(|c| c.truncate());
        let apart = |k: usize| (corners(a)[k] - corners(b)[k]).abs().max_element();
        let room_mm = 1e-5 * a.bounds_mm().size().max_element();
        let is_one_cloth = a.repeats() == b.repeats()
            && (!a.repeats() || (apart(0) <= room_mm && apart(1) <= room_mm));
        let is_packed =
            packed.event() == VirtualFibreEvent::Packed && !packed.has_local_visibility();
        (is_one_cloth && is_packed).then_some(HybridFibres {
            explicit,
            packed,
            switch,
        })
    }

    /// The packed fibres.
    pub(crate) fn packed(&self) -> &VirtualFibreMedium {
        &self.packed
    }

    /// The fibres for the kernel, in at most `max_bytes`.
    ///
    /// # Errors
    /// Fibres that the kernel does not suit.
    pub fn matter(&self, max_bytes: u64) -> Result<FibreMatter, Refusal> {
        let explicit = FibreMatter::new(&[self.explicit.body(None)], Vec::new(), max_bytes);
        let explicit = explicit.map_err(|unfit| Refusal::of_fibres(unfit, max_bytes))?;
        explicit.with_packed(&self.packed, self.switch, max_bytes)
    }

    /// What a path meets that has come so far.
    fn met_by(&self, tracking: &Tracking) -> &dyn RayTarget {
        let progress = tracking.progress;
        if self.switch.is_over(progress.events, progress.least_weight) {
            &self.packed
        } else {
            &self.explicit
        }
    }
}

impl RayTarget for HybridFibres {
    fn cell_grid(&self) -> Option<&CellGrid> {
        RayTarget::cell_grid(&self.explicit)
    }

    fn cut_to(&mut self, min_mm: Vec2, max_mm: Vec2) -> Option<()> {
        self.explicit.cut_to(min_mm, max_mm)?;
        RayTarget::cut_to(&mut self.packed, min_mm, max_mm)
    }

    fn is_piecewise_constant(&self) -> bool {
        false
    }

    fn walk_bytes(&self) -> u64 {
        self.explicit.walk_bytes()
    }

    fn collide(&self, query: Query<'_>, rng: &mut PathRng, stats: &mut Stats) -> Met<'_> {
        self.met_by(&query.tracking).collide(query, rng, stats)
    }

    fn pass(&self, query: Query<'_>, rng: &mut PathRng, stats: &mut Stats) -> f32 {
        self.met_by(&query.tracking).pass(query, rng, stats)
    }
}
