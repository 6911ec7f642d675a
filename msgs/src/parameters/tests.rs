use super::*;

fn parameters() -> Parameters {
    let mut parameters = Parameters::default();
    parameters.declare([
        DeclaredParameter::fixed("seed", 7_i64, "the seed").with_range(0.0, 9.0),
        DeclaredParameter::fixed("execution.rtf", 0.0, "the pace").with_range(0.0, 10.0).settable(),
        DeclaredParameter::fixed("map.noise.fill", 0.5, "walls"),
    ]);
    parameters
}

fn named(name: &str, value: impl Into<ParameterValue>) -> Parameter {
    Parameter { name: name.to_owned(), value: value.into() }
}

fn texts(words: &[&str]) -> Vec<String> {
    words.iter().map(ToString::to_string).collect()
}

#[test]
fn names_are_listed_below_prefixes_and_down_to_a_depth() {
    let listed = |prefixes: &[&str], depth| parameters().list(&texts(prefixes), depth).names;
    assert_eq!(listed(&[], 0), ["execution.rtf", "map.noise.fill", "seed"]);
    assert_eq!(listed(&[], 1), ["seed"]);
    assert_eq!(listed(&["map"], 0), ["map.noise.fill"]);
    assert_eq!(listed(&["map"], 1), [""; 0]);
    assert_eq!(listed(&["map.noise", "seed"], 1), ["map.noise.fill", "seed"]);
    assert_eq!(listed(&["ma"], 0), [""; 0]);
    assert_eq!(parameters().list(&[], 0).prefixes, ["execution", "map.noise"]);
}

#[test]
fn what_does_not_fit_is_refused_and_changes_nothing() {
    let mut changed = parameters();
    let mut refused = |parameter: Parameter| changed.set(&parameter).unwrap_err();
    assert_eq!(refused(named("seed", 3_i64)), "seed is read-only");
    assert_eq!(refused(named("execution.rtf", 3_i64)), "execution.rtf has type double, not integer");
    assert_eq!(refused(named("execution.rtf", 11.0)), "execution.rtf = 11: expected 0 to 10");
    assert_eq!(refused(named("execution.rtf", f64::NAN)), "execution.rtf = NaN: expected 0 to 10");
    assert_eq!(refused(named("nothing", true)), "there is no parameter nothing");
    assert!(changed.set_all(&[named("execution.rtf", 2.0), named("seed", 3_i64)]).is_err());
    assert_eq!(changed, parameters());
    changed.set_all(&[named("execution.rtf", 2.0)]).unwrap();
    assert_eq!(changed.values(&texts(&["execution.rtf", "nothing"])), [2.0.into(), ParameterValue::default()]);
}

#[test]
fn what_there_is_not_is_described_by_its_name() {
    let described = parameters().descriptors(&texts(&["seed", "nothing"]));
    assert_eq!((described[0].r#type, described[0].integer_range[0].to_value), (ParameterType::PARAMETER_INTEGER, 9));
    assert_eq!((described[1].name.as_str(), described[1].r#type), ("nothing", ParameterType::PARAMETER_NOT_SET));
}

#[test]
fn answers_fit_into_a_datagram() {
    let many = vec!["seed".to_owned(); 1000];
    let values = parameters().values(&many);
    assert!(fits(&values) && values.len() >= 16, "{}", values.len());
    assert!(fits(&parameters().descriptors(&many)));
    let mut crowd = Parameters::default();
    crowd.declare((0..1000).map(|number| DeclaredParameter::fixed(&format!("a.{number}"), number, "")));
    assert!(fits(&crowd.list(&[], 0)) && crowd.list(&[], 0).names.len() >= 64);
}
