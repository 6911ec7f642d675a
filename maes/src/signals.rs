//! Requests to end what is under way: SIGINT, SIGTERM and SIGHUP; on Windows Ctrl-C, Ctrl-Break and
//! the closing of the window.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
#[cfg(feature = "ros")]
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;
#[cfg(unix)]
use std::thread;

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};
use sim_server::exit;

/// Calls a function at each request from now on, on another thread, instead of ending at the first
/// one. A process does this once.
pub(crate) fn each(mut requested: impl FnMut() + Send + 'static) -> anyhow::Result<()> {
    #[cfg(unix)]
    {
        let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, signal_hook::consts::SIGHUP])
            .context("handling signals")?;
        thread::spawn(move || signals.forever().for_each(|_| requested()));
    }
    #[cfg(windows)]
    ctrlc::set_handler(move || requested()).context("handling Ctrl-C")?;
    Ok(())
}

/// Counts requests from now on.
#[cfg(feature = "ros")]
pub(crate) fn count() -> anyhow::Result<impl Fn() -> u32> {
    let count = Arc::new(AtomicU32::new(0));
    let counted = Arc::clone(&count);
    each(move || _ = counted.fetch_add(1, Ordering::Relaxed))?;
    Ok(move || count.load(Ordering::Relaxed))
}

/// A function that waits for the first request from now on.
pub(crate) fn first() -> anyhow::Result<impl FnOnce()> {
    let (requested, requests) = channel();
    each(move || _ = requested.send(()))?;
    Ok(move || _ = requests.recv())
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
