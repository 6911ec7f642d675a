//! Results on stdout: a reader that has enough is no failure, a full disk behind it is one.

use std::io::{self, ErrorKind, Write};

/// Writes a result and a line break.
///
/// # Errors
/// If it cannot be written, unless nobody reads any more.
pub fn write_line(text: &str) -> io::Result<()> {
    write_to(&mut io::stdout().lock(), text.as_bytes(), b"\n")
}

/// Writes bytes as they are.
///
/// # Errors
/// As [`write_line`].
pub fn write(bytes: &[u8]) -> io::Result<()> {
    write_to(&mut io::stdout().lock(), bytes, b"")
}

fn write_to(out: &mut impl Write, bytes: &[u8], end: &[u8]) -> io::Result<()> {
    match out.write_all(bytes).and_then(|()| out.write_all(end)).and_then(|()| out.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Broken(ErrorKind);

    impl Write for Broken {
        fn write(&mut self, _bytes: &[u8]) -> io::Result<usize> {
            Err(self.0.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn only_a_reader_that_is_gone_is_no_failure() {
        assert!(write_to(&mut Broken(ErrorKind::BrokenPipe), b"a", b"").is_ok());
        assert!(write_to(&mut Broken(ErrorKind::StorageFull), b"a", b"").is_err());
        let mut out = Vec::new();
        write_to(&mut out, b"a", b"\n").unwrap();
        assert_eq!(out, b"a\n");
    }
}
