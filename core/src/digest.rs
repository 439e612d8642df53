//! A fast hash that is the same on every machine: of ellipsoids' inputs and of files' contents.

/// Two lanes of multiply, rotate and add, with the finaliser of MurmurHash3 (public domain): the same
/// on every machine and with every compiler version, unlike the standard library's hasher. Not cryptographic: it doesn't
/// withstand a deliberate search for collisions.
#[derive(Clone, Debug)]
pub struct Digest {
    lanes: [u64; 2],
    words: u64,
}

impl Default for Digest {
    fn default() -> Self {
        Self::new()
    }
}

impl Digest {
    /// The hash of nothing yet.
    pub fn new() -> Self {
        Self { lanes: [0x243f_6a88_85a3_08d3, 0x1319_8a2e_0370_7344], words: 0 }
    }

    /// Adds a number.
    pub fn add(&mut self, word: u64) {
        let [a, b] = &mut self.lanes;
        *a = (*a ^ word.wrapping_mul(0x87c3_7b91_1142_53d5)).rotate_left(27).wrapping_mul(5).wrapping_add(*b);
        *b = (*b ^ word.wrapping_mul(0x4cf5_ad43_2745_937f)).rotate_left(31).wrapping_mul(9).wrapping_add(*a);
        self.words += 1;
    }

    /// Adds bytes and their number.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.add(bytes.len() as u64);
        let (words, rest) = bytes.as_chunks::<8>();
        for word in words {
            self.add(u64::from_be_bytes(*word));
        }
        if !rest.is_empty() {
            self.add(rest.iter().fold(0, |word, &b| word << 8 | u64::from(b)));
        }
    }

    /// The 128 bits of everything added.
    pub fn finish(&self) -> [u64; 2] {
        let finalize = |mut v: u64| {
            v = (v ^ v >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
            v = (v ^ v >> 33).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
            v ^ v >> 33
        };
        let (a, b) = (self.lanes[0] ^ self.words, self.lanes[1] ^ self.words);
        let (a, b) = (a.wrapping_add(b), b.wrapping_add(a.rotate_left(32)));
        [finalize(a), finalize(b.wrapping_add(finalize(a)))]
    }
}
