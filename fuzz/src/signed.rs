//! Archives with a right checksum: the fuzzer shall get behind it.

use std::hash::Hasher as _;

use twox_hash::XxHash3_64;

/// The bytes whose last eight are the checksum of the rest, as of every archive.
pub(crate) fn signed(data: &[u8]) -> Vec<u8> {
    let mut bytes = data.to_vec();
    if let Some((rest, checksum)) = bytes.split_last_chunk_mut() {
        let mut hash = XxHash3_64::with_seed(0);
        hash.write(rest);
        *checksum = hash.finish().to_le_bytes();
    }
    bytes
}
