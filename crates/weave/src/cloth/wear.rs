//! Cloth whose faces were rubbed: dye is lost where it stands out.

use super::heights::Heights;
use super::pills::{self, PillSpec};
use super::recolour::{MAX_MATERIALS, recoloured};
use super::{Cloth, PrintSide};
use crate::Error;
use crate::strand::thickest_fibre_mm;
use glam::Vec3;
use organza_basis::{Rgb, Segment};
use serde::Deserialize;

/// Shades between a colour and what is left of it where most was rubbed off.
const SHADES: usize = 6;
/// Share of the places of a face that lie lower than what is rubbed most: thick threads stand out
/// farther (estimated).
const CROWNS: f32 = 0.9;
/// Length of fibre, in depths of wear, over which its colour changes.
const PART: f32 = 0.25;

/// `[wear]`: rubbing that takes dye off the crowns of threads, and entangles fibres.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct WearSpec {
    /// Share of the dye that the highest places lose, 0 to 1; without pills it is required.
    pub amount: Option<f64>,
    /// How far below them dye is lost, micrometres, 1 to 1e5: less, the deeper. It goes with
    /// `amount`.
    pub depth_um: Option<f64>,
    /// Colour of the fibres without dye.
    #[serde(default = "undyed")]
    pub colour: Rgb,
    /// Which faces were rubbed.
    #[serde(default)]
    pub side: PrintSide,
    /// Balls of entangled fibre, if any.
    pub pills: Option<PillSpec>,
}

/// Cotton without dye (estimated).
pub(super) fn undyed() -> Rgb {
    Rgb::new(0.6, 0.55, 0.45)
}

/// The wear of a cloth.
#[derive(Clone, Debug)]
pub(super) struct Wear {
    /// Heights, outwards, of what is rubbed most on the face and on the back.
    crowns_mm: [Option<f32>; 2],
    depth_mm: f32,
    /// Materials of the shades of every material, from one that lost a little to the palest.
    materials: Vec<u16>,
}

impl Cloth {
    /// Rubs the faces of the cloth: from now on its segments have the materials of the wear, and
    /// those of pills come after all others.
    ///
    /// # Errors
    /// The key of `[wear]` at fault.
    pub fn wear(&mut self, spec: &WearSpec) -> Result<(), Error> {
        for channel in spec.colour.0.to_array() {
            number("colour", f64::from(channel), 0.0, 1.0)?;
        }
        let heights = Heights::of(self);
        match (spec.amount, spec.depth_um, &spec.pills) {
            (Some(amount), Some(depth_um), _) => self.rub(spec, [amount, depth_um], &heights)?,
            (None, None, Some(_)) => {}
            (amount, ..) => {
                let key = amount.map_or("amount", |_| "depth_um");
                let message = "is missing: give amount and depth_um, or pills alone";
                return Err(Error::spec(format!("wear.{key}"), message));
            }
        }
        if let Some(pills) = &spec.pills {
            let pills = pills::pills(self, pills, spec.side, &heights)?;
            let thickest = self.yarns.iter().map(|y| thickest_fibre_mm(y));
            let beyond = 2.0 * thickest.fold(0.0, f64::max) as f32;
            let bounds = &mut self.tile.bounds_mm;
            for top in pills.iter().map(|p| p.top_mm() as f32) {
                bounds.min.z = bounds.min.z.min(top - beyond);
                bounds.max.z = bounds.max.z.max(top + beyond);
            }
            self.pills = pills.into();
        }
        Ok(())
    }

    /// Takes off a share of the dye down to a depth in micrometres.
    fn rub(
        &mut self,
        spec: &WearSpec,
        [amount, depth_um]: [f64; 2],
        heights: &Heights,
    ) -> Result<(), Error> {
        number("amount", amount, 0.0, 1.0)?;
        number("depth_um", depth_um, 1.0, 1e5)?;
        let plain = self.materials.len();
        if plain * (1 + SHADES) > MAX_MATERIALS {
            let most = MAX_MATERIALS / (1 + SHADES);
            let message = format!("expected a cloth of at most {most} colours, found {plain}");
            return Err(Error::spec("wear", message));
        }
        let materials = self.recolour(SHADES, |own, shade| {
            let lost = amount as f32 * (shade + 1) as f32 / SHADES as f32;
            Rgb(own.0.lerp(spec.colour.0, lost))
        });
        let rubbed = |is_back: bool| {
            let other = if is_back {
                PrintSide::Face
            } else {
                PrintSide::Back
            };
            (spec.side != other).then(|| heights.outer_mm(is_back, CROWNS))
        };
        self.wear = Some(std::sync::Arc::new(Wear {
            crowns_mm: [false, true].map(rubbed),
            depth_mm: depth_um as f32 * 1e-3,
            materials,
        }));
        Ok(())
    }
}

/// Refuses a value out of range.
fn number(key: &str, value: f64, from: f64, to: f64) -> Result<(), Error> {
    let message = || format!("expected a number from {from} to {to}, found {value}");
    match (from..=to).contains(&value) {
        true => Ok(()),
        false => Err(Error::spec(format!("wear.{key}"), message())),
    }
}

impl Wear {
    /// Gives a segment the materials of the wear.
    pub fn rub(&self, segment: &Segment, emit: &mut dyn FnMut(&Segment)) {
        let radius = segment.start_radius_mm.max(segment.end_radius_mm);
        let part_mm = (PART * self.depth_mm).max(2.0 * radius);
        recoloured(
            segment,
            part_mm,
            |plain, at_mm| self.material(plain, at_mm),
            emit,
        );
    }

    /// The material of a place whose fibre has another one on cloth that is new.
    fn material(&self, plain: u16, at_mm: Vec3) -> u16 {
        let lost = |(crown, outward): (&Option<f32>, f32)| {
            let below = crown.map_or(f32::INFINITY, |crown| crown - outward * at_mm.z);
            1.0 - (below / self.depth_mm).clamp(0.0, 1.0)
        };
        let lost = self.crowns_mm.iter().zip([1.0, -1.0]).map(lost);
        let lost = lost.fold(0.0, f32::max);
        match (lost * SHADES as f32).round() as usize {
            0 => plain,
            shade => self.materials[usize::from(plain) * SHADES + shade - 1],
        }
    }
}
