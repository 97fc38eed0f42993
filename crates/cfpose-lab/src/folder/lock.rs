//! Locks of a run's folder: who may write what.
//!
//! * The lock of the folder (`cfpose.lock`) is held for the moments in which names in the folder change: a run claims its record
//!   file, a record file is sorted, tables are written. Who waits for it waits for seconds.
//! * The lock of a record file (`NAME.lock` beside it) is held by the one run that appends to it, for as long as it computes. It is
//!   taken and released under the lock of the folder.
//!
//! Reading needs no lock. The system releases the locks of a process that is killed. A file system without locks is used without.

use std::fs::{self, File, TryLockError};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use super::io_error;
use crate::error::LabError;

/// Name of the lock of a folder.
const FOLDER_LOCK: &str = "cfpose.lock";

/// The lock of a folder, released when it is dropped.
pub(crate) struct FolderLock {
    _file: File,
}

impl FolderLock {
    /// Wait for the lock.
    pub(crate) fn wait(folder: &Path) -> Result<Self, LabError> {
        let path = folder.join(FOLDER_LOCK);
        let file = open(&path)?;
        match file.lock() {
            Err(problem) if problem.kind() != ErrorKind::Unsupported => Err(io_error(&path, "lock")(problem)),
            _ => Ok(Self { _file: file }),
        }
    }
}

/// The lock of a record file.
pub(crate) struct FileLock {
    path: PathBuf,
    file: File,
}

impl FileLock {
    /// Take the lock of a record file; the caller holds the lock of the folder.
    ///
    /// # Errors
    /// [`LabError::Busy`] where another run has it.
    pub(crate) fn take(records: &Path) -> Result<Self, LabError> {
        let mut name = records.file_name().unwrap_or_default().to_os_string();
        name.push(".lock");
        let path = records.with_file_name(name);
        let mut file = open(&path)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                let mut process = String::new();
                let _ = file.read_to_string(&mut process);
                return Err(LabError::Busy { path: records.to_path_buf(), process: process.trim().to_string() });
            }
            Err(TryLockError::Error(problem)) if problem.kind() != ErrorKind::Unsupported => {
                return Err(io_error(&path, "lock")(problem));
            }
            _ => {}
        }
        // For the message of another run only.
        let _ = file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id()));
        Ok(Self { path, file })
    }

    /// Release the lock and remove its file; the caller holds the lock of the folder, so nobody waits with the old file open.
    pub(crate) fn release(self) {
        let _ = fs::remove_file(&self.path);
        drop(self.file);
    }
}

fn open(path: &Path) -> Result<File, LabError> {
    let mut options = File::options();
    options.create(true).truncate(false).read(true).write(true).open(path).map_err(io_error(path, "lock"))
}
