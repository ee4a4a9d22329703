//! Compression by two references, as ATTILA's depth and colour caches have it: the upper bits of each code are those of the block's least or
//! greatest code, or one beside them towards the other; the lower bits are stored.

use super::PIXELS;

/// Lower bits that are stored, and the bytes that a block then takes: two bits a code choose the reference.
const LEVELS: [(u32, u32); 3] = [(5, 64), (13, 128), (21, 192)];

/// Bytes that a block of 64 codes of 32 bits takes, of those up to `most`; none if no level fits.
pub(super) fn bytes(codes: &[u32], most: u32) -> Option<u32> {
    if codes.len() != PIXELS {
        return None;
    }
    let (least, greatest) = codes.iter().fold((u32::MAX, 0), |(least, most), &code| (least.min(code), most.max(code)));
    let fits = |&&(stored, _): &&(u32, u32)| {
        let (low, high) = (least >> stored, greatest >> stored);
        codes.iter().all(|code| {
            let upper = code >> stored;
            upper - low <= 1 || high - upper <= 1
        })
    };
    LEVELS.iter().filter(|&&(_, bytes)| bytes <= most).find(fits).map(|&(_, bytes)| bytes)
}

#[cfg(test)]
mod tests {
    fn bytes(codes: &[u32]) -> Option<u32> {
        super::bytes(codes, 192)
    }

    #[test]
    fn a_block_takes_the_smallest_level_that_holds_its_codes() {
        assert_eq!(bytes(&[7; 64]), Some(64));
        // Two surfaces far from each other: each near its reference.
        let two: Vec<u32> = (0..64).map(|i| if i % 3 == 0 { 0x0100_0000 + i } else { 0x00ff_0000 - i }).collect();
        assert_eq!(bytes(&two), Some(64));
        // The same with a code a little further off, and with one halfway.
        let mut three = two.clone();
        three[9] = 0x00ff_1000;
        assert_eq!(bytes(&three), Some(128));
        three[9] = 0x00ff_8000;
        assert_eq!(bytes(&three), Some(192));
        assert_eq!(super::bytes(&three, 128), None, "no such level for colours");
        let spread: Vec<u32> = (0..64).map(|i| i << 26).collect();
        assert_eq!(bytes(&spread), None);
        assert_eq!(bytes(&[0; 128]), None, "codes of several words or samples");
    }
}
