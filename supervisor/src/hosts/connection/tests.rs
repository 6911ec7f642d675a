use std::fs;
use std::os::unix::fs::PermissionsExt;

use super::*;
use crate::hosts::Share;

fn host(launcher: Launcher, binaries: &Path) -> Host {
    let environment = BTreeMap::new();
    Host { name: "a".to_owned(), launcher, share: Share::Of(1.0), binaries: Some(binaries.to_owned()), environment }
}

/// A program `maes` in a folder of its own. A copy, because this process must not open the program
/// for writing: a child that another test starts just then would have it open, too, and the system
/// executes no such file.
fn maes(script: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (text, program) = (folder.path().join("text"), folder.path().join("maes"));
    fs::write(&text, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&text, fs::Permissions::from_mode(0o755)).unwrap();
    assert!(Command::new("cp").arg(text).arg(program).status().unwrap().success());
    folder
}

fn wait<T>(what: impl Fn() -> Option<T>) -> T {
    loop {
        if let Some(value) = what() {
            return value;
        }
        thread::yield_now();
    }
}

const HELLO: &str = r#"echo welcome; echo '{"hello":{"build":"b","cores":3}}'"#;

#[test]
fn a_host_says_who_it_is_what_agents_print_and_how_they_end() {
    let script = format!(
        r#"test "$1" = serve-agents || exit 9
{HELLO}
read -r request
case $request in *secret*) ;; *) exit 8 ;; esac
echo '{{"log":{{"agents":{{"first":4,"last":5}},"line":"hello"}}}}'
echo '{{"ended":{{"agents":{{"first":9,"last":9}},"code":0}}}}'
echo '{{"ended":{{"agents":{{"first":4,"last":5}},"code":7}}}}'
while read -r request; do :; done"#
    );
    let (folder, logs) = (maes(&script), tempfile::tempdir().unwrap());
    let connection = Connection::open(&host(Launcher::Local, folder.path()), Path::new("/"), logs.path()).unwrap();
    assert_eq!(wait(|| connection.hello().unwrap()), ("b".to_owned(), 3));
    let environment = BTreeMap::from([("X".to_owned(), "secret".to_owned())]);
    let log = logs.path().join("agent_4.log");
    connection.start(Group { first: 4, last: 5 }, Vec::new(), environment, &log).unwrap();
    assert_eq!(wait(|| connection.ended(Group { first: 4, last: 5 })), 7);
    assert_eq!(connection.ended(Group::of(9)), None, "it was not started");
    assert_eq!(fs::read_to_string(&log).unwrap(), "hello\n");
    assert_eq!(connection.launcher_code(), None);
    drop(connection);
    assert_eq!(fs::read_to_string(logs.path().join("host_a.log")).unwrap(), "welcome\n");
}

#[test]
fn agents_of_a_lost_host_have_ended() {
    let (folder, logs) = (maes(&format!("{HELLO}; read -r request; kill -9 $$")), tempfile::tempdir().unwrap());
    let connection = Connection::open(&host(Launcher::Local, folder.path()), Path::new("/"), logs.path()).unwrap();
    let log = logs.path().join("agent_0.log");
    connection.start(Group { first: 0, last: 0 }, Vec::new(), BTreeMap::new(), &log).unwrap();
    assert_eq!(wait(|| connection.ended(Group::of(0))), 137);
}

#[test]
fn a_launcher_that_fails_is_quoted() {
    let logs = tempfile::tempdir().unwrap();
    let words = ["sh", "-c", "echo no route to host >&2; exit 255", "sh"].map(str::to_owned).to_vec();
    let connection = Connection::open(&host(Launcher::Words(words), Path::new("/opt")), Path::new("/"), logs.path());
    let connection = connection.unwrap();
    let error = wait(|| connection.hello().err()).to_string();
    assert!(error.starts_with("host \"a\": its launcher ended with exit code 255: no route to host"), "{error}");
}

#[test]
fn a_shell_gets_one_word() {
    let folder = maes("echo \"$1\" >&2");
    let odd = folder.path().join("it's; here");
    fs::create_dir(&odd).unwrap();
    fs::rename(folder.path().join("maes"), odd.join("maes")).unwrap();
    let logs = tempfile::tempdir().unwrap();
    let words = ["sh", "-c"].map(str::to_owned).to_vec();
    let connection = Connection::open(&host(Launcher::Shell(words), &odd), Path::new("/"), logs.path()).unwrap();
    let error = wait(|| connection.hello().err()).to_string();
    assert!(error.contains("exit code 0: serve-agents"), "{error}");
}

#[test]
fn launcher_that_talks_nonsense_is_refused_and_fills_no_disk() {
    let logs = tempfile::tempdir().unwrap();
    let open = |words: &[&str]| {
        let launcher = Launcher::Words(words.iter().map(|word| (*word).to_owned()).collect());
        Connection::open(&host(launcher, Path::new("/none")), Path::new("/"), logs.path()).unwrap()
    };
    for words in [&["yes"][..], &["sh", "-c", "yes 'no line ends' | tr -d '\\n'"]] {
        let connection = open(words);
        let refused = wait(|| connection.hello().err()).to_string();
        assert!(refused.starts_with("host \"a\": its launcher prints 64 KiB and more, and no greeting"), "{refused}");
    }
    let length = fs::metadata(logs.path().join("host_a.log")).unwrap().len();
    assert!(length <= 4 * NOISE_MAX as u64, "{length} bytes");
    // A banner is none, and what it says on its way out is in the error.
    let connection = open(&["sh", "-c", "echo welcome; echo 'no route' >&2; exit 3"]);
    let refused = wait(|| connection.hello().err()).to_string();
    assert!(refused.contains("ended with exit code 3: no route"), "{refused}");
}
