//! Where the socket of a server is found, and who is at the other end of a connection.
//!
//! Invariant: both ends belong to the same user. The address is a name without a file (an abstract
//! one), so that a killed process leaves nothing; only Linux has those.

use std::io;
use std::os::unix::net::{UnixListener, UnixStream};

#[cfg(target_os = "linux")]
mod linux {
    use std::io;
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};

    use nix::sys::socket::{getsockopt, sockopt};
    use nix::unistd::geteuid;

    fn address(server: [u8; 16]) -> io::Result<SocketAddr> {
        let number: String = server.iter().map(|byte| format!("{byte:02x}")).collect();
        SocketAddr::from_abstract_name(format!("maes/{number}"))
    }

    pub(super) fn listen(server: [u8; 16]) -> io::Result<UnixListener> {
        UnixListener::bind_addr(&address(server)?)
    }

    pub(super) fn connect(server: [u8; 16]) -> io::Result<UnixStream> {
        UnixStream::connect_addr(&address(server)?)
    }

    pub(super) fn is_of_same_user(stream: &UnixStream) -> io::Result<bool> {
        Ok(getsockopt(stream, sockopt::PeerCredentials)?.uid() == geteuid().as_raw())
    }
}

#[cfg(not(target_os = "linux"))]
mod linux {
    use std::io::{self, ErrorKind};
    use std::os::unix::net::{UnixListener, UnixStream};

    fn unsupported() -> io::Error {
        io::Error::new(ErrorKind::Unsupported, "sockets without a file need Linux")
    }

    pub(super) fn listen(_: [u8; 16]) -> io::Result<UnixListener> {
        Err(unsupported())
    }

    pub(super) fn connect(_: [u8; 16]) -> io::Result<UnixStream> {
        Err(unsupported())
    }

    pub(super) fn is_of_same_user(_: &UnixStream) -> io::Result<bool> {
        Err(unsupported())
    }
}

/// The socket at which a server, known by its participant, expects the agents of its machine.
pub(super) fn listen(server: [u8; 16]) -> io::Result<UnixListener> {
    let listener = linux::listen(server)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

/// A connection to the socket of a server.
///
/// # Errors
/// If the server has none on this machine, or is of another user.
pub(super) fn connect(server: [u8; 16]) -> io::Result<UnixStream> {
    let stream = linux::connect(server)?;
    check(&stream)?;
    Ok(stream)
}

/// The next connection to a socket, if there is one.
pub(super) fn accept(listener: &UnixListener) -> io::Result<Option<UnixStream>> {
    match listener.accept() {
        Ok((stream, _)) => {
            check(&stream)?;
            Ok(Some(stream))
        }
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(None),
        Err(error) => Err(error),
    }
}

fn check(stream: &UnixStream) -> io::Result<()> {
    if linux::is_of_same_user(stream)? {
        Ok(())
    } else {
        Err(io::Error::new(io::ErrorKind::PermissionDenied, "the process at the other end is of another user"))
    }
}
