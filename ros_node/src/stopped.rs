//! A process that was stopped for a while (SIGSTOP, or Ctrl-Z) and goes on.
//!
//! The middleware's threads wait in a system call that is interrupted then, whoever handles the signal, and they end at that: the
//! process would be deaf from then on, or never get as far as to have joined. So it ends, and says so.

use std::io;
use std::process;
use std::thread;

use signal_hook::consts::SIGCONT;
use signal_hook::iterator::Signals;

/// Exit code of a failure of the system.
const FAILED: i32 = 1;

/// Ends this process, with exit code 1, as soon as it goes on after it was stopped. To be called before the network is joined.
///
/// # Errors
/// If signals cannot be handled.
pub fn end_when_continued() -> io::Result<()> {
    let mut signals = Signals::new([SIGCONT])?;
    thread::spawn(move || {
        if signals.forever().next().is_some() {
            eprintln!(
                "error: this process was stopped for a while, which its connection does not survive; start it again \
                 (a recorded run goes on with --resume)"
            );
            process::exit(FAILED);
        }
    });
    Ok(())
}
