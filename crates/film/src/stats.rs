//! Counts of the trackers' work.

use organza_basis::Rgb;

/// Units of [`Stats::clamped_radiance`] in a radiance of one.
const CLAMPED_UNITS: f64 = 4_294_967_296.0;

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
    /// The brightest channel of any sample, before any clamp: fireflies show
    /// here.
    pub brightest: f32,
    /// Samples that a clamp made darker.
    pub clamped: u64,
    /// Radiance that the clamp took away, summed over samples and channels, in
    /// units of `2^-32`: a whole number, so that the order does not matter.
    pub clamped_radiance: u128,
}

impl Stats {
    /// Words of [`Stats::to_words`].
    pub const WORDS: usize = 12;

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
        self.clamped += o.clamped;
        self.clamped_radiance = self.clamped_radiance.saturating_add(o.clamped_radiance);
    }

    /// Darkens a sample to at most `limit` in its brightest channel, keeping its
    /// colour, and counts what that took away.
    pub fn clamp(&mut self, radiance: Rgb, limit: f32) -> Rgb {
        let most = radiance.max_component();
        if most <= limit {
            return radiance;
        }
        let kept = radiance * (limit / most);
        let lost: f64 = (radiance.0 - kept.0).as_dvec3().element_sum();
        self.clamped += 1;
        self.clamped_radiance = self
            .clamped_radiance
            .saturating_add((lost * CLAMPED_UNITS) as u128);
        kept
    }

    /// All counts as the words of a file; the brightest sample by its bits.
    pub fn to_words(&self) -> [u64; Stats::WORDS] {
        let mut words = [0; Stats::WORDS];
        let mut slots = words.iter_mut();
        let mut copy = *self;
        copy.visit_words(|word| {
            if let Some(slot) = slots.next() {
                *slot = *word;
            }
        });
        words
    }

    /// The counts of [`Stats::to_words`].
    pub fn from_words(words: &[u64; Stats::WORDS]) -> Stats {
        let mut stats = Stats::default();
        let mut slots = words.iter();
        stats.visit_words(|word| *word = slots.next().copied().unwrap_or_default());
        stats
    }

    /// Passes every count to `visit` as words, in their order in files, and keeps
    /// what `visit` makes of them.
    fn visit_words(&mut self, mut visit: impl FnMut(&mut u64)) {
        // Destructured in full, so that a new count cannot be forgotten.
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
            clamped,
            clamped_radiance,
        } = self;
        visit(paths);
        visit(tentative);
        visit(collisions);
        visit(shadow_rays);
        visit(shadow_steps);
        visit(cut);
        visit(rejected);
        visit(majorant_violations);
        let mut bits = u64::from(brightest.to_bits());
        visit(&mut bits);
        *brightest = f32::from_bits(bits as u32);
        visit(clamped);
        let (mut low, mut high) = (*clamped_radiance as u64, (*clamped_radiance >> 64) as u64);
        visit(&mut low);
        visit(&mut high);
        *clamped_radiance = u128::from(low) | (u128::from(high) << 64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_hold_every_count_in_its_place() {
        let stats = Stats {
            paths: 1,
            tentative: 2,
            collisions: 3,
            shadow_rays: 4,
            shadow_steps: 5,
            cut: 6,
            rejected: 7,
            majorant_violations: 8,
            brightest: 1.5,
            clamped: 10,
            clamped_radiance: (12 << 64) | 11,
        };
        let bits = u64::from(1.5f32.to_bits());
        let words = [1, 2, 3, 4, 5, 6, 7, 8, bits, 10, 11, 12];
        assert_eq!(stats.to_words(), words);
        assert_eq!(Stats::from_words(&words), stats);
    }
}
