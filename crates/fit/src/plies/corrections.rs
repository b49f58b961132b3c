//! What a fit changes of plies: its ranges, and the tables that a place stands for.

use organza_measure::fit::Bound;
use organza_scene::optics::EVERY_YARN;
use organza_scene::ply_table::{PlyFile, PlyTable};

/// Ranges of a search, narrower than what a file may have: least, greatest, the value that
/// changes nothing, and where the search starts.
const THROUGH_ODDS: [f64; 4] = [0.1, 5.0, 1.0, 1.0];
/// Ends of a range are flat to the search.
const SPREAD_DEG: [f64; 4] = [0.0, 25.0, 0.0, 2.5];
const ABSORPTION: [f64; 4] = [0.0, 4.0, 1.0, 1.0];

/// The values of a fit: two of all plies, then absorption by channel.
pub struct Corrections {
    /// Yarns that have an absorption of their own; [`EVERY_YARN`] where all share one.
    yarns: Vec<String>,
    /// What a fit leaves as it is: radius and extinction follow from the fibres, and the light
    /// that leaves a cloth hardly distinguishes them from what is fitted.
    kept: PlyFile,
    /// Their ranges.
    pub bounds: Vec<Bound>,
    /// What changes nothing.
    pub none: Vec<f64>,
}

impl Corrections {
    /// Those of a cloth with such tables; yarns have absorptions of their own where there are names.
    pub fn new(mut yarns: Vec<String>, own: &PlyFile) -> Corrections {
        if yarns.len() < 2 {
            yarns = vec![EVERY_YARN.to_owned()];
        }
        let mut kept = own.clone();
        for table in kept.values_mut() {
            *table = PlyTable {
                radius_scale: table.radius_scale,
                extinction_scale: table.extinction_scale,
                ..PlyTable::default()
            };
        }
        let mut list = Corrections {
            yarns,
            kept,
            bounds: Vec::new(),
            none: Vec::new(),
        };
        list.add("through_odds_scale".into(), THROUGH_ODDS);
        list.add("spread_deg".into(), SPREAD_DEG);
        for yarn in list.yarns.clone() {
            for letter in ["r", "g", "b"] {
                list.add(format!("{yarn}.absorption_scale.{letter}"), ABSORPTION);
            }
        }
        list
    }

    fn add(&mut self, name: String, [low, high, none, start]: [f64; 4]) {
        self.bounds.push(Bound {
            name,
            low,
            high,
            start,
        });
        self.none.push(none);
    }

    /// The `[plies]` section of a place.
    pub fn tables(&self, place: &[f64]) -> PlyFile {
        let [through, spread] = [0, 1].map(|k| place.get(k).copied());
        let mut file = self.kept.clone();
        let all = file.entry(EVERY_YARN.to_owned()).or_default();
        all.through_odds_scale = through;
        all.spread_deg = spread;
        for (yarn, rgb) in self.yarns.iter().zip(place[2..].chunks_exact(3)) {
            let table = file.entry(yarn.clone()).or_default();
            table.absorption_scale = Some([rgb[0], rgb[1], rgb[2]]);
        }
        file
    }

    /// The only channel that a value changes, 0 to 2; none if it changes all.
    pub fn channel(&self, k: usize) -> Option<usize> {
        k.checked_sub(2).map(|k| k % 3)
    }

    /// Distances of a place from what changes nothing, in deviations of uniform ranges: they
    /// keep what the data does not determine where the fibres put it.
    pub fn priors(&self, place: &[f64]) -> Vec<f64> {
        let both = self.bounds.iter().zip(&self.none).zip(place);
        both.map(|((b, none), x)| (x - none) / ((b.high - b.low) / 12f64.sqrt()))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_scatter::PlyCorrection;
    use organza_scene::ply_table::of_yarn;

    #[test]
    fn a_place_becomes_tables_and_the_first_changes_nothing() {
        let two = Corrections::new(vec!["warp".into(), "weft".into()], &PlyFile::new());
        let file = two.tables(&two.none);
        assert_eq!(
            of_yarn(&file, "warp").correction(),
            PlyCorrection::default()
        );
        assert!(two.priors(&two.none).iter().all(|&p| p == 0.0));
        assert_eq!(
            [1, 2, 4, 5].map(|k| two.channel(k)),
            [None, Some(0), Some(2), Some(0)]
        );
        let place = [0.5, 9.0, 1.0, 2.0, 3.0, 0.1, 0.2, 0.3];
        let file = two.tables(&place);
        let (warp, weft) = (of_yarn(&file, "warp"), of_yarn(&file, "weft"));
        assert_eq!(warp.absorption_scale, Some([1.0, 2.0, 3.0]));
        assert_eq!(weft.absorption_scale, Some([0.1, 0.2, 0.3]));
        assert_eq!(
            (warp.through_odds_scale, weft.spread_deg),
            (Some(0.5), Some(9.0))
        );
        let own = PlyTable {
            radius_scale: Some(1.1),
            through_odds_scale: Some(3.0),
            ..PlyTable::default()
        };
        let own = [("silk".to_owned(), own)].into();
        let one = Corrections::new(vec!["silk".into()], &own);
        let silk = of_yarn(&one.tables(&one.none), "silk");
        assert_eq!(silk.radius_scale, Some(1.1));
        assert_eq!(silk.through_odds_scale, Some(1.0));
        assert_eq!(one.bounds.len(), 5);
        assert_eq!(one.tables(&place[..5]).len(), 2);
    }
}
