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

/// The name with the fewest edits from one that is not among them, if they are at most a third of its characters, or one: with more of
/// them another name is meant, or none.
pub fn nearest<'a>(names: impl IntoIterator<Item = &'a str>, given: &str) -> Option<&'a str> {
    let most = (given.chars().count() / 3).max(1);
    let measured = names.into_iter().map(|name| (edits(name, given), name));
    measured.filter(|(distance, _)| *distance <= most).min_by_key(|(distance, _)| *distance).map(|(_, name)| name)
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
        // Characters, not bytes.
        assert_eq!(nearest(["abc"], "äöü"), None);
    }
}
