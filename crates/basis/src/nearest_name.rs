//! The valid name nearest to a misspelt one.

/// The candidate most like `name`, for messages of the form "did you mean".
///
/// `None` when nothing is near: more than half of the longer word would have
/// to change (Damerau-Levenshtein distance, letter case ignored).
pub fn nearest_name<'a, S: AsRef<str> + ?Sized + 'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a S>,
) -> Option<&'a str> {
    let lower = name.to_lowercase();
    candidates
        .into_iter()
        .map(|c| {
            let c = c.as_ref();
            (strsim::damerau_levenshtein(&lower, &c.to_lowercase()), c)
        })
        .filter(|(distance, c)| 2 * distance <= name.chars().count().max(c.chars().count()))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, c)| c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_near_and_not_the_far() {
        let names = ["albedo", "extinction", "sggx"];
        assert_eq!(nearest_name("Albdeo", &names), Some("albedo"));
        assert_eq!(nearest_name("exinction", &names), Some("extinction"));
        assert_eq!(nearest_name("resolution", &["spp", "seed"]), None);
    }
}
