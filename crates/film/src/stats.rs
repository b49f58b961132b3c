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
            clamped,
            clamped_radiance,
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
            clamped,
            clamped_radiance as u64,
            (clamped_radiance >> 64) as u64,
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
            clamped,
            clamped_low,
            clamped_high,
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
            clamped,
            clamped_radiance: u128::from(clamped_low) | (u128::from(clamped_high) << 64),
        }
    }
}
