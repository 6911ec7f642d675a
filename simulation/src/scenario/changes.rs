//! Changes of keys: what flags, plans, events and forks do to a scenario.
//!
//! All changes are made before the result is read, so that the cost is that of one reading; only if
//! it is refused, the change at fault is found by bisection.

use super::Scenario;
use super::filled_in::drop_filled_in;

/// A dotted key with its new value; `None` removes it.
pub(super) type Change<'a> = (&'a str, Option<&'a toml::Value>);

/// Why changed keys are no scenario.
#[derive(Debug)]
pub(super) enum Refusal {
    /// The change with this number cannot be made, for this reason.
    Key(usize, String),
    /// After the change with this number the keys are no scenario; before it they are.
    Scenario(usize, toml::Table, Box<toml::de::Error>),
}

/// The scenario after all changes of the keys `before`, which are a scenario. `read` counts how
/// often keys are read as a scenario.
pub(super) fn changed(before: &toml::Table, changes: &[Change<'_>], read: &mut usize) -> Result<Scenario, Refusal> {
    let mut after = |count: usize| -> Result<Scenario, Refusal> {
        let table = keys_after(before, &changes[..count])?;
        *read += 1;
        let scenario: Result<Scenario, _> = table.clone().try_into();
        scenario.map_err(|error| Refusal::Scenario(count.saturating_sub(1), table, Box::new(error)))
    };
    let mut refusal = match after(changes.len()) {
        Err(refusal @ Refusal::Scenario(..)) => refusal,
        other => return other,
    };
    // The first `legal` changes make a scenario, the first `illegal` ones do not.
    let (mut legal, mut illegal) = (0, changes.len());
    while illegal - legal > 1 {
        let middle = legal.midpoint(illegal);
        match after(middle) {
            Ok(_) => legal = middle,
            Err(other) => (illegal, refusal) = (middle, other),
        }
    }
    Err(refusal)
}

/// The keys `before` after all changes. Values that were filled in make room for those that the
/// changes decide.
pub(super) fn keys_after(before: &toml::Table, changes: &[Change<'_>]) -> Result<toml::Table, Refusal> {
    let mut table = before.clone();
    drop_filled_in(&mut table, changes);
    for (number, (key, value)) in changes.iter().enumerate() {
        change_key(&mut table, key, value.cloned()).map_err(|reason| Refusal::Key(number, reason))?;
    }
    Ok(table)
}

/// A key that a change of the other one takes the place of, as a scenario has one of them.
const IN_PLACE_OF: [(&str, &str); 2] = [("lidars", "lidar"), ("lidar", "lidars")];

/// Sets or removes a dotted key; missing tables of its path are created.
fn change_key(table: &mut toml::Table, key: &str, value: Option<toml::Value>) -> Result<(), String> {
    for (_, other) in IN_PLACE_OF.iter().filter(|(changed, _)| *changed == key && value.is_some()) {
        table.remove(*other);
    }
    let (path, last) = match key.rsplit_once('.') {
        Some((path, last)) => (Some(path), last),
        None => (None, key),
    };
    let mut place = table;
    for part in path.into_iter().flat_map(|path| path.split('.')) {
        place = place
            .entry(part)
            .or_insert_with(|| toml::Value::Table(toml::Table::new()))
            .as_table_mut()
            .ok_or_else(|| format!("`{part}` in `{key}` is not a table"))?;
    }
    match value {
        Some(value) => place.insert(last.to_owned(), value),
        None => place.remove(last),
    };
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn base() -> toml::Table {
        toml::from_str("seed = 7\nduration_s = 60.0\nmap = { kind = \"spheres\", size = 50 }\nagents.count = 3")
            .unwrap()
    }

    #[test]
    fn many_changes_are_read_once() {
        let keys: Vec<String> = (0..2000).map(|number| format!("agents.set.k{number}")).collect();
        let (one, wrong) = (toml::Value::from(1), toml::Value::from("x"));
        let mut changes: Vec<Change<'_>> = keys.iter().map(|key| (key.as_str(), Some(&one))).collect();
        let mut read = 0;
        assert_eq!(changed(&base(), &changes, &mut read).unwrap().agents.set.len(), 2000);
        assert_eq!(read, 1);
        changes.insert(1234, ("agents.count", Some(&wrong)));
        let refusal = changed(&base(), &changes, &mut read).unwrap_err();
        assert!(matches!(refusal, Refusal::Scenario(1234, ..)), "{refusal:?}");
        assert!(read <= 14, "{read}: once, and once for each halving");
    }

    #[test]
    fn several_lidars_take_the_place_of_one() {
        let one: toml::Table = toml::from_str("lidar = { rays = 9 }\nlidars = [{ name = \"top\" }]").unwrap();
        let mut base = base();
        base.insert("lidar".to_owned(), one["lidar"].clone());
        let several = changed(&base, &[("lidars", Some(&one["lidars"]))], &mut 0).unwrap();
        assert!(several.lidar.is_none() && several.lidars.is_some());
        let changes = [("lidars", Some(&one["lidars"])), ("lidar", Some(&one["lidar"]))];
        let single = changed(&base, &changes, &mut 0).unwrap();
        assert!(single.lidar.is_some() && single.lidars.is_none());
    }

    #[test]
    fn path_through_a_value_is_refused() {
        let value = toml::Value::from(1);
        let refusal =
            changed(&base(), &[("agents.count", Some(&value)), ("seed.x", Some(&value))], &mut 0).unwrap_err();
        assert!(matches!(&refusal, Refusal::Key(1, reason) if reason == "`seed` in `seed.x` is not a table"));
    }
}
