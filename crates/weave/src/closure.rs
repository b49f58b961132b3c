//! How the plies and fibres of a yarn close over a period of the tile.
//!
//! A tile must close: whatever leaves it on one side enters on the other. A random fibre that
//! is twisted by an arbitrary angle over the period would not close. Therefore a fibre is
//! longer than the tile: it runs through several periods (`windings`) before it meets itself,
//! and all its pieces lie in the one tile, as different fibres of the same cross-section. The
//! twist then only needs to close over all windings, which changes it by a few per cent at
//! most.

use crate::evenness::Profile;
use crate::named::gcd;
use crate::yarn::Yarn;
use std::f64::consts::TAU;

/// The largest number of periods, per visited ply, that a fibre runs through.
const MAX_ROUNDS: u32 = 16;

/// The cost of one more round, in units of the slope error of the outermost fibres and of the
/// relative error of the fibre count. With fewer rounds, more fibres differ from each other.
const ROUND_PRICE: f64 = 0.0025;

/// How a yarn's plies and fibres close over a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Closure {
    /// Turns of the plies over a period, times the number of plies.
    pub ply_shift: i64,
    /// Plies that one fibre visits.
    pub visited: u32,
    /// Times that a fibre passes through each ply that it visits.
    pub rounds: u32,
    /// Turns of a fibre about its ply over all windings.
    pub turns: i64,
    /// Swings of migration over all windings.
    pub swings: i64,
    /// Fibres per cycle of plies, each of `windings` pieces.
    pub fibres: u32,
}

impl Closure {
    /// The closure that is nearest to the twist and fibre count of the yarn.
    pub fn new(yarn: &Yarn, length_mm: f64) -> Closure {
        Closure::of_fibres(yarn, yarn.fibres_per_ply, length_mm)
    }

    /// The same for a thread that is uneven along its length: there are as many fibres as its
    /// thickest place holds.
    pub fn of_profile(yarn: &Yarn, profile: Option<&Profile>, length_mm: f64) -> Closure {
        let most = profile.map_or(1.0, Profile::most);
        let fibres = (f64::from(yarn.fibres_per_ply) * most).round() as u32;
        Closure::of_fibres(yarn, fibres.max(1), length_mm)
    }

    fn of_fibres(yarn: &Yarn, fibres_per_ply: u32, length_mm: f64) -> Closure {
        let plies = i64::from(yarn.plies);
        let shift_exact = plies as f64 * yarn.ply_twist_rad_per_mm * length_mm / TAU;
        let ply_shift = shift_exact.round() as i64;
        let shift = ply_shift.rem_euclid(plies) as usize;
        let visited = (plies as usize / gcd(plies as usize, shift)) as u32;
        let wanted = f64::from(fibres_per_ply);
        let close = |rounds: u32| {
            let exact = yarn.twist_rad_per_mm * length_mm / TAU * f64::from(rounds * visited);
            let turns = exact.round() as i64;
            // Pieces of one fibre must not coincide.
            let distinct = gcd(turns.unsigned_abs() as usize, rounds as usize) == 1;
            let fibres = (wanted / f64::from(rounds)).round().max(1.0);
            let swings = yarn
                .migration
                .map_or(0.0, |m| m.cycles_per_turn * exact.abs());
            let slope_error = (turns as f64 - exact).abs() * TAU * yarn.ply_radius_mm
                / (f64::from(rounds * visited) * length_mm);
            let count_error = (fibres * f64::from(rounds) / wanted - 1.0).abs();
            let closure = Closure {
                ply_shift,
                visited,
                rounds,
                turns,
                swings: swings.round() as i64,
                fibres: fibres as u32,
            };
            let price = slope_error + count_error + ROUND_PRICE * f64::from(rounds);
            (distinct, price, closure)
        };
        (2..=MAX_ROUNDS.min(fibres_per_ply))
            .map(close)
            .filter(|(distinct, ..)| *distinct)
            .fold(
                close(1),
                |best, next| if next.1 < best.1 { next } else { best },
            )
            .2
    }

    /// Periods that a fibre runs through.
    pub fn windings(&self) -> u32 {
        self.rounds * self.visited
    }

    /// Number of fibres in a cross-section of a ply.
    pub fn fibres_per_ply(&self) -> u32 {
        self.fibres * self.rounds
    }

    /// The twist of the fibres that results, radians per millimetre.
    pub fn twist_rad_per_mm(&self, length_mm: f64) -> f64 {
        TAU * self.turns as f64 / (f64::from(self.windings()) * length_mm)
    }

    /// The twist of the plies that results, radians per millimetre.
    pub fn ply_twist_rad_per_mm(&self, plies: u32, length_mm: f64) -> f64 {
        TAU * self.ply_shift as f64 / (f64::from(plies) * length_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn yarn(plies: u32, fibres: u32, turns_per_m: f64) -> Yarn {
        let twists = format!(
            "twist = {{ direction = 'Z', turns_per_m = {turns_per_m} }}\n\
             ply_twist = {{ direction = 'S', turns_per_m = {turns_per_m} }}"
        );
        let keys = format!("plies = {plies}\nfibres_per_ply = {fibres}\n{twists}");
        Yarn::new("cotton", &toml::from_str(&keys).unwrap()).unwrap()
    }

    #[test]
    fn closures_stay_near_the_twist_and_the_count_and_never_double_a_fibre() {
        for fibres in [30, 75, 200] {
            for turns in 1..40 {
                let yarn = yarn(1, fibres, 50.0 * f64::from(turns));
                let c = Closure::new(&yarn, 0.9);
                let twist = c.twist_rad_per_mm(0.9) - yarn.twist_rad_per_mm;
                let count = f64::from(c.fibres_per_ply()) / f64::from(fibres);
                assert!(twist.abs() * yarn.ply_radius_mm < 0.06, "{turns}: {c:?}");
                assert!((count - 1.0).abs() < 0.08, "{turns}: {c:?}");
                assert_eq!(gcd(c.turns.unsigned_abs() as usize, c.rounds as usize), 1);
            }
        }
        let straight = Closure::new(&yarn(1, 50, 0.0), 1.0);
        assert_eq!(
            (straight.rounds, straight.turns, straight.fibres),
            (1, 0, 50)
        );
    }

    #[test]
    fn plies_that_shift_over_the_period_are_all_visited() {
        let c = Closure::new(&yarn(3, 40, 400.0), 0.85);
        assert_eq!((c.ply_shift, c.visited), (-1, 3));
        let c = Closure::new(&yarn(4, 40, 500.0), 1.0);
        assert_eq!((c.ply_shift, c.visited), (-2, 2));
        assert_eq!(c.windings() % 2, 0);
    }
}
