use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, symlink};

use nix::sys::stat::Mode;
use nix::unistd::mkfifo;

use super::*;

/// A process id that no process of Linux can have.
const NO_PROCESS: u32 = u32::MAX;

const RECORDING: &[u8] = b"\x89MCAP0\r\n and more";

fn refusal(file: &Path) -> String {
    let error = check(file).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::InvalidInput);
    assert_eq!(Destination::create(file).err().unwrap().to_string(), error.to_string());
    error.to_string()
}

fn mode(file: &Path) -> u32 {
    fs::symlink_metadata(file).unwrap().mode() & 0o7777
}

#[test]
fn only_recordings_are_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("keys"), "ssh-ed25519 ...").unwrap();
    assert!(refusal(&path("keys")).starts_with("a file that is no recording; nothing was written; "));
    // A beginning of the magic is no recording either.
    fs::write(path("short"), &RECORDING[..4]).unwrap();
    refusal(&path("short"));
    fs::write(path("a.mcap"), RECORDING).unwrap();
    symlink(path("a.mcap"), path("link")).unwrap();
    assert!(refusal(&path("link")).starts_with("a symbolic link; "));
    symlink(path("nowhere"), path("dangling")).unwrap();
    refusal(&path("dangling"));
    mkfifo(&path("fifo"), Mode::S_IRWXU).unwrap();
    assert!(refusal(&path("fifo")).starts_with("a FIFO; "));
    assert!(refusal(Path::new("/dev/full")).starts_with("a device; "));
    assert!(refusal(folder.path()).starts_with("a folder; "));

    assert_eq!(fs::read(path("keys")).unwrap(), b"ssh-ed25519 ...");
    assert_eq!(fs::read(path("a.mcap")).unwrap(), RECORDING);
    assert!(!path("nowhere").exists());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 6, "no temporary file is left");

    fs::write(path("empty"), "").unwrap();
    for allowed in ["a.mcap", "empty", "new"] {
        check(&path(allowed)).unwrap();
    }
}

#[test]
fn mode_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    for expected in [0o600, 0o640, 0o444] {
        fs::write(&file, RECORDING).unwrap();
        fs::set_permissions(&file, Permissions::from_mode(expected | 0o4000)).unwrap();
        let (mut destination, _handle) = Destination::create(&file).unwrap();
        assert_eq!(mode(&destination.temporary), 0o600);
        destination.publish().unwrap();
        assert_eq!(mode(&file), expected);
        fs::remove_file(&file).unwrap();
    }
}

#[test]
fn what_took_the_place_meanwhile_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let [file, victim] = ["a.mcap", "victim"].map(|name| folder.path().join(name));
    fs::write(&victim, "precious").unwrap();
    let (mut destination, _handle) = Destination::create(&file).unwrap();
    symlink(&victim, &file).unwrap();
    assert_eq!(destination.publish().unwrap_err().kind(), ErrorKind::InvalidInput);
    drop(destination);
    assert!(fs::symlink_metadata(&file).unwrap().is_symlink());
    assert_eq!(fs::read(&victim).unwrap(), b"precious");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn files_of_killed_processes_are_removed() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let file = path("a.mcap");
    let abandoned = path(&temporary_name("a.mcap", NO_PROCESS));
    fs::write(&abandoned, RECORDING).unwrap();
    // Of a process that lives, and of a process elsewhere that holds the lock.
    let living = path(&temporary_name("a.mcap", std::os::unix::process::parent_id()));
    fs::write(&living, RECORDING).unwrap();
    let locked = path(&temporary_name("a.mcap", NO_PROCESS - 1));
    fs::write(&locked, RECORDING).unwrap();
    let lock = File::open(&locked).unwrap();
    lock.try_lock().unwrap();
    // No recordings, other names, and what is no file.
    let foreign = [".a.mcap.4294967293.tmp", ".a.mcap.x.tmp", ".b.mcap.4294967295.tmp", ".a.mcap.+9.tmp", "a.mcap.tmp"];
    for name in foreign {
        fs::write(path(name), if name.starts_with(".b") { RECORDING } else { b"notes" }).unwrap();
    }
    let link = path(&temporary_name("a.mcap", NO_PROCESS - 3));
    symlink(path("a.mcap.tmp"), &link).unwrap();
    let fifo = path(&temporary_name("a.mcap", NO_PROCESS - 4));
    mkfifo(&fifo, Mode::S_IRWXU).unwrap();

    let (destination, _handle) = Destination::create(&file).unwrap();
    assert!(!abandoned.exists());
    assert!(living.exists() && locked.exists());
    assert!(foreign.iter().all(|name| path(name).exists()));
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert!(fs::symlink_metadata(&fifo).unwrap().file_type().is_fifo());

    // A second recorder for the same file finds the first one at work.
    let refused = Destination::create(&file).err().unwrap();
    assert_eq!(refused.kind(), ErrorKind::AlreadyExists);
    assert!(destination.temporary.exists());
    drop(lock);
    drop(destination);
    drop(Destination::create(&file).unwrap());
    assert!(!locked.exists());
}

#[test]
fn name_with_a_slash_is_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag/");
    check(&bag).unwrap();
    let (destination, _) = Destination::create(&bag).unwrap();
    drop(destination);
    assert!(!bag.exists(), "an aborted recording leaves no folder");
    let (mut destination, mut handle) = Destination::create(&bag).unwrap();
    handle.write_all(RECORDING).unwrap();
    destination.publish().unwrap();
    destination.write_metadata(|name| format!("of {name}")).unwrap();
    assert_eq!(fs::read(bag.join("bag_0.mcap")).unwrap(), RECORDING);
    assert_eq!(fs::read_to_string(bag.join("metadata.yaml")).unwrap(), "of bag_0.mcap\n");
    drop(destination);

    // A later run replaces both, the metadata at the end.
    let (mut destination, mut handle) = Destination::create(&bag).unwrap();
    handle.write_all(RECORDING).unwrap();
    destination.publish().unwrap();
    assert!(!bag.join("metadata.yaml").exists(), "those of the former recording");
    drop(destination);
    fs::write(bag.join("thesis.tex"), "...").unwrap();
    assert!(refusal(&bag).starts_with("a folder with another file, thesis.tex; nothing was written; "));
}
