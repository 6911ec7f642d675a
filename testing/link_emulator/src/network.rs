//! A network of namespaces.

use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::net::Ipv4Addr;
use std::os::fd::AsFd;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use system::wall_clock::now;
use thiserror::Error;

use crate::device;
use crate::switch::{Counts, Link, Switch};

/// Most hosts of a network: their addresses end with 1 to 254.
const HOSTS_MAX: usize = 254;

/// Longest frame: that of Ethernet with its header.
const FRAME_MAX: usize = 1514;

/// Wall time after which the switch looks whether it has to end.
const PERIOD: Duration = Duration::from_millis(50);

/// Where the command line tool keeps its names of namespaces.
const NAMED: &str = "/run/netns";

/// Why there is no network.
#[derive(Debug, Error)]
pub enum NetworkError {
    /// This machine or this user cannot have one.
    #[error("no network namespaces with TAP devices here: {0}")]
    Unavailable(String),
    #[error("expected 1 to {HOSTS_MAX} hosts")]
    Hosts,
    #[error("{command}: {reason}")]
    Ip { command: String, reason: String },
}

/// Some hosts, each with the address 10.83.0.`n` at its only device, and the switch between them.
/// Dropping it removes them.
#[derive(Debug)]
pub struct Network {
    hosts: Vec<String>,
    stop: Arc<AtomicBool>,
    counts: Arc<Mutex<Counts>>,
    switch: Option<JoinHandle<()>>,
}

impl Network {
    /// Makes a network.
    ///
    /// # Errors
    /// If this machine or this user cannot have one.
    pub fn create(hosts: usize, link: Link) -> Result<Self, NetworkError> {
        static MADE: AtomicU32 = AtomicU32::new(0);
        if !(1..=HOSTS_MAX).contains(&hosts) {
            return Err(NetworkError::Hosts);
        }
        remove_left_behind();
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let name = |host: usize| format!("maes-{}-{number}-{host}", std::process::id());
        let stop = Arc::new(AtomicBool::new(false));
        let counts = Arc::new(Mutex::new(Counts::default()));
        // From here on dropping it removes what has been made.
        let mut network = Self { hosts: Vec::new(), stop, counts, switch: None };
        let mut devices = Vec::new();
        for host in 0..hosts {
            // The name of a device has at most fifteen bytes.
            let short = format!("m{:x}-{number:x}-{host:x}", std::process::id());
            let device =
                device::open(&short).map_err(|error| NetworkError::Unavailable(format!("{}: {error}", device::TUN)))?;
            let name = name(host);
            ip(&["netns", "add", &name]).map_err(|error| NetworkError::Unavailable(error.to_string()))?;
            network.hosts.push(name.clone());
            ip(&["link", "set", &short, "netns", &name, "name", "eth0"])?;
            let address = format!("{}/24", network.address(host));
            ip(&["-n", &name, "address", "add", &address, "dev", "eth0"])?;
            for device in ["lo", "eth0"] {
                ip(&["-n", &name, "link", "set", device, "up"])?;
            }
            ip(&["-n", &name, "route", "add", "224.0.0.0/4", "dev", "eth0"])?;
            devices.push(device);
        }
        let (stop, counts) = (Arc::clone(&network.stop), Arc::clone(&network.counts));
        network.switch =
            Some(thread::spawn(move || forward(&devices, Switch::new(link, devices.len()), &stop, &counts)));
        Ok(network)
    }

    /// The names of the namespaces.
    #[must_use]
    pub fn hosts(&self) -> &[String] {
        &self.hosts
    }

    /// The address of a host.
    #[must_use]
    pub fn address(&self, host: usize) -> Ipv4Addr {
        Ipv4Addr::new(10, 83, 0, u8::try_from(host + 1).unwrap_or(u8::MAX))
    }

    /// A command on a host. It gets the environment that is set on it.
    #[must_use]
    pub fn command(&self, host: usize, program: &Path) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.hosts[host]]).arg(program);
        command
    }

    /// What has happened to the frames so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        *self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(switch) = self.switch.take() {
            // It has panicked, or it ends within a period.
            drop(switch.join());
        }
        for host in &self.hosts {
            drop(ip(&["netns", "delete", host]));
        }
    }
}

/// Removes the namespaces of processes that were killed.
fn remove_left_behind() {
    let Ok(entries) = std::fs::read_dir(NAMED) else { return };
    for name in entries.filter_map(Result::ok).filter_map(|entry| entry.file_name().into_string().ok()) {
        let owner = name.strip_prefix("maes-").and_then(|rest| rest.split('-').next());
        if owner.is_some_and(|owner| !Path::new("/proc").join(owner).exists()) {
            drop(ip(&["netns", "delete", &name]));
        }
    }
}

fn ip(arguments: &[&str]) -> Result<(), NetworkError> {
    let command = || format!("ip {}", arguments.join(" "));
    let failed = |reason: String| NetworkError::Ip { command: command(), reason };
    let output = Command::new("ip").args(arguments).output().map_err(|error| failed(error.to_string()))?;
    let reason = || String::from_utf8_lossy(&output.stderr).trim().to_owned();
    if output.status.success() { Ok(()) } else { Err(failed(reason())) }
}

/// Forwards frames until it has to stop.
fn forward(devices: &[File], mut switch: Switch, stop: &AtomicBool, counts: &Mutex<Counts>) {
    let begun = now();
    let mut frame = [0; FRAME_MAX];
    while !stop.load(Ordering::Relaxed) {
        let until = switch.next_arrival().map_or(PERIOD, |due| due.saturating_sub(begun.elapsed()).min(PERIOD));
        let mut awaited: Vec<PollFd<'_>> =
            devices.iter().map(|device| PollFd::new(device.as_fd(), PollFlags::POLLIN)).collect();
        // An interrupted wait is one that has ended early.
        let _ = ppoll(&mut awaited, Some(TimeSpec::from_duration(until)), None);
        for (port, mut device) in devices.iter().enumerate() {
            while let Some(length) = read(&mut device, &mut frame) {
                switch.take(begun.elapsed(), port, &frame[..length]);
            }
        }
        while let Some((ports, frame)) = switch.arrived(begun.elapsed()) {
            for port in ports {
                // A device without room loses the frame.
                drop((&devices[port]).write(&frame));
            }
        }
        *counts.lock().unwrap_or_else(PoisonError::into_inner) = switch.counts();
    }
}

fn read(device: &mut &File, frame: &mut [u8]) -> Option<usize> {
    loop {
        match device.read(frame) {
            Ok(length) => return Some(length),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => return None,
        }
    }
}
