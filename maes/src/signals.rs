//! Signals that ask for the end of what is under way.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread;

use anyhow::Context;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use sim_server::exit;

/// Counts SIGINT, SIGTERM and SIGHUP from now on, instead of ending at the first one.
pub(crate) fn count() -> anyhow::Result<impl Fn() -> u32> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).context("handling signals")?;
    let count = Arc::new(AtomicU32::new(0));
    let counted = Arc::clone(&count);
    thread::spawn(move || signals.forever().for_each(|_| _ = counted.fetch_add(1, Ordering::Relaxed)));
    Ok(move || count.load(Ordering::Relaxed))
}

/// A flag that SIGINT and SIGTERM set; a second signal ends the process.
pub(crate) fn stop_flag() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, exit::BY_SIGNAL.into(), Arc::clone(&stop))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&stop)))
            .context("handling signals")?;
    }
    Ok(stop)
}
