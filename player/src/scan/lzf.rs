//! LZF, the compression of `binary_compressed` PCD files (Lehmann's liblzf format). Written here because the
//! maintained crates allocate what a file claims before they look at it.

use super::error::Problem;

/// A back reference of three bytes gives at most 264: no honest file expands more than this.
const MOST_EXPANSION: usize = 88;

/// Expands `packed` to exactly `size` bytes.
pub(super) fn expand(packed: &[u8], size: usize) -> Result<Vec<u8>, Problem> {
    if size > packed.len().saturating_mul(MOST_EXPANSION) {
        let problem = format!("{} compressed bytes cannot hold {size}: the header is wrong", packed.len());
        return Err(Problem::at("compressed data", problem));
    }
    let mut out = Vec::with_capacity(size);
    let mut at = 0;
    let broken =
        |at: usize| Problem::at(format!("byte {at} of the compressed data"), "damaged: write the scan again");
    let next = |at: &mut usize| {
        let byte = packed.get(*at).copied().map(usize::from).ok_or_else(|| broken(*at));
        *at += 1;
        byte
    };
    while at < packed.len() {
        let control = next(&mut at)?;
        if control < 32 {
            let literal = packed.get(at..at + control + 1).ok_or_else(|| broken(at))?;
            out.extend_from_slice(literal);
            at += control + 1;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += next(&mut at)?;
            }
            let back = (((control & 31) << 8) | next(&mut at)?) + 1;
            let from = out.len().checked_sub(back).ok_or_else(|| broken(at))?;
            // The copied bytes may overlap the ones being written: one at a time.
            for index in from..from + length + 2 {
                let byte = out.get(index).copied().ok_or_else(|| broken(at))?;
                out.push(byte);
            }
        }
        if out.len() > size {
            return Err(broken(at));
        }
    }
    if out.len() == size {
        return Ok(out);
    }
    let problem = format!("{} bytes came out, {size} were expected: the file is damaged", out.len());
    Err(Problem::at("compressed data", problem))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_and_overlapping_references() {
        // "abc", then 9 bytes from 3 back, then a long one.
        let packed = [2, b'a', b'b', b'c', 0b1110_0000, 0, 2];
        assert_eq!(expand(&packed, 12).unwrap(), b"abcabcabcabc");
    }

    #[test]
    fn damage_is_an_error() {
        for packed in [&[5, 1, 2][..], &[0b0010_0000, 7], &[0b1110_0000], &[0, 1, 0b0010_0000]] {
            assert!(expand(packed, 20).is_err(), "{packed:?}");
        }
        assert!(expand(&[0, 1], usize::MAX).is_err());
        assert!(expand(&[1, 1, 2], 1).is_err());
    }
}
