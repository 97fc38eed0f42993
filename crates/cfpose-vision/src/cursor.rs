//! Lines of a file whose text may end in binary data.

use std::borrow::Cow;

/// Walks through bytes line by line and gives up the rest.
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Lines<'a> {
    /// Start at the first byte, after a UTF-8 byte order mark if there is one.
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), line: 0 }
    }

    /// Return what follows the lines taken so far.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, Cow<'a, str>);

    /// Take one line without its end (`\n` or `\r\n`); bytes that are not UTF-8 become replacement characters.
    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|byte| *byte == b'\n');
        let line = &self.rest[..end.unwrap_or(self.rest.len())];
        self.rest = end.map_or(&[], |end| &self.rest[end + 1..]);
        self.line += 1;
        Some((self.line, String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_with_either_convention_and_leave_the_rest() {
        let mut lines = Lines::new(b"\xef\xbb\xbfone\r\n\ntwo\nbin\xff");
        let taken: Vec<String> = lines.by_ref().take(3).map(|(n, l)| format!("{n}:{l}")).collect();
        assert_eq!(taken, ["1:one", "2:", "3:two"]);
        assert_eq!(lines.rest(), b"bin\xff");
    }
}
