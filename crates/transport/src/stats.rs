//! Counts of what the trackers did.

/// What happened while paths were traced.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
    /// The brightest channel of any sample: fireflies show here.
    pub brightest: f32,
}

impl Stats {
    /// Words of [`Stats::to_words`].
    pub const WORDS: usize = 9;

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
        self.brightest = self.brightest.max(o.brightest);
    }

    /// All counts in the order of their declaration, for a file; the brightest
    /// sample by its bits.
    pub fn to_words(&self) -> [u64; Stats::WORDS] {
        // Taken apart whole, so that a new count cannot be forgotten.
        let Stats {
            paths,
            tentative,
            collisions,
            shadow_rays,
            shadow_steps,
            cut,
            rejected,
            majorant_violations,
            brightest,
        } = *self;
        let brightest = u64::from(brightest.to_bits());
        [
            paths,
            tentative,
            collisions,
            shadow_rays,
            shadow_steps,
            cut,
            rejected,
            majorant_violations,
            brightest,
        ]
    }

    /// The counts of [`Stats::to_words`].
    pub fn from_words(words: &[u64; Stats::WORDS]) -> Stats {
        let [
            paths,
            tentative,
            collisions,
            shadow_rays,
            shadow_steps,
            cut,
            rejected,
            majorant_violations,
            brightest,
        ] = *words;
        Stats {
            paths,
            tentative,
            collisions,
            shadow_rays,
            shadow_steps,
            cut,
            rejected,
            majorant_violations,
            brightest: f32::from_bits(brightest as u32),
        }
    }
}
