//! How many entries a zip archive says that it has, before its directory is read: readers make room for as many as are stated.

/// Bytes of the record at the end of an archive, without its comment.
const END: usize = 22;

/// Bytes of a comment at most.
const COMMENT_MAX: usize = u16::MAX as usize;

/// Bytes of the large record (zip64), as all writers make it, and of the locator between it and the end record.
const LARGE_END: usize = 56;
const LOCATOR: usize = 20;

/// The largest number of entries that a record at the end of the archive states. Which of several records counts is a matter of the
/// reader, so all are looked at.
///
/// # Errors
/// If a large record is not where its locator says, right before it: readers would search for it.
pub(super) fn most_entries(bytes: &[u8]) -> Result<u64, &'static str> {
    let from = bytes.len().saturating_sub(END + COMMENT_MAX);
    let mut most = 0;
    for (at, record) in bytes[from..].windows(END).enumerate() {
        if !record.starts_with(b"PK\x05\x06") {
            continue;
        }
        let at = from + at;
        most = most.max(u64::from(u16::from_le_bytes([record[10], record[11]])));
        let Some(locator) = at.checked_sub(LOCATOR).filter(|&start| bytes[start..].starts_with(b"PK\x06\x07")) else {
            continue;
        };
        let large = locator.checked_sub(LARGE_END).filter(|&start| {
            let size = number(bytes, start + 4);
            bytes[start..].starts_with(b"PK\x06\x06")
                && size == LARGE_END as u64 - 12
                && number(bytes, locator + 8) == start as u64
        });
        let large = large.ok_or("its large end record (zip64) is not where its locator says, right before it")?;
        most = most.max(number(bytes, large + 24)).max(number(bytes, large + 32));
    }
    Ok(most)
}

fn number(bytes: &[u8], at: usize) -> u64 {
    let mut eight = [0; 8];
    eight.copy_from_slice(&bytes[at..at + 8]);
    u64::from_le_bytes(eight)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn end(entries: u16) -> Vec<u8> {
        let mut record = b"PK\x05\x06\0\0\0\0".to_vec();
        record.extend([entries.to_le_bytes(), entries.to_le_bytes()].concat());
        record.resize(END, 0);
        record
    }

    fn large(at: u64, entries: u64) -> Vec<u8> {
        let mut record = b"PK\x06\x06".to_vec();
        record.extend(44u64.to_le_bytes());
        record.resize(24, 0);
        record.extend([entries.to_le_bytes(), entries.to_le_bytes()].concat());
        record.resize(LARGE_END, 0);
        record.extend(b"PK\x06\x07\0\0\0\0");
        record.extend(at.to_le_bytes());
        record.extend(1u32.to_le_bytes());
        record
    }

    #[test]
    fn the_largest_statement_counts() {
        assert_eq!(most_entries(b""), Ok(0));
        assert_eq!(most_entries(&end(7)), Ok(7));
        assert_eq!(most_entries(&[end(300), end(7)].concat()), Ok(300));
        let archive = [b"junk".to_vec(), large(4, 5_000_000), end(u16::MAX)].concat();
        assert_eq!(most_entries(&archive), Ok(5_000_000));
    }

    #[test]
    fn a_large_record_elsewhere_is_refused() {
        let archive = [large(0, 5_000_000), b"a gap".to_vec(), end(1)].concat();
        assert_eq!(most_entries(&archive), Ok(1), "nobody finds a locator that is not right before the end");
        let archive = [b"junk".to_vec(), large(0, 5_000_000), end(1)].concat();
        assert!(most_entries(&archive).is_err_and(|reason| reason.contains("zip64")));
        assert!(most_entries(&[b"PK\x06\x07".to_vec(), vec![0; 16], end(1)].concat()).is_err());
    }
}
