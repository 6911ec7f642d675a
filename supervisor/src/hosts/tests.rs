use super::*;

fn parse(text: &str) -> Result<Hosts, String> {
    Hosts::parse(Path::new("h.toml"), text).map_err(|error| error.to_string())
}

fn hosts(tables: &str) -> Hosts {
    parse(&format!("server = \"10.0.0.1\"\n{tables}")).unwrap()
}

fn refused(tables: &str) -> String {
    parse(&format!("server = \"10.0.0.1\"\n{tables}")).unwrap_err()
}

fn spread(tables: &str, agents: std::ops::Range<u32>) -> Result<Vec<Vec<u32>>, String> {
    let split = hosts(tables).distribute(&agents.collect());
    split
        .map(|hosts| hosts.into_iter().map(|ids| ids.into_iter().collect()).collect())
        .map_err(|error| error.to_string())
}

#[test]
fn launchers_are_words_before_the_program() {
    let found = hosts(
        "[[host]]\nname = \"a\"\nlauncher = \"ssh\"\naddress = \"me@10.0.0.2\"\nbinaries = \"/opt/maes\"\n\
         [[host]]\nname = \"b\"\nlauncher = \"srun\"\nenvironment = { RUST_BACKTRACE = \"1\" }\n\
         [[host]]\nname = \"c\"\naddress = \"pod-3\"\ncommand = [\"kubectl\", \"exec\", \"-i\", \"{address}\", \"-c\", \"{name}\", \"--\"]\n\
         [[host]]\nname = \"d\"\nlauncher = \"local\"\n",
    );
    let words = |place: usize| match &found.hosts[place].launcher {
        Launcher::Local => String::new(),
        Launcher::Words(words) | Launcher::Shell(words) => words.join(" "),
    };
    assert!(words(0).starts_with("ssh ") && words(0).ends_with(" me@10.0.0.2"), "{}", words(0));
    assert!(matches!(found.hosts[0].launcher, Launcher::Shell(_)));
    assert!(words(1).starts_with("srun ") && words(1).ends_with("--nodelist b"), "{}", words(1));
    assert_eq!(words(2), "kubectl exec -i pod-3 -c c --");
    assert_eq!(found.hosts[3].launcher, Launcher::Local);
    assert_eq!(found.hosts[1].environment["RUST_BACKTRACE"], "1");
}

#[test]
fn agents_are_listed_or_split_by_share() {
    let even = "[[host]]\nname = \"a\"\nlauncher = \"local\"\n[[host]]\nname = \"b\"\nlauncher = \"local\"\n";
    assert_eq!(spread(even, 0..5).unwrap(), [vec![0, 1, 2], vec![3, 4]]);
    let weighed = even.replacen("launcher", "share = 3\nlauncher", 1);
    assert_eq!(spread(&weighed, 0..4).unwrap(), [vec![0, 1, 2], vec![3]]);
    let listed = even.replacen("launcher", "agents = \"4,1-2\"\nlauncher", 1);
    assert_eq!(spread(&listed, 0..6).unwrap(), [vec![1, 2, 4], vec![0, 3, 5]]);
    assert!(spread(&listed, 0..4).unwrap_err().contains("agent 4 takes no part"));
    let twice = even.replace("launcher", "agents = \"1\"\nlauncher");
    assert!(spread(&twice, 0..2).unwrap_err().contains("agent 1: on two hosts, \"a\" and \"b\""));
    let short = even
        .replacen("launcher", "agents = \"0\"\nlauncher", 1)
        .replace("name = \"b\"\n", "name = \"b\"\nagents = \"1\"\n");
    assert!(spread(&short, 0..3).unwrap_err().contains("agent 2 has no host"));
    for count in 0..50 {
        let agents: Vec<u32> = spread(&weighed, 0..count).unwrap().concat();
        assert_eq!(agents, (0..count).collect::<Vec<_>>(), "each agent has one host");
    }
}

#[test]
fn bad_files_give_one_line_with_the_place() {
    let host = |line: &str| refused(&format!("[[host]]\nname = \"a\"\n{line}"));
    for (error, expected) in [
        (parse("").unwrap_err(), "missing field `server`"),
        (parse("server = \"\"").unwrap_err(), "server = \"\": expected "),
        (refused(""), "expected 1 to 1000 tables [[host]]"),
        (refused("[[host]]\nlauncher = \"ssh\""), "line 2: missing field `name`"),
        (refused("[[host]]\nname = \"a b\"\nlauncher = \"ssh\""), "host \"a b\": expected a name of letters"),
        (host(""), "host \"a\": expected a launcher: "),
        (host("launcher = \"rsh\""), "line 4: unknown variant `rsh`"),
        (host("launcher = \"command\""), "host \"a\": launcher = \"command\": expected a command"),
        (host("launcher = \"ssh\"\ncommand = [\"x\"]"), "command: only with launcher = \"command\""),
        (host("command = []"), "command: expected a program"),
        (host("launcher = \"ssh\"\naddress = \"-oProxyCommand=x\""), "address = \"-oProxyCommand=x\": expected a name"),
        (host("launcher = \"ssh\"\nagents = \"3-1\""), "agents = \"3-1\": expected ids and ranges"),
        (host("launcher = \"ssh\"\nagents = \"1\"\nshare = 1"), "expected agents or a share, not both"),
        (host("launcher = \"ssh\"\nshare = 0"), "share = 0: expected a number above 0"),
        (host("launcher = \"ssh\"\nport = 1"), "line 5: unknown field `port`"),
        (
            host("launcher = \"ssh\"\nenvironment = { \"A=B\" = \"\" }"),
            "environment: \"A=B\": expected a name without `=`",
        ),
        (host("launcher = \"ssh\"\n[[host]]\nname = \"a\"\nlauncher = \"ssh\""), "two hosts have this name"),
    ] {
        assert!(error.starts_with("h.toml: ") && error.contains(expected), "{error} / {expected}");
        assert!(!error.contains('\n'), "{error}");
    }
    let missing = Hosts::read(Path::new("/nowhere.toml")).unwrap_err().to_string();
    assert!(missing.starts_with("/nowhere.toml: "), "{missing}");
    assert!(Hosts::read(Path::new("/dev/zero")).unwrap_err().to_string().contains("expected a regular file"));
}

#[test]
fn processes_have_neighbouring_agents() {
    let of = |ids: &[u32], size| -> Vec<(u32, u32)> {
        groups(&ids.iter().copied().collect(), size).iter().map(|group| (group.first, group.last)).collect()
    };
    assert_eq!(of(&[0, 1, 2, 3, 4], 2), [(0, 1), (2, 3), (4, 4)]);
    assert_eq!(of(&[1, 2, 5, 7, 8], 10), [(1, 2), (5, 5), (7, 8)]);
    assert_eq!(of(&[], 10), []);
}
