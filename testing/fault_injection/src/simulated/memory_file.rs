//! A recording in memory, which never fails.

use std::cell::RefCell;
use std::io;
use std::rc::Rc;

use recording::recorder::Store;

/// The content of a file; clones share it.
#[derive(Debug, Clone, Default)]
pub(super) struct MemoryFile(Rc<RefCell<Vec<u8>>>);

impl MemoryFile {
    pub(super) fn bytes(&self) -> Vec<u8> {
        self.0.borrow().clone()
    }
}

impl Store for MemoryFile {
    fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        let at = usize::try_from(at).map_err(|_too_large| io::ErrorKind::FileTooLarge)?;
        let mut content = self.0.borrow_mut();
        let end = at + bytes.len();
        if content.len() < end {
            content.resize(end, 0);
        }
        content[at..end].copy_from_slice(bytes);
        Ok(())
    }

    fn set_len(&self, length: u64) -> io::Result<()> {
        self.0.borrow_mut().truncate(usize::try_from(length).map_err(|_too_large| io::ErrorKind::FileTooLarge)?);
        Ok(())
    }

    fn sync(&self) -> io::Result<()> {
        Ok(())
    }
}
