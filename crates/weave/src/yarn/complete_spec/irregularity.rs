//! Checks of the keys that make a yarn irregular.

use super::CompleteSpec;
use crate::Error;
use crate::clump;
use crate::error::did_you_mean;
use crate::neps;
use crate::spec::YarnSpec;
use crate::spec::{
    BlendTuftSpec, CrimpSpec, DraftingWaveSpec, EvennessSpec, FlatteningSpec, HairinessSpec,
    NepSpec, RingDyeSpec, SlubSpec, WanderSpec,
};
use crate::spinning::{FINISHES, NAMES};
use organza_basis::Rgb;

/// Length of drafting waves, in lengths of the fibres [Furter1982].
const WAVE_OF_FIBRES: f64 = 2.75;
/// The largest displacement by crimp, its variation included, as a share of the room in the ply.
const MAX_CRIMP: f64 = 0.5;

impl CompleteSpec<'_> {
    /// Refuses names of irregularities and finishes that do not exist.
    pub(super) fn check_names(key: &str, own: &YarnSpec) -> Result<(), Error> {
        let irregularity = own
            .irregularity
            .iter()
            .map(|n| ("irregularity", n, &NAMES[..]));
        let finishes = own.finish.iter().map(|n| ("finish", n, &FINISHES[..]));
        for (what, name, known) in irregularity.chain(finishes) {
            if !known.contains(&name.as_str()) {
                let hint = did_you_mean(name, known.iter().copied());
                let names = known.join(", ");
                let message = format!("no {what} \"{name}\"{hint}; there are {names}");
                return Err(Error::spec(format!("yarn.{key}.{what}"), message));
            }
        }
        Ok(())
    }

    pub(super) fn evenness(&self) -> Result<Option<EvennessSpec>, Error> {
        let Some(e) = self.spec.evenness else {
            return Ok(None);
        };
        self.number(
            "evenness.mass_cv_percent",
            Some(e.mass_cv_percent),
            0.0,
            50.0,
        )?;
        self.number(
            "evenness.fibre_length_mm",
            Some(e.fibre_length_mm),
            1.0,
            1e5,
        )?;
        Ok(Some(e).filter(|e| e.mass_cv_percent > 0.0))
    }

    pub(super) fn drafting_waves(&self) -> Result<Option<DraftingWaveSpec>, Error> {
        let Some(d) = self.spec.drafting_waves else {
            return Ok(None);
        };
        let Some(evenness) = self.spec.evenness else {
            let message = "needs evenness or irregularity, whose variation the waves are part of";
            return Err(Error::spec(self.key("drafting_waves"), message));
        };
        let length_mm = d
            .length_mm
            .unwrap_or(WAVE_OF_FIBRES * evenness.fibre_length_mm);
        self.number("drafting_waves.share", Some(d.share), 0.0, 1.0)?;
        self.number("drafting_waves.length_mm", Some(length_mm), 1.0, 1e6)?;
        self.number("drafting_waves.spread", Some(d.spread), 0.01, 0.5)?;
        let completed = DraftingWaveSpec {
            length_mm: Some(length_mm),
            ..d
        };
        Ok(Some(completed).filter(|d| d.share > 0.0))
    }

    pub(super) fn slubs(&self) -> Result<Option<SlubSpec>, Error> {
        let Some(s) = self.spec.slubs else {
            return Ok(None);
        };
        self.number("slubs.per_m", Some(s.per_m), 0.0, 1e4)?;
        self.number("slubs.length_mm[0]", Some(s.length_mm[0]), 0.01, 1e4)?;
        self.number("slubs.length_mm[1]", Some(s.length_mm[1]), 0.0, 1e4)?;
        self.number("slubs.mass[0]", Some(s.mass[0]), 0.4, 2.2)?;
        self.number("slubs.mass[1]", Some(s.mass[1]), 0.0, 1.0)?;
        Ok(Some(s).filter(|s| s.per_m > 0.0))
    }

    /// Neps in a yarn of which so much of the section is fibre.
    pub(super) fn neps(&self, fibre_mm2: f64) -> Result<Option<NepSpec>, Error> {
        let Some(n) = &self.spec.neps else {
            return Ok(None);
        };
        self.number("neps.per_m", Some(n.per_m), 0.0, 1e4)?;
        let [mean, deviation] = n.size_mm;
        self.number("neps.size_mm[0]", Some(mean), 0.05, 10.0)?;
        let most = clump::MAX_DEVIATION * mean;
        self.number("neps.size_mm[1]", Some(deviation), 0.0, most)?;
        for (i, colour) in n.colours.iter().enumerate() {
            self.colour(&format!("neps.colours[{i}]"), *colour)?;
        }
        let share = neps::fibre_mm2(n) / fibre_mm2;
        if share > 1.0 {
            let message = format!(
                "neps of {} mm, {} per metre, would weigh {share:.1} times as much as the yarn, \
                 and may weigh as much at most",
                n.size_mm[0], n.per_m
            );
            return Err(Error::spec(self.key("neps"), message));
        }
        Ok(Some(n.clone()).filter(|n| n.per_m > 0.0))
    }

    pub(super) fn wander(&self) -> Result<Option<WanderSpec>, Error> {
        let Some(w) = self.spec.wander else {
            return Ok(None);
        };
        self.number("wander.amplitude", Some(w.amplitude), 0.0, 1.0)?;
        self.number("wander.length_mm", Some(w.length_mm), 0.01, 1e5)?;
        Ok(Some(w).filter(|w| w.amplitude > 0.0))
    }

    /// Crimp, in a ply that leaves fibres so much room from its centre.
    pub(super) fn crimp(&self, room_mm: f64) -> Result<Option<CrimpSpec>, Error> {
        let Some(c) = self.spec.crimp else {
            return Ok(None);
        };
        self.number("crimp.per_cm", Some(c.per_cm), 0.1, 200.0)?;
        self.number("crimp.cv_percent", Some(c.cv_percent), 0.0, 40.0)?;
        self.number("crimp.amplitude_um", Some(c.amplitude_um), 0.0, 1e4)?;
        if c.amplitude_um == 0.0 {
            return Ok(None);
        }
        if c.reach_mm() > MAX_CRIMP * room_mm {
            let most = (MAX_CRIMP * room_mm / c.reach_mm() * c.amplitude_um).floor();
            let message = format!(
                "expected at most {most} um in a ply that leaves its fibres {:.1} um to either \
                 side, found {}",
                1e3 * room_mm.max(0.0),
                c.amplitude_um
            );
            return Err(Error::spec(self.key("crimp.amplitude_um"), message));
        }
        Ok(Some(c))
    }

    pub(super) fn hairiness(&self) -> Result<Option<HairinessSpec>, Error> {
        let Some(h) = self.spec.hairiness else {
            return Ok(None);
        };
        self.number("hairiness.index", Some(h.index), 0.0, 1e3)?;
        self.number("hairiness.length_mm", Some(h.length_mm), 0.01, 100.0)?;
        self.number("hairiness.reach_mm", Some(h.reach_mm), 1e-3, 100.0)?;
        self.number("hairiness.curl_mm", Some(h.curl_mm), 0.01, 1e3)?;
        self.number("hairiness.returning", Some(h.returning), 0.0, 1.0)?;
        self.number("hairiness.lean[0]", Some(h.lean[0]), -1.0, 1.0)?;
        self.number("hairiness.lean[1]", Some(h.lean[1]), -1.0, 1.0)?;
        Ok(Some(h).filter(|h| h.index > 0.0))
    }

    pub(super) fn flattening(&self) -> Result<Option<FlatteningSpec>, Error> {
        let Some(f) = self.spec.flattening else {
            return Ok(None);
        };
        self.number("flattening.crossing", Some(f.crossing), 1.0, 3.0)?;
        self.number("flattening.float", Some(f.float), 0.3, 1.0)?;
        Ok(Some(f).filter(|f| (f.crossing, f.float) != (1.0, 1.0)))
    }

    pub(super) fn ring_dye(&self) -> Result<Option<RingDyeSpec>, Error> {
        let Some(d) = self.spec.ring_dye else {
            return Ok(None);
        };
        if !self.spec.blend.is_empty() {
            let message = "give ring_dye or blend, not both";
            return Err(Error::spec(self.key("ring_dye"), message));
        }
        self.number("ring_dye.depth", Some(d.depth), 0.0, 1.0)?;
        self.colour("ring_dye.core_colour", d.core_colour)?;
        Ok(Some(d))
    }

    pub(super) fn blend_tufts(&self, of_materials: bool) -> Result<Option<BlendTuftSpec>, Error> {
        let Some(t) = self.spec.blend_tufts else {
            return Ok(None);
        };
        if self.spec.blend.is_empty() || of_materials {
            let message = "expected a blend whose parts differ by colour alone";
            return Err(Error::spec(self.key("blend_tufts"), message));
        }
        self.number("blend_tufts.fibres", Some(t.fibres), 1.0, 1e5)?;
        self.number("blend_tufts.length_mm", Some(t.length_mm), 0.1, 1e5)?;
        Ok(Some(t))
    }

    fn colour(&self, key: &str, colour: Rgb) -> Result<(), Error> {
        let channels = <[f32; 3]>::from(colour);
        for channel in channels {
            self.number(key, Some(f64::from(channel)), 0.0, 1.0)?;
        }
        Ok(())
    }
}
