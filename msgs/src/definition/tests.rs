use super::*;

#[test]
fn comments_belong_to_what_they_stand_beside() {
    let text = "# The whole,\n# in two lines.\n\n# A section.\n\n# above\nuint8 ONE=1   # beside\n              # below\n# next\n\
                float64[3] a\n\nstring b  # last\n";
    let definition = Definition::parse(text).unwrap();
    assert_eq!(definition.comment, ["The whole,", "in two lines."]);
    let [one] = definition.constants().collect::<Vec<_>>()[..] else { panic!("{definition:?}") };
    assert_eq!((one.name, one.value, one.line), ("ONE", Value::Constant("1"), 7));
    assert_eq!(one.comment, ["above", "beside", "below"]);
    let [a, b] = definition.fields().collect::<Vec<_>>()[..] else { panic!("{definition:?}") };
    assert_eq!((a.name, a.of_type.length, &a.comment[..]), ("a", Length::Array(3), &["next"][..]));
    assert_eq!(
        (b.name, b.of_type.primitive(), &b.comment[..]),
        ("b", Some((17, "std::string::String")), &["last"][..])
    );
    assert_eq!(Definition::parse("# All.\n").unwrap().comment, ["All."]);
}

#[test]
fn types_are_read() {
    let of = |text| Type::parse(text).unwrap();
    let text = Type { element: "string", string_bound: Some(22), length: Length::Bounded(3) };
    assert_eq!(of("string<=22[<=3]"), text);
    assert_eq!(of("uint8[]").length, Length::Unbounded);
    assert_eq!(of("Point").message("geometry_msgs"), ("geometry_msgs", "Point"));
    assert_eq!(of("std_msgs/msg/Header").message("geometry_msgs"), ("std_msgs", "Header"));
}

#[test]
fn errors_name_line_and_remedy() {
    for (text, line, problem) in [
        ("uint8", 1, "`uint8`: expected TYPE NAME, TYPE NAME DEFAULT or TYPE NAME=VALUE"),
        ("\nuint9 a", 2, "`uint9 a`: type uint9: expected a primitive type or a message, such as"),
        ("uint8[0] a", 1, "`uint8[0] a`: type uint8[0]: expected"),
        ("uint8[3 a", 1, "`uint8[3 a`: type uint8[3: expected"),
        ("uint8<=3 a", 1, "`uint8<=3 a`: type uint8<=3: expected"),
        ("a/b/c/D a", 1, "`a/b/c/D a`: type a/b/c/D: expected"),
        ("uint8 a__b", 1, "`uint8 a__b`: name a__b: expected small letters"),
        ("uint8 a_", 1, "`uint8 a_`: name a_: expected small letters"),
        ("uint8 1a", 1, "`uint8 1a`: name 1a: expected small letters"),
        ("uint8 a=1", 1, "`uint8 a=1`: name a: expected capitals"),
        ("uint8 A=256", 1, "`uint8 A=256`: value 256: expected one number or boolean of this type"),
        ("string A=\"x y\"", 1, "`string A=\"x y\"`: value \"x y\": expected one number or boolean"),
        ("float64[2] a 1", 1, "`float64[2] a 1`: value 1: expected one number or boolean"),
        ("uint8 a\nint8 a", 2, "`int8 a`: there is another a"),
    ] {
        let error = Definition::parse(text).unwrap_err();
        assert_eq!(error.line, line, "{text}");
        assert!(error.to_string().starts_with(problem), "{error}");
    }
}
