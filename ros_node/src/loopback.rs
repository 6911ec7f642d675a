//! Confinement of the DDS sockets of this process to the loopback device.
//!
//! The DDS library binds its sockets to all addresses of the machine, also if it may only use
//! loopback, and sends to every address that a received packet names. Bound to the device `lo`
//! (SO_BINDTODEVICE), a socket receives nothing that was sent to another address of the machine,
//! and nothing that it sends leaves the machine. Linux allows that without privileges since 5.7.
//!
//! What it does not do: protect against processes on the same machine.

use std::fs;
use std::io;
use std::os::fd::{BorrowedFd, RawFd};

use nix::sys::socket::{AddressFamily, SockType, SockaddrLike, SockaddrStorage, getsockname};
use nix::sys::socket::{getsockopt, sockopt};

/// The loopback device of Linux.
#[cfg(target_os = "linux")]
const LOOPBACK: &str = "lo";

/// Binds every UDP socket of this process to the loopback device, and returns their number.
///
/// # Errors
/// If the system does not list the sockets, or refuses to bind one.
pub(crate) fn confine_sockets() -> io::Result<usize> {
    let mut confined = 0;
    for entry in fs::read_dir("/proc/self/fd")? {
        let entry = entry?;
        // A descriptor may be closed meanwhile: the one of this listing is.
        let Ok(target) = fs::read_link(entry.path()) else { continue };
        if !target.to_string_lossy().starts_with("socket:") {
            continue;
        }
        let Some(number) = entry.file_name().to_str().and_then(|name| name.parse::<RawFd>().ok()) else { continue };
        #[expect(unsafe_code, reason = "the DDS library keeps its sockets to itself")]
        // SAFETY: only system calls see the number, and they refuse one that is closed or no
        // socket.
        let socket = unsafe { BorrowedFd::borrow_raw(number) };
        if is_udp(&socket) {
            bind_to_loopback(&socket)?;
            confined += 1;
        }
    }
    Ok(confined)
}

#[cfg(target_os = "linux")]
fn bind_to_loopback(socket: &BorrowedFd<'_>) -> io::Result<()> {
    Ok(nix::sys::socket::setsockopt(socket, sockopt::BindToDevice, &std::ffi::OsString::from(LOOPBACK))?)
}

/// Other systems have no such option.
#[cfg(not(target_os = "linux"))]
fn bind_to_loopback(_socket: &BorrowedFd<'_>) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

fn is_udp(socket: &BorrowedFd<'_>) -> bool {
    use std::os::fd::AsRawFd;

    let is_internet =
        |address: &SockaddrStorage| matches!(address.family(), Some(AddressFamily::Inet | AddressFamily::Inet6));
    getsockopt(socket, sockopt::SockType) == Ok(SockType::Datagram)
        && getsockname::<SockaddrStorage>(socket.as_raw_fd()).as_ref().is_ok_and(is_internet)
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use super::*;

    /// The kernel distinguishes packets to another address of the machine from those to loopback,
    /// whoever sent them.
    #[test]
    fn confined_sockets_do_not_see_other_addresses() {
        let outside = UdpSocket::bind("0.0.0.0:0").unwrap();
        // Sends nothing: chooses the local address of the route.
        let has_route = outside.connect("192.0.2.77:9").is_ok();
        let other = outside.local_addr().unwrap().ip();
        let receiver = UdpSocket::bind("0.0.0.0:0").unwrap();
        let port = receiver.local_addr().unwrap().port();
        assert!(confine_sockets().unwrap() >= 2);
        assert_eq!(getsockopt(&receiver, sockopt::BindToDevice).unwrap(), "lo");

        let sender = UdpSocket::bind("0.0.0.0:0").unwrap();
        if has_route && !other.is_loopback() {
            sender.send_to(b"other", (other, port)).unwrap();
        } else {
            eprintln!("not tested: this machine has no address but those of loopback");
        }
        sender.send_to(b"loopback", ("127.0.0.1", port)).unwrap();
        let mut buffer = [0; 16];
        let length = receiver.recv(&mut buffer).unwrap();
        assert_eq!(&buffer[..length], b"loopback");
    }
}
