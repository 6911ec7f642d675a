//! Exit of a process that is continued after it was suspended (SIGSTOP, or Ctrl-Z), in a build with
//! the published DDS library.
//!
//! The threads of that library wait in a system call that SIGCONT interrupts, whatever handles the
//! signal, and they end at that: the process would receive nothing from then on, or never finish
//! joining. So it exits with an error message. With the fixes of `contrib/rustdds` (patch 0002)
//! they continue, and nothing is done here.

use std::io;
use std::process;
use std::thread;

use signal_hook::consts::SIGCONT;
use signal_hook::iterator::Signals;

/// Exit code of a system failure.
const FAILED: i32 = 1;

/// Exits this process with code 1 when it is continued after a suspension, unless the DDS library
/// survives that. Call it before joining the network.
///
/// # Errors
/// If the signal handler cannot be installed.
pub fn exit_on_continue() -> io::Result<()> {
    if crate::has_dds_fixes() {
        return Ok(());
    }
    let mut signals = Signals::new([SIGCONT])?;
    thread::spawn(move || {
        if signals.forever().next().is_some() {
            tracing::error!(
                "this process was stopped for a while and has lost its connection to the ROS network; start it again \
                 (--resume continues a recorded run)"
            );
            process::exit(FAILED);
        }
    });
    Ok(())
}
