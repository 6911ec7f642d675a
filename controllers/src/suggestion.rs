//! The nearest known name to a misspelt one.

/// Appended to an error about an unknown name: `; did you mean ...?`, or nothing if no known name
/// is near.
#[must_use]
pub fn did_you_mean<K: AsRef<str>>(unknown: &str, known: &[K]) -> String {
    let distance = |name: &&str| strsim::osa_distance(unknown, name);
    let nearest = known.iter().map(AsRef::as_ref).min_by_key(distance);
    match nearest.filter(|name| distance(name) <= (unknown.len() / 3).max(1)) {
        Some(name) => format!("; did you mean `{name}`?"),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::did_you_mean;

    #[test]
    fn near_names_are_suggested_and_far_ones_are_not() {
        let known = ["rbw", "dsvp", "dsvp-auction"];
        assert_eq!(did_you_mean("dspv", &known), "; did you mean `dsvp`?");
        assert_eq!(did_you_mean("dsvp-action", &known), "; did you mean `dsvp-auction`?");
        assert_eq!(did_you_mean("lvd", &known), "");
        assert_eq!(did_you_mean("", &known), "");
        assert_eq!(did_you_mean("x", &[""; 0]), "");
    }
}
