//! How far one name is from another, and which of some names is meant.

/// Characters to be put in, left out or changed to make one text of the other.
pub fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut corner = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let cost = if x == *y { corner } else { 1 + corner.min(row[j]).min(row[j + 1]) };
            corner = row[j + 1];
            row[j + 1] = cost;
        }
    }
    row[b.len()]
}

/// The name that is meant by one that is not among them: the shortest that begins with at least two given characters. Else the name with the
/// fewest edits, if they are at most a third of the given characters, or one: with more of them another name is meant, or none.
pub fn nearest<'a>(names: impl IntoIterator<Item = &'a str>, given: &str) -> Option<&'a str> {
    let length = given.chars().count();
    let measured = names.into_iter().filter_map(|name| {
        let (begins, distance) = (length >= 2 && name.starts_with(given), edits(name, given));
        (begins || distance <= (length / 3).max(1)).then_some((!begins, distance, name))
    });
    measured.min_by_key(|&(differs, distance, _)| (differs, distance)).map(|(.., name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_near_up_to_a_third_of_its_characters() {
        assert_eq!(nearest(["Init", "Submit"], "Submot"), Some("Submit"));
        assert_eq!(nearest(["Init", "Submit"], "Sabmot"), Some("Submit"));
        assert_eq!(nearest(["Init", "Submit"], "Sabmet"), Some("Submit"));
        assert_eq!(nearest(["Init", "Submit"], "Saymet"), None);
        assert_eq!(nearest(["Init"], "Explode"), None);
        // One edit is always few.
        assert_eq!(nearest(["id"], "ix"), Some("id"));
        assert_eq!(nearest([], "id"), None);
        // A name that is not complete is no other name.
        assert_eq!(nearest(["cone", "cache_lines", "cache"], "cac"), Some("cache"));
        assert_eq!(nearest(["texture.fifo", "texture.cache_lines"], "texture.cach"), Some("texture.cache_lines"));
        assert_eq!(nearest(["cache"], "c"), None);
        // Characters, not bytes.
        assert_eq!(nearest(["abc"], "äöü"), None);
    }
}
