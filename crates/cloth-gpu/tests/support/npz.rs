//! Reads the arrays of a `.npz` file: a zip archive of `.npy` files.

use std::io::Read;

/// The bytes of one member's array, header skipped; None if there is no such member.
pub(crate) fn array(archive: &[u8], name: &str) -> Option<Vec<u8>> {
    let word = |at: usize| u32::from_le_bytes(archive[at..at + 4].try_into().unwrap()) as usize;
    let half = |at: usize| u16::from_le_bytes(archive[at..at + 2].try_into().unwrap()) as usize;
    // The end record is the last thing in the file: 22 bytes, as there is no comment.
    let end = archive.len() - 22;
    assert_eq!(&archive[end..end + 4], b"PK\x05\x06", "no zip archive");
    let mut at = word(end + 16);
    for _ in 0..half(end + 10) {
        let name_length = half(at + 28);
        if &archive[at + 46..at + 46 + name_length] == name.as_bytes() {
            let local = word(at + 42);
            let data = local + 30 + half(local + 26) + half(local + 28);
            let packed = &archive[data..data + word(at + 20)];
            let mut npy = vec![];
            match half(at + 10) {
                0 => npy.extend_from_slice(packed),
                _ => {
                    flate2::read::DeflateDecoder::new(packed).read_to_end(&mut npy).unwrap();
                }
            }
            let header = 10 + u16::from_le_bytes([npy[8], npy[9]]) as usize;
            return Some(npy.split_off(header));
        }
        at += 46 + name_length + half(at + 30) + half(at + 32);
    }
    None
}

/// Rows of three numbers.
pub(crate) fn rows<const N: usize, T>(bytes: &[u8], read: impl Fn([u8; N]) -> T) -> Vec<[T; 3]> {
    let value = |at: usize| read(bytes[at..at + N].try_into().unwrap());
    (0..bytes.len() / (3 * N)).map(|k| [0, 1, 2].map(|c| value((3 * k + c) * N))).collect()
}
