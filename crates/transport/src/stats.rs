//! Counts of what the trackers did.

/// What happened while paths were traced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Paths started.
    pub paths: u64,
    /// Tentative collisions of walks.
    pub tentative: u64,
    /// Real collisions.
    pub collisions: u64,
    /// Shadow rays traced.
    pub shadow_rays: u64,
    /// Look-ups of shadow rays.
    pub shadow_steps: u64,
    /// Paths cut by the limit on bounces.
    pub cut: u64,
    /// Samples thrown away because they were NaN, infinite or negative.
    pub rejected: u64,
    /// Look-ups whose extinction exceeded the majorant.
    pub majorant_violations: u64,
}

impl Stats {
    /// Adds the counts of another worker.
    pub fn merge(&mut self, o: &Stats) {
        self.paths += o.paths;
        self.tentative += o.tentative;
        self.collisions += o.collisions;
        self.shadow_rays += o.shadow_rays;
        self.shadow_steps += o.shadow_steps;
        self.cut += o.cut;
        self.rejected += o.rejected;
        self.majorant_violations += o.majorant_violations;
    }
}
