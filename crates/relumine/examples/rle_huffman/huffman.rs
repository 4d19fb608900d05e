//! A canonical Huffman code of bytes.

/// The longest code word: its length fits four bits of the table.
const LONGEST: u8 = 15;

/// Bytes of a table: four bits a symbol.
pub(crate) const TABLE_BYTES: u64 = 128;

/// How often each byte occurs.
pub(crate) type Histogram = [u64; 256];

/// Counts bytes.
pub(crate) fn count(bytes: &[u8], histogram: &mut Histogram) {
    for byte in bytes {
        histogram[usize::from(*byte)] += 1;
    }
}

/// A code: the length of each byte's word in bits; 0 for a byte that does not occur.
#[derive(Clone, Copy)]
pub(crate) struct Code {
    lengths: [u8; 256],
}

impl Code {
    /// The code for bytes as frequent as `histogram` says: Huffman's, with the differences of the frequencies halved until no
    /// word is too long.
    pub(crate) fn for_histogram(histogram: &Histogram) -> Self {
        let mut weights = *histogram;
        loop {
            let lengths = lengths(&weights);
            if lengths.iter().all(|length| *length <= LONGEST) {
                return Self { lengths };
            }
            weights.iter_mut().filter(|weight| **weight > 0).for_each(|weight| *weight = weight.div_ceil(2));
        }
    }

    /// Bits of bytes as frequent as `histogram` says.
    pub(crate) fn bits(&self, histogram: &Histogram) -> u64 {
        histogram.iter().zip(&self.lengths).map(|(count, length)| count * u64::from(*length)).sum()
    }

    /// Symbols by their words: the shorter first, equally long ones by value.
    fn ordered(&self) -> Vec<u8> {
        let mut symbols: Vec<u8> = (0..=255).filter(|symbol| self.lengths[usize::from(*symbol)] > 0).collect();
        symbols.sort_by_key(|symbol| self.lengths[usize::from(*symbol)]);
        symbols
    }

    /// The bits of `bytes`, the last byte filled up with zeros.
    ///
    /// # Panics
    /// If a byte has no word.
    pub(crate) fn encode(&self, bytes: &[u8]) -> Vec<u8> {
        let mut words = [0u32; 256];
        let (mut word, mut length) = (0, 0);
        for symbol in self.ordered() {
            let own = self.lengths[usize::from(symbol)];
            word <<= own - length;
            words[usize::from(symbol)] = word;
            (word, length) = (word + 1, own);
        }
        let mut out = Vec::new();
        let (mut pending, mut bits) = (0u64, 0);
        for byte in bytes {
            let length = self.lengths[usize::from(*byte)];
            assert!(length > 0, "byte {byte} has no word");
            pending = pending << length | u64::from(words[usize::from(*byte)]);
            bits += length;
            while bits >= 8 {
                bits -= 8;
                out.push((pending >> bits) as u8);
            }
        }
        if bits > 0 {
            out.push((pending << (8 - bits)) as u8);
        }
        out
    }

    /// The `length` bytes that `bits` stand for; `None` if they end too early or contain what is no word.
    pub(crate) fn decode(&self, bits: &[u8], length: usize) -> Option<Vec<u8>> {
        let ordered = self.ordered();
        let mut counts = [0u32; LONGEST as usize + 1];
        for symbol in &ordered {
            counts[usize::from(self.lengths[usize::from(*symbol)])] += 1;
        }
        let mut bits = bits.iter().flat_map(|byte| (0..8).rev().map(move |shift| u32::from(byte >> shift & 1)));
        let symbol = |bits: &mut dyn Iterator<Item = u32>| {
            // Words of one length are successive numbers, which begin where the shorter ones end.
            let (mut word, mut first, mut before) = (0, 0, 0);
            for count in &counts[1..] {
                word = word << 1 | bits.next()?;
                first <<= 1;
                if word < first + count {
                    return ordered.get((before + word - first) as usize).copied();
                }
                first += count;
                before += count;
            }
            None
        };
        (0..length).map(|_| symbol(&mut bits)).collect()
    }
}

/// The lengths of Huffman's words.
fn lengths(weights: &Histogram) -> [u8; 256] {
    let mut lengths = [0; 256];
    let mut leaves: Vec<(u64, u8)> =
        (0..=255).map(|symbol| (weights[usize::from(symbol)], symbol)).filter(|(weight, _)| *weight > 0).collect();
    if let [(_, only)] = leaves[..] {
        lengths[usize::from(only)] = 1;
        return lengths;
    }
    leaves.sort_unstable();
    // The lightest two trees are joined until one is left; joined trees come in order of their weight.
    let mut weights: Vec<u64> = leaves.iter().map(|(weight, _)| *weight).collect();
    let mut parents = vec![0; weights.len()];
    let (mut leaf, mut joined) = (0, leaves.len());
    for parent in leaves.len()..(2 * leaves.len()).saturating_sub(1) {
        let mut weight = 0;
        for _ in 0..2 {
            let take_leaf = leaf < leaves.len() && (joined == weights.len() || weights[leaf] <= weights[joined]);
            let lightest = if take_leaf { &mut leaf } else { &mut joined };
            weight += weights[*lightest];
            parents[*lightest] = parent;
            *lightest += 1;
        }
        weights.push(weight);
        parents.push(parent);
    }
    let mut depths = vec![0u8; parents.len()];
    for node in (0..parents.len().saturating_sub(1)).rev() {
        depths[node] = depths[parents[node]] + 1;
    }
    for ((_, symbol), depth) in leaves.iter().zip(depths) {
        lengths[usize::from(*symbol)] = depth;
    }
    lengths
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits_of(bytes: &[u8]) -> u64 {
        let mut histogram = [0; 256];
        count(bytes, &mut histogram);
        let code = Code::for_histogram(&histogram);
        let bits = code.bits(&histogram);
        let encoded = code.encode(bytes);
        assert_eq!(encoded.len() as u64, bits.div_ceil(8));
        assert_eq!(code.decode(&encoded, bytes.len()).as_deref(), Some(bytes));
        assert!(code.decode(&encoded[..encoded.len() / 2], bytes.len()).is_none() || bytes.len() < 2);
        bits
    }

    #[test]
    fn bytes_come_back_from_as_many_bits_as_were_counted() {
        assert_eq!(bits_of(&[]), 0);
        assert_eq!(bits_of(&[7; 20]), 20);
        assert_eq!(bits_of(b"abracadabra"), 23);
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(bits_of(&all), 256 * 8);
        let mut state = 1u32;
        let skewed: Vec<u8> = (0..20_000)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24).leading_zeros() as u8 * 3 + (state >> 8) as u8 % 3
            })
            .collect();
        let mut histogram = [0; 256];
        count(&skewed, &mut histogram);
        let entropy: f64 = histogram
            .iter()
            .filter(|count| **count > 0)
            .map(|count| -(*count as f64) * (*count as f64 / skewed.len() as f64).log2())
            .sum();
        let bits = bits_of(&skewed) as f64;
        assert!(bits >= entropy && bits < 1.05 * entropy, "{bits} bits, entropy {entropy}");
    }

    #[test]
    fn no_word_is_too_long() {
        let mut histogram = [0; 256];
        let (mut a, mut b) = (1u64, 1);
        for count in histogram.iter_mut().take(60) {
            *count = a;
            (a, b) = (b, a + b);
        }
        let code = Code::for_histogram(&histogram);
        assert_eq!(code.lengths.iter().max(), Some(&LONGEST));
        let space: u32 = code.lengths.iter().filter(|length| **length > 0).map(|length| 1 << (LONGEST - length)).sum();
        assert_eq!(space, 1 << LONGEST, "a full tree");
        let bytes: Vec<u8> = (0..60).collect();
        assert_eq!(code.decode(&code.encode(&bytes), 60), Some(bytes));
    }
}
