//! Makes the structs of the messages of their `.msg`, `.srv` and `.action` files: one file for each
//! package, and the list of all types.
//!
//! Crates that make structs of such files were tried on ours. The structs of `roslibrust_codegen`
//! 0.26 need its run-time crate, have no comments, and pass arrays of bytes to serde as sequences
//! with a length, which CDR does not have there; `ros2msg` 0.5 parses only, and
//! `ros2-interfaces-jazzy-serde` 0.0.7 has the structs of published packages alone.

#[path = "src/definition.rs"]
mod definition;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{env, fs};

use definition::{Definition, Item, Length, PART_SEPARATOR, Type, Value};

/// The package of `msg/` and `srv/`; those under `src/standard` have the name of their folder.
const OWN_PACKAGE: &str = "maes_msgs";

/// Fields that are something else in Rust than the rules say, with the same bytes.
const FIELD_TYPES: [(&str, &str, &str); 3] = [
    ("maes_msgs/AgentMessage", "data", "crate::shared_bytes::SharedBytes"),
    ("geometry_msgs/PoseWithCovariance", "covariance", "crate::geometry_msgs::Covariance"),
    ("geometry_msgs/TwistWithCovariance", "covariance", "crate::geometry_msgs::Covariance"),
];

/// Structs that are deserialised by hand.
const DESERIALISED_BY_HAND: [&str; 1] = ["simulation_interfaces/SetEntityStateRequest"];

/// Structs that are ordered, as all their fields are.
const ORDERED: [&str; 2] = ["builtin_interfaces/Duration", "builtin_interfaces/Time"];

/// Most elements of an array for which serde and `Default` are implemented.
const ARRAY_MAX: usize = 32;

/// An interface file.
struct File {
    package: String,
    name: String,
    /// Relative to the folder of the crate.
    path: String,
    text: String,
}

/// What a struct is made of: a message, or a part of a service or action.
struct Struct<'a> {
    file: &'a File,
    /// What is added to the name of the file.
    suffix: &'static str,
    /// Line before its definition.
    line: usize,
    definition: Definition<'a>,
}

fn main() -> ExitCode {
    match generate() {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

fn generate() -> Result<(), String> {
    let variable = |name: &str| env::var_os(name).map(PathBuf::from).ok_or_else(|| format!("{name} is not set"));
    let (folder, out) = (variable("CARGO_MANIFEST_DIR")?, variable("OUT_DIR")?);
    let files = files(&folder)?;
    let structs = structs(&files)?;
    let known: BTreeMap<String, &Struct<'_>> = structs.iter().map(|one| (one.full_name(), one)).collect();
    let packages: BTreeSet<&str> = files.iter().map(|file| file.package.as_str()).collect();
    for package in packages {
        let mut code = String::new();
        for one in structs.iter().filter(|one| one.file.package == package) {
            code += &one.code(&known)?;
        }
        for file in files.iter().filter(|file| file.package == package) {
            code += &file.trait_of_type();
        }
        write(&out.join(format!("{package}.rs")), &code)?;
    }
    let mut all = "&[".to_owned();
    for File { package, name, .. } in files.iter().filter(|file| file.is_message()) {
        let _infallible = write!(all, "<crate::{package}::{name} as Message>::TYPE,");
    }
    write(&out.join("all.rs"), &(all + "]"))
}

fn write(path: &Path, code: &str) -> Result<(), String> {
    fs::write(path, code).map_err(|error| format!("{}: {error}", path.display()))
}

/// The interface files, sorted by package and name.
fn files(folder: &Path) -> Result<Vec<File>, String> {
    let standard = "src/standard";
    for watched in ["build.rs", "src/definition.rs", "msg", "srv", standard] {
        println!("cargo::rerun-if-changed={watched}");
    }
    let mut files = Vec::new();
    read_folder(folder, "msg", OWN_PACKAGE, &mut files)?;
    read_folder(folder, "srv", OWN_PACKAGE, &mut files)?;
    for (path, name) in entries(folder, standard)? {
        read_folder(folder, &path, &name, &mut files)?;
    }
    files.sort_by(|a, b| (&a.package, &a.name).cmp(&(&b.package, &b.name)));
    Ok(files)
}

/// Path relative to `folder`, and name, of everything in a folder.
fn entries(folder: &Path, of: &str) -> Result<Vec<(String, String)>, String> {
    let failed = |error: std::io::Error| format!("{of}: {error}");
    let name = |entry: std::io::Result<fs::DirEntry>| Ok(entry?.file_name().to_string_lossy().into_owned());
    let names: std::io::Result<Vec<String>> = fs::read_dir(folder.join(of)).map_err(failed)?.map(name).collect();
    Ok(names.map_err(failed)?.into_iter().map(|name| (format!("{of}/{name}"), name)).collect())
}

fn read_folder(folder: &Path, of: &str, package: &str, files: &mut Vec<File>) -> Result<(), String> {
    for (path, name) in entries(folder, of)? {
        if folder.join(&path).is_dir() {
            read_folder(folder, &path, package, files)?;
            continue;
        }
        let Some((name, "msg" | "srv" | "action")) = name.rsplit_once('.') else {
            return Err(format!("msgs/{path}: expected a .msg, .srv or .action file"));
        };
        let text = fs::read_to_string(folder.join(&path)).map_err(|error| format!("msgs/{path}: {error}"))?;
        files.push(File { package: package.to_owned(), name: name.to_owned(), path, text });
    }
    Ok(())
}

fn structs(files: &[File]) -> Result<Vec<Struct<'_>>, String> {
    let mut structs = Vec::new();
    for file in files {
        let suffixes: &[&str] = match file.path.rsplit('.').next() {
            Some("srv") => &["Request", "Response"],
            Some("action") => &["Goal", "Result", "Feedback"],
            _ => &[""],
        };
        let parts: Vec<&str> = match suffixes.len() {
            1 => vec![&file.text],
            _ => file.text.split(&format!("{PART_SEPARATOR}\n")).collect(),
        };
        if parts.len() != suffixes.len() {
            let (path, found, expected) = (&file.path, parts.len(), suffixes.len());
            return Err(format!("msgs/{path}: {found} parts, expected {expected} with {PART_SEPARATOR} between them"));
        }
        let mut line = 0;
        for (part, suffix) in parts.into_iter().zip(suffixes) {
            let definition = Definition::parse(part)
                .map_err(|error| format!("msgs/{}:{}: {error}", file.path, line + error.line))?;
            structs.push(Struct { file, suffix, line, definition });
            line += part.lines().count() + 1;
        }
    }
    Ok(structs)
}

impl File {
    fn is_message(&self) -> bool {
        self.path.ends_with(".msg")
    }

    /// What says which ROS type a struct or a service is.
    fn trait_of_type(&self) -> String {
        let Self { package, name, path, .. } = self;
        let definition = format!("include_str!(concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/{path}\"))");
        if self.is_message() {
            return format!(
                "impl crate::message::Message for {name} {{ const TYPE: crate::message::MessageType = \
                 crate::message::MessageType {{ package: \"{package}\", name: \"{name}\", definition: {definition} \
                 }}; }}\n"
            );
        }
        let kind = if path.ends_with(".srv") { "service" } else { "action" };
        let comment =
            format!("/// The {kind} `{package}/{name}`.\n#[derive(Clone, Copy, Debug)]\npub struct {name};\n");
        let parts = match kind {
            "service" => format!("type Request = {name}Request; type Response = {name}Response;"),
            _ => format!("type Goal = {name}Goal; type Result = {name}Result; type Feedback = {name}Feedback;"),
        };
        let of_trait = if kind == "service" { "Service" } else { "Action" };
        format!(
            "{comment}impl crate::service::{of_trait} for {name} {{ const PACKAGE: &'static str = \"{package}\"; const \
             NAME: &'static str = \"{name}\"; const DEFINITION: &'static str = {definition}; {parts} }}\n"
        )
    }
}

impl Struct<'_> {
    fn name(&self) -> String {
        format!("{}{}", self.file.name, self.suffix)
    }

    fn full_name(&self) -> String {
        format!("{}/{}", self.file.package, self.name())
    }

    fn wrong(&self, item: &Item<'_>, problem: &str) -> String {
        format!("msgs/{}:{}: `{}`: {problem}", self.file.path, self.line + item.line, item.code)
    }

    fn code(&self, known: &BTreeMap<String, &Struct<'_>>) -> Result<String, String> {
        let (name, full_name) = (self.name(), self.full_name());
        let mut comment = self.definition.comment.clone();
        let of_what = match self.suffix {
            "" => "The message",
            "Request" => "The request of the service",
            "Response" => "The response of the service",
            "Goal" => "The goal of the action",
            "Result" => "The result of the action",
            _ => "The feedback of the action",
        };
        let of_what = format!("{of_what} `{}/{}`.", self.file.package, self.file.name);
        if !comment.is_empty() {
            comment.push("");
        }
        comment.push(&of_what);
        let mut code = doc(&comment, "");
        let has_defaults = self.definition.fields().any(|field| field.value != Value::None);
        let mut derived = vec!["Clone", "Debug", "PartialEq", "serde::Serialize"];
        derived.extend(self.all(known, &|item| is_copy(&self.field_type(item), item)).then_some("Copy"));
        derived.extend(self.all(known, &|item| !item.of_type.element.starts_with("float")).then_some("Eq"));
        derived.extend((!has_defaults).then_some("Default"));
        derived.extend((!DESERIALISED_BY_HAND.contains(&full_name.as_str())).then_some("serde::Deserialize"));
        if ORDERED.contains(&full_name.as_str()) {
            derived.extend(["PartialOrd", "Ord"]);
        }
        let _infallible = writeln!(code, "#[derive({})]\npub struct {name} {{", derived.join(", "));
        let mut defaults = String::new();
        for field in self.definition.fields() {
            if let Length::Array(length @ ARRAY_MAX..) = field.of_type.length
                && length > ARRAY_MAX
                && self.other_type(field).is_none()
            {
                let problem = format!("an array of more than {ARRAY_MAX} elements needs a line in FIELD_TYPES");
                return Err(self.wrong(field, &problem));
            }
            if field.of_type.primitive().is_none() && !known.contains_key(&self.referred(field)) {
                let problem = format!("there is no {}.msg in msg/ and src/standard/", self.referred(field));
                return Err(self.wrong(field, &problem));
            }
            code += &doc(&field.comment, field.code);
            let of_type = self.field_type(field);
            if of_type == "Vec<u8>" {
                code += "#[serde(with = \"serde_bytes\")]\n";
            }
            let name = escaped(field.name);
            let _infallible = writeln!(code, "pub {name}: {of_type},");
            let _infallible = match field.value {
                Value::Default(value) => write!(defaults, "{name}: {},", literal(field, value)),
                _ => write!(defaults, "{name}: Default::default(),"),
            };
        }
        code += "}\n";
        if has_defaults {
            let body = format!("fn default() -> Self {{ Self {{ {defaults} }} }}");
            let _infallible = writeln!(code, "impl Default for {name} {{ {body} }}");
        }
        let constants: String = self.definition.constants().map(constant).collect();
        if !constants.is_empty() {
            let _infallible = writeln!(code, "impl {name} {{\n{constants}}}");
        }
        Ok(code)
    }

    /// Whether something holds for all fields, and for those of all messages in them.
    fn all(&self, known: &BTreeMap<String, &Struct<'_>>, holds: &dyn Fn(&Item<'_>) -> bool) -> bool {
        self.definition.fields().all(|field| {
            holds(field) && known.get(&self.referred(field)).is_none_or(|message| message.all(known, holds))
        })
    }

    /// The full name of the message that a field has.
    fn referred(&self, field: &Item<'_>) -> String {
        let (package, name) = field.of_type.message(&self.file.package);
        format!("{package}/{name}")
    }

    fn other_type(&self, field: &Item<'_>) -> Option<&'static str> {
        let found = FIELD_TYPES.iter().find(|(of, name, _)| *of == self.full_name() && *name == field.name);
        found.map(|(.., of_type)| *of_type)
    }

    fn field_type(&self, field: &Item<'_>) -> String {
        if let Some(of_type) = self.other_type(field) {
            return of_type.to_owned();
        }
        let element = match field.of_type.primitive() {
            Some((_, rust)) => rust.to_owned(),
            None => format!("crate::{}", self.referred(field).replace('/', "::")),
        };
        match field.of_type.length {
            Length::One => element,
            Length::Array(length) => format!("[{element}; {length}]"),
            Length::Bounded(_) | Length::Unbounded => format!("Vec<{element}>"),
        }
    }
}

fn is_copy(rust_type: &str, field: &Item<'_>) -> bool {
    let Type { element, length, .. } = field.of_type;
    !rust_type.ends_with("SharedBytes")
        && !element.ends_with("string")
        && matches!(length, Length::One | Length::Array(_))
}

fn constant(item: &Item<'_>) -> String {
    let (Value::Constant(value) | Value::Default(value)) = item.value else { return String::new() };
    let rust = item.of_type.primitive().map_or("", |(_, rust)| rust);
    format!("{}pub const {}: {rust} = {};\n", doc(&item.comment, item.code), item.name, literal(item, value))
}

/// A number or a boolean in Rust.
fn literal(item: &Item<'_>, value: &str) -> String {
    match item.of_type.element {
        "float32" | "float64" if !value.contains(['.', 'e']) => format!("{value}.0"),
        _ => value.to_owned(),
    }
}

/// A doc comment; without lines, the code of the definition.
fn doc(lines: &[&str], code: &str) -> String {
    if lines.is_empty() {
        return format!("/// `{code}`\n");
    }
    let escape = |line: &str| line.replace('\\', "\\\\").replace('[', "\\[").replace('<', "\\<");
    lines.iter().map(|line| format!("/// {}\n", escape(line))).collect()
}

/// A name that may be a keyword of Rust.
fn escaped(name: &str) -> String {
    let is_keyword = matches!(name, "type" | "loop" | "match" | "move" | "ref" | "use" | "where" | "in" | "mod" | "fn");
    format!("{}{name}", if is_keyword { "r#" } else { "" })
}
