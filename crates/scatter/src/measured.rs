//! `kind = "measured"`: a fibre by its lobes, as a goniometer sees them: colours, widths along the
//! fibre, and profiles around it.

use crate::fibre::{Fibre, FibreModel};
use crate::fibre_catalogue::FibreKind;
use crate::lobe_table::{LobeTable, ROWS, SHAPED};
use crate::longitudinal::{Balance, Blur, MAX_BLUR_DEG};
use crate::near::LOBES;
use crate::near::parts::{NearKind, NearParts};
use glam::{Vec3, Vec4};
use organza_basis::{PathRng, Rgb};
use serde::Deserialize;

/// Most values of a profile.
const MAX_VALUES: usize = 1024;
/// Least steps of a table.
const MIN_STEPS: usize = 32;
/// An index of textile fibres: near fields send the first lobe from where a round fibre of it
/// reflects.
const IOR: f32 = 1.55;

/// A fibre of up to three lobes. A lobe sends a colour, at every inclination the same, with a
/// Gaussian blur along the fibre and a profile over the azimuth, averaged over where the fibre is
/// met: which side of it a ray meets is unknown, so that its near field is its far field.
///
/// The lobes share one [`Balance`], which keeps energy and reciprocity: it is made for the lobes
/// scaled, channel by channel, to send on all light.
#[derive(Clone, Debug)]
pub struct MeasuredFibre {
    blurs: [Blur; LOBES],
    balance: Balance,
    table: LobeTable,
    through: Rgb,
}

/// The table of a [`MeasuredFibre`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredTable {
    /// One to three; the first is what the surface reflects.
    pub lobes: Vec<MeasuredLobe>,
}

/// One lobe.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredLobe {
    /// Share of the light that it sends on, linear RGB. Those of all lobes add up to at most 1.
    pub colour: [f32; 3],
    /// Deviation of the inclination from the specular cone.
    pub longitudinal_deg: f32,
    /// Light at even steps of the azimuth from 0 (straight on) to 180 degrees (back), of any
    /// scale: two values at least.
    pub profile: Vec<f32>,
}

impl MeasuredLobe {
    fn check(&self) -> Result<(), String> {
        if let Some(c) = self.colour.iter().find(|c| !(0.0..=1.0).contains(*c)) {
            return Err(format!(
                "colour: expected three numbers from 0 to 1, found {c}"
            ));
        }
        let width = self.longitudinal_deg;
        if !(0.0..=MAX_BLUR_DEG).contains(&width) {
            return Err(format!(
                "longitudinal_deg: expected a number from 0 to {MAX_BLUR_DEG}, found {width}"
            ));
        }
        let count = self.profile.len();
        if !(2..=MAX_VALUES).contains(&count) {
            return Err(format!(
                "profile: expected 2 to {MAX_VALUES} values, found {count}"
            ));
        }
        let wrong = |v: &&f32| !(0.0..=1e9).contains(*v);
        if let Some(v) = self.profile.iter().find(wrong) {
            return Err(format!(
                "profile: expected numbers from 0 to 1e9, found {v}"
            ));
        }
        if self.profile.iter().all(|v| *v == 0.0) {
            return Err("profile: expected a number above 0".into());
        }
        Ok(())
    }

    /// The profile over its greatest value at a share of the way from straight on to back.
    fn at(&self, share: f32) -> f32 {
        let values = self.profile.iter();
        let most = values.fold(f32::MIN_POSITIVE, |a, &b| a.max(b));
        let last = self.profile.len() - 1;
        let place = share.clamp(0.0, 1.0) * last as f32;
        let i = (place as usize).min(last - 1);
        let (a, b) = (self.profile[i], self.profile[i + 1]);
        (a + (b - a) * (place - i as f32)) / most
    }
}

impl MeasuredFibre {
    /// Checks lobes and balances them.
    ///
    /// # Errors
    /// `.key: what was expected`.
    pub fn new(lobes: &[MeasuredLobe]) -> Result<MeasuredFibre, String> {
        if !(1..=SHAPED).contains(&lobes.len()) {
            let count = lobes.len();
            return Err(format!(".lobes: expected 1 to 3 lobes, found {count}"));
        }
        for (i, lobe) in lobes.iter().enumerate() {
            lobe.check().map_err(|why| format!(".lobes[{i}].{why}"))?;
        }
        let colours: Vec<Rgb> = lobes.iter().map(|lobe| Rgb::from(lobe.colour)).collect();
        let sum = colours.iter().fold(Rgb::BLACK, |sum, c| sum + *c);
        // Shares that are written with few digits may exceed 1 by their rounding.
        if sum.max_component() > 1.0 + 1e-4 {
            let found = sum.0.to_array();
            return Err(format!(
                ".lobes: expected colours that add up to at most 1, found {found:?}"
            ));
        }
        let mut energies = [Rgb::BLACK; LOBES];
        energies[..lobes.len()].copy_from_slice(&colours);
        // Where a channel is dark, any share will do.
        let even = Vec3::splat(1.0 / lobes.len() as f32);
        let is_lit = sum.0.cmpgt(Vec3::ZERO);
        let white = energies.map(|e| Rgb(Vec3::select(is_lit, e.0 / sum.0, even)));
        let widths = [0, 1, 2, 3].map(|p| lobes[p.min(lobes.len() - 1)].longitudinal_deg);
        let blurs = widths.map(|deg| Blur::new(deg.to_radians()));
        let balance = Balance::new(blurs, |_| {
            let mut own = white;
            own[lobes.len()..].fill(Rgb::BLACK);
            own
        });
        // A whole number of steps of the longest profile, so that none of its values is passed
        // over; those of others are kept where they divide it.
        let longest = lobes.iter().map(|lobe| lobe.profile.len() - 1);
        let steps = longest.max().unwrap_or(1);
        let nodes = steps * MIN_STEPS.div_ceil(steps) + 1;
        let shapes = [0, 1, 2].map(|p: usize| -> Vec<Vec3> {
            let share = |k: usize| k as f32 / (nodes - 1) as f32;
            let value = |k| lobes.get(p).map_or(0.0, |lobe| lobe.at(share(k)));
            (0..nodes).map(|k| Vec3::splat(value(k))).collect()
        });
        let mut table = LobeTable::new(nodes);
        for _ in 0..ROWS {
            table.add_row(energies, &shapes);
        }
        Ok(MeasuredFibre {
            blurs,
            balance,
            table,
            through: sum,
        })
    }
}

impl FibreModel for MeasuredFibre {
    fn blurs(&self) -> &[Blur] {
        &self.blurs
    }

    fn balance(&self) -> &Balance {
        &self.balance
    }

    fn near_parts(&self) -> NearParts {
        // The lobes come from the table. The absorption only distinguishes dyes for the cache.
        let through = self.through.0.max(Vec3::splat(1e-6));
        let kind = NearKind::Dielectric {
            ior: IOR,
            absorption_radii: Rgb(-0.5 * through.map(f32::ln).min(Vec3::ZERO)),
        };
        NearParts {
            section: Some(self.table.sections()),
            ..NearParts::new(kind, &self.blurs, 1.0, &self.balance)
        }
    }

    fn far_lobes(&self, mean_cos: f32) -> [f32; LOBES] {
        self.table.far_lobes(mean_cos)
    }

    fn far(&self, mean_cos: f32, azimuth_rad: f32) -> [Vec4; LOBES] {
        self.table.far(mean_cos, azimuth_rad)
    }

    fn far_azimuth_sample(&self, lobe: usize, mean_cos: f32, rng: &mut PathRng) -> f32 {
        self.table.far_azimuth_sample(lobe, mean_cos, rng)
    }

    fn azimuth_nodes(&self) -> usize {
        self.table.azimuth_nodes()
    }
}

impl FibreKind for MeasuredTable {
    fn build(&self) -> Result<Fibre, String> {
        MeasuredFibre::new(&self.lobes).map(Fibre::from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proofs::{oblique, prove_lobe};
    use crate::{FibreFrame, Lobe};
    use organza_basis::{Moments, warp};

    const TANGENT: Vec3 = Vec3::new(0.6, -0.64, 0.48);

    fn lobe(colour: [f32; 3], longitudinal_deg: f32, profile: &[f32]) -> MeasuredLobe {
        MeasuredLobe {
            colour,
            longitudinal_deg,
            profile: profile.to_vec(),
        }
    }

    fn lobes() -> [MeasuredLobe; 2] {
        [
            lobe([0.1, 0.1, 0.1], 5.0, &[1.0, 1.0, 2.0]),
            lobe([0.9, 0.7, 0.0], 12.0, &[8.0, 3.0, 0.5, 0.0, 0.2]),
        ]
    }

    #[test]
    fn lobes_are_proved() {
        let fibre = Fibre::from(MeasuredFibre::new(&lobes()).unwrap());
        for w_out in oblique() {
            prove_lobe("far", &fibre.far_field(TANGENT), TANGENT, w_out, 20);
            let near = fibre.near_field(FibreFrame::new(TANGENT, w_out), 0.4);
            prove_lobe("near", &near, TANGENT, w_out, 20);
        }
    }

    /// Red sends all light on, blue a tenth; swapping light and view changes nothing, and lobes
    /// have the shape of their profiles. The twin's colours add up to less.
    #[test]
    fn energy_reciprocity_and_shape() {
        let fibre = Fibre::from(MeasuredFibre::new(&lobes()).unwrap());
        let mut rng = PathRng::from_seed(81);
        let mut apart = 0.0f32;
        for _ in 0..500 {
            let [a, b] = [(); 2].map(|()| warp::uniform_sphere(rng.unit2()));
            let lobe = fibre.far_field(TANGENT);
            let there = lobe.eval(a, b).0 * TANGENT.cross(a).length();
            let back = lobe.eval(b, a).0 * TANGENT.cross(b).length();
            apart = apart.max((there - back).abs().max_element() / (there.max_element() + 1e-3));
        }
        assert!(apart < 1e-3, "seed 81: {apart}");
        let w_out = oblique()[0];
        let sent = |fibre: &Fibre, rng: &mut PathRng| {
            let mut sent = [Moments::default(); 3];
            for _ in 0..20_000 {
                let drawn = fibre.far_field(TANGENT).sample(w_out, rng);
                let weight = drawn.map_or(Vec3::ZERO, |s| s.weight.0);
                for (sent, w) in sent.iter_mut().zip(weight.to_array()) {
                    sent.add(f64::from(w));
                }
            }
            sent
        };
        // The balance keeps light to a thousandth.
        let off =
            |m: &Moments, exact: f64| ((m.mean - exact).abs() - 1e-3 * exact) / m.standard_error();
        for (m, exact) in sent(&fibre, &mut rng).iter().zip([1.0, 0.8, 0.1]) {
            assert!(off(m, exact) < 4.0, "seed 81: {m:?} {exact}");
        }
        let mut darker = lobes();
        darker[1].colour[0] = 0.88;
        let darker = Fibre::from(MeasuredFibre::new(&darker).unwrap());
        let twin = sent(&darker, &mut rng)[0];
        assert!(off(&twin, 1.0) > 5.0, "seed 81: {twin:?}");
        let [_, tt, ..] = fibre.far(0.9, 0.0);
        let [_, aside, ..] = fibre.far(0.9, std::f32::consts::FRAC_PI_4);
        assert!((tt.x / aside.x - 8.0 / 3.0).abs() < 0.02, "{tt} {aside}");
    }

    #[test]
    fn wrong_tables_name_their_key() {
        for (lobes, expected) in [
            (vec![], ".lobes: expected 1 to 3 lobes, found 0"),
            (
                vec![lobe([0.6; 3], 5.0, &[1.0, 1.0]); 2],
                ".lobes: expected colours that add up to at most 1, found [1.2, 1.2, 1.2]",
            ),
            (
                vec![lobe([0.6; 3], 50.0, &[1.0, 1.0])],
                ".lobes[0].longitudinal_deg: expected a number from 0 to 34, found 50",
            ),
            (
                vec![lobe([0.6; 3], 5.0, &[0.0, 0.0])],
                ".lobes[0].profile: expected a number above 0",
            ),
            (
                vec![lobe([0.6; 3], 5.0, &[1.0])],
                ".lobes[0].profile: expected 2 to 1024 values, found 1",
            ),
            (
                vec![lobe([0.6; 3], 5.0, &[1.0, f32::NAN])],
                ".lobes[0].profile: expected numbers from 0 to 1e9, found NaN",
            ),
        ] {
            assert_eq!(MeasuredFibre::new(&lobes).unwrap_err(), expected);
        }
    }
}
