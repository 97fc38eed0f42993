//! Bytes of a file.

use std::io::Read;
use std::path::Path;

use crate::error::Fault;

/// The file name of standard input.
pub(crate) const STANDARD_INPUT: &str = "-";

/// Most bytes that are taken from a pipe, whose size is not known before (1 GiB).
const MOST_PIPED: u64 = 1 << 30;

/// Read a file, a pipe or standard input (`-`) whole: memory is then bounded by what is really there.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, Fault> {
    let bytes = match path.as_os_str() == STANDARD_INPUT {
        true => read_pipe(std::io::stdin().lock(), MOST_PIPED)?,
        false => {
            let kind = std::fs::metadata(path)?.file_type();
            match (kind.is_file(), is_pipe(&kind)) {
                (true, _) => std::fs::read(path)?,
                (false, true) => read_pipe(std::fs::File::open(path)?, MOST_PIPED)?,
                (false, false) => return Err(Fault::NotAFile),
            }
        }
    };
    if bytes.is_empty() { Err(Fault::Empty) } else { Ok(bytes) }
}

/// Say whether bytes of a path come from elsewhere than a regular file.
pub(crate) fn is_piped(path: &Path) -> bool {
    let pipe = |path: &Path| std::fs::metadata(path).is_ok_and(|data| is_pipe(&data.file_type()));
    path.as_os_str() == STANDARD_INPUT || pipe(path)
}

#[cfg(unix)]
fn is_pipe(kind: &std::fs::FileType) -> bool {
    use std::os::unix::fs::FileTypeExt;
    kind.is_fifo() || kind.is_socket()
}

#[cfg(not(unix))]
fn is_pipe(_kind: &std::fs::FileType) -> bool {
    false
}

fn read_pipe(pipe: impl Read, limit: u64) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    pipe.take(limit + 1).read_to_end(&mut bytes).map_err(Fault::Io)?;
    if bytes.len() as u64 > limit {
        let what = format!("a pipe of more than {limit} bytes");
        return Err(Fault::Unsupported { what, advice: "write it to a file" });
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pipe_without_end_is_refused() {
        let message = read_pipe(std::io::repeat(b'1'), 1 << 16).unwrap_err().to_string();
        assert_eq!(message, "a pipe of more than 65536 bytes is not supported; write it to a file");
        assert_eq!(read_pipe(&b"1 2"[..], 3).unwrap(), b"1 2");
    }
}
